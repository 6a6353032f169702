"""The one reader of tables: what scenes, imports, tests and calibrations understand alike."""

import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from warpspace.bench.data import DataColumn
from warpspace.bench.data import parse_table as parse_test
from warpspace.calibration.readings import parse_reading_table as parse_calibration
from warpspace.exceptions import SceneError
from warpspace.formats.registry import ReadOptions, open_upload, read_errors
from warpspace.scene.curve_reader import read_csv_column
from warpspace.scene.text_files import CsvRows, guard_cell, parse_number, spell_row, unguard_cell


def _scene(text, folder):
    path = folder / "t.csv"
    path.write_text(text, encoding="utf-8")
    return read_csv_column(path, CsvRows(io.StringIO(text), "", 1).header[1])


def _import(text, _folder):
    found = read_errors([open_upload("t.csv", text.encode())], ReadOptions(), "csv").imported
    return list(zip(found.series[0].positions, found.series[0].values.tolist(), strict=True))


def _test(text, _folder):
    table = parse_test(text, (DataColumn("X_mm", "number"), DataColumn("EXX_um")), "t.csv")
    return list(zip(table["X_mm"].tolist(), table["EXX_um"].tolist(), strict=True))


def _calibration(text, _folder):
    table = parse_calibration(text, "t.csv")
    return [(x, y) for x, y in table.require(("x_mm", "exx_um")).tolist()]


every_reader = pytest.mark.parametrize("read", [_scene, _import, _test, _calibration])
UNDERSTOOD = {
    "points": "X_mm,EXX_um\n-1.25,1.5\n2,3e-1\n",
    "decimal commas": "X_mm;EXX_um\n-1,25;1,5\n2;3e-1\n",
    "tabs": "X_mm\tEXX_um\n-1,25\t1,5\n2\t,3\n",
    "sep=;": "sep=;\nX_mm;EXX_um\n-1.25;1.5\n2;.3\n",
    "quoted sep": '"sep=;"\r\n"X_mm";"EXX_um"\r\n"-1,25";"1,5"\r\n2;0,3\r\n',
    "separators behind the rows": "X_mm;EXX_um\n-1,25;1,5;\n2;0,3;;\n",
    "separators behind all": "X_mm,EXX_um,\n-1.25,1.5,\n2,0.3,\n",
    "empty rows and remarks": "# by hand\n;;\nX_mm;EXX_um\n\n-1,25;1,5\n;;\n# end\n2;0,3\n",
    "a preamble": '"Laser report"\n"Machine";"M1"\n\nX [mm];EXX [um]\n-1,25;1,5\n2;0,3\n',
    "a row of units": "X;EXX\nmm;µm\n-1,25;1,5\n2;0,3\n",
    "U+2212": "X [mm];EXX [um]\n−1,25;1,5\n2;0,3\n",
    "other units": "X [m];EXX [nm]\n-0.00125;1500\n0.002;300\n",
    "columns that are not needed": "X_mm,EXX_um,Pt,Timestamp\n-1.25,1.5,P1,2e13\n2,0.3,P2,2e13\n",
    "units in brackets": "X [mm],EXX [um]\n-1.25,1.5\n2,0.3\n",
    "units in parentheses": "X (mm);EXX (µm)\n-1,25;1,5\n2;0,3\n",
}


@every_reader
@pytest.mark.parametrize("case", UNDERSTOOD)
def test_every_reader_understands(case, read, tmp_path):
    assert read(UNDERSTOOD[case], tmp_path) == [(-1.25, 1.5), (2.0, 0.3)]


@every_reader
def test_two_decimal_signs_are_refused_with_both_lines(read, tmp_path):
    """-1.250;1,5 was read as -1.25 mm in silence by the import, and not at all by the others."""
    with pytest.raises(SceneError) as caught:
        read("X_mm;EXX_um\n-3;0,5\n-2;4\n-1.250;1\n", tmp_path)
    for fragment in ('line 2 has "0,5"', 'line 4 has "-1.250"', "one decimal sign"):
        assert fragment in str(caught.value)
    assert len(caught.value.problems) == 1


@every_reader
@pytest.mark.parametrize(
    "text", ["0_8682", "inf", "-nan", "Infinity", "٣", "0x1", "1.250,5", "1e999", "1 000", "1e", ""]
)
def test_what_no_reader_takes_for_a_number(text, read, tmp_path):
    with pytest.raises(SceneError, match="line 2"):
        read(f"X_mm;EXX_um\n{text};1\n3;4\n", tmp_path)
    with pytest.raises(ValueError, match="is no number"):
        parse_number(text)


@every_reader
def test_a_decimal_comma_between_commas_is_no_number(read, tmp_path):
    with pytest.raises(SceneError, match="decimal comma"):
        read('X_mm,EXX_um\n"1,250",2\n3,4\n', tmp_path)
    with pytest.raises(SceneError, match="decimal commas"):
        read("X_mm,EXX_um\n1,250,2\n3,4\n", tmp_path)


@given(st.text(st.sampled_from("'=+-@\t\rrun1 "), max_size=6))
def test_guarded_texts_are_no_formulas_and_stay_apart(text):
    guarded = guard_cell(text)
    assert not guarded.startswith(("=", "+", "-", "@", "\t", "\r"))
    assert unguard_cell(guarded) == text


@pytest.mark.parametrize("sign", "=+-@\uff1d\uff0b\uff0d\uff20")
def test_a_text_that_a_spreadsheet_may_run_is_guarded(sign):
    text = f"{sign}HYPERLINK(1)"
    assert spell_row([text]) == f"'{text}\n"
    assert unguard_cell(guard_cell(text)) == text


@pytest.mark.parametrize(
    ("unit", "factor"),
    [("urad", 1.0), ("mm/m", 1e3), ("µm/m", 1.0), ('"', np.pi / 648e-3), ("°", 1e6 * np.pi / 180)],
)
def test_angles_of_a_scene_in_any_unit(unit, factor, tmp_path):
    path = tmp_path / "x.csv"
    path.write_text(f"X [in];EAX [{unit}]\n0;0\n1;2\n", encoding="utf-8")
    points = read_csv_column(path, "EAX", "errors.EAX")
    assert np.array(points) == pytest.approx(np.array([[0.0, 0.0], [25.4, 2.0 * factor]]))


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ("X [mm],EAX [mm]", r"column 'EAX \[mm\]'; expected a unit such as urad"),
        ("X [deg],EAX [urad]", r"column 'X \[deg\]'; expected a unit such as mm"),
        ("X [mm],EAX [furlong]", "column 'EAX' not found|expected a unit"),
    ],
)
def test_units_of_another_quantity_are_refused(header, message, tmp_path):
    path = tmp_path / "x.csv"
    path.write_text(f"{header}\n0,0\n1,2\n", encoding="utf-8")
    with pytest.raises(SceneError, match=message):
        read_csv_column(path, "EAX", "errors.EAX")
    with pytest.raises(SceneError, match="expected a unit"):
        read_csv_column(path, header.split(",")[1], "errors.EAX")
