"""Files that are not as they should be: read rightly, doubted or refused."""

import codecs
import sys
from dataclasses import replace

import numpy as np
import pytest

from bench_scenes import scene_with
from warpspace.analysis.uncertainty.propagation import scene_uncertainty
from warpspace.bench.base import find_test, run_test
from warpspace.calibration.registry import parse_readings
from warpspace.exceptions import SceneError
from warpspace.formats import source
from warpspace.formats.registry import (
    ReadOptions,
    find_format,
    open_upload,
    read_errors,
    recognise,
)
from warpspace.formats.source import MAX_BYTES, source_of_bytes, source_of_text
from warpspace.formats.to_scene import build_imported_scene
from warpspace.kinematics.model import Loop
from warpspace.scene.library import load_scene, parse_scene

GOOD = "X [mm],EXX [um],EAX [urad]\n-100,1,2\n0,0,0\n100,-1.5,3\n"
MACHINE = load_scene("dvf5000_nominal").machine


def read(text, name="file.csv", **options):
    return read_errors([source_of_text(text, name)], ReadOptions(**options)).imported


@pytest.mark.parametrize(
    "content",
    [
        codecs.BOM_UTF8 + GOOD.encode(),
        *(GOOD.encode(encoding) for encoding in ("utf-8", "utf-16", "utf-16-le", "utf-16-be")),
        GOOD.replace("\n", "\r\n").encode(),
        GOOD.replace("\n", "\r").encode(),
        GOOD.rstrip("\n").encode(),
        ("# gemessen in München\n" + GOOD).encode("cp1252"),
        GOOD.replace("[um]", "[mm]").replace(",1,", ",0.001,").replace("-1.5", "-0.0015").encode(),
        GOOD.replace("[urad]", "[arcsec]")
        .replace(",2\n", ",0.41252961\n")
        .replace(",3\n", ",0.61879442\n")
        .encode(),
    ],
)
def test_the_same_table_in_any_spelling(content):
    exx, eax = read_errors([source_of_bytes(content, "t.csv")], ReadOptions()).imported.series
    assert (exx.key, eax.key) == ("EXX", "EAX")
    assert exx.positions == (-100.0, 0.0, 100.0)
    assert exx.values == pytest.approx([1.0, 0.0, -1.5])
    assert eax.values == pytest.approx([2.0, 0.0, 3.0], abs=1e-7)


def com(rows):
    lines = [f"{i}  {q}  0.1\n" for i, q in enumerate(rows)]
    return "BEGIN T_X.COM MM\nNR AXISPOS X\n" + "".join(lines) + "[END]\n"


COMP = "".join(f"{i} 0.001 0.001\n" for i in range(257))
JOINT = "[JOINT_9]\nCOMP_FILE = j.comp\nCOMP_FILE_TYPE = 1\n"


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("x.csv", "X [mm],EXX [um]\n" + "0,1\n" * 100_002, "line 100002: more than 100,000 rows"),
        ("T_X.COM", com(range(257)), "257.*at most 256"),
        ("T_X.COM", com([0] * 100_000), "line 259.* 100000 rows.* at most 256"),
        ("j_X.comp", COMP, "line 257: more than 256 rows"),
        ("j_X.comp", "1 0 0\n0 0 0\n", "line 2: nominal 0 after 1"),
        ("joint.comp", "0 0 0\n1 0 0\n", "its axis"),
        ("machine.ini", JOINT, r"line 1: section \[JOINT_9\]; expected a joint from 0 to 8"),
    ],
    ids=lambda part: part[:20],
)
def test_rows_that_are_too_many_and_other_tables_are_refused_with_their_line(name, text, said):
    with pytest.raises(SceneError, match=f"{name}: .*{said}"):
        read(text, name)


