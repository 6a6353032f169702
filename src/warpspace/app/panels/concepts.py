"""The tab "Concepts": machines within the same tolerances side by side."""

import threading
import time
from collections.abc import Callable
from functools import partial
from math import exp
from typing import TYPE_CHECKING, Any

from warpspace.app.browser.clicks import Clicks
from warpspace.app.browser.handles import Handle, Input
from warpspace.app.documents.services import ConceptRequest, Progress
from warpspace.app.evaluation.concepts import Answer, Question, answer, ask
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine_edits import machine_types
from warpspace.app.panels.context import PanelContext
from warpspace.app.panels.job_part import JobPart
from warpspace.app.readouts.concepts import ConceptRow, Offer, concepts_html, cut_strip, offers_html
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.state.concept_choice import (
    LIMIT_UM,
    LOOPS,
    OVERS,
    PRESENT,
    TOLERANCES,
    Chosen,
    ConceptChoice,
)

if TYPE_CHECKING:
    from warpspace.analysis.concepts import Concept


# --- Comparing and drawing beside the session: a progress bar and a way to cancel -----------------

COMPARING, SHEET = "Comparing machines", "Sheet of all machines"
SAMPLED = 45.0  # per cent of the bar when all machines are sampled; the rest are pictures
STRIP_PX = (480, 340)
"""Size of each picture; it is shown about half as large, sharp on fine screens too."""
DRAWING_S, SHEET_S = 6.0, 8.0
"""How long pictures usually take."""


class ConceptWork:
    """One comparison or one sheet at a time."""

    def __init__(
        self,
        context: PanelContext,
        found: "Callable[[Answer, ConceptChoice], None]",
        drawn: Callable[[Answer, list[str]], None],
        failed: Callable[[str, str], None],
    ) -> None:
        self._context, self._found, self._drawn = context, found, drawn
        self._share, self._drawing_since = 0.0, 0.0
        self._job = JobPart(
            context,
            failed,
            "Give it up; what was shown stays.",
            lambda progress: "Sampling machines …" if self._samples(progress) else "Drawing …",
            self._percent,
            "What was shown stays.",
        )

    def compare(self, question: Question, choice: "ConceptChoice", *, dark: bool) -> bool:
        """Compare machines, then draw them; False where something runs already."""
        draw = self._context.services.draw_concepts

        def progress(share: float) -> None:
            self._share = share

        def work(cancelled: threading.Event) -> None:
            found = answer(question, cancelled, progress)
            if found is None or cancelled.is_set():
                return
            self._context.act(partial(self._found, found, choice))
            if draw is None:
                return
            self._drawing_since = time.monotonic()
            strip = draw(_request(question, dark, STRIP_PX), cancelled)
            pictures = cut_strip(strip, len(question.scenes))
            if not cancelled.is_set():
                self._context.act(partial(self._drawn, found, pictures))

        self._share, self._drawing_since = 0.0, 0.0
        return self._job.start(COMPARING, work, DRAWING_S)

    def draw_sheet(self, question: Question, *, dark: bool) -> bool:
        """Draw one sheet and have the browser save it; False where something runs already."""
        draw, client = self._context.services.draw_concepts, self._context.client
        if draw is None:
            return True

        def work(cancelled: threading.Event) -> None:
            content = draw(_request(question, dark), cancelled)
            if not cancelled.is_set():
                client.send_file_download("concepts.png", content, save_immediately=True)
                client.flush()

        return self._job.start(SHEET, work, SHEET_S)

    def _samples(self, progress: Progress) -> bool:
        return progress.name == COMPARING and not self._drawing_since

    def _percent(self, progress: Progress) -> float:
        """Put sampling, which counts its machines, and drawing, which does not, on one bar."""
        if progress.name != COMPARING:
            return progress.percent
        if self._samples(progress):
            return SAMPLED * min(self._share, 1.0)
        drawn = 1.0 - exp(-(time.monotonic() - self._drawing_since) / DRAWING_S)
        return SAMPLED + (100.0 - SAMPLED) * drawn


