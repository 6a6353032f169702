"""Errors by direction of travel: one curve forward, one backward."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from warpspace.machine.axes import TravelDirection
from warpspace.machine.curves.curve import ErrorFunction, Rows, Span, Spell, ValueReader
from warpspace.machine.curves.simple import Constant
from warpspace.units import Array

SHARES = {
    TravelDirection.MEAN: (0.5, 0.5),
    TravelDirection.FORWARD: (1.0, 0.0),
    TravelDirection.BACKWARD: (0.0, 1.0),
    TravelDirection.DIFFERENCE: (1.0, -1.0),
}
"""Of the curve forward and of that backward."""
NOTHING = Constant((0.0, 1.0))


@dataclass(frozen=True)
class Directional(ErrorFunction):
    """An error whose value depends on the way that its axis has come.

    `evaluate` gives the mean of both; `evaluate_at` takes a direction. The amplitude is the larger
    one of the two curves' and scales both, so that their ratio stays.
    """

    name = "directional"
    title = "by direction of travel"
    forms = (("forward", "backward"),)
    row_words = "curves by direction come from a scene file or an import"
    slider = "differs by direction of travel of {axis}; this is the larger one's amplitude"
    edited_as_rows = False
    # reached towards growing positions, and towards falling ones; of any other kind
    forward: ErrorFunction = NOTHING
    backward: ErrorFunction = NOTHING

    @property
    def arguments(self) -> tuple[str, ...]:
        """Axes that either curve depends on."""
        return tuple(dict.fromkeys((*self.forward.arguments, *self.backward.arguments)))

    def evaluate(self, position: Array) -> Array:
        """Give the mean of both directions."""
        return 0.5 * (self.forward.evaluate(position) + self.backward.evaluate(position))

    def evaluate_at(
        self,
        axis: str,
        coordinates: Mapping[str, Array],
        direction: str = TravelDirection.MEAN,
    ) -> Array:
        """Give the mean, one of the directions, or forward − backward, [...]."""
        there, back = SHARES[TravelDirection(direction)]
        ways = ((there, self.forward), (back, self.backward))
        return np.asarray(
            sum(share * curve.evaluate_at(axis, coordinates) for share, curve in ways if share)
        )

    @property
    def has_directions(self) -> bool:
        """It does."""
        return True

    @property
    def lines(self) -> tuple[tuple[str, ErrorFunction], ...]:
        """The curves of both directions."""
        pairs = (("forward", self.forward), ("backward", self.backward))
        return tuple(
            (f"{way} {words}".rstrip(), line) for way, one in pairs for words, line in one.lines
        )

    @property
    def parts(self) -> tuple[ErrorFunction, ...]:
        """The curves of both directions."""
        return (*self.forward.parts, *self.backward.parts)

    def scaled(self, factor: float) -> Self:
        """Multiply both curves."""
        return replace(
            self, forward=self.forward.scaled(factor), backward=self.backward.scaled(factor)
        )

    @property
    def amplitude(self) -> float:
        """The amplitude of the curve whose one is larger, forward where they are alike."""
        there, back = self.forward.amplitude, self.backward.amplitude
        return back if math.isnan(back) or abs(back) > abs(there) else there

    def without_axes(self, positions: Mapping[str, float]) -> ErrorFunction:
        """Give both curves without the axes."""
        there, back = (one.without_axes(positions) for one in (self.forward, self.backward))
        return replace(self, forward=there, backward=back)

    @property
    def kinks(self) -> tuple[float, ...]:
        """The kinks of both curves."""
        return tuple(sorted({*self.forward.kinks, *self.backward.kinks}))

    @property
    def samples(self) -> int:
        """As many as the curve needs that needs more."""
        return max(self.forward.samples, self.backward.samples)

    def grown(self) -> Self:
        """Give both directions the same amplitude, each in its kind."""
        return replace(
            self,
            forward=self.forward.with_amplitude(1.0),
            backward=self.backward.with_amplitude(1.0),
        )

    @classmethod
    def read(cls, raw: Any, span: Span, reader: ValueReader) -> Self:
        """Read ``{ forward = CURVE, backward = CURVE }``."""
        found: list[ErrorFunction] = []
        for way in ("forward", "backward"):
            curve = reader.curve(raw[way], (way,))
            if isinstance(curve, Directional):
                reader.note((way,), "expected a curve that has no directions of its own")
            found.append(curve or Constant(span))
        return cls(span, *found)

    def to_toml(self) -> object:
        """Spell both curves."""
        return {"forward": self.forward.to_toml(), "backward": self.backward.to_toml()}

    def for_span(self, span: Span) -> ErrorFunction:
        """Give both curves for another range."""
        there, back = (
            replace(curve.for_span(span), span=span) for curve in (self.forward, self.backward)
        )
        return replace(self, span=span, forward=there, backward=back)

    def describe(self, unit: str, value: Spell, position: Spell) -> str:
        """Describe both curves."""
        there, back = (
            curve.describe(unit, value, position) for curve in (self.forward, self.backward)
        )
        return f"forward {there}, backward {back}"

    def rows(self) -> Rows:
        """Give the rows of the curve forward, then those backward."""
        return [*self.forward.rows(), *self.backward.rows()]

    @classmethod
    def from_curve(cls, present: ErrorFunction, span: Span) -> Self:
        """Give both directions the present curve."""
        if isinstance(present, cls):
            return replace(present, span=span)
        return cls(span, present, present)
