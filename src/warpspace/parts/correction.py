"""A program mended: its points moved so that a machine with these errors cuts the nominal path.

The tip is sent to where it belongs less the error that the machine has there: linear axes follow,
rotary words stay. Words come out absolute (G90), arcs as lines, cycles as the moves they stand for.
The other words, comments and the lines of G28 and G53 are kept.

A linear axis is written from the line on that names it: where it stands before, nobody knows. The
same holds behind G28 and G53, another work offset or mode, and for Z behind another tool or length.
"""

import re
from collections import Counter
from collections.abc import Iterator, Sequence, Set

import numpy as np
from numpy.typing import NDArray

from warpspace.bench.placing import follow, following_axes
from warpspace.exceptions import OptionError
from warpspace.machine.limits import MAX_PATH_POINTS
from warpspace.parts.control import PLANES, RAPID, STAND, Control, ReadProgram, upright
from warpspace.parts.program import Program, along_moves, samples_of_moves
from warpspace.parts.words import WORD, Block, Reader
from warpspace.scene.model import Scene
from warpspace.units import Array

ROUNDS = 20
LEFT_UM = 1e-3  # of an error that is taken back
SAMPLED = 4  # pieces that are looked at are shorter by the root of this than those that are written
_MODES = {"G2", "G3", "G81", "G82", "G83", "G90", "G91"}  # not of the corrected program
_OF_TOOL = {"M6", "G43", "G43.4", "G49"}
_LAST = {"M0", "M1", "M2", "M5", "M9", "M30", "M60"}  # take effect when the axes have moved


def correct_program(
    scene: Scene, lines: Sequence[str], read: ReadProgram, asked: Program
) -> Iterator[str]:
    """Give the lines of a program that leaves the nominal path of another one on this machine."""
    for one in read.refused:
        raise OptionError(
            f"line {one.line}: {one.word} is not followed; expected a program that is followed to"
            " its end, to correct it"
        )
    row, places = corrected_places(scene, read, asked.within_um / 1e3)
    first = np.searchsorted(read.line[row], np.arange(len(lines) + 2)).tolist()
    reader = Reader(asked.file or "")
    writer = _Writer(scene, read, asked, reader)
    number, is_headed = 0, False
    for block in reader.blocks(lines):
        if not is_headed and (block.codes or block.numbers):
            yield from _header(scene, asked)
            is_headed = True
        number = block.line
        here = slice(*first[number : number + 2])
        yield from writer.rewrite(block, lines[number - 1], row[here].tolist(), places[here])
    yield from (line.rstrip() for line in lines[number:])


def _header(scene: Scene, asked: Program) -> Iterator[str]:
    from hashlib import sha256

    from warpspace.scene.save import scene_to_toml

    digest = sha256(scene_to_toml(scene).encode()).hexdigest()[:12]
    said = f"for {scene.title[:80]}, chain {scene.machine.chain}, errors {digest}"
    said = re.sub("[()]", " ", said).encode("ascii", "replace").decode()
    setup = [f"{system}={axis}{at:g}" for system, axis, at in asked.offset]
    setup += [f"{name}={length:g}" for name, length in asked.lengths]
    yield f"(corrected {said})"
    yield f"(TCP {asked.tcp}, length {asked.length_mm:g} mm, {', '.join(setup) or 'no offsets'})"
    yield f"(within {asked.within_um:g} um between points; geometry only)"
    yield "G90"


def corrected_places(
    scene: Scene, read: ReadProgram, within_mm: float
) -> tuple[NDArray[np.int64], Array]:
    """Give rows of a program, [n], and corrected places, [n, a], that its lines lead to in turn.

    A row comes as often as its move has pieces, all of one length. Between two places the linear
    axes stay within a distance of where they have to be. Places are those of `ReadProgram.end`.
    """
    count = samples_of_moves(scene, read, within_mm / SAMPLED, 2.0, 10.0)
    pieces = 2 ** np.ceil(np.log2(np.maximum(count, 1))).astype(np.int64)
    pieces[~read.moves | (read.kind == RAPID)] = 1
    if pieces.sum() > MAX_PATH_POINTS:
        most = f"{pieces.sum():,} points; expected at most {MAX_PATH_POINTS:,}"
        raise OptionError(f"within {{within_um}} the path is looked at in {most}")
    row = np.repeat(np.arange(len(pieces)), pieces + 1)
    share = (np.arange(len(row)) - np.searchsorted(row, row)) / pieces[row]
    shift = np.zeros((len(row), 3))
    for _ in range(ROUNDS):
        found, tip, error_um = along_moves(scene, read, row, share, shift)
        if np.abs(1e3 * shift + error_um).max() <= LEFT_UM:
            break
        shift = -error_um / 1e3
    else:
        raise OptionError("the errors change too much from place to place to be corrected")
    places, names = read.positions(row, share), following_axes(scene.model)
    words = follow(scene.model, upright(scene.model, found), tip)
    moved, at = (np.stack([one[name] for name in names], axis=-1) for one in (words, found))
    linear = np.where(read.tcp[row, None], moved, at)
    places[:, [read.axes.index(name) for name in names]] = linear
    is_kept = _fewest(row, share, pieces, linear, within_mm) & (share > 0.0)
    return row[is_kept], places[is_kept]


