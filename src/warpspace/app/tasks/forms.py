"""Forms out of analyses: one control an option, with unit, range and help."""

from collections.abc import Mapping, Sequence

from markupsafe import Markup

from warpspace.analysis.options import Option
from warpspace.app.browser.html import choice, field, join, switch, text_box
from warpspace.scene.model import Scene

OWN = ""  # what stands for an option that is left to the analysis
EXAMPLES = {"X=..,Y=..": "X=0,B=30", "X,Y,Z": "100,0,50"}


def form_html(
    part: str, options: Sequence[Option], values: Mapping[str, str], scene: Scene
) -> Markup:
    """Give the controls of options; what was typed stands in them, else what they default to."""
    return join(_control(part, one, values.get(one.name), scene) for one in options)


def _control(part: str, one: Option, given: str | None, scene: Scene) -> Markup:
    name, hint = f"{part}:set.{one.name}", one.about + "."
    if one.kind is bool:
        return switch(name, one.label, on=given == "1" if given is not None else bool(one.default),
                      hint=hint)  # fmt: skip
    default = one.default_words
    if one.choices:
        words = {word: one.words.get(word, word.replace("_", " ").replace("-", " "))
                 for word in one.choices}  # fmt: skip
        if one.default is None:
            words = {OWN: default or "automatic", **words}
        chosen = (
            given if given is not None else str(one.default if one.default is not None else OWN)
        )
        return field(one.label, choice(name, chosen, words), name, one.unit, hint)
    if one.grammar is not None and one.grammar.metavar == "AXIS":
        words = {OWN: default or "automatic", **{axis: axis for axis in scene.machine.axes}}
        return field(one.label, choice(name, given or OWN, words), name, one.unit, hint)
    example = "" if one.grammar is None else EXAMPLES.get(one.grammar.metavar, one.grammar.metavar)
    held = default if one.grammar is None and not one.unset else ""
    span = f" {one.low:g} to {one.high:g}" if one.low is not None and one.high is not None else ""
    box = text_box(
        name, given if given is not None else held, placeholder=default or example,
        size="" if one.grammar else "short",
    )  # fmt: skip
    return field(one.label, box, name, one.unit, f"{hint}{span}")
