"""Import of measured errors: what files bring and replace, mean and max before and after."""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Self

import numpy as np
from markupsafe import Markup

from warpspace.analysis.blocks import Column, Curve, Lines, Style, Table, table_html
from warpspace.app.browser.html import (
    EMPTY,
    button,
    choice,
    field,
    join,
    number,
    rows,
    tag,
    text_box,
)
from warpspace.app.documents.files import safe_file_name
from warpspace.app.evaluation.compare import applied, plain_state, with_applied
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.app.tasks.charts import lines_html
from warpspace.app.tasks.context import Context
from warpspace.app.tasks.files import PLAIN
from warpspace.app.tasks.parts import Part, Window, actions
from warpspace.exceptions import UnsaidError, WarpspaceError
from warpspace.formats.measured import BACKWARD, BOTH, FORWARD, Series, Summary, summaries
from warpspace.formats.registry import (
    CORRECTION,
    ERROR,
    SIGNS,
    Format,
    Reading,
    ReadOptions,
    find_format,
    formats,
    open_upload,
    parse_axis_options,
    read_errors,
    recognise,
)
from warpspace.formats.source import Source
from warpspace.formats.to_scene import ImportedScene, into_scene
from warpspace.machine.axes import is_linear, parameter
from warpspace.scene.model import Scene

LONGEST_AXES = 200  # characters of what is said of axes
LONGEST_PROBLEM = 1500  # characters of a message in the window


@dataclass(frozen=True)
class Said:
    """What a user says of files that they do not say themselves, as the command's options."""

    format: str = ""  # name of a format; empty for the one recognised
    axes: str = ""  # ``X`` or ``AX1=X``, several with blanks or commas between
    sign: str = ""  # "error", "correction", or empty for what the manual says
    variant: str = ""  # published variant of the format; empty for the usual one

    def fitting(self, kind: Format | None) -> Self:
        """Leave out what a format has no choice of, and what is too long."""
        signs = SIGNS if kind is not None and kind.tables is not None else ()
        variants = kind.variants if kind is not None else ()
        return replace(
            self,
            axes=self.axes[:LONGEST_AXES],
            sign=self.sign if self.sign in signs else "",
            variant=self.variant if self.variant in variants else "",
        )


@dataclass(frozen=True)
class Offer:
    """Files, what is said of them, and what they would bring."""

    sources: tuple[Source, ...]
    said: Said = Said()
    recognised: Format | None = None  # what the files are by themselves
    reading: Reading | None = None  # the last one that was possible; None before the first
    made: ImportedScene | None = None  # the scene with it
    problem: str = ""  # why the files cannot be read with what is said now; empty where they can

    @property
    def kind(self) -> Format | None:
        """The format they are read in."""
        return find_format(self.said.format) if self.said.format else self.recognised

    @property
    def names(self) -> list[str]:
        """Names of the files."""
        return [source.name for source in self.sources]

    @property
    def can_apply(self) -> bool:
        """Whether the scene is what is said now."""
        return self.made is not None and not self.problem


def offered(sources: Sequence[Source], base: Scene, said: Said = Said()) -> Offer:
    """Read files into a scene."""
    return _read(Offer(tuple(sources), said, _recognised(sources)), base)


def asking(sources: Sequence[Source], error: UnsaidError) -> Offer:
    """Give files that cannot be read before their user says more of them."""
    return Offer(tuple(sources), Said(), _recognised(sources), problem=_clamped(error))


def said_again(offer: Offer, said: Said, base: Scene) -> Offer:
    """Read files again as a user says now; the last reading stays where that is not possible."""
    try:
        chosen = replace(offer, said=said)
        return _read(replace(chosen, said=said.fitting(chosen.kind)), base)
    except WarpspaceError as error:
        return replace(offer, said=said, problem=_clamped(error))


