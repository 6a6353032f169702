"""Words of programs from the shop: executed, known to move no axis, or the end of the path."""

import math
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

import warpspace
from warpspace.analysis.description import ignore_progress
from warpspace.cli.main import cli
from warpspace.exceptions import SceneError
from warpspace.parts.program import Program, ProgramResult

MILL, PRINTER = "machine_gantry_mill", "machine_printer_3d"
BC, AC = "machine_trunnion_bc", "machine_trunnion_ac"


def run(text: str, scene: str = MILL, **options: Any) -> ProgramResult:
    program = Program(file="p.nc", text=text, **options)
    return program.run(warpspace.load_scene(scene), ignore_progress)


START = "G21 G90 G17\nG0 X0 Y0 Z0\nG1 X10 F100\n"


@pytest.mark.parametrize(
    ("block", "word"),
    [
        ("SCALE X2", "SCALE"), ("AROT Z30 A5", "A5"), ("G101 X0", "G101"),
        ("G7.1 C50", "G7.1"), ("M777 X500 Y500", "M777"), ("G68.1 R45", "G68.1"),
        ("G71 I30 J0 K30 L4", "G71"), ("G51 X0", "G51"), ("G50 X3", "G50"),
        ("M128", "M128"), ("G5", "G5"), ("G8", "G8"),
        ("CYCLE800(1,\"TC1\",0)", "CYCLE800"), ("MCALL CYCLE83(1)", "MCALL"),
        ("G1 X50 ,B5.", ",B5."), ("G1 X50 A5", "A5"), ("G58 X10 Y20", "G58"), ("R1=5", "R1=5"),
        ("G83 Z-5. R1.", "G83"), ("G83 Z-5. R1. Q0.", "G83"), ("G83 Z-5 R1 Q1 K0.2", "K0.2"),
        ("ROT X4 RPL=45", "ROT"), ("M98 P7", "M98 P7"), ("G41 D1 X9", "G41"), ("X=R1", "X=R1"),
    ],
)  # fmt: skip
def test_the_path_ends_before_a_word_that_is_not_known(tmp_path: Path, block: str, word: str):
    result = run(f"{START}{block}\nG1 X500 Y500")
    assert next(iter(result.program.refused.values())) == word
    assert result.length_mm == pytest.approx(10.0)
    (tmp_path / "a.nc").write_text(f"{START}{block}\nG1 X500 Y500")
    files = [str(tmp_path / "a.nc"), "-o", str(tmp_path / "b.nc")]
    outcome = CliRunner().invoke(cli, ["program", MILL, *files])
    assert outcome.exit_code
    assert not (tmp_path / "b.nc").exists()


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("SCALE X5 Y5\nG0 X1", r"line 1: SCALE; expected"), ("M8\nM30", "moves no axis"),
    ],
)  # fmt: skip
def test_a_program_without_motion_is_an_error(text: str, problem: str):
    with pytest.raises(SceneError, match=problem):
        run(text)


def test_words_to_skip_are_ignored_and_stated():
    text = f"{START}TRANS X100 Y50\nG101 X0 M8\nX20 A5 M777\nG0 M0777 X30"
    result = run(text, skip=("TRANS", "G101", "M777", "A5"))
    assert result.program.skipped == {
        "TRANS X100 Y50": 4,
        "G101 X0": 5,
        "A5 M777": 6,
        "M777 X30": 7,
    }
    assert (result.length_mm, result.program.refused) == (pytest.approx(20.0), {})
    assert {"line": 4, "words": "TRANS X100 Y50"} in result.as_json()["skipped"]
    stated = [*map(str, result.blocks()), *result.caveats()]
    assert sum("TRANS X100 Y50 (line 4)" in text for text in stated) == 1


def test_a_printer_executes_words_of_slicers():
    text = "G28 W\nG29\nG92 E0.0\nM117 Layer 1/20 X9\nG1 Z2.0 F3000\nX10.1 Y20 Z0.28\nX10.1Y90.E0.5"
    result = run(text, PRINTER)
    assert (result.program.refused, result.program.dialect) == ({}, "printer")
    assert result.length_mm == pytest.approx(94.4715, abs=1e-3)


