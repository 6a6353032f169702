"""What an inspector measures on a part as cut: features, their measures, tolerances and causes.

A measure is taken on the part as it lies in the machine, and `placed`, after the best rigid fit of
all its vertices. The placed difference is split by error parameter: what each of them moves the
measure by where all errors are half as large, so that the parts add up.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from warpspace.analysis.blocks import Column, Table, number_columns
from warpspace.exceptions import SceneError
from warpspace.field.evaluate import amplitudes_of
from warpspace.kinematics.model import Loop
from warpspace.machine.limits import MAX_SCENE_BYTES
from warpspace.parts.features import FREE, FREEDOMS, Feature, Shape, find_features, fit_shape
from warpspace.parts.part import Made, PartMesh, fit_out, point_basis
from warpspace.scene import schema
from warpspace.scene.files import parse_toml, read_text
from warpspace.scene.model import Scene, evaluate
from warpspace.units import MM_PER_UM, UM_PER_MM, URAD_PER_RAD, Array, spell_signed

RIGHT_RAD = 1e-4  # a nominal angle this close to 90° or to 0 has a squareness or a parallelism
STEP = 1e-6  # mm and rad by which shapes are moved to find what a measure depends on
LEVER_MM = 100.0  # at which turns count as much as shifts where datums leave both free
POINTS_AT_ONCE = 2_000_000  # times parameters: what a budget holds in memory
Shapes = Sequence[Shape]


def _distance(actual: Shapes, _nominal: Shapes) -> float:
    """Distance square to a plane; else square to an axis; else between centres."""
    away = actual[0].centre_mm - actual[1].centre_mm
    kinds = [shape.kind for shape in actual]
    if "plane" in kinds:
        return abs(float(away @ actual[1 if kinds[1] == "plane" else 0].axis))
    if kinds != ["sphere", "sphere"]:
        axis = actual[1 if kinds[1] != "sphere" else 0].axis
        away = away - (away @ axis) * axis
    return float(np.linalg.norm(away))


def _angle(actual: Shapes, nominal: Shapes) -> float:
    """Angle through the material between planes, else up to 90° between axes, or to a plane."""
    one, other = actual
    across = np.linalg.norm(np.cross(one.axis, other.axis))
    turn = float(np.arctan2(across, one.axis @ other.axis))
    planes = [one.kind, other.kind].count("plane")
    if planes == 1:
        return abs(np.pi / 2.0 - turn)
    return np.pi - turn if planes or nominal[0].axis @ nominal[1].axis < -STEP else turn


def _parallelism(actual: Shapes, nominal: Shapes) -> float:
    angle = _angle(actual, nominal)
    return min(angle, np.pi - angle)


def _position(actual: Shapes, nominal: Shapes) -> float:
    """How far a feature is from where it should be against datums, along what it fixes.

    Each datum fixes what those before it have left; what none does stays as the best fit has it.
    """
    place, found, left = nominal[0].centre_mm, np.zeros(6), np.eye(6)
    for shape, before in zip(actual[1:], nominal[1:], strict=True):
        arm = (before.centre_mm - place) / LEVER_MM
        moved = shape.centre_mm - before.centre_mm, np.cross(before.axis, shape.axis) * LEVER_MM
        ways = [(at // 3, before.frame[:, at % 3]) for at in FREE[before.kind] if at < 6]
        seen = np.array([way @ moved[turns] for turns, way in ways])
        rows = np.array([[*way * (1 - turns), *(way if turns else np.cross(arm, way))]
                         for turns, way in ways])  # fmt: skip
        fixing = rows @ left
        inverse = np.linalg.pinv(fixing, rcond=1e-6)
        found = found + left @ inverse @ (seen - rows @ found)
        left = left @ (np.eye(6) - inverse @ fixing)
    fixed = [at for at in FREE[nominal[0].kind] if at < 3]
    away = actual[0].centre_mm - place - found[:3]
    return float(np.linalg.norm(away @ nominal[0].frame[:, fixed]))


class Kind(NamedTuple):
    """A kind of measure: how it is taken, mm or rad, of what, to how many others."""

    take: Callable[[Shapes, Shapes], float] | None  # None of the form
    features: Sequence[str]
    others: tuple[int, int] = (0, 0)
    is_angle: bool = False


_LEANING = ("plane", "cylinder", "cone")
KINDS: Mapping[str, Kind] = {
    "flatness": Kind(None, ["plane"]),
    "cylindricity": Kind(None, ["cylinder"]),
    "conicity": Kind(None, ["cone"]),
    "sphericity": Kind(None, ["sphere"]),
    "diameter": Kind(lambda actual, _: 2.0 * actual[0].radius_mm, ["cylinder", "sphere"]),
    "half_angle": Kind(lambda actual, _: actual[0].angle_rad, ["cone"], is_angle=True),
    "position": Kind(_position, [*FREE], (0, 6)),
    "distance": Kind(_distance, [*FREE], (1, 1)),
    "angle": Kind(_angle, _LEANING, (1, 1), is_angle=True),
    "squareness": Kind(_angle, _LEANING, (1, 1), is_angle=True),
    "parallelism": Kind(_parallelism, _LEANING, (1, 1), is_angle=True),
}


class Wanted(NamedTuple):
    """One measure of a feature, by the numbers of the features."""

    kind: str
    of: tuple[int, ...]  # the feature, and what it is measured to
    name: str
    tolerance: tuple[float, float] | None = None  # of the difference, µm or µrad


@dataclass(frozen=True)
class FeatureResult:
    """A feature as it is measured."""

    name: str
    kind: str
    measures: Mapping[str, Mapping[str, Any]]  # by name: numbers by names with units, and a budget
    budget_of: str  # its measure that `budget` splits: with a tolerance in µm, or the position
    budget: Mapping[str, float]  # what each parameter adds to it, placed, µm


def inspect(
    scene: Scene, mesh: PartMesh, made: Made, tolerances: str | Path | None = None
) -> tuple[FeatureResult, ...]:
    """Measure the features of a part as the machine makes it.

    Parameters
    ----------
    scene : Scene
    mesh : PartMesh
        The part in its own frame: names of features do not depend on where it is clamped.
    made : Made
        Its vertices in the workpiece frame, as the machine makes them.
    tolerances : str or Path, optional
        TOML file that names features and says what they have to keep; SceneError says all that is
        wrong with it.
    """
    features = find_features(mesh)
    pose = _pose(mesh.vertices_mm, made.point_mm)
    nominal = [feature.shape.posed(*pose) for feature in features]
    names = [one.name for one in features]
    asked = {} if tolerances is None else _read(Path(tolerances), features, names)
    wanted = [
        asked.pop((kind, (at,)), Wanted(kind, (at,), kind))
        for at, feature in enumerate(features)
        for kind, row in KINDS.items()
        if feature.kind in row.features and not row.others[0]
    ]
    rest = fit_out(made.point_mm, made.error_um)

    def state(moved_um: Array) -> _State:
        points = made.point_mm + moved_um * MM_PER_UM
        chosen = [points[feature.vertices] for feature in features]
        return _State(nominal, [*map(fit_shape, nominal, chosen)], chosen)

    states = [state(moved) for moved in (0.0 * rest, made.error_um, rest)]
    if any(one.tolerance for one in (*wanted, *asked.values())):
        at = made.coordinates
        exact = evaluate(scene, at=at, loop=Loop.RELATIVE, frame="workpiece", exact=True)
        states.append(state(fit_out(made.point_mm, exact.error_um)))
    keys, responses = _responses(scene, made, features, middle := state(rest / 2.0))
    measures: list[dict[str, Mapping[str, Any]]] = [{} for _ in features]
    for one in (*wanted, *asked.values()):
        slopes = zip(middle.slopes(one), (responses[at] for at in one.of), strict=True)
        parts = sum((slope @ response for slope, response in slopes), np.zeros(len(keys)))
        values = [each.measure(one) for each in states]
        measures[one.of[0]][one.name] = _numbers(one, values, zip(keys, parts, strict=True))
    results: list[FeatureResult] = []
    for name, feature, found in zip(names, features, measures, strict=True):
        of = next((key for key, one in found.items() if "tolerance_um" in one), "position")
        results.append(FeatureResult(name, feature.kind, found, of, found[of]["budget"]))
    return tuple(results)


def _pose(own_mm: Array, placed_mm: Array) -> tuple[Array, Array]:
    """Find the turn, [3, 3], and shift, [3], that have put vertices where they are."""
    middle, there = own_mm.mean(axis=0), placed_mm.mean(axis=0)
    first, _, second = np.linalg.svd((own_mm - middle).T @ (placed_mm - there))
    turn = (first * [1.0, 1.0, np.sign(np.linalg.det(first @ second))] @ second).T
    return turn, there - turn @ middle


class _State:
    """The features of a part with some errors."""

    def __init__(self, nominal: Shapes, shapes: list[Shape], points_mm: Sequence[Array]) -> None:
        self.nominal, self.shapes = nominal, shapes
        self.found = [one.respond(points) for one, points in zip(shapes, points_mm, strict=True)]

    def measure(self, wanted: Wanted, index: int = 0, step: Array | None = None) -> float:
        """Take a measure, mm or rad; with a step of one of its features."""
        take = KINDS[wanted.kind].take
        if take is None:
            return float(np.ptp(self.found[wanted.of[0]].distance_mm))
        chosen = [self.shapes[at] for at in wanted.of]
        if step is not None:
            chosen[index] = chosen[index].moved(step)
        return take(chosen, [self.nominal[at] for at in wanted.of])

    def slopes(self, wanted: Wanted) -> list[Array]:
        """Give how a measure grows with the freedoms and the form of its features, [9] each."""
        if KINDS[wanted.kind].take is None:
            return [np.eye(FREEDOMS + 1)[FREEDOMS]]
        steps = np.eye(FREEDOMS + 1, FREEDOMS) * STEP
        rise = [
            [self.measure(wanted, at, step) - self.measure(wanted, at, -step) for step in steps]
            for at in range(len(wanted.of))
        ]
        return [np.array(one) / (2.0 * STEP) for one in rise]

    def respond(self, index: int, moved_mm: Array) -> Array:
        """Give how freedoms and form of a feature follow moves of its points, [K, n, 3]: [9, K]."""
        shape, found = self.shapes[index], self.found[index]
        along = np.einsum("nc,knc->nk", found.normal, moved_mm)
        follows = np.zeros((FREEDOMS + 1, len(moved_mm)))
        follows[:3] = shape.frame.T @ moved_mm.mean(axis=1).T  # the centre stays amid the points
        follows[list(FREE[shape.kind])] = shape.solve(found, along)
        ends = [int(found.distance_mm.argmax()), int(found.distance_mm.argmin())]
        high, low = along[ends] + found.design[ends] @ follows[:FREEDOMS]
        follows[FREEDOMS] = high - low
        return follows


def _responses(
    scene: Scene, made: Made, features: Sequence[Feature], middle: _State
) -> tuple[list[str], list[Array]]:
    """Give what parameters add, placed, to the freedoms and forms of features, [9, K] each, mm."""
    keys = [key for key in scene.parameter_keys if scene.errors.amplitude(key) != 0.0]
    amplitudes = amplitudes_of(scene.errors, keys)[:, None, None] * MM_PER_UM
    responses = [np.zeros((FREEDOMS + 1, len(keys))) for _ in features]
    count = max(1, POINTS_AT_ONCE // len(made.point_mm))
    for some in (slice(first, first + count) for first in range(0, len(keys), count)):
        moved = point_basis(scene, made, keys[some]).position * amplitudes[some]
        moved = fit_out(made.point_mm, moved)
        for at, feature in enumerate(features):
            responses[at][:, some] = middle.respond(at, moved[:, feature.vertices])
    return keys, responses


def _numbers(
    wanted: Wanted, values: Sequence[float], parts: Iterable[tuple[str, float]]
) -> dict[str, Any]:
    """Give a measure in numbers: nominal, actual, placed and, for a verdict, exact, mm or rad."""
    is_angle = KINDS[wanted.kind].is_angle
    large, small = ("deg", "urad") if is_angle else ("mm", "um")
    per = URAD_PER_RAD if is_angle else UM_PER_MM
    difference, placed, *exact = ((value - values[0]) * per for value in values[1:])
    split = sorted(((key, float(part) * per) for key, part in parts), key=lambda one: -abs(one[1]))
    found: dict[str, Any] = {
        f"{name}_{large}": float(np.rad2deg(value) if is_angle else value)
        for name, value in zip(("nominal", "actual", "placed"), values, strict=False)
    }
    found |= {f"difference_{small}": difference, f"placed_difference_{small}": placed}
    if wanted.tolerance is not None:
        low, high = wanted.tolerance
        doubt, beyond = abs(exact[0] - placed), max(low - placed, placed - high)
        verdict = "in doubt" if abs(beyond) < doubt else "missed" if beyond > 0.0 else "kept"
        found |= {f"tolerance_{small}": wanted.tolerance, f"doubt_{small}": doubt}
        found["verdict"] = verdict
    return found | {"budget": dict(split)}


def _read(
    path: Path, features: Sequence[Feature], names: list[str]
) -> dict[tuple[str, tuple[int, ...]], Wanted]:
    """Read tolerances, and names of features into the list of them; refuse what does not fit."""
    source, problems = str(path), schema.Problems()
    raw = parse_toml(read_text(path, MAX_SCENE_BYTES), source)
    entries: Sequence[Any] = (problems.read(schema.FEATURES, "", raw) or {}).get("features", ())
    known = {one.name: at for at, one in enumerate(features)}
    wanted: list[Wanted] = []
    for index, entry in enumerate(entries):
        where, name, chosen = f"features[{index}]", entry["name"], [entry["is"], *entry["to"]]
        if entry["near"] is not None:
            place = np.array(entry["near"])
            alike = [one for one in features if one.kind == entry["is"]]
            away = [float(np.linalg.norm(one.shape.centre_mm - place)) for one in alike]
            chosen[0] = alike[int(np.argmin(away))].name if alike else entry["is"]
        problems.only(where, chosen, known, "feature")
        of = tuple(known[one] for one in chosen if one in known)
        if len(of) < len(chosen):
            continue
        if known.setdefault(name or names[of[0]], of[0]) != of[0]:
            problems.add(f"{where}.name", "another feature has it", name)
        names[of[0]] = name or names[of[0]]
        if wrong := _wrong(entry, [features[at].shape for at in of]):
            problems.add(where, wrong)
        elif kind := entry["measure"]:
            to = f" to {', '.join(names[at] for at in of[1:])}" if of[1:] else ""
            band = entry["tolerance_um"] or entry["tolerance_urad"]
            wanted.append(Wanted(kind, of, kind + to, band))
    if problems.lines:
        raise SceneError(source, problems.lines)
    return {(one.kind, one.of): one for one in wanted}


def _wrong(entry: Mapping[str, Any], shapes: Shapes) -> str:
    """Say why features do not have the measure of an entry; nothing where they do."""
    if entry["measure"] not in KINDS:
        is_named = not (entry["to"] or entry["tolerance_um"] or entry["tolerance_urad"])
        return "" if is_named else "expected a measure"
    name, kind = entry["measure"], KINDS[entry["measure"]]
    other = "tolerance_um" if kind.is_angle else "tolerance_urad"
    if entry[other] is not None:
        return f"{other} of {name}; expected tolerance_{'urad' if kind.is_angle else 'um'}"
    if not kind.others[0] <= len(shapes) - 1 <= kind.others[1]:
        return f"{name} to {len(shapes) - 1} features; expected {kind.others[1]}"
    strange = [one.kind for one in (shapes if kind.others[0] else shapes[:1])]
    strange = [one for one in strange if one not in kind.features]
    if strange:
        return f"{name} of a {strange[0]}; expected a {' or a '.join(kind.features)}"
    if name in ("squareness", "parallelism"):
        angle = _parallelism(shapes, shapes)
        if abs(angle - np.pi / 2.0 * (name == "squareness")) > RIGHT_RAD:
            return f"{name} at a nominal angle of {np.rad2deg(angle):.4g}°; expected angle"
    return ""


def features_table(results: Sequence[FeatureResult]) -> Table:
    """List features and their measures, with what adds most to each."""
    rows: list[tuple[Any, ...]] = []
    for result in results:
        for name, one in result.measures.items():
            large, small = ("deg", "urad") if "nominal_deg" in one else ("mm", "um")
            most = [*one["budget"].items()][:3]
            rows.append((
                result.name,
                name.replace("_", " "),
                one[f"nominal_{large}"],
                "°" if large == "deg" else large,
                one[f"difference_{small}"],
                one[f"placed_difference_{small}"],
                "µrad" if small == "urad" else "µm",
                " … ".join(map(spell_signed, one.get(f"tolerance_{small}", ()))),
                one.get("verdict", ""),
                ", ".join(f"{key} {spell_signed(part)}" for key, part in most),
            ))  # fmt: skip
    columns = (
        Column("feature", key="feature", leads=True),
        Column("measure", key="measure", leads=True),
        Column("nominal", ".4f", key="nominal"),
        Column(key="nominal_unit", joins=True),
        *number_columns(("in the\nmachine", "placed"), "+.2f", keys=("difference", "placed")),
        Column(key="unit", joins=True),
        Column("tolerance", key="tolerance"),
        Column("verdict", key="verdict"),
        Column("most of it", key="most_of_it", wraps=True),
    )
    return Table(columns, rows, empty="no plane, cylinder, cone or sphere was found")
