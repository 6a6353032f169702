"""Programs: what a control makes of their words, and the path of the tip against closed forms."""

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import warpspace
from products import first
from warpspace.analysis.registry import verb
from warpspace.bench.kinds.circular import Circular
from warpspace.exceptions import OptionError, SceneError
from warpspace.parts.gcode.control_settings import ControlSettings
from warpspace.parts.gcode.interpreter import read_program
from warpspace.parts.gcode.parsed import STAND, ParsedProgram, with_length
from warpspace.parts.program import Program, ToolPath, trace_program
from warpspace.scene.library import parse_scene
from warpspace.scene.model import Scene, evaluate

TRAVEL = "X = [-900, 900]\nY = [-900, 900]\nZ = [-900, 900]"
HEAD = f"""
title = "head"
[machine]
chain = "wXYFZCBt"
direction = {{ X = -1, Y = -1 }}
[machine.travel]
{TRAVEL}
[workspace]
{TRAVEL}
B = 0
C = 0
"""


@pytest.fixture(scope="module")
def head() -> Scene:
    return parse_scene(HEAD, "head")


@pytest.fixture(scope="module")
def dvf() -> Scene:
    return warpspace.load_scene("dvf5000_first")


def run(scene: Scene, text: str, **setup: Any) -> tuple[ParsedProgram, ToolPath]:
    read = read_program(scene, text.splitlines(), ControlSettings(**setup))
    return read, trace_program(read)


def is_end(path: ToolPath) -> np.ndarray:
    return np.append(path.line[1:], -1) != path.line


def ends(path: ToolPath) -> np.ndarray:
    return path.tip_mm[is_end(path)]


def test_without_tcp_a_tool_of_length_l_swings_by_l_sin_b(head: Scene):
    length, angle = 180.0, 35.0
    _, path = run(head, f"G43 H1 G0 X0 Y0 Z0 B0\nG1 B{angle}", length_mm=length)
    moved, b = np.diff(ends(path), axis=0)[0], math.radians(angle)
    expected = [-length * math.sin(b), 0.0, length * (1.0 - math.cos(b))]
    assert moved == pytest.approx(expected, abs=1e-9)
    assert np.linalg.norm(path.tip_mm[0] - ends(run(head, "G0 X0 Y0 Z0")[1])) < 1e-9
    swing = path.tip_mm - [0.0, 0.0, path.tip_mm[0, 2] + length]
    sagitta = length - np.linalg.norm((swing[1:] + swing[:-1]) / 2.0, axis=1)
    assert 0.001 < sagitta.max() <= 0.01


@pytest.mark.parametrize("name", ["head", "dvf"])
def test_with_tcp_the_tip_stays_on_its_line(name: str, request: pytest.FixtureRequest):
    scene = request.getfixturevalue(name)
    text = "G0 X10 Y0 Z-200\nG43.4 H1 Z-190\nG1 B20 C40\nX50 Y30 B-30 C90\nG49 X0"
    setup = {"offset": (("G54X", 5.0), ("G54C", 10.0)), "length_mm": 60.0}
    read, path = run(scene, text, **setup)
    straight = ends(run(scene, "G0 X15 Y0 Z-200\nZ-190\nX55 Y30")[1])
    assert ends(path)[1:3] == pytest.approx(straight[[1, 1]], abs=1e-9)
    assert ends(path)[3] == pytest.approx(straight[2], abs=1e-9)
    along = path.tip_mm[path.line == 4] - straight[1]
    assert np.cross(along, straight[2] - straight[1]) == pytest.approx(0.0, abs=1e-8)
    assert path.coordinates["C"][is_end(path)][-1] == 100.0
    moved = {axis: values[path.line == 5][-1] for axis, values in path.coordinates.items()}
    before = {axis: values[path.line == 4][-1] for axis, values in path.coordinates.items()}
    assert moved["X"] == pytest.approx(5.0)
    assert [moved[axis] for axis in "YZBC"] == pytest.approx([before[axis] for axis in "YZBC"])
    assert read.blocks == 5


