"""The window in which machines are chosen: the library, the present machine, scenes of the page."""

from collections.abc import Callable
from typing import Any

from warpspace.app.browser.clicks import Clicks
from warpspace.app.browser.handles import Handle
from warpspace.app.evaluation.machine_edits.library import machine_types
from warpspace.app.panels.context import PanelContext
from warpspace.app.readouts.concepts import Offer, offers_html
from warpspace.app.state.concept_choice import PRESENT, Chosen, ConceptChoice

VERB = "choose"
MOST_OFFERS = 200
"""Scenes that are offered."""


class ConceptWindow:
    """A window with a button for each machine that can be chosen.

    Parameters
    ----------
    context : PanelContext
    clicks : Clicks
        Carries the words of the buttons.
    choose : callable
        Gets the choice as a click has changed it.
    """

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
        """Spell the offers."""
        return offers_html(self._offers, choice, self._clicks.button)

    def _find(self) -> tuple[Offer, ...]:
        """List what can be chosen: each scene once."""
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
