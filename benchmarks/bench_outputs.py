"""Files: a field of a million nodes, exports, reports; their time, their memory, their size.

And the page that `warpspace.show` builds for a notebook, which is a file in its outputs.
"""

import contextlib
import io
import tempfile
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import trimesh
import viser
from table import Row, Section
from timing import cheapest, in_turns, python, warpspace

from warpspace import Scene, evaluate, load_scene, show, to_pyvista
from warpspace.field.grid import build_grid
from warpspace.outputs.exports.fields import FIELD_ENDINGS, FieldRecord, write_field

NODES, PEER_NODES = 101, 41
INF = float("inf")
EXPORTS = (  # name, arguments, ending; seconds of processor and of the wall, and MB allowed
    ("export .glb", ("export", "dvf5000_first"), ".glb", 1.5, INF, 8.0),
    ("export .vts", ("export", "dvf5000_first"), ".vts", 30.0, INF, 8.0),
    ("export .html", ("export", "dvf5000_first"), ".html", 30.0, INF, 3.0),
    ("report .html, one scene", ("report", "dvf5000_first"), ".html", 5.0, 4.0, 8.0),
    (
        "report .pdf, two scenes",
        ("report", "dvf5000_first", "dvf5000_second"),
        ".pdf",
        30.0,
        INF,
        8.0,
    ),
    (
        "draw .webp, 12 pictures",
        ("draw", "dvf5000_first", "--frames", "12"),
        ".webp",
        60.0,
        INF,
        8.0,
    ),
)


def peers(record: FieldRecord, folder: Path) -> dict[str, tuple[str, partial]]:
    """Return other writers of the same numbers, in memory."""
    shape = record.shape
    table = {
        name: np.broadcast_to(values, shape).reshape(-1) for name, values in record.columns.items()
    }
    arrays = {"nominal": record.field.nominal_mm, "error": record.field.error_um}
    arrays |= {"norm": record.field.norm_um, "orientation": record.field.orientation_urad}
    frame = pd.DataFrame(table)
    csv = partial(frame.to_csv, folder / "p.csv", index=False, float_format="%.9g")
    return {
        ".parquet": (
            "pyarrow, the whole table",
            partial(pq.write_table, pa.table(table), folder / "p.parquet", compression="zstd"),
        ),
        ".npz": ("numpy.savez", partial(np.savez, folder / "p.npz", **arrays)),
        ".csv": ("pandas to_csv, nine digits", csv),
    }


def coloured_surface(scene: Scene) -> trimesh.Trimesh:
    """Build the surface of the deformed volume, grey levels for |E|."""
    surface = to_pyvista(scene)["deformed"].extract_surface(algorithm="dataset_surface")
    surface = surface.triangulate()
    levels = 255.0 * surface["norm_um"] / surface["norm_um"].max()
    colours = np.repeat(levels.astype(np.uint8)[:, None], 3, axis=1)
    return trimesh.Trimesh(surface.points, surface.regular_faces, vertex_colors=colours)


def viser_page(surface: trimesh.Trimesh) -> str:
    """Build viser's page with a surface and nothing else."""
    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        server.scene.add_mesh_trimesh("/volume", surface)
        page = server.scene.as_html()
        server.stop()
    return page


def notebook_rows(scene: Scene) -> list[Row]:
    """Measure what a notebook displays, once its modules are loaded."""
    surface = coloured_surface(scene)
    page, bare = show(scene)._repr_html_(), viser_page(surface)
    took, other = in_turns(lambda: show(scene)._repr_html_(), lambda: viser_page(surface))
    baseline = "viser's page with the surface alone"
    return [
        Row("warpspace.show in a notebook", took, baseline, other),
        Row("warpspace.show in a notebook, size", len(page) / 1e6, baseline, len(bare) / 1e6, "MB"),
    ]


def measure() -> Section:
    """Run the commands as a user does."""
    rows = []
    scene = load_scene("dvf5000_general")
    grid = build_grid(scene.model, scene.workspace, PEER_NODES)
    record = FieldRecord(grid.coordinates, evaluate(scene, grid=PEER_NODES))
    floor = cheapest(lambda: python("-c", "import warpspace, numpy"))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        target = folder / "f"
        for ending, (baseline_name, peer) in peers(record, folder).items():
            took, other = in_turns(
                lambda: write_field(record, target.with_suffix(ending)),  # noqa: B023
                peer,
                3,
            )
            label = f"writing {PEER_NODES}³ nodes as {ending}"
            rows.append(Row(label, took, baseline_name, other))
        result = 101**3 * 3 * 8 / 1e6
        for ending in FIELD_ENDINGS:
            options = ("field", "dvf5000_first", "--grid", NODES, "--force", "-o")
            cost = cheapest(lambda: warpspace(*options, target.with_suffix(ending)), 2)  # noqa: B023
            label = f"field --grid {NODES} -o {ending}"
            rows.append(
                Row(label, cost.processor_s, "python, numpy", floor.processor_s, max_value=3.0)
            )
            rows.append(
                Row(f"{label}, memory", cost.peak_mb, "the errors", result, "MB", max_value=500.0)
            )
        for label, arguments, ending, seconds, wall, size in EXPORTS:
            path = folder / f"{label.split(',')[0].replace(' ', '_')}{ending}"
            command = ("-m", "warpspace", *arguments, "--force", "-o", path)
            cost = cheapest(lambda: python(*command), 2)  # noqa: B023  # the first one compiles
            large = path.stat().st_size / 1e6
            baseline = "python, numpy"
            rows += [
                Row(label, cost.processor_s, baseline, floor.processor_s, max_value=seconds),
                Row(f"{label}, wall", cost.wall_s, baseline, floor.wall_s, max_value=wall),
            ]
            rows.append(
                Row(
                    f"{label}, size",
                    large,
                    "the errors of 21³",
                    21**3 * 24e-6,
                    "MB",
                    max_value=size,
                )
            )
    rows += notebook_rows(load_scene("dvf5000_first"))
    text = (
        "Whole commands with everything they load, beside the start of Python with numpy; fields"
        " also beside what else writes the same numbers, which holds the whole table. Processor"
        " time counts the renderer's process and its threads too. What a notebook shows is built in"
        " a process that has its modules, and holds the drawing, its labels and the controls."
    )
    return Section("Files", text, rows)
