"""Controls with unit, range and help, for options of an analysis and leaves of the state."""

import re
from collections.abc import Mapping, Sequence

from markupsafe import Markup

from warpspace.analysis.options import Option
from warpspace.app.browser.html import choice, field, ident, join, slider, switch, tag, text_box
from warpspace.app.state.app_state import AppState
from warpspace.app.state.tree import LONGEST, leaves, spell, value
from warpspace.scene.model import Scene

UNSET = ""  # value of an option that the analysis chooses
EXAMPLES = {"X=..,Y=..": "X=0,B=30", "X,Y,Z": "100,0,50"}


def form_html(
    panel: str, options: Sequence[Option], values: Mapping[str, str], scene: Scene
) -> Markup:
    """Render the controls of options with their values or defaults."""
    return join(_control(f"{panel}:set.{option.name}", option, values.get(option.name), scene)
                for option in options)  # fmt: skip


def _control(name: str, option: Option, text: str | None, scene: Scene) -> Markup:
    hint, default = f"{option.about}.", option.default_words
    metavar = option.grammar and option.grammar.metavar
    if option.kind is bool:
        return switch(name, option.label, hint=hint, on=(text or str(int(option.default))) == "1")
    if option.choices or metavar == "AXIS":
        keys = option.choices or tuple(scene.machine.axes)
        titles = {key: option.choice_labels.get(key, re.sub("[_-]", " ", key)) for key in keys}
        if not option.default:
            titles = {UNSET: default or "automatic", **titles}
        control = choice(name, str(option.default or UNSET) if text is None else text, titles)
        return field(option.label, control, name, option.unit, hint)
    if option.low is not None and option.high is not None:
        hint += f" Range: {option.low:g} to {option.high:g}"
    initial = "" if metavar or option.unset else default
    control = text_box(
        name, initial if text is None else text, size="" if metavar else "short",
        placeholder=default or EXAMPLES.get(metavar or "", metavar or ""),
    )  # fmt: skip
    return field(option.label, control, name, option.unit, hint)


def setting(state: AppState, path: str, *, text: str = "", bar: bool = False) -> Markup:
    """Render the control of a leaf of the state: a switch, a list, a text box or a slider."""
    leaf, present, name = leaves(state)[path], value(state, path), f"state:set.{path}"
    if leaf.kind == "switch":
        return switch(name, leaf.label, on=bool(present), hint=leaf.hint)
    label, control = leaf.label, text_box(name, spell(state, path))
    if leaf.kind == "choice":
        control = choice(name, str(present), leaf.choices)
    elif leaf.kind == "lines":
        control = tag("textarea", str(present), class_="ws-box", id=ident(name), rows=3,
                      data_set=name, maxlength=LONGEST, placeholder=leaf.hint or None)  # fmt: skip
    elif leaf.kind == "number":
        text = text or f"{present:.6g}"
        control = text_box(name, text, size="short", inputmode="decimal")
        if bar and leaf.span is not None:
            span, label = leaf.span, path.rpartition(".")[2]
            control = slider(name, present, span.low, span.high, span.step, label=leaf.label,
                             twin=name, text=f"{text} {leaf.unit}") + control  # fmt: skip
    return field(label, control, name, leaf.unit, leaf.hint)
