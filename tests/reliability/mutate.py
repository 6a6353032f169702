"""Changed files: bytes flipped, cut, doubled and joined, numbers and words put in."""

import random
import re
from collections.abc import Sequence

_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_INTERESTING = [0, 1, 0x7F, 0x80, 0xFF, 0x0A, 0x22, 0x5B, 0x7B]
LARGEST = 200_000


def mutate(seeds: Sequence[bytes], words: Sequence[bytes], chance: random.Random) -> bytes:
    """Change a good file in one to eight places.

    Parameters
    ----------
    seeds : sequence of bytes
    words : sequence of bytes
        Put in where the format is a text; none for a binary one.
    chance : random.Random
    """
    content = bytearray(chance.choice(seeds))
    for _ in range(chance.choice((1, 1, 1, 2, 3, 5, 8))):
        _change(content, seeds, words, chance)
    return bytes(content[:LARGEST])


def _change(
    content: bytearray, seeds: Sequence[bytes], words: Sequence[bytes], chance: random.Random
) -> None:
    """Change a file in one place."""
    at, length = chance.randrange(len(content) + 1), chance.choice((1, 2, 4, 16, 64, 512))
    kind = chance.randrange(9 if words else 6)
    if kind == 0 and content:
        content[at % len(content)] ^= 1 << chance.randrange(8)
    elif kind == 1 and content:
        content[at % len(content)] = chance.choice(_INTERESTING)
    elif kind == 2:
        del content[at : at + length]
    elif kind == 3:
        content[at:at] = content[at : at + length] * chance.choice((1, 2, 50))
    elif kind == 4:
        other = chance.choice(seeds)
        begin = chance.randrange(len(other) + 1)
        content[at : at + length] = other[begin : begin + length]
    elif kind == 5:
        content[at : at + 4] = chance.choice(
            (b"\xff" * 4, b"\0" * 4, b"\x7f\xff\xff\xff", b"\0\0\x80\x7f", chance.randbytes(4))
        )
    elif kind == 6:
        content[at:at] = chance.choice(words)
    elif kind == 7:
        _replace_number(content, words, chance)
    else:
        _swap_lines(content, chance)


def _replace_number(content: bytearray, words: Sequence[bytes], chance: random.Random) -> None:
    """Put another number, or a word, where one stands."""
    found = list(_NUMBER.finditer(bytes(content)))
    if not found:
        return
    place = chance.choice(found)
    value = chance.choice(
        (
            str(chance.uniform(-1e6, 1e6)).encode(),
            f"{10.0 ** chance.uniform(-330, 308):e}".encode(),
            str(chance.randrange(-(10**20), 10**20)).encode(),
            chance.choice(words),
        )
    )
    content[place.start() : place.end()] = value


def _swap_lines(content: bytearray, chance: random.Random) -> None:
    """Double a line, or move it elsewhere."""
    lines = bytes(content).split(b"\n")
    line = lines[chance.randrange(len(lines))]
    lines.insert(chance.randrange(len(lines) + 1), line)
    content[:] = b"\n".join(lines)
