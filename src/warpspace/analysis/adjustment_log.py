"""Logs of adjustments: acts with the errors before them, and the stiffness they reveal."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from warpspace.analysis.act_planning import Act
from warpspace.analysis.adjuster_effects import adjuster_effects
from warpspace.analysis.uncertainty.propagation import coverage_factor
from warpspace.exceptions import SceneError
from warpspace.machine.axes import PARAMETERS, parameter
from warpspace.machine.errors import Constant, ErrorSet
from warpspace.machine.limits import MAX_SCENE_BYTES
from warpspace.scene import schema
from warpspace.scene.library import load_scene
from warpspace.scene.model import Scene
from warpspace.scene.scene_writer import spell_section
from warpspace.scene.text_files import parse_toml, read_text
from warpspace.units import Array

PRIOR_SD = 0.3  # standard deviation of the effect of an adjuster, relative to the geometric one
CURVE_POSITIONS = 5  # along an axis at which curves before and after are compared


class DoneActs(NamedTuple):
    """Changes of adjusters, and the errors before them."""

    changes: Mapping[str, float]  # by adjuster, in its unit
    before: ErrorSet
    keys: frozenset[str] | None  # that are known before; None for all


@dataclass(frozen=True, slots=True)
class Stiffness:
    """Effect of an adjuster relative to the geometric one."""

    adjuster: str
    factor: float
    u95: float


def read_log(file: str, scene: Scene) -> tuple[DoneActs, ...]:
    """Read the acts of a log, ``[[done]]``; raise SceneError with all its problems."""
    path, problems = Path(file), schema.Problems()
    raw = parse_toml(read_text(path, MAX_SCENE_BYTES), file)
    document: dict[str, Any] | None = problems.read(schema.DONE_ACTS, "", raw)
    adjusters = scene.machine.adjusters
    groups = {name for adjuster in adjusters for name in adjuster.groups}
    names = [*(adjuster.name for adjuster in adjusters), *sorted(groups)]
    done: Sequence[dict[str, Any]] = document["done"] if document else ()
    entries: list[DoneActs] = []
    for index, entry in enumerate(done):
        key, before = f"done[{index}]", entry["before"]
        problems.only(f"{key}.acts", entry["acts"], names, "adjuster or group")
        changes: dict[str, float] = {}
        for name, change in entry["acts"].items():
            for adjuster in adjusters:
                if name in (adjuster.name, *adjuster.groups):
                    changes[adjuster.name] = changes.get(adjuster.name, 0.0) + change
        if isinstance(before, str):
            entries.append(DoneActs(changes, load_scene(path.parent / before).errors, None))
        else:
            allowed = [k for k in scene.machine.allowed_keys if PARAMETERS[k].is_constant]
            problems.only(f"{key}.before", before, allowed, "constant error of this machine")
            values = {k: v for k, v in before.items() if k in allowed}
            constants = {k: Constant((0.0, 1.0), value) for k, value in values.items()}
            entries.append(DoneActs(changes, ErrorSet(constants), frozenset(values)))
    if problems.lines:
        raise SceneError(file, problems.lines)
    return tuple(entries)


def learn_stiffness(
    scene: Scene, entries: Sequence[DoneActs], source: str = "log"
) -> dict[str, Stiffness]:
    """Estimate the effect of the adjusters that were changed, from the errors before and after.

    Linear Gaussian estimate: the prior of each factor is 1 ± `PRIOR_SD`; a reading is the change of
    an error at a position, with √2 times the standard uncertainty of that error in the scene. The
    positions along a curve count as one reading.
    """
    names = list(dict.fromkeys(name for entry in entries for name in entry.changes))
    effects = {
        adjuster.name: effect
        for adjuster, effect in zip(scene.machine.adjusters, adjuster_effects(scene), strict=True)
    }
    matrix, readings, unstated = [np.zeros((0, len(names)))], [np.zeros(0)], list[str]()
    for entry, after in pairwise((*entries, DoneActs({}, scene.errors, None))):
        changed = {key for name in entry.changes for key in effects[name]}
        for measured_keys in (entry.keys, after.keys):
            changed &= changed if measured_keys is None else measured_keys
        for key in sorted(changed):
            at = np.zeros(1)
            if not parameter(key).is_constant:
                at = np.linspace(*scene.axis_span(parameter(key).axis), CURVE_POSITIONS)
            width = _standard_uncertainty(scene, key, at)
            if width is None:
                unstated.append(key)
                continue
            scale = 1.0 / (width * np.sqrt(2.0 * len(at)))
            columns = np.zeros((len(at), len(names)))
            for name, change in entry.changes.items():
                columns[:, names.index(name)] = change * effects[name].evaluate(key, at)
            difference = after.before.evaluate(key, at) - entry.before.evaluate(key, at)
            matrix.append(columns * scale[:, None])
            readings.append(difference * scale)
    if unstated:
        keys = ", ".join(dict.fromkeys(unstated))
        problem = f"uncertainty of {keys} is not stated; expected it in [uncertainty] of the scene"
        raise SceneError(source, [problem])
    design, reading = np.concatenate(matrix), np.concatenate(readings)
    precision = np.eye(len(names)) / PRIOR_SD**2 + design.T @ design
    covariance = np.linalg.inv(precision)
    factors = 1.0 + covariance @ design.T @ (reading - design.sum(axis=1))
    u95 = coverage_factor(np.inf) * np.sqrt(np.diagonal(covariance))
    values = zip(names, factors.tolist(), u95.tolist(), strict=True)
    return {name: Stiffness(name, factor, width) for name, factor, width in values}


def _standard_uncertainty(scene: Scene, key: str, at: Array) -> Array | None:
    """Return the standard uncertainty of an error at positions, [n]; None where not stated."""
    if key in scene.uncertainty:
        return np.broadcast_to(scene.uncertainty[key].evaluate(at), at.shape)
    joint = scene.covariance
    if joint is None or key not in joint.keys:
        return None
    index = joint.keys.index(key)
    return np.full(at.shape, joint.rows[index][index] ** 0.5)


def extend_log(file: str, scene: Scene, acts: Sequence[Act], keys: Iterable[str]) -> str:
    """Write a log with acts and the present values of the constant errors that they change."""
    before = {k: scene.errors.amplitude(k) for k in keys if parameter(k).is_constant}
    changes = {act.adjuster: act.change for act in acts}
    entry = spell_section("[done]", {"acts": changes, "before": before})
    if not Path(file).exists():
        return entry
    read_log(file, scene)
    return f"{read_text(Path(file), MAX_SCENE_BYTES).rstrip()}\n\n{entry}".lstrip()