@pytest.mark.parametrize("count", first(240, 1000))
def test_random_arcs_are_circles(dvf: Scene, count: int):
    rng = np.random.default_rng(7)
    planes = {"G17": ("X", "Y", "Z"), "G18": ("Z", "X", "Y"), "G19": ("Y", "Z", "X")}
    text, expected = ["G91 G0 X0 Y0 Z0 F1"], []
    for number in range(count):
        plane, axes = list(planes.items())[number % 3]
        radius, start = rng.uniform(1.0, 90.0), rng.uniform(0.0, 2.0 * np.pi)
        turn, pitch = rng.uniform(0.1, 2.0 * np.pi - 0.1), rng.uniform(-5.0, 5.0)
        sense = rng.choice([-1.0, 1.0])

        def place(share, start=start, sense=sense, radius=radius, turn=turn, pitch=pitch):
            angle = start + sense * turn * share
            circle = np.stack([np.cos(angle) - np.cos(start), np.sin(angle) - np.sin(start)])
            return np.column_stack([*(radius * circle), pitch * share])

        to = dict(zip(axes, place(np.ones(1))[0], strict=True))
        words = " ".join(f"{axis}{value:.10f}" for axis, value in to.items())
        if number % 2:
            words += f" R{radius if turn < np.pi else -radius:.10f}"
        else:
            centre = zip(axes, (-radius * np.cos(start), -radius * np.sin(start)), strict=False)
            words += "".join(f" {'IJK'['XYZ'.index(x)]}{v:.10f}" for x, v in centre)
        text.append(f"{plane} G{3 if sense > 0 else 2} {words}")
        expected.append(([*map("XYZ".index, axes)], radius, place))
    _, path = run(dvf, "\n".join(text))
    starts = ends(path)
    for number, (axes, radius, place) in enumerate(expected):
        found = (path.tip_mm[path.line == number + 2] - starts[number])[:, axes]
        points = place(np.linspace(0.0, 1.0, len(found) + 1))
        assert found == pytest.approx(points[1:], abs=1e-6)
        middle = place((np.arange(len(found)) + 0.5) / len(found))
        away = np.linalg.norm(middle - (points[1:] + points[:-1]) / 2.0, axis=1)
        assert away.max() <= 0.01001, radius


def test_a_circle_deviates_as_the_circular_test_reads(dvf: Scene):
    test = Circular(plane="XY", radius_mm=100.0, points=72)
    plan = test.plan(dvf)
    outcome = test.run(dvf, lambda _: None).model
    _, path = run(dvf, "G0 X100 Y0 Z-280\nG3 X100 Y0 I-100")
    centre = run(dvf, "G0 X0 Y0 Z-280")[1]
    relative = path.error_um - centre.error_um[-1]
    outward = (path.tip_mm - centre.tip_mm[-1]) / 100.0
    radial = np.sum(relative * outward, axis=1)
    angle = np.rad2deg(np.arctan2(outward[:, 1], outward[:, 0])) % 360.0
    forward = plan.marks["sense"] > 0
    order = np.argsort(angle)
    found = np.interp(plan.marks["angle_deg"][forward], angle[order], radial[order], period=360.0)
    assert found == pytest.approx(outcome.readings[forward], abs=0.02)


def test_modal_words(dvf: Scene):
    text = """%
    O0012 (inches, then millimetres)
    N10 g20 g90 g0 x1 y.5 z-10. ; comment
    N20 G91 X1 (Y9)
    N30 G21 G55 G90 X10 M8 S5000 T1 F200
    N40 G53 Z-100
    N50 G91 G28 Z0
    G4 X5
    / G90 G54 X0
    M30
    X99
    """
    read, path = run(dvf, text, offset=(("G54X", 100.0), ("G55X", 1.0)))
    x, z = (path.coordinates[axis][is_end(path)] for axis in "XZ")
    assert x == pytest.approx([125.4, 150.8, 11.0, 11.0, 11.0, 100.0])
    assert z == pytest.approx([-254.0, -254.0, -254.0, -100.0, 0.0, 0.0])
    assert path.line[is_end(path)].tolist() == [3, 4, 5, 6, 7, 9]
    assert read.remarks == {"/": 9}


def test_holes(dvf: Scene):
    text = "G0 X0 Y0 Z-100\nG99 G83 X10 Z-112 R-102 Q4\nX20\nG98 G81 X30\nG80 G0 X40"
    read, path = run(dvf, text)
    z = [read.end[(read.kind != STAND) & (read.line == line), 2].tolist() for line in (2, 3, 4)]
    hole = [-106, -102, -106, -110, -102, -110, -112, -102]
    assert z == [[-100, -102, *hole], [-102, *hole], [-102, -112, -100]]
    assert path.coordinates["Z"][is_end(path)].tolist() == [-100.0, -102.0, -102.0, -100.0, -100.0]


