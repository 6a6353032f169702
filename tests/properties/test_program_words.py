"""Mutated programs: no word that is not understood changes a number without a message."""

import re
from collections.abc import Callable

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import warpspace
from warpspace.exceptions import SceneError
from warpspace.parts.gcode.control_settings import ControlSettings
from warpspace.parts.gcode.dialects.detection import DIALECTS
from warpspace.parts.gcode.interpreter import Interpreter, read_program
from warpspace.parts.gcode.parsed import STAND, ParsedProgram

SCENE = warpspace.load_scene("machine_gantry_mill")
PROGRAM = """%
O1001
G21 G90 G17 G40
T1 M6
S5000 M3
G0 X0. Y0. Z50.
G43 H1 Z10.
G1 Z-5. F300
X50. Y10.
G2 X60. Y20. I10. J0.
G0 Z10. M8
G98 G83 X10. Y10. Z-20. R2. Q5.
X20.
G80
G54 G1 X5. Z0.
G91 X3. Y3.
G90 G28 Z0.
M30""".splitlines()
FOREIGN = (
    "TRANS X100 Y50", "AROT Z30", "G101 X0", "G7.1 C50", "M201 X500 Y500", "M92 X80", "E5.",
    "G58 X10 Y20", "G56 H1 Z50", "G254", "CYCLE83(1,2)", "R1=5", "CR=10", "X=AC(5)", "G68.2 X0 Y0",
    "#1=5", "M777 X7", "G50 X5", "G15 H1", "ROT RPL=45", ",B5.", "K0.2", "A30.", "L CALL", "M128",
    "G5 X1 Y1", "G60", "G187 P3", "U3.9.1", "G16", "G51.1 X0", "G72", "M97 P3", "G65 P9010", "SUPA",
)  # fmt: skip


def insert(line: str, word: str, at: int) -> str:
    words = line.split()
    words.insert(at % (len(words) + 1), word)
    return " ".join(words)


def duplicate(line: str, _word: str, at: int) -> str:
    words = line.split()
    return insert(line, words[at % len(words)], at)


def truncate(line: str, _word: str, at: int) -> str:
    words = line.split()
    index = at % len(words)
    words[index] = words[index][:-1]
    return " ".join(words)


def path_to(program: ParsedProgram, line: int) -> np.ndarray:
    rows = (program.line < line) & (program.kind != STAND)
    return np.column_stack([program.line, program.kind, program.end])[rows]


@settings(max_examples=300, deadline=None)
@given(
    mutate=st.sampled_from([insert, duplicate, truncate]),
    number=st.integers(3, len(PROGRAM)),
    word=st.sampled_from(FOREIGN),
    at=st.integers(0, 9),
    dialect=st.sampled_from(["auto", *DIALECTS]),
)
def test_no_unknown_word_changes_a_number(
    mutate: Callable[[str, str, int], str], number: int, word: str, at: int, dialect: str
):
    lines = list(PROGRAM)
    lines[number - 1] = mutate(lines[number - 1], word, at)
    options = ControlSettings(dialect=dialect, length_mm=20.0)  # type: ignore[arg-type]
    try:
        changed = read_program(SCENE, lines, options)
    except SceneError as error:
        message = str(error)
    else:
        message = ""
    if message:
        assert re.search(r"line \d+: \S.*; .*expected", message)
        return
    original = read_program(SCENE, PROGRAM, options)
    end = min([number, *original.refused])
    if changed.dialect == original.dialect:  # otherwise the output states the new one
        np.testing.assert_array_equal(path_to(changed, end), path_to(original, end))
    control = Interpreter(SCENE, options, "program")
    control.choose_dialect(lines)
    table = {*control.handlers, *control.motionless}
    is_letter = word in {"E5.", "K0.2"} or (changed.dialect == "sinumerik" and "=" in word)
    if mutate is insert and not {*re.findall(r"[A-Z]+[\d.]*", word)} & table and not is_letter:
        assert min(changed.refused) <= number