def _read(offer: Offer, base: Scene) -> Offer:
    said = offer.said
    axis, names = parse_axis_options([text for text in re.split(r"[\s,;]+", said.axes) if text])
    options = ReadOptions(base.machine, axis, names, said.sign, said.variant)
    reading = read_errors(offer.sources, options, said.format)
    made = into_scene(reading, base, base.title, ", ".join(offer.names))
    return replace(offer, reading=reading, made=made, problem="")


def _recognised(sources: Sequence[Source]) -> Format | None:
    """Find the format of files; None where they have none that is known, or several."""
    try:
        return recognise(sources)
    except WarpspaceError:
        return None


def _clamped(error: WarpspaceError) -> str:
    text = str(error)
    return text if len(text) <= LONGEST_PROBLEM else text[: LONGEST_PROBLEM - 1] + "…"


# --- The window -----------------------------------------------------------------------------------

MOST_FILES = 16  # files that are read together
MOST_CURVES, MOST_POINTS = 12, 400
SIGN_WORDS = {
    "": "as the manual says",
    ERROR: "errors, which the controller subtracts",
    CORRECTION: "corrections, which the controller adds",
}
WAYS = {FORWARD: "forward", BACKWARD: "backward", BOTH: "mean"}
OPTIONS = {"--axis": "“Axis”", "--sign": "“Sign”", "--variant": "“Variant”", "--format": "“Format”"}
Extremes = tuple[float, float]  # mean and max of the error, µm


class ImportWindow(Window):
    """Shows what files bring; nothing is changed before it is applied."""

    name, title = "import", "Import errors"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        context.offer_import = self.offer
        self._offer: Offer | None = None
        self._refused: list[Source] = []
        self._effect: tuple[Extremes, Extremes] | None = None

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        """Follow the files, and what is said of them."""
        return (id(self._offer),)

    def offer(self, name: str, content: bytes) -> None:
        """Take a file; with those shown, or the one refused before it, where they belong together.

        A file that does not say enough to be read opens the window with the question, unless it
        shows other files already.
        """
        source = open_upload(safe_file_name(name), content)
        is_open = self.context.state.page.window == self.name
        shown = list(self._offer.sources) if self._offer is not None and is_open else []
        for others in (shown, self._refused):
            together = [one for one in others if one.name != source.name]
            if together and len(together) < MOST_FILES:
                with suppress(WarpspaceError):
                    self._open(self._read([*together, source]))
                    return
        try:
            self._open(self._read([source]))
        except UnsaidError as error:
            if any(one.name != source.name for one in shown):
                raise
            self._open(asking([source], error))
        except WarpspaceError:
            self._refused = [source]  # such as a list of tables that come after it
            raise

    def _base(self) -> Scene:
        return self.context.state.resulting_scene()

    def _read(self, sources: Sequence[Source]) -> Offer:
        if self._offer is not None and len(sources) > 1:
            with suppress(WarpspaceError):
                return offered(sources, self._base(), self._offer.said)
        return offered(sources, self._base())

    def _open(self, offer: Offer) -> None:
        self._take_in(offer)
        self._refused = []
        self.context.send("page:open", self.name)

    def _take_in(self, offer: Offer) -> None:
        now = plain_state(self.context.state)
        if offer.can_apply and offer.made is not None:
            self._effect = _extremes(now), _extremes(applied(now, offer.made.scene))
        self._offer = offer
        self.context.renew(self)

    def take(self, state: AppState, word: str, value: str) -> AppState:
        """Say what a file does not say, or apply it."""
        offer = self._offer
        if offer is None:
            return state
        name = word.removeprefix("set.")
        if name in ("format", "axes", "sign", "variant"):
            said = replace(offer.said, **{name: value})
            self.context.act(partial(self._say, said))
        elif word == "apply" and offer.made is not None and offer.can_apply:
            self._offer = None
            names = ", ".join(offer.names)
            self.context.act(partial(self.context.notify, "Imported", names))
            before = f"before the import of {names}"
            return with_applied(self.closed(state), offer.made.scene, before)
        return state

    def _say(self, said: Said) -> None:
        if self._offer is not None:
            self._take_in(said_again(self._offer, said, self._base()))

    def body(self, picture: LivePicture) -> Markup:
        """Say what would be replaced and what it does; then the options and the details."""
        offer = self._offer
        if offer is None:
            return tag("p", "No file is open. Choose one with Open at the top.")
        problem = _without_options(offer.problem)
        buttons = actions(
            button("Apply", "import:apply", kind="main", disabled=not offer.can_apply,
                   hint="Take these errors over; the state before is kept as A"),
            button("Cancel", "page:close", hint="Change nothing"),
        )  # fmt: skip
        options = tag("details", tag("summary", "Format, axis, sign") + _options(offer),
                      class_="ws-options", open=bool(offer.problem))  # fmt: skip
        return join((
            tag("p", problem, class_="ws-problem", role="alert") if problem else EMPTY,
            _said_first(offer, picture.state), self._effect_rows() if offer.can_apply else EMPTY,
            buttons, options, _details(offer, picture.state),
        ))  # fmt: skip

    def _effect_rows(self) -> Markup:
        if self._effect is None:
            return EMPTY
        before, after = self._effect
        return rows(
            (word, f"{number(a)} → {number(b)} µm")
            for word, a, b in zip(("mean", "max"), before, after, strict=True)
        )


