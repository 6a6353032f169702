"""Fields as files of numbers, read back by the programs that people read them with."""

import csv
import json
import subprocess
import sys
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import pyvista as pv

from warpspace import evaluate, load_scene
from warpspace.exceptions import OptionError, OutputError
from warpspace.field.basis import ErrorField
from warpspace.field.grid import Grid, build_grid
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
    *("R_x_mm", "R_y_mm", "R_z_mm", "error_x_um", "error_y_um", "error_z_um", "norm_um"),
    *("orientation_x_urad", "orientation_y_urad", "orientation_z_urad"),
)
MEGABYTES = 500


def evaluated(name: str) -> tuple[Grid, ErrorField, FieldRecord]:
    """A scene over its grid."""
    scene = load_scene(name)
    grid = build_grid(scene.model, scene.workspace, NODES)
    field = evaluate(scene, grid=NODES, loop="relative")
    return grid, field, FieldRecord(grid.coordinates, field, ABOUT)


def expected_columns(grid: Grid, field: ErrorField) -> dict[str, np.ndarray]:
    """The table that a file holds, written down apart from it."""
    axes = {
        f"axis_{name}_{'deg' if name[0] in 'ABC' else 'mm'}": np.broadcast_to(
            values, grid.shape
        ).ravel()
        for name, values in grid.coordinates.items()
    }
    numbers = np.column_stack(
        [
            field.nominal_mm.reshape(-1, 3),
            field.error_um.reshape(-1, 3),
            np.linalg.norm(field.error_um, axis=-1).ravel(),
            field.orientation_urad.reshape(-1, 3),
        ]
    )
    return axes | dict(zip(COLUMNS, numbers.T, strict=True))


@pytest.mark.parametrize("name", SCENES)
def test_parquet_read_by_pyarrow(name: str, tmp_path: Path) -> None:
    grid, field, record = evaluated(name)
    write_field(record, tmp_path / "a.parquet")
    table = pq.read_table(tmp_path / "a.parquet")
    expected = expected_columns(grid, field)
    assert table.column_names == [*expected]
    for column, values in expected.items():
        np.testing.assert_allclose(table[column].to_numpy(), values, rtol=1e-15, atol=1e-300)
    np.testing.assert_array_equal(table["error_x_um"].to_numpy(), field.error_um[..., 0].ravel())
    assert json.loads(table.schema.metadata[b"warpspace"]) == ABOUT
    units = {f.name: f.metadata[b"unit"].decode() for f in table.schema}
    assert units["error_x_um"] == units["norm_um"] == "µm"
    assert units["R_x_mm"] == "mm"
    assert units["orientation_z_urad"] == "µrad"
    assert all(
        unit == ("°" if column.endswith("_deg") else "mm")
        for column, unit in units.items()
        if column.startswith("axis_")
    )


@pytest.mark.parametrize("name", SCENES)
def test_csv_read_by_csv(name: str, tmp_path: Path) -> None:
    grid, field, record = evaluated(name)
    write_field(record, tmp_path / "a.csv")
    with (tmp_path / "a.csv").open(encoding="ascii", newline="") as file:
        rows = list(csv.DictReader(file))
    expected = expected_columns(grid, field)
    assert [*rows[0]] == [*expected]
    for column, values in expected.items():
        read = np.array([float(row[column]) for row in rows])
        np.testing.assert_allclose(read, values, rtol=0, atol=0.6 * 10**-DECIMALS)
    assert "-0," not in (tmp_path / "a.csv").read_text(encoding="ascii")


