"""Adjusters: effects in closed form, plans against exhaustive search, invalid descriptions."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from warpspace import evaluate
from warpspace.analysis import adjustment_search
from warpspace.analysis.adjuster_effects import add_effects, adjuster_effects
from warpspace.analysis.adjustment_search import Objective, StepSearch, Volume
from warpspace.analysis.commands.adjust import Adjust
from warpspace.analysis.statistics import volume_statistics
from warpspace.bodies.placed import check_adjusters
from warpspace.exceptions import OptionError, SceneError
from warpspace.field.evaluate import ErrorBasis
from warpspace.field.grid import build_grid
from warpspace.machine.errors import Constant, ErrorSet
from warpspace.scene.library import load_scene, parse_scene
from warpspace.scene.model import evaluate_grid
from warpspace.scene.scene_writer import scene_to_toml

HEAD = """
[machine]
chain = "wFXYZt"
[machine.offset_mm]
X = [10, 20, 300]
Z = [0, 100, 50]
[machine.travel]
X = [-400, 400]
Y = [-300, 300]
Z = [-200, 0]
"""
FOOT = (
    'kind = "levelling foot"\ndirection = [0, 0, 1]\npitch_mm = 1.0\nstep = 0.125\nrange = [-2, 2]'
)
SHIM = 'kind = "shim"\ndirection = [0, 0, 1]\nstep = 0.01\nrange = [0, 0.5]'


def scene_of(*entries, errors=""):
    tables = [f"[[machine.adjusters]]\n{entry}\n" for entry in entries]
    return parse_scene(HEAD + "".join(tables) + errors, "tried")


def support(name, body, at, text):
    return f'name = "{name}"\nbody = "{body}"\nat_mm = {list(at)}\n{text}'


def amplitudes(effect):
    return {key: function.amplitude for key, function in effect.functions.items()}


THREE = ((-310.0, 120.0, 40.0), (290.0, 75.0, 40.0), (35.0, 640.0, 40.0))


def test_a_body_on_three_feet_turns_as_the_plane_through_their_tops():
    scene = scene_of(*(support(f"foot {n}", "Z", at, FOOT) for n, at in enumerate(THREE)))
    x, y, _ = np.array(THREE).T
    for n, effect in enumerate(adjuster_effects(scene)):
        heights_um = np.eye(3)[n] * 1000.0
        _, along_x, along_y = np.linalg.solve(np.column_stack([np.ones(3), x, y]), heights_um)
        found = amplitudes(effect)
        assert set(found) == {"EA0Z", "EB0Z"}
        assert found["EA0Z"] == pytest.approx(1000.0 * along_y, abs=1e-9)
        assert found["EB0Z"] == pytest.approx(-1000.0 * along_x, abs=1e-9)


def test_a_body_on_five_feet_follows_the_plane_of_best_fit():
    places = (*THREE, (-100.0, 500.0, 40.0), (200.0, 300.0, 40.0))
    scene = scene_of(*(support(f"foot {n}", "Z", at, FOOT) for n, at in enumerate(places)))
    matrix = np.column_stack([np.ones(5), np.array(places)[:, :2]])
    for n, effect in enumerate(adjuster_effects(scene)):
        _, along_x, along_y = np.linalg.lstsq(matrix, np.eye(5)[n])[0] * 1e6
        found = amplitudes(effect)
        assert found["EA0Z"] == pytest.approx(along_y, abs=1e-9)
        assert found["EB0Z"] == pytest.approx(-along_x, abs=1e-9)


def test_three_feet_under_the_bed_change_nothing_and_a_fourth_twists_it():
    corners = [(x, y, -100.0) for y in (-250.0, 250.0) for x in (-500.0, 500.0)]
    feet = [support(f"foot {n}", "frame", at, FOOT) for n, at in enumerate(corners)]
    assert not any(effect.functions for effect in adjuster_effects(scene_of(*feet[:3])))
    effect = adjuster_effects(scene_of(*feet))[0]
    # the residual of the plane of best fit is a quarter of the travel at each corner, so that
    # w = 250 µm · (x / 500) · (y / 250); the origin of X is at x = 10 + q, y = 20, 400 above
    q = np.linspace(-400.0, 400.0, 9)
    w_xy = 250.0 / 500.0 / 250.0  # µm/mm²
    expected = {
        "EZX": w_xy * 20.0 * q,
        "EAX": 1000.0 * w_xy * (10.0 + q),
        "EBX": -1000.0 * w_xy * 20.0 + 0.0 * q,
        "EYX": -400.0 * w_xy * q,  # the lever above the feet, less its value at 0
    }
    assert set(effect.functions) == set(expected)
    for key, values in expected.items():
        assert effect.evaluate(key, q) == pytest.approx(values, abs=1e-9)


def test_bolts_bend_a_guide_as_the_natural_spline_through_them():
    bolt = 'kind = "rail bolt"\ndirection = [0, 0, 1]\nstep = 0.01\nrange = [-1, 1]'
    places = [(x, 20.0, 300.0) for x in (-290.0, 10.0, 310.0)]
    scene = scene_of(*(support(f"bolt {n}", "X", at, bolt) for n, at in enumerate(places)))
    effect = adjuster_effects(scene)[1]
    q = np.linspace(-400.0, 400.0, 17)
    u = np.minimum(np.abs(q) / 300.0, 1.0)
    beyond = np.maximum(np.abs(q) - 300.0, 0.0)
    # natural cubic spline through 0, 1, 0: 1 − 3/2 u² + 1/2 u³, its slope at the end −3/2
    height = 1000.0 * (-1.5 * u**2 + 0.5 * u**3 - 1.5 * beyond / 300.0)
    slope = 1000.0 / 300.0 * (-3.0 * u + 1.5 * u**2) * np.sign(q)
    assert set(effect.functions) == {"EZX", "EBX"}
    assert effect.evaluate("EZX", q) == pytest.approx(height, abs=1e-9)
    assert effect.evaluate("EBX", q) == pytest.approx(-1000.0 * slope, abs=1e-8)


def test_a_guide_on_many_bolts_is_the_spline_of_a_second_implementation():
    bolt = 'kind = "rail bolt"\ndirection = [0, 0, 1]\nstep = 0.01\nrange = [-1, 1]'
    at = np.array([-350.0, -200.0, -120.0, 60.0, 270.0, 330.0])
    bolts = [support(str(x), "X", (x, 20.0, 300.0), bolt) for x in at.tolist()]
    scene = scene_of(*bolts)
    travel = np.array([3.0, -2.0, 5.0, 1.0, 0.0, -4.0])
    errors = add_effects(scene, adjuster_effects(scene), (travel / 1000.0).tolist())
    q = np.linspace(-340.0, 310.0, 40)
    second = CubicSpline(at, travel, bc_type="natural")
    # the tilt of the guide is a constant error, which turns the carriage as well
    pitch = errors.evaluate("EBX", q) + errors.amplitude("EB0X")
    assert pitch == pytest.approx(-1000.0 * second(10.0 + q, 1), abs=1e-8)
    straight = errors.evaluate("EZX", q) - 1e-3 * errors.amplitude("EB0X") * q
    assert straight == pytest.approx(second(10.0 + q) - second(10.0), abs=1e-8)


def test_two_rows_of_bolts_roll_the_carriage():
    bolt = 'kind = "rail bolt"\ndirection = [0, 0, 1]\nstep = 0.01\nrange = [-1, 1]'
    places = [(x, y, 300.0) for y in (-180.0, 220.0) for x in (-290.0, 10.0, 310.0)]
    scene = scene_of(*(support(f"bolt {n}", "X", at, bolt) for n, at in enumerate(places)))
    effects = adjuster_effects(scene)
    both = add_effects(replace(scene, errors=ErrorSet()), effects, [0.0, 1.0, 0, 0, 1.0, 0])
    single = add_effects(replace(scene, errors=ErrorSet()), effects, [0.0, 0, 0, 0, 1.0, 0])
    assert abs(both.evaluate("EAX", np.array([100.0]))).max() < 1e-9
    q = np.array([-150.0, 0.0, 200.0])
    u = np.abs(q) / 300.0
    height = 1000.0 * (1.0 - 1.5 * u**2 + 0.5 * u**3)  # of one row; the other stays, 400 mm away
    roll = single.evaluate("EAX", q) + single.amplitude("EA0X")
    assert roll == pytest.approx(1000.0 * height / 400.0, abs=1e-8)


def test_gibs_turn_the_carriage_wherever_it_stands():
    gib = 'kind = "gib"\ndirection = [0, 1, 0]\nstep = 0.01\nrange = [-1, 1]'
    places = [(x, 20.0, 300.0) for x in (-90.0, 110.0)]
    scene = scene_of(*(support(f"gib {n}", "X", at, gib) for n, at in enumerate(places)))
    found = amplitudes(adjuster_effects(scene)[1])
    assert found == pytest.approx({"ECX": 1000.0 * 1000.0 / 200.0})


def test_an_offset_of_a_table_turns_it_in_its_programmed_sense():
    scene = parse_scene(
        'title = "t"\n[machine]\nchain = "wCFXYZt"\n[machine.direction]\nC = -1\n'
        '[[machine.adjusters]]\nname = "offset"\nbody = "C"\nkind = "encoder offset"\nstep = 1\n'
        "range = [-500, 500]\n",
        "tried",
    )
    errors = add_effects(scene, adjuster_effects(scene), [100.0])
    field = evaluate(replace(scene, errors=errors), at={"X": 200.0, "Y": 0.0}, loop="relative")
    assert field.error_um == pytest.approx([0.0, 20.0, 0.0], abs=1e-9)  # 100 µrad · 200 mm


CURVES = {
    "constant": "3.0",
    "ramp": "{ ramp = 5.5 }",
    "harmonics": "{ harmonics = [[2, 3.0, 40.0]] }",
    "table": "{ table = [[-400, 1.0], [35, -2.0], [400, 4.0]] }",
    "directional": "{ forward = { ramp = 2 }, backward = 1.0 }",
}


@pytest.mark.parametrize("kind", CURVES)
def test_an_effect_is_added_to_any_curve(kind):
    bolt = 'kind = "rail bolt"\ndirection = [0, 0, 1]\nstep = 0.01\nrange = [-1, 1]'
    bolts = [support(str(x), "X", (x, 20.0, 300.0), bolt) for x in (-290.0, 10.0, 310.0)]
    scene = scene_of(*bolts, errors=f"[errors]\nEZX = {CURVES[kind]}\n")
    effects, q = adjuster_effects(scene), np.linspace(-400.0, 400.0, 23)
    errors = add_effects(scene, effects, [0.0, 0.02, 0.0])
    for direction in ("forward", "backward"):
        before, after = (s.evaluate_at("EZX", {"X": q}, direction) for s in (scene.errors, errors))
        assert after - before == pytest.approx(0.02 * effects[1].evaluate("EZX", q), abs=1e-9)


def test_a_scale_of_a_table_lengthens_its_programmed_travel():
    scene = parse_scene(
        'title = "t"\n[machine]\nchain = "wXFYZt"\n[machine.direction]\nX = -1\n'
        '[[machine.adjusters]]\nname = "scale"\nbody = "X"\nkind = "scale factor"\nstep = 1\n'
        "range = [-50, 50]\n",
        "tried",
    )
    errors = add_effects(scene, adjuster_effects(scene), [10.0])
    field = evaluate(replace(scene, errors=errors), at={"X": 200.0}, loop="relative")
    assert field.error_um == pytest.approx([2.0, 0.0, 0.0], abs=1e-9)


def random_volume(rng, acts):
    scene = load_scene("machine_c_frame_mill")
    grid = build_grid(scene.model, scene.workspace, 4)
    position = rng.normal(size=(acts + 1, *grid.nominal_mm.shape))
    position[0] *= 4.0
    basis = ErrorBasis(tuple(map(str, range(acts + 1))), grid.nominal_mm, position, position)
    return Volume(basis, grid, np.eye(acts + 1)[0])


@pytest.mark.parametrize("objective", list(Objective))
@pytest.mark.parametrize("seed", range(6))
def test_whole_steps_are_those_of_exhaustive_search(objective, seed):
    rng = np.random.default_rng(seed)
    volume, acts = random_volume(rng, 4), 4
    steps = np.array([[-2, 3], [0, 2], [-3, 1], [-1, 1]], float)
    rows = rng.normal(size=(2, acts))
    limits = np.array([[-1.5, 1.0], [-1.0, 2.0]])
    mean = volume.mean((), np.zeros(0))[0]
    search = StepSearch(volume, objective, steps, rows, limits, mean)
    found = list(search.best_sets(3, lambda _: None))
    every = np.array(list(product(*(range(int(a), int(b) + 1) for a, b in steps))), float)
    inside = np.all((every @ rows.T >= limits[:, 0]) & (every @ rows.T <= limits[:, 1]), axis=1)
    values = []
    for change in every:
        numbers = volume.statistics(np.append(1.0, change))
        is_allowed = numbers.mean_um <= mean + 1e-9
        values.append(getattr(numbers, f"{objective}_um") if is_allowed else np.inf)
    values = np.where(inside, values, np.inf)
    best = [values[np.count_nonzero(every, axis=1) <= size].min() for size in range(4)]
    improves = [best[size] < best[size - 1] - 1e-4 for size in (1, 2, 3)]
    assert len(found) == [*improves, False].index(False)
    for size, (change, proven) in enumerate(found, 1):
        assert proven
        assert search.evaluate(change)[0] == pytest.approx(best[size], abs=2e-4)
        assert np.count_nonzero(change) <= size


def test_acts_are_whole_steps_within_ranges_and_the_written_scene_has_their_errors(tmp_path):
    scene = load_scene("machine_gantry_mill")
    result = Adjust(grid=5, count=2).run(scene)
    adjusters = {adjuster.name: adjuster for adjuster in scene.machine.adjusters}
    assert [len(planned.acts) for planned in result.adjustments] == [1, 2]
    for planned, change in zip(result.adjustments, result.changes(), strict=True):
        for act in planned.acts:
            adjuster = adjusters[act.adjuster]
            assert (act.change / adjuster.step) % 1.0 == 0.0
            assert adjuster.range[0] <= act.change <= adjuster.range[1]
            assert act.um == pytest.approx(1000.0 * adjuster.pitch_mm * act.change)
        written = parse_scene(scene_to_toml(change.scene), "written")
        grid = build_grid(scene.model, scene.workspace, 5)
        numbers = volume_statistics(evaluate_grid(written, grid, scene.view()), grid)
        assert numbers.four == pytest.approx(planned.four, abs=1e-9)
        assert numbers.mean_um <= result.before.mean_um
        assert {key: written.errors.amplitude(key) for key in planned.adjust} == pytest.approx(
            planned.adjust
        )


def test_a_group_is_one_act_and_shares_the_range_of_its_members():
    scene = load_scene("dvf5000_first")
    first = Adjust(grid=5, count=1).run(scene).adjustments[0]
    assert str(first.acts[0]) == "front column bolts + 0.01 mm (10 µm)"
    # two bolts 820 mm in front of the others: 10 µm turn the column by −10 / 0.82 µrad
    assert first.adjust == pytest.approx({"EA0Z": 33.9 - 10.0 / 0.82}, abs=1e-9)
    assert Adjust(grid=5, count=1).run(scene).as_json()["adjustments"][0]["acts"] == [
        {"adjuster": "front column bolts", "change": 0.01, "unit": "mm", "um": 10.0}
    ]


def test_named_errors_are_adjusted_as_before():
    result = Adjust(grid=5, count=1, adjustable=("EA0Z",)).run(load_scene("dvf5000_first"))
    assert "acts" not in result.as_json()["adjustments"][0]


def test_an_act_that_would_leave_a_tolerance_is_not_proposed():
    feet = [
        support(f"foot {n}", "Z", at, FOOT.replace("1.0", "0.01")) for n, at in enumerate(THREE)
    ]
    errors = "[errors]\nEA0Z = 100\n[tolerances]\nEB0Z = 1e-3\n"
    free = Adjust(grid=3, count=1).run(scene_of(*feet, errors=errors.partition("[tol")[0]))
    bound = Adjust(grid=3, count=1).run(scene_of(*feet, errors=errors))
    assert abs(free.adjustments[0].adjust["EB0Z"]) > 1e-3
    assert not bound.adjustments


SCALE = 'name = "s"\nbody = "X"\nkind = "scale factor"\nstep = 1\nrange = [-9, 9]'
WRONG = [
    ([f'name = "a"\nbody = "Z"\n{FOOT}'], "at_mm", "levelling foot; is missing"),
    (
        [f"{SCALE}\nat_mm = [0, 0, 0]"],
        "at_mm",
        "a parameter of the control has none",
    ),
    ([support("a", "Q", (0, 0, 0), FOOT)], "body", "one of frame, X, Y, Z"),
    ([support("a", "Z", (0, 0, 0), FOOT.replace("[0, 0, 1]", "[0, 0, 0]"))], "direction", "unit"),
    ([support("a", "Z", (0, 0, 0), FOOT.replace("[0, 0, 1]", "[0, 0, 2]"))], "direction", "unit"),
    ([support("a", "Z", (0, 0, 0), FOOT.replace("pitch_mm = 1.0\n", ""))], "pitch_mm", "travel"),
    ([support("a", "Z", (0, 0, 0), SHIM + "\npitch_mm = 1")], "pitch_mm", "expected none"),
    ([support("a", "Z", (0, 0, 0), FOOT.replace("[-2, 2]", "[-0.1, 0.1]"))], "range", "no step"),
    ([support("a", "Z", (0, 0, 0), FOOT.replace("[-2, 2]", "[1, 2]"))], "range", "around 0"),
    ([support("a", "Z", (0, 0, 0), FOOT.replace("[-2, 2]", "[1, 1]"))], "range", "lower < upper"),
    ([support("a", "Z", (0, 0, 0), FOOT.replace("levelling", "wobbling"))], "kind", "shim"),
    ([support("a", "Z", (0, 0, 0), FOOT)], "adjusters", "at least 3"),
    ([support(n, "Z", (0, 0, 0), FOOT) for n in "aab"], "name", "no other adjuster"),
    (
        [support(str(n), "Z", (100.0 * n, 0, 0), FOOT) for n in range(4)],
        "adjusters",
        "dependent; expected 3 that are not in one place or line",
    ),
    (
        [support(str(n), "frame", (100.0 * n, 97.0 * n * n, 0), FOOT) for n in range(4)],
        "adjusters",
        "rows of at least two",
    ),
    (['name = "s"\nbody = "X"\nkind = "scale factor"\nstep = 1\nrange = [-9, 9]'] * 1
     + ['name = "t"\nbody = "X"\nkind = "scale factor"\nstep = 1\nrange = [-9, 9]'],
     "adjusters", "dependent; expected one scale factor of X"),
    (['name = "s"\nbody = "X"\nkind = "encoder offset"\nstep = 1\nrange = [-9, 9]'], "body",
     "no axis can have one"),
    (
        [
            support(str(n), "Z", at, (FOOT if n else SHIM) + '\ngroups = ["g"]')
            for n, at in enumerate(THREE)
        ],
        "adjusters",
        "group g",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("entries", "key", "expected"), WRONG)
def test_invalid_adjusters_are_refused_with_one_message(entries, key, expected):
    with pytest.raises(SceneError) as caught:
        scene_of(*entries)
    (problem,) = caught.value.problems
    assert problem.startswith("machine.adjusters")
    assert key in problem
    assert expected in problem


def test_adjusters_survive_writing_and_reading():
    scene = scene_of(*(support(f"foot {n}", "Z", at, FOOT) for n, at in enumerate(THREE)))
    assert parse_scene(scene_to_toml(scene), "tried") == scene
    third = FOOT.replace("[0, 0, 1]", "[0.5774, 0.5774, 0.5774]")
    scene = scene_of(*(support(f"foot {n}", "Z", at, third) for n, at in enumerate(THREE)))
    assert np.linalg.norm(scene.machine.adjusters[0].direction) == pytest.approx(1.0, abs=1e-12)
    assert parse_scene(scene_to_toml(scene), "tried") == scene


def test_a_log_needs_adjusters_and_no_named_errors(tmp_path):
    with pytest.raises(OptionError, match="has no adjusters"):
        Adjust(done=str(tmp_path / "x")).run(load_scene("machine_scara"))
    with pytest.raises(OptionError, match="acts on adjusters"):
        Adjust(done="x", adjustable=("EA0Z",)).run(load_scene("dvf5000_first"))


LOG = '[[done]]\nacts = { "foot 0" = 1.0 }\nbefore = { EA0Z = 0.0, EB0Z = 0.0 }\n'


def test_stiffness_is_the_bayes_estimate_of_the_change(tmp_path):
    feet = [support(f"foot {n}", "Z", at, FOOT.replace("1.0", "0.1")) for n, at in enumerate(THREE)]
    uncertain = "[uncertainty]\nEA0Z = 20\nEB0Z = 30\n"
    geometric = amplitudes(adjuster_effects(scene_of(*feet))[0])
    a, b = geometric["EA0Z"], geometric["EB0Z"]
    errors = f"[errors]\nEA0Z = {1.2 * a}\nEB0Z = {1.1 * b}\n"
    log = tmp_path / "log.toml"
    log.write_text(LOG)
    result = Adjust(grid=3, count=1, done=str(log)).run(scene_of(*feet, errors=errors + uncertain))
    weights = np.array([a, b]) ** 2 / (2.0 * np.array([20.0, 30.0]) ** 2)
    precision = 1.0 / 0.3**2 + weights.sum()
    (learnt,) = result.stiffness
    assert learnt.adjuster == "foot 0"
    assert learnt.factor == pytest.approx((1.0 / 0.09 + weights @ [1.2, 1.1]) / precision)
    assert learnt.u95 == pytest.approx(2.0 / precision**0.5)
    assert result.as_json()["stiffness"] == [
        {"adjuster": "foot 0", "factor": learnt.factor, "u95": learnt.u95}
    ]
    assert "foot 0: effect 1." in " ".join(b for b in result.blocks() if isinstance(b, str))


def test_an_unstated_uncertainty_is_refused_and_unknown_names_too(tmp_path):
    feet = [support(f"foot {n}", "Z", at, FOOT) for n, at in enumerate(THREE)]
    scene, log = scene_of(*feet, errors="[errors]\nEA0Z = 5\n"), tmp_path / "log.toml"
    log.write_text(LOG)
    with pytest.raises(SceneError, match="uncertainty of EA0Z, EB0Z is not stated"):
        Adjust(grid=3, done=str(log)).run(scene)
    log.write_text(LOG.replace("foot 0", "foot 9").replace("EB0Z", "EB0Q"))
    with pytest.raises(SceneError, match="2 problems") as caught:
        Adjust(grid=3, done=str(log)).run(scene)
    assert "done[0].acts" in str(caught.value)
    assert "done[0].before.EB0Q" in str(caught.value)


def test_a_log_is_extended_by_the_proposed_acts(tmp_path):
    scene, log = load_scene("dvf5000_first"), tmp_path / "log.toml"
    uncertain = replace(scene, uncertainty={"EA0Z": Constant((0.0, 1.0), 1.0)})
    first = Adjust(grid=3, count=1, log=str(log)).run(uncertain)
    for path, text in first.updated_files().items():
        assert path == str(log)
        log.write_text(text)
    after = replace(uncertain, errors=first.adjustments[0].errors)
    second = Adjust(grid=3, count=1, done=str(log), log=str(log)).run(after)
    (learnt, other) = second.stiffness
    assert (learnt.factor, other.factor) == pytest.approx((1.0, 1.0))
    assert {learnt.adjuster, other.adjuster} == {
        "front left column bolt", "front right column bolt",
    }  # fmt: skip


def test_check_lists_adjusters_outside_the_meshes_they_lie_between():
    model = load_scene("dvf5000_first").model
    assert check_adjusters(model) == ()
    machine = model.machine
    moved = [replace(a, at_mm=(a.at_mm[0], 2000.0, a.at_mm[2])) for a in machine.adjusters]
    model = replace(model, machine=replace(machine, adjusters=(*machine.adjusters[1:], moved[0])))
    (problem,) = check_adjusters(model)
    assert problem.startswith(
        "adjuster front left foot: at_mm = [-520.0, 2000.0, -545.0] is outside"
    )
    assert "y" in problem
    assert "-620…1250" in problem


def test_the_result_of_acts_is_stated_with_its_uncertainty():
    scene = load_scene("dvf5000_first")
    stated = replace(scene, uncertainty={key: Constant((0.0, 1.0), 1.0) for key in scene.errors})
    result = Adjust(grid=3, count=1, objective="max").run(stated)
    (best,) = result.adjustments
    u95 = best.expanded_uncertainty["u95_max_um"]
    # the largest error is that of one node, and its uncertainty that of the errors times the gains
    after = best.applied_to(stated)
    grid = build_grid(after.model, after.workspace, 3)
    error = evaluate_grid(after, grid, after.view()).error_um.reshape(-1, 3)
    worst = int(np.argmax(np.linalg.norm(error, axis=1)))
    along = error[worst] / np.linalg.norm(error[worst])
    raised = [
        replace(after, errors=ErrorSet({key: Constant((0.0, 1.0), 1.0)})) for key in scene.errors
    ]
    gains = [
        evaluate_grid(one, grid, one.view()).error_um.reshape(-1, 3)[worst] @ along
        for one in raised
    ]
    # curves vary along their axis: two modes; at the end of an axis only one of them acts
    assert u95 == pytest.approx(2.0 * np.linalg.norm(gains), rel=1e-6)
    text = " ".join(block for block in result.blocks() if isinstance(block, str))
    assert f"set 1: largest |E| 51.7 → {best.max_um:.1f} ± {u95:.1f} µm; EA0Z 33.9 →" in text


def test_supports_that_move_tool_and_workpiece_together_are_listed_as_idle():
    corners = [(x, y, -100.0) for y in (-250.0, 250.0) for x in (-500.0, 500.0)][:3]
    feet = [support(f"foot {n}", "frame", at, FOOT) for n, at in enumerate(corners)]
    # the first axis carries all others over a fixed table: a placement of the workpiece
    feet += [support(f"shim {n}", "X", at, SHIM) for n, at in enumerate(corners)]
    result = Adjust(grid=3).run(scene_of(*feet, errors="[errors]\nEA0Z = 50\n"))
    assert not result.adjustments
    text = " ".join(block for block in result.blocks() if isinstance(block, str))
    assert "no effect in this loop: foot 0, foot 1, foot 2, shim 0, shim 1, shim 2" in text
    assert result.no_change in text or "No act on an adjuster" in text


def test_a_search_that_is_cut_short_claims_no_proof(monkeypatch):
    volume = random_volume(np.random.default_rng(0), 4)
    free = np.zeros((0, 4)), np.zeros((0, 2))
    search = StepSearch(volume, Objective.RMS, np.array([[-3.0, 3.0]] * 4), *free)
    ((best, proven),) = search.best_sets(2, lambda _: None)  # a second act gains nothing
    assert proven
    monkeypatch.setattr(adjustment_search, "MOST_CUTS", 4)
    ((same, proven),) = search.best_sets(1, lambda _: None)
    assert np.array_equal(same, best)
    assert not proven
    monkeypatch.setattr(adjustment_search, "MOST_SECONDS", 0.0)
    assert [*search.best_sets(1, lambda _: None)] == []
