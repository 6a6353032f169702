"""One picture in numbers: an evaluated volume with its display factor and its colours."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from warpspace.analysis.description import to_json
from warpspace.analysis.statistics import Statistics, volume_statistics
from warpspace.analysis.uncertainty.propagation import (
    NOT_STATED,
    FieldUncertainty,
    field_uncertainty,
)
from warpspace.analysis.uncertainty.verdict import VERDICT_PROBABILITY
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import ErrorField, View, placed_words, second_order_words
from warpspace.field.grid import DEFAULT_NODES, Grid, build_grid
from warpspace.geometry import surfaces
from warpspace.geometry.colour import SYMBOLS, ColourScale, build_scale, component_values
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import parameter
from warpspace.machine.limits import EXAGGERATION
from warpspace.picture.formatting import direction_words
from warpspace.picture.traces import TraceLines, evaluate_traces
from warpspace.resources import __version__
from warpspace.scene.model import Scene, choose_view, evaluate, second_order
from warpspace.scene.scene_writer import scene_to_toml
from warpspace.units import Array

Floats = NDArray[np.float32]

CUT_CORNER = (1, 0, 1)
"""The octant that is cut away: the one nearest to the operator, right, front and top."""


def map_faces(shape: surfaces.Shape, *, cut: bool = False) -> list[surfaces.Index]:
    """List the patches of the surface that is drawn, whole or without the octant cut away."""
    return surfaces.cut_faces(shape, CUT_CORNER) if cut else surfaces.outer_faces(shape)


@dataclass(frozen=True, slots=True)
class Topology:
    """Indices of the surface and lines of a grid; independent of its deformation."""

    surface: surfaces.Surface
    grid_segments: surfaces.Index  # [S, 2]; flat node indices of the ends of each piece of line
    edge_segments: surfaces.Index
    # [S, 2, 3]; at the ends of the pieces of line, the sum of the outward directions of the faces
    # that the node lies on
    grid_outwards: Floats
    edge_outwards: Floats
    # [a, b]; rectangular patches of nodes that the surface consists of
    faces: tuple[surfaces.Index, ...]
    normals: Array  # [F, 3]; outward direction of each patch


@lru_cache(maxsize=32)
def topology(shape: surfaces.Shape, *, cut: bool = False) -> Topology:
    faces = map_faces(shape, cut=cut)
    normals = np.array([_normal(face, shape) for face in faces]).reshape(-1, 3)
    outwards = np.zeros((int(np.prod(shape)), 3))
    for face, normal in zip(faces, normals, strict=True):
        outwards[face] += normal
    outwards = np.sign(outwards).astype(np.float32)  # patches of one plane share nodes
    lines = surfaces.face_lines(faces, shape, surfaces.line_spacing(shape))
    grid, edges = surfaces.segments(lines), surfaces.segments(surfaces.crease_lines(faces, shape))
    surface = surfaces.triangulate(faces)
    return Topology(surface, grid, edges, outwards[grid], outwards[edges], tuple(faces), normals)


def _normal(face: surfaces.Index, shape: surfaces.Shape) -> Array:
    corners = np.stack(np.unravel_index(face[[0, -1, 0], [0, 0, -1]], shape), -1)
    return np.sign(np.cross(corners[1] - corners[0], corners[2] - corners[0])).astype(float)


QUANTITIES = {
    "position": "position error",
    "orientation": "tool-orientation error",
    "uncertainty": "uncertainty of the position error",
}
"""Quantities that colours can show."""
DIFFERENCE_LENGTH = "|E_B − E_A|"
"""Quantity of the statistics of a difference: the length of the change of the error vector."""
SAME_PLACE_MM = 1e-6  # nodes nearer to each other than this are the same


@dataclass(frozen=True, kw_only=True)
class Picture:
    """Evaluated grid with display settings, the input of every renderer, export and page."""

    view: View  # loop, frame and reference of the errors
    grid: Grid
    field: ErrorField  # errors of all nodes of the grid
    exaggeration: float  # display factor of displacements; 1 is true scale
    component: str = "norm"  # coloured component: "norm", "x", "y" or "z" ..
    # ... of the "position" error, µm, of the "orientation" error of the tool axis, µrad, or of the
    # "uncertainty" of the position error, its U95, µm.
    quantity: str = "position"
    uncertainty: FieldUncertainty | None = None  # of its errors; None if not stated
    significant: bool = False  # whether colours fade where an error is not above its U95
    # limit of |E|; colours fade where the verdict is undecided
    limit_um: float | None = None
    # limit of the coloured values, above which the surface is hatched; None for none
    hatch_um: float | None = None
    # colour scale, for instance shared with other pictures; None for round ends around all values
    colours: ColourScale | None = None
    cut: bool = False  # whether the octant towards the operator is cut away
    # slices drawn in place of the surface, if any
    slices: "tuple[Picture, ...]" = ()
    # restrictions that every output states: excluded errors, a colour range set by the user
    conditions: tuple[str, ...] = ()
    is_difference: bool = False  # whether it is the change from one picture to another, B − A

    @property
    def length_words(self) -> str:
        """Quantity of the statistics."""
        return DIFFERENCE_LENGTH if self.is_difference else "|E|"

    @property
    def tilts(self) -> bool:
        """True if the colours show the orientation error of the tool axis."""
        return self.quantity == "orientation"

    @property
    def shape(self) -> surfaces.Shape:
        return self.grid.shape

    @property
    def topology(self) -> Topology:
        return topology(self.grid.shape, cut=self.cut)

    @cached_property
    def size_mm(self) -> float:
        """Reference length for the size of marks, mm: the longest edge of the volume."""
        return self.grid.longest_edge_mm

    @property
    def exceeded_um(self) -> float | None:
        """The limit above which the surface is hatched, if a value is above it."""
        limit = self.hatch_um
        return limit if limit is not None and float(self.values.max()) > limit else None

    @cached_property
    def statistics(self) -> Statistics:
        """Statistics of the length of the position error over the volume."""
        return volume_statistics(self.field, self.grid)

    @cached_property
    def values(self) -> Array:
        """Coloured values at the nodes, [nx, ny, nz], in the unit of the scale."""
        if self.quantity == "uncertainty" and self.u95_um is not None:
            return self.u95_um
        return coloured_values(self.field, self.component, self.quantity)

    @cached_property
    def u95_um(self) -> Array | None:
        """U95 of the component of position errors, [nx, ny, nz]; None if unknown."""
        uncertainty = self.uncertainty
        if uncertainty is None or not uncertainty.errors.is_known:
            return None
        if self.component == "norm":
            return uncertainty.u95_norm_um
        return component_values(uncertainty.u95_um, self.component)

    @cached_property
    def faded(self) -> NDArray[np.bool_] | None:
        """Nodes with faded colours: undecided or not significant, [nx, ny, nz]; None if none."""
        uncertainty = self.uncertainty
        if uncertainty is None or self.u95_um is None or self.tilts:
            return None
        if self.limit_um is not None:
            probability = uncertainty.conformance_probability(self.limit_um)
            return (probability > 1.0 - VERDICT_PROBABILITY) & (probability < VERDICT_PROBABILITY)
        if not self.significant:
            return None
        return np.abs(coloured_values(self.field, self.component)) <= self.u95_um

    @cached_property
    def scale(self) -> ColourScale:
        if self.colours is not None:
            return self.colours
        values, change = [self.values], self.is_difference
        return choose_scale(values, self.component, self.quantity, change=change)

    @cached_property
    def drawn_mm(self) -> Array:
        """Displaced nodes, [nx, ny, nz, 3], mm."""
        return surfaces.deform(self.grid.nominal_mm, self.field.error_um, self.exaggeration)


P = TypeVar("P", bound=Picture)


def coloured_error(field: ErrorField, quantity: str) -> Array:
    """Return the position or orientation errors, [..., 3], µm or µrad."""
    return field.orientation_urad if quantity == "orientation" else field.error_um


def coloured_values(field: ErrorField, component: str, quantity: str = "position") -> Array:
    if component == "norm" and quantity == "position":
        return field.norm_um
    return component_values(coloured_error(field, quantity), component)


def choose_scale(
    values: "list[Array]",
    component: str,
    quantity: str = "position",
    end: float | None = None,
    *,
    change: bool = False,
) -> ColourScale:
    symbol, unit = SYMBOLS[quantity]
    largest = max((float(np.abs(part).max(initial=0.0)) for part in values), default=0.0)
    if quantity == "uncertainty":
        label = "U95 |E|" if component == "norm" else f"U95 E_{component}"
        return replace(build_scale(largest, "norm", unit=unit, end=end), label=label)
    return build_scale(largest, component, quantity=symbol, unit=unit, end=end, change=change)


def same_nodes(first_mm: Array, second_mm: Array) -> bool:
    """Check that two sets of nominal points, [..., 3], mm, coincide."""
    return first_mm.shape == second_mm.shape and bool(
        np.allclose(first_mm, second_mm, rtol=0.0, atol=SAME_PLACE_MM)
    )


def subtract_pictures(minuend: P, subtrahend: Picture) -> P:
    if not same_nodes(minuend.grid.nominal_mm, subtrahend.grid.nominal_mm):
        raise OptionError("the working volumes differ: no difference can be formed")
    quantity = "position" if minuend.quantity == "uncertainty" else minuend.quantity
    return replace(
        minuend, field=minuend.field - subtrahend.field, quantity=quantity, uncertainty=None,
        colours=None, hatch_um=None, is_difference=True,
    )  # fmt: skip


def subtract_traces(
    minuends: Sequence[TraceLines], subtrahends: Sequence[TraceLines]
) -> tuple[TraceLines, ...]:
    return tuple(
        replace(first, error_um=first.error_um - second.error_um)
        for first, second in zip(minuends, subtrahends, strict=False)
        if same_nodes(first.nominal_mm, second.nominal_mm)
    )


@dataclass(frozen=True, kw_only=True)
class Slice(Picture):
    """A picture of one plane of the working volume."""

    axis: str  # the fixed axis: the grid has one node along it
    position_mm: float  # of that axis


Direction = tuple[float, float, float]

VIEWS: Mapping[str, Direction] = {
    "iso": (0.53, -0.85, 0.55),
    "front": (0.0, -1.0, 0.0),
    "right": (1.0, 0.0, 0.0),
    "top": (0.0, 0.0, 1.0),
}
"""Direction towards the viewer, in R; the operator stands on the −Y side."""
UPWARDS: Mapping[str, Direction] = {"top": (0.0, 1.0, 0.0)}
"""Upward direction of a view, in R, where it is not z."""
VIEW_WORDS = {
    "front": "front view, from the operator",
    "right": "view from the right",
    "top": "view from above",
}


def view_words(view: str, shape: surfaces.Shape) -> str:
    """Describe the direction of view and the part of the volume that is cut away."""
    is_cut = view == "iso" and min(shape) >= surfaces.MIN_CUT_NODES
    return "octant towards the viewer cut away" if is_cut else VIEW_WORDS.get(view, "iso view")


Exaggeration = float | Literal["auto"] | None
"""Display factor, "auto" for a round one that suits the errors, None for the scene's."""


