"""What files must say of a picture beside its scene: excluded errors, a fixed range of colours."""

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.resulting_scene import active_scene
from warpspace.app.state.app_state import AppState
from warpspace.app.state.table import table_words
from warpspace.field.evaluate import placed_words, second_order_words
from warpspace.picture.comparison import conditions_of_both
from warpspace.picture.words import (
    direction_words,
    range_words,
)
from warpspace.scene.model import second_order


def state_conditions(state: AppState) -> tuple[str, ...]:
    """Say which errors of a state are excluded; nothing where that changes nothing."""
    chosen = state.exclusions
    own = [key for key, value in state.amplitudes.items() if value != 0.0]
    excluded = [key for key in own if key in chosen.excluded]
    only = [key for key in state.amplitudes if key in chosen.only and key not in chosen.excluded]
    if not chosen.only:
        return (f"excluded: {', '.join(excluded)}",) if excluded else ()
    if any(not chosen.active(key) for key in own):
        return (f"only: {', '.join(only or ['no error'])}",)
    return ()


def all_conditions(state: AppState) -> tuple[str, ...]:
    """Say the direction of travel, which errors do not take part, and the table that corrects."""
    table = table_words(state)
    view = (*direction_words(state.scene), *placed_words(state.view()))
    return (*view, *state_conditions(state), *((table,) if table else ()))


def picture_conditions(picture: LivePicture) -> tuple[str, ...]:
    """Say all that a file of a picture must say; of a difference for both sides."""
    if picture.is_difference and picture.compared is not None:
        a, b = (all_conditions(side) for side in picture.compared.sides)
        found = conditions_of_both(a, b)
    else:
        found = all_conditions(picture.drawn_state)
    return (*found, *order_conditions(picture), *range_conditions(picture))


def order_conditions(picture: LivePicture) -> tuple[str, ...]:
    """Say where the first order is not enough; with a table the exact chain is drawn."""
    both = picture.compared.sides if picture.compared and picture.is_difference else ()
    states = [one for one in both or (picture.drawn_state,) if one.controller is None]
    return second_order_words(*(second_order(active_scene(one), one.loop) for one in states))


def range_conditions(picture: LivePicture) -> tuple[str, ...]:
    """Say where a user has fixed the range of the colours."""
    if picture.state.look.range_mode != "fixed":
        return ()
    scale = picture.scale
    return (range_words(scale.low, scale.high, scale.unit),)
