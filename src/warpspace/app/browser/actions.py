"""Actions of the user: typed messages from the elements of a page.

An element carries its action as JSON (`data-do`, `data-set`, `data-live`, `data-enter`); the page
sends it back, with the text or the state of a control as its `value`. `incoming.py` decodes it:
unknown actions, fields and values are refused. Panels handle actions in methods with `@on(action)`.
"""

from enum import StrEnum, auto
from typing import Annotated, Literal, TypeAlias

import msgspec
from msgspec import Meta

LONGEST_VALUE = 20_000  # characters, except of files and of the copy of a state
LARGEST_NUMBER = 1e9

Number = Annotated[float, Meta(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]  # NaN is neither
Side = Annotated[int, Meta(ge=120, le=16_384)]  # of the drawing, pixels
Pixels = Annotated[int, Meta(ge=0, le=999_999)]
Index = Annotated[int, Meta(ge=0, le=9_999_999)]
Name = Annotated[str, Meta(max_length=160)]
Text = Annotated[str, Meta(max_length=LONGEST_VALUE)]
Motion: TypeAlias = Literal["exaggeration", "rotation", "program", "story"]
LongText = Annotated[str, Meta(max_length=15_500_000)]


class Signal(StrEnum):
    """Actions without data."""

    UNDO = auto()
    REDO = auto()
    FIT_VIEW = auto()
    SHOW_HINTS = auto()
    CLOSE_DIALOG = auto()
    FIND_ERROR = auto()  # in the page only
    CHOOSE_FILES = auto()  # in the page only
    DRAWN = auto()  # everything sent before is drawn
    RISE = auto()  # the first view begins
    HOLD = auto()  # a drag of a slider begins
    RELEASE = auto()
    REDUCE_MOTION = auto()  # the page wants no animations
    ZERO_ERRORS = auto()
    RESET_ERRORS = auto()
    INCLUDE_ERRORS = auto()
    SORT_ERRORS = auto()
    SAVE_SCENE = auto()
    SAVE_VIEW = auto()
    SAVE_FIGURE = auto()
    SAVE_PAGE = auto()
    SAVE_STORY = auto()
    OPEN_NOTES = auto()
    CLOSE_NOTES = auto()
    RECORD_DECISION = auto()
    LEAVE_NOTE_VIEW = auto()
    START_STORY = auto()
    NEXT_STEP = auto()
    PREVIOUS_STEP = auto()
    FIRST_STEP = auto()
    LAST_STEP = auto()
    END_STORY = auto()
    OPEN_COMPARISON = auto()
    PIN_AS_A = auto()
    END_COMPARISON = auto()
    FORGET_POINT = auto()
    SHOW_LEVER = auto()
    PICK_POINTS = auto()
    STOP_PICKING = auto()
    CLEAR_POINTS = auto()
    POINTER_GONE = auto()
    RESET_CONVENTIONS = auto()
    USE_PICKED_REFERENCE = auto()
    RESET_TOLERANCES = auto()
    SAVE_TABLE = auto()
    DRAW_CONCEPTS = auto()
    STOP_PLAYBACK = auto()
    SHOW_WORST_BLOCK = auto()


class Input(StrEnum):
    """Actions with a text: a name, or the value of a control."""

    FOLLOW_LINK = auto()
    OPEN_DIALOG = auto()
    FOLD_SECTION = auto()
    CHOOSE_SCENE = auto()
    CHOOSE_MACHINE = auto()
    RUN_COMMAND = auto()
    RUN_FIRST_COMMAND = auto()
    TOGGLE_DISPLAY = auto()
    COLOUR_BY = auto()
    SET_TRAVEL = auto()
    SET_SPEED = auto()
    PLAY = auto()
    CHOOSE_TRACK = auto()
    FIND_ERRORS = auto()
    UNFOLD_ERROR = auto()
    SHOW_LEVER_OF = auto()
    EXPORT = auto()
    CHOOSE_TEST = auto()
    ADD_READINGS = auto()
    SET_READING_KIND = auto()
    SET_TEST_OPTIONS = auto()
    SHOW_RESIDUALS = auto()
    SCALE_TOLERANCES = auto()
    ADD_CONCEPT = auto()
    REMOVE_CONCEPT = auto()
    OPEN_CONCEPT = auto()
    CHOOSE_CONVENTION = auto()
    SET_REFERENCE = auto()
    PIN_NOTE = auto()
    SAVE_NOTE = auto()
    SHOW_NOTE = auto()

    def __call__(self, value: str = "") -> "InputValue":
        return InputValue(self, value)


class Action(
    msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True, tag_field="do", tag=True
):
    def __str__(self) -> str:
        return msgspec.json.encode(self).decode()


class InputValue(Action):
    input: Input
    value: Text = ""


def kind_of(action: "AnyAction") -> "type[Action] | Signal | Input":
    if isinstance(action, InputValue):
        return action.input
    return action if isinstance(action, Signal) else type(action)


class PanelAction(Action):
    panel: Name


class Run(PanelAction): ...


class Cancel(PanelAction): ...


class AddToReport(PanelAction): ...


class RemoveOverlay(PanelAction): ...


class RemoveFile(PanelAction):
    index: Index


class Preview(PanelAction):
    card: Index


class Apply(PanelAction):
    card: Index


class SaveResult(PanelAction):
    format: Literal["CSV", "JSON"]


class SetOption(PanelAction):
    option: Name
    value: Text = ""


class Upload(PanelAction):
    name: Annotated[str, Meta(max_length=1000)]
    size: Annotated[int, Meta(ge=0)]
    content: LongText  # base64; empty where the file is too large


class SetLeaf(Action):
    path: Name
    value: Text = ""


class SetError(Action):
    key: Name
    value: Text = ""


class EditCurve(Action):
    key: Name
    edit: Literal["kind", "rows", "own"]
    value: Text = ""


class EditMachine(Action):
    edit: Name
    value: Text | None = None  # a typed number, or the chain


class SetSide(Action):
    side: Literal["a", "b"]
    value: Text = ""


class Scrub(Action):
    axis: Name
    value: Text = ""


class SaveAnimation(Action):
    motion: Motion
    ending: Literal[".webp", ".mp4"] = ".webp"


class OpenSection(Action):
    task: Name
    section: Name


class Share(Action):
    kind: Literal["", "without_token", "with_token"] = ""


class WriteReport(Action):
    ending: Literal[".html", ".pdf"]


class RemoveFromReport(Action):
    index: Index


class TurnPart(Action):
    axis: Literal["x", "y", "z"]


class ShowBox(Action):
    box: Literal["machine", "comparison", "residual"]


class DrawMaps(Action):
    save: bool = False


class ShowMachine(Action):
    look: Literal["off", "ghost", "solid"]


class ShowDrawing(Action):
    value: Literal["", "volume", "rotary"] = ""


class ViewFrom(Action):
    view: Literal["iso", "front", "right", "top"]


class SetOrthographic(Action):
    value: Literal["", "0", "1"] = ""


class RevealNote(Action):
    number: Index


class EditNote(Action):
    note: Name
    edit: Literal["edit", "delete", "revert", "status", "add", "up", "down", "out"]


class ChooseVersion(Action):
    note: Name
    index: Index


class ReplyToNote(Action):
    note: Name
    value: Text = ""


class TabHere(Action):
    token: Annotated[str, Meta(max_length=100)]


class StoredCopy(Action):
    text: LongText


class Resize(Action):
    """Size of the drawing, and of the texts at its edges."""

    width: Side
    height: Side
    top: Pixels
    bottom: Pixels
    right: Pixels


class PointAt(Action):
    """The pointer of a participant of a shared review."""

    ray: tuple[Number, Number, Number, Number, Number, Number]
    author: Text


AnyAction: TypeAlias = (
    Signal | InputValue | Run | Cancel | AddToReport | RemoveOverlay | RemoveFile | Preview | Apply
    | SaveResult | SetOption | Upload | SetLeaf | SetError | EditCurve | EditMachine | SetSide
    | Scrub | SaveAnimation | OpenSection | Share | WriteReport | RemoveFromReport | TurnPart
    | ShowBox | DrawMaps | ShowMachine | ShowDrawing | ViewFrom | SetOrthographic | RevealNote
    | EditNote | ChooseVersion | ReplyToNote | TabHere | StoredCopy | Resize | PointAt
)  # fmt: skip