def fixed_exaggeration(requested: Exaggeration, scene_factor: float | None) -> float | None:
    """Return the requested factor, else the scene's; None where one is to be chosen."""
    factor = scene_factor if requested is None else requested
    if factor is None or factor == "auto":
        return None
    low, high = EXAGGERATION
    if not low <= factor <= high:  # nor is NaN
        problem = f"exaggeration {factor:g}; expected auto or a number above 0"
        raise OptionError(f"{problem}, from {low:g} to {high:,.0f}")
    return float(factor)


def choose_exaggeration(
    requested: Exaggeration, scene_factor: float | None, largest_um: float, size_mm: float
) -> float:
    """Choose the display factor of a picture, or of several that share one."""
    fixed = fixed_exaggeration(requested, scene_factor)
    return surfaces.auto_exaggeration(largest_um, size_mm) if fixed is None else fixed


LEAST_SIZE_MM = 100.0  # of a single point without traces, on a machine without linear axes


def picture_size_mm(scene: Scene, grid: Grid) -> float:
    if grid.longest_edge_mm > 0.0:
        return grid.longest_edge_mm
    axes = scene.machine.axes.values()
    if any(not axis.is_linear for axis in axes):
        circle = 2.0 * max((math.hypot(*point) for point in scene.trace_points_mm), default=0.0)
        if circle > 0.0:
            return circle
    travels = (axis.travel[1] - axis.travel[0] for axis in axes if axis.is_linear)
    return max(travels, default=0.0) or LEAST_SIZE_MM


