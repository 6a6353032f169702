"""Files that are not as they should be: read rightly, or refused with file and line."""

import codecs

import pytest

from warpspace.exceptions import SceneError
from warpspace.formats.importing import open_upload, read_errors
from warpspace.formats.kind import ReadOptions
from warpspace.formats.registry import recognise
from warpspace.formats.source import MAX_BYTES, source_of_bytes, source_of_text
from warpspace.formats.to_scene import into_scene
from warpspace.scene.library import load_scene

GOOD = "X [mm],EXX [um],EAX [urad]\n-100,1,2\n0,0,0\n100,-1.5,3\n"
MACHINE = load_scene("dvf5000_nominal").machine


def read(text: str, name: str = "file.csv", **options):
    """Read a text as a file."""
    return read_errors([source_of_text(text, name)], ReadOptions(**options)).found


def refused(text: str, *fragments: str, name: str = "file.csv", **options) -> None:
    """Check that a text is refused with a message of all fragments."""
    with pytest.raises(SceneError) as caught:
        read(text, name, **options)
    for fragment in (name, "expected", *fragments):
        assert fragment in str(caught.value), (fragment, str(caught.value))


@pytest.mark.parametrize(
    "content",
    [
        GOOD.encode(),
        codecs.BOM_UTF8 + GOOD.encode(),
        GOOD.encode("utf-16"),
        GOOD.encode("utf-16-le"),
        GOOD.encode("utf-16-be"),
        GOOD.replace("\n", "\r\n").encode(),
        GOOD.replace("\n", "\r").encode(),
        GOOD.replace(",", ";").replace(".", ",").encode(),
        GOOD.replace(",", "\t").replace(".", ",").encode(),
        GOOD.rstrip("\n").encode(),
        "\n".join('"' + row.replace(",", '","') + '"' for row in GOOD.splitlines()).encode(),
        "\n".join(
            '"' + row.replace(",", '";"').replace(".", ",") + '"' for row in GOOD.splitlines()
        ).encode(),
        ("# gemessen in München\n" + GOOD).encode("cp1252"),
        ("\n\n" + GOOD + "\n  \n,,\n").encode(),
        GOOD.replace("[um]", "[mm]").replace(",1,", ",0.001,").replace("-1.5", "-0.0015").encode(),
        GOOD.replace("[urad]", "[arcsec]")
        .replace(",2\n", ",0.41252961\n")
        .replace(",3\n", ",0.61879442\n")
        .encode(),
    ],
)
def test_the_same_table_in_any_spelling(content: bytes) -> None:
    found = read_errors([source_of_bytes(content, "t.csv")], ReadOptions()).found
    exx, eax = found.series
    assert (exx.key, eax.key) == ("EXX", "EAX")
    assert exx.positions == (-100.0, 0.0, 100.0)
    assert exx.values == pytest.approx([1.0, 0.0, -1.5])
    assert eax.values == pytest.approx([2.0, 0.0, 3.0], abs=1e-7)


def test_rows_in_another_order_are_sorted_and_it_is_said() -> None:
    found = read("X [mm],EXX [um]\n100,3\n-100,1\n0,2\n")
    assert found.series[0].positions == (-100.0, 0.0, 100.0)
    assert found.series[0].values == pytest.approx([1.0, 2.0, 3.0])
    assert any("sorted" in note for note in found.notes)