def test_json_holds_together(dvf: Scene, tmp_path: Path):
    file = tmp_path / "x.ngc"
    text = "G43 H1 G0 X-50 Y-50 Z-300\nG1 X50\nY50\nX-50\nY-50\nG2 I50 J50\nG1 B-10 Z0\n#1=2"
    file.write_text(text)
    found = verb("program")(dvf, file=str(file), length_mm=75.0, at_line=7)
    said = found.as_json()
    assert said["blocks"] == 7
    assert [(entry["line"], entry["word"]) for entry in said["refused"]] == [(8, "#1=2")]
    assert said["length_mm"] > 400.0 + 100.0 * math.sqrt(2.0) * math.pi
    assert said["deviation"]["max_um"] == said["worst"][0]["um"]
    assert said["across"]["max_um"] <= said["deviation"]["max_um"]
    longer = replace(dvf, model=with_length(dvf.model, 75.0))
    for one in [*said["worst"], said["line"]]:
        field = evaluate(longer, at=one["axes"], loop="relative", frame="workpiece")
        assert one["error_um"] == pytest.approx(field.error_um.tolist(), abs=1e-9)
        if "um" in one:
            assert sum(one["budget"].values()) == pytest.approx(one["um"], abs=1e-9)
    assert said["line"]["axes"]["Z"] == 75.0
    assert said["outside"] > 0
    with pytest.raises(OptionError, match="moves no axis; expected 7"):
        Program(file=str(file), at_line=8).run(dvf, lambda _: None)


@pytest.mark.parametrize(
    ("text", "word"),
    [("#1=5", "#1=5"), ("G1 X[1+2]", "X[1+2]"), ("X#3", "X#3"), ("M98 P100", "M98 P100"),
     ("G41 D1 X5", "G41"), ("O100 sub", "O100 SUB"),
     ("O100 call [5]", "O100 CALL"), ("O1 endsub", "O1 ENDSUB"), ("O1 if [1]", "O1"),
     ("IF [#1 GT 2] GOTO 5", "IF"),
     ("G05.1 X5", "G5.1"), ("M198 P5", "M198"),
     *((f"G{g} X5", f"G{g}") for g in (27, 29, 31, 34, 37, 47, 70, 110, 129, 150, 154))],
)  # fmt: skip
def test_what_is_refused_ends_the_path(dvf: Scene, text: str, word: str):
    read, _ = run(dvf, f"G0 X1 Y1 Z-200\n{text}\nG1 X50\nM98 P5")
    assert read.refused == {2: word}
    assert read.blocks == 1


@pytest.mark.parametrize(
    ("text", "said"),
    [("G1 X1.2.3", "line 1: X1.2.3; expected"), ("G1 X", "X; expected a letter"),
     ("G1 A5", "A5; expected an axis"),
     ("X1 X2", "expected X once"), ("G0 X1e2", "X1E2; expected"), ("G2 X1", "expected I or J"),
     ("(open", "end of the comment"),
     ("G0 X999999", "at most ±100000"), ("G2 X10 R1", "R1; expected a radius"),
     ("G2 X10 I2", "one radius"), ("G83 X1 Z-9 R1", "pecks of Q"), ("G81 X1", "expected Z and R")],
)  # fmt: skip
def test_errors_name_line_and_word(dvf: Scene, text: str, said: str):
    with pytest.raises(SceneError, match="line 1: ") as caught:
        run(dvf, text)
    assert said in str(caught.value)


def test_the_way_from_an_unknown_place_does_not_count(dvf: Scene):
    text = "G90 G0 Z-100\nG1 X250\nG0 Y200\nG1 X240\nY230"  # of 10 and 30 mm
    found = Program(file="x", text=text).run(dvf, lambda _: None)
    assert found.length_mm == pytest.approx(40.0, abs=1e-9)
    assert found.program.blocks == 3
    assert found.path.line[0] == 3
    _, late = run(dvf, "G0 X250 Y200\nG1 X240\nG0 Z-270")  # Z is named once all is cut
    assert np.linalg.norm(late.step_mm, axis=1).sum() == pytest.approx(20.0, abs=1e-9)
    _, plane = run(dvf, "G0 X250\nY200\nG1 X240")  # Z stands as in the scene
    assert np.linalg.norm(plane.step_mm, axis=1).sum() == pytest.approx(10.0, abs=1e-9)