@dataclass(frozen=True, kw_only=True)
class ScenePicture(Picture):
    """A scene evaluated over its grid."""

    scene: Scene

    @cached_property
    def size_mm(self) -> float:
        """Reference length for the size of marks, mm; defined for a single point too."""
        return picture_size_mm(self.scene, self.grid)

    @cached_property
    def traces(self) -> tuple[TraceLines, ...]:
        return evaluate_traces(self.scene, self.exaggeration)

    @cached_property
    def settings(self) -> dict[str, Any]:
        reference = self.scene.reference
        return {
            "loop": str(self.view.loop),
            "reference": "absolute" if reference is None else dict(reference),
            "component_errors": self.scene.model.convention_value,
            "model": "first order",
            "nodes": list(self.grid.shape),
            "exaggeration": self.exaggeration,
            "component": self.component,
            "coloured": QUANTITIES[self.quantity],
            "conditions": list(self.conditions),
        }

    @property
    def remarks(self) -> dict[str, str]:
        """Columns that are the same in all rows of a table: scene, loop, reference, convention."""
        return field_remarks(self.scene, self.view, conditions="; ".join(self.conditions))

    @cached_property
    def provenance(self) -> dict[str, Any]:
        """Program, scene, settings, statistics and parameters, fit for JSON."""
        scene = self.scene
        return {
            "program": f"warpspace {__version__}",
            "scene": scene.name,
            "title": scene.title,
            "machine": scene.machine.title,
            "chain": str(scene.machine.chain),
            "settings": self.settings,
            "statistics": to_json(self.statistics),
            "parameters": {
                key: {"amplitude": scene.errors.amplitude(key), "unit": parameter(key).unit}
                for key in scene.errors
                if scene.errors.amplitude(key) != 0.0
            },
            "scene_toml": scene_to_toml(scene),
        }


