"""A scene written as TOML reloads to the identical scene."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from warpspace import load_scene, scene_names
from warpspace.machine import errors
from warpspace.machine.limits import MIN_HALF_WIDTH
from warpspace.scene.library import parse_scene
from warpspace.scene.scene_writer import scene_to_toml
from warpspace.scene.text_files import one_line

finite = st.floats(-1e3, 1e3, allow_subnormal=False)


@pytest.mark.parametrize("name", scene_names())
def test_every_bundled_scene_reloads_identically(name):
    scene = load_scene(name)
    assert parse_scene(scene_to_toml(scene), name) == scene


@given(
    title=st.text(max_size=60).map(one_line),
    value=finite,
    centre=finite,
    half=st.just(0.0) | st.floats(MIN_HALF_WIDTH, 1e3),
    rows=st.lists(st.tuples(finite, finite), min_size=1, max_size=20, unique_by=lambda row: row[0]),
    exaggeration=st.none() | st.floats(1e-3, 1e6),
)
def test_any_numbers_and_any_title_survive(title, value, centre, half, rows, exaggeration):
    scene = load_scene("dvf5000_nominal")
    x, c = scene.workspace.ranges["X"], scene.machine.axes["C"].travel
    changed = replace(
        scene,
        title=title or "untitled",
        description=f'{title}\nsecond line \\ " \'\'\' """',
        errors=errors.ErrorSet(
            {
                "EC0Y": errors.Constant(scene.workspace.ranges["Y"], value),
                "EAX": errors.Ramp(x, value),
                "EXX": errors.Poly(x, (value, 1e-7)),
                "EXC": errors.Harmonics(c, ((1.0, value, 90.0), (2.0, 0.1 + 0.2, 0.0))),
                "EYX": errors.TableCurve(x, tuple(sorted(rows))),
            }
        ),
        tolerances=errors.ToleranceSet(
            {"rotation": half},
            {"EAX": errors.Tolerance(centre, half), "EBX": errors.Tolerance(0.0, half)},
        ),
        exaggeration=exaggeration,
        reference={"X": value, "Y": 0.5, "Z": -280.0, "B": 0.0, "C": 0.0},
    )
    assert parse_scene(scene_to_toml(changed), scene.name) == changed


def test_errors_carry_symbol_name_and_unit_as_remarks():
    text = scene_to_toml(load_scene("dvf5000_first"))
    assert "EAX = { ramp = 5.5 }  # ε_xX, roll of X, µrad" in text
    assert 'machine = "dvf5000"' in text
