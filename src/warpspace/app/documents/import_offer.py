"""What files of measured data would bring to a scene, with what a user says of them."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

from warpspace.exceptions import UnsaidError, WarpspaceError
from warpspace.formats.registry import (
    SIGNS,
    Format,
    Reading,
    ReadOptions,
    find_format,
    parse_axis_options,
    read_errors,
    recognise,
)
from warpspace.formats.source import Source
from warpspace.formats.to_scene import ImportedScene, into_scene
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
