"""Reads files in a watched process: no traceback, no hang, no more memory than there may be.

Time is that of the processor, so that a busy machine does not look like a hang; a file that takes
a minute of the clock all the same is one, too.
"""

import argparse
import json
import os
import random
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path

from reliability.mutate import mutate
from reliability.row import Outcome

LONGEST_S = 1.0
LARGEST_MB = 500.0
SILENT_S = 60.0
HERE = Path(__file__).resolve().parents[1]
PORTION = 5000
"""Files that one process reads, so that what it keeps is not counted for ever."""
WAYS = ("bytes", "hypothesis", "atheris")


def read_many(way: str, count: int, seed: int) -> Outcome:
    """Read so many changed files, in processes of their own; give what came of it."""
    total, good, done = Counter[str](), Counter[str](), 0
    slowest, most_mb = 0.0, 0.0
    faults: list[str] = []
    while done < count:
        portion = min(PORTION, count - done)
        command = [sys.executable, "-m", "reliability.reading", way, str(portion), str(seed + done)]
        found = _watch(command)
        total.update(found["by_format"])
        good.update(found["read"])
        slowest = max(slowest, float(found["slowest_s"]))
        most_mb = max(most_mb, float(found["most_mb"]))
        faults += found["faults"]
        read = sum(found["by_format"].values())
        done += read
        if read < portion:  # its process has ended in the midst
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


def _watch(command: list[str]) -> dict[str, object]:  # pyright: ignore[reportReturnType]
    """Run a reader; end it where it says nothing for long."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log"
        with log.open("w") as stream:
            process = subprocess.Popen(
                [*command, folder], cwd=HERE, stdout=stream, stderr=subprocess.STDOUT
            )
        state = Path(folder) / "state.json"
        last = time.monotonic()
        seen = 0
        while process.poll() is None:
            time.sleep(0.1)
            now = state.stat().st_mtime_ns if state.exists() else 0
            if now != seen:
                seen, last = now, time.monotonic()
            if time.monotonic() - last > SILENT_S:
                process.kill()
                process.wait()
        found = (
            json.loads(state.read_text())
            if state.exists()
            else {"by_format": {}, "read": {}, "slowest_s": 0.0, "most_mb": 0.0, "faults": []}
        )
        if not found.get("ended"):
            said = log.read_text(errors="replace")[-2000:]
            current = Path(folder) / "current"
            name, _, content = (current.read_bytes() if current.exists() else b"").partition(b"\n")
            kept = keep(name.decode(), content)
            found["faults"].append(f"the reader ended with {process.returncode}: {kept} {said}")
        return found


def keep(name: str, content: bytes) -> Path:
    """Keep a file that shows a fault."""
    handle, path = tempfile.mkstemp(prefix=f"warpspace-fault-{name.replace(' ', '-')}-")
    os.write(handle, content)
    os.close(handle)
    return Path(path)


class Reader:
    """Reads files and keeps count of what went wrong.

    A process of its own may have 500 MB; one that is larger from the start, as a test's is, 250 MB
    more than it has.
    """

    def __init__(self, folder: Path) -> None:
        from reliability.formats import FORMATS

        self._folder, self._formats = folder, {each.name: each for each in FORMATS}
        self.by_format: Counter[str] = Counter()
        self.good: Counter[str] = Counter()
        self.slowest_s, self.faults, self._said = 0.0, [], time.monotonic()
        self._largest_mb = max(LARGEST_MB, self.most_mb + LARGEST_MB / 2.0)
        warnings.simplefilter("error")

    def read(self, name: str, content: bytes) -> None:
        """Read one file."""
        from warpspace.exceptions import WarpspaceError

        (self._folder / "current").write_bytes(name.encode() + b"\n" + content)
        began = time.process_time()
        try:
            self._formats[name].read(content, self._folder)
            self.good[name] += 1
        except WarpspaceError as error:
            if len(str(error)) > 20_000:
                self._fault(name, content, f"a message of {len(str(error)):,} characters")
        except Exception as error:  # noqa: BLE001 - that is what is looked for
            self._fault(name, content, f"{type(error).__name__}: {error}"[:300])
        spent = time.process_time() - began
        self.slowest_s = max(self.slowest_s, spent)
        if spent > LONGEST_S:
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
        """Memory the process has ever had, MB.

        Linux lets a process inherit `ru_maxrss` from the one that started it; VmHWM begins anew.
        """
        status = Path("/proc/self/status")
        if status.exists():
            line = next(x for x in status.read_text().splitlines() if x.startswith("VmHWM"))
            return float(line.split()[1]) / 1024.0
        scale = 1024.0 if sys.platform == "linux" else 1024.0**2
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / scale

    def say(self, *, ended: bool = False) -> None:
        """Write down how far it is."""
        self._said = time.monotonic()
        text = json.dumps(
            {
                "by_format": self.by_format,
                "read": self.good,
                "slowest_s": self.slowest_s,
                "most_mb": self.most_mb,
                "faults": self.faults[:20],
                "ended": ended,
            }
        )
        path = self._folder / "state.new"
        path.write_text(text)
        path.replace(self._folder / "state.json")

    def _fault(self, name: str, content: bytes, what: str) -> None:
        """Keep what must not be, with the file that shows it."""
        self.faults.append(f"{name}: {what} ({keep(name, content)})")


def _read_bytes(reader: Reader, count: int, seed: int) -> None:
    """Change bytes and words of good files."""
    from reliability.formats import FORMATS, WORDS

    chance = random.Random(seed)
    seeds = {each.name: each.seeds() for each in FORMATS}
    shares = [each.share for each in FORMATS]
    for _ in range(count):
        (each,) = chance.choices(FORMATS, shares)
        words = WORDS if each.text else []
        reader.read(each.name, mutate(seeds[each.name], words, chance))


def _read_hypothesis(reader: Reader, count: int, seed: int) -> None:
    """Read whole scenes of hypothesis's making, as they are and with changes."""
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
            max_examples=count - done,
            database=None,
            deadline=None,
            phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        )
        seeded(seed + done)(chosen(given(scene_texts(), st.integers(0, 2**32))(read)))()


