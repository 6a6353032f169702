"""What an inspector measures on a part as cut: features, their measures, tolerances and causes.

A measure is taken on the part as it lies in the machine, and `placed`, after the best rigid fit of
all its vertices. The placed difference is split by error parameter: what each of them moves the
measure by where all errors are half as large, so that the parts add up.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from warpspace.analysis.blocks import Column, Table, number_columns
from warpspace.exceptions import SceneError, near_miss
from warpspace.field.evaluate import amplitudes_of
from warpspace.kinematics.model import Loop
from warpspace.parts.features import FREE, Feature, Shape, find_features, fit_shape
from warpspace.parts.part import Made, PartMesh, fit_out, point_basis
from warpspace.scene import schema
from warpspace.scene.files import parse_toml
from warpspace.scene.model import Scene, evaluate
from warpspace.units import MM_PER_UM, RAD_PER_URAD, UM_PER_MM, URAD_PER_RAD, Array, spell_signed

RIGHT_RAD = 1e-4  # a nominal angle this close to 90° or to 0 has a squareness or a parallelism
NUDGE = 1e-4  # share of an error by which points are moved: too little for others to stand out
LEVER_MM = 100.0  # at which turns count as much as shifts where datums leave both free
KEYS_AT_ONCE = 8  # parameters whose responses of all points are in memory
SHOWN = 0.005  # µm or µrad that a table names a parameter for
Shapes = Sequence[Shape]


def _distance(actual: Shapes, _nominal: Shapes) -> float:
    """Distance square to a plane; else square to an axis; else between centres."""
    away = actual[0].centre_mm - actual[1].centre_mm
    shape = min(reversed(actual), key=lambda one: one.across.shape[1])
    return float(np.linalg.norm(away @ shape.across))


def _angle(actual: Shapes, nominal: Shapes) -> float:
    """Angle through the material between planes, else up to 90° between axes, or to a plane."""
    one, other = actual
    across = np.linalg.norm(np.cross(one.axis, other.axis))
    turn = float(np.arctan2(across, one.axis @ other.axis))
    planes = [one.kind, other.kind].count("plane")
    if planes == 1:
        return abs(np.pi / 2.0 - turn)
    return np.pi - turn if planes or nominal[0].axis @ nominal[1].axis < -RIGHT_RAD else turn


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
    away = actual[0].centre_mm - place - found[:3]
    return float(np.linalg.norm(away @ nominal[0].across))


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
    "parallelism": Kind(_angle, _LEANING, (1, 1), is_angle=True),
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
    scene: Scene, mesh: PartMesh, made: Made, tolerances: tuple[str, str] | None = None
) -> tuple[FeatureResult, ...]:
    """Measure the features of a part, in its own frame, and made at some place in a scene.

    Tolerances are the name and the text of a TOML file that names features and says what they have
    to keep; SceneError says all that is wrong with it.
    """
    features, points = find_features(mesh), mesh.vertices_mm
    names = [one.name for one in features]
    asked = _read(*tolerances, features, names) if tolerances else {}
    wanted = [
        asked.pop((kind, (at,)), Wanted(kind, (at,), kind))
        for at, feature in enumerate(features)
        for kind, row in KINDS.items()
        if feature.shape.kind in row.features and not row.others[0]
    ]
    wanted += asked.values()
    turns = np.linalg.svd(
        (made.point_mm - made.point_mm.mean(axis=0)).T @ (points - points.mean(0))
    )
    sides = [1.0, 1.0, np.sign(np.linalg.det(turns[0] @ turns[2]))]
    turn = turns[0] * sides @ turns[2]  # from the frame of the part to that of the workpiece

    def measure(moved_um: Array) -> Array:
        return _measure(features, wanted, points + moved_um * MM_PER_UM)

    rest = fit_out(points, made.error_um @ turn)
    values = [measure(moved) for moved in (0.0 * rest, made.error_um @ turn, rest)]
    if any(one.tolerance for one in wanted):
        at = made.coordinates
        exact = evaluate(scene, at=at, loop=Loop.RELATIVE, frame="workpiece", exact=True)
        values.append(measure(fit_out(points, exact.error_um @ turn)))
    keys = [key for key in scene.parameter_keys if scene.errors.amplitude(key) != 0.0]
    parts: list[Array] = []
    for some in (keys[first : first + KEYS_AT_ONCE] for first in range(0, len(keys), KEYS_AT_ONCE)):
        moved = point_basis(scene, made, some).position @ turn
        for amplitude, one in zip(amplitudes_of(scene.errors, some), moved, strict=True):
            step = NUDGE * amplitude * fit_out(points, one)
            parts.append((measure(rest / 2.0 + step) - measure(rest / 2.0 - step)) / (2.0 * NUDGE))
    measures: list[dict[str, Mapping[str, Any]]] = [{} for _ in features]
    for index, one in enumerate(wanted):
        split = {key: float(part[index]) for key, part in zip(keys, parts, strict=True)}
        measures[one.of[0]][one.name] = _numbers(one, [float(row[index]) for row in values], split)
    results: list[FeatureResult] = []
    for name, feature, found in zip(names, features, measures, strict=True):
        of = next((key for key, one in found.items() if "tolerance_um" in one), "position")
        results.append(FeatureResult(name, feature.shape.kind, found, of, found[of]["budget"]))
    return tuple(results)


def _measure(features: Sequence[Feature], wanted: Sequence[Wanted], point_mm: Array) -> Array:
    """Take all measures, [m], µm or µrad, where the vertices of a part are, [V, 3]."""
    points = [point_mm[one.vertices] for one in features]
    shapes = [fit_shape(one.shape, seen) for one, seen in zip(features, points, strict=True)]
    found = np.empty(len(wanted))
    for index, (name, of, *_) in enumerate(wanted):
        kind, at = KINDS[name], of[0]
        if kind.take:
            value = kind.take([shapes[at] for at in of], [features[at].shape for at in of])
        else:  # what the file itself has rounded is no error of the machine
            value = np.ptp(shapes[at].respond(points[at]).distance_mm - features[at].away_mm)
        found[index] = value * (URAD_PER_RAD if kind.is_angle else UM_PER_MM)
    return found


def _numbers(wanted: Wanted, values: Sequence[float], split: Mapping[str, float]) -> dict[str, Any]:
    """Give a measure in numbers: nominal, actual, placed and, for a verdict, exact, µm or µrad."""
    is_angle = KINDS[wanted.kind].is_angle
    large, small = ("deg", "urad") if is_angle else ("mm", "um")
    per = np.rad2deg(RAD_PER_URAD) if is_angle else MM_PER_UM
    difference, placed, *exact = (value - values[0] for value in values[1:])
    names = ("nominal", "actual", "placed")
    found: dict[str, Any] = {f"{a}_{large}": v * per for a, v in zip(names, values, strict=False)}
    found |= {f"difference_{small}": difference, f"placed_difference_{small}": placed}
    if wanted.tolerance is not None:
        low, high = wanted.tolerance
        doubt, beyond = abs(exact[0] - placed), max(low - placed, placed - high)
        verdict = "in doubt" if abs(beyond) < doubt else "missed" if beyond > 0.0 else "kept"
        found |= {f"tolerance_{small}": wanted.tolerance, f"doubt_{small}": doubt}
        found["verdict"] = verdict
    return found | {"budget": dict(sorted(split.items(), key=lambda pair: -abs(pair[1])))}


def _read(
    source: str, text: str, features: Sequence[Feature], names: list[str]
) -> dict[tuple[str, tuple[int, ...]], Wanted]:
    """Read tolerances, and names of features into the list of them; refuse what does not fit."""
    problems, raw = schema.Problems(), parse_toml(text, source)
    entries: Sequence[Any] = (problems.read(schema.FEATURES, "", raw) or {}).get("features", ())
    known = {one.name: at for at, one in enumerate(features)}
    wanted: list[Wanted] = []
    for index, entry in enumerate(entries):
        where, name, chosen = f"features[{index}]", entry["name"], [entry["is"], *entry["to"]]
        if entry["near"] is not None:
            away = {
                float(np.linalg.norm(one.shape.centre_mm - entry["near"])): one.name
                for one in features
                if one.shape.kind == entry["is"]
            }
            chosen[0] = away[min(away)] if away else entry["is"]
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
    name, count = entry["measure"], len(shapes) - 1
    if not name:
        has_more = count or entry["tolerance_um"] or entry["tolerance_urad"]
        return "expected a measure" if has_more else ""
    if name not in KINDS:
        return f"unknown measure {name!r}{near_miss(name, KINDS)}"
    kind = KINDS[name]
    unit, other = ("urad", "um") if kind.is_angle else ("um", "urad")
    if entry[f"tolerance_{other}"] is not None:
        return f"tolerance_{other} of {name}; expected tolerance_{unit}"
    if not kind.others[0] <= count <= kind.others[1]:
        return f"{name} to {count} features; expected {kind.others[1]}"
    for one in shapes if kind.others[0] else shapes[:1]:
        if one.kind not in kind.features:
            return f"{name} of a {one.kind}; expected a {' or a '.join(kind.features)}"
    if name in ("squareness", "parallelism"):
        angle = _angle(shapes, shapes)
        if abs((np.cos if name == "squareness" else np.sin)(angle)) > RIGHT_RAD:
            return f"{name} at a nominal angle of {np.rad2deg(angle):.4g}°; expected angle"
    return ""


def features_table(results: Sequence[FeatureResult]) -> Table:
    """List features and their measures, with what adds most to each."""
    rows: list[tuple[Any, ...]] = []
    for result in results:
        for name, one in result.measures.items():
            large, small = ("deg", "urad") if "nominal_deg" in one else ("mm", "um")
            most = [pair for pair in one["budget"].items() if abs(pair[1]) >= SHOWN][:3]
            rows.append((
                f"{result.name} · {name.replace('_', ' ')}",
                *(one[f"{key}_{large}"] for key in ("nominal", "placed")),
                *(one[f"{key}_{small}"] for key in ("difference", "placed_difference")),
                " … ".join(map(spell_signed, one.get(f"tolerance_{small}", ()))),
                one.get("verdict", ""),
                ", ".join(f"{key} {spell_signed(part)}" for key, part in most),
            ))  # fmt: skip
    columns = (
        Column("measure", key="measure", leads=True, wraps=True),
        *number_columns(("nominal", "placed"), ".4f", "mm, °", ("nominal", "actual")),
        *number_columns(("deviation", "placed"), "+.2f", "µm, µrad", ("deviation", "placed")),
        Column("tolerance", key="tolerance"),
        Column("verdict", key="verdict"),
        Column("most of it", key="most_of_it", wraps=True),
    )
    return Table(columns, rows, empty=f"no {', '.join(FREE)} was found")
