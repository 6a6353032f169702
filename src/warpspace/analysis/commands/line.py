"""Error along a straight line between two points, six components."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from warpspace.analysis.blocks import Block, Column, Curve, Lines, Table, number_columns
from warpspace.analysis.description import Analysis, ExpandedUncertainty, ProgressCallback, Result
from warpspace.analysis.options import LOOP_HELP, LOOP_UNSET, Place, option, place_words
from warpspace.analysis.uncertainty.propagation import plus_minus, scene_uncertainty, u95_columns
from warpspace.exceptions import OptionError
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.kinematics.relative_motion import relative_point
from warpspace.machine.axes import is_linear
from warpspace.scene.model import Scene, check_magnitude, evaluate
from warpspace.units import Array, spell_fixed

MAX_ROWS = 21  # points that the table of a longer line shows; the file has all


@dataclass(frozen=True, kw_only=True)
class Between(Analysis):
    """Analysis of two points, by default the ends of the diagonal of the volume."""

    start: Place = option(
        (), "First point, mm and degrees", unset="lower ends of the working volume",
        flag="--from", label="From",
    )  # fmt: skip
    end: Place = option(
        (), "Second point", unset="upper ends of the working volume", flag="--to", label="To"
    )

    def places(self, scene: Scene, *further_points: Place) -> dict[str, Array]:
        """Return the positions of all axes at both points and at further ones, [n]."""
        ranges, points = scene.workspace.ranges, [dict(self.start), dict(self.end)]
        if not any(points):
            points = [{name: at[end] for name, at in ranges.items()} for end in (0, -1)]
        points += [dict(point) for point in further_points if point]
        stand = scene.workspace.positions
        coordinates = [complete_coordinates(scene.machine, point, stand) for point in points]
        if coordinates[0] == coordinates[1]:
            raise OptionError("{start} and {end} are one point; expected two")
        places = {
            name: np.array([point[name] for point in coordinates]) for name in scene.machine.axes
        }
        check_magnitude(scene, places)
        return places


@dataclass(frozen=True, kw_only=True)
class Line(Between):
    """Follow the error of SCENE along a straight line.

    All axes go in proportion from one point to the other, by default along the diagonal of the
    working volume. Six components: position error x, y, z in µm, orientation error about x, y, z
    in µrad.
    """

    name = "line"
    task = "understand"
    has_chart = True
    has_table = True
    points: int = option(101, "Points along it", low=2, high=10_001)
    loop: Loop | None = option(None, LOOP_HELP, unset=LOOP_UNSET)
    exact: bool = option(False, "The exact chain instead of the first order")

    def run(self, scene: Scene, watch: ProgressCallback, /) -> "LineResult":
        share = np.linspace(0.0, 1.0, self.points)
        ends = self.places(scene).items()
        axes = {name: low + (high - low) * share for name, (low, high) in ends}
        view = scene.view(self.loop)
        field = evaluate(scene, at=axes, loop=view.loop, exact=self.exact)
        watch(1.0)
        on_workpiece = np.broadcast_to(relative_point(scene.model, axes), (self.points, 3))
        steps = np.linalg.norm(np.diff(on_workpiece, axis=0), axis=1)
        along_mm = np.concatenate([[0.0], np.cumsum(steps)])
        return LineResult(
            length_mm=float(along_mm[-1]),
            axes={name: np.broadcast_to(at, share.shape) for name, at in axes.items()},
            along_mm=along_mm,
            nominal_mm=field.nominal_mm,
            error_um=field.error_um,
            orientation_urad=field.orientation_urad,
            title=f"{scene.title} · {view.loop} loop",
            uncertainty=scene_uncertainty(scene, view.loop),
            expanded_uncertainty=u95_columns(scene, field, axes, view),
        )


@dataclass(frozen=True, kw_only=True)
class LineResult(Result):
    """Errors along a line."""

    json_keys = (
        "length_mm", "axes", "along_mm", "nominal_mm", "error_um", "orientation_urad",
        "expanded_uncertainty",
    )  # fmt: skip
    length_mm: float
    axes: Mapping[str, Array]  # [n], mm or degrees
    along_mm: Array  # [n], path of the nominal tool point over the workpiece
    nominal_mm: Array  # [n, 3], in R
    error_um: Array  # [n, 3], in R
    orientation_urad: Array  # [n, 3], in R
    title: str
    expanded_uncertainty: ExpandedUncertainty[Array]  # of these; empty where unknown

    def blocks(self) -> Iterator[Block]:
        norm = np.linalg.norm(self.error_um, axis=1)
        worst = int(np.argmax(norm))
        place = {name: float(at[worst]) for name, at in self.axes.items()}
        yield f"{self.title} · {self.length_mm:.1f} mm"
        u95 = [self.expanded_uncertainty["u95_norm_um"]] if self.expanded_uncertainty else []
        about = f" {plus_minus(u95[0][worst] if u95 else None)}" if self.uncertainty else ""
        yield f"  largest |E| {spell_fixed(norm[worst])}{about} µm at {place_words(place)}"
        columns = self.along_mm, *self.axes.values(), norm, *u95
        everything = np.column_stack([*columns, self.error_um, self.orientation_urad])
        step = -(-(len(norm) - 1) // (MAX_ROWS - 1)) if len(norm) > MAX_ROWS else 1
        units = {name: "mm" if is_linear(name) else "deg" for name in self.axes}
        columns = (
            Column("along", ".1f", "mm", key="along_mm", leads=True),
            *(Column(key=f"{name}_{unit}", shows=False) for name, unit in units.items()),
            Column("|E|", ".2f", "µm", key="norm_um"),
            *(Column("U95", ".2f", "µm", key="u95_norm_um") for _ in u95),
            *number_columns(("x", "y", "z"), ".2f", "µm", ("x_um", "y_um", "z_um")),
            *number_columns(
                ("about x", "y", "z"),
                ".2f",
                "µrad",
                ("about_x_urad", "about_y_urad", "about_z_urad"),
            ),
        )
        yield Table(columns, everything[::step].tolist(), file_rows=everything.tolist())
        for title, unit, values in (
            ("Position error", "µm", self.error_um),
            ("Orientation error", "µrad", self.orientation_urad),
        ):
            curves = [Curve(x, self.along_mm, values[:, i], i) for i, x in enumerate("xyz")]
            yield Lines("lines", title, "along the line [mm]", f"error [{unit}]", tuple(curves))
