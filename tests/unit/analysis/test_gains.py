"""What an error gives: gains, levers, shares of the variance, and concepts side by side."""

from dataclasses import replace

import numpy as np
import pytest

import warpspace
from warpspace import evaluate, load_scene
from warpspace.analysis.blocks import Table
from warpspace.analysis.commands.concepts import Concepts, compare_concepts, expected_um
from warpspace.analysis.commands.contributions import explain
from warpspace.analysis.commands.gains import Gain, gains_at, gains_max, mark_key_errors
from warpspace.analysis.registry import PUBLICATIONS, Publication
from warpspace.exceptions import OptionError, SceneError
from warpspace.field.evaluate import View
from warpspace.field.grid import build_grid
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.machine.errors import Constant, ErrorSet, Tolerance, ToleranceSet
from warpspace.scene.starter import starter_scene

SCENE = load_scene("dvf5000_nominal")


def gain(key, norm):
    return Gain(key, norm, 0.0, 0.0, norm, (0.0, 0.0, 0.0), {})


def test_key_errors_are_the_fewest_that_reach_the_share():
    rows = [gain("EXX", 1.0), gain("EAX", 3.0), gain("EAY", 2.0)]
    marked = mark_key_errors(rows, 0.9)  # 9 of 14, then 13 of 14
    assert [row.key for row in marked] == ["EAX", "EAY", "EXX"]
    assert [row.is_key for row in marked] == [True, True, False]
    assert [row.is_key for row in mark_key_errors(rows, 1.0)] == [True, True, True]
    assert [row.is_key for row in mark_key_errors(rows, 0.5)] == [True, False, False]
    assert not any(row.is_key for row in mark_key_errors([gain("EXX", 0.0)], 1.0))


@pytest.mark.parametrize("loop", [Loop.TOOL, Loop.WORKPIECE])
def test_lever_parts_add_up_to_the_lever(loop):
    at = {"X": 30.0, "Y": -100.0, "Z": -200.0, "B": -35.0, "C": 70.0}
    for row in gains_at(SCENE.model, loop, SCENE.parameter_keys, at):
        total = np.sum([vector for _, vector in row.lever_parts_mm] or [(0, 0, 0)], axis=0)
        np.testing.assert_allclose(total, row.lever_mm, atol=1e-6)


def test_workpiece_parameters_have_no_parts_in_the_relative_loop():
    found = gains_at(SCENE.model, Loop.RELATIVE, ["EAC", "EAX"], {})
    assert {row.key: bool(row.lever_parts_mm) for row in found} == {"EAC": False, "EAX": True}


@pytest.mark.nightly
@pytest.mark.parametrize("loop", [Loop.RELATIVE, Loop.TOOL, Loop.WORKPIECE])
def test_largest_gain_is_not_below_any_random_position(loop):
    ranges = {name: axis.travel for name, axis in SCENE.machine.axes.items()}
    rng = np.random.default_rng(4)
    best = {row.key: row for row in gains_max(SCENE.model, loop, SCENE.parameter_keys, ranges)}
    for _ in range(25):
        at = {name: rng.uniform(*span) for name, span in ranges.items()}
        for row in gains_at(SCENE.model, loop, SCENE.parameter_keys, at):
            assert row.norm <= best[row.key].norm * (1 + 4e-5) + 1e-9
            for column in "xyz":
                limit = getattr(best[row.key], column) + 1e-4 * best[row.key].norm + 1e-9
                assert abs(getattr(row, column)) <= limit


def test_position_of_the_largest_gain_reproduces_it():
    ranges = {name: axis.travel for name, axis in SCENE.machine.axes.items()}
    for row in gains_max(SCENE.model, Loop.WORKPIECE, SCENE.parameter_keys, ranges, 10.0):
        (again,) = gains_at(SCENE.model, Loop.WORKPIECE, [row.key], row.at)
        assert again.norm == pytest.approx(row.norm)


@pytest.mark.parametrize("loop", list(Loop))
@pytest.mark.parametrize("reference", [None, {"X": 0.0, "Y": 0.0, "Z": -280.0}])
def test_contributions_and_remainder_add_up_to_the_exact_error(loop, reference):
    scene = load_scene("dvf5000_first")
    at = complete_coordinates(scene.machine, {"X": 100.0, "Y": -225.0, "Z": -480.0, "B": 10.0})
    found = explain(scene.model, scene.errors, at, View(loop, reference=reference))
    total = sum((part.error_um for part in found.contributions), np.zeros(3))
    np.testing.assert_allclose(total + found.remainder_um, found.error_um, atol=1e-12)
    along = sum(part.along_um for part in found.contributions)
    assert along == pytest.approx(np.linalg.norm(total))


def test_squareness_alone_is_explained_by_its_printed_lever():
    # table 4-3 at Y -225, Z -480: EC0Y 1.30 and 0.07 (levers 1299 and 70 mm), EBY 0.66 (658 mm)
    scene = load_scene("teach_squareness")
    at = complete_coordinates(scene.machine, {"X": 0.0, "Y": -225.0, "Z": -480.0})
    (part,) = explain(scene.model, scene.errors, at).contributions
    assert part.key == "EC0Y"
    assert part.value == 30.0
    np.testing.assert_allclose(part.lever_mm, [-70.0, -1299.0, -658.0])


PROPOSED = load_scene("dvf5000_proposed")
NONE = ToleranceSet({"translation": 0, "rotation": 0, "squareness": 0})