def _fewest(
    row: NDArray[np.int64], share: Array, pieces: NDArray[np.int64], at: Array, within_mm: float
) -> NDArray[np.bool_]:
    """Choose the ends of the fewest pieces, halved again and again, that stay near all points."""
    kept, is_open = np.zeros(len(row), dtype=bool), np.ones(len(pieces), dtype=bool)
    level = 0
    while len(some := np.flatnonzero(is_open[row])):
        where, points = 2.0 * row[some] + share[some], at[some]
        knot = share[some] * np.minimum(2**level, pieces)[row[some]] % 1.0 == 0.0
        lines = [np.interp(where, where[knot], points[knot, axis]) for axis in range(3)]
        away = np.linalg.norm(points - np.stack(lines, axis=-1), axis=1)
        is_bent = np.bincount(row[some], away > within_mm, len(pieces)) > 0.0
        kept[some] |= knot & ~is_bent[row[some]]
        is_open &= is_bent
        level += 1
    return kept


class _Writer:
    """Puts other places into the lines of a program."""

    def __init__(self, scene: Scene, read: ReadProgram, asked: Program, reader: Reader) -> None:
        self.control, self.kind = Control(scene, asked, reader), read.kind
        self.decimals = asked.decimals
        self.linear = {name[0] for name in following_axes(scene.model)}
        for name in following_axes(scene.model):
            if name[0] not in self.control.index:
                raise OptionError(f"no word moves axis {name}; expected one axis of each letter")
        self.known: set[str] = set()
        self.mode = "", False
        self.is_inverse, self.dwell = False, 0.0

    def rewrite(self, block: Block, raw: str, rows: list[int], places: Array) -> Iterator[str]:
        control, codes = self.control, {*block.codes}
        control.run(block)
        if (mode := (control.system, control.tcp)) != self.mode:
            self.mode, self.known = mode, set()
        self.known -= {"Z"} if codes & _OF_TOOL else set()
        self.is_inverse = (self.is_inverse or "G93" in codes) and not codes & {"G94", "G95"}
        letters = block.numbers.keys() & control.index.keys()
        moving = [at for at, row in enumerate(rows) if self.kind[row] != STAND]
        text = raw.strip().lstrip("/")
        text = text.lstrip("0123456789") if raw.strip() != text else text
        skip = raw.strip().removesuffix(text)
        if codes & {"G4", "G28", "G53"} or not (moving or letters):
            kept = _without(text, _MODES).replace("\0 ", "").replace("\0", "")
            if codes & {"G28", "G53"}:
                self.known -= letters or self.known
            if "G28" in codes and not control.absolute:
                yield f"{skip}G91 {kept}"
                yield "G90"
            elif kept.strip() or not text:
                yield skip + kept
            return
        self.know(block, letters)
        dropped = "IJKR" + "".join(control.index) + "F" * self.is_inverse
        dropped += "PQ" * bool(control.cycle)
        before, *after = _without(text, _MODES | _LAST | {"G0", "G1"}, dropped).split("\0")
        blocks = self.blocks(block, rows, places, moving or [len(rows) - 1])
        blocks[-1] += "".join(f" {code}" for code in block.codes if code in _LAST)
        blocks[0] = " ".join([*before.split(), blocks[0], *"".join(after).split()])
        yield from (skip + one for one in blocks)

    def know(self, block: Block, letters: Set[str]) -> None:
        """Take the axes of a block as known; refuse moves that begin nobody knows where."""
        control = self.control
        needed = set(letters if not control.absolute else "")
        needed |= set(PLANES[control.across] if control.motion in {"G2", "G3"} else "")
        needed |= {"XYZ"[control.across]} - letters if control.cycle else set()
        if missing := ", ".join(sorted(needed - self.known)):
            block.refuse(
                f"moves {missing} from a place that is not known; expected G90 and {missing} before"
            )
        self.known |= letters

    def blocks(
        self, block: Block, rows: list[int], places: Array, chosen: Sequence[int]
    ) -> list[str]:
        """Write the blocks that lead to some of the places."""
        control, pieces = self.control, Counter(rows)
        letters = [x for x in control.index if x in block.numbers or x in self.known & self.linear]
        if control.cycle:
            self.dwell = block.numbers.get("P", self.dwell)
        found: list[str] = []
        for at in chosen:
            kind = self.kind[rows[at]]
            is_rapid = kind == RAPID or (kind == STAND and control.motion == "G0")
            words = ["G0" if is_rapid else "G1"]
            for letter in letters:
                digits = self.decimals + (2 if letter in "ABC" else control.unit_mm != 1.0)
                value = control.word(letter, float(places[at, control.index[letter]]))
                words.append(letter + _spelled(value, digits))
            if self.is_inverse and not is_rapid and "F" in block.numbers:
                words.append("F" + _spelled(block.numbers["F"] * pieces[rows[at]], 4))
            found.append(" ".join(words))
            if control.motion == "G82" and not is_rapid:
                found.append(f"G4 P{self.dwell:g}")
        return found


def _without(text: str, codes: Set[str], letters: str = "") -> str:
    """Leave words out of a line; where they stood are zero characters."""

    def take(found: re.Match[str]) -> str:
        letter = (found[1] or "").upper()
        is_out = letter and (letter in letters or f"{letter}{float(found[2]):g}" in codes)
        return "\0" if is_out else found[0]

    return re.sub(WORD, take, text)


def _spelled(value: float, digits: int) -> str:
    return f"{round(value, digits) + 0.0:.{digits}f}".rstrip("0")
