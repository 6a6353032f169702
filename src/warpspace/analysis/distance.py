"""Distance between two points and the angle at a third: nominal, actual, and how they differ."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from warpspace.analysis.blocks import Block, Column, Table, number_columns
from warpspace.analysis.description import Analysis, Result, Watch
from warpspace.analysis.line import complete_ends
from warpspace.analysis.options import LOOP_HELP, Place, option, place_words, travel_warnings
from warpspace.exceptions import OptionError
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose, nominal_point
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.scene.model import Scene, evaluate, placed_in
from warpspace.units import UM_PER_MM, URAD_PER_RAD, Array

RIGHT_RAD = 1e-6  # a nominal angle this close to 90° is a right one: its deviation is a squareness


@dataclass(frozen=True, kw_only=True)
class Distance(Analysis):
    """Measure between points of SCENE: distance, angle.

    Points are where the axes stand, by default the ends of the diagonal of the working volume.
    They are taken as the workpiece sees them, and so are the directions x, y, z: as on a part that
    a coordinate measuring machine measures. Difference is actual − nominal. With a corner also the
    angle there between the edges to both points; positive where it is wider than nominal.
    """

    name = "distance"
    task = "understand"
    has_table = True
    start: Place = option(
        (), "First point, mm and degrees", unset="lower ends of the working volume",
        flag="--from", label="From",
    )  # fmt: skip
    end: Place = option(
        (), "Second point", unset="upper ends of the working volume", flag="--to", label="To"
    )
    corner: Place = option((), "Point whose angle between both edges is measured", unset="no angle")
    loop: Loop = option(Loop.TOOL, LOOP_HELP)
    placed: bool = option(False, "Leave out where the workpiece lies; of the relative loop")
    exact: bool = option(False, "The exact chain instead of the first order")

    def run(self, scene: Scene, watch: Watch, /) -> "DistanceResult":
        scene = placed_in(scene, self.loop, placed=self.placed)
        places = list(complete_ends(scene, self.start, self.end))
        if self.corner:
            stand = scene.workspace.positions
            corner = complete_coordinates(scene.machine, dict(self.corner), stand)
            places.append({name: float(at) for name, at in corner.items()})
        if any(place == places[-1] for place in places[:2]) and self.corner:
            raise OptionError("{corner} is an end of an edge; expected a third point")
        found = [self._point(scene, place) for place in places]
        watch(1.0)
        return DistanceResult(
            at=tuple(places),
            nominal_mm=np.stack([point for point, _ in found]),
            error_um=np.stack([error for _, error in found]),
            title=f"{scene.title} · {self.loop} loop",
        )

    def _point(self, scene: Scene, place: Mapping[str, float]) -> tuple[Array, Array]:
        at = complete_coordinates(scene.machine, place)
        to_workpiece = transforms.inverse(branch_pose(scene.model, "workpiece", at))
        point = transforms.apply(to_workpiece, nominal_point(scene.model, Loop.TOOL, at))
        # as over the grid, the workpiece point is the one that nominally is at the tool point
        x, y, z = map(float, point)
        scene = replace(scene, model=replace(scene.model, workpiece_point_mm=(x, y, z)))
        field = evaluate(scene, at=place, loop=self.loop, exact=self.exact, frame="workpiece")
        return point, field.error_um

    def warnings(self, scene: Scene) -> Iterator[str]:
        return travel_warnings(scene.machine, start=self.start, end=self.end, corner=self.corner)


@dataclass(frozen=True, kw_only=True)
class DistanceResult(Result):
    """Distance, its parts along x, y and z, and the angle at the corner where there is one."""

    keys = (
        "at", "nominal_mm", "error_um", "distance_mm", "difference_um", "along_mm", "along_um",
        "angle_deg", "deviation_urad", "is_squareness",
    )  # fmt: skip
    at: tuple[Mapping[str, float], ...]  # start, end and corner, mm or degrees
    nominal_mm: Array  # [n, 3], in the workpiece frame
    error_um: Array  # [n, 3], in the workpiece frame
    title: str

    @property
    def distance_mm(self) -> tuple[float, float]:
        """Nominal and actual."""
        nominal, actual = (float(np.linalg.norm(ends[1] - ends[0])) for ends in self._both())
        return nominal, actual

    @property
    def difference_um(self) -> float:
        nominal, actual = self.distance_mm
        return (actual - nominal) * UM_PER_MM

    @property
    def along_mm(self) -> Array:
        """From start to end along x, y, z, nominal."""
        return self.nominal_mm[1] - self.nominal_mm[0]

    @property
    def along_um(self) -> Array:
        """What the errors add to it, along x, y, z."""
        return self.error_um[1] - self.error_um[0]

    @property
    def angle_deg(self) -> tuple[float, float] | None:
        """Nominal and actual angle at the corner, from the edge to start to the edge to end."""
        if len(self.nominal_mm) == 2:
            return None
        nominal, actual = (_angle_deg(*points) for points in self._both())
        return nominal, actual

    @property
    def deviation_urad(self) -> float | None:
        angle = self.angle_deg
        return None if angle is None else float(np.deg2rad(angle[1] - angle[0])) * URAD_PER_RAD

    @property
    def is_squareness(self) -> bool:
        angle = self.angle_deg
        return angle is not None and abs(np.deg2rad(angle[0]) - np.pi / 2.0) < RIGHT_RAD

    def _both(self) -> tuple[Array, Array]:
        return self.nominal_mm, self.nominal_mm + self.error_um / UM_PER_MM

    def blocks(self) -> Iterator[Block]:
        start, end, *_ = (place_words(place) for place in self.at)
        yield f"{self.title} · from {start} to {end}"
        lengths = (("distance", *self.distance_mm, self.difference_um),)
        along = zip("xyz", self.along_mm, self.along_um, strict=True)
        parts = ((f"along {x}", mm, mm + um / UM_PER_MM, um) for x, mm, um in along)
        columns = (
            Column(key="of", leads=True),
            *number_columns(("nominal", "actual"), ".4f", "mm", ("nominal_mm", "actual_mm")),
            Column("difference", "+.2f", "µm", key="difference_um"),
        )
        rows = [(name, *map(float, numbers)) for name, *numbers in (*lengths, *parts)]
        yield Table(columns, rows)
        if self.angle_deg is not None:
            nominal, actual = self.angle_deg
            kind = "squareness" if self.is_squareness else "deviation"
            yield f"angle at {place_words(self.at[2])}: {nominal:.6f}° → {actual:.6f}°"
            yield (
                f"  {kind} of the edge to {end} against the edge to {start}:"
                f" {self.deviation_urad:+.2f} µrad; positive is wider"
            )


def _angle_deg(start: Array, end: Array, corner: Array) -> float:
    first, second = start - corner, end - corner
    across = np.linalg.norm(np.cross(first, second))
    return float(np.rad2deg(np.arctan2(across, first @ second)))
