"""Publications: printed numbers of machines, which analyses show beside their own."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from warpspace.plugins import Registry

if TYPE_CHECKING:
    from warpspace.scene.model import Scene


class PrintedNumber(NamedTuple):
    """A number of a publication, and the phrase that quotes it."""

    value_um: float
    quotation: str


@dataclass(frozen=True, kw_only=True)
class Publication:
    """Numbers that a publication gives; each function returns nothing for other machines."""

    name: str  # heading of a column, mark of a chart, start of a key of a CSV file
    key_errors: Callable[[str], tuple[str, ...]]  # key errors of a machine by its name
    # mean |E| of machines within the tolerances of a scene, at one random point each, of a loop
    sampled_mean: "Callable[[Scene, str], PrintedNumber | None]"
    measured_error: "Callable[[Scene], PrintedNumber | None]"  # volumetric error of a machine


PUBLICATIONS: Registry[Publication] = Registry("publication", {})