def _read_atheris(reader: Reader, count: int, seed: int) -> None:
    """Let a coverage-guided fuzzer choose what is read; it learns which bytes reach new code."""
    import atheris

    from reliability.formats import FORMATS, WORDS

    for module in [name for name in sys.modules if name.startswith(("warpspace.", "tomllib"))]:
        holder = sys.modules[module]
        for name, value in list(vars(holder).items()):
            if getattr(value, "__module__", None) == module and hasattr(value, "__code__"):
                try:
                    setattr(holder, name, atheris.instrument_func(value))
                except (AttributeError, TypeError, ValueError):
                    continue
    chosen = [each for each in FORMATS if each.share >= 1.0]
    corpus = reader._folder / "corpus"
    corpus.mkdir()
    for number, each in enumerate(chosen):
        for at, content in enumerate(each.seeds()):
            (corpus / f"{number}-{at}").write_bytes(bytes([number]) + content)
    words = reader._folder / "words"
    spelt = ("".join(f"\\x{byte:02x}" for byte in word) for word in WORDS if len(word) < 60)
    words.write_text("".join(f'"{word}"\n' for word in spelt))

    def read(data: bytes) -> None:
        if data:
            reader.read(chosen[data[0] % len(chosen)].name, data[1:])
        if sum(reader.by_format.values()) >= count:
            reader.say(ended=True)
            os._exit(0)

    options = [f"-seed={seed % 2**31 or 1}", "-max_len=60000", "-rss_limit_mb=2000"]
    atheris.Setup(
        [sys.argv[0], *options, f"-dict={words}", "-timeout=60", str(corpus)],
        read,
    )
    atheris.Fuzz()


def main() -> None:
    """Read so many files in this process; the folder is for them, and for what is said."""
    parser = argparse.ArgumentParser()
    parser.add_argument("way", choices=WAYS)
    parser.add_argument("count", type=int)
    parser.add_argument("seed", type=int)
    parser.add_argument("folder", type=Path)
    options = parser.parse_args()
    reader = Reader(options.folder)
    reader.say()
    run = {"bytes": _read_bytes, "hypothesis": _read_hypothesis, "atheris": _read_atheris}
    run[options.way](reader, options.count, options.seed)
    reader.say(ended=True)


if __name__ == "__main__":
    main()
