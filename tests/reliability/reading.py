"""Reads files in a watched process: no traceback, no hang, no more memory than there may be."""

import json
import os
import random
import re
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from reliability.outcome import Outcome

LONGEST_S = 1.0
LARGEST_MB = 500.0
SILENT_S = 180.0
HERE = Path(__file__).resolve().parents[1]
PORTION = 5000
"""Files that one process reads, so that what it keeps is not counted for ever."""

NOTHING = {"by_format": {}, "read": {}, "slowest_s": 0.0, "most_mb": 0.0, "faults": []}
_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_INTERESTING = b'\0\1\x7f\x80\xff\n"[{'
_RUNS = (b"\xff" * 4, b"\0" * 4, b"\x7f\xff\xff\xff", b"\0\0\x80\x7f")
LARGEST = 200_000


def mutate(seeds: Sequence[bytes], words: Sequence[bytes], chance: random.Random) -> bytes:
    content = bytearray(chance.choice(seeds))
    for _ in range(chance.choice((1, 1, 1, 2, 3, 5, 8))):
        _change(content, seeds, words, chance)
    return bytes(content[:LARGEST])


def _change(
    content: bytearray, seeds: Sequence[bytes], words: Sequence[bytes], chance: random.Random
) -> None:
    at, length = chance.randrange(len(content) + 1), chance.choice((1, 2, 4, 16, 64, 512))
    match chance.randrange(9 if words else 6):
        case 0 if content:
            content[at % len(content)] ^= 1 << chance.randrange(8)
        case 1 if content:
            content[at % len(content)] = chance.choice(_INTERESTING)
        case 2:
            del content[at : at + length]
        case 3:
            content[at:at] = content[at : at + length] * chance.choice((1, 2, 50))
        case 4:
            other = chance.choice(seeds)
            begin = chance.randrange(len(other) + 1)
            content[at : at + length] = other[begin : begin + length]
        case 5:
            content[at : at + 4] = chance.choice((*_RUNS, chance.randbytes(4)))
        case 6:
            content[at:at] = chance.choice(words)
        case 7 if found := list(_NUMBER.finditer(bytes(content))):
            number = chance.choice(found)
            content[number.start() : number.end()] = chance.choice(
                (
                    f"{chance.uniform(-1e6, 1e6)}".encode(),
                    f"{10.0 ** chance.uniform(-330, 308):e}".encode(),
                    f"{chance.randrange(-(10**20), 10**20)}".encode(),
                    chance.choice(words),
                )
            )
        case _:
            lines = bytes(content).split(b"\n")
            lines.insert(chance.randrange(len(lines) + 1), chance.choice(lines))
            content[:] = b"\n".join(lines)


def read_many(way: str, count: int, seed: int) -> Outcome:
    total, good = Counter[str](), Counter[str]()
    slowest, most_mb = 0.0, 0.0
    faults: list[str] = []
    while (done := sum(total.values())) < count:
        portion = min(PORTION, count - done)
        found = _watch([way, str(portion), str(seed + done)])
        total.update(found["by_format"])
        good.update(found["read"])
        slowest, most_mb = max(slowest, found["slowest_s"]), max(most_mb, found["most_mb"])
        faults += found["faults"]
        if sum(total.values()) < done + portion:  # its process has ended in the midst
            break
    spelt = ", ".join(
        f"{name} {100.0 * good[name] / number:.0f} % of {number:,}"
        for name, number in sorted(total.items())
    )
    result = (
        f"slowest {slowest:.2f} s of CPU, at most {most_mb:.0f} MB (could be read all the same:"
        f" {spelt})"
    )
    return Outcome(sum(total.values()), result, faults)


def _watch(given: list[str]) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        log, state, current = (folder / name for name in ("log", "state.json", "current"))
        with log.open("w") as stream:
            command = [sys.executable, "-m", "reliability.reading", *given, place]
            process = subprocess.Popen(command, cwd=HERE, stdout=stream, stderr=subprocess.STDOUT)
        last, seen = time.monotonic(), 0
        while process.poll() is None:
            time.sleep(0.1)
            now = state.stat().st_mtime_ns if state.exists() else 0
            if now != seen:
                seen, last = now, time.monotonic()
            if time.monotonic() - last > SILENT_S:
                process.kill()
                process.wait()
        found = json.loads(state.read_text() if state.exists() else json.dumps(NOTHING))
        if not found.get("ended"):
            said = log.read_text(errors="replace")[-2000:]
            name, _, content = (current.read_bytes() if current.exists() else b"").partition(b"\n")
            kept = keep(name.decode(), content)
            found["faults"].append(f"the reader ended with {process.returncode}: {kept} {said}")
        return found


