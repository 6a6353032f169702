"""Reads worst-case lines of two lengths with every parser of text: time grows with their length."""

import gc
import math
import random
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from reliability.formats import EVERY
from reliability.outcome import Outcome
from warpspace.exceptions import WarpspaceError

STEEPEST = 1.2
"""Exponent by which time may grow with the length of a line."""
LEAST_S = 0.08
"""Time below which the longer line is fast whatever the shorter one takes: noise and set-up."""
SHORT, LONG = 4_000, 16_000  # characters of a line; most parsers refuse one of over 16,384
FEW, MANY = 12_500, 50_000  # lines
REPEATS = 3
PIECES = [
    *(b" ", b"\t", b"1", b"9", b"a", b"A", b"(", b")", b"[", b"{", b"<", b'"', b"'", b"#", b";"),
    *(b",", b".", b"-", b"=", b":", b"\\", b"/", b"%", b"$", b"_", b"!", b"1 ", b"a ", b"A "),
    b"1,",
    *(b"1.", b"a=", b"[ ", b"( ", b"()", b"a(", b"a[", b"X1", b"X1 ", b"// ", b"/*", b"e1", b"0x"),
    *(b"endsolid ", b"solid ", b"vertex ", b"facet ", b"COMP_FILE ", b"coordinates ", b"\xc2\xa0"),
]
"""What a worst line repeats."""
ENDS = [b"", b"#", b"x", b"]", b"!", b" x", b"\xff"]
BREAKS = [b"\n", b"\r\n", b" \n", b"\t\n", b"#\n", b"1\n", b"a\n", b"endsolid\n", b"\r"]


def time_of(read: Callable[[bytes], object], content: bytes, repeats: int = REPEATS) -> float:
    """Measure the least time of the processor that some readings take, s."""
    spent = []
    for _ in range(repeats):
        gc.collect()
        began = time.process_time()
        with suppress(WarpspaceError):
            read(content)
        spent.append(time.process_time() - began)
        if spent[-1] < LEAST_S / 4.0:
            break
    return min(spent)


def growth(read: Callable[[bytes], object], make: Callable[[int], bytes], *lengths: int) -> float:
    """Give the exponent by which time grows with a length; 0 where the longer one is fast."""
    short, long = lengths
    least = math.inf
    # other work on the machine makes it larger, never smaller
    for repeats in (1, REPEATS, REPEATS):
        slow = time_of(read, make(long), repeats)
        if slow < LEAST_S:
            return 0.0
        fast = time_of(read, make(short), repeats)
        least = min(least, math.log(slow / max(fast, 1e-4)) / math.log(long / short))
        if least <= STEEPEST:
            break
    return least


def line_maker(
    seed: bytes, chance: random.Random, pieces: Sequence[bytes] = PIECES
) -> tuple[Callable[[int], bytes], str]:
    """Give what puts a worst line into a file, amid one of its lines, by its length."""
    piece, end = chance.choice(pieces), chance.choice(ENDS)
    at = chance.randrange(len(seed) + 1)
    if chance.random() < 0.5:  # a line of its own
        at = seed.rfind(b"\n", 0, at) + 1
    head, tail = seed[:at], seed[at:]
    if chance.random() < 0.5:
        tail = tail[tail.find(b"\n") :] if b"\n" in tail else b""
    return (
        lambda n: head + piece * (n // len(piece)) + end + tail,
        f"{head[-20:]!r} {piece!r} {end!r}",
    )


def run(count: int, seed: int = 14) -> Outcome:
    """Read worst lines, and many short ones, with every parser in turn."""
    chance, faults, steepest = random.Random(seed), [], 0.0
    texts = [each for each in EVERY if each.text or each.name in {"stl", "ply"}]
    seeds = {each.name: each.seeds() for each in texts}
    done = 0
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("error")
        for done in range(1, count + 1):
            each = texts[done % len(texts)]

            def read(content: bytes, each=each) -> object:
                return each.read(content, Path(folder))

            text = chance.choice(seeds[each.name])
            if chance.random() < 0.2:
                make, what = line_maker(text, chance, BREAKS)
                lengths = FEW, MANY
            else:
                make, what = line_maker(text, chance)
                lengths = SHORT, LONG
            try:
                found = growth(read, make, *lengths)
            except Exception as error:  # noqa: BLE001 - that is what is looked for
                faults.append(f"{each.name}: {what}: {type(error).__name__}: {error}"[:300])
                continue
            steepest = max(steepest, found)
            if found > STEEPEST:
                faults.append(f"{each.name}: {what}: time grows with the power {found:.2f}")
    return Outcome(done, f"steepest growth {steepest:.2f}, in {len(texts)} parsers", faults)