def _request(
    question: Question, dark: bool, strip_px: tuple[int, int] | None = None
) -> ConceptRequest:
    return ConceptRequest(question.scenes, question.plan(), question.loop, dark, strip_px)


# --- The window in which machines are chosen ------------------------------------------------------
# The library, the present machine, scenes of the page.

VERB = "choose"
MOST_OFFERS = 200  # scenes that are offered


class ConceptWindow:
    """A window with a button for each machine that can be chosen."""

    def __init__(
        self, context: PanelContext, clicks: Clicks, choose: Callable[[ConceptChoice], None]
    ) -> None:
        self._context, self._clicks, self._choose = context, clicks, choose
        self._window: Any = None
        self._list: Handle | None = None
        self._offers: tuple[Offer, ...] = ()

    def toggle(self, choice: ConceptChoice) -> None:
        """Show the machines, or close the window."""
        opened, self._window, self._list = self._window, None, None
        if opened is not None:
            opened.close()
            return
        gui = self._context.gui
        self._offers = self._find()
        self._window = gui.add_modal("Machines to compare")
        with self._window:
            self._list = Handle(gui.add_html(self._html(choice)))
            close = gui.add_button("Done", hint="Close this window.")
            close.on_click(lambda _: self._context.act(lambda: self.toggle(choice)))

    def take(self, word: str, choice: ConceptChoice) -> bool:
        """Choose what a word says; tell whether it was one of this window's, whatever it says."""
        if word.partition(" ")[0] != VERB:
            return False
        found = next((offer for offer in self._offers if offer.word == word), None)
        if found is not None:
            changed = choice.toggled(found.chosen)
            if changed is choice or changed == choice:
                most = len(choice.machines)
                self._context.notify("Concepts", f"At most {most} machines at once.", "yellow")
            if self._list is not None:
                self._list.put(content=self._html(changed))
            self._choose(changed)
        return True

    def _html(self, choice: ConceptChoice) -> str:
        return offers_html(self._offers, choice, self._clicks.button)

    def _find(self) -> tuple[Offer, ...]:
        found = [Chosen(entry.title, entry.scene, entry.name) for entry in machine_types()]
        found.append(Chosen(PRESENT.capitalize()))
        for title, scene in self._context.scenes.items():
            chosen = Chosen(title, scene)
            if not any(chosen.is_same(other) for other in found):
                found.append(chosen)
        present = self._context.store.state.scene
        return tuple(
            Offer(
                f"{VERB} {number}",
                chosen,
                str((present if chosen.scene is None else chosen.scene).machine.chain),
            )
            for number, chosen in enumerate(found[:MOST_OFFERS])
        )


# --- The concepts panel: machines to choose, how they are compared, and the outcome ---------------

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
                "The largest |E| of each sampled machine over the working volume, or |E| at a"
                " random point.",
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
        self._context.act(self._take_settings)

    def _take_settings(self) -> None:
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
        self._take_settings()
        if len(self._choice.machines) < 2:
            self._context.notify("Concepts", "Choose two machines or more.", "yellow")
            return
        state = self._context.store.state
        dark = state.shown.dark
        if not self._work.compare(ask(state, self._choice), self._choice, dark=dark):
            self._context.notify("Busy", "Machines are being compared already.", "gray")

    def _take(self, found: "Answer", choice: ConceptChoice) -> None:
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
        if self._answer is not None:
            dark = self._context.store.state.shown.dark
            if not self._work.draw_sheet(self._answer.question, dark=dark):
                self._context.notify("Busy", "Wait for the comparison, or cancel it.", "gray")

    def _failed(self, _name: str, words: str) -> None:
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
        if self._answer is None:
            return None, ""
        for place, one in enumerate(self._compared.machines):
            if one.is_same(chosen):
                picture = self._pictures[place] if self._pictures else ""
                return self._answer.concepts[place], picture
        return None, ""

    def _note(self, state: AppState) -> str:
        if self._problem:
            return self._problem
        if len(self._choice.machines) < 2:
            return FEW
        if self._answer is None:
            return READY
        return "" if self._answer.question.covers(ask(state, self._choice)) else STALE