@pytest.mark.parametrize(
    ("text", "offset", "length"),
    [
        # SINUMERIK: header, axis positions, names of tools, absolute centres, radii
        ("G0 SUPA X0 Y0 Z0\nX=10 Y=IC(3)\nX=IC(-4) Y=AC(0)", {}, math.hypot(10, 3) + 5),
        # shifts, work offsets, positions that are set
        ("G0 X0 Y0 Z0\nG52 X100 Y50\nX0 Y0\nG52 X0 Y0\nX0 Y0", {}, 2 * math.hypot(100, 50)),
        ("G0 X5. Y0 Z0\nG92 X0 Y0\nX10\nG92.1\nX10", {}, 15.0),
        ("G10 L2 P2 X7.\nG0 X0 Y0 Z0\nG55 X0", {}, 7.0),
        ("G10 L10 P3 R40.\nG0 X0 Y0 Z0\nG43 H3 Z-50", {}, 10.0),
        ("G0 X0 Y0 Z0\nG54.1 P3 X1", {"G54.1P3X": 8.0}, 9.0),
        ("G0 X0 Y0 Z0\nG154 P3 X1", {"G54.1P3X": 8.0}, 9.0),
        ("G0 X0 Y0 Z0\nG1 G41 D1 X9", {"D1": 0.0}, 9.0),
        # corners, also without blanks
        ("G0X0Y0Z0\nG1X-30.,R10.\nY-30.", {}, 40 + 5 * math.pi),
        # rotation in the plane
        ("G0 X0 Y0 Z0\nG68 X0 Y0 R90.\nG1 X10 Y0\nX10 Y5\nG69\nX0 Y0", {}, 15 + math.hypot(10, 5)),
        # cycles: G83 K according to Haas, pecks of I, J, K; up at the feed; reference point 2
        ("G91 G30 Z0\nG90 G0 X0 Y0\nZ10\nG1 Z0\nX50\nG91 G30 Z0\nG90 G0 Z5\nG1 X60", {}, 70.0),
        # subprograms with repetitions
        ("G0 X0 Y0 Z0\nM98 P30012\nM30\nO12\nG91 X1\nG90\nM99", {}, 3.0),
        ("G0 X0 Y0 Z0\nM97 P5 L2\nM30\nN5 G91 X1\nM99", {}, 2.0),
        (("o100 sub\nG91 X1 (one)\nG90\no100 endsub\nG0 X0 Y0 Z0\no100 call\no2 repeat [3]\n"
          "o100 call\no2 endrepeat (thrice)\no3 repeat [0]\nX99\no3 endrepeat\nM2"), {}, 4.0),
        ("o<side> sub\nG1 X10\no<side> endsub\nG0 X0 Y0 Z0\no<side> call\nM2", {}, 10.0),
        # corners of SINUMERIK: radius, leg and length of a chamfer
        ("G0 X0 Y0 Z0 SUPA\nG1 X50 RND=5\nY50 CHR=2\nX0 CHF=2\nY0", {},
         45 + 2.5 * math.pi + 43 + 8**0.5 + 48 - 2**0.5 + 2 + 50 - 2**0.5),
    ],
)  # fmt: skip
def test_common_constructs(text: str, offset: dict[str, float], length: float):
    result = run(text, offset=tuple(offset.items()))
    assert result.program.refused == {}
    assert result.length_mm == pytest.approx(length, abs=2e-3)


def test_shifts_of_the_programs_of_controls():
    """Words of an unshifted program, and those after a shift, lead to the same path."""
    shifted = "G17 G90 G54\nG0 X0 Y0 Z10\nTRANS X100 Y50\nG1 X0 Y0 Z0 F300\nX10\nTRANS\nG0 Z10"
    reference = "G17 G90 G54\nG0 X0 Y0 Z10\nG1 X100 Y50 Z0 F300\nG1 X110\nG0 Z10"
    assert run(shifted).length_mm == pytest.approx(run(reference).length_mm)
    unnamed = run(shifted.replace("G1 X0 Y0 Z0", "G1 Z0"))
    assert unnamed.program.refused == {4: "G1"}


@pytest.mark.parametrize(
    ("text", "options", "caveat"),
    [
        ("G0 X1 Y1 Z1", {"offset": (("H1", 5.0), ("G54X", 1.0), ("G55X", 1.0))}, "H1, G55X"),
        ("G0 X1. Y1. Z1. H4", {}, "H4 without G43 (line 1)"),
        ("G0 X50000 Y1. Z1.", {}, "X50000 (line 1); unless a least increment"),
        ("%\nG0 X1. Y1. Z1.\nG91.1\nSUPA", {}, "linuxcnc (line 3, G91.1), sinumerik"),
        ("G0 X1. Y1. Z1.\nG73 Z0 R1. Q.5", {}, "G73 without the retraction"),
    ],
)  # fmt: skip
def test_assumptions_are_stated(text: str, options: Any, caveat: str):
    assert any(caveat in remark for remark in run(text, **options).as_json()["remarks"])


@pytest.mark.parametrize("frame", ["present", "zero"])
def test_the_frame_of_a_turned_table_is_stated(frame: Any):
    text = "G0 X0 Y0 Z0 A0 C90.\nG43.4 H1 Z-100.\nX50."
    result = run(text, AC, offset=(("H1", 100.0),), tcp_frame=frame)
    stated = "as it stands" if frame == "present" else "at rotary zero"
    assert any(f"G43.4 at C90: workpiece frame {stated}" in remark for remark in result.caveats())


def test_the_least_increment_scales_numbers_without_a_point():
    text = "G21G90\nG0X0Y0Z10000\nG1X50000F300\nY50.\nG20 Y0\nX10000"
    result = run(text, least_increment=0.001)
    assert result.length_mm == pytest.approx(50 + 50 + 50 + 50 - 25.4)
    assert run("G0 X0 Y0 Z0\nX50000").length_mm == pytest.approx(50_000.0)


def test_programs_in_utf16_are_read(tmp_path: Path):
    path = tmp_path / "p.nc"
    path.write_text("%\nO1\nG0 X0 Y0 Z10.\nG1 X50. F300\n", "utf-16")
    program = Program(file=str(path))
    assert program.run(warpspace.load_scene(MILL), ignore_progress).length_mm == pytest.approx(50.0)


def test_a_subprogram_without_its_end_is_refused():
    result = run(f"{START}M98 P8\nM30\nO8\nX20")
    assert result.program.refused == {7: "X20"}
    assert result.program.reasons[7] == "; expected M99 at the end of the subprogram"


def test_the_command_line_reads_dialect_and_words_to_skip(tmp_path: Path):
    (tmp_path / "a.nc").write_text(f"{START}TRANS X100 Y50\nM777\nX20\n")
    arguments = ["program", MILL, str(tmp_path / "a.nc")]
    skip = ["--skip", "TRANS,M777", "--dialect", "sinumerik"]
    text = CliRunner().invoke(cli, [*arguments, *skip]).output
    assert "Ignored as requested: TRANS X100 Y50 (line 4)" in text
    assert "3 blocks, 20.0 mm" in text
    assert (
        "is not one of 'auto', 'fanuc'"
        in CliRunner().invoke(cli, [*arguments, "--dialect", "x"]).output
    )
