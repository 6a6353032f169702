"""Machines side by side in a report: the numbers of the command, and what is refused."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from warpspace import load_scene
from warpspace.exceptions import OptionError, RenderError
from warpspace.outputs.report import ReportSettings, write_report
from warpspace.outputs.report.blocks import Picture, Table, Text
from warpspace.outputs.report.concepts import compare_with, concept_section
from warpspace.scene.concepts import ConceptPlan, compare_concepts
from warpspace.scene.model import Scene

SETTINGS = ReportSettings(spec_um=45.0, samples=20_000)
FIRST, *OTHERS = (
    load_scene(name) for name in ("dvf5000_first", "machine_trunnion_ac", "machine_scara")
)


class Painter:
    """Remembers what is to be drawn; draws nothing."""

    def __init__(self, problem: str = "") -> None:
        self.asked: list[tuple[Any, ...]] = []
        self._problem = problem

    def concepts(self, scenes: Sequence[Scene], *more: Any) -> Picture:
        if self._problem:
            raise RenderError(self._problem)
        self.asked.append((*scenes, *more))
        return Picture("concepts", "", b"", "svg")


def test_the_section_has_the_numbers_of_the_command() -> None:
    expected = compare_concepts(
        [FIRST, *OTHERS], ConceptPlan(45.0, samples=20_000), loop="relative"
    )
    found = compare_with([FIRST], OTHERS, SETTINGS)
    painter = Painter()
    words, table, picture = concept_section(found, painter, SETTINGS).blocks  # type: ignore[arg-type]
    assert isinstance(words, Text)
    assert "translation ±10 µm, rotation ±20 µrad, squareness ±25 µrad" in words.text
    assert "C has the smallest mean" in words.text
    assert isinstance(table, Table)
    assert [row[0] for row in table.rows] == ["A", "B", "C"]
    for row, concept in zip(table.rows, expected, strict=True):
        assert len(row) == len(table.columns)
        assert row[2] == str(concept.scene.machine.chain)
        assert float(row[3]) == pytest.approx(concept.sampled.mean_um, rel=5e-3)
        assert float(row[4]) == pytest.approx(concept.sampled.p95_um, rel=5e-3)
        assert concept.sampled.probability is not None
        assert row[6] == f"{100 * concept.sampled.probability.probability:.1f} %"
        assert row[7].startswith(concept.leading[0].key)
    assert isinstance(picture, Picture)
    assert len(painter.asked[0]) == 6


def test_a_picture_that_cannot_be_drawn_leaves_a_note() -> None:
    found = compare_with([FIRST], OTHERS[:1], ReportSettings(samples=1000))
    painter: Any = Painter("no OpenGL")
    *_, note = concept_section(found, painter, ReportSettings(samples=1000)).blocks
    assert isinstance(note, Text)
    assert "no OpenGL" in note.text


def test_too_many_machines_are_refused_before_anything_is_drawn(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="9 machines side by side; expected at most 8"):
        write_report([FIRST], tmp_path / "a.html", SETTINGS, concepts=[OTHERS[0]] * 8)
    assert list(tmp_path.iterdir()) == []
    assert compare_with([FIRST], (), SETTINGS) == ()
