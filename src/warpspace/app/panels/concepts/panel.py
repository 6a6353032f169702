"""The concepts panel: machines to choose, how they are compared, and the outcome."""

from functools import partial
from typing import TYPE_CHECKING, Any

from warpspace.app.browser.clicks import Clicks
from warpspace.app.browser.handles import Handle, Input
from warpspace.app.evaluation.concepts import ask
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels.concepts.choosing import ConceptWindow
from warpspace.app.panels.concepts.work import ConceptWork
from warpspace.app.panels.context import PanelContext
from warpspace.app.readouts.concepts import ConceptRow, concepts_html
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.state.concept_choice import (
    LIMIT_UM,
    LOOPS,
    OVERS,
    TOLERANCES,
    Chosen,
    ConceptChoice,
)

if TYPE_CHECKING:
    from warpspace.app.evaluation.concepts import Answer
    from warpspace.scene.concepts import Concept

FEW = (
    "The same tolerances on several machines: which one holds a limit, and which errors matter in"
    " each? Choose two machines or more, then press Compare. Tolerances are those of A."
)
READY = "Press Compare: it takes some seconds, and pictures follow."
HOW = "Tolerances, place and loop"
STALE = "Machines, tolerances or settings have changed since: press Compare for new numbers."


class ConceptsPanel:
    """Machines of the library and of the page side by side.

    The outcome stays until something else is compared; nothing of the state is changed but by
    opening one of the machines.

    Parameters
    ----------
    context : PanelContext
    state : AppState
    """

    def __init__(self, context: PanelContext, state: AppState) -> None:
        gui = context.gui
        self._context = context
        self._choice = ConceptChoice(limit_um=state.specification.limit_um)
        self._answer: Answer | None = None
        self._compared = self._choice
        self._pictures: list[str] = []
        self._problem = ""
        self._clicks = Clicks(gui, lambda word: context.act(partial(self._do, word)))
        self._window = ConceptWindow(context, self._clicks, self._choose)
        choose = gui.add_button(
            "Choose machines …",
            color="gray",
            hint="Machines of the library with their pictures, the present one, every open scene.",
        )
        choose.on_click(lambda _: context.act(lambda: self._window.toggle(self._choice)))
        self._limit: Input[float] = Input(
            gui.add_number(
                "Limit of |E| [µm]",
                self._choice.limit_um,
                min=LIMIT_UM.low,
                max=LIMIT_UM.high,
                step=LIMIT_UM.step,
                hint="How likely is it that a machine within tolerance stays below?",
            ),
            self._note_settings,
        )
        self._start: Any = gui.add_button(
            "Compare", hint="Sample machines of each within tolerance. It runs beside the page."
        )
        self._start.on_click(lambda _: context.act(self._compare))
        self._work = ConceptWork(context, self._take, self._take_pictures, self._failed)
        with gui.add_folder(HOW, expand_by_default=False):
            self._tolerances = self._list(
                "Tolerances",
                TOLERANCES,
                "Half widths by class, as in the scene of A; or what each scene says itself.",
            )
            self._over = self._list(
                "Evaluated at",
                OVERS,
                "|E| at a random point of each sampled"
                " machine, or its largest over the working volume.",
            )
            self._loop = self._list(
                "Loop", LOOPS, "Tool against workpiece counts the axes of both sides."
            )
        self._text = Handle(gui.add_html(""))
        self._sheet: Any = gui.add_button(
            "Picture of all (PNG)",
            color="gray",
            visible=False,
            hint="One sheet for a report: the machines in one scale with their numbers.",
        )
        self._sheet.on_click(lambda _: context.act(self._draw_sheet))
        self._write(state)

    def _list(self, label: str, words: dict[str, Any], hint: str) -> Input[str]:
        """Add a list of words."""
        return Input(
            self._context.gui.add_dropdown(label, tuple(words), hint=hint), self._note_settings
        )

    def read(self, state: AppState) -> AppState:
        """Nothing of the state is chosen here; clicks post what they change."""
        return state

    def show(self, picture: LivePicture) -> None:
        """Nothing that must follow at once."""

    def settle(self, picture: LivePicture) -> None:
        """Say so where the outcome is no longer that of what is shown."""
        self._write(picture.state)

    def _note_settings(self) -> None:
        """Have the session take over what a browser has set; returns at once."""
        self._context.act(self._take_settings)

    def _take_settings(self) -> None:
        """Take over limit and lists, clamped."""
        choice = self._choice.with_words(
            *(str(one.handle.value) for one in (self._tolerances, self._over, self._loop))
        )
        self._limit.poll()
        self._choose(choice.with_limit(float(self._limit.handle.value)))
        self._limit.show(self._choice.limit_um)

    def _choose(self, choice: ConceptChoice) -> None:
        """Compare something else from now on; the outcome of before stays."""
        self._choice, self._problem = choice, ""
        self._write(self._context.store.state)
        self._context.client.flush()

    def _do(self, word: str) -> None:
        """Do what a button says; the word comes from a browser and may be anything."""
        if self._window.take(word, self._choice):
            return
        verb, _, number = word.partition(" ")
        machines = self._choice.machines
        if number not in map(str, range(len(machines))):
            return
        chosen = machines[int(number)]
        if verb == "remove":
            self._choose(self._choice.toggled(chosen))
        elif verb == "open" and chosen.scene is not None:
            self._context.show_opened(start_state(chosen.scene), None, whole=False)

    def _compare(self) -> None:
        """Start the work."""
        self._take_settings()
        if len(self._choice.machines) < 2:
            self._context.notify("Concepts", "Choose two machines or more.", "yellow")
            return
        state = self._context.store.state
        dark = state.shown.dark
        if not self._work.compare(ask(state, self._choice), self._choice, dark=dark):
            self._context.notify("Busy", "Machines are being compared already.", "gray")

    def _take(self, found: "Answer", choice: ConceptChoice) -> None:
        """Show numbers; their pictures follow."""
        self._answer, self._compared, self._pictures = found, choice, []
        self._problem = ""
        self._write(self._context.store.state)
        self._context.client.flush()

    def _take_pictures(self, found: "Answer", pictures: list[str]) -> None:
        """Show pictures, unless other machines are shown by now."""
        if found is self._answer:
            self._pictures = pictures
            self._write(self._context.store.state)
            self._context.client.flush()

    def _draw_sheet(self) -> None:
        """Draw one sheet of what is shown, and have the browser save it."""
        if self._answer is not None:
            dark = self._context.store.state.shown.dark
            if not self._work.draw_sheet(self._answer.question, dark=dark):
                self._context.notify("Busy", "Wait for the comparison, or cancel it.", "gray")

    def _failed(self, _name: str, words: str) -> None:
        """Show what went wrong; the outcome of before stays."""
        self._problem = words
        self._context.notify("Not compared", words, "red")
        self._context.act(lambda: self._write(self._context.store.state))

    def _write(self, state: AppState) -> None:
        """Write what is chosen and what is known of it; what is the same already is not sent."""
        text = concepts_html(
            self._rows(state), self._answer, self._note(state), self._clicks.button
        )
        self._text.put(content=text)
        drawable = self._answer is not None and self._context.services.draw_concepts is not None
        if self._sheet.visible != drawable:
            self._sheet.visible = drawable

    def _rows(self, state: AppState) -> list[ConceptRow]:
        """List the chosen machines, with numbers and pictures where they were compared."""
        rows: list[ConceptRow] = []
        for chosen in self._choice.machines:
            concept, picture = self._known(chosen)
            title = chosen.title
            if chosen.scene is None:  # another one may have been opened since
                present = state.scene if concept is None else concept.scene
                title = f"{present.title} (as it stands)"
            rows.append(ConceptRow(title, chosen.scene is not None, concept, picture))
        return rows

    def _known(self, chosen: Chosen) -> "tuple[Concept | None, str]":
        """Give numbers and picture of a machine, as far as there are any."""
        if self._answer is None:
            return None, ""
        for place, one in enumerate(self._compared.machines):
            if one.is_same(chosen):
                picture = self._pictures[place] if self._pictures else ""
                return self._answer.concepts[place], picture
        return None, ""

    def _note(self, state: AppState) -> str:
        """Say what is to be done next, or what went wrong."""
        if self._problem:
            return self._problem
        if len(self._choice.machines) < 2:
            return FEW
        if self._answer is None:
            return READY
        return "" if self._answer.question.covers(ask(state, self._choice)) else STALE
