"""Rows of the performance table, growth curves, and the page that has them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

FITTED = 3
"""Largest sizes that an exponent is fitted to: the smaller ones show fixed costs."""


@dataclass(frozen=True)
class Row:
    """A figure beside a floor or a peer that was measured in the same run.

    Attributes
    ----------
    what : str
    value : float
        Seconds, or what `unit` says.
    beside : str
        What stands beside it: the least that is possible (a floor), or another program (a peer).
    beside_value : float
    unit : str, optional
    most : float, optional
        Largest value that is fine.
    most_ratio : float, optional
        Largest ratio that is fine.
    """

    what: str
    value: float
    beside: str
    beside_value: float
    unit: str = "s"
    most: float = math.inf
    most_ratio: float = math.inf

    @property
    def ratio(self) -> float:
        """Figure by floor."""
        return self.value / self.beside_value

    @property
    def is_met(self) -> bool:
        """Whether no target is missed."""
        return self.value <= self.most and self.ratio <= self.most_ratio

    @property
    def target(self) -> str:
        """The target in words."""
        parts = []
        if self.most < math.inf:
            parts.append(f"≤ {spell(self.most, self.unit)}")
        if self.most_ratio < math.inf:
            parts.append(f"≤ {self.most_ratio:g} ×")
        return ", ".join(parts) + ("" if self.is_met else " (missed)")


@dataclass(frozen=True)
class Growth:
    """A cost over a size, both growing.

    Attributes
    ----------
    what : str
    over : str
        What is counted.
    sizes, costs : sequence of float
    unit : str, optional
        Of the costs.
    """

    what: str
    over: str
    sizes: Sequence[float]
    costs: Sequence[float]
    unit: str = "s"

    @property
    def exponent(self) -> float:
        """Slope of the line through the logarithms of the three largest: 1 is proportional."""
        sizes, costs = np.log(self.sizes[-FITTED:]), np.log(self.costs[-FITTED:])
        return float(np.polyfit(sizes, costs, 1)[0])


@dataclass(frozen=True)
class Section:
    """What one benchmark found.

    Attributes
    ----------
    title : str
    text : str
        What was measured and how.
    rows : sequence of Row
    growth : sequence of Growth, optional
    """

    title: str
    text: str
    rows: Sequence[Row]
    growth: Sequence[Growth] = ()


def spell(value: float, unit: str = "s") -> str:
    """Spell a value with three digits; seconds in the unit that suits them."""
    if unit == "s":
        for factor, name in ((1.0, "s"), (1e3, "ms"), (1e6, "µs")):
            if value * factor >= 1.0 or name == "µs":
                return f"{_three(value * factor)} {name}"
    return f"{_three(value)} {unit}".rstrip()


def _three(value: float) -> str:
    """Spell a number with three digits, without an exponent."""
    if value == 0.0:
        return "0"
    digits = max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{value:,.{digits}f}"


def section_text(section: Section) -> str:
    """Spell a section as Markdown."""
    lines = [f"## {section.title}", "", section.text, ""]
    if section.rows:
        lines += [
            "| what | ours | beside it | takes | ratio | target |",
            "|---|--:|---|--:|--:|---|",
        ]
        lines += [
            f"| {row.what} | {spell(row.value, row.unit)} | {row.beside} |"
            f" {spell(row.beside_value, row.unit)} | {_three(row.ratio)} | {row.target} |"
            for row in section.rows
        ]
        lines.append("")
    if section.growth:
        lines += ["| growth | over | sizes | costs | exponent |", "|---|---|---|---|--:|"]
        lines += [
            f"| {curve.what} | {curve.over} | {', '.join(f'{size:,.0f}' for size in curve.sizes)} |"
            f" {', '.join(spell(cost, curve.unit) for cost in curve.costs)} |"
            f" {curve.exponent:.2f} |"
            for curve in section.growth
        ]
        lines.append("")
    return "\n".join(lines)
