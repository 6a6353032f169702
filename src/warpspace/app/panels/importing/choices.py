"""Widgets of what the files of an import do not say: format, axis, sign and variant."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from viser import GuiApi

from warpspace.app.browser.handles import Input
from warpspace.app.documents.import_offer import Offer, Said
from warpspace.formats.kind import CORRECTION, ERROR, Format
from warpspace.formats.registry import formats

TITLE = "What the files do not say"
SIGNS = {
    "as the manual says": "",
    "errors, which the controller takes back": ERROR,
    "corrections, which it adds": CORRECTION,
}


class ImportChoices:
    """A group of widgets, folded unless the files cannot be read without them.

    Parameters
    ----------
    gui : viser.GuiApi
    offer : Offer
        What is in the window first.
    changed : callable
        Called when a browser has changed one; it must only take note.
    """

    def __init__(self, gui: GuiApi, offer: Offer, changed: Callable[[], None]) -> None:
        self._said = said = offer.said
        self._formats = _format_words(offer.recognised)
        self._variants = _variant_words(offer.kind)

        def choice(label: str, words: Mapping[str, str], chosen: str, hint: str) -> Any:
            first = next((word for word, meant in words.items() if meant == chosen), None)
            return gui.add_dropdown(label, tuple(words), initial_value=first, hint=hint)

        with gui.add_folder(TITLE, expand_by_default=bool(offer.problem)):
            kind = choice(
                "Format",
                self._formats,
                said.format,
                "Structure of the files, where it is recognised wrongly or not at all.",
            )
            axes = gui.add_text(
                "Axis",
                said.axes,
                hint="X: the axis of files that name none. AX1=X: what a name in the files means;"
                " several with blanks between.",
            )
            self._sign = choice(
                "Sign", SIGNS, said.sign, "What the numbers of a controller's table are."
            )
            self._variant = choice(
                "Variant", self._variants, said.variant, "Published variant of the format."
            )
        self._kind: Input[str] = Input(kind, changed)
        self._axes: Input[str] = Input(axes, changed)
        self._signs: Input[str] = Input(self._sign, changed)
        self._chosen: Input[str] = Input(self._variant, changed)
        self.show(offer)

    def read(self) -> Said | None:
        """Give what is said now; None where nothing has changed since the last call."""
        said = self._said
        if (kind := self._kind.poll()) is not None:
            said = replace(said, format=self._formats.get(kind, ""))
        if (axes := self._axes.poll()) is not None:
            said = replace(said, axes=axes)
        if (sign := self._signs.poll()) is not None:
            said = replace(said, sign=SIGNS.get(sign, ""))
        if (variant := self._chosen.poll()) is not None:
            said = replace(said, variant=self._variants.get(variant, ""))
        if said == self._said:
            return None
        self._said = said
        return said

    def show(self, offer: Offer) -> None:
        """Offer what the format of the files has a choice of, and take back all else."""
        kind = offer.kind
        self._said = offer.said.fitting(kind)
        self._sign.visible = kind is not None and kind.tables is not None
        if not self._said.sign:
            self._signs.show(next(iter(SIGNS)))
        words = _variant_words(kind)
        self._variant.visible = len(words) > 1
        if words != self._variants:
            self._variants = words
            self._variant.options = tuple(words)
            self._chosen.show(next(iter(words)))


def _format_words(recognised: Format | None) -> dict[str, str]:
    """Give the names of the formats by the words that a user chooses from."""
    first = recognised.title if recognised is not None else "none, choose one"
    words = {f"recognised: {first}": ""}
    return words | {f"{one.name}: {one.title}": one.name for one in formats()}


def _variant_words(kind: Format | None) -> dict[str, str]:
    """Give the variants of a format by the words that a user chooses from."""
    names = kind.variants if kind is not None else ()
    return {"not told": ""} | {name: name for name in names}
