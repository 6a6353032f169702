"""Sentences and numbers of a report, in the words a reader needs."""

from collections.abc import Sequence

from warpspace.machine.errors import ErrorFunction
from warpspace.machine.parameters import parameter
from warpspace.outputs.report.review import Review, Reviewed, Sampling
from warpspace.picture.coordinates import list_axes, own_axes, spell_point
from warpspace.picture.words import MINUS, TIMES, spell, spell_factor, spell_short
from warpspace.scene.model import Scene
from warpspace.units import MICROMETRE

SUBJECTS = {
    "tool": "the tool point",
    "workpiece": "the workpiece point",
    "relative": "the tool, relative to the workpiece,",
}
NBSP = "\N{NO-BREAK SPACE}"
"""Keeps a number and its unit on one line."""
_WORTH = 0.01
"""Share of the RMS that an adjustment must gain to be named."""


def signed(value: float, digits: int = 3) -> str:
    """Spell a computed number with its sign."""
    return _signed(spell(value, digits))


def given(value: float) -> str:
    """Spell a number that somebody has chosen, with its sign and without trailing zeros."""
    return _signed(spell_short(value))


def _signed(text: str) -> str:
    """Put a plus before what has no sign."""
    return text if text == "0" or text.startswith(MINUS) else f"+{text}"


def microns(value: float) -> str:
    """Spell a length in µm."""
    return f"{spell(value)}{NBSP}{MICROMETRE}"


def limit(value: float) -> str:
    """Spell a specification in µm."""
    return f"{spell_short(value)}{NBSP}{MICROMETRE}"


def percent(share: float, digits: int = 1) -> str:
    """Spell a share in per cent."""
    return f"{100.0 * share:.{digits}f}{NBSP}%".replace("-", MINUS)


def worst_place(reviewed: Reviewed) -> str:
    """Spell the worst point: axis positions, and the point of R."""
    own = own_axes(reviewed.scene, reviewed.worst_at)
    return f"{spell_point(own, reviewed.statistics.max_at_mm)} mm"


def volume(reviewed: Reviewed) -> str:
    """Spell the size of the working volume."""
    extent = reviewed.picture.grid.extent_mm
    return f" {TIMES} ".join(f"{edge:.6g}" for edge in extent) + " mm"


def named(key: str) -> str:
    """Spell a parameter: key and plain name."""
    return f"{key} ({parameter(key).name})"