def test_a_second_table_of_an_axis_is_refused_not_added():
    comp = "0 0.001 0.002\n10 0.001 0.002\n"
    for ending, text, word in (("comp", comp, "of"), ("COM", com((0, 1)), "over")):
        tables = [source_of_text(text, f"{name}_X.{ending}") for name in "ab"]
        said = rf"b_X\.{ending}: is a second table {word} X; expected one"
        with pytest.raises(SceneError, match=said):
            read_errors(tables, ReadOptions())


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"a" * (MAX_BYTES + 1), "bytes long"), (b"a" * 20_000, "line 1 is longer"),
        (b"\n" * 2_000_001, "lines"), (b"X [mm]\n\x00\x01\x02\x03\n", "null bytes"),
        (b" \n\n", "is empty"),
    ],
    ids=["big", "long", "many", "binary", "empty"],
)  # fmt: skip
def test_sizes_of_hostile_files(content, said):
    with pytest.raises(SceneError, match=said):
        source_of_bytes(content, "file")


@pytest.mark.parametrize(
    ("name", "content", "fragment"),
    [
        ("a.rtx", b"anything", "laser interferometer"),
        ("a.pdf", b"%PDF-1.4", "PDF"),
        ("a.vcs", b"x", "SINUMERIK VCS"),
        ("a.tab", b"TAB TEXT", "may be a HEIDENHAIN kinematics table"),
        ("a.tab", b"24 -1448819\n0\n-32\n-38\n", "is a screw compensation table of Centroid"),
        ("a.map", b"-10.0,-10.001\n0,0\n10,10.002\n", "pairs of numbers.*Mach3"),
        ("a.txt", b"#\nND-280 MM\nAXIS X1 = 0\n", "digital readout"),
        ("a.txt", b"%\nN10000 Q1 P0\nN10001 Q1 P-1\n", "pitch error data of FANUC"),
        ("a.REN", b"Renishaw compensation\nCompensation type: Mean\n", "Renishaw"),
        ("a.dat", b"unit = mm\n[X]\n0, 0.000, 0.010\n", "EasyRoute"),
        ("a.cfg", b"#*# [bed_mesh default]\n#*# version = 1\n", "bed mesh of Klipper"),
    ],
)
def test_what_has_no_public_structure_is_refused_by_name(name, content, fragment):
    with pytest.raises(SceneError, match=f"{fragment}.*expected another file"):
        recognise([open_upload(name, content)])


@pytest.mark.parametrize("ending", [".tab", ".map", ".cmp", ".xlsx"])
def test_no_file_is_identified_by_its_ending(ending):
    source = open_upload(f"a{ending}", GOOD.encode())
    assert recognise([source]).name == "csv"


@pytest.mark.parametrize("content", [b"PK\x03\x04...", b"\xd0\xcf\x11\xe0"])
def test_spreadsheets_need_their_reader(content, monkeypatch):
    monkeypatch.setitem(sys.modules, "python_calamine", None)
    with pytest.raises(SceneError, match="is a spreadsheet; expected the package python-calamine"):
        open_upload("a.csv", content)


def circle(angles, tmp_path, **options):
    path = tmp_path / "c.csv"
    rows = [f"{angle:.9g},{5.0 * np.sin(angle)}" for angle in angles]
    path.write_text("angle_deg,radial_um\n" + "\n".join(rows), encoding="utf-8")
    return run_test(scene_with(), find_test("circular")(**options), path).notes


def test_an_arc_other_than_that_of_the_test(tmp_path):
    quarter = np.linspace(0.0, 90.0, 91)
    said = "the readings run 0 … 90°, the test is set to 0 … 360°: the figures are of the readings"
    assert said in circle(quarter, tmp_path)
    assert not any("set to" in one for one in circle(quarter, tmp_path, end_deg=90.0))
    assert not any("set to" in one for one in circle(np.arange(0.0, 360.0, 10.0), tmp_path))


def test_angles_that_look_like_radians(tmp_path):
    turn = np.deg2rad(np.arange(0.0, 360.0, 7.3))
    assert any("in radians that would be 0 … 357.7°" in one for one in circle(turn, tmp_path))
    degrees = np.linspace(0.0, 5.0, 25)
    assert not any("radians" in one for one in circle(degrees, tmp_path, end_deg=5.0))


