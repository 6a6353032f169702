"""Writes every format of a control for scenes with hostile titles: no line more, all printable."""

import random
import sys
import unicodedata
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache

from reliability.outcome import Outcome
from warpspace.formats.compensation.compensate import table_points
from warpspace.formats.compensation.corrections import RequiredCorrections, build_corrector
from warpspace.formats.registry import formats
from warpspace.parts.program import Program
from warpspace.scene.library import load_scene
from warpspace.scene.model import Scene

CONTROLS = [
    character
    for character in map(chr, range(sys.maxunicode + 1))
    if unicodedata.category(character) in {"Cc", "Cf", "Zl", "Zp"}
]
"""C0, C1, DEL, ends of lines and paragraphs, direction of writing and other marks of a format."""
DELIMITERS = [*"()[]{};#%$*/\\\"'", "//", "*/", "\\\n", "\r\n", "\u00c5", "\uff1b", "\udc85"]
HOSTILE = [*CONTROLS, *DELIMITERS]
WORDS = "G91 G0 Z-300"  # what must not stand at the beginning of a line
COUNT_NODES = 3


@cache
def writers() -> Mapping[str, Callable[[str], Mapping[str, str]]]:
    """Give what writes the files of each format for a scene with a title."""
    scene = load_scene("dvf5000_first")
    corrector = build_corrector(scene, "tool")
    found: dict[str, Callable[[str], Mapping[str, str]]] = {}
    for kind in formats():
        if kind.write is None:
            continue
        points = table_points(kind, scene, COUNT_NODES)
        wanted = RequiredCorrections(scene, corrector, points)
        found[kind.name] = lambda title, kind=kind, wanted=wanted: kind.write(
            replace(wanted, scene=replace(wanted.scene, title=title))
        )
    found["program"] = lambda title: _corrected(replace(scene, title=title))
    return found


def _corrected(scene: Scene) -> Mapping[str, str]:
    text = "G0 X0 Y0 Z-100\nG1 X10 F100 (a\u2028b)\nM30\n"
    return Program(file="p.ngc", text=text).run(scene, lambda _: None).texts()


@cache
def _plain(name: str) -> Mapping[str, str]:
    return writers()[name]("title")


def fault_of(name: str, hostile: str) -> str:
    """Say what is wrong with the files that a format writes for a title; nothing where none is."""
    plain, written = _plain(name), writers()[name](f"{hostile}{WORDS}{hostile}")
    for added, text in written.items():
        lines, expected = text.splitlines(), plain[added].splitlines()
        if len(lines) != len(expected):
            return f"{len(lines)} lines in {added!r}, {len(expected)} with another title"
        changed = [at for at, line in enumerate(lines) if line != expected[at]]
        if len(changed) > 1:
            return f"lines {changed} of {added!r} differ"
        for line in (lines[at] for at in changed):
            bare = line.removeprefix(expected[changed[0]].partition("title")[0]).removesuffix(")")
            if not (line.isascii() and line.isprintable()) or {*bare} & {*"();#%*\\"}:
                return f"{added!r} holds {line!r}"
            if line.startswith((WORDS, f" {WORDS}")):
                return f"{added!r} begins a line with {WORDS}"
    return ""


def run(count: int, seed: int = 14) -> Outcome:
    """Write titles with each hostile character in every format, in random order."""
    pairs = [(name, hostile) for name in writers() for hostile in HOSTILE]
    random.Random(seed).shuffle(pairs)
    faults = [
        f"{name}, {hostile!r}: {fault}"
        for name, hostile in pairs[:count]
        if (fault := fault_of(name, hostile))
    ]
    done = min(count, len(pairs))
    return Outcome(done, f"{len(HOSTILE)} characters in {len(writers())} formats", faults)
