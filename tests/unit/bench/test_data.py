"""Readings of tests as files: read back, in any order of columns, and in another unit."""

import numpy as np
import pytest

from bench_scenes import scene_with
from warpspace.bench.base import bench_names, find_test, run_test
from warpspace.bench.data import parse_table, unit_notes


def test_columns_may_stand_in_any_order_among_others():
    columns = find_test("r-test").columns
    table = parse_table("note,z_um,y_um,x_um,angle_deg\na,3,2,1,0\n", columns, "x.csv")
    assert table["x_um"][0] == 1.0
    assert table["z_um"][0] == 3.0


@pytest.mark.parametrize("name", bench_names())
def test_every_test_reads_what_its_model_reads(name, tmp_path):
    """The readings of the model, written as a file, give the same numbers again."""
    scene = scene_with("dvf5000_first", EXX=("ramp", 8.0), EC0Y=20.0, EA0C=15.0, EZC=3.0)
    test = find_test(name)()
    model = run_test(scene, test).model
    path = tmp_path / f"{name}.csv"
    path.write_text(as_csv(test, model), encoding="utf-8")
    both = run_test(scene, test, path)
    for quantity in both.measured.outcome.quantities:
        assert quantity.value == pytest.approx(model.outcome[quantity.key], abs=1e-6), name


def as_csv(test, model):
    marks = dict(model.plan.marks)
    marks["target_mm"] = marks.get("target")
    names = [column.name for column in test.columns]
    channels = [name for name in names if name.endswith(("_um", "_urad"))]
    marks |= zip(channels, model.readings.reshape(len(channels), -1), strict=True)
    signs = marks.get("travel_sign", marks.get("sense"))

    def cell(column, row, run):
        if column.name == "run":
            return str(run)
        if column.kind == "sign":
            return "-+"[int(signs[row] > 0)]
        if column.kind == "name":
            return {"line": "XY", "diagonal": ("PPP", "NPP", "PNP", "PPN")}[column.name][
                int(marks[column.name][row])
            ]
        counted = column.name in ("position", "row", "column")
        return f"{marks[column.name][row] + counted:.9f}"

    rows = [",".join(names)]
    for run in (1, 2)[: 1 + ("run" in names)]:
        for row in range(len(marks[channels[0]])):
            rows += [",".join(cell(column, row, run) for column in test.columns)]
    return "\n".join(rows)


def test_thousandfold_readings_are_said():
    model = np.array([0.0, 5.0, 10.0])
    assert unit_notes(model * 1.4, model, "µm") == ()
    (text,) = unit_notes(model * 1000.0, model, "µm")
    assert "1,000 times" in text
    assert "in nm?" in text
    (text,) = unit_notes(model / 1000.0, model, "µm")
    assert "in mm?" in text
    assert unit_notes(model * 1000.0, model * 0.0, "µm") == ()
