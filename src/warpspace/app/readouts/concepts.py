"""Machines side by side as HTML: numbers, pictures in one scale, and what can be chosen."""

import base64
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from string import ascii_uppercase
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup
from PIL import Image, ImageChops

from warpspace.app.readouts.html import render, thousands
from warpspace.app.readouts.machine_editor import small_picture
from warpspace.app.readouts.summary import colour_stops
from warpspace.app.state.concept_choice import Chosen, ConceptChoice
from warpspace.geometry.colour import ColourScale
from warpspace.machine.limits import MOST_CONCEPTS
from warpspace.picture.words import LOOP_WORDS, tolerance_words
from warpspace.units import spell_short

if TYPE_CHECKING:
    from warpspace.analysis.concepts import Concept
    from warpspace.app.evaluation.concepts import Answer

Button = Callable[[str], Markup]
NUMBERS = {"mean": "mean_um", "P95": "p95_um", "max": "max_um"}
"""Word on a column to field of `MonteCarlo`."""
MARGIN_PX = 6  # paper that is kept above and below a picture


@dataclass(frozen=True, slots=True)
class Offer:
    """A machine that can be chosen."""

    word: str  # what its button sends
    chosen: Chosen
    chain: str


def offers_html(offers: Sequence[Offer], choice: ConceptChoice, button: Button) -> str:
    """Spell what can be chosen: machines of the library with their pictures, then other scenes."""
    return render(
        "concept_offers",
        offers=[
            (offer, small_picture(offer.chosen.picture) if offer.chosen.picture else "")
            for offer in offers
        ],
        held=choice.holds,
        most=MOST_CONCEPTS,
        count=len(choice.machines),
        button=button,
    )


@dataclass(frozen=True, slots=True)
class ConceptRow:
    """A chosen machine."""

    title: str
    opens: bool  # whether it can be opened: what is steered is open already
    concept: "Concept | None" = None  # its numbers; None before it is compared
    picture: str = ""  # A data address; empty before it is drawn


def concepts_html(
    rows: Sequence[ConceptRow], found: "Answer | None", note: str, button: Button
) -> str:
    """Spell the chosen machines side by side, as far as they are compared."""
    lettered = list(zip(ascii_uppercase, rows, strict=False))
    known = [row.concept for row in rows if row.concept is not None]
    best: dict[str, float] = {}
    for name in NUMBERS.values() if known else ():
        best[name] = min(float(getattr(concept.sampled, name)) for concept in known)
    return render(
        "concepts",
        rows=lettered,
        compared=[(letter, row.concept) for letter, row in lettered if row.concept is not None],
        numbers=NUMBERS,
        best=best,
        note=note,
        found=found,
        colours=colour_stops(diverging=False),
        about=[] if found is None else _about(found),
        drawn=any(row.picture for row in rows),
        ticks=[] if found is None else _ticks(found.scale),
        button=button,
    )


def _about(found: "Answer") -> list[str]:
    question, first = found.question, found.concepts[0]
    return [
        f"{thousands(first.sampled.plan.samples)} machines of each",
        "each within its own tolerances"
        if question.own_tolerances
        else tolerance_words(first.scene.tolerances),
        LOOP_WORDS[first.sampled.view.loop],
        "largest |E| of each" if question.over == "max" else "|E| at a random point of each",
    ]


def _ticks(scale: ColourScale) -> list[tuple[float, str]]:
    span = scale.high - scale.low
    return [(100.0 * (tick - scale.low) / span, spell_short(tick)) for tick in scale.ticks]


def cut_strip(png: bytes, count: int) -> list[str]:
    """Cut pictures that stand one below the other apart."""
    with Image.open(io.BytesIO(png)) as opened:
        strip = opened.convert("RGB")
    height = strip.height // count
    found: list[str] = []
    for index in range(count):
        cell = strip.crop((0, index * height, strip.width, (index + 1) * height))
        paper = Image.new("RGB", cell.size, cell.getpixel((0, 0)))
        ends = ImageChops.difference(cell, paper).getbbox()
        if ends is not None:
            top, bottom = np.clip([ends[1] - MARGIN_PX, ends[3] + MARGIN_PX], 0, height).tolist()
            cell = cell.crop((0, top, cell.width, bottom))
        buffer = io.BytesIO()
        cell.quantize(64).save(buffer, "PNG", optimize=True)
        found.append(f"data:image/png;base64,{base64.b64encode(buffer.getvalue()).decode()}")
    return found
