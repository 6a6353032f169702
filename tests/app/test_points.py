"""Points in both coordinates, typed or worst, with the numbers of the command line."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from markupsafe import Markup

from warpspace.app.documents.scene_file import open_link, open_text, state_to_link, state_to_toml
from warpspace.app.evaluation.budget import answer, pick_worst, with_picked
from warpspace.app.evaluation.compare import with_pin
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.machine import standing
from warpspace.app.readouts.budget import answer_html, field_html
from warpspace.app.readouts.circles import circle_rows, circle_table
from warpspace.app.readouts.comparison import comparison_html
from warpspace.app.readouts.conventions import conventions_html
from warpspace.app.readouts.places import spell_slice, tool_point_html
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.state.edits import with_excluded
from warpspace.app.state.history import History
from warpspace.app.state.picked import Picked
from warpspace.app.state.typed_point import LONGEST, read_positions, with_typed_point
from warpspace.cli.commands.field import field
from warpspace.picture.coordinates import spell_at, spell_axes, spell_point
from warpspace.scene.library import load_scene

LIVE = LiveModel()
FIRST = load_scene("dvf5000_first")
START = start_state(FIRST)
WORST = {"X": 275.0, "Y": -225.0, "Z": -480.0}
PLACE = "axes X 275 Y −225 Z −480 · in R x 275 y −225 z −51"
AT = "X=275,Y=-225,Z=-480,B=0,C=0"


def field_at(at: str, *more: str, scene: str = "dvf5000_first") -> dict:
    """What `warpspace field --at` gives for a point."""
    found = CliRunner().invoke(field, [scene, "--at", at, "--json", *more])
    assert found.exit_code == 0, found.output
    return json.loads(found.stdout)["points"][0]


def answered(state: AppState) -> tuple[np.ndarray, np.ndarray, dict[str, float]]:
    """Exact error (µm), nominal point (mm) and axis positions of the point asked about."""
    assert state.picked is not None
    found = answer(state, state.picked, 1.0)
    return found.explanation.error_um, found.explanation.nominal_mm, dict(found.at)


def test_a_point_is_spelt_in_both_coordinates() -> None:
    axes = {**WORST, "B": 0.0, "C": 0.0}
    assert spell_point(axes, (275.0, -225.0, -51.0)) == PLACE
    assert spell_at(axes) == AT
    assert spell_axes({**axes, "B": -30.0}) == "axes X 275 Y −225 Z −480 B −30°"
    assert spell_axes({"B": 0.0, "C": 12.34}) == "axes B 0° C 12.3°"
    assert spell_point({}, (0.0, -0.04, 2.5)) == "in R x 0 y 0 z 2.5"
    assert spell_at({"C": -1e-9, "X": 1.25, "Y": 1.0 / 3.0}) == "X=1.25,Y=0.333333,C=0"


@pytest.mark.parametrize(
    "text",
    [
        "X 275 Y -225 Z -480",
        "X=275,Y=-225,Z=-480",
        "x275y-225z-480",
        "X: 275 mm; Y: −225 mm; Z: −480 mm",
        "X 2.75e2, Y -225,0, Z -480.",
        PLACE,
        f"--at {AT}",
        "  axes X +275   Y −225 Z −480 B 0° C 0° ",
    ],
)
def test_a_point_is_read_in_every_way_it_is_spelt(text: str) -> None:
    found = read_positions(text)
    assert found is not None
    assert {axis: found[axis] for axis in "XYZ"} == WORST
    assert with_typed_point(START, text).picked == Picked(WORST)
    assert with_typed_point(START, text).notes == ()


@pytest.mark.parametrize(
    "text", ["X", "275", "X 1 X 2", "X nan", "X 1e999", "X 1 2", "<b>", "X=1,Q=2", "A 5", "X - 5"]
)
def test_what_is_no_point_changes_nothing_and_is_said(text: str) -> None:
    asked = with_typed_point(START, "X 1")
    state = with_typed_point(asked, text)
    assert state.without_notes() == asked
    (note,) = state.notes
    assert "expected positions of the axes X, Y, Z, B, C, for instance X 275" in note


@given(st.text(max_size=2 * LONGEST))
def test_any_text_is_read_or_refused(text: str) -> None:
    state = with_typed_point(START, text)
    assert state.picked is None or all(map(np.isfinite, state.picked.at.values()))


@given(
    st.fixed_dictionaries(
        {axis: st.floats(-400.0, 400.0) for axis in "XYZ"} | {"B": st.floats(-90.0, 90.0)}
    )
)
def test_what_is_copied_is_read_back(at: dict[str, float]) -> None:
    found = read_positions(spell_at(at))
    assert found is not None
    assert found == pytest.approx(at, abs=1e-6)


def test_a_typed_point_is_clamped_to_the_travel_and_said() -> None:
    travel = FIRST.machine.axes["X"].travel
    state = with_typed_point(START, "X 1e5 B 500")
    assert state.picked is not None
    assert state.picked.at["X"] == travel[1]
    assert state.positions["B"] == START.position_spans["B"].high
    assert len(state.notes) == 2
    assert "X = 100000 mm is outside the travel" in " ".join(state.notes)
    middle = FIRST.workspace.positions
    assert (state.picked.at["Y"], state.picked.at["Z"]) == (middle["Y"], middle["Z"])
    moved = with_typed_point(state.without_notes(), "Z -300")
    assert moved.picked is not None
    assert moved.picked.at == {**state.picked.at, "Z": -300.0}
    assert with_typed_point(moved, "  ").picked is None


@pytest.mark.parametrize("at", [AT, "X=0,Y=0,Z=-280,B=-30,C=45", "X=-275,Y=225,Z=-80"])
def test_a_typed_point_has_the_error_of_the_command_line(at: str) -> None:
    found = field_at(at, "--exact")
    error, point, axes = answered(with_typed_point(START, at))
    np.testing.assert_allclose(error, found["error_um"], atol=1e-9)
    np.testing.assert_allclose(point, found["nominal_mm"], atol=1e-9)
    assert axes == pytest.approx(found["axes"])


@pytest.mark.parametrize("scene", ["dvf5000_first", "dvf5000_second", "teach_wobbling_table"])
def test_what_is_copied_at_the_worst_point_gives_its_error_on_the_command_line(scene: str) -> None:
    picture = LIVE.evaluate(start_state(load_scene(scene)))
    found = picture.statistics
    at = spell_at(found.max_at_axes)
    loop = picture.state.loop.value
    there = field_at(at, "--loop", loop, scene=scene)
    assert there["norm_um"] == pytest.approx(found.max_um)
    if scene == "dvf5000_first":
        assert at == AT
        assert found.max_um == pytest.approx(51.7, abs=0.05)


def test_the_worst_point_is_asked_about_undone_linked_and_saved() -> None:
    picture = LIVE.evaluate(START)
    picked = pick_worst(picture)
    assert picked == Picked(WORST)
    history = History(START).push(with_picked(START, picked), 0.0)
    assert history.undo().present.picked is None
    typed = with_typed_point(history.present, "X 1.25 Y -2 B 10")
    assert open_link(state_to_link(typed, None, [FIRST]), [FIRST])[0] == typed
    assert open_text(state_to_toml(typed), "dvf5000_first", "x.toml")[0].picked == typed.picked


def test_the_budget_has_both_coordinates_and_buttons_of_each_row() -> None:
    state = with_excluded(with_picked(START, Picked(WORST)), "EAX", True)
    found = answer(state, Picked(WORST), 1.0)

    def spell(word: str) -> Markup:
        return Markup(f'data-word="{word}"')

    text = answer_html(found, "EA0Z", spell, spell, state.exclusions.excluded)
    assert f'data-value="why at">{PLACE} <' in text
    assert f'data-copy="{AT}"' in text
    for word in ("edit EA0Z", "exclude EA0Z", "lever EA0Z", "include EAX"):
        assert f'data-word="{word}"' in text
    assert 'data-contribution="EAX"' not in text
    assert "hide lever" in text
    assert "show lever" in text
    # of what is only compared nothing can be changed
    assert 'data-word="exclude EA0Z"' not in answer_html(found, "", spell)
    assert 'value="X 275 Y −225 Z −480"' in field_html(found.at, Markup())
    assert 'value=""' in field_html(None, Markup())


def test_only_what_is_steered_can_be_changed() -> None:
    pinned = with_pin(START)
    for shown, steered in (("a", False), ("b", True), ("difference", False)):
        state = replace(pinned, comparison=pinned.comparison.with_shown(shown))
        assert LIVE.evaluate(state.with_nodes(3)).is_steered == steered
    assert LIVE.evaluate(START).is_steered


def test_a_comparison_has_both_statistics_their_change_and_the_length_of_the_change() -> None:
    state = with_pin(START).with_amplitude("EA0Z", 0.0)
    picture = LIVE.evaluate(state)
    compared = picture.compared
    assert compared is not None
    assert compared.difference is not None
    assert compared.titles == (f"before: {FIRST.title}", f"after: {FIRST.title}")
    text = comparison_html(picture)
    change = compared.b.max_um - compared.a.max_um
    # the issue: without EA0Z the largest error rises from 51.7 to 63.6 µm
    assert change == pytest.approx(63.6 - 51.7, abs=0.1)
    for column, value in (
        ("A", f"{compared.a.max_um:.2f}"),
        ("B", f"{compared.b.max_um:.2f}"),
        ("change", f"+{change:.2f}"),
        ("B − A", f"{compared.difference.max_um:.2f}"),
    ):
        assert f'data-compared="max {column}">{value}</td>' in text
    assert "|E<sub>B</sub> − E<sub>A</sub>|" in text
    assert PLACE in text


def test_tool_point_slices_reference_and_traced_points_have_both_coordinates() -> None:
    axes, point_mm = standing(START, WORST)
    assert PLACE in tool_point_html(axes, point_mm)
    assert AT in tool_point_html(axes, point_mm)
    look = START.look.with_choice(surface="slices")
    z = next(one for one in LIVE.evaluate(replace(START, look=look)).slices if one.axis == "Z")
    assert spell_slice(z) == "axes Z −280 · in R z 149"
    held = replace(START, scene=replace(FIRST, reference=WORST))
    assert f"held still: {PLACE}" in conventions_html(held, {}, lambda *_: Markup())
    turned = LIVE.evaluate(START.with_position("C", 90.0))
    own = FIRST.trace_points_mm[0]
    row = circle_rows(turned)[0]
    assert row.trace.point_mm == own
    # a quarter turn of C about +z takes x of the workpiece to y of R
    assert row.place.startswith("axes B 0° C 90° · in R x ")
    assert row.place in circle_table([row])