@pytest.mark.parametrize(
    ("head", "rows", "said"),
    [
        ("c_deg", (0.0, 0.785398, 1.570796, 3.141593), "c_deg runs 0 … 3.142"),
        ("x_mm", (-275, 0, 275, 0), "line 5 is line 3 again"),
        ("x_mm", (-50, 0, 49), "data over X -50 … 49 mm, 18 % of its range -275 … 275 mm: the re"),
    ],
)
def test_readings_of_a_calibration_are_doubted_like_imports(head, rows, said):
    table = f"{head},ex_um,ey_um,ez_um\n" + "".join(f"{at},1,2,{at}\n" for at in rows)
    readings = parse_readings(table, "p.csv", load_scene("dvf5000_nominal"))
    assert any(said in one for one in readings.notes)
    assert len(readings) == len({*rows})


@pytest.mark.parametrize("text", ["a\nb\n", "a\r\nb", "a\rb\r", "\n\n"])
def test_lines_are_counted_before_they_are_split(monkeypatch, text):
    assert len(source.source_of_text(text, "file").lines) == 2
    monkeypatch.setattr(source, "MAX_LINES", 1)
    monkeypatch.setattr(source, "_LINE_ENDS", None)
    with pytest.raises(SceneError, match="has 2 lines; expected at most 1"):
        source.source_of_text(text, "file")


@pytest.mark.parametrize("measured", [True, False])
def test_the_runs_of_a_format_of_any_name_are_kept_where_it_says_so(measured):
    text = "X [mm],EXX [um],run,direction\n-100,1,1,+\n100,3,1,+\n-100,2,2,+\n100,5,2,+\n"
    reading = read_errors([source_of_text(text, "runs.csv")], ReadOptions())
    assert find_format("csv").measured
    assert find_format("rtl").measured
    plugin = replace(
        reading,
        format=replace(reading.format, name="mine", measured=measured),
        imported=replace(reading.imported, format="mine"),
    )
    scene = build_imported_scene(plugin, None, "runs", "runs.csv").scene
    assert ("EXX" in scene.measured) is measured


def test_lengths_that_do_not_close_are_told():
    said = " | ".join(read("SET_SKEW XY=141.4,124.1,100\n", "a.cfg").notes)
    assert "imply a side AB of 87.73 mm, -12.3 % from AD" in said


@pytest.mark.parametrize("u", ["", ",u(EXX) [um]"])
def test_errors_that_are_imported_leave_the_covariance_of_others(u):
    base = parse_scene(
        """machine = "dvf5000"
[errors]
EXX = 5
EC0Y = 20
[uncertainty.covariance]
keys = ["EXX", "EC0Y"]
matrix = [[4.0], [3.0, 9.0]]
measured_range = { X = [-10, 20], Y = 7 }
""",
        "base",
    )
    cells = ",0.5" if u else ""
    text = f"X [mm],EXX [um]{u}\n-100,1{cells}\n100,3{cells}\n"
    reading = read_errors([source_of_text(text, "x.csv")], ReadOptions())
    scene = build_imported_scene(reading, base, "", "x.csv").scene
    assert (scene.covariance.keys, scene.covariance.rows) == (("EC0Y",), ((9.0,),))
    assert set(scene.uncertainty) == ({"EXX"} if u else set())
    assert scene_uncertainty(scene, Loop.RELATIVE).unknown == (() if u else ("EXX",))
    assert scene.covariance.measured_range["X"] == ((-100.0, 100.0) if u else (-10.0, 20.0))
    alone = build_imported_scene(reading, None, "", "x.csv").scene
    assert (alone.covariance.measured_range if u else alone.covariance) == (
        {"X": (-100.0, 100.0)} if u else None
    )


def test_an_uncertainty_of_zero_is_refused_with_its_line():
    with pytest.raises(SceneError, match=r"line 2: u\(EXX\) '0'; .*above 0"):
        read("X [mm],EXX [um],u(EXX) [um]\n-9,1,0\n9,1,1\n")
