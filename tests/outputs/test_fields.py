"""Fields as files of numbers, read back by the programs that people read them with."""

import csv
import json
import subprocess
import sys
import tracemalloc
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
import pyvista as pv

from products import first
from warpspace import evaluate, load_scene
from warpspace.exceptions import OptionError, OutputError
from warpspace.field.grid import build_grid
from warpspace.outputs.exports.fields import (
    DECIMALS,
    FIELD_ENDINGS,
    GRID_ENDINGS,
    FieldRecord,
    column_unit,
    write_field,
)

SCENES = ("dvf5000_first", "dvf5000_general", "machine_scara", "machine_printer_3d")
NODES = (4, 3, 5)
ABOUT = {"scene": "Maß µm", "loop": "relative"}
COLUMNS = (
    *("R_x_mm", "R_y_mm", "R_z_mm"),
    *(f"error_relative_R_{letter}_um" for letter in "xyz"),
    "norm_um",
    *(f"orientation_R_{letter}_urad" for letter in "xyz"),
)
MEGABYTES = 500


def evaluated(name):
    scene = load_scene(name)
    grid = build_grid(scene.model, scene.workspace, NODES)
    field = evaluate(scene, grid=NODES, loop="relative")
    return grid, field, FieldRecord(grid.coordinates, field, ABOUT)


def axis_columns(grid):
    return {
        f"axis_{name}_{'deg' if name[0] in 'ABC' else 'mm'}": values
        for name, values in grid.coordinates.items()
    }


def expected_columns(grid, field):
    """The table that a file holds, written down apart from it."""
    axes = axis_columns(grid)
    axes = {name: np.broadcast_to(values, grid.shape).ravel() for name, values in axes.items()}
    length = np.linalg.norm(field.error_um, axis=-1)[..., None]
    parts = (field.nominal_mm, field.error_um, length, field.orientation_urad)
    numbers = np.concatenate(parts, axis=-1).reshape(-1, len(COLUMNS))
    return axes | dict(zip(COLUMNS, numbers.T, strict=True))


ARRAYS = ("nominal_mm", "error_um", "norm_um", "orientation_urad")