@pytest.mark.parametrize("loop", ["tool", "workpiece", "relative"])
def test_exact_shares_add_up_and_sampling_repeats_them(loop):
    found = warpspace.contributions(PROPOSED, loop=loop)
    assert sum(row.share for row in found.rows) == pytest.approx(1.0)
    shares = [row.share for row in found.rows]
    assert shares == sorted(shares, reverse=True)
    for row in found.rows:
        assert row.sampled_share == pytest.approx(row.share, abs=0.012)


def test_translations_of_the_general_tolerance_have_equal_known_variances():
    found = warpspace.contributions(load_scene("dvf5000_general"))
    straight = [row.variance_um2 for row in found.rows if row.unit == "µm"]
    assert [value for value in straight if value] == pytest.approx([100.0 / 3.0] * 15)


def test_sobol_ranks_the_largest_first_and_totals_exceed_first_order():
    found = warpspace.contributions(PROPOSED, sobol=128)
    rows = [row for row in found.rows if row.share]
    totals = {row.key: row.sobol_total for row in rows}
    assert max(totals, key=lambda key: totals[key]) == found.rows[0].key == "EBZ"
    assert sum(totals.values()) > 1.0 > sum(row.sobol_first for row in rows)
    for row in rows:
        assert row.sobol_total >= row.sobol_first - 0.1


def test_a_single_parameter_has_all_of_it():
    only = replace(NONE, individual={"EXX": Tolerance(0, 3)})
    found = warpspace.contributions(replace(PROPOSED, tolerances=only), sobol=64)
    assert found.rows[0].key == "EXX"
    assert found.rows[0].share == 1.0
    assert found.variance_um2 == pytest.approx(3.0)
    assert found.rows[0].sobol_total == pytest.approx(1.0, abs=0.3)
    assert found.rows[1].sobol_total is None


def test_no_width():
    with pytest.raises(OptionError, match="no parameter of this loop"):
        warpspace.contributions(replace(PROPOSED, tolerances=NONE))


QUICK = Concepts(samples=20_000)


def with_default(chain, *widths):
    default = dict(zip(NONE.default, widths, strict=True))
    return replace(starter_scene(chain), tolerances=ToleranceSet(default))


@pytest.mark.parametrize(("chain", "count"), [("wFXt", 3), ("wFXYZt", 9), ("wXYFZt", 9)])
def test_translations_alone_give_the_root_of_their_number_everywhere(chain, count):
    scene = with_default(chain, 10.0, 0.0, 0.0)
    (concept,) = compare_concepts([scene], QUICK)
    grid = build_grid(scene.model, scene.workspace, 3)
    # a uniform range of ±10 µm has a variance of 100/3 µm², and each translation acts one to one
    expected = np.sqrt(count * 100.0 / 3.0)
    assert expected_um(concept, grid) == pytest.approx(expected)
    assert concept.shares.rms_um == pytest.approx(expected)
    assert concept.sampled.rms_um == pytest.approx(expected, rel=0.01)


def test_the_expected_error_is_that_of_machines_drawn_apart():
    scene = with_default("wCBFXYZt", 10.0, 20.0, 25.0)
    own = {"EAX": Tolerance(-30.0, 5.0), "EC0Y": Tolerance(40.0, 10.0)}
    scene = replace(scene, tolerances=replace(scene.tolerances, individual=own))
    (concept,) = compare_concepts([scene], replace(QUICK, own_tolerances=True))
    grid = build_grid(scene.model, scene.workspace, 2)
    expected = expected_um(concept, grid)
    rng, squares, count = np.random.default_rng(3), 0.0, 300
    for _ in range(count):
        errors = {}
        for key in scene.parameter_keys:
            tolerance = scene.tolerances.get(key)
            value = tolerance.centre + tolerance.half_width * rng.uniform(-1.0, 1.0)
            errors[key] = Constant((0.0, 1.0), value)
        found = evaluate(replace(scene, errors=ErrorSet(errors)), grid=2, loop="relative")
        squares = squares + found.norm_um**2
    # the scatter of a mean square of 300 is about 6 %, of its root 3 %
    assert np.sqrt(squares / count) == pytest.approx(expected, rel=0.07)


def test_no_point_is_held_still():
    scene = with_default("wFXYZt", 10.0, 20.0, 25.0)
    held = replace(scene, reference={"X": 0.0, "Y": 0.0, "Z": -200.0})
    one, other = compare_concepts([scene, held], QUICK)
    assert one.sampled.mean_um == other.sampled.mean_um


def test_tolerances_without_width_are_said():
    with pytest.raises(SceneError, match="none of the relative loop has a width"):
        compare_concepts([with_default("wFXYZt", 0.0, 0.0, 0.0)], QUICK)


def test_a_publication_has_a_column_of_key_errors():
    def nothing(*_):
        return None

    def keys(machine):
        return ("EXX",) if machine == "dvf5000" else ()

    scene = load_scene("dvf5000_first")
    book = Publication(name="book", key_errors=keys, sampled_mean=nothing, measured_error=nothing)
    PUBLICATIONS.register(book)
    try:
        (table,) = warpspace.gains(scene).blocks_of(Table)
    finally:
        PUBLICATIONS.unregister("book")
    head, *rows = table.csv_rows()
    marked = {row[head.index("key")] for row in rows if row[head.index("book_key_error")]}
    assert marked == {"EXX"}
    assert "book" in [column.heading for column in table.visible_columns]
    assert "thesis_key_error" in head