def listed(words: Sequence[str]) -> str:
    """Join words with commas and a last "and"."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def repair_words(reviewed: Reviewed) -> str:
    """Say which one adjustment helps the whole volume most; empty where none does."""
    found = reviewed.repairs
    if not found.repairs:
        return ""
    best = found.repairs[0]
    ((key, value),) = best.adjust.items()
    if not best.outcome.rms_um < found.before.rms_um - _WORTH * found.before.rms_um:
        return ""
    return (
        f"Of all squareness and alignment errors, {named(key)} helps most: set from"
        f" {given(found.present[key])} to {signed(value)}{NBSP}{parameter(key).unit}, it brings the"
        f" mean to {microns(best.outcome.mean_um)} and the largest error to"
        f" {microns(best.outcome.max_um)}."
    )


def verdict(review: Review) -> str:
    """Say in a few sentences what a reader must know."""
    if len(review.scenes) == 1:
        return " ".join(_one(review, review.scenes[0]))
    return " ".join(_two(review))


def _one(review: Review, reviewed: Reviewed) -> list[str]:
    """Sentences about one scene."""
    found, subject = reviewed.statistics, SUBJECTS[review.settings.loop]
    where = f"in the working volume of {volume(reviewed)}"
    if found.max_um == 0.0:
        sentences = [f"The error set is zero: {subject} is where it should be {where}."]
    else:
        sentences = [
            (
                f"On average {subject} is {microns(found.mean_um)} away from where it should be,"
                f" and at most {microns(found.max_um)}, {where}."
            ),
            _cause(reviewed),
        ]
        if review.settings.spec_um is not None:
            kept = found.max_um <= review.settings.spec_um
            sentences.append(
                f"The specification of {limit(review.settings.spec_um)} is"
                f" {'kept everywhere' if kept else 'not kept'}."
            )
    if reviewed.sampling is not None:
        sentences.append(sampling_sentence(reviewed.sampling))
    return sentences


def _cause(reviewed: Reviewed) -> str:
    """Say where the worst point is, and what helps."""
    return f"The worst point is at {worst_place(reviewed)}. {repair_words(reviewed)}".rstrip()


def _two(review: Review) -> list[str]:
    """Sentences about two scenes."""
    first, second = review.scenes
    a, b = first.statistics, second.statistics
    if a.mean_um > 0.0:
        change = (b.mean_um - a.mean_um) / a.mean_um
        word = "less" if change < 0.0 else "more"
        how = f": {percent(abs(change), 0)} {word} than A's {microns(a.mean_um)}"
        how = how if abs(change) >= 0.005 else f", the same as A's {microns(a.mean_um)}"
    else:
        how = "; A has none"
    sentences = [
        (
            f"B ({second.scene.title}) has a mean error of {microns(b.mean_um)}{how}"
            f" ({first.scene.title})."
        ),
        f"The largest error is {microns(b.max_um)} in B and {microns(a.max_um)} in A.",
    ]
    for letter, reviewed in (("A", first), ("B", second)):
        if reviewed.statistics.max_um > 0.0:
            words = f"In {letter} the worst point is at {worst_place(reviewed)}."
            sentences.append(f"{words} {repair_words(reviewed)}".rstrip())
    if review.settings.spec_um is not None:
        sentences.append(_kept(review, review.settings.spec_um))
    return sentences


def _kept(review: Review, spec_um: float) -> str:
    """Say which of two scenes keeps the specification, and how likely others like them do."""
    first, second = review.scenes
    keeps = [scene.statistics.max_um <= spec_um for scene in review.scenes]
    what = f"the specification of {limit(spec_um)}"
    if all(keeps):
        sentence = f"Both keep {what} everywhere."
    elif not any(keeps):
        sentence = f"Neither keeps {what} everywhere."
    else:
        sentence = f"{'A' if keeps[0] else 'B'} keeps {what} everywhere, the other does not."
    if first.sampling is None or second.sampling is None:
        return sentence
    a, b = first.sampling.worst.probability, second.sampling.worst.probability
    if a is None or b is None:
        return sentence
    return (
        f"{sentence} Of machines that their tolerances allow, {percent(a.probability)} (A) and"
        f" {percent(b.probability)} (B) would keep it."
    )


def sampling_sentence(sampling: Sampling) -> str:
    """Say what the tolerances promise."""
    within = sampling.worst.probability
    if within is None:
        return (
            f"Of machines that its tolerances allow, 95 % stay below"
            f" {microns(sampling.worst.p95_um)} at their worst point, and"
            f" {microns(sampling.sampled.mean_um)} is the mean error."
        )
    return (
        f"Of machines that its tolerances allow, {percent(within.probability)} keep the"
        f" specification of {limit(within.spec_um)} in the whole working volume (95 % interval"
        f" {percent(within.low)} to {percent(within.high)})."
    )


def spell_function(function: ErrorFunction | None, unit: str) -> str:
    """Describe the curve of an error along its axis."""
    if function is None:
        return ""
    return function.describe(unit, spell, spell_short)


def reference_words(scene: Scene) -> str:
    """Say what errors are referred to."""
    if scene.reference is None:
        return "Absolute: errors include the part that is the same everywhere."
    return f"Relative to the reference point {list_axes(scene.reference)}, which is held still."


def factor_words(factor: float) -> str:
    """Say how displacements are drawn."""
    return f"displacement drawn {spell_factor(factor)}"
