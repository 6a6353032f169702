"""A kind of error curve that a plug-in adds appears wherever curves appear."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
import pytest

from warpspace.app.documents.scene_file import open_text, state_to_toml
from warpspace.app.state.app_state import start_state
from warpspace.app.state.curve_text import convert_shape, kind_titles, parse_shape, spell_rows
from warpspace.app.state.edits import with_curve
from warpspace.exceptions import OptionError, SceneError
from warpspace.machine.curves.curve import ErrorFunction, Rows, Span, Spell
from warpspace.machine.curves.reading import ValueReader
from warpspace.machine.curves.registry import curve_kinds, register_curve, unregister_curve
from warpspace.machine.curves.rows import single_value
from warpspace.machine.errors import Constant, Poly, Table
from warpspace.outputs.drawing.sheet import parameter_words
from warpspace.outputs.report.wording import spell_function
from warpspace.scene.library import load_scene, parse_scene
from warpspace.scene.pipeline import evaluate
from warpspace.scene.save import scene_to_toml
from warpspace.units import Array

SPAN = (-275.0, 275.0)
SCENE = 'machine = "dvf5000"\n[errors]\nEYX = { half_sine = 4.0 }\n'


@dataclass(frozen=True)
class HalfSine(ErrorFunction):
    """Zero at both ends of the span, the value in the middle."""

    name: ClassVar[str] = "half_sine"
    title: ClassVar[str] = "half sine"
    forms: ClassVar[tuple[tuple[str, ...], ...]] = (("half_sine",),)
    row_words: ClassVar[str] = "one number: the value in the middle"
    value: float = 0.0

    def evaluate(self, position: Array) -> Array:
        low, high = self.span
        return self.value * np.sin(np.pi * (np.asarray(position, dtype=float) - low) / (high - low))

    def scaled(self, factor: float) -> Self:
        return replace(self, value=factor * self.value)

    @classmethod
    def read(cls, raw: Any, span: Span, reader: ValueReader) -> Self:
        return cls(span, reader.number(raw["half_sine"], ("half_sine",), -1e5, 1e5))

    def to_toml(self) -> object:
        return {"half_sine": self.value}

    def for_span(self, span: Span) -> ErrorFunction:
        return self if span == self.span else Table.from_curve(self, self.span)

    def describe(self, unit: str, value: Spell, position: Spell) -> str:
        return f"half sine of {value(self.value)} {unit} in the middle"

    @classmethod
    def from_rows(cls, span: Span, rows: Rows) -> Self:
        return cls(span, single_value(rows))

    def rows(self) -> Rows:
        return [[self.value]]

    @classmethod
    def from_curve(cls, present: ErrorFunction, span: Span) -> Self:
        return cls(span, present.amplitude)


@pytest.fixture(autouse=True)
def half_sine() -> Iterator[None]:
    register_curve(HalfSine)
    yield
    unregister_curve("half_sine")


def test_a_scene_file_with_it_loads_evaluates_saves_and_reloads() -> None:
    scene = parse_scene(SCENE, "mine")
    assert scene.errors.functions == {"EYX": HalfSine(SPAN, 4.0)}
    field = evaluate(scene, at={"X": [-275.0, 0.0], "Y": 0.0, "Z": -280.0})
    np.testing.assert_allclose(field.error_um[..., 1].ravel(), [0.0, 4.0], atol=1e-12)
    text = scene_to_toml(scene)
    assert "EYX = { half_sine = 4.0 }" in text
    assert parse_scene(text, "mine") == scene


def test_a_bad_value_and_a_misspelled_key_are_refused_like_those_of_bundled_kinds() -> None:
    with pytest.raises(SceneError, match=r'errors\.EYX\.half_sine = "a": expected a number'):
        parse_scene(SCENE.replace("4.0", '"a"'), "mine")
    with pytest.raises(SceneError, match=r"\{ csv = , column = \}, .*\{ half_sine = \}"):
        parse_scene(SCENE.replace("half_sine", "halfsine"), "mine")
    with pytest.raises(SceneError, match=r"EC0Y = .*is constant along its axis"):
        parse_scene(SCENE.replace("EYX", "EC0Y"), "mine")


def test_a_curve_over_another_range_is_saved_as_one_with_the_same_values() -> None:
    scene = parse_scene(SCENE, "mine")
    narrow = {**scene.workspace.ranges, "X": (-100.0, 100.0)}
    moved = replace(scene, workspace=replace(scene.workspace, ranges=narrow))
    saved = parse_scene(scene_to_toml(moved), "mine").errors
    assert saved.evaluate("EYX", np.array([0.0])).tolist() == [4.0]


def test_the_app_offers_reads_converts_and_stores_it() -> None:
    assert kind_titles()[-1] == "half sine"
    curve = parse_shape("half sine", "2.5  # in the middle", SPAN)
    assert curve == HalfSine(SPAN, 2.5)
    assert spell_rows(curve) == "2.5"
    with pytest.raises(OptionError, match="one number: the value in the middle"):
        parse_shape("half sine", "", SPAN)
    assert convert_shape(Constant(SPAN, 7.0), "half sine", SPAN) == HalfSine(SPAN, 7.0)
    assert isinstance(convert_shape(curve, "polynomial", SPAN), Poly)
    assert "half_sine along X" in curve.slider_words("X")
    state = with_curve(start_state(load_scene("dvf5000_first"), nodes=3), "EYX", curve)
    back, _ = open_text(state_to_toml(state), "dvf5000_first", "x.toml")
    assert back.scene.errors.functions["EYX"] == curve


def test_reports_and_figures_have_its_words() -> None:
    scene = parse_scene(SCENE, "mine")
    words = spell_function(scene.errors.functions["EYX"], "µm")
    assert words == "half sine of 4.00 µm in the middle"
    assert parameter_words(scene) == ["EYX 4 µm half_sine"]


def test_names_titles_and_keys_of_others_are_refused() -> None:
    with pytest.raises(OptionError, match="'half_sine' is there already"):
        register_curve(HalfSine)
    assert curve_kinds().count(HalfSine) == 1
