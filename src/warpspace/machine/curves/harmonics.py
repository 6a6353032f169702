"""Harmonics: a sum of cosines."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.machine.curves.curve import SPAN_SAMPLES, ErrorFunction, Rows, Span, Spell
from warpspace.machine.curves.reading import ValueReader
from warpspace.machine.curves.rows import limited, refuse_more
from warpspace.machine.limits import MAX_ERROR, MAX_LENGTH_MM, MAX_ORDER, MAX_TERMS
from warpspace.units import Array

MAX_SAMPLES = 200_001
MAX_COSINES = 2_000_000
"""Cosines that the peak of a curve may take: terms × positions."""
SAMPLES_PER_WAVE = 16
SHOWN_TERMS = 3
LEAST_PEAK = 1e-6
"""Largest value below which a wave of amplitude one does not leave zero within the range."""
LIMITS = ((0.0, MAX_ORDER), (-MAX_ERROR, MAX_ERROR), (-MAX_LENGTH_MM, MAX_LENGTH_MM))
"""Of order, amplitude and phase."""


@dataclass(frozen=True)
class Harmonics(ErrorFunction):
    """Sum of A·cos(n·q − φ).

    Attributes
    ----------
    terms : tuple of tuple of float, (n, 3)
        Order n, amplitude A, phase φ in degrees. The product n·q counts as degrees, so on a linear
        axis the wavelength is 360/n mm.
    """

    name: ClassVar[str] = "harmonics"
    title: ClassVar[str] = "harmonics"
    forms: ClassVar[tuple[tuple[str, ...], ...]] = (("harmonics",),)
    row_words: ClassVar[str] = "order, amplitude and phase in degrees in each row"
    terms: tuple[tuple[float, float, float], ...] = ()

    def evaluate(self, position: Array) -> Array:
        """Give the sum of the harmonics."""
        angle = np.asarray(position, dtype=float)
        total = np.zeros(angle.shape)
        for order, amplitude, phase in self.terms:
            total = total + amplitude * np.cos(np.deg2rad(order * angle - phase))
        return total

    def scaled(self, factor: float) -> Self:
        """Multiply all amplitudes."""
        return replace(self, terms=tuple((n, factor * a, phase) for n, a, phase in self.terms))

    def grown(self) -> Self:
        """Give the first of its waves that is not zero by its order and phase, else one whole wave.

        Orders and phases of all terms stay.
        """
        for index in range(len(self.terms)):
            terms = tuple(
                (n, float(k == index), phase) for k, (n, _, phase) in enumerate(self.terms)
            )
            wave = replace(self, terms=terms)
            if abs(wave.amplitude) > LEAST_PEAK:
                return wave
        return replace(self, terms=((_one_wave(self.span), 1.0, 0.0),))

    @property
    def samples(self) -> int:
        """Number of positions that resolves the shortest wave."""
        highest = max((order for order, _, _ in self.terms), default=0.0)
        waves = highest * (self.span[1] - self.span[0]) / 360.0
        most = min(MAX_SAMPLES, MAX_COSINES // max(len(self.terms), 1))
        return int(min(max(SPAN_SAMPLES, SAMPLES_PER_WAVE * waves + 1), most))

    @property
    def cosines(self) -> int:
        """Number of cosines that its peak takes: what opening a scene with this curve costs."""
        return self.samples * len(self.terms)

    @classmethod
    def read(cls, raw: Any, span: Span, reader: ValueReader) -> Self:
        """Read ``{ harmonics = [[n, A, φ], …] }``."""
        terms: list[tuple[float, float, float]] = []
        for index, entry in enumerate(reader.entries(raw["harmonics"], ("harmonics",), MAX_TERMS)):
            place = ("harmonics", index)
            order, amplitude, phase = reader.row(entry, place, "[order, amplitude, phase]", LIMITS)
            terms.append((order, amplitude, phase))
        return cls(span, tuple(terms))

    def to_toml(self) -> object:
        """Spell it as ``{ harmonics = [[n, A, φ], …] }``."""
        return {"harmonics": [list(term) for term in self.terms]}

    def describe(self, unit: str, value: Spell, position: Spell) -> str:
        """Name the first terms."""
        del position
        terms = ", ".join(f"{value(a)} {unit} × {n:g}" for n, a, _ in self.terms[:SHOWN_TERMS])
        return f"harmonics: {terms}" + (" …" if len(self.terms) > SHOWN_TERMS else "")

    @classmethod
    def from_rows(cls, span: Span, rows: Rows) -> Self:
        """Read terms of order, amplitude and phase; an absent phase is zero."""
        refuse_more(len(rows), MAX_TERMS, "terms")
        terms: list[tuple[float, float, float]] = []
        for number, row in enumerate(rows, start=1):
            if len(row) not in (2, 3):
                raise OptionError(f"row {number}: {len(row)} numbers; expected {cls.row_words}")
            order, amplitude, phase = (*row, 0.0)[:3]
            if not 0.0 <= order <= MAX_ORDER:
                raise OptionError(f"row {number}: order {order:g}; expected 0 to {MAX_ORDER}")
            limited(amplitude, number, what="amplitude")
            terms.append((order, amplitude, limited(phase, number, MAX_LENGTH_MM, "phase")))
        return cls(span, tuple(terms))

    def rows(self) -> Rows:
        """Give one term a row."""
        return self.terms

    @classmethod
    def from_curve(cls, present: ErrorFunction, span: Span) -> Self:
        """Give one wave over the range, with the amplitude of the present curve."""
        return cls(span, ((_one_wave(span), present.amplitude, 0.0),))


def _one_wave(span: Span) -> float:
    """Give the order, rounded, of the wave that is as long as the range."""
    return float(f"{360.0 / (span[1] - span[0]):.6g}")