@pytest.mark.parametrize(
    ("text", "fragments"),
    [
        ("X [mm],EXX\n0,1\n", ("line 1", "EXX", "no unit")),
        ("X [mm],EXX [urad]\n0,1\n", ("line 1", "unit", "urad")),
        ("X [mm],EXX [um]\n0,1\n0,2\n", ("line 3", "line 2", "run and direction")),
        ("X [mm],EXX [um]\n0,1\n1\n", ("line 3", "1 fields", "2")),
        ("X [mm],EXX [um]\n0,1,5\n", ("line 2", "3 fields", "decimal commas")),
        ("X [mm],EXX [um],EAX [um]\n0,1,1\n", ("line 1", "EAX in 'um'", "urad, mrad")),
        ("X [cm],EXX [um]\n0,1\n", ("line 1", "X in 'cm'", "units um, mm")),
        ('X [mm],EXX [um]\n"1,000",1\n', ("line 2", "decimal comma")),
        ('X [mm],EXX [um]\n"1,1\n', ("line 2", "1 fields")),
        ("X [mm],EXX [um]\n0,abc\n", ("line 2", "'abc'", "finite number")),
        ("X [mm],EXX [um]\n0,nan\n", ("line 2", "finite number")),
        ("X [mm],EXX [um]\n0,1_0\n", ("line 2", "finite number")),
        ("X [mm],EXX [m]\n0,1\n", ("line 2", "is the unit right?")),
        ("X [mm],EXX [um],EXX [um]\n0,1,1\n", ("line 1", "EXX", "twice")),
        ("X [mm],EYY [um]\n0,1\n", ("EYY", "error of Y", "errors of X")),
        ("X [mm],EXQ [um],EXX [um]\n0,1,1\n", ("line 1", "EXQ", "did you mean")),
        ("X [mm],EXX [um]\n", ("no rows",)),
        ("X [mm],Z [mm],EXX [um]\n0,0,1\n10,0,1\n0,5,2\n", ("EXX", "X 10", "Z 5")),
        ("X [mm],run,direction,EXX [um]\n0,1,up,1\n", ("line 2", "'up'")),
        ("X [mm],run,direction,EXX [um]\n0,1,+,1\n1,1,+,1\n0,1,-,1\n", ("EXX", "backward")),
        ("EC0Y [urad]\n1\n2\n", ("2 rows", "one")),
    ],
)
def test_a_bad_measurement_table_is_refused(text: str, fragments: tuple[str, ...]) -> None:
    refused(text, *fragments)


@pytest.mark.parametrize(
    ("text", "fragments"),
    [
        ("[EXY]\nGridpoints = {\n0 0.001\n10 0.002\n", ("line 2", "EXY", "cut off")),
        ("[EXY]\nGridpoints = {\n10 0.001\n0 0.002\n}\n", ("line 4", "ascending")),
        ("[EXY]\nGridpoints = {\n10 0.001\n10 0.002\n}\n", ("line 4", "ascending")),
        ("[EXY]\nGridpoints = {\n10 0,001\n}\n", ("line 3", "decimal comma")),
        ("[EXY]\nVALUE = 1\n", ("line 2", "Gridpoints")),
        ("[C0B]\nVALUE = 3\n", ("line 2", "is the unit right?")),
        ("[C0B]\nVALUE = 1e-6\n[QQQ]\nVALUE = 1\n", ("line 3", "QQQ")),
        ("[C0B]\nVALUE = 1e-6\n[C0B]\nVALUE = 1e-6\n", ("line 3", "twice")),
    ],
)
def test_a_bad_etalon_file_is_refused(text: str, fragments: tuple[str, ...]) -> None:
    refused(text, *fragments, name="e.exc")


@pytest.mark.parametrize(
    ("text", "fragments"),
    [
        ("X EXX\n0 0.001\n0 0.002\n", ("line 3", "ascending")),
        ("X EXX\n0 0.001\n10\n", ("line 3", "1 fields")),
        ("Y EXX\n0 0.001\n", ("line 1", "EXX", "argument X")),
        ("X Y Z EXX\n0 0 0 0.001\n", ("line 1", "3 arguments")),
        ("Z X EXX\n0 0 0.001\n100 0 0.001\n0 10 0.001\n", ("EXX", "X 10", "Z 100")),
        ("X EXX\n", ("line 1", "without records")),
    ],
)
def test_a_bad_isg_file_is_refused(text: str, fragments: tuple[str, ...]) -> None:
    with pytest.raises(SceneError) as caught:
        read(text, "v.csv")
    for fragment in fragments:
        assert fragment in str(caught.value)


ENC = (
    "$AA_ENC_COMP[0,0,X]=0.001\n$AA_ENC_COMP[0,1,X]=0.002\n$AA_ENC_COMP[0,2,X]=0\n"
    "$AA_ENC_COMP_STEP[0,X]=10\n$AA_ENC_COMP_MIN[0,X]=0\n$AA_ENC_COMP_MAX[0,X]=20\n"
)


