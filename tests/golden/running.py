"""Run a case and give what it said and wrote, short enough to be kept and read."""

import io
import json
import re
import shlex
import struct
import sys
import tempfile
from collections.abc import Iterator
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any
from unittest import mock

from click.testing import CliRunner

from golden.cases import CASES
from warpspace.cli.main import cli, main
from warpspace.exceptions import WarpspaceError

HERE = Path(__file__).parent
KEPT = HERE / "kept"
REFUSALS = HERE / "refusals.txt"
"""Command lines that cannot be, each with the message it is refused with."""
INPUTS = HERE / "refused"
"""Files that cannot be used. Each text holds a command, the files it needs, the last of which is
the bad one, and below "=== name" what it holds, with the message of its refusal after ">>>"."""
READ = HERE / "read"
"""Files that are imported, in texts like those; below ">>>" what is said and the errors written."""
ROOT = Path(__file__).resolve().parents[2]
MOST_LINES, MOST_VALUES = 60, 12  # of a text or table, and of a list; the rest is counted
NUMBER = re.compile(r"(?<![\w.])[-+−]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


def run_case(name: str, out: Path) -> str:
    words = [word.replace("{out}", ".") for word in CASES[name].split()]
    with chdir(out):
        said = CliRunner(env={"COLUMNS": "80"}).invoke(cli, words)
    if isinstance(said.exception, WarpspaceError):
        lines = [f"refused: {said.exception}"]
    elif said.exception is not None and not isinstance(said.exception, SystemExit):
        raise said.exception
    else:
        lines = _short(_spelled(said.stdout or said.output), MOST_LINES)
    for path in sorted(out.iterdir()):
        lines += [f"--- {path.name}", *_file(path)]
    return "\n".join(line.replace(str(ROOT), "{root}").rstrip() for line in lines) + "\n"


def refusals() -> dict[str, str]:
    lines = REFUSALS.read_text("utf-8").splitlines()
    return {line[2:]: said for line, said in zip(lines[::2], lines[1::2], strict=True)}


def run_refused(line: str, folder: Path) -> tuple[int, str, str]:
    out, err = io.StringIO(), io.StringIO()
    words = mock.patch.object(sys, "argv", ["warpspace", *shlex.split(line)])
    status = 0
    with chdir(folder), redirect_stdout(out), redirect_stderr(err), words:
        try:
            main()
        except SystemExit as stop:
            status = int(stop.code or 0)
    said = " ".join(err.getvalue().split())
    return status, out.getvalue(), re.split(r"(?:^| )(?:warpspace|Error): ", said, maxsplit=1)[-1]


def input_cases(path: Path) -> Iterator[tuple[str, str, dict[str, str], str]]:
    head, *cases = path.read_text("utf-8").split("\n=== ")
    command, *texts = head.split("\n--- ")
    files = {name: text for name, _, text in (one.partition("\n") for one in texts)}
    for case in cases:
        name, _, rest = case.partition("\n")
        content, _, said = rest.rpartition(">>>")
        yield name, command.removeprefix("$ "), files | {[*files][-1]: content}, said.strip()


def run_input(command: str, files: dict[str, str], folder: Path) -> tuple[int, str, str]:
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    return run_refused(command, folder)


def run_read(command: str, files: dict[str, str], folder: Path) -> str:
    status, printed, said = run_input(command, files, folder)
    if status:
        raise ValueError(said)
    if (folder / "new.toml").exists():
        scene = (folder / "new.toml").read_text("utf-8")
        printed += re.split(r"^(?=\[machine|\[errors)", scene, maxsplit=1, flags=re.MULTILINE)[-1]
    return printed.partition("[view]")[0].strip()


def keep_inputs(path: Path) -> None:
    head = path.read_text("utf-8").split("\n=== ")[0]
    parts = [head]
    for name, command, files, _ in input_cases(path):
        with tempfile.TemporaryDirectory() as folder:
            if path.parent == READ:
                said = run_read(command, files, Path(folder))
            else:
                said = run_input(command, files, Path(folder))[2]
        parts.append(f"{name}\n{[*files.values()][-1]}>>> {said}")
    path.write_text("\n=== ".join(parts) + "\n", encoding="utf-8")


def _spelled(text: str) -> list[str]:
    try:
        return list(_leaves(json.loads(text), ""))
    except ValueError:
        return text.splitlines()


def _leaves(value: Any, path: str) -> Any:
    if isinstance(value, dict):
        for key, part in value.items():
            yield from _leaves(part, f"{path}.{key}")
    elif isinstance(value, list) and any(isinstance(part, dict | list) for part in value):
        for index, part in enumerate(value):
            yield from _leaves(part, f"{path}[{index}]")
    else:
        is_long = isinstance(value, list) and len(value) > MOST_VALUES
        shown = value[:: len(value) // MOST_VALUES] if is_long else value
        count = f" of {len(value)}" if is_long else ""
        yield f"{path} = {json.dumps(shown, ensure_ascii=False)}{count}"


def _short(lines: list[str], most: int) -> list[str]:
    if len(lines) <= most:
        return lines
    step = -(-len(lines) // most)
    return [*lines[::step], f"({len(lines)} lines)"]


def _file(path: Path) -> list[str]:
    if path.suffix == ".glb":
        content = path.read_bytes()
        (length,) = struct.unpack_from("<I", content, 12)
        scene = json.loads(content[20 : 20 + length])
        counts = {key: len(part) for key, part in scene.items() if isinstance(part, list)}
        return [f"{key} = {count}" for key, count in sorted(counts.items())]
    if path.suffix == ".vts":
        head = path.read_bytes().split(b"<AppendedData")[0].decode("utf-8", "replace")
        return re.findall(r"<(?:DataArray|StructuredGrid)[^>]*>", head)
    text = path.read_text("utf-8")
    if path.suffix == ".html":
        text = re.sub(r"<(script|style|svg).*?</\1>|<[^>]+>", "\n", text, flags=re.DOTALL)
        text = re.sub(r"data:[^\"']{60,}", "", text)
        text = re.sub(r"\d{4}-\d\d-\d\d \d\d:\d\d UTC", "DATE", text)
        return _short([line.strip() for line in text.splitlines() if line.strip()], MOST_LINES)
    return _short(text.splitlines(), MOST_LINES)


def differences(kept: str, now: str) -> list[str]:
    """Say where two outcomes differ; numbers may by one millionth, or by their last digit."""
    found: list[str] = []
    before, after = kept.splitlines(), now.splitlines()
    if len(before) != len(after):
        found.append(f"{len(before)} lines, now {len(after)}")
    for number, (old, new) in enumerate(zip(before, after, strict=False), 1):
        if old == new:
            continue
        numbers = NUMBER.findall(old), NUMBER.findall(new)
        words = " ".join(NUMBER.sub("#", old).split()), " ".join(NUMBER.sub("#", new).split())
        alike = len(numbers[0]) == len(numbers[1]) and all(map(_alike, *numbers))
        if words[0] != words[1] or not alike:
            found.append(f"line {number}: {old!r}, now {new!r}")
    return found


def _alike(old: str, new: str) -> bool:
    first, second = (float(text.replace("−", "-")) for text in (old, new))
    powers = "e" in (old + new).lower()
    digits = 9 if powers else max(len(text.partition(".")[2]) for text in (old, new))
    return abs(first - second) <= max(1.001 * 10.0 ** -min(digits, 9), 1e-6 * abs(first))