def field_remarks(
    scene: Scene, view: View, *, exact: bool = False, **others: str
) -> dict[str, str]:
    convention = scene.model.convention_value
    placement = {} if view.placed_over is None else {"placement": "fitted out"}
    reference = " ".join(f"{axis}={at:g}" for axis, at in (view.reference or {}).items())
    if not isinstance(convention, str):
        convention = " ".join(f"{axis}={name}" for axis, name in convention.items())
    return {
        "scene": scene.name,
        "loop": str(view.loop),
        **placement,
        "reference": "absolute" if view.reference is None else reference,
        "component_errors": convention,
        "model": "exact chain" if exact else "first order",
        **others,
        "program": f"warpspace {__version__}",
    }


def evaluate_picture(
    scene: Scene,
    *,
    grid: int = DEFAULT_NODES,
    loop: Loop | str | None = None,
    exaggeration: Exaggeration = None,
    component: str = "norm",
    quantity: str = "position",
    colours: ColourScale | None = None,
    conditions: Sequence[str] = (),
) -> ScenePicture:
    view = choose_view(scene, loop)
    nodes = build_grid(scene.model, scene.workspace, grid)
    field = evaluate(scene, grid=grid, loop=loop)
    coloured_values(field, component, quantity)  # raises for an unknown component
    largest, size, uncertainty = float(field.norm_um.max()), picture_size_mm(scene, nodes), None
    if quantity == "uncertainty":
        uncertainty = field_uncertainty(
            scene, field.error_um, nodes.coordinates, view, nodes.point_mm
        )
        if uncertainty is None or not uncertainty.errors.is_known:
            remarks = () if uncertainty is None else uncertainty.errors.remarks()
            raise OptionError("; ".join(remarks) or NOT_STATED)
    orders = second_order_words(second_order(scene, loop))
    return ScenePicture(
        view=view,
        grid=nodes,
        field=field,
        exaggeration=choose_exaggeration(exaggeration, scene.exaggeration, largest, size),
        component=component,
        quantity=quantity,
        uncertainty=uncertainty,
        colours=colours,
        hatch_um=scene.limit_um if (component, quantity) == ("norm", "position") else None,
        conditions=(*direction_words(scene), *placed_words(view), *orders, *conditions),
        scene=scene,
    )
