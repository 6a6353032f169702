"""A calibration in words: files, RMS, circles, parameters, what is confounded, what comes next."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from warpspace.app.evaluation.calibration import Answer, Measured
from warpspace.app.readouts.html import render
from warpspace.calibration.results import Found, Residuals
from warpspace.calibration.solve import spell_rank
from warpspace.units import UM_PER_MM, Array

Button = Callable[[str], Markup]
WIDTH, HEIGHT, EDGE = 400.0, 110.0, 6.0
MOST_BARS = 200  # readings that have a bar each; more share one, which shows the longest
WIDE = 100.0  # ends of intervals that need no decimals, µm or µrad
MOST_WORDS = 12  # notes and readings far off that are listed


@dataclass(frozen=True, slots=True)
class Bar:
    """The residual of a reading, or the longest of several: SVG places, and words."""

    x: float
    before: float
    after: float
    words: str
    outlier: bool


def files_html(files: Sequence[Measured], note: str, problem: str, button: Button) -> str:
    """List files of readings, each with a button that removes it."""
    return render(
        "calibration_files", files=files, note=note, problem=problem, button=button, remove="remove"
    )


def calibration_html(given: Answer, standing: str, button: Button, arrows: str = "") -> str:
    """Spell a calibration."""
    found = given.found
    shown = [one for one in found.parameters if one.before or one.key not in found.rank.unseen]
    bars, top_um = _bars(found.fitted)
    return render(
        "calibration",
        standing=standing,
        before_um=UM_PER_MM * found.rms_before_mm,
        after_um=UM_PER_MM * found.rms_after_mm,
        sigma_um=UM_PER_MM * found.sigma_mm,
        freedom=found.freedom,
        count=sum(len(one.readings) for one in found.fitted),
        circles=found.circles,
        rows=[(one, _value(one), _interval(one.interval_95)) for one in shown],
        in_part=any(one.told == "in part" for one in shown),
        combinations=[
            (
                one.words,
                _plus_minus(one.value, one.standard_uncertainty),
                _interval(one.interval_95),
            )
            for one in found.combinations
        ],
        confounded=spell_rank(found.rank, found.slopes),
        apart=[(group[0], words) for group, words in found.apart.items()],
        steps=found.steps,
        notes=found.notes[:MOST_WORDS],
        far=_far(found.fitted)[:MOST_WORDS],
        bars=bars,
        top_um=top_um,
        button=button,
        arrows=arrows,
    )


def _value(one: Found) -> str:
    if one.told == "no":
        return f"{one.before:.1f} held".replace("-", "−")
    return _plus_minus(one.value, one.standard_uncertainty)


def _plus_minus(value: float, width: float | None) -> str:
    return (f"{value:.1f}" + ("" if width is None else f" ± {width:.1f}")).replace("-", "−")


def _interval(ends: tuple[float, float] | None) -> str:
    if ends is None:
        return ""
    digits = 0 if max(map(abs, ends)) >= WIDE else 1
    return " … ".join(f"{end:.{digits}f}" for end in ends).replace("-", "−")


def _far(groups: Sequence[Residuals]) -> list[str]:
    return [
        f"{group.readings.source} line {group.readings.lines[at]}"
        for group in groups
        for at in group.outliers
    ]


def _bars(groups: Sequence[Residuals]) -> tuple[list[Bar], float]:
    """Lay out the chart of the residuals; also gives the value at its top, µm."""
    words = [(group, at) for group in groups for at in range(len(group.readings))]
    before, after = (
        UM_PER_MM * np.concatenate([np.linalg.norm(rows, axis=-1) for rows in parts])
        for parts in (
            [group.before_mm for group in groups],
            [group.after_mm for group in groups],
        )
    )
    top = max(float(before.max()), float(after.max()), 1e-6)
    places = np.array_split(np.arange(len(before)), min(len(before), MOST_BARS))
    step = (WIDTH - 2.0 * EDGE) / len(places)

    def up(value: float) -> float:
        return HEIGHT - EDGE - (HEIGHT - 2.0 * EDGE) * value / top

    bars: list[Bar] = []
    for number, members in enumerate(places):
        was, left = float(before[members].max()), float(after[members].max())
        group, at = words[int(members[np.argmax(after[members])])]
        text = f"{_pose(group, at)}: {was:.1f} → {left:.1f} µm"
        far = any(words[int(one)][1] in words[int(one)][0].outliers for one in members)
        bars.append(Bar(EDGE + (number + 0.5) * step, up(was), up(left), text, far))
    return bars, top


def _pose(group: Residuals, at: int) -> str:
    coordinates = group.readings.coordinates
    moving = [name for name, values in coordinates.items() if np.ptp(values) > 1e-9]
    rotary = [name for name in moving if name[0] in "ABC"] or moving
    stands = ", ".join(f"{name} {coordinates[name][at]:g}" for name in rotary[:3])
    return f"line {group.readings.lines[at]}, {stands}" if stands else "reading"


def arrows_of(given: Answer, *, before: bool) -> tuple[Array, Array]:
    """Give foot and residual of each reading that is a vector, [n, 3] mm and [n, 3] mm."""
    feet: list[Array] = [np.zeros((0, 3))]
    vectors: list[Array] = [np.zeros((0, 3))]
    for group in given.found.fitted:
        rows = group.before_mm if before else group.after_mm
        if rows.shape[1] == 3:
            feet.append(group.readings.nominal_mm)
            vectors.append(rows)
    return np.concatenate(feet), np.concatenate(vectors)
