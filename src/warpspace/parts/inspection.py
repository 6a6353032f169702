"""Inspection of the actual workpiece: features, their measures, tolerances and contributions.

A shape is a surface of revolution about an axis: a point at the height h along it and the distance
ρ from it has the distance (ρ − radius) · cos φ − h · sin φ to the surface. φ is 0 for a
cylinder and the half angle of a cone; −90° makes it a plane whose axis is its normal; without an
axis it is a sphere. Shapes are fitted to vertices by least squares of these distances, weighted by
the area of their triangles, and follow their small displacements in first order, by least squares
or, where a feature states it, as minimum zone, maximum inscribed or minimum circumscribed shape.
Surfaces of scans are fitted likewise, without outliers; their residuals stay in form errors.
A measure is
evaluated on the workpiece as clamped, and `placed`, after the best rigid fit of its surface. The
contribution of a parameter is evaluated where all errors are half as large, so that contributions
add up.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from warpspace.analysis.blocks import Column, Table, number_columns
from warpspace.analysis.commands.contributions import budget_words
from warpspace.analysis.uncertainty.propagation import (
    ErrorUncertainty,
    FieldUncertainty,
    plus_minus,
)
from warpspace.analysis.uncertainty.verdict import Verdict
from warpspace.exceptions import OptionError, SceneError, near_miss
from warpspace.kinematics.model import Loop
from warpspace.kinematics.transforms import skew, vector_rotation
from warpspace.parts.workpiece import (
    ActualPoints,
    Workpiece,
    measure_triangles,
    point_basis,
    subtract_best_fit,
)
from warpspace.scene import schema
from warpspace.scene.model import Scene, evaluate
from warpspace.scene.text_files import parse_toml
from warpspace.units import MM_PER_UM, RAD_PER_URAD, UM_PER_MM, URAD_PER_RAD, Array, spell_signed

SMOOTH_DEG = 30.5  # triangles meeting at less may belong to one curved surface: 12 around a hole
FLAT_RAD = 1e-3  # triangles meeting at less lie in one facet
ROUNDING_SHARE = 5e-6  # share of the largest coordinate: files with six digits
SHAPE_SHARE = 2e-5  # share of its extent by which vertices may deviate from a shape, and rounding
NEAR_DEG = 12.0  # angle between triangles and the first guess of the shape, at most
FACETS = 4  # of a curved surface, at least: fewer lie on many shapes
FACET_RATIO = 4.0  # facets within this ratio may belong to one surface that is tangent to others
SLIVER_SHARE = 0.01  # share of the area whose normals may deviate
AXIS_MM = 1e-3  # distance from an axis below which a point, as the tip of a cone, has no side
RANK_TOLERANCE = 3e-7  # share of the strongest response below which a freedom is undetermined
STEPS, STILL_MM, FAR_MM = 40, 1e-11, 1e6  # of a fit; changes of a distance that end it
SCAN_NOISE_UM = 20.0  # largest standard deviation of vertices of a scan
OUTLIER = 4.0  # standard deviations beyond which a vertex of a scan is an outlier
ROBUST_STEPS, MEDIAN_TO_SIGMA = 5, 1.4826  # of a normal distribution
OUTLIER_SHARE, SCAN_DEG = 0.01, 30.0  # outliers; angle between triangles and the first guess
SCAN_VERTICES = 24  # of a surface, at least: fewer lie near many shapes
SIMPLER = 1.1  # ratio of residuals up to which the simpler shape is chosen
MAX_FEATURES = 500  # the largest surfaces of a mesh; smaller ones are ignored
RIGHT_RAD = 1e-4  # tolerance of nominal angles of 90° or 0, and of what datums fix
SMALL_MM, SMALL_RAD = 1.0, 0.01  # distances and angles of which changes are not linear
STEP_SHARE = 1e-4  # step of difference quotients, as a share of an error
LEVER_MM = 100.0  # weight of rotations against translations that datums leave free
SHAPES = "plane", "cylinder", "cone", "sphere"  # in the order of trials


@dataclass(frozen=True, eq=False)
class FeatureShape:
    """A plane, sphere, cylinder or cone."""

    kind: str
    centre_mm: Array  # [3]; on the plane or axis, amid its triangles
    axis: Array  # [3], unit vector; outward normal of a plane, zero of a sphere
    radius_mm: float = 0.0  # at the centre
    angle_rad: float = 0.0  # half angle of a cone, along whose axis the radius grows

    @property
    def across(self) -> Array:
        """Projection on the directions in which its position is determined, [3, 3]."""
        along = np.outer(self.axis, self.axis)
        return along if self.kind == "plane" else np.eye(3) - along

    def move(self, step: Array) -> "FeatureShape":
        """Return the shape after a step, [8], of the columns of its design matrix."""
        centre, axis = self.centre_mm + step[:3], vector_rotation(step[3:6]) @ self.axis
        radius, angle = self.radius_mm + step[6], self.angle_rad + step[7]
        return FeatureShape(self.kind, centre, axis, radius, angle)

    def respond(self, point_mm: Array) -> tuple[Array, Array, Array]:
        """Compute distances of points, [n], outwards, and their derivatives.

        These are unit vectors, [n, 3], by the points, and a design matrix, [n, 8], by translation,
        rotation, and radius or, of a cone, angle.
        """
        arm = point_mm - self.centre_mm
        sine, cosine = np.sin(self.angle_rad), np.cos(self.angle_rad)
        height = arm @ self.axis
        radial = arm - np.outer(height, self.axis)
        length = np.linalg.norm(radial, axis=1)
        beyond = length - self.radius_mm
        normal = radial * (cosine / np.maximum(length, AXIS_MM))[:, None] - sine * self.axis
        opening, widening = beyond * sine + height * cosine, np.full_like(beyond, cosine)
        sizes = [0.0 * widening, opening] if self.kind == "cone" else [widening, 0.0 * opening]
        design: Any = -np.column_stack([normal, np.cross(arm, normal), *sizes])
        return beyond * cosine - height * sine, normal, design


class ShapeMotion(NamedTuple):
    """Motion of a shape that follows F fields of small displacements."""

    shape: FeatureShape
    shift_mm: Array  # [F, 3], of its centre
    turn_rad: Array  # [F, 3]
    radius_mm: Array  # [F]
    angle_rad: Array  # [F]
    distance_mm: Array  # [F, n], of its points

    @property
    def form_mm(self) -> Array:
        """Span of the distances of its points, [F]."""
        return np.ptp(self.distance_mm, axis=1)


@dataclass(frozen=True, eq=False)
class Feature:
    """One surface of a workpiece."""

    shape: FeatureShape  # in the frame of the mesh
    vertices: NDArray[np.int32]  # [n], of the refined mesh
    shares: Array  # [n], of its area
    area_mm2: float
    normal: Array  # [n, 3]; see `FeatureShape.respond`
    design: Array  # [n, 8]
    residual_mm: Array  # [m], of its first vertices, those of a scan; zero of a nominal mesh
    fit: str = schema.LEAST_SQUARES

    @property
    def residual_um(self) -> float:
        """Standard deviation of the vertices of a scan from the shape."""
        return float(np.std(self.residual_mm)) * UM_PER_MM

    def with_fit(self, fit: str) -> "Feature":
        """Return the feature with its shape fitted otherwise to its vertices."""
        if fit == schema.LEAST_SQUARES:
            return self
        design = self.design[: len(self.residual_mm)]
        step = fit_extreme(design, self.residual_mm, fit)
        if not self.residual_mm.any():
            step[:] = 0.0
        residual = self.residual_mm + design @ step
        return replace(self, shape=self.shape.move(step), residual_mm=residual, fit=fit)

    def follow(self, move_um: Array) -> ShapeMotion:
        """Fit the motion of the shape to displacements of all vertices of the mesh, [F, V, 3]."""
        move, root = move_um[:, self.vertices] * MM_PER_UM, np.sqrt(self.shares)[:, None]
        mean = self.shares @ move  # directions without influence on distances follow it
        away = np.einsum("fnc,nc->fn", move - mean[:, None], self.normal)
        step = -np.linalg.lstsq(self.design * root, away.T * root, RANK_TOLERANCE)[0].T
        count = len(self.residual_mm)
        away, design = away[:, :count] + self.residual_mm, self.design[:count]
        if self.fit != schema.LEAST_SQUARES:
            step = np.array([fit_extreme(design, distance, self.fit) for distance in away])
        radius, angle = self.shape.radius_mm + step[:, 6], self.shape.angle_rad + step[:, 7]
        distance = away + step @ design.T
        return ShapeMotion(self.shape, mean + step[:, :3], step[:, 3:6], radius, angle, distance)


def fit_shape(start: FeatureShape, point_mm: Array, shares: Array | None = None) -> FeatureShape:
    """Fit a shape to points, [n, 3], by least squares of distances, from an approximate one."""
    shape, root = start, np.sqrt(np.ones(len(point_mm)) if shares is None else shares)
    for _ in range(STEPS):
        distance, _, design = shape.respond(point_mm)
        step: Any = -np.linalg.lstsq(design * root[:, None], distance * root, RANK_TOLERANCE)[0]
        shape = shape.move(step)
        if not STILL_MM < np.abs(design @ step).max() < FAR_MM:
            break
    return shape


def fit_extreme(design: Array, distance_mm: Array, fit: str) -> Array:
    """Fit a minimum zone, a maximum inscribed or a minimum circumscribed shape to distances, [n].

    Returns
    -------
    ndarray, [8]
        Step of the shape, of the columns of `design`. To first order it is the linear programme of
        Chebyshev: the least t of |distance + design · step| ≤ t, or the extreme radius of which all
        distances are on one side.
    """
    from scipy.optimize import linprog

    _, size, axes = np.linalg.svd(design, full_matrices=False)
    is_free = size > RANK_TOLERANCE * size[0]
    basis = axes[is_free].T * (np.sqrt(len(design)) / size[is_free])
    rows, limit = design @ basis, -distance_mm * UM_PER_MM
    signs = {"inscribed": (-1.0,), "circumscribed": (1.0,)}.get(fit, (1.0, -1.0))
    zone = np.full((len(rows), 1), -1.0 if len(signs) == 2 else 0.0)
    goal = np.append(basis[6] * signs[0] * (len(signs) == 1), -zone[0])
    solution = linprog(
        goal,
        np.vstack([np.hstack([sign * rows, zone]) for sign in signs]),
        np.concatenate([sign * limit for sign in signs]),
        bounds=[(None, None)] * is_free.sum() + [(0.0, None)],
    )
    if solution.x is None:
        raise OptionError(f"points on one side do not determine its {fit} fit")
    return basis @ solution.x[:-1] * MM_PER_UM


def find_features(fine: Workpiece, noise_um: float = SCAN_NOISE_UM) -> dict[str, Feature]:
    """Find the shapes that the surface of a part consists of, sorted by kind, size and place.

    Those of the original mesh, with the vertices of the refined one. Surfaces between creases are
    examined first, then the remaining ones, divided by the size of their facets, finally those of
    scans. A surface that deviates from all shapes by more than `SHAPE_SHARE` of its extent, and of
    a scan by a standard deviation of more than `noise_um`, is no feature.
    """
    from trimesh.graph import connected_component_labels, connected_components

    mesh = fine.original or fine
    area, pairs = mesh.surface.area_faces, mesh.surface.face_adjacency
    angle = mesh.surface.face_adjacency_angles
    facet_of = connected_component_labels(pairs[angle < FLAT_RAD], len(area))
    pairs = pairs[angle < np.deg2rad(SMOOTH_DEG)]
    facet = np.bincount(facet_of, area)[facet_of][pairs]
    is_alike = facet.max(axis=1) < FACET_RATIO * facet.min(axis=1)
    is_free, features = np.ones(len(area), dtype=bool), list[Feature]()
    for chosen, noise in ((True, 0.0), (is_alike, 0.0), (True, noise_um)):
        links = pairs[chosen & is_free[pairs].all(axis=1)]
        # a single triangle is flat whatever the machine does
        surfaces: Any = connected_components(links, min_len=2, engine="scipy")
        for rows in sorted(surfaces, key=lambda rows: -area[rows].sum())[:MAX_FEATURES]:
            kinds = SHAPES if len(np.unique(facet_of[rows])) >= FACETS else SHAPES[:1]
            fits = (_fit_feature(fine, mesh, kind, rows, noise) for kind in kinds)
            if noise:
                fits = [*filter(None, fits)]
                limit = SIMPLER * min((fit.residual_um for fit in fits), default=0.0)
                fits = (fit for fit in fits if fit.residual_um <= limit)
            feature = next(filter(None, fits), None)
            if feature is not None:
                is_free[rows] = False
                features.append(feature)
    if any(feature.residual_um for feature in features):
        # a few triangles of a scan may lie on a plane by chance
        least = SLIVER_SHARE * area.sum()
        features = [x for x in features if x.area_mm2 > least or len(x.vertices) >= SCAN_VERTICES]
    features.sort(key=lambda x: (float(f"{-x.area_mm2:.5g}"), *x.shape.centre_mm.round(3)))
    names: dict[str, Feature] = {}
    for kind in SHAPES:
        same_kind = (feature for feature in features if feature.shape.kind == kind)
        names |= {f"{kind} {number}": feature for number, feature in enumerate(same_kind, 1)}
    return names


def _fit_feature(
    fine: Workpiece, mesh: Workpiece, kind: str, rows: NDArray[np.intp], noise_um: float
) -> Feature | None:
    """Fit a shape to triangles; None where their normals or vertices deviate from it.

    With `noise_um`, vertices may have a standard deviation up to that, and a few be outliers.
    """
    normal, area = mesh.surface.face_normals[rows], mesh.surface.area_faces[rows]
    place, weight = mesh.surface.triangles_center[rows], area / area.sum()
    centre, mean = weight @ place, weight @ normal
    bent, is_flat = normal - mean, kind == "plane"
    same, spread = np.outer(mean, mean), (weight * bent.T) @ bent
    # normals are square to the axis of a cylinder, and on a circle about that of a cone
    apart = {"plane": same, "cylinder": -same - spread}.get(kind, -spread)
    axis = np.linalg.eigh(apart)[1][:, 2] * (kind != "sphere")
    lean = mean @ axis
    angle = {"plane": -np.pi / 2.0, "cone": np.arcsin(min(abs(lean), 1.0))}.get(kind, 0.0)
    # radius: distance of places per change of their normals; negative for a hole
    reach = 0.0 if is_flat else weight @ np.sum((place - centre) * bent, 1) / np.trace(spread)
    axis = axis * np.copysign(1.0, lean if is_flat else -lean * reach)
    centre = centre - reach * (mean - (mean @ axis) * axis)
    start = FeatureShape(kind, centre, axis, abs(reach) * np.cos(angle), angle)
    turned = np.sum(start.respond(place)[1] * normal, axis=1)
    near_deg = SCAN_DEG if noise_um else NEAR_DEG
    is_turned = turned * np.sign(area @ turned) < np.cos(np.deg2rad(near_deg))
    if area @ is_turned > SLIVER_SHARE * area.sum():
        return None
    vertices, shares = _weigh_vertices(mesh, rows)
    if noise_um and len(vertices) < SCAN_VERTICES:
        return None
    points = mesh.vertices_mm[vertices]
    shape = fit_shape(start, points, shares)
    distance, *_ = shape.respond(points)
    tolerance = SHAPE_SHARE * np.linalg.norm(np.ptp(points, axis=0))
    tolerance += ROUNDING_SHARE * np.abs(mesh.vertices_mm).max()
    is_inlier = np.abs(distance) <= tolerance
    for _ in range(ROBUST_STEPS * bool(noise_um)):
        deviation = np.median(np.abs(distance)) * MEDIAN_TO_SIGMA
        is_inlier = np.abs(distance) <= max(OUTLIER * deviation, tolerance)
        shape = fit_shape(shape, points[is_inlier], shares[is_inlier])
        distance, *_ = shape.respond(points)
    residual = distance[is_inlier]
    if noise_um:
        deviation = np.sqrt(np.mean(residual**2)) * UM_PER_MM
        uncertain = 1.0 + 2.0 / np.sqrt(len(residual))  # of a sample, 95 %
        if deviation > noise_um * uncertain or np.mean(is_inlier) < 1.0 - OUTLIER_SHARE:
            return None
    elif not is_inlier.all():
        return None
    if fine.source is not None:
        is_part = np.zeros(len(mesh.triangles), dtype=bool)
        is_part[rows] = True
        outliers = vertices[~is_inlier]
        vertices, shares = _weigh_vertices(fine, np.flatnonzero(is_part[fine.source]))
        is_inlier = ~np.isin(vertices, outliers)
    vertices, shares = vertices[is_inlier], shares[is_inlier] / shares[is_inlier].sum()
    residual = residual if noise_um else np.zeros(len(vertices))
    _, outward, design = shape.respond(fine.vertices_mm[vertices])
    return Feature(shape, vertices, shares, float(area.sum()), outward, design, residual)


def _weigh_vertices(mesh: Workpiece, rows: NDArray[np.intp]) -> tuple[NDArray[np.int32], Array]:
    """Return the vertices of triangles and their shares of the area."""
    corners = mesh.triangles[rows]
    vertices, index = np.unique(corners, return_inverse=True)
    area = np.repeat(measure_triangles(mesh.vertices_mm, corners)[0], 3)
    shares = np.bincount(index.reshape(-1), area)
    return vertices, shares / shares.sum()


def _separation(feature: ShapeMotion, datum: ShapeMotion) -> Array:
    """Compute the distance normal to a plane, else to an axis, else between centres, [F, 3]."""
    fixing = min(datum, feature, key=lambda motion: SHAPES.index(motion.shape.kind))
    away = feature.shape.centre_mm - datum.shape.centre_mm
    moved = feature.shift_mm - datum.shift_mm - np.cross(fixing.turn_rad, away)
    return (away + moved) @ fixing.shape.across


def _angle_offset(feature: ShapeMotion, datum: ShapeMotion) -> float:
    """Compute the angle, through the material between planes, of parallel axes."""
    planes = [feature.shape.kind, datum.shape.kind].count("plane")
    is_opposite = feature.shape.axis @ datum.shape.axis < -RIGHT_RAD
    return np.pi / 2.0 if planes == 1 else np.pi if planes and not is_opposite else 0.0


def _turn_between(feature: ShapeMotion, datum: ShapeMotion) -> Array:
    """Compute the rotation from an axis to that of a datum, up to 90°, [F, 3]."""
    axis = feature.shape.axis
    same = -1.0 if axis @ datum.shape.axis < -RIGHT_RAD else 1.0
    about = np.cross(axis, same * datum.shape.axis)
    sine = np.linalg.norm(about)
    start = about * np.arctan2(sine, same * axis @ datum.shape.axis) / (sine or 1.0)
    turned = datum.turn_rad - feature.turn_rad
    return start + turned - np.outer(turned @ axis, axis)


def _angle(feature: ShapeMotion, datum: ShapeMotion) -> Array:
    """Compute the angle through the material between planes, else up to 90°."""
    turn = np.linalg.norm(_turn_between(feature, datum), axis=1)
    return np.abs(_angle_offset(feature, datum) - turn)


def _displacement(feature: ShapeMotion, *datums: ShapeMotion) -> Array:
    """Compute the deviation of a feature from its nominal position against datums, [F, 3].

    Each datum fixes degrees of freedom that the previous ones leave free; the best fit determines
    those that none fixes.
    """
    from scipy.linalg import block_diag, pinv

    motion, free, rigid = np.zeros(6), np.eye(6), np.eye(6)
    for shape, shifted, turned, *_ in datums:
        rigid[3:, :3] = skew((shape.centre_mm - feature.shape.centre_mm) / LEVER_MM)
        turns = np.eye(3) * (shape.axis @ shape.axis) - np.outer(shape.axis, shape.axis)
        fixed: Any = block_diag(shape.across, turns)
        moved = np.hstack([shifted, turned * LEVER_MM])
        difference = moved @ fixed - motion @ rigid @ fixed
        fixing = free @ rigid @ fixed
        inverse = pinv(fixing, atol=RIGHT_RAD) @ free
        motion, free = motion + difference @ inverse, free - fixing @ inverse
    return (feature.shift_mm - motion[..., :3]) @ feature.shape.across


def _norm_of(vectors: Callable[..., Array]) -> Callable[..., Array]:
    return lambda *motions: np.linalg.norm(vectors(*motions), axis=1)


class MeasureKind(NamedTuple):
    """A kind of measure, its features, and the number of its datums."""

    evaluate: Callable[..., Array]  # mm or rad, [F], of the motions of features
    features: Sequence[str]
    datum_count: tuple[int, int] = (0, 0)
    is_angle: bool = False
    # linear in the displacements, [F, r]: a number, a vector whose norm, or distances whose span
    # is the measure
    vectors: Callable[..., Array] = lambda shape: shape.distance_mm


KINDS: Mapping[str, MeasureKind] = {
    "flatness": MeasureKind(lambda shape: shape.form_mm, ["plane"]),
    "cylindricity": MeasureKind(lambda shape: shape.form_mm, ["cylinder"]),
    "conicity": MeasureKind(lambda shape: shape.form_mm, ["cone"]),
    "sphericity": MeasureKind(lambda shape: shape.form_mm, ["sphere"]),
    "diameter": MeasureKind(
        lambda shape: 2.0 * shape.radius_mm,
        ["cylinder", "sphere"],
        vectors=lambda shape: 2.0 * shape.radius_mm[:, None],
    ),
    "half_angle": MeasureKind(
        lambda shape: shape.angle_rad,
        ["cone"],
        is_angle=True,
        vectors=lambda shape: shape.angle_rad[:, None],
    ),
    "position": MeasureKind(_norm_of(_displacement), SHAPES, (0, 6), vectors=_displacement),
    "distance": MeasureKind(_norm_of(_separation), SHAPES, (1, 1), vectors=_separation),
    "angle": MeasureKind(_angle, SHAPES[:3], (1, 1), is_angle=True, vectors=_turn_between),
    "squareness": MeasureKind(_angle, SHAPES[:3], (1, 1), is_angle=True, vectors=_turn_between),
    "parallelism": MeasureKind(_angle, SHAPES[:3], (1, 1), is_angle=True, vectors=_turn_between),
}
Band: TypeAlias = tuple[float, float] | None  # a tolerance, µm or µrad
MeasureKey: TypeAlias = tuple[str, tuple[int, ...]]  # its kind, and numbers of features
MeasureBands = dict[MeasureKey, Band]


@dataclass(frozen=True)
class FeatureResult:
    """Inspection result of a feature."""

    name: str
    kind: str
    measures: Mapping[str, Mapping[str, Any]]  # by name: numbers by names with units, and a budget
    budget_of: str  # measure of `budget`: one with a tolerance in µm, or the position
    budget: Mapping[str, float]  # contribution of each parameter, placed, µm
    fit: str
    residual_um: float  # standard deviation of vertices of a scan; 0 of a nominal mesh


def inspect(
    scene: Scene,
    mesh: Workpiece,
    actual: ActualPoints,
    tolerances: tuple[str, str] | None = None,
    uncertainty: FieldUncertainty | None = None,
    interpolation_um: float = 0.0,
    noise_um: float = SCAN_NOISE_UM,
) -> tuple[FeatureResult, ...]:
    """Measure the features of a workpiece, in the frame of its mesh.

    A verdict is undecided where the distance to the tolerance is below `interpolation_um`, the
    largest deviation of errors between evaluated points. `tolerances` are the name and the text of
    a TOML file of features; a SceneError lists its problems.
    """
    points = mesh.vertices_mm
    names, features, bands = read_measures(mesh, tolerances, noise_um)
    if not bands:
        return ()
    turn = mesh_rotation(mesh, actual)
    evaluate_measures = partial(_evaluate_measures, features, bands)
    fit = partial(subtract_best_fit, points, shares=mesh.shares)
    errors = [actual.error_um]
    if any(bands.values()):
        at = actual.coordinates
        exact = evaluate(scene, at=at, loop=Loop.RELATIVE, frame="workpiece", exact=True)
        errors.append(exact.error_um)
    placed = fit(np.array(errors) @ turn)
    values = evaluate_measures(np.stack([0.0 * placed[0], actual.error_um @ turn, *placed]))
    budget: dict[str, Array] = {}
    for key in scene.parameter_keys:
        amplitude = scene.errors.amplitude(key)
        if amplitude:
            effect = amplitude * point_basis(scene, actual, [key]).position @ turn
            effect = STEP_SHARE * fit(effect)
            low, high = evaluate_measures(placed[0] / 2.0 + np.concatenate([-effect, effect]))
            budget[key] = (high - low) / (2.0 * STEP_SHARE)
    u95: list[float | None] = [None] * len(bands)
    if uncertainty is not None:
        changes = fit(uncertainty.response @ turn)
        u95 = uncertainty.errors.propagate(
            lambda change: evaluate_measures(placed[:1] + np.tensordot(change, changes, 1))[0]
        )
    measures = [dict[str, Mapping[str, Any]]() for _ in features]
    for index, ((kind, of), band) in enumerate(bands.items()):
        split = {key: float(part[index]) for key, part in budget.items()}
        stated = (uncertainty.errors, u95[index]) if uncertainty else None
        measures[of[0]][spell_measure((kind, of), names)] = _measure_numbers(
            KINDS[kind], values[:, index], band, split, stated, interpolation_um
        )
    results: list[FeatureResult] = []
    for name, feature, row in zip(names, features, measures, strict=True):
        of = next((key for key, numbers in row.items() if "tolerance_um" in numbers), "position")
        result = FeatureResult(
            name, feature.shape.kind, row, of, row[of]["budget"], feature.fit, feature.residual_um
        )
        results.append(result)
    return tuple(results)


def read_measures(
    mesh: Workpiece, tolerances: tuple[str, str] | None, noise_um: float = SCAN_NOISE_UM
) -> tuple[list[str], list[Feature], MeasureBands]:
    """Find the features of a mesh, their names and their measures, with tolerances if stated."""
    by_name = find_features(mesh, noise_um)
    names, features = [*by_name], [*by_name.values()]
    bands: MeasureBands = {
        (kind, (at,)): None
        for at, feature in enumerate(features)
        for kind, row in KINDS.items()
        if feature.shape.kind in row.features and not row.datum_count[0]
    }
    if tolerances:
        bands |= _read_tolerances(*tolerances, features, names)
    return names, features, bands


def spell_measure(measure: MeasureKey, names: Sequence[str]) -> str:
    kind, (_, *datums) = measure
    return f"{kind} to {', '.join(names[at] for at in datums)}" if datums else kind


class LinearMeasure(NamedTuple):
    """A measure to first order in K small displacements: its deviation, µm or µrad.

    Of one row the number rows · v; of three their norm, of more their span, both times the sign.
    """

    rows: Array  # [r, K]
    sign: float  # of deviations that have only one, else 0


def linearise_measures(
    features: Sequence[Feature], measures: Collection[MeasureKey], move_um: Array
) -> list[LinearMeasure | None]:
    """Compute the response of measures to displacements, [K, n, 3], in the frame of the mesh.

    None where a measure is not linear: the form of a scan, a fit that is not by least squares, or
    a nominal distance or angle so small, but not zero, that its direction changes.
    """
    moves = np.concatenate([0.0 * move_um[:1], move_um])
    is_linear = [feature.fit == schema.LEAST_SQUARES for feature in features]
    used = {at for _, of in measures for at in of if is_linear[at]}
    motions = {at: features[at].follow(moves) for at in used}
    return [
        _linearise(kind, [motions[at] for at in of]) if used.issuperset(of) else None
        for kind, of in measures
    ]


def _linearise(name: str, motions: Sequence[ShapeMotion]) -> LinearMeasure | None:
    kind = KINDS[name]
    unit = URAD_PER_RAD if kind.is_angle else UM_PER_MM
    start, *moved = kind.vectors(*motions)
    rows, size = (np.array(moved) - start).T * unit, float(np.linalg.norm(start))
    if len(rows) == 1:
        return LinearMeasure(rows, 0.0)
    if len(rows) > 3:
        return None if size else LinearMeasure(rows, 1.0)
    zero, small = (RIGHT_RAD, SMALL_RAD) if kind.is_angle else (AXIS_MM, SMALL_MM)
    beyond = size - _angle_offset(*motions) if kind.is_angle else size
    sign = -1.0 if beyond < -zero else 1.0
    if size <= zero:
        return LinearMeasure(rows, sign)
    along = sign * (start / size) @ rows[None]
    return LinearMeasure(along, float(abs(beyond) <= zero)) if size > small else None


def measure_changes(
    mesh: Workpiece, actual: ActualPoints, moves_um: Array, tolerances: tuple[str, str]
) -> Array:
    """Compute the changes of toleranced measures, placed, [K, m], with vertices, [K, n, 3], µm.

    In µm or µrad; displacements of vertices are in the workpiece frame.
    """
    by_name = find_features(mesh)
    features = [*by_name.values()]
    bands = _read_tolerances(*tolerances, features, [*by_name])
    toleranced = [measure for measure, band in bands.items() if band]
    moved = np.array([actual.error_um, *moves_um]) @ mesh_rotation(mesh, actual)
    present, *steps = subtract_best_fit(mesh.vertices_mm, moved, mesh.shares)
    moves = (present + sign * STEP_SHARE * np.array(steps) for sign in (-1.0, 1.0))
    low, high = (_evaluate_measures(features, toleranced, move) for move in moves)
    return (high - low) / (2.0 * STEP_SHARE)


def mesh_rotation(mesh: Workpiece, actual: ActualPoints) -> Array:
    """Compute the rotation from the frame of a mesh to the workpiece frame, [3, 3]."""
    from scipy.spatial.transform import Rotation

    arms = (at - at.mean(axis=0) for at in (actual.point_mm, mesh.vertices_mm))
    return Rotation.align_vectors(*arms)[0].as_matrix()


def _evaluate_measures(
    features: Collection[Feature], measures: Collection[MeasureKey], move_um: Array
) -> Array:
    """Evaluate measures of features that follow displacements, [F, V, 3]; [F, m], µm or µrad."""
    motions = [feature.follow(move_um) for feature in features]
    numbers = np.empty((len(move_um), len(measures)))
    for index, (kind, of) in enumerate(measures):
        number = KINDS[kind].evaluate(*(motions[at] for at in of))
        numbers[:, index] = number * (URAD_PER_RAD if KINDS[kind].is_angle else UM_PER_MM)
    return numbers


def _measure_numbers(
    kind: MeasureKind,
    values: Array,
    band: Band,
    budget: dict[str, float],
    uncertainty: tuple[ErrorUncertainty, float | None] | None,
    interpolation_um: float,
) -> dict[str, Any]:
    """Build the numbers of a measure from its nominal, actual, placed and exact placed values.

    Where a scene states the uncertainty of its errors, a verdict holds with a probability of at
    least 95 % (ISO 14253-1).
    """
    large, small = ("deg", "urad") if kind.is_angle else ("mm", "um")
    per = np.rad2deg(RAD_PER_URAD) if kind.is_angle else MM_PER_UM
    difference, placed, *exact = (values[1:] - values[0]).tolist()
    names = (f"{word}_{large}" for word in ("nominal", "actual", "placed"))
    numbers: dict[str, Any] = dict(zip(names, (values * per).tolist(), strict=False))
    numbers |= {f"difference_{small}": difference, f"placed_difference_{small}": placed}
    errors, u95 = uncertainty or (None, None)
    if errors is not None:
        numbers[f"u95_placed_difference_{small}"] = u95
    if band is not None:
        neglected, beyond = abs(exact[0] - placed), max(band[0] - placed, placed - band[1])
        neglected += 0.0 if kind.is_angle else interpolation_um
        probability: float | None = float(beyond <= 0.0)
        if errors is not None:
            probability = None
            if u95 is not None:
                probability = float(errors.probability_within(placed, u95, *band))
            numbers["probability"] = probability
        verdict = Verdict.from_probability(probability)
        if abs(beyond) < neglected:
            verdict = Verdict.UNDECIDED
        numbers |= {f"tolerance_{small}": band, f"doubt_{small}": neglected, "verdict": verdict}
    return numbers | {"budget": dict(sorted(budget.items(), key=lambda pair: -abs(pair[1])))}


def _read_tolerances(
    source: str, text: str, features: list[Feature], names: list[str]
) -> MeasureBands:
    """Read measures with their tolerances; assign their names and fits to features."""
    problems, raw = schema.Problems(), parse_toml(text, source)
    entries: Sequence[Any] = (problems.read(schema.FEATURES, "", raw) or {}).get("features", ())
    index_of, bands = {name: at for at, name in enumerate(names)}, MeasureBands()
    fitted = set[int]()
    for index, entry in enumerate(entries):
        where, chosen = f"features[{index}]", [entry["is"], *entry["to"]]
        if entry["near"] is not None:
            away = {
                float(np.linalg.norm(feature.shape.centre_mm - entry["near"])): name
                for name, feature in zip(names, features, strict=True)
                if feature.shape.kind == entry["is"]
            }
            chosen[0] = away.get(min(away, default=0.0), entry["is"])
        problems.only(where, chosen, index_of, "feature")
        of = tuple(index_of[name] for name in chosen if name in index_of)
        if len(of) < len(chosen):
            continue
        names[of[0]] = name = entry["name"] or names[of[0]]
        if index_of.setdefault(name, of[0]) != of[0]:
            problems.add(f"{where}.name", "another feature has it", name)
        twice = "an entry before has the same measure" * ((entry["measure"], of) in bands)
        problem = twice or _find_problem(entry, [features[at].shape for at in of])
        if entry["fit"] and not problem:
            feature = features[of[0]]
            problem = _find_fit_problem(feature, entry["fit"], of[0] in fitted)
            fitted.add(of[0])
            try:
                features[of[0]] = feature if problem else feature.with_fit(entry["fit"])
            except OptionError as error:
                problem = str(error)
        if problem:
            problems.add(where, problem)
        elif entry["measure"]:
            bands[entry["measure"], of] = entry["tolerance_um"] or entry["tolerance_urad"]
    if problems.lines:
        raise SceneError(source, problems.lines)
    return bands


def _find_problem(entry: Mapping[str, Any], shapes: Sequence[FeatureShape]) -> str:
    name, count = entry["measure"], len(shapes) - 1
    bands = entry["tolerance_um"], entry["tolerance_urad"]
    if not name:
        return "expected a measure" if count or any(bands) else ""
    if name not in KINDS:
        return f"unknown measure {name!r}{near_miss(name, KINDS)}"
    kind = KINDS[name]
    unit, other = ("urad", "um") if kind.is_angle else ("um", "urad")
    if bands[not kind.is_angle]:
        return f"tolerance_{other} of {name}; expected tolerance_{unit}"
    if not kind.datum_count[0] <= count <= kind.datum_count[1]:
        return f"{name} to {count} features; expected {kind.datum_count[1]}"
    for shape in shapes:
        if shape.kind not in kind.features:
            return f"{name} of a {shape.kind}; expected a {' or a '.join(kind.features)}"
    if name in ("squareness", "parallelism"):
        (angle,) = _angle(*(ShapeMotion(shape, *np.zeros((5, 1, 3))) for shape in shapes))
        if abs((np.cos if name == "squareness" else np.sin)(angle)) > RIGHT_RAD:
            return f"{name} at a nominal angle of {np.rad2deg(angle):.4g}°; expected angle"
    return ""


def _find_fit_problem(feature: Feature, fit: str, is_fitted: bool) -> str:
    if is_fitted and fit != feature.fit:
        return f"fit {fit!r}; an entry before states {feature.fit!r} for the same feature"
    kinds = KINDS["diameter"].features
    if fit in schema.EXTREME_FITS and feature.shape.kind not in kinds:
        return f"{fit} fit of a {feature.shape.kind}; expected a {' or a '.join(kinds)}"
    return ""


def features_table(results: Sequence[FeatureResult]) -> Table:
    """List features and their measures with the largest contributions."""
    rows: list[tuple[Any, ...]] = []
    for result in results:
        for name, numbers in result.measures.items():
            nominal, _, placed, *differences = [*numbers.values()][:5]
            tolerance = numbers.get("tolerance_um") or numbers.get("tolerance_urad") or ()
            u95 = [plus_minus(number) for key, number in numbers.items() if key.startswith("u95_")]
            rows.append((
                f"{result.name} · {name.replace('_', ' ')}", nominal, placed, *differences,
                u95[0] if u95 else None,
                " … ".join(map(spell_signed, tolerance)), numbers.get("verdict", ""),
                budget_words(numbers["budget"]),
            ))  # fmt: skip
    columns = (
        Column("measure", key="measure", leads=True, wraps=True),
        *number_columns(("nominal", "placed"), ".4f", "mm, °", ("nominal", "actual")),
        *number_columns(("deviation", "placed"), "+.2f", "µm, µrad", ("deviation", "placed")),
        Column("U95", key="u95", shows=any(row[5] for row in rows)),
        Column("tolerance", key="tolerance"),
        Column("verdict", key="verdict"),
        Column("largest contributions", key="most_of_it", wraps=True),
    )
    return Table(columns, rows, empty=f"no {', '.join(SHAPES)} was found")
