"""Tables that commands write: no text is a formula, none is lost, units and line ends are right."""

import csv
import io

import pytest

from warpspace.calibration.readings import parse_table
from warpspace.outputs.exports.fields import write_rows

TEXTS = ("=1+1", "+1", "-run1", "run1", "@x", "\t=1", "\r=1", "'=1", "'x", "plain")
SCENE = """title = "W"
[machine]
chain = "wCbWXYZt"
[machine.offset_mm]
Z = [0, 0, 300]
[machine.travel]
W = [0, 100]
X = [-100, 100]
Y = [-100, 100]
Z = [-100, 0]
C = [-180, 180]
[errors]
EXX = 3.0
EAW = 4.0
"""


def cells(content):
    assert content.endswith(b"\n")
    assert b"\r\n" not in content
    return list(csv.reader(io.StringIO(content.decode(), newline="")))


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "=w.toml"
    path.write_text(SCENE, encoding="utf-8")
    return path


def test_gains_have_the_unit_of_every_axis(scene, warpspace, tmp_path):
    target = tmp_path / "gains.csv"
    assert warpspace("gains", scene, "--csv", target).status == 0
    head = cells(target.read_bytes())[0]
    assert {"W_mm", "X_mm", "C_deg"} <= set(head)
    assert "W_deg" not in head


def test_the_name_of_a_scene_is_no_formula(scene, warpspace, tmp_path):
    target = tmp_path / "field.csv"
    result = warpspace("export", scene, "-o", target, "--grid", "2")
    assert result.status == 0, result.err
    for row in cells(target.read_bytes())[1:]:
        assert "'=w" in row
        assert not any(cell.startswith(("=", "+", "@", "\t", "\r")) for cell in row)


def test_texts_of_a_table_stay_apart(tmp_path):
    target = tmp_path / "t.csv"
    with write_rows(target, {"session": "text", "x_mm": "number"}) as append:
        append({"session": TEXTS, "x_mm": range(len(TEXTS))})
    written = [row[0] for row in cells(target.read_bytes())[1:]]
    assert not any(text.startswith(("=", "+", "-", "@", "\t", "\r")) for text in written)
    table = parse_table(target.read_bytes().decode(), "t.csv")
    assert table.session == TEXTS


def test_sessions_that_differ_in_their_sign_stay_apart(warpspace, tmp_path):
    """`-run1` was written as `run1`."""
    data, target = tmp_path / "=data.csv", tmp_path / "residuals.csv"
    rows = [f"{x},{y},{x / 50},{y / 90},1,{name}" for x in (-100, 0, 100) for y in (-100, 100)
            for name in ("-run1", "run1")]  # fmt: skip
    data.write_text("x_mm,y_mm,ex_um,ey_um,ez_um,session\n" + "\n".join(rows), encoding="utf-8")
    result = warpspace("calibrate", "dvf5000_nominal", "--data", data, "--csv", target)
    assert result.status == 0, result.err
    head, *written = cells(target.read_bytes())
    assert {row[head.index("session")] for row in written} == {"'-run1", "run1"}
    assert {row[head.index("file")] for row in written} == {"'=data.csv"}
