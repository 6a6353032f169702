"""The last parts of a report: conventions, and what it was made from and with."""

import hashlib
import platform
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from warpspace import __version__
from warpspace.outputs.report import sections as parts
from warpspace.outputs.report.blocks import Block, Code, Column, Items, Section, Text, table
from warpspace.outputs.report.clock import report_time
from warpspace.outputs.report.review import Review
from warpspace.outputs.report.wording import factor_words, reference_words
from warpspace.picture.words import convention_sentences, spell
from warpspace.scene.save import scene_to_toml


def conventions(review: Review) -> Section:
    """How to read signs, frames and factors."""
    items = [
        "Error = actual − nominal. Lengths in mm, errors in µm, small angles in µrad.",
        (
            "Right-handed machine frame R with the axis directions of ISO 841; parameters as in"
            " ISO 230-1 (EAX: rotation about x of the X axis; EC0Y: squareness of Y to X)."
        ),
        f"Loop: {review.settings.loop}. "
        + {
            "tool": "The tool point, actual minus nominal.",
            "workpiece": "The workpiece point, actual minus nominal.",
            "relative": "The tool point minus the workpiece point that nominally coincides.",
        }[review.settings.loop],
        *(
            parts.prefixed(letter, reference_words(reviewed.scene))
            for letter, reviewed in parts.letters(review)
        ),
        *_component_errors(review),
        f"In all pictures: {factor_words(review.exaggeration)}; the dashed box is nominal.",
        "First order in the errors; over a 5 × 5 × 5 grid the exact chain (full rotations, all"
        " products) differs by at most "
        + ", ".join(
            f"{spell(max(reviewed.linearisation_um, 0.0), 2)} µm"
            + (f" in {letter}" if letter else "")
            for letter, reviewed in parts.letters(review)
        )
        + ".",
        "Sampled machines have one constant value per error and point, drawn independently.",
    ]
    return parts.section("Conventions", [Items(tuple(items))])


def _component_errors(review: Review) -> list[str]:
    """Say where component errors act; of each scene where they differ."""
    found = [(letter, convention_sentences(one.scene)) for letter, one in parts.letters(review)]
    if len({sentences for _, sentences in found}) == 1:
        return list(found[0][1])
    return [parts.prefixed(letter, text) for letter, sentences in found for text in sentences]


def provenance(review: Review, files: Sequence[Path]) -> Section:
    """Tell what the report was made from and with."""
    settings = review.settings
    rows = [
        ("program", f"warpspace {__version__}"),
        ("made", report_time().strftime("%Y-%m-%d %H:%M UTC")),
        ("with", f"Python {platform.python_version()}, NumPy {np.__version__}"),
        ("grid", f"{settings.grid} nodes per axis"),
        ("loop", settings.loop),
        ("exaggeration", factor_words(review.exaggeration)),
        (
            "sampling",
            f"{settings.samples} machines, {settings.distribution}, seed {settings.seed}",
        ),
    ]
    texts = [scene_to_toml(reviewed.scene) for reviewed in review.scenes]
    for (letter, reviewed), text in zip(parts.letters(review), texts, strict=True):
        digest = hashlib.sha256(text.encode()).hexdigest()
        rows.append((parts.prefixed(letter, f"scene {reviewed.scene.name}"), f"SHA-256 {digest}"))
    for path in files:
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        rows.append((f"file {path.name}", f"SHA-256 {digest}"))
    blocks: list[Block] = [
        table("Program, settings and input.", [Column("what"), Column("value", width=3.2)], rows)
    ]
    for (letter, reviewed), text in zip(parts.letters(review), texts, strict=True):
        name = parts.prefixed(letter, f"{reviewed.scene.name}.toml")
        blocks += [
            Text(f"{name}, complete: saved as a file it is the scene of this report.", "heading"),
            Code(text),
        ]
    return parts.section("Provenance", blocks)