def test_holes_are_repeated_and_arcs_turn_more_than_once(dvf: Scene):
    text = "G90 G0 X0 Y0 Z-200\nG91 G99 G81 X10 Z-15 R-5 {}5\nX7 {}0\nX10"
    for letter in "KL":  # five holes, none, and one more
        read, _ = run(dvf, text.format(letter, letter))
        deep = read.end[:, 2] == -220.0
        assert read.end[deep, 0] == pytest.approx([10.0, 20.0, 30.0, 40.0, 50.0, 60.0])
        assert not read.remarks
    _, path = run(dvf, "G0 X10 Y0 Z-200\nG3 X10 Y0 Z-230 I-10 P3")
    assert np.linalg.norm(path.step_mm, axis=1).sum() == pytest.approx(
        math.hypot(3.0 * math.tau * 10.0, 30.0), rel=1e-3
    )
    _, path = run(dvf, "G0 X10 Y0 Z-200\nG3 X0 Y10 I-10 P2")
    way = np.linalg.norm(path.step_mm, axis=1).sum()
    assert way == pytest.approx(1.25 * math.tau * 10.0, rel=1e-3)


def test_as_controls_take_it(dvf: Scene):
    read, path = run(dvf, ":1000\nG0 X0 Y0 Z-200\nN30 /2 G1 X10\nG83 X20 Z-212 R-202 Q-4")
    assert (read.remarks, path.coordinates["X"][-1], read.blocks) == ({"/": 3}, 20.0, 3)
    assert run(dvf, "%\n<O1000>\nG0 X0 Y0 Z-200")[0].blocks == 1


@pytest.mark.parametrize(
    ("text", "said"),
    [("G1 X10 R2 F100", "R2; expected no R with G1"), ("G0 X10 K4", "K4; expected no K with G0"),
     ("G81 X1 Z-9 R-1 I4", "I4; expected no I with G81"),
     ("G3 X1 I.5 L2", "L2; expected no L with G3"), ("M128", "M128; expected"),
     ("G50 X5", "G50; expected no axis"), ("G0 X1 G2", "G2; expected it in another block")],
)  # fmt: skip
def test_a_letter_without_a_known_meaning_ends_the_path(dvf: Scene, text: str, said: str):
    read, _ = run(dvf, f"G0 X0 Y0 Z0\n{text}\nX50")
    assert (read.refused[2] + read.reasons[2]).startswith(said)
    assert read.blocks == 1


@pytest.mark.parametrize("offset", ["H1=1e9", "G54X=-10001"])
def test_offsets_are_bounded_as_lengths_are(dvf: Scene, offset: str):
    asked = next(one for one in Program.options() if one.name == "offset")
    with pytest.raises(ValueError, match="expected at most ±10000"):
        asked.grammar.read(offset, dvf)


@pytest.mark.parametrize(
    ("block", "message"),
    [
        *(
            (f"{word}{'9' * 400}", f"{word[-1]}9{{37,39}}…; expected at most ±")
            for word in ("N", "G1 X", "G1 X1 F", "G2 I5 P", "S", "G81 X1 Z-5 R1 L", "H")
        ),
        ("G1 X0." + "1" * 400, "X0.1+…; .* in up to 40 characters"),
        ("G1 X1 AB" + "9" * 400, "AB9+…; expected a"),
        ("O" + "9" * 400, "O9{37,39}…; expected at most ±99999999"),
        ("G1 X1 F100000000", "F100000000; expected at most ±99999999"),
        ("G1 X1\u2028G0 Z-300", r"'\\u2028G0'; expected a letter and a number"),
        ("G2 I5 P1001", "P1001; expected at most 1,000 turns"),
        ("G2 I5 P99999999", "P1e[+]08; expected at most 1,000 turns"),
        ("G81 X1 Z-5 R1 L9999999", "L9999999; 59,999,994 moves; .* 40,000"),
        ("G83 X1 Z-500 R1 Q.1 K3", "K3; 45,099 moves; .* 40,000"),
        ("G2 X0 Y.004 I.00000001", "G2; radii are 0.0000 and 0.0040 mm"),
    ],
)
def test_numbers_of_a_program_are_bounded_before_anything_moves(dvf: Scene, block, message):
    read = read_program(dvf, ["G0 X0 Y0 Z0", block])
    assert re.match(message, read.refused[2] + read.reasons[2])
    assert read.blocks == 1


def test_a_line_comes_to_a_limited_number_of_samples(dvf: Scene):
    read = read_program(dvf, ["G0 X0 Y0 Z0", "G2 I99999 P900"])
    with pytest.raises(OptionError, match=r"line 2: its moves have .* at most 100,000"):
        trace_program(read)


def test_a_program_has_the_lines_of_its_file_wherever_it_comes_from(tmp_path: Path):
    text = "G0 X1 ; a\x0bb\x85c\u2028d\r\nG1 X2\rG1 X3\n"
    path = tmp_path / "p.ngc"
    path.write_text(text, "utf-8", newline="")
    assert [*Program(text=text).lines()] == [*Program(file=str(path)).lines()]
