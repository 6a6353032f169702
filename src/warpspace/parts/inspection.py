"""What an inspector measures on a part as cut: features, their measures, tolerances and causes.

A shape is a surface of revolution about an axis: from a point at the height h along it and the
distance ρ from it, (ρ − radius) · cos φ − h · sin φ is the way to the surface. φ is 0 for a
cylinder and the half angle of a cone; −90° makes it a plane whose axis is its normal; without an
axis it is a sphere. Shapes are fitted to vertices by least squares of these distances, and follow
small moves of them in first order. A measure is taken on the part as it lies in the machine, and
`placed`, after the best rigid fit of all vertices; each parameter adds to it what it does where all
errors are half as large, so that the parts add up.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from warpspace.analysis.blocks import Column, Table, number_columns
from warpspace.analysis.commands.contributions import budget_words
from warpspace.analysis.uncertainty.propagation import (
    LEAST_PROBABILITY,
    ErrorUncertainty,
    FieldUncertainty,
    plus_minus,
)
from warpspace.exceptions import SceneError, near_miss
from warpspace.kinematics.model import Loop
from warpspace.kinematics.transforms import skew, vector_rotation
from warpspace.parts.workpiece import Made, PartMesh, fit_out, point_basis
from warpspace.scene import schema
from warpspace.scene.model import Scene, evaluate
from warpspace.scene.text_files import parse_toml
from warpspace.units import MM_PER_UM, RAD_PER_URAD, UM_PER_MM, URAD_PER_RAD, Array, spell_signed

SMOOTH_DEG = 30.5  # triangles meeting at less may belong to one curved surface: 12 around a hole
FLAT_RAD = 1e-3  # triangles meeting at less lie in one facet
FINE = 5e-6  # share of the largest coordinate that vertices are rounded by: files of six digits
CLOSE = 2e-5  # share of its extent that a feature's vertices may be off its shape, beside rounding
NEAR_DEG = 12.0  # angle between triangles and the first guess of the shape, at most
FACETS = 4  # of a curved surface, at least: fewer lie on many shapes
ALIKE = 4.0  # facets within this ratio may belong to one surface that runs into others
ODD = 0.01  # share of its area that may lean otherwise: slivers
MIDST_MM = 1e-3  # from an axis; closer points, as the tip of a cone, are on no side of it
WEAK = 3e-7  # share of the strongest response below which a freedom of a shape counts as none
STEPS, STILL_MM, FAR_MM = 40, 1e-11, 1e6  # of a fit; changes of a distance that end it
MAX_FEATURES = 500  # the largest surfaces of a mesh; what lies behind is left
RIGHT_RAD = 1e-4  # nominal angles this close to 90° or 0 are right or none; datums fix no less
NUDGE = 1e-4  # share of an error by which points are moved: too little for others to stand out
LEVER_MM = 100.0  # at which turns count as much as shifts where datums leave both free
SHAPES = ("plane", "cylinder", "cone", "sphere")  # as they are tried: two circles fit a sphere, too


@dataclass(frozen=True, eq=False)
class FeatureShape:
    """A plane, sphere, cylinder or cone."""

    kind: str
    centre_mm: Array  # [3]; on the plane or axis, amid the triangles that it was found in
    axis: Array  # [3], unit vector; outward normal of a plane, zero of a sphere
    radius_mm: float = 0.0  # at the centre
    angle_rad: float = 0.0  # half angle of a cone, along whose axis the radius grows

    @property
    def across(self) -> Array:
        """Projection on the directions in which it has a place, [3, 3]."""
        along = np.outer(self.axis, self.axis)
        return along if self.kind == "plane" else np.eye(3) - along

    def respond(self, point_mm: Array) -> tuple[Array, Array, Array]:
        """Give distances of points, [n], outwards, and what they grow with.

        That is unit vectors, [n, 3]; and shifts, turns, and radius or, of a cone, angle, [n, 8].
        """
        arm = point_mm - self.centre_mm
        sine, cosine = np.sin(self.angle_rad), np.cos(self.angle_rad)
        height = arm @ self.axis
        radial = arm - np.outer(height, self.axis)
        length = np.linalg.norm(radial, axis=1)
        beyond = length - self.radius_mm
        normal = radial * (cosine / np.maximum(length, MIDST_MM))[:, None] - sine * self.axis
        opening, widening = beyond * sine + height * cosine, np.full_like(beyond, cosine)
        sizes = [0.0 * widening, opening] if self.kind == "cone" else [widening, 0.0 * opening]
        design: Any = -np.column_stack([normal, np.cross(arm, normal), *sizes])
        return beyond * cosine - height * sine, normal, design


class ShapeMotion(NamedTuple):
    """How a shape follows F fields of small moves."""

    shape: FeatureShape
    shift_mm: Array  # [F, 3], of its centre
    turn_rad: Array  # [F, 3]
    radius_mm: Array  # [F]
    angle_rad: Array  # [F]
    form_mm: Array  # [F], span of the distances of its points


@dataclass(frozen=True, eq=False)
class Feature:
    """One surface of a part."""

    shape: FeatureShape  # in the frame of the mesh
    vertices: NDArray[np.int32]  # [n], of the mesh
    area_mm2: float
    normal: Array  # [n, 3]; see `Shape.respond`
    design: Array  # [n, 8]

    def follow(self, move_um: Array) -> ShapeMotion:
        """Fit how the shape follows moves of all vertices of the mesh, [F, V, 3]."""
        move = move_um[:, self.vertices] * MM_PER_UM
        mean = move.mean(axis=1)  # what no distance tells follows this
        away = np.einsum("fnc,nc->fn", move - mean[:, None], self.normal)
        step = -np.linalg.lstsq(self.design, away.T, WEAK)[0].T
        radius, angle = self.shape.radius_mm + step[:, 6], self.shape.angle_rad + step[:, 7]
        form = np.ptp(away + step @ self.design.T, axis=1)
        return ShapeMotion(self.shape, mean + step[:, :3], step[:, 3:6], radius, angle, form)


def fit_shape(start: FeatureShape, point_mm: Array) -> FeatureShape:
    """Fit a shape to points, [n, 3], by least squares of their distances, from a near one."""
    shape = start
    for _ in range(STEPS):
        distance, _, design = shape.respond(point_mm)
        step = -np.linalg.lstsq(design, distance, WEAK)[0]
        centre, axis = shape.centre_mm + step[:3], vector_rotation(step[3:6]) @ shape.axis
        radius, angle = shape.radius_mm + step[6], shape.angle_rad + step[7]
        shape = FeatureShape(shape.kind, centre, axis, radius, angle)
        if not STILL_MM < np.abs(design @ step).max() < FAR_MM:
            break
    return shape


def find_features(mesh: PartMesh) -> dict[str, Feature]:
    """Find the shapes that the surface of a part consists of: by kind, size, and place.

    First what lies between creases is looked at; then what is left of it, parted by the size of its
    facets. A surface that is none of them, within `CLOSE` of its extent, is no feature.
    """
    from trimesh.graph import connected_component_labels, connected_components

    area, pairs = mesh.surface.area_faces, mesh.surface.face_adjacency
    leaning = mesh.surface.face_adjacency_angles
    facet_of = connected_component_labels(pairs[leaning < FLAT_RAD], len(area))
    pairs = pairs[leaning < np.deg2rad(SMOOTH_DEG)]
    facet = np.bincount(facet_of, area)[facet_of][pairs]
    is_alike = facet.max(axis=1) < ALIKE * facet.min(axis=1)
    is_left, found = np.ones(len(area), dtype=bool), list[Feature]()
    for chosen in (True, is_alike):
        links = pairs[chosen & is_left[pairs].all(axis=1)]
        # a single triangle is flat whatever the machine does
        parts: Any = connected_components(links, min_len=2, engine="scipy")
        for part in sorted(parts, key=lambda one: -area[one].sum())[:MAX_FEATURES]:
            kinds = SHAPES if len(np.unique(facet_of[part])) >= FACETS else SHAPES[:1]
            if feature := next(filter(None, (_fitted(mesh, kind, part) for kind in kinds)), None):
                is_left[part] = False
                found.append(feature)
    found.sort(key=lambda one: (float(f"{-one.area_mm2:.5g}"), *one.shape.centre_mm.round(3)))
    return {
        f"{kind} {number}": feature
        for kind in SHAPES
        for number, feature in enumerate((one for one in found if one.shape.kind == kind), 1)
    }


def _fitted(mesh: PartMesh, kind: str, part: NDArray[np.intp]) -> Feature | None:
    """Fit a shape to triangles; None where their normals or vertices are off it."""
    normal, area = mesh.surface.face_normals[part], mesh.surface.area_faces[part]
    place, weight = mesh.surface.triangles_center[part], area / area.sum()
    centre, mean = weight @ place, weight @ normal
    bent, is_flat = normal - mean, kind == "plane"
    same, spread = np.outer(mean, mean), (weight * bent.T) @ bent
    # normals are square to the axis of a cylinder, and on a circle about that of a cone
    apart = {"plane": same, "cylinder": -same - spread}.get(kind, -spread)
    axis = np.linalg.eigh(apart)[1][:, 2] * (kind != "sphere")
    lean = mean @ axis
    angle = {"plane": -np.pi / 2.0, "cone": np.arcsin(min(abs(lean), 1.0))}.get(kind, 0.0)
    # what places go apart by with their normals; a hole has less than none
    reach = 0.0 if is_flat else weight @ np.sum((place - centre) * bent, 1) / np.trace(spread)
    axis = axis * np.copysign(1.0, lean if is_flat else -lean * reach)
    centre = centre - reach * (mean - (mean @ axis) * axis)
    start = FeatureShape(kind, centre, axis, abs(reach) * np.cos(angle), angle)
    turned = np.sum(start.respond(place)[1] * normal, axis=1)
    if area @ (turned * np.sign(area @ turned) < np.cos(np.deg2rad(NEAR_DEG))) > ODD * area.sum():
        return None
    vertices = np.unique(mesh.triangles[part])
    points = mesh.vertices_mm[vertices]
    shape = fit_shape(start, points)
    distance, *response = shape.respond(points)
    most = CLOSE * np.linalg.norm(np.ptp(points, axis=0)) + FINE * np.abs(mesh.vertices_mm).max()
    is_close = np.abs(distance).max() <= most
    return Feature(shape, vertices, float(area.sum()), *response) if is_close else None


def _distance(one: ShapeMotion, other: ShapeMotion) -> Array:
    """Distance square to a plane; else square to an axis; else between centres."""
    fixing = min(other, one, key=lambda motion: SHAPES.index(motion.shape.kind))
    away = one.shape.centre_mm - other.shape.centre_mm
    moved = one.shift_mm - other.shift_mm - np.cross(fixing.turn_rad, away)
    return np.linalg.norm((away + moved) @ fixing.shape.across, axis=1)


def _angle(one: ShapeMotion, other: ShapeMotion) -> Array:
    """Angle through the material between planes, else up to 90° between axes, or to a plane."""
    axis, planes = one.shape.axis, [one.shape.kind, other.shape.kind].count("plane")
    same = -1.0 if axis @ other.shape.axis < -RIGHT_RAD else 1.0
    sine = np.linalg.norm(about := np.cross(axis, same * other.shape.axis))
    start = about * np.arctan2(sine, same * axis @ other.shape.axis) / (sine or 1.0)
    turned = other.turn_rad - one.turn_rad
    offset = np.pi / 2.0 if planes == 1 else np.pi if planes and same > 0.0 else 0.0
    return np.abs(offset - np.linalg.norm(start + turned - np.outer(turned @ axis, axis), axis=1))


def _position(own: ShapeMotion, *datums: ShapeMotion) -> Array:
    """How far a feature is from where it should be against datums, along what it fixes.

    Each datum fixes what those before it have left; what none does stays as the best fit has it.
    """
    from scipy.linalg import block_diag, pinv

    found, left, rigid = np.zeros(6), np.eye(6), np.eye(6)
    for shape, shifted, turned, *_ in datums:
        rigid[3:, :3] = skew((shape.centre_mm - own.shape.centre_mm) / LEVER_MM)
        turns = np.eye(3) * (shape.axis @ shape.axis) - np.outer(shape.axis, shape.axis)
        ways: Any = block_diag(shape.across, turns)
        rest = np.hstack([shifted, turned * LEVER_MM]) @ ways - found @ rigid @ ways
        fixing = left @ rigid @ ways
        inverse = pinv(fixing, atol=RIGHT_RAD) @ left
        found, left = found + rest @ inverse, left - fixing @ inverse
    return np.linalg.norm((own.shift_mm - found[..., :3]) @ own.shape.across, axis=1)


class MeasureKind(NamedTuple):
    """A kind of measure: how it is taken, of what, to how many others."""

    take: Callable[..., Array]  # mm or rad, [F], of the motions of these
    features: Sequence[str]
    others: tuple[int, int] = (0, 0)
    is_angle: bool = False


KINDS: Mapping[str, MeasureKind] = {
    "flatness": MeasureKind(lambda one: one.form_mm, ["plane"]),
    "cylindricity": MeasureKind(lambda one: one.form_mm, ["cylinder"]),
    "conicity": MeasureKind(lambda one: one.form_mm, ["cone"]),
    "sphericity": MeasureKind(lambda one: one.form_mm, ["sphere"]),
    "diameter": MeasureKind(lambda one: 2.0 * one.radius_mm, ["cylinder", "sphere"]),
    "half_angle": MeasureKind(lambda one: one.angle_rad, ["cone"], is_angle=True),
    "position": MeasureKind(_position, SHAPES, (0, 6)),
    "distance": MeasureKind(_distance, SHAPES, (1, 1)),
    "angle": MeasureKind(_angle, SHAPES[:3], (1, 1), is_angle=True),
    "squareness": MeasureKind(_angle, SHAPES[:3], (1, 1), is_angle=True),
    "parallelism": MeasureKind(_angle, SHAPES[:3], (1, 1), is_angle=True),
}
Band: TypeAlias = tuple[float, float] | None  # a tolerance, µm or µrad
Measure: TypeAlias = tuple[str, tuple[int, ...]]  # its kind, and numbers of features
Wanted = dict[Measure, Band]


@dataclass(frozen=True)
class FeatureResult:
    """A feature as it is measured."""

    name: str
    kind: str
    measures: Mapping[str, Mapping[str, Any]]  # by name: numbers by names with units, and a budget
    budget_of: str  # its measure that `budget` splits: with a tolerance in µm, or the position
    budget: Mapping[str, float]  # what each parameter adds to it, placed, µm


def inspect(
    scene: Scene,
    mesh: PartMesh,
    made: Made,
    tolerances: tuple[str, str] | None = None,
    sure: FieldUncertainty | None = None,
    between_um: float = 0.0,
) -> tuple[FeatureResult, ...]:
    """Measure the features of a part, in its own frame, and made at some place in a scene.

    What errors are off between vertices leaves in doubt what is no further from a tolerance.
    Tolerances are the name and the text of a TOML file that names features and says what they have
    to keep; SceneError says all that is wrong with it.
    """
    known, points = find_features(mesh), mesh.vertices_mm
    names, features, shapes = [*known], known.values(), [one.shape for one in known.values()]
    wanted: Wanted = {
        (kind, (at,)): None
        for at, shape in enumerate(shapes)
        for kind, row in KINDS.items()
        if shape.kind in row.features and not row.others[0]
    }
    if tolerances:
        wanted |= _read(*tolerances, shapes, names)
    if not wanted:
        return ()
    turn, take = _turn(mesh, made), partial(_take, features, wanted)
    errors = [made.error_um]
    if any(wanted.values()):
        at = made.coordinates
        exact = evaluate(scene, at=at, loop=Loop.RELATIVE, frame="workpiece", exact=True)
        errors.append(exact.error_um)
    placed = fit_out(points, np.array(errors) @ turn)
    values = take(np.stack([0.0 * placed[0], made.error_um @ turn, *placed]))
    budget: dict[str, Array] = {}
    for key in scene.parameter_keys:
        if amplitude := scene.errors.amplitude(key):
            alone = fit_out(points, amplitude * point_basis(scene, made, [key]).position @ turn)
            low, high = take(placed[0] / 2.0 + NUDGE * np.concatenate([-alone, alone]))
            budget[key] = (high - low) / (2.0 * NUDGE)
    u95: list[float | None] = [None] * len(wanted)
    if sure is not None:
        changes = fit_out(points, sure.response @ turn)
        u95 = sure.errors.propagate(
            lambda change: take(placed[:1] + np.tensordot(change, changes, 1))[0]
        )
    measures = [dict[str, Mapping[str, Any]]() for _ in features]
    for index, ((kind, of), band) in enumerate(wanted.items()):
        to = f" to {', '.join(names[at] for at in of[1:])}" if of[1:] else ""
        split = {key: float(part[index]) for key, part in budget.items()}
        known = (sure.errors, u95[index]) if sure else None
        told = KINDS[kind], values[:, index], band, split, known, between_um
        measures[of[0]][kind + to] = _numbers(*told)
    results: list[FeatureResult] = []
    for name, shape, row in zip(names, shapes, measures, strict=True):
        of = next((key for key, one in row.items() if "tolerance_um" in one), "position")
        results.append(FeatureResult(name, shape.kind, row, of, row[of]["budget"]))
    return tuple(results)


def measure_changes(
    mesh: PartMesh, made: Made, moves_um: Array, tolerances: tuple[str, str]
) -> Array:
    """Give what moves of vertices, [K, n, 3], µm, change of measures with a tolerance, [K, m].

    Placed, µm or µrad; the moves are in the workpiece frame.
    """
    known = find_features(mesh)
    every = _read(*tolerances, [one.shape for one in known.values()], [*known])
    wanted = [measure for measure, band in every.items() if band]
    moved = np.array([made.error_um, *moves_um]) @ _turn(mesh, made)
    here, *steps = fit_out(mesh.vertices_mm, moved)
    both = (here + sign * NUDGE * np.array(steps) for sign in (-1.0, 1.0))
    low, high = (_take(known.values(), wanted, move) for move in both)
    return (high - low) / (2.0 * NUDGE)


def _turn(mesh: PartMesh, made: Made) -> Array:
    """Give the rotation from the frame of a part to the workpiece, [3, 3]."""
    from scipy.spatial.transform import Rotation

    arms = (at - at.mean(axis=0) for at in (made.point_mm, mesh.vertices_mm))
    return Rotation.align_vectors(*arms)[0].as_matrix()


def _take(features: Collection[Feature], wanted: Collection[Measure], move_um: Array) -> Array:
    """Take measures, (m,), of features that follow moves, [F, V, 3]; [F, m], µm or µrad."""
    motions = [one.follow(move_um) for one in features]
    found = np.empty((len(move_um), len(wanted)))
    for index, (kind, of) in enumerate(wanted):
        taken = KINDS[kind].take(*(motions[at] for at in of))
        found[:, index] = taken * (URAD_PER_RAD if KINDS[kind].is_angle else UM_PER_MM)
    return found


def _numbers(
    kind: MeasureKind,
    values: Array,
    band: Band,
    budget: dict[str, float],
    known: tuple[ErrorUncertainty, float | None] | None,
    between_um: float,
) -> dict[str, Any]:
    """Give a measure in numbers: nominal, actual, placed and, for a verdict, exact, µm or µrad.

    Where a scene states how sure its errors are, a tolerance is kept, or missed, with at least 95 %
    probability (ISO 14253-1); else that cannot be told.
    """
    large, small = ("deg", "urad") if kind.is_angle else ("mm", "um")
    per = np.rad2deg(RAD_PER_URAD) if kind.is_angle else MM_PER_UM
    difference, placed, *exact = (values[1:] - values[0]).tolist()
    names = (f"{word}_{large}" for word in ("nominal", "actual", "placed"))
    found: dict[str, Any] = dict(zip(names, (values * per).tolist(), strict=False))
    found |= {f"difference_{small}": difference, f"placed_difference_{small}": placed}
    doubt, u95 = known or (None, None)
    found |= {f"u95_placed_difference_{small}": u95} if doubt else {}
    if band is not None:
        left_out, beyond = abs(exact[0] - placed), max(band[0] - placed, placed - band[1])
        left_out += 0.0 if kind.is_angle else between_um
        share = float(beyond <= 0.0)
        if doubt is not None:
            share = None if u95 is None else float(doubt.probability_within(placed, u95, *band))
            found["probability"] = share
        verdict = "kept" if (share or 0.0) >= LEAST_PROBABILITY else "missed"
        if share is None or 1.0 - LEAST_PROBABILITY < share < LEAST_PROBABILITY:
            verdict = "cannot be told"
        verdict = "in doubt" if abs(beyond) < left_out else verdict
        found |= {f"tolerance_{small}": band, f"doubt_{small}": left_out, "verdict": verdict}
    return found | {"budget": dict(sorted(budget.items(), key=lambda pair: -abs(pair[1])))}


def _read(source: str, text: str, shapes: Sequence[FeatureShape], names: list[str]) -> Wanted:
    problems, raw = schema.Problems(), parse_toml(text, source)
    entries: Sequence[Any] = (problems.read(schema.FEATURES, "", raw) or {}).get("features", ())
    known, wanted = {name: at for at, name in enumerate(names)}, Wanted()
    for index, entry in enumerate(entries):
        where, chosen = f"features[{index}]", [entry["is"], *entry["to"]]
        if entry["near"] is not None:
            away = {
                float(np.linalg.norm(shape.centre_mm - entry["near"])): name
                for name, shape in zip(names, shapes, strict=True)
                if shape.kind == entry["is"]
            }
            chosen[0] = away.get(min(away, default=0.0), entry["is"])
        problems.only(where, chosen, known, "feature")
        of = tuple(known[one] for one in chosen if one in known)
        if len(of) < len(chosen):
            continue
        names[of[0]] = name = entry["name"] or names[of[0]]
        if known.setdefault(name, of[0]) != of[0]:
            problems.add(f"{where}.name", "another feature has it", name)
        twice = "an entry before has the same measure" * ((entry["measure"], of) in wanted)
        if wrong := twice or _wrong(entry, [shapes[at] for at in of]):
            problems.add(where, wrong)
        elif entry["measure"]:
            wanted[entry["measure"], of] = entry["tolerance_um"] or entry["tolerance_urad"]
    if problems.lines:
        raise SceneError(source, problems.lines)
    return wanted


def _wrong(entry: Mapping[str, Any], shapes: Sequence[FeatureShape]) -> str:
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
    if not kind.others[0] <= count <= kind.others[1]:
        return f"{name} to {count} features; expected {kind.others[1]}"
    for one in shapes:
        if one.kind not in kind.features:
            return f"{name} of a {one.kind}; expected a {' or a '.join(kind.features)}"
    if name in ("squareness", "parallelism"):
        (angle,) = _angle(*(ShapeMotion(shape, *np.zeros((5, 1, 3))) for shape in shapes))
        if abs((np.cos if name == "squareness" else np.sin)(angle)) > RIGHT_RAD:
            return f"{name} at a nominal angle of {np.rad2deg(angle):.4g}°; expected angle"
    return ""


def features_table(results: Sequence[FeatureResult]) -> Table:
    """List features and their measures, with what adds most to each."""
    rows: list[tuple[Any, ...]] = []
    for result in results:
        for name, one in result.measures.items():
            nominal, _, placed, *differences = [*one.values()][:5]
            tolerance = one.get("tolerance_um") or one.get("tolerance_urad") or ()
            u95 = [value for key, value in one.items() if key.startswith("u95_")]
            sure = plus_minus(u95[0]) if u95 else None
            rows.append((
                f"{result.name} · {name.replace('_', ' ')}", nominal, placed, *differences, sure,
                " … ".join(map(spell_signed, tolerance)), one.get("verdict", ""),
                budget_words(one["budget"]),
            ))  # fmt: skip
    columns = (
        Column("measure", key="measure", leads=True, wraps=True),
        *number_columns(("nominal", "placed"), ".4f", "mm, °", ("nominal", "actual")),
        *number_columns(("deviation", "placed"), "+.2f", "µm, µrad", ("deviation", "placed")),
        Column("U95", key="u95", shows=any(row[5] for row in rows)),
        Column("tolerance", key="tolerance"),
        Column("verdict", key="verdict"),
        Column("most of it", key="most_of_it", wraps=True),
    )
    return Table(columns, rows, empty=f"no {', '.join(SHAPES)} was found")
