"""The table of conventions as HTML: every choice with what it changes."""

from collections.abc import Callable, Mapping, Sequence
from itertools import groupby

from markupsafe import Markup

from warpspace.app.evaluation.conventions import Effect, choices, chosen, own_state
from warpspace.app.evaluation.machine import standing
from warpspace.app.readouts.html import render
from warpspace.app.state.app_state import AppState
from warpspace.field.grid import find_volume_axes
from warpspace.kinematics.model import find_convention
from warpspace.machine.axes import is_linear

GROUPS = {
    "component_errors": ("Component errors", "where the errors of a motion act"),
    "loop": ("Loop", "whose error is looked at"),
    "reference": ("Reference", "what is held still"),
    "rotary": ("Table direction", "+1 with its name, −1 against"),
    "linear": ("Direction of linear axes", "likewise"),
}
WORDS = {
    "loop=tool": "tool point",
    "loop=workpiece": "workpiece point",
    "loop=relative": "tool relative to workpiece",
    "reference=absolute": "absolute",
    "reference=point": "a point is held still",
}
Attributes = Callable[[str, str], Markup]


def spell_choice(choice: str) -> str:
    """Spell a choice for people."""
    if choice in WORDS:
        return WORDS[choice]
    what, _, value = choice.partition("=")
    if what == "component_errors":
        return find_convention(value).title
    axis, sign = what.removeprefix("direction "), value
    return f"{axis} {'+1' if sign == '1' else '−1'}"


COST_GROUPS = {
    "squareness": ("Sign of squareness", "the scene's: by the right-hand rule"),
    "measuring_line": ("Measuring line", "the scene's: at the origin of each axis"),
    "straightness": ("Reference line of straightness", "the scene's: with its tilt"),
    "zero_at": ("Zero of the curves", "the scene's: as given"),
}
COST_WORDS = {
    "squareness=over_90": "positive where the angle is over 90°",
    "squareness=under_90": "positive where it is under 90°",
    "measuring_line": "through the middle of the volume",
    "straightness=end_point": "end points taken out",
    "straightness=least_squares": "least squares taken out",
    "straightness=minimum_zone": "minimum zone taken out",
    "zero_at": "zero in the middle of each axis",
}


def _cost_group(cost: Effect) -> str:
    return cost.choice.partition("=")[0]


def _group(choice: str) -> str:
    what, _, axis = choice.split("=", maxsplit=1)[0].partition(" ")
    return what if not axis else "linear" if is_linear(axis) else "rotary"


def conventions_html(
    state: AppState,
    effects: Mapping[str, Effect],
    attributes: Attributes,
    costs: Sequence[Effect] = (),
) -> str:
    """Spell the table of all choices."""
    ranges = state.scene.workspace.ranges
    nodes = "×".join(str(state.nodes if axis else 1) for axis in find_volume_axes(ranges))
    return render(
        "conventions",
        groups=[(*GROUPS[name], list(own)) for name, own in groupby(choices(state), _group)],
        nodes=nodes,
        in_force=chosen(state),
        own=chosen(own_state(state)),
        held=state.scene.reference and standing(state, state.scene.reference),
        effects=effects,
        spell_choice=spell_choice,
        attributes=attributes,
        cost_groups=[(*COST_GROUPS[name], list(own)) for name, own in groupby(costs, _cost_group)],
        cost_words=COST_WORDS,
    )