@pytest.mark.parametrize(
    ("change", "fragments"),
    [
        (("STEP[0,X]=10", "STEP[0,X]=7"), ("whole number of steps", "equal steps")),
        (("$AA_ENC_COMP[0,1,X]=0.002\n", ""), ("point 1 has no value",)),
        (("MAX[0,X]=20", "MAX[0,X]=10"), ("point 2", "last one to be 1")),
        (("$AA_ENC_COMP_MAX[0,X]=20\n", ""), ("$AA_ENC_COMP_MAX is missing", "cut off")),
        (("[0,1,X]=0.002", "[0,0,X]=0.002"), ("line 2", "given twice")),
        (("0.002", "0,002"), ("line 2", "decimal comma")),
        (("[0,1,X]", "[0,X]"), ("line 2", "[encoder, point, axis]")),
        (("$AA_ENC_COMP[0,2,X]=0\n", "hello\n"), ("line 3", "$VARIABLE")),
        (("X]", "Q]"), ("axis 'Q'", "--axis Q=AXIS")),
    ],
)
def test_a_table_that_a_controller_refuses(change, fragments) -> None:
    assert len(read(ENC, "x.ini").series) == 1
    with pytest.raises(SceneError) as caught:
        read(ENC.replace(*change), "x.ini", machine=MACHINE)
    for fragment in ("x.ini", *fragments):
        assert fragment in str(caught.value), (fragment, str(caught.value))


def com(rows: list[tuple[float, float]], end: str = "[END]\n") -> str:
    """Spell a .COM table."""
    lines = [f"{i}  {q}  {v}" for i, (q, v) in enumerate(rows)]
    return "BEGIN T_X.COM MM\nNR AXISPOS X\n" + "\n".join(lines) + "\n" + end


@pytest.mark.parametrize(
    ("rows", "end", "fragments"),
    [
        ([(float(i), 0.0) for i in range(257)], "[END]\n", ("257", "at most 256")),
        ([(0.0, 0.0), (1.0, 0.0), (3.0, 0.0)], "[END]\n", ("line 5", "step of 2", "equal steps")),
        ([(0.0, 0.0), (0.0, 0.0)], "[END]\n", ("line 4", "ascending")),
        ([(0.0, 0.0), (1.0, 0.0)], "", ("[END]", "cut off")),
    ],
)
def test_a_com_table_that_the_control_refuses(rows, end, fragments) -> None:
    refused(com(rows, end), *fragments, name="T_X.COM")
    assert read(com(rows[:2] if rows[1][0] else [(0.0, 0.1), (1.0, 0.2)]), "T_X.COM")


def test_too_many_or_unsorted_rows_for_linuxcnc() -> None:
    many = "".join(f"{i} 0.001 0.001\n" for i in range(257))
    refused_by = pytest.raises(SceneError, match=r"line 257: has more than 256 rows")
    with refused_by:
        read(many, "j_X.comp")
    with pytest.raises(SceneError, match="line 2: nominal 0 after 1"):
        read("1 0 0\n0 0 0\n", "j_X.comp")
    with pytest.raises(SceneError, match="which axis"):
        read("0 0 0\n1 0 0\n", "joint.comp")


def test_a_joint_beyond_those_of_linuxcnc_is_refused() -> None:
    text = "[JOINT_9]\nCOMP_FILE = j.comp\nCOMP_FILE_TYPE = 1\n"
    with pytest.raises(
        SceneError, match=r"line 1: section \[JOINT_9\]; expected a joint from 0 to 8"
    ):
        read(text, "machine.ini")


def test_a_second_table_of_an_axis_is_refused_not_added() -> None:
    comp = [source_of_text("0 0.001 0.002\n10 0.001 0.002\n", f"{n}_X.comp") for n in "ab"]
    with pytest.raises(SceneError, match=r"b_X\.comp: is a second table of X; expected one"):
        read_errors(comp, ReadOptions())
    tables = [source_of_text(com([(0.0, 0.1), (1.0, 0.2)]), f"{n}_X.COM") for n in "ab"]
    with pytest.raises(SceneError, match=r"b_X\.COM: is a second table over X; expected one"):
        read_errors(tables, ReadOptions())


def test_a_skew_factor_that_the_firmware_refuses_is_named_with_its_line() -> None:
    refused("G28\nM852 I5\n", "line 2", "factor 5 of XY", "±1", name="a.gcode")


def test_an_error_of_an_axis_that_the_machine_lacks_names_those_it_has() -> None:
    base = load_scene("dvf5000_nominal")
    found = read_errors([source_of_text("U [mm],EXU [um]\n0,1\n9,2\n", "u.csv")], ReadOptions())
    with pytest.raises(SceneError) as caught:
        into_scene(found, base, "", "u.csv")
    for fragment in ("u.csv", "EXU", "no axis U", "expected errors of X, Y, Z, B, C"):
        assert fragment in str(caught.value)