def keep(name: str, content: bytes) -> Path:
    handle, path = tempfile.mkstemp(prefix=f"warpspace-fault-{name.replace(' ', '-')}-")
    os.write(handle, content)
    os.close(handle)
    return Path(path)


class Reader:
    def __init__(self, folder: Path) -> None:
        from reliability.formats import EVERY

        self.folder, self._formats = folder, {each.name: each for each in EVERY}
        self.by_format: Counter[str] = Counter()
        self.good: Counter[str] = Counter()
        self.slowest_s, self.faults, self._said = 0.0, [], time.monotonic()
        self._largest_mb = max(LARGEST_MB, self.most_mb + LARGEST_MB / 2.0)
        warnings.simplefilter("error")

    def read(self, name: str, content: bytes) -> None:
        from warpspace.exceptions import WarpspaceError

        (self.folder / "current").write_bytes(name.encode() + b"\n" + content)
        began = time.process_time()
        try:
            self._formats[name].read(content, self.folder)
            self.good[name] += 1
        except WarpspaceError as error:
            if len(str(error)) > 20_000:
                self._fault(name, content, f"a message of {len(str(error)):,} characters")
        except Exception as error:  # noqa: BLE001 - that is what is looked for
            self._fault(name, content, f"{type(error).__name__}: {error}"[:300])
        spent = time.process_time() - began
        self.slowest_s = max(self.slowest_s, spent)
        if spent > LONGEST_S * self._formats[name].longest_s:
            self._fault(name, content, f"{spent:.1f} s of CPU")
        self.by_format[name] += 1
        if time.monotonic() - self._said > 1.0:
            self.say()
        if self.most_mb > self._largest_mb:
            self._fault(name, content, f"{self.most_mb:.0f} MB")
            self.say(ended=True)
            raise SystemExit(0)

    @property
    def most_mb(self) -> float:
        status = Path("/proc/self/status").read_text()
        return float(status.partition("VmHWM:")[2].split()[0]) / 1024.0

    def say(self, *, ended: bool = False) -> None:
        self._said = time.monotonic()
        said = NOTHING | {"by_format": self.by_format, "read": self.good, "ended": ended}
        said |= {"slowest_s": self.slowest_s, "most_mb": self.most_mb, "faults": self.faults[:20]}
        path = self.folder / "state.new"
        path.write_text(json.dumps(said))
        path.replace(self.folder / "state.json")

    def _fault(self, name: str, content: bytes, what: str) -> None:
        self.faults.append(f"{name}: {what} ({keep(name, content)})")


def _read_bytes(reader: Reader, count: int, seed: int, only: str = "") -> None:
    from reliability.formats import EVERY, FORMATS, WORDS

    chance = random.Random(seed)
    formats = [each for each in EVERY if each.name == only] or FORMATS
    seeds = {each.name: each.seeds() for each in formats}
    shares = [each.share for each in formats]
    for each in formats:  # what is imported then is no time of a changed file
        each.read(seeds[each.name][0], reader.folder)
    for _ in range(count):
        (each,) = chance.choices(formats, shares)
        words = [*WORDS, *each.words * 3] if each.text else []
        reader.read(each.name, mutate(seeds[each.name], words, chance))


def _read_hypothesis(reader: Reader, count: int, seed: int) -> None:
    from hypothesis import HealthCheck, Phase, given, settings
    from hypothesis import seed as seeded
    from hypothesis import strategies as st

    from random_scenes import scene_texts
    from reliability.formats import WORDS

    def read(text: str, number: int) -> None:
        if sum(reader.by_format.values()) < count:
            content = text.encode()
            if number % 4:
                content = mutate([content], WORDS, random.Random(number))
            reader.read("scene", content)

    while (done := sum(reader.by_format.values())) < count:
        chosen = settings(
            max_examples=count - done, database=None, deadline=None, phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        )  # fmt: skip
        seeded(seed + done)(chosen(given(scene_texts(), st.integers(0, 2**32))(read)))()


if __name__ == "__main__":  # way, count, seed, and the folder for files and for what is said
    reader = Reader(Path(sys.argv[4]))
    reader.say()
    run = {"bytes": _read_bytes, "hypothesis": _read_hypothesis}
    run["programs"] = partial(_read_bytes, only="program")
    run[sys.argv[1]](reader, int(sys.argv[2]), int(sys.argv[3]))
    reader.say(ended=True)
