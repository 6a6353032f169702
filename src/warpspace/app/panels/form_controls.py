"""Controls with unit, range and help: of the options of an analysis, of leaves of the state."""

import re
from collections.abc import Mapping, Sequence

from markupsafe import Markup

from warpspace.analysis.options import Option
from warpspace.app.browser.html import choice, field, ident, join, slider, switch, tag, text_box
from warpspace.app.state.app_state import AppState
from warpspace.app.state.tree import LONGEST, leaves, spell, value
from warpspace.scene.model import Scene

OWN = ""  # what stands for an option that is left to the analysis
EXAMPLES = {"X=..,Y=..": "X=0,B=30", "X,Y,Z": "100,0,50"}


def form_html(
    part: str, options: Sequence[Option], values: Mapping[str, str], scene: Scene
) -> Markup:
    """Give the controls of options; what was typed stands in them, else what they default to."""
    return join(_control(f"{part}:set.{one.name}", one, values.get(one.name), scene)
                for one in options)  # fmt: skip


def _control(name: str, one: Option, given: str | None, scene: Scene) -> Markup:
    hint, default, typed = f"{one.about}.", one.default_words, one.grammar and one.grammar.metavar
    if one.kind is bool:
        return switch(name, one.label, hint=hint, on=(given or str(int(one.default))) == "1")
    if one.choices or typed == "AXIS":
        known = one.choices or tuple(scene.machine.axes)
        words = {key: one.choice_labels.get(key, re.sub("[_-]", " ", key)) for key in known}
        if not one.default:
            words = {OWN: default or "automatic", **words}
        control = choice(name, str(one.default or OWN) if given is None else given, words)
        return field(one.label, control, name, one.unit, hint)
    if one.low is not None and one.high is not None:
        hint += f" {one.low:g} to {one.high:g}"
    held = "" if typed or one.unset else default
    control = text_box(
        name, held if given is None else given, size="" if typed else "short",
        placeholder=default or EXAMPLES.get(typed or "", typed or ""),
    )  # fmt: skip
    return field(one.label, control, name, one.unit, hint)


def setting(state: AppState, path: str, *, shown: str = "", bar: bool = False) -> Markup:
    """Give the control of a leaf of the state: a switch, a list, or a box, with a slider or not."""
    leaf, at, name = leaves(state)[path], value(state, path), f"state:set.{path}"
    if leaf.kind == "switch":
        return switch(name, leaf.label, on=bool(at), hint=leaf.hint)
    label, control = leaf.label, text_box(name, spell(state, path))
    if leaf.kind == "choice":
        control = choice(name, str(at), leaf.choices)
    elif leaf.kind == "lines":
        control = tag("textarea", str(at), class_="ws-box", id=ident(name), rows=3, data_set=name,
                      maxlength=LONGEST, placeholder=leaf.hint or None)  # fmt: skip
    elif leaf.kind == "number":
        shown = shown or f"{at:.6g}"
        control = text_box(name, shown, size="short", inputmode="decimal")
        if bar and leaf.span is not None:
            span, label = leaf.span, path.rpartition(".")[2]
            control = slider(name, at, span.low, span.high, span.step, label=leaf.label, twin=name,
                             text=f"{shown} {leaf.unit}") + control  # fmt: skip
    return field(label, control, name, leaf.unit, leaf.hint)
