"""Distance between two points and the angle at a third: nominal, actual and difference."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from dataclasses import field as attribute
from typing import Any

import numpy as np

from warpspace.analysis.blocks import Block, Column, Table, number_columns
from warpspace.analysis.commands.line import Between
from warpspace.analysis.description import ExpandedUncertainty, ProgressCallback, Result
from warpspace.analysis.options import LOOP_HELP, LOOP_UNSET, Place, option, place_words
from warpspace.analysis.uncertainty.propagation import field_uncertainty, plus_minus
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import ErrorField, evaluate_exact, evaluate_first_order
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose, nominal_point
from warpspace.kinematics.model import Coordinates, Loop
from warpspace.scene.model import Scene, with_placement
from warpspace.units import MINUS, UM_PER_MM, URAD_PER_RAD, Array, spell_change

RIGHT_RAD = 1e-6  # a nominal angle this close to 90° is a right one: its deviation is a squareness


@dataclass(frozen=True, kw_only=True)
class Distance(Between):
    """Measure between points of SCENE: distance, angle.

    Points are where the axes stand, by default the ends of the diagonal of the working volume.
    They are taken as the workpiece sees them, and so are the directions x, y, z: as on a part that
    a coordinate measuring machine measures. Difference is actual − nominal. With a corner also the
    angle there between the edges to both points; positive where it is wider than nominal.
    """

    name = "distance"
    task = "understand"
    has_table = True
    corner: Place = option((), "Point whose angle between both edges is measured", unset="no angle")
    loop: Loop | None = option(None, LOOP_HELP, unset=LOOP_UNSET)
    placed: bool = option(False, "Fit out the placement of the workpiece; relative loop only")
    exact: bool = option(False, "The exact chain instead of the first order")

    def run(self, scene: Scene, watch: ProgressCallback, /) -> "DistanceResult":
        scene = with_placement(scene, self.loop, placed=self.placed)
        view = scene.view(self.loop)
        at = self.places(scene, self.corner)
        point = nominal_point(scene.model, Loop.TOOL, at)  # in any loop, as over the grid
        solve = evaluate_exact if self.exact else evaluate_first_order
        field = solve(scene.model, scene.errors, at, view, point)
        watch(1.0)
        result = self.between(scene, at, field)
        uncertainty = field_uncertainty(scene, field.error_um, at, view, point)
        if uncertainty is None:
            return result

        def measure(error_um: Array) -> Array:
            moved = self.between(scene, at, replace(field, error_um=error_um))
            return np.array([moved.difference_um, moved.deviation_urad or 0.0, *moved.along_um])

        distance, angle, *along = uncertainty.propagate(measure)
        u95 = ExpandedUncertainty[Any](u95_difference_um=distance, u95_along_um=along)
        if self.corner:
            u95["u95_deviation_urad"] = angle
        return replace(result, expanded_uncertainty=u95)

    def between(self, scene: Scene, at: Coordinates, field: ErrorField) -> "DistanceResult":
        """Measure between points, [n], of a field in R."""
        to_workpiece = transforms.inverse(branch_pose(scene.model, "workpiece", at))
        nominal = transforms.apply(to_workpiece, field.nominal_mm)
        error = transforms.rotate(to_workpiece[..., :3, :3], field.error_um)
        start, end, *corner = np.stack([nominal, nominal + error / UM_PER_MM], axis=1)
        distance = np.linalg.norm(end - start, axis=-1)
        angle = _angles_rad(start - corner[0], end - corner[0]) if corner else None
        return DistanceResult(
            at=tuple(
                dict(zip(at, coordinates, strict=True))
                for coordinates in np.transpose([*at.values()])
            ),
            nominal_mm=nominal,
            error_um=error,
            distance_mm=distance,
            difference_um=float(distance[1] - distance[0]) * UM_PER_MM,
            along_mm=nominal[1] - nominal[0],
            along_um=error[1] - error[0],
            angle_deg=None if angle is None else np.rad2deg(angle),
            deviation_urad=None if angle is None else float(angle[1] - angle[0]) * URAD_PER_RAD,
            is_squareness=angle is not None and bool(abs(angle[0] - np.pi / 2.0) < RIGHT_RAD),
            title=f"{scene.title} · {scene.view(self.loop).loop} loop",
        )


def _angles_rad(first: Array, second: Array) -> Array:
    if not first[0].any() or not second[0].any():
        raise OptionError("{corner} is an end of an edge; expected a third point")
    across = np.linalg.norm(np.cross(first, second), axis=-1)
    return np.arctan2(across, (first * second).sum(axis=-1))


@dataclass(frozen=True, kw_only=True)
class DistanceResult(Result):
    """Distance, its components, and the angle at the corner if there is one."""

    json_keys = (
        "at", "nominal_mm", "error_um", "distance_mm", "difference_um", "along_mm", "along_um",
        "angle_deg", "deviation_urad", "is_squareness", "expanded_uncertainty",
    )  # fmt: skip
    at: tuple[Mapping[str, float], ...]  # start, end and corner, mm or degrees
    nominal_mm: Array  # [n, 3], in the workpiece frame
    error_um: Array  # [n, 3], in the workpiece frame
    distance_mm: Array  # [2], nominal and actual
    difference_um: float
    along_mm: Array  # [3], from start to end, nominal
    along_um: Array  # [3], what the errors add to it
    # [2], nominal and actual, from the edge to start to the edge to end; None without a corner
    angle_deg: Array | None
    deviation_urad: float | None
    is_squareness: bool
    title: str
    expanded_uncertainty: ExpandedUncertainty[Any] = attribute(
        default_factory=ExpandedUncertainty[Any]
    )

    def lines(self) -> list[str]:
        """Format the distance, its components, and the angle if there is a corner."""
        nominal, actual = self.distance_mm
        parts = (f"Δ{x} {um:+.1f}" for x, um in zip("xyz", self.along_um, strict=True))
        lines = [
            f"{nominal:.3f} → {actual:.3f} mm, {self.difference_um:+.1f} µm",
            f"{'  '.join(parts)} µm",
        ]
        if self.angle_deg is not None:
            nominal, actual = self.angle_deg
            lines.append(f"angle {nominal:.4f} → {actual:.4f}°, {self.deviation_urad:+.1f} µrad")
        return [line.replace("-", MINUS) for line in lines]

    def blocks(self) -> Iterator[Block]:
        start, end, *_ = (place_words(place) for place in self.at)
        yield f"{self.title} · from {start} to {end}"
        nominal_mm = (self.distance_mm[0], *self.along_mm)
        added_um = (self.difference_um, *self.along_um)
        names = ("distance", "along x", "along y", "along z")
        rows = [
            (name, float(mm), float(mm + um / UM_PER_MM), float(um))
            for name, mm, um in zip(names, nominal_mm, added_um, strict=True)
        ]
        if self.expanded_uncertainty:
            u95 = (
                self.expanded_uncertainty["u95_difference_um"],
                *self.expanded_uncertainty["u95_along_um"],
            )
            rows = [(*row, plus_minus(expanded)) for row, expanded in zip(rows, u95, strict=True)]
        columns = (
            Column(key="of", leads=True),
            *number_columns(("nominal", "actual"), ".4f", "mm", ("nominal_mm", "actual_mm")),
            Column("difference", "+.2f", "µm", key="difference_um"),
            *([Column("U95", unit="µm", key="u95_um")] if self.expanded_uncertainty else []),
        )
        yield Table(columns, rows)
        if self.angle_deg is not None:
            nominal, actual = self.angle_deg
            kind = "squareness" if self.is_squareness else "deviation"
            angle = (
                f" {plus_minus(self.expanded_uncertainty['u95_deviation_urad'])}"
                if self.expanded_uncertainty
                else ""
            )
            yield f"angle at {place_words(self.at[2])}: {nominal:.6f}° → {actual:.6f}°"
            yield (
                f"  {kind} of the edge to {end} against the edge to {start}:"
                f" {spell_change(self.deviation_urad or 0.0)} µrad{angle}; positive is wider"
            )
