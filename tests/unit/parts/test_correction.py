"""Corrected programs: read back and run on the model, they leave what their words cannot say."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import warpspace
from warpspace.cli.main import cli
from warpspace.exceptions import OptionError, SceneError
from warpspace.parts.gcode.interpreter import read_program
from warpspace.parts.program import Program, ToolPath, correct_program, trace_program
from warpspace.scene.library import parse_scene
from warpspace.scene.model import Scene

CONTOUR = Path(__file__).parent / "contour.ngc"


@pytest.fixture(scope="module")
def dvf() -> Scene:
    return warpspace.load_scene("dvf5000_first")


def correct(scene: Scene, lines: Sequence[str], **asked) -> list[str]:
    program = Program(text="\n".join(lines), **asked)
    return [*correct_program(program, read_program(scene, lines, program))]


def trace(scene: Scene, lines: Sequence[str], chord_mm=0.1, **asked) -> ToolPath:
    return trace_program(read_program(scene, lines, Program(**asked)), chord_mm)


def actual(path: ToolPath) -> np.ndarray:
    return path.tip_mm + path.error_um / 1e3


def is_end(path: ToolPath) -> np.ndarray:
    return np.append(path.line[1:], -1) != path.line


def random_scene(seed: int) -> Scene:
    rng = np.random.default_rng(seed)
    rotary = "".join(rng.permutation(list("ABC"))[:2])
    axes = "".join(rng.permutation(list("XYZ" + rotary)))
    cut = int(rng.integers(0, 6))
    text = [f'title = "r"\n[machine]\nchain = "w{axes[:cut]}F{axes[cut:]}t"\n[machine.offset_mm]']
    text += [f"{axis} = {rng.uniform(-300, 300, 3).tolist()}" for axis in axes]
    text += ["[machine.direction]", *(f"{axis} = {rng.choice([-1, 1])}" for axis in axes)]
    text += ["[workspace]", "X = [-300, 300]\nY = [-300, 300]\nZ = [-300, 300]"]
    text += [*(f"{axis} = 0" for axis in rotary), "[errors]"]
    for key in rng.permutation(parse_scene("\n".join(text), "r").parameter_keys)[:12]:
        low, high = rng.normal(0.0, 60.0, 2)
        table = "" if "0" in key else f"{{ table = [[-100, {low}], [80, {high}]] }}"
        text.append(f"{key} = {table or low}")
    return parse_scene("\n".join(text), "random")


@pytest.mark.parametrize("count", [6, pytest.param(100, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("tcp", ["always", "never"])
def test_random_machines_cut_the_nominal_points(tcp: str, count: int):
    for seed in range(count):
        scene = random_scene(seed)
        turn = next(axis for axis in "ABC" if axis in scene.machine.axes)
        lines = [
            f"G55 G0 X1 Y2 Z-3 {turn}0", f"G43.4 H1 G1 X9 Y1 Z4 {turn}12.5 F500",
            "G91", f"X30.5 Z-20 {turn}12.5", f"G90 G20 X.5 Y-1 Z2 {turn}-70",
            "N5 G21 G54 X-80 Y40 Z-50 M9", "G2 X-70 Y50 I10", "G1 X-70 Y50", "G49 X-80 Y40 Z9",
        ]  # fmt: skip
        offset = ("G54X", 3.0), ("G55Y", -7.25), (f"G55{turn}", 20.0)
        asked = {"tcp": tcp, "length_mm": 60.0, "offset": offset, "within_um": 100.0}
        wanted, found = (
            trace(scene, some, **asked) for some in (lines, correct(scene, lines, **asked))
        )
        left = actual(found)[is_end(found)] - wanted.tip_mm[is_end(wanted)][:, None]
        left_um = 1e3 * np.linalg.norm(left, axis=-1).min(axis=1)
        assert left_um.max() <= 0.1 + np.sqrt(3.0) * 0.127, seed  # the word in inches, 1e-5


def test_between_its_points_it_stays_within(dvf: Scene):
    lines, asked = CONTOUR.read_text().splitlines(), {"length_mm": 80.0, "within_um": 0.5}
    wanted, found = (
        trace(dvf, some, 1e-4, **asked) for some in (lines, correct(dvf, lines, **asked))
    )
    cut = np.isin(wanted.line, [*range(7, 12)])
    fine, here = wanted.tip_mm[cut], actual(found)[np.abs(found.tip_mm[:, 2] + 220.0) < 1.0]
    start, way = fine[:-1], np.diff(fine, axis=0)
    for point in here[::7]:
        share = np.clip(np.sum((point - start) * way, 1) / np.sum(way * way, 1), 0.0, 1.0)
        nearest = start + share[:, None] * way
        assert np.linalg.norm(point - nearest, axis=1).min() <= 1e-3 * (0.5 + 0.1 + 0.1)


def test_words_that_do_not_lead_are_kept(dvf: Scene):
    text = """%
    O0012 (a part)
    N10 g91 (kept) g28 z0
    N20 G90 G54 G0 X10 Y20 S900 M3 ; fast
    N30 G43 H1 Z-100 M8
    /N40 G99 G82 Z-120 R-102 P2
    X30
    N50 G80 (done)
    G93 G1 X40 F2 M5
    G2 X40 Y40 R10 F3
    G53 G0 Z-80
    G94 X50 M30
    %
    rest""".splitlines()
    lines = correct(dvf, [line.strip() for line in text])
    found = [re.sub(r"-?\d+\.\d{2,}", lambda x: f"{float(x[0]):.0f}", line) for line in lines]
    assert found[:2] == ["%", "O0012 (a part)"]
    assert found[2].startswith("(corrected for DVF5000, first machine measured, chain wCBFXYZt")
    assert found[5:10] == [
        "G90", "G91 N10 (kept) g28 z0", "G90", "N20 G0 X10 Y20 G54 S900 M3 ; fast",
        "N30 G0 X10 Y20 Z-100 G43 H1 M8",
    ]  # fmt: skip
    assert found[10:16] == [
        "/N40 G0 X10 Y20 Z-102 G99", "/G1 X10 Y20 Z-120", "/G4 P2", "/G0 X10 Y20 Z-102",
        "G0 X30 Y20 Z-102", "G1 X30 Y20 Z-120",
    ]  # fmt: skip
    assert found[18:20] == ["N50 G80 (done)", "G1 X40 Y20 Z-102 F2.0 M5 G93"]
    arc = [line for line in found[20:] if "F" in line]
    assert len(arc) > 2
    assert {line.split("F")[1] for line in arc} == {f"{3 * len(arc)}.0"}
    assert found[-4:] == ["G53 G0 Z-80", "G0 X50 Y40 M30 G94", "%", "rest"]


@pytest.mark.parametrize(
    "text",
    [
        "G0 X0 Y0 Z-200\nG52 X10 Y5\nG0 X0 Y0\nG1 X20\nG52 X0 Y0\nX0 Y0",
        "G10 L2 P1 X7.\nG0 X0 Y0 Z-200\nG1 X9\nG91 G30 Z0\nG90 G0 Z-210\nG1 X3",
        "(HAAS)\nG0 X0 Y0 Z-200\nG83 X5. Z-220 R-202 I8 J2 K3\nX9\nG80\nG98 G85 X5 Z-220 R-202",
        "G500 G0 X0 Y0 Z-200 D0\nZ-150 D1\nG1 X10\nG2 X0 Y-10 I=AC(10) J=AC(-10)\nX-9 Y-1 CR=15",
        "G0 X0 Y0 Z-400\nG56 H1 Z-300\nG1 X30\nG53\nG1 X9 Z-310",
        "G0 X0 Y0 Z-200\nG1 X50 ,R5.\nY50 ,C2.\nX0",
        "G500 G0 X0 Y0 Z-200\nG1 X50 RND=5\nY50 CHF=2\nX0 CHR=3\nY9",
        "G0 X0 Y0 Z-200 B0 C0\nD1\nTRAORI\nG1 X5 Y5 Z-190\nX9 B10 C20\nTRAFOOF\nG1 X3 Y5 Z-190",
        "G0 X0 Y0 Z-200\nSCALE X5 Y5\nG1 X9 M777\nX3",
    ],
)
def test_other_words_of_a_corrected_program_mean_the_same(dvf: Scene, text: str):
    asked = {"length_mm": 60.0, "skip": ("SCALE", "M777")}
    lines = text.splitlines()
    wanted, found = (trace(dvf, some, **asked) for some in (lines, correct(dvf, lines, **asked)))
    ends, corrected = wanted.tip_mm[is_end(wanted)], actual(found)[is_end(found)]
    away_um = 1e3 * np.linalg.norm(corrected - ends[:, None], axis=-1).min(axis=1)
    assert away_um.max() <= 0.2


@pytest.mark.parametrize(
    ("lines", "said"),
    [(["G0 X1 Y1 Z1", "M98 P1"], "line 2: M98"), (["G0 X1 Y1 Z1", "G1 X9 R2"], "line 2: R2"),
     (["G0 X1 Y1 Z1", "G84 Z-5 R0"], "line 2: G84"), (["G0 X1 Y1 Z1", "G92 X0"], "line 2: G92"),
     (["G0 X1 Y1 Z1", "G68 R5"], "line 2: G68"), (["G91 G1 X1"], "expected G90 and X, Y, Z before"),
     (["G0 X1 Y1 Z1 C9", "G43.4 H1 X2"], "line 2: G43.4"),
     (["G0 X1 Y1 Z1 C9", "TRANS X5"], "line 2: TRANS"),
     (["G0 X1 Y1 Z1 C9", "G68.2 X0 Y0 Z0 I0 J5 K0", "G53.1"], "line 3: G53.1"),
     (["G0 X1 Z1", "G2 X1 I5"], "expected G90 and Y before"),
     (["G90 X1 Y1 Z1", "G55 G91 Z1"], "line 2: moves from a place not known")],
)  # fmt: skip
def test_what_cannot_be_corrected_is_said(dvf: Scene, lines: list[str], said: str):
    with pytest.raises((OptionError, SceneError), match=said):
        correct(dvf, lines)


def test_the_command_keeps_what_it_reads(tmp_path: Path):
    file, other = tmp_path / "a.ngc", tmp_path / "b.ngc"
    file.write_text(CONTOUR.read_text())
    arguments = ["program", "dvf5000_first", str(file), "--length", "80", "-o"]
    assert CliRunner().invoke(cli, [*arguments, str(file), "--force"]).exit_code != 0
    assert file.read_text() == CONTOUR.read_text()
    assert CliRunner().invoke(cli, [*arguments, str(other)]).exit_code == 0
    first = other.read_text()
    assert CliRunner().invoke(cli, [*arguments, str(other), "--force"]).exit_code == 0
    assert other.read_text() == first


def test_holes_and_turns_are_written_out(dvf: Scene):
    lines = (
        "G90 G0 X0 Y0 Z-200\nG99 G81 X9 Z-220 R-205 K1\nG80\nG17 G3 X9 I-5 Z-190 P2".splitlines()
    )
    found = correct(dvf, lines)
    assert not [line for line in found if re.search("[IJKLPR]", line) and "(" not in line]
    wanted, path = (trace(dvf, some) for some in (lines, found))
    length = [np.linalg.norm(one.step_mm, axis=1).sum() for one in (wanted, path)]
    assert length[1] == pytest.approx(length[0], abs=0.1)


def test_a_corrected_program_has_no_control_characters_and_no_exponents(dvf: Scene):
    text = (
        "(a\x0bG0 Z-300)\nG0 X0 Y0 Z-100 ; b\u2028c\x85d\x1b[2J\n"
        "G82 X5 Z-120 R-110 P2500000.5\nG80\nG93 G1 X9 F99999999\nM30\nrest\x0c\n"
    )
    outcome = Program(file="p", text=text).run(dvf, lambda _: None)
    lines = outcome.output_files()[""].removesuffix("\n").split("\n")
    assert all(line.isprintable() for line in lines)
    assert any(line.endswith("; b c d [2J") for line in lines)
    assert "G4 P2500000.5" in lines
    assert not re.search(r"[0-9]e[+-]?[0-9]|inf|nan", "".join(lines))
