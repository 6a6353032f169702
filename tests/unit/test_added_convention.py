"""A convention that a plug-in adds appears wherever conventions appear, and is consistent."""

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
from markupsafe import Markup

from chains import central_differences
from warpspace.app.documents.scene_file import open_text, state_to_toml
from warpspace.app.evaluation.conventions import Effects, choices, chosen, with_choice
from warpspace.app.readouts.conventions import conventions_html
from warpspace.app.state.app_state import start_state
from warpspace.exceptions import OptionError, SceneError, UnknownNameError
from warpspace.kinematics.chain import nominal_point
from warpspace.kinematics.conventions.convention import AxisFrames, Convention
from warpspace.kinematics.conventions.registry import (
    convention_names,
    register_convention,
    unregister_convention,
)
from warpspace.kinematics.firstorder import jacobian
from warpspace.kinematics.model import Loop, Model
from warpspace.machine.parameters import Parameter
from warpspace.outputs.report import closing
from warpspace.scene.library import load_scene, parse_scene
from warpspace.scene.pipeline import evaluate
from warpspace.scene.save import scene_to_toml
from warpspace.units import Array

SCENE = 'machine = "dvf5000"\n[convention]\ncomponent_errors = "split"\n[errors]\nEXC = 3.0\n'


class Split(Convention):
    """``Trans(δ) · Motion · Rot(ε)``: shifts in fixed directions, turns on the moving body."""

    name: ClassVar[str] = "split"
    title: ClassVar[str] = "shifts before, turns after motion"
    place: ClassVar[str] = "on both sides of the motion"
    meaning: ClassVar[str] = "shift in fixed directions and turn with the moving body"

    def factors(
        self, constant: Array | None, motion: Array, component: Array | None
    ) -> tuple[Array | None, ...]:
        if component is None:
            return constant, motion
        shift, turn = component.copy(), component.copy()
        shift[..., :3, :3] = np.eye(3)
        turn[..., :3, 3] = 0.0
        return constant, shift, motion, turn

    def frame(self, frames: AxisFrames, row: Parameter) -> Array:
        after = row.is_rotation and not row.is_constant
        return frames.after if after else frames.before


@pytest.fixture(autouse=True)
def split() -> Iterator[None]:
    register_convention(Split())
    yield
    unregister_convention("split")


@pytest.mark.parametrize("loop", Loop)
def test_first_order_is_the_derivative_of_the_exact_chain(loop: Loop) -> None:
    model = replace(load_scene("dvf5000_first").model, component_errors="split")
    coordinates = {
        axis: np.asarray(value)
        for axis, value in {"X": 120.0, "Y": -80.0, "Z": -200.0, "B": -35.0, "C": 70.0}.items()
    }
    point = nominal_point(model, loop, coordinates)
    keys = model.machine.allowed_keys
    found = jacobian(model, loop, keys, coordinates, point)
    expected = central_differences(model, loop, keys, coordinates, point)
    for ours, theirs in zip(found, expected, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-6)


def test_it_is_neither_of_the_bundled_conventions() -> None:
    model = load_scene("dvf5000_first").model
    at = {name: np.asarray(40.0) for name in model.machine.axes}
    point, keys = np.array([100.0, 50.0, 200.0]), ("EXC", "EAC")
    shift, turn = (
        {
            name: jacobian(replace(model, component_errors=name), Loop.WORKPIECE, keys, at, point)[
                0
            ][index].tolist()
            for name in convention_names()
        }
        for index in (0, 1)
    )
    assert shift["split"] == shift["before_motion"] != shift["after_motion"]
    assert turn["split"] == turn["after_motion"] != turn["before_motion"]


def test_a_scene_file_with_it_loads_evaluates_saves_and_reloads() -> None:
    scene = parse_scene(SCENE, "mine")
    assert scene.model.component_errors == "split"
    at = {"X": 0.0, "Y": 0.0, "Z": -280.0, "C": 90.0}
    first, exact = (
        evaluate(scene, loop="workpiece", at=at, exact=exact) for exact in (False, True)
    )
    np.testing.assert_allclose(first.error_um, exact.error_um, atol=1e-6)
    assert parse_scene(scene_to_toml(scene), "mine") == scene


def test_an_unknown_one_is_refused_with_all_names() -> None:
    expected = '"after_motion", "before_motion" or "split"'
    with pytest.raises(SceneError, match=f'component_errors = "splt": expected {expected}'):
        parse_scene(SCENE.replace("split", "splt"), "mine")
    model = Model(load_scene("dvf5000_first").machine, "splt")
    with pytest.raises(UnknownNameError, match="did you mean 'split'"):
        model.convention("X")
    with pytest.raises(OptionError, match="'split' is there already"):
        register_convention(Split())


def test_the_app_offers_it_says_what_it_changes_and_stores_it() -> None:
    fixed = scene_to_toml(load_scene("dvf5000_first")).replace("after_motion", "before_motion")
    start = start_state(parse_scene(fixed, "dvf5000_first"), nodes=3)
    assert "component_errors=split" in choices(start)
    state = with_choice(start, "component_errors=split")
    assert "component_errors=split" in chosen(state)
    assert Effects().of(state)["component_errors=split"].max_um > 0.0
    text = conventions_html(state, {}, lambda word, role: Markup())
    assert 'data-choice="component_errors=split" aria-checked="true"' in text
    assert "shifts before, turns after motion" in text
    back, _ = open_text(state_to_toml(state), "dvf5000_first", "x.toml")
    assert back.scene.model == state.scene.model


def test_reports_have_its_words() -> None:
    reviewed = SimpleNamespace(scene=parse_scene(SCENE, "mine"), linearisation_um=0.0)
    settings = SimpleNamespace(loop="tool")
    review = SimpleNamespace(scenes=(reviewed,), settings=settings, exaggeration=1000.0)
    assert (
        "Component errors shift in fixed directions and turn with the moving body"
        " (on both sides of the motion)."
    ) in str(closing.conventions(review))
