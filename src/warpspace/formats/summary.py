"""What was read of each error, in a few numbers: for tables, previews and programs."""

from dataclasses import dataclass

import numpy as np

from warpspace.formats.measured import BACKWARD, BOTH, FORWARD, Imported, Series
from warpspace.machine.parameters import parameter


@dataclass(frozen=True)
class Summary:
    """One error.

    Attributes
    ----------
    key, unit : str
        Values below are in the unit, µm or µrad.
    kind : str
        "table", "by direction", "over Z", "over Z, by direction", "constant", or the name of a
        curve.
    points, runs : int
    directions : str
        "+", "-", "+ -", or empty where not told.
    span : tuple of float or None
        First and last position, mm or degrees.
    smallest, largest : float
        Of the mean.
    mean_reversal : float or None
        Mean over the positions of the reversal error (B̄ of ISO 230-2).
    repeatability : float or None
        Largest bidirectional repeatability (R of ISO 230-2).
    uncertainty : float or None
        Largest standard uncertainty.
    """

    key: str
    unit: str
    kind: str
    points: int
    runs: int
    directions: str
    span: tuple[float, float] | None
    smallest: float
    largest: float
    mean_reversal: float | None = None
    repeatability: float | None = None
    uncertainty: float | None = None


def summaries(found: Imported) -> list[Summary]:
    """Summarise all errors of an import."""
    rows = [_of_series(one) for one in found.series]
    for plane in found.planes:
        values = plane.table(BOTH)
        ways = ", by direction" if plane.backward else ""
        rows.append(
            Summary(
                plane.key,
                parameter(plane.key).unit,
                f"over {plane.axes[1]}{ways}",
                values.size,
                0,
                "+ -" if plane.backward else "",
                (plane.first[0], plane.first[-1]),
                float(values.min()),
                float(values.max()),
            )
        )
    rows += [
        Summary(
            key,
            parameter(key).unit,
            "constant",
            1,
            0,
            "",
            None,
            value,
            value,
            uncertainty=found.uncertainty.get(key),
        )
        for key, value in found.constants.items()
    ]
    for key, curve in found.curves.items():
        ((kind, numbers),) = curve.items()
        last = numbers[-1][1] if kind == "harmonics" else numbers[-1]
        rows.append(Summary(key, parameter(key).unit, kind, len(numbers), 0, "", None, last, last))
    return rows


def _of_series(one: Series) -> Summary:
    """Summarise an error along its axis."""
    values, reversal, repeatability = one.values, one.reversal, one.repeatability
    ways = {run.direction for run in one.runs}
    told = " ".join(sign for sign, way in (("+", FORWARD), ("-", BACKWARD)) if way in ways)
    return Summary(
        one.key,
        parameter(one.key).unit,
        "table" if reversal is None else "by direction",
        len(one.positions),
        len(one.runs),
        told,
        (one.positions[0], one.positions[-1]),
        float(values.min()),
        float(values.max()),
        None if reversal is None else float(reversal.mean()),
        None
        if repeatability is None or np.isnan(repeatability).all()
        else float(np.nanmax(repeatability)),
        max(one.uncertainty) if one.uncertainty else None,
    )