def read_table(path):
    """Read the columns of a table with the library that people read it with."""
    if path.suffix == ".parquet":
        table = pq.read_table(path)
        return {name: table[name].to_numpy() for name in table.column_names}
    with path.open(encoding="ascii", newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def read_grid(path, shape):
    """Read the arrays of a grid with the library that people read it with, and what it is of."""
    if path.suffix == ".npz":
        with np.load(path) as arrays:
            found = {name: arrays[name] for name in arrays.files}
        return found, json.loads(str(found.pop("about_json")))
    mesh = pv.read(path)
    assert tuple(mesh.dimensions) == shape
    found = {"nominal_mm": mesh.points, **{name: mesh[name] for name in ARRAYS[1:]}}
    ordered = {
        name: np.asarray(values).reshape(*shape, *values.shape[1:], order="F")
        for name, values in found.items()
    }
    about = np.asarray(mesh.field_data["about_json"]).astype(np.uint8).tobytes()
    return ordered, json.loads(about.decode())


@pytest.mark.parametrize("ending", [".parquet", ".csv"])
@pytest.mark.parametrize("name", first(*SCENES))
def test_tables_are_read_by_pyarrow_and_csv(name, ending, tmp_path):
    grid, field, record = evaluated(name)
    target = tmp_path / f"a{ending}"
    write_field(record, target)
    expected, found = expected_columns(grid, field), read_table(target)
    assert [*found] == [*expected]
    close = {"rtol": 1e-15, "atol": 1e-300 if ending == ".parquet" else 0.6 * 10**-DECIMALS}
    for column, values in expected.items():
        np.testing.assert_allclose(found[column], values, **close)
    if ending == ".csv":
        assert "-0," not in target.read_text(encoding="ascii")
        return
    np.testing.assert_array_equal(found["error_relative_R_x_um"], field.error_um[..., 0].ravel())
    schema = pq.read_schema(target)
    assert json.loads(schema.metadata[b"warpspace"]) == ABOUT
    for column in schema:
        unit = column_unit(column.name)
        assert column.metadata[b"unit"].decode() == unit
        ends = {"mm": "_mm", "°": "_deg", "µm": "_um", "µrad": "_urad"}
        assert column.name.endswith(ends[unit])


@pytest.mark.parametrize("ending", [".npz", ".vts"])
@pytest.mark.parametrize("name", first(*SCENES))
def test_grids_are_read_by_numpy_and_pyvista(name, ending, tmp_path):
    grid, field, record = evaluated(name)
    write_field(record, tmp_path / f"a{ending}")
    found, about = read_grid(tmp_path / f"a{ending}", grid.shape)
    assert about == ABOUT
    for array in ARRAYS:
        np.testing.assert_array_equal(found[array], getattr(field, array))
    for column, values in axis_columns(grid).items() if ending == ".npz" else ():
        np.testing.assert_array_equal(found[column], values)


@pytest.mark.parametrize("ending", FIELD_ENDINGS)
def test_points_are_written_too_where_the_format_is_no_grid(ending, tmp_path):
    at = {"X": np.array([0.0, 100.0, 275.0])}
    field = evaluate(load_scene("dvf5000_first"), at=at)
    record = FieldRecord({**at, "Y": np.asarray(0.0)}, field)
    target = tmp_path / f"a{ending}"
    if ending in GRID_ENDINGS:
        with pytest.raises(OptionError, match="holds a grid"):
            write_field(record, target)
        assert not list(tmp_path.iterdir())
        return
    write_field(record, target)
    if ending == ".npz":
        read = read_grid(target, ())[0]["error_um"][:, 0]
    else:
        read = read_table(target)["error_tool_R_x_um"]
    np.testing.assert_allclose(read, field.error_um[:, 0], atol=1e-9)


@pytest.mark.parametrize("ending", FIELD_ENDINGS)
def test_files_are_the_same_when_written_again_and_stay_when_that_fails(ending, tmp_path):
    _, _, record = evaluated("dvf5000_first")
    first, second = tmp_path / f"a{ending}", tmp_path / f"b{ending}"
    write_field(record, first)
    write_field(record, second)
    data = first.read_bytes()
    assert data == second.read_bytes()
    with pytest.raises(OutputError, match="exists already"):
        write_field(record, first, overwrite=False)
    torn = replace(record.field, nominal_mm=np.zeros((2, 2, 2, 3)))
    with pytest.raises((ValueError, TypeError)):
        write_field(replace(record, field=torn, about={"scene": object()}), first)
    assert first.read_bytes() == data
    assert sorted(tmp_path.iterdir()) == [first, second]


@pytest.mark.parametrize("ending", [".parquet", ".csv", ".npz"])
def test_tables_are_written_block_by_block(ending, tmp_path):
    scene = load_scene("dvf5000_general")
    grid = build_grid(scene.model, scene.workspace, 61)
    record = FieldRecord(grid.coordinates, evaluate(scene, grid=61))
    rows = record.field.norm_um.size
    blocks = [len(block["norm_um"]) for block in record.blocks()]
    assert sum(blocks) == rows
    assert max(blocks) < rows / 5
    write_field(record, tmp_path / f"warm{ending}")  # imports count once
    tracemalloc.start()
    try:
        write_field(record, tmp_path / f"a{ending}")
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    table = rows * len(record.columns) * 8
    assert peak < table / 2
    if ending == ".parquet":
        assert pq.ParquetFile(tmp_path / "a.parquet").num_row_groups == len(blocks)


@pytest.mark.nightly
@pytest.mark.skipif(sys.platform != "linux", reason="counts memory as Linux does")
@pytest.mark.parametrize("ending", FIELD_ENDINGS)
def test_a_million_nodes_are_written_in_little_memory(ending, tmp_path):
    """Python, the libraries, the field and the file: JSON took 2.1 GB."""
    target = tmp_path / f"a{ending}"
    code = (
        "import re, sys\nfrom pathlib import Path\nfrom warpspace.cli import main\nmain()\n"
        "status = Path('/proc/self/status').read_text()\n"
        "print(int(re.search(r'VmHWM:\\s*(\\d+) kB', status)[1]) // 1024)"
    )
    command = [sys.executable, "-c", code, "field", "dvf5000_first", "--grid", "101", "--json"]
    run = subprocess.run([*command, "-o", target], capture_output=True, text=True, check=True)
    said, peak = run.stdout.splitlines()
    assert int(peak) <= MEGABYTES
    found = json.loads(said)
    assert found["output"] == str(target)
    assert found["points_written"] == 101**3
    assert set(found["statistics"]) == set(found["statistics_nodes"])
    assert target.stat().st_size > 10_000_000
