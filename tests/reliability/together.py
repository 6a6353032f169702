"""Files changed by many processes at once, and files written together: no update lost, no mix."""

import os
import random
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from reliability.outcome import Outcome, run_module

AT_ONCE = 8
LONGEST_S = 4.0
MIXED = "is not the matrix of this scene"


def run(row: str, count: int) -> Outcome:
    with tempfile.TemporaryDirectory() as folder:
        last, faults = run_module("together", row, str(count), folder)
        return Outcome(count if last else 0, last, faults)


def _fork(work: Callable[[], None]) -> int:
    child = os.fork()
    if child == 0:
        status = 1
        with suppress(BaseException):
            work()
            status = 0
        os._exit(status)
    return child


def _hidden(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir() if path.name.startswith(".")]


def _updates(count: int, folder: Path) -> None:
    """Add notes, eight processes at once; one of them is killed in every other round."""
    from warpspace.cli import main
    from warpspace.scene.library import load_scene, scene_path

    chance, path, stored, killed = random.Random(14), folder / "x.toml", 0, 0
    whole = scene_path("dvf5000_first").read_bytes()
    for first in range(0, count, AT_ONCE):
        path.write_bytes(whole)

        def add(text: str) -> None:
            sys.argv = ["warpspace", "notes", str(path), "--add", text]
            with Path(os.devnull).open("w", encoding="utf-8") as quiet:
                os.dup2(quiet.fileno(), 1)
                os.dup2(quiet.fileno(), 2)
                main()

        texts = [f"note {number}" for number in range(first, min(first + AT_ONCE, count))]
        children = {text: _fork(lambda text=text: add(text)) for text in texts}
        if chance.random() < 0.5:
            time.sleep(chance.uniform(0.0, LONGEST_S))
            with suppress(ProcessLookupError):
                os.kill(children[chance.choice(texts)], signal.SIGKILL)
        ends = {text: os.waitpid(child, 0)[1] for text, child in children.items()}
        killed += sum(os.WIFSIGNALED(status) for status in ends.values())
        notes = {note.text for note in load_scene(path).review}
        stored += len(notes)
        for text, status in ends.items():
            if status == 0 and text not in notes:
                print(f"fault {text} was reported as added and is not stored")
            elif status and not os.WIFSIGNALED(status):
                print(f"fault {text} was not added")
    print(f"{stored} notes stored by {AT_ONCE} processes at once, {killed} of them killed")


def _contents(number: int) -> dict[str, dict[str, bytes]]:
    """Build the files of two outputs: a scene with its covariance, and tables of a control."""
    import numpy as np

    from warpspace.machine.errors import Covariance
    from warpspace.scene.library import load_scene
    from warpspace.scene.scene_writer import scene_files

    scene = load_scene("dvf5000_first")
    keys = scene.parameter_keys[:31]
    rows = tuple(map(tuple, ((1.0 + number) * np.eye(len(keys))).tolist()))
    files: Mapping[str, Any] = scene_files(
        replace(scene, title=f"calibration {number}", covariance=Covariance(keys, rows)), "x"
    )
    tables = {f"t_{axis}.comp": f"table {number} of {axis}\n".encode() * 500 for axis in "XYZ"}
    return {"scene": {"x.npz": files[".npz"], "x.toml": files[""].encode()}, "tables": tables}


def _sets(count: int, folder: Path) -> None:
    """Write sets of files, ended or refused room at any moment, most between two renames."""
    from warpspace.cli.shared_options import write_texts
    from warpspace.exceptions import SceneError
    from warpspace.scene.library import load_scene

    chance, contents = random.Random(14), [_contents(0), _contents(1)]
    rename, between, refused, full = Path.replace, 0, 0, 0

    def write(name: str, number: int) -> None:
        write_texts({folder / file: text for file, text in contents[number][name].items()},
                    force=True)  # fmt: skip

    for attempt in range(count):
        name, number = chance.choice(["scene", "tables"]), attempt % 2
        write(name, 1 - number)
        files = contents[number][name]
        renames, kind = chance.randrange(len(files) + 1), chance.choice(["kill", "between", "full"])

        def act(name: str = name, number: int = number, renames: int = renames, kind: str = kind):
            count = 0

            def move(path: Path, target: Path) -> Path:
                nonlocal count
                count += 1
                if count == renames + 1 and kind == "between":
                    os.kill(os.getpid(), signal.SIGKILL)
                if count == renames + 1 and kind == "full":
                    raise OSError(28, "No space left on device")
                return rename(path, target)

            Path.replace = move
            write(name, number)

        child = _fork(act)
        if kind == "kill":
            time.sleep(chance.uniform(0.0, 0.03))
            os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        full += kind == "full" and renames < len(files)
        state = [
            "old" if now == contents[1 - number][name][file] else "new" if now == text else "piece"
            for file, text in files.items()
            for now in [(folder / file).read_bytes()]
        ]
        mixed = len({*state}) > 1
        between += mixed
        if "piece" in state or (kind == "full" and mixed):
            print(f"fault {name}: {state} after {kind} at rename {renames}")
        if name == "scene":
            try:
                load_scene(folder / "x.toml")
                if mixed:
                    print(f"fault a scene with another covariance was read after {kind}")
            except SceneError as error:
                refused += 1
                if not mixed or MIXED not in str(error):
                    print(f"fault {name}: {error}")
        write(name, number)
        if left := _hidden(folder):
            print(f"fault the next run left {left}")
    print(
        f"each file old or new; {full} full disks left the whole set old, {between} kills hit"
        f" between two renames, each scene of these ({refused}) refused with its matrix by name"
    )


if __name__ == "__main__":
    {"updates": _updates, "sets": _sets}[sys.argv[1]](int(sys.argv[2]), Path(sys.argv[3]))
