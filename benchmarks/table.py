"""Rows of the performance table, growth curves, and the page that has them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import median

import numpy as np

FITTED = 3
"""Largest sizes that an exponent is fitted to: the smaller ones show fixed costs."""


@dataclass(frozen=True)
class Row:
    """A figure and its baseline, a floor or a peer, measured in the same run.

    Attributes
    ----------
    label : str
    value : float
        Seconds, or what `unit` says.
    baseline : str
        The least that is possible (a floor), or another program (a peer).
    baseline_value : float
    unit : str, optional
    max_value : float, optional
        Largest value accepted.
    max_ratio : float, optional
        Largest ratio accepted.
    """

    label: str
    value: float
    baseline: str
    baseline_value: float
    unit: str = "s"
    max_value: float = math.inf
    max_ratio: float = math.inf

    @property
    def ratio(self) -> float:
        """Figure by floor."""
        return self.value / self.baseline_value

    @property
    def is_met(self) -> bool:
        """True if the figure meets its targets."""
        return self.value <= self.max_value and self.ratio <= self.max_ratio

    @property
    def target(self) -> str:
        """The target in words."""
        parts = []
        if self.max_value < math.inf:
            parts.append(f"≤ {spell(self.max_value, self.unit)}")
        if self.max_ratio < math.inf:
            parts.append(f"≤ {self.max_ratio:g} ×")
        return ", ".join(parts) + ("" if self.is_met else " (missed)")


@dataclass(frozen=True)
class Growth:
    """A cost over a size, both growing.

    Attributes
    ----------
    label : str
    size_name : str
        Quantity of the sizes.
    sizes, costs : sequence of float
    unit : str, optional
        Of the costs.
    """

    label: str
    size_name: str
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
    """The figures of one benchmark.

    Attributes
    ----------
    title : str
    text : str
        The method of measurement.
    rows : sequence of Row
    growth : sequence of Growth, optional
    """

    title: str
    text: str
    rows: Sequence[Row]
    growth: Sequence[Growth] = ()


def median_section(runs: Sequence[Section]) -> Section:
    """Take the median of each figure and of each baseline over complete runs."""
    first = runs[0]
    rows = [
        replace(
            same[0],
            value=median(row.value for row in same),
            baseline_value=median(row.baseline_value for row in same),
        )
        for same in zip(*(run.rows for run in runs), strict=True)
    ]
    growth = [
        replace(same[0], costs=[*map(median, zip(*(curve.costs for curve in same), strict=True))])
        for same in zip(*(run.growth for run in runs), strict=True)
    ]
    return replace(first, rows=rows, growth=growth)


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
            f"| {row.label} | {spell(row.value, row.unit)} | {row.baseline} |"
            f" {spell(row.baseline_value, row.unit)} | {_three(row.ratio)} | {row.target} |"
            for row in section.rows
        ]
        lines.append("")
    if section.growth:
        lines += ["| growth | over | sizes | costs | exponent |", "|---|---|---|---|--:|"]
        lines += [
            f"| {curve.label} | {curve.size_name} |"
            f" {', '.join(f'{size:,.0f}' for size in curve.sizes)} |"
            f" {', '.join(spell(cost, curve.unit) for cost in curve.costs)} |"
            f" {curve.exponent:.2f} |"
            for curve in section.growth
        ]
        lines.append("")
    return "\n".join(lines)
