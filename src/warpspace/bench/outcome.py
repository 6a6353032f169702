"""What a test comes to: its standard's numbers, and its figure in numbers."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from warpspace.units import Array

Kind = Literal["lines", "polar", "plane"]
Style = Literal["line", "dashed", "dots", "thin"]


@dataclass(frozen=True, slots=True)
class Quantity:
    """One number of a standard.

    Attributes
    ----------
    key : str
        In JSON; ends in its unit.
    name : str
        In words.
    value : float
    unit : str
    """

    key: str
    name: str
    value: float
    unit: str


@dataclass(frozen=True, slots=True)
class Outcome:
    """What readings come to.

    Attributes
    ----------
    quantities : tuple of Quantity
        The most important first.
    details : mapping of str to object
        What else JSON has: lists of numbers, ready to be spelled.
    """

    quantities: tuple[Quantity, ...]
    details: Mapping[str, object] = field(default_factory=dict[str, object])

    def __getitem__(self, key: str) -> float:
        """Give a number by its key."""
        return next(quantity.value for quantity in self.quantities if quantity.key == key)


@dataclass(frozen=True, slots=True)
class Curve:
    """One curve of a chart.

    Attributes
    ----------
    name : str
        In the legend; a curve without one is not in it.
    x, y : ndarray, [n]
        In polar charts angle in degrees and deviation.
    colour : int
        Which of the colours of series; the same thing has the same colour, whoever measured it.
    style : str
        "line" for the model, "dots" for data, "dashed" for fits, "thin" for what is nominal.
    """

    name: str
    x: Array
    y: Array
    colour: int = 0
    style: Style = "line"


@dataclass(frozen=True, slots=True)
class Band:
    """What lies between two curves, [n]: scatter."""

    name: str
    x: Array
    low: Array
    high: Array
    colour: int = 0


@dataclass(frozen=True, slots=True)
class Chart:
    """A chart in numbers: what the app and figures draw alike.

    Attributes
    ----------
    kind : str
        "lines" over an abscissa, "polar" around the angle, "plane" to scale.
    title : str
    x_label, y_label : str
        With units.
    curves : tuple of Curve
    bands : tuple of Band
    note : str
        What a reader has to know: a factor, a reference.
    """

    kind: Kind
    title: str
    x_label: str
    y_label: str
    curves: tuple[Curve, ...]
    bands: tuple[Band, ...] = ()
    note: str = ""