def _extremes(state: AppState) -> Extremes:
    found = PLAIN.evaluate(state).statistics
    return found.mean_um, found.max_um


def _said_first(offer: Offer, state: AppState) -> Markup:
    """Say what is read from where, and what it replaces."""
    if offer.reading is None:
        return tag("p", f"{', '.join(offer.names)} is not read yet.")
    found = offer.reading
    units = ", ".join(found.found.units).replace("um", "µm").replace("urad", "µrad")
    title = found.format.title[:1].upper() + found.format.title[1:]
    read = f"{title} from {', '.join(offer.names)}, in {units}."
    keys = [one.key for one in summaries(found.found)]
    old = [key for key in dict.fromkeys(keys) if state.amplitudes.get(key)]
    new = [key for key in dict.fromkeys(keys) if key not in old]
    parts = [f"replaces {', '.join(old)}" if old else "", f"adds {', '.join(new)}" if new else ""]
    words = " and ".join(part for part in parts if part) or "holds no errors"
    stale = "As it was last read: it " if offer.problem else "It "
    return tag("p", read) + tag("p", f"{stale}{words}.", class_="ws-told")


def _without_options(text: str) -> str:
    """Name the controls of the window in place of the options of a command."""
    for option, words in OPTIONS.items():
        text = text.replace(option, words)
    return text


def _details(offer: Offer, state: AppState) -> Markup:
    if offer.reading is None or offer.made is None:
        return EMPTY
    found = offer.reading.found
    said = (*found.assumed, *found.notes, *offer.made.notes)
    kept = f"kept from {state.scene.name}:"
    notes = [
        _without_options(one.replace(kept, "unchanged:"))
        for one in said
        if not one.startswith("replaced: ")
    ]
    charts = [*_charts(found.series[:MOST_CURVES])]
    if (left := len(found.series) - MOST_CURVES) > 0:
        notes.append(f"{left} more curves are not drawn")
    return join((
        Markup(table_html(_table(summaries(found), state))),  # noqa: S704 - escaped there
        tag("ul", join(tag("li", words) for words in notes), class_="ws-quiet") if notes else EMPTY,
        tag("details", tag("summary", "Curves") + tag("div", join(charts), class_="ws-columns"),
            class_="ws-options", data_key="curves") if charts else EMPTY,
    ))  # fmt: skip