@pytest.mark.parametrize("name", SCENES)
def test_npz_read_by_numpy(name: str, tmp_path: Path) -> None:
    grid, field, record = evaluated(name)
    write_field(record, tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as arrays:
        for array in ("nominal_mm", "error_um", "norm_um", "orientation_urad"):
            np.testing.assert_array_equal(arrays[array], getattr(field, array))
            assert arrays[array].shape[:3] == grid.shape
        for axis, values in grid.coordinates.items():
            unit = "deg" if axis[0] in "ABC" else "mm"
            np.testing.assert_array_equal(arrays[f"axis_{axis}_{unit}"], values)
        assert json.loads(str(arrays["about_json"])) == ABOUT


@pytest.mark.parametrize("name", SCENES)
def test_vts_read_by_pyvista(name: str, tmp_path: Path) -> None:
    grid, field, record = evaluated(name)
    write_field(record, tmp_path / "a.vts")
    mesh = pv.read(tmp_path / "a.vts")
    assert tuple(mesh.dimensions) == grid.shape

    def in_grid(values: np.ndarray) -> np.ndarray:
        return values.reshape(*grid.shape, *values.shape[1:], order="F")

    np.testing.assert_array_equal(in_grid(np.asarray(mesh.points)), field.nominal_mm)
    for array in ("error_um", "norm_um", "orientation_urad"):
        np.testing.assert_array_equal(in_grid(np.asarray(mesh[array])), getattr(field, array))
    about = np.asarray(mesh.field_data["about_json"]).astype(np.uint8).tobytes().decode()
    assert json.loads(about) == ABOUT


@pytest.mark.parametrize("ending", FIELD_ENDINGS)
def test_points_are_written_too_where_the_format_is_no_grid(ending: str, tmp_path: Path) -> None:
    scene, at = load_scene("dvf5000_first"), {"X": np.array([0.0, 100.0, 275.0])}
    field = evaluate(scene, at=at)
    record = FieldRecord({**at, "Y": np.asarray(0.0)}, field)
    target = tmp_path / f"a{ending}"
    if ending in GRID_ENDINGS:
        with pytest.raises(OptionError, match="holds a grid"):
            write_field(record, target)
        assert not list(tmp_path.iterdir())
        return
    write_field(record, target)
    if ending == ".parquet":
        read = pq.read_table(target)["error_x_um"].to_numpy()
    elif ending == ".npz":
        with np.load(target) as arrays:
            read = arrays["error_um"][:, 0]
    else:
        read = np.genfromtxt(target, delimiter=",", names=True)["error_x_um"]
    np.testing.assert_allclose(read, field.error_um[:, 0], atol=1e-9)


@pytest.mark.parametrize("ending", FIELD_ENDINGS)
def test_files_are_the_same_when_written_again_and_replace_only_when_told(
    ending: str, tmp_path: Path
) -> None:
    _, _, record = evaluated("dvf5000_first")
    first, second = tmp_path / f"a{ending}", tmp_path / f"b{ending}"
    write_field(record, first)
    write_field(record, second)
    assert first.read_bytes() == second.read_bytes()
    with pytest.raises(OutputError, match="exists already"):
        write_field(record, first, overwrite=False)
    assert sorted(tmp_path.iterdir()) == [first, second]


@pytest.mark.parametrize("ending", FIELD_ENDINGS)
def test_a_write_that_fails_leaves_the_old_file(ending: str, tmp_path: Path) -> None:
    _, _, record = evaluated("dvf5000_first")
    target = tmp_path / f"a{ending}"
    target.write_bytes(b"old")
    torn = replace(record.field, nominal_mm=np.zeros((2, 2, 2, 3)))
    broken = replace(record, field=torn, about={"scene": object()})
    with pytest.raises((ValueError, TypeError)):
        write_field(broken, target)
    assert target.read_bytes() == b"old"
    assert [*tmp_path.iterdir()] == [target]


@pytest.mark.parametrize("ending", [".parquet", ".csv", ".npz"])
def test_tables_are_written_block_by_block(ending: str, tmp_path: Path) -> None:
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


@pytest.mark.skipif(sys.platform != "linux", reason="counts memory as Linux does")
@pytest.mark.parametrize("ending", FIELD_ENDINGS)
def test_a_million_nodes_are_written_in_little_memory(ending: str, tmp_path: Path) -> None:
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


def test_every_column_has_a_unit() -> None:
    record = evaluated("dvf5000_first")[2]
    assert {column_unit(name) for name in record.columns} == {"mm", "°", "µm", "µrad"}


def test_command_writes_what_it_evaluates(tmp_path: Path) -> None:
    from click.testing import CliRunner

    from warpspace.cli.commands.field import field

    target = tmp_path / "a.parquet"
    options = ["--grid", "3", "--exact", "--loop", "relative", "--frame", "workpiece"]
    result = CliRunner().invoke(field, ["dvf5000_first", *options, "-o", str(target)])
    assert result.exit_code == 0, result.output
    assert "a.parquet" in result.output
    table = pq.read_table(target)
    expected = evaluate(
        load_scene("dvf5000_first"), grid=3, loop="relative", exact=True, frame="workpiece"
    )
    np.testing.assert_array_equal(table["error_y_um"], expected.error_um[..., 1].ravel())
    about = json.loads(table.schema.metadata[b"warpspace"])
    assert about["model"] == "exact chain"
    assert (about["frame"], about["loop"], about["scene"]) == (
        "workpiece",
        "relative",
        "dvf5000_first",
    )
