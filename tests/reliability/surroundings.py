"""Commands in places they do not expect: no room, no home, no folder, odd languages and names."""

import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from reliability.outcome import Outcome

COMMANDS: tuple[tuple[tuple[str, ...], str], ...] = (
    (("field", "dvf5000_first", "--grid", "21", "--csv"), "x.csv"),
    (("export", "dvf5000_first", "-o"), "x.vts"),
    (("export", "dvf5000_first", "-o"), "x.glb"),
    (("export", "dvf5000_first", "-o"), "x.html"),
    (("montecarlo", "dvf5000_general", "--samples", "9000", "-o"), "x.parquet"),
    (
        (
            *("montecarlo", "dvf5000_general", "--rows", "--samples", "900"),
            *("--tolerance", "EAX=1:9:3", "-o"),
        ),
        "x.csv",
    ),
    (("gains", "dvf5000_first", "--plot"), "x.svg"),
    (("draw", "dvf5000_first", "--size", "400x300", "-o"), "x.png"),
    (("report", "dvf5000_first", "-o"), "x.html"),
    (("new-machine", "wCBFXYZt", "-o"), "x.toml"),
)
FILE_LIMIT = 300
"""Bytes of a file where the disk is full: less than any output has."""
PATIENCE_S = 1200.0
"""By the clock, and long: on a busy machine a report takes minutes."""
Start = Callable[[], None]


@dataclass(frozen=True)
class Place:
    name: str
    environment: Mapping[str, str] = field(default_factory=dict)
    start: Start | None = None
    folder: str = "here"
    works: bool = True


def _no_room() -> None:
    import signal

    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (FILE_LIMIT, FILE_LIMIT))


def _no_folder() -> None:
    import shutil

    shutil.rmtree(Path.cwd())


READ_ONLY = "/proc/self"
"""A folder nobody can write into, root included."""
PLACES: tuple[Place, ...] = (
    Place("full disk", start=_no_room, works=False),
    Place("read-only home", {"HOME": READ_ONLY, "XDG_CACHE_HOME": f"{READ_ONLY}/c"}),
    Place("no home", {"HOME": "", "XDG_CACHE_HOME": "", "XDG_CONFIG_HOME": "", "USER": ""}),
    Place("home is a file", {"HOME": "/dev/null"}),
    Place("folder deleted", start=_no_folder, works=False),
    Place("locale C", {"LC_ALL": "C", "LANG": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}),
    Place("locale unknown", {"LC_ALL": "xx_YY.nonsense", "LANG": "xx"}),
    Place("locale de", {"LC_ALL": "de_DE.UTF-8", "LANGUAGE": "de"}),
    Place("locale tr", {"LC_ALL": "tr_TR.UTF-8"}),
    Place("ASCII output", {"PYTHONIOENCODING": "ascii"}),
    Place("blanks and quotes", folder="a b 'c' \"d\" $e;f"),
    Place("other scripts", folder="größe_机器_حجم"),
    Place("line break", folder="one\ntwo"),
    Place("leading dash", folder="-o"),
    Place("long name", folder="l" * 200),
    Place("narrow terminal", {"COLUMNS": "1", "TERM": "dumb"}),
)


def run(count: int) -> Outcome:
    pairs = [(place, command) for command in COMMANDS for place in PLACES]
    tried = [(number * 7) % len(pairs) for number in range(count)]
    faults = [fault for at in tried for fault in _try(pairs[at][0], *pairs[at][1])]
    places = {at % len(PLACES) for at in tried}
    commands = {at // len(PLACES) for at in tried}
    return Outcome(
        count,
        f"{len(places)} surroundings and {len(commands)} writing commands, {len({*tried})} of"
        f" {len(pairs)} combinations, two instances each time: done, or one message, exit 2 and"
        " nothing half-written",
        faults,
    )


def _try(place: Place, command: Sequence[str], target: str) -> list[str]:
    with tempfile.TemporaryDirectory() as root:
        folder = Path(root) / place.folder
        folder.mkdir()
        given = os.environ.get("PYTHONPATH", "").split(os.pathsep)  # Python refuses a relative one
        found = os.pathsep.join(str(Path(path).resolve()) for path in given if path)
        own = {"MPLCONFIGDIR": "", "PYTHONPATH": found}
        environment = {**os.environ, **own, **place.environment}
        environment = {name: value for name, value in environment.items() if value}
        line = [sys.executable, "-m", "warpspace", *command, target, "--force"]
        processes = [
            subprocess.Popen(
                line, cwd=folder, env=environment, preexec_fn=place.start,  # noqa: PLW1509 - no thread here
                stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            )
            for _ in range(1 if place.start is _no_folder else 2)
        ]  # fmt: skip
        faults: list[str] = []
        for process in processes:
            try:
                _, said = process.communicate(timeout=PATIENCE_S)
            except subprocess.TimeoutExpired:
                process.kill()
                _, said = process.communicate()
                faults.append("has not ended")
            faults += _judge(place, process.returncode, said.decode("utf-8", "replace"))
        if folder.exists():
            there = sorted(path.name for path in folder.iterdir())
            allowed = [[target]] if place.works else [[], [target]]
            if there not in allowed:
                faults.append(f"leaves {there}")
        name = f"{place.name}: {command[0]} → {target}"
        return [f"{name}: {fault}" for fault in dict.fromkeys(faults)]


def _judge(place: Place, status: int, said: str) -> list[str]:
    faults: list[str] = []
    if "Traceback" in said:
        faults.append(f"traceback: {said[-400:]}")
    if place.works and status != 0:
        faults.append(f"exit {status}: {said[-400:]}")
    if not place.works and status != 2:
        faults.append(f"exit {status} in place of 2: {said[-400:]}")
    if not place.works and said.count("warpspace: ") != 1:
        faults.append(f"not one message: {said[-400:]}")
    return faults
