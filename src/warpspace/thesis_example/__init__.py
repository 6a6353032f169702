"""Reference example: a thesis on the DVF5000, its printed numbers beside the computed ones.

The package registers itself as any plug-in does; nothing below imports it.
"""

import tomllib
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warpspace.analysis.registry import PUBLICATIONS, PrintedNumber, Publication

if TYPE_CHECKING:
    from warpspace.scene.model import Scene

MACHINE = "dvf5000"
MEASURED_MACHINES = ("first", "second")


@cache
def printed_tables() -> dict[str, Any]:
    """Read the printed numbers, and the notes on them."""
    return tomllib.loads(Path(__file__).with_name("thesis.toml").read_text("utf-8"))


def key_errors(machine: str) -> tuple[str, ...]:
    """Return the key errors of table 4-7."""
    if machine != MACHINE:
        return ()
    return tuple(key for key, row in printed_tables()["table_4_7"].items() if isinstance(row, list))


def sampled_mean(scene: "Scene", loop: str) -> PrintedNumber | None:
    """Return the predicted volumetric error of table 4-8."""
    machine, _, name = scene.name.partition("_")
    printed = printed_tables()["table_4_8"]["predicted"].get(f"{loop}_{name}")
    if printed is None or not machine == scene.machine.name == MACHINE:
        return None
    quotation = f"the thesis prints {printed:g} µm (table 4-8; see `warpspace thesis`)"
    return PrintedNumber(float(printed), quotation)


def measured_error(scene: "Scene") -> PrintedNumber | None:
    """Return the volumetric error of table 5-5, measured by LaserTRACER."""
    machine, _, name = scene.name.partition("_")
    if machine != MACHINE or name not in MEASURED_MACHINES:
        return None
    printed = printed_tables()["table_5_5"]["volumetric_um"][MEASURED_MACHINES.index(name)]
    return PrintedNumber(float(printed), f"LaserTRACER {printed:g} µm")


PUBLICATIONS.register(
    Publication(
        name="thesis",
        key_errors=key_errors,
        sampled_mean=sampled_mean,
        measured_error=measured_error,
    )
)