def test_a_million_rows_are_refused_at_the_line_that_is_too_many() -> None:
    text = "X [mm],EXX [um]\n" + "0,1\n" * 1_000_000
    refused(text, "1,000,000 rows", "at most 100,000", "line 100002")
    many = "BEGIN T_X.COM MM\nNR AXISPOS X\n" + "0 0 0\n" * 1_000_000 + "[END]\n"
    refused(many, "1000000 rows", "at most 256", "line 259", name="T_X.COM")


def test_sizes_of_hostile_files() -> None:
    with pytest.raises(SceneError, match="bytes long"):
        source_of_bytes(b"a" * (MAX_BYTES + 1), "big")
    with pytest.raises(SceneError, match="line 1 is longer"):
        source_of_text("a" * 20_000, "long")
    with pytest.raises(SceneError, match="lines"):
        source_of_text("\n" * 2_000_001, "many")
    with pytest.raises(SceneError, match="no text"):
        source_of_bytes(b"X [mm]\n\x00\x01\x02\x03\n", "binary")
    with pytest.raises(SceneError, match="is empty"):
        source_of_bytes(b" \n\n", "empty")


@pytest.mark.parametrize(
    ("name", "content", "fragment"),
    [
        ("a.xlsx", b"PK\x03\x04", "spreadsheet"),
        ("a.csv", b"PK\x03\x04...", "spreadsheet"),
        ("a.rtx", b"anything", "laser interferometer"),
        ("a.pdf", b"%PDF-1.4", "PDF"),
        ("a.vcs", b"x", "SINUMERIK VCS"),
    ],
)
def test_what_has_no_public_structure_is_refused_by_name(name, content, fragment) -> None:
    with pytest.raises(SceneError) as caught:
        open_upload(name, content)
    assert fragment in str(caught.value)
    assert "expected another file" in str(caught.value)


def test_an_unknown_file_names_the_formats_there_are() -> None:
    with pytest.raises(SceneError) as caught:
        recognise([source_of_text("hello\nworld\n", "x.txt")])
    for fragment in ("line 1", "'hello'", "no format that is known", "sinumerik-cec", "--format"):
        assert fragment in str(caught.value)


RTL = """HEADER::
File type  : rtl
Owner      : Linear
Version no : V20.02.02

TARGET DATA::
Filetype  : ISO
Target-count: 3
Targets :
0.000  100.000
200.000
Flags: 0 0 2 0

USER-TEXT::
Machine:
Axis:X

RUNS::
Run-count:2

DEVIATIONS::
Run Target Data:
1   1      0.5
1   2      1.0
1   3      1.5
2   3      1.1
2   2      0.6
2   1      0.1

EOF::
"""


def test_a_laser_file_is_read_run_by_run_and_what_was_inferred_is_said() -> None:
    found = read(RTL, "x.rtl")
    (one,) = found.series
    assert one.key == "EXX"
    assert one.positions == (0.0, 100.0, 200.0)
    assert one.forward == pytest.approx([0.5, 1.0, 1.5])
    assert one.backward == pytest.approx([0.1, 0.6, 1.1])
    assert any("inferred" in text for text in found.assumed)
    one_way = read(RTL.replace("Flags: 0 0", "Flags: 0 1"), "x.rtl")
    assert len(one_way.series[0].runs) == 1


@pytest.mark.parametrize(
    ("change", "fragments"),
    [
        (("2   1      0.1\n", ""), ("5 readings", "6", "cut off")),
        (("Target-count: 3", "Target-count: 4"), ("3 targets", "4")),
        (("USER-TEXT::", "SECRET::"), ("SECRET", "not understood")),
        (("Flags: 0 0 2 0", "Colour: blue"), ("Colour", "not understood")),
        (("Axis:X", "Axis:"), ("--axis",)),
        (("1   3      1.5", "1   9      1.5"), ("line 25", "target 9")),
        (("1   3      1.5", "1   2      1.5"), ("line 25", "twice")),
        (("RUNS::\nRun-count:2\n", ""), ("RUNS", "cut off")),
    ],
)
def test_a_laser_file_that_is_not_understood_is_refused(change, fragments) -> None:
    assert change[0] in RTL
    with pytest.raises(SceneError) as caught:
        read(RTL.replace(*change), "x.rtl")
    for fragment in fragments:
        assert fragment in str(caught.value), (fragment, str(caught.value))