def _table(found: Sequence[Summary], state: AppState) -> Table:
    def spelt(value: float | None) -> str:
        return "" if value is None else f"{value:.3g}"

    def row(one: Summary) -> tuple[object, ...]:
        values = f"{number(one.smallest)} … {number(one.largest)} {one.unit}"
        now = state.amplitudes.get(one.key)
        held = f"{number(now)} {one.unit}" if now else "zero"
        return (one.key, parameter(one.key).name, held, values, one.points,
                f"{one.runs or ''} {one.directions}".strip(),
                spelt(one.mean_reversal), spelt(one.uncertainty))  # fmt: skip

    heads = ("Error", "", "Now", "In the file", "Points", "Runs", "Reversal", "Uncertainty")
    lines = [row(one) for one in found]
    columns = (
        Column(head, shows=any(cells))  # one that says nothing is left out
        for head, cells in zip(heads, zip(*lines, strict=True), strict=True)
    )
    return Table(tuple(columns) if lines else (), lines)


def _charts(found: Sequence[Series]) -> Iterator[Markup]:
    for one in found:
        at, row = np.array(one.positions), parameter(one.key)
        thin = slice(None, None, max(1, len(at) // MOST_POINTS))
        curves: list[Curve] = []

        def add(name: str, values: np.ndarray, way: int, style: Style, at: np.ndarray = at) -> None:
            held = np.isfinite(values)
            colour = list(WAYS).index(way)
            curves.append(Curve(name, at[held][thin], values[held][thin], colour, style))  # noqa: B023

        means = {way: mean for way in WAYS if (mean := one.mean(way)) is not None}
        for way, mean in means.items():
            add(WAYS[way], np.asarray(mean), way, "line")
        if len(one.runs) > len(means):
            for run in one.runs:
                add("", np.array(run.values), run.direction, "dots")
        place = "mm" if is_linear(row.axis) else "°"
        title = f"{one.key} {row.name}"
        yield lines_html(
            Lines("lines", title, f"{row.axis} [{place}]", f"[{row.unit}]", tuple(curves))
        )


def _options(offer: Offer) -> Markup:
    """Ask for what the files do not say."""
    said, kind = offer.said, offer.kind
    first = offer.recognised.title if offer.recognised is not None else "none, choose one"
    known = {"": f"recognised: {first}", **{one.name: one.title for one in formats()}}

    def chosen(label: str, name: str, words: Mapping[str, str], hint: str) -> Markup:
        event = f"import:set.{name}"
        return field(label, choice(event, getattr(said, name), words), event, hint=hint)

    axes = text_box("import:set.axes", said.axes, placeholder="X, or AX1=X AX2=Y")
    return join((
        chosen("Format", "format", known, "Choose one if it is recognised wrongly or not at all."),
        field("Axis", axes, "import:set.axes", hint="X: the axis, if the files name"
              " none. AX1=X: what a name in the files means; several separated by blanks."),
        chosen("Sign", "sign", SIGN_WORDS, "Whether a table holds errors or corrections.")
        if kind is not None and kind.tables is not None else EMPTY,
        chosen("Variant", "variant", _variants(kind), "Published variant of the format.")
        if kind is not None and kind.variants else EMPTY,
    ))  # fmt: skip


def _variants(kind: Format) -> dict[str, str]:
    return {"": "usual one"} | {name: name for name in kind.variants}


class ImportSection(Part):
    """The section of the task Measure that opens a file."""

    name = "importing"

    def is_seen(self, state: AppState) -> bool:
        """Only within its task."""
        return state.page.task == "measure"

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        """Depend on nothing: it says the same every time."""
        return ()

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        """Offer to open a file."""
        words = (
            "Measured errors or a controller's table; what changes is shown before it is applied."
            " Files can also be dropped on the page."
        )
        upload = tag("button", "Import a file", type="button", class_="ws-button main",
                     data_upload="files")  # fmt: skip
        body = tag("div", tag("p", words) + actions(upload), class_="ws-body")
        return {
            f"section.{self.name}": tag(
                "section", tag("h3", "Import") + body, class_="ws-section", data_key=self.name
            )
        }
