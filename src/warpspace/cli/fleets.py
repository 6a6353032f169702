"""Several scenes in one command, and the rows that are printed and written of each."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from warpspace.cli.tables import Column, number_columns
from warpspace.exceptions import OptionError
from warpspace.machine.limits import SWEEP_CASES

if TYPE_CHECKING:
    from warpspace.analysis.montecarlo import MonteCarlo
    from warpspace.scene.model import Scene
    from warpspace.scene.sweeps import SweepPoint

NUMBERS = ("mean_um", "rms_um", "median_um", "p95_um", "p99_um", "max_um")
HEADINGS = ("mean", "RMS", "median", "P95", "P99", "max")
PRINTED = 200
"""Rows that are printed; more are written with -o."""


def find_scenes(names: Sequence[str]) -> list[str]:
    """List the scenes that arguments stand for; a folder stands for the .toml files in it.

    Raises
    ------
    OptionError
        If a folder has none.
    """
    found: list[str] = []
    for name in names:
        if Path(name).is_dir():
            inside = sorted(str(path) for path in Path(name).glob("*.toml"))
            if not inside:
                raise OptionError(f"{name}: a folder without .toml files; expected scenes")
            found += inside
        else:
            found.append(name)
    if len(found) > SWEEP_CASES:
        raise OptionError(f"{len(found):,} scenes; expected at most {SWEEP_CASES:,}")
    return found


def load_each(names: Sequence[str]) -> "Iterator[Scene]":
    """Load scenes one after the other, so that a fleet need not fit into the memory.

    All are loaded once before the first is given, so that a mistake in the last one is said at
    once and not after hours.
    """
    from warpspace.scene.library import load_scene

    if len(names) > 1:
        for name in names:
            load_scene(name)
    return (load_scene(name) for name in names)


def row_kinds(swept: Sequence[str]) -> dict[str, str]:
    """Give the columns of a written table and what they hold."""
    return {
        "scene": "text",
        "title": "text",
        **dict.fromkeys(swept, "number"),
        "samples": "integer",
        "seed": "integer",
        **dict.fromkeys(NUMBERS, "number"),
        "spec_um": "number",
        "probability": "number",
        "probability_low": "number",
        "probability_high": "number",
    }


def row(point: "SweepPoint") -> dict[str, object]:
    """Give the numbers of one point, by column."""
    sampled = point.sampled
    kept = sampled.probability
    return {
        "scene": point.scene.name,
        "title": point.scene.title,
        **point.half_widths,
        "samples": sampled.plan.samples,
        "seed": sampled.plan.seed,
        **{name: getattr(sampled, name) for name in NUMBERS},
        "spec_um": None if kept is None else kept.spec_um,
        "probability": None if kept is None else kept.probability,
        "probability_low": None if kept is None else kept.low,
        "probability_high": None if kept is None else kept.high,
    }


def columns(swept: Sequence[str], spec_um: float | None) -> tuple[Column, ...]:
    """Give the columns of a printed table."""
    return (
        Column("scene", leads=True),
        *(Column(key, "±", is_number=True) for key in swept),
        *number_columns(HEADINGS, "µm"),
        *(() if spec_um is None else number_columns((f"≤ {spec_um:g} µm",), "%")),
    )


def cells(values: Mapping[str, object], swept: Sequence[str]) -> tuple[str, ...]:
    """Spell one row of a printed table."""
    share = values["probability"]
    return (
        str(values["scene"]),
        *(f"{values[key]:g}" for key in swept),
        *(f"{values[name]:.2f}" for name in NUMBERS),
        *([f"{100.0 * share:.2f}"] if isinstance(share, float) else []),
    )


def describe_run(sampled: "MonteCarlo") -> str:
    """Say how every row was sampled."""
    plan = sampled.plan
    return (
        f"{sampled.view.loop} loop · {plan.samples:,} machines a row, {plan.over} ·"
        f" {sampled.draws.distribution} · seed {plan.seed}"
    )
