"""What files of measured data would bring to a scene, with what a user says of them."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

from warpspace.exceptions import UnsaidError, WarpspaceError
from warpspace.formats.importing import Reading, read_errors
from warpspace.formats.kind import SIGNS, Format, ReadOptions, parse_axis_options
from warpspace.formats.registry import find_format, recognise
from warpspace.formats.source import Source
from warpspace.formats.to_scene import ImportedScene, into_scene
from warpspace.scene.model import Scene

LONGEST_AXES = 200
"""Characters of what is said of axes."""
LONGEST_PROBLEM = 1500
"""Characters of a message in the window."""


@dataclass(frozen=True)
class Said:
    """What a user says of files that they do not say themselves, as the command's options.

    Attributes
    ----------
    format : str
        Name of a format; empty for the one recognised.
    axes : str
        ``X`` or ``AX1=X``, several with blanks or commas between.
    sign : str
        "error", "correction", or empty for what the manual says.
    variant : str
        Published variant of the format; empty for the usual one.
    """

    format: str = ""
    axes: str = ""
    sign: str = ""
    variant: str = ""

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
    """Files, what is said of them, and what they would bring.

    Attributes
    ----------
    sources : tuple of Source
    said : Said
    recognised : Format or None
        What the files are by themselves.
    reading : Reading or None
        The last one that was possible; None before the first.
    made : ImportedScene or None
        The scene with it.
    problem : str
        Why the files cannot be read with what is said now; empty where they can.
    """

    sources: tuple[Source, ...]
    said: Said = Said()
    recognised: Format | None = None
    reading: Reading | None = None
    made: ImportedScene | None = None
    problem: str = ""

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
    """Read files into a scene.

    Parameters
    ----------
    sources : sequence of Source
    base : Scene
    said : Said, optional

    Returns
    -------
    Offer

    Raises
    ------
    WarpspaceError
        If they cannot be read; an `UnsaidError` where the user may say more of them.
    """
    return _read(Offer(tuple(sources), said, _recognised(sources)), base)


def asking(sources: Sequence[Source], error: UnsaidError) -> Offer:
    """Give files that cannot be read before their user says more of them."""
    return Offer(tuple(sources), Said(), _recognised(sources), problem=_clamped(error))


def said_again(offer: Offer, said: Said, base: Scene) -> Offer:
    """Read files again as a user says now; the last reading stays where that is not possible.

    Parameters
    ----------
    offer : Offer
    said : Said
        As a browser sends it.
    base : Scene

    Returns
    -------
    Offer
    """
    try:
        chosen = replace(offer, said=said)
        return _read(replace(chosen, said=said.fitting(chosen.kind)), base)
    except WarpspaceError as error:
        return replace(offer, said=said, problem=_clamped(error))


def _read(offer: Offer, base: Scene) -> Offer:
    """Read the files of an offer as it says."""
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
    """Spell a message that a window can show."""
    text = str(error)
    return text if len(text) <= LONGEST_PROBLEM else text[: LONGEST_PROBLEM - 1] + "…"
