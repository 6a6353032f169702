"""What a chart shows in words, for those who do not see it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpspace.app.readouts.html import render
from warpspace.machine.curves.curve import ErrorFunction
from warpspace.machine.measurement import Measurement
from warpspace.picture.words import spell
from warpspace.units import Array


def chart_text(words: str) -> str:
    """Write the text that stands, unseen, just before a chart.

    Parameters
    ----------
    words : str

    Returns
    -------
    str
        HTML. A script of the page gives the chart these words as its name.
    """
    return render("chart_text", words=words)


def describe_curve(name: str, unit: str, along: str, at: Array, value: Array) -> str:
    """Say what the curve of an error shows.

    Parameters
    ----------
    name, unit : str
        Of the error.
    along : str
        Unit of the positions.
    at, value : ndarray, [n]
        Positions, ascending, and the error there.

    Returns
    -------
    str
        The error at both ends; the least and the greatest, where they are not at the ends.
    """
    places = [0, len(at) - 1, int(np.argmin(value)), int(np.argmax(value))]
    words = ("starts with", "ends with", "least", "greatest")
    if np.ptp(value) == 0.0:
        return f"Chart of {name}: {spell(float(value[0]))} {unit} everywhere"
    said = [
        f"{word} {spell(float(value[place]))} {unit} at {spell(float(at[place]))} {along}"
        for word, place in zip(words, places, strict=True)
        if word.endswith("with") or place not in places[:2]
    ]
    return f"Chart of {name}: " + ", ".join(said)


def measured_words(uncertainty: ErrorFunction | None, measurement: Measurement | None) -> str:
    """Say what is known of the measurement of an error, behind the words of its curve."""
    parts: list[str] = []
    if uncertainty is not None:
        parts.append(f"standard uncertainty up to {spell(abs(uncertainty.amplitude))}")
    if measurement is not None:
        parts.append(f"{measurement.count} readings in {len(measurement.runs)} runs")
    return "".join(f", {part}" for part in parts)


def describe_histogram(
    edges_um: Array, counts: NDArray[np.integer[Any]], limit_um: float, words: str
) -> str:
    """Say what the histogram of the error shows.

    Parameters
    ----------
    edges_um : ndarray, [n + 1], µm
        Edges of its bars.
    counts : ndarray, [n]
        Machines per bar.
    limit_um : float, µm
    words : str
        What is counted, for instance "machines".

    Returns
    -------
    str
    """
    top = int(np.argmax(counts))
    return (
        f"Histogram of |E|: {words} from {spell(float(edges_um[0]))} to"
        f" {spell(float(edges_um[-1]))} µm, most of them between {spell(float(edges_um[top]))} and"
        f" {spell(float(edges_um[top + 1]))} µm; the limit is {spell(limit_um)} µm"
    )
