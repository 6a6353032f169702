"""The column of errors: rows by effect, what a row says and sets, what stays while a hand moves."""

import re

import pytest

from app.parts import LIVE, lone_part
from warpspace.app.browser import actions as do
from warpspace.app.browser.page import script_source
from warpspace.app.panels.conventions import with_reference
from warpspace.app.panels.error_list import ErrorsPanel, find_parameters
from warpspace.app.state.app_state import start_state
from warpspace.app.state.tree import toggled
from warpspace.machine.axes import parameter
from warpspace.scene.library import load_scene

STATE = start_state(load_scene("dvf5000_first"))
KEYS = STATE.scene.parameter_keys


class Column:
    """The column without a page."""

    def __init__(self):
        self.part, self.state = lone_part(ErrorsPanel), STATE

    def do(self, action=do.Signal.DRAWN):
        self.state = self.part.handle(self.state, action)
        return self.part.render(LIVE.evaluate(self.state))


def places(pieces):
    return re.findall(r'data-piece="error\.(\w+)"', pieces["errors"])


def test_the_largest_effect_comes_first_and_a_move_renders_one_row_in_its_place():
    column = Column()
    first = column.do()
    assert places(first)[:3] == ["EA0Z", "EAY", "EC0Y"]
    assert "34 errors are zero" in first["errors"]
    moved = column.do(do.SetError("EAX", "900"))
    assert [name for name in moved if moved[name] != first[name]] == ["errors", "error.EAX"]
    assert places(moved)[0] == "EA0Z"
    assert places(column.do(do.Signal.SORT_ERRORS))[0] == "EAX"


def test_what_something_else_changes_is_sorted_at_once():
    column = Column()
    column.do()
    column.state = column.state.with_amplitude("EAX", 40.0)
    for key in [key for key in column.state.amplitudes if key.endswith("Z")]:
        column.state = column.state.with_amplitude(key, 0.0)
    assert places(column.do())[0] == "EAY"
    column.state = with_reference(column.state, {"X": 0.0, "Y": 225.0, "Z": -80.0})
    held = column.do()  # order and bars follow what is held still
    assert "width:100.0%" in held[f"error.{places(held)[0]}"]


def test_a_slider_has_the_range_of_its_kind_again_after_a_wild_number():
    column = Column()
    column.do()
    assert 'max="100"' in column.do(do.Input.UNFOLD_ERROR("EAY"))["error.EAY"]
    assert 'max="100000"' in column.do(do.SetError("EAY", "1e9"))["error.EAY"]
    column.do(do.SetError("EAY", "-40"))
    again = column.do(do.Signal.SORT_ERRORS)
    assert 'max="100"' in again["error.EAY"]
    assert 'max="100"' in again["error.EAX"]


def test_undo_restores_the_range_that_a_large_number_widened():
    column = Column()
    before = column.do()["error.EAY"]
    assert 'max="500"' in column.do(do.SetError("EAY", "200"))["error.EAY"]
    column.state = STATE
    assert column.do()["error.EAY"] == before


def test_a_row_opens_into_curve_origin_and_numbers_and_goes_back():
    column = Column()
    opened = column.do(do.Input.UNFOLD_ERROR("EAY"))["error.EAY"]
    assert "assumed" in opened
    assert "Reset to the scene" not in opened
    column.do(do.EditCurve("EAY", "kind", "table"))
    column.part.context.rerender = (renewed := []).append
    edited = column.do(do.EditCurve("EAY", "rows", "position;value\n-225;0\n225;<b>"))["error.EAY"]
    assert renewed == [column.part]  # the state is as it was, the row says why
    assert 'aria-invalid="true"' in edited
    assert "&lt;b&gt;" in edited
    edited = column.do(do.EditCurve("EAY", "rows", "q;value\n-225;0,5\n225;-30"))["error.EAY"]
    assert "Reset to the scene" in edited
    assert column.state.amplitudes["EAY"] == -30.0
    column.do(do.EditCurve("EAY", "own"))
    assert column.state.amplitudes == STATE.amplitudes


def test_what_is_nonsense_changes_nothing_and_exclusions_are_counted():
    column = Column()
    for action in (
        do.SetError("EQQ", "<script>"), do.EditCurve("", "rows", "<script>"),
        do.EditCurve("EAY", "kind", "<script>"), do.Input.UNFOLD_ERROR("<script>"),
    ):  # fmt: skip
        column.do(action)
        assert column.state.without_notes() == STATE, action
    column.do(do.SetError("EAY", "x7"))
    assert column.state.notes[-1] == "EAY = 'x7'; expected a number; unchanged"
    assert column.state.amplitudes == STATE.amplitudes
    column.state = toggled(column.state, "exclusions.only", "EAY")
    assert "6 of 7 errors excluded" in column.do()["errors"]


@pytest.mark.parametrize(
    ("query", "found"),
    [
        ("roll x", ["EAX"]),
        ("eax", ["EAX"]),
        ("c0y", ["EC0Y"]),
        ("squareness", ["EC0Y", "EA0Z", "EB0Z"]),
        ("squarness", ["EC0Y", "EA0Z", "EB0Z"]),
        ("γ", ["EC0Y", "EC0B"]),
        ("ε_xX", ["EAX"]),
        ("tilt c", ["EAC", "EBC"]),
        ("positioning z", ["EZZ"]),
        ("no such thing", []),
        ("<script>", []),
    ],
)
def test_errors_are_found_by_what_people_call_them(query, found):
    assert list(find_parameters(query, KEYS)) == found


def test_every_parameter_is_found_by_its_key_symbol_and_name():
    for key in KEYS:
        row = parameter(key)
        assert find_parameters(key, KEYS) == (key,)
        assert key in find_parameters(row.symbol, KEYS)
        assert key in find_parameters(row.name, KEYS)
    assert find_parameters("   ", KEYS) == KEYS
    assert find_parameters("x" * 1_000_000, KEYS) == ()


def test_every_kind_of_error_has_its_pictogram():
    rows = Column().do()
    shown = {key: re.findall(r'href="#ws-kind-(\w+)"', rows[f"error.{key}"]) for key in KEYS}
    assert shown["EA0Z"] == ["squareness"]
    assert shown["EAX"] == ["roll"]
    assert shown["EX0C"] == ["location"]
    drawn = re.findall(r'(\w+): "M', script_source("pictograms.js"))
    assert {kind for kinds in shown.values() for kind in kinds} == {*drawn}
