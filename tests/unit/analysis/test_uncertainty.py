"""How sure numbers are: covariances and uncertainties carried to points and statistics."""

import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from warpspace import load_scene
from warpspace.analysis.commands.conformance import Conformance
from warpspace.analysis.commands.form import Form
from warpspace.analysis.commands.line import Line
from warpspace.analysis.statistics import statistics, volume_statistics
from warpspace.analysis.uncertainty.propagation import (
    combine,
    coverage_factor,
    field_uncertainty,
    scene_uncertainty,
    volume_uncertainty,
)
from warpspace.bench.base import find_test, run_test
from warpspace.exceptions import SceneError
from warpspace.field.evaluate import ErrorField
from warpspace.field.grid import build_grid
from warpspace.kinematics.model import complete_coordinates
from warpspace.machine.errors import Covariance
from warpspace.parts.clamp import Clamp
from warpspace.parts.part import Part
from warpspace.parts.workpiece import WorkpieceAnalysis
from warpspace.scene.library import parse_scene
from warpspace.scene.model import evaluate
from warpspace.scene.scene_writer import scene_to_toml

HEAD = """[machine]
chain = "wFXYZt"
[machine.offset_mm]
t = [0, 0, -300]
[workspace]
X = [-100, 100]
Y = [-100, 100]
Z = 0
"""

STATED = "EXX = 0.4\nEYX = { table = [[-100, 0.1], [100, 0.3]] }\nEBX = 1\n"
SCENE = f"{HEAD}[errors]\nEXX = 5\n[uncertainty]\n{STATED}"


def sure(scene, at):
    field = evaluate(scene, at=at)
    axes = complete_coordinates(scene.machine, at, scene.workspace.positions)
    return field_uncertainty(scene, field.error_um, axes, scene.view())


def test_gains_times_uncertainties_add_up_in_squares():
    found = sure(parse_scene(SCENE, "s"), at={"X": [-100.0, 0.0, 100.0]})
    # along x: 0.4 µm, and 1 µrad on an arm of 300 mm; along y the table; along z nothing at X 0 …
    x = math.hypot(0.4, 0.3)
    np.testing.assert_allclose(found.u95_um[:, 0], 2.0 * x)
    np.testing.assert_allclose(found.u95_um[:, 1], [0.2, 0.4, 0.6])
    np.testing.assert_allclose(found.u95_um[:, 2], 0.0, atol=1e-12)
    # … and |E| is along x
    np.testing.assert_allclose(found.u_norm_um, x)
    np.testing.assert_allclose(found.columns["u95_orientation_urad"][:, 1], 2.0)


def test_where_there_is_no_error_the_vector_counts_as_a_whole():
    found = sure(parse_scene(SCENE.replace("EXX = 5\n", ""), "s"), at={"X": 0.0})
    assert float(found.u_norm_um) == pytest.approx(math.sqrt(0.4**2 + 0.3**2 + 0.2**2))


def test_ends_of_an_axis_are_not_sure_by_themselves_near_points_together():
    held = SCENE + "[view]\nreference = { X = -100, Y = 0, Z = 0 }\n"
    found = sure(parse_scene(held, "s"), at={"X": [-100.0, 99.0, 100.0]})
    # a difference of the ends: both add up, of x √2 · 0.5, of y √(0.1² + 0.3²)
    ends = [2.0 * math.hypot(0.5, 0.5), 2.0 * math.hypot(0.1, 0.3), 0.0]
    np.testing.assert_allclose(found.u95_um[[0, 2]], [[0, 0, 0], ends], atol=1e-12)
    np.testing.assert_allclose(found.u95_um[1], found.u95_um[2], rtol=0.01, atol=1e-12)
    # along the axis they vary by u · cos φ and u · sin φ, so that u of a mean is (2 / π) · √2 · u
    alone = HEAD + "[errors]\nEXX = 5\n[uncertainty]\nEXX = 0.4\n"
    mean = volume_uncertainty(parse_scene(alone, "s"), parse_scene(alone, "s").view(), 21)
    assert mean.statistics()["mean_um"] == pytest.approx(2 * 0.4 * math.sqrt(8) / math.pi, rel=2e-3)
    assert mean.statistics()["max_um"] == pytest.approx(2 * 0.4)


def test_a_width_is_not_surer_than_its_points():
    text = HEAD + "[errors]\nEXX = { ramp = 10 }\n[uncertainty]\nEXX = 0.5\n"
    found = run_test(parse_scene(text, "s"), find_test("positioning")(axis="X"))
    by_ends = 2 * math.hypot(0.5, 0.5)
    assert found.u95["M_um"] == pytest.approx(by_ends, rel=1e-3)


TWO = f"""{HEAD}[errors]
EC0Y = 20
EA0Z = -30
[uncertainty.covariance]
keys = ["EC0Y", "EA0Z"]
matrix = [[4.0], [3.0, 9.0]]
dof = 12
"""


def test_two_amplitudes_together_against_the_law_of_propagation():
    # x grows by −y · γ, y by −z' · α …: numbers of the basis, differentiated by hand from errors
    scene = parse_scene(TWO, "s")
    at = {"X": 40.0, "Y": 70.0, "Z": -20.0}
    found = sure(scene, at)
    step = []
    for key in ("EC0Y", "EA0Z"):
        more = scene.errors.with_amplitude(key, scene.errors.amplitude(key) + 1.0, (0.0, 1.0))
        step.append(evaluate(replace(scene, errors=more), at=at).error_um - found.error_um)
    gain, matrix = np.array(step).T, np.array([[4.0, 3.0], [3.0, 9.0]])
    np.testing.assert_allclose(found.covariance_um2, gain @ matrix @ gain.T, atol=1e-9)
    along = found.error_um / found.norm_um
    expected = math.sqrt(along @ gain @ matrix @ gain.T @ along)
    assert float(found.u_norm_um) == pytest.approx(expected, rel=1e-9)
    assert found.statistics()["max_um"] == pytest.approx(coverage_factor(12) * expected)


ALONE = HEAD + "[errors]\nEC0Y = 20\n[uncertainty]\nEC0Y = 1.5\n"
QUESTIONS = (
    Line(points=5),
    Form(nodes=3),
    Conformance(nodes=5, limit_um=40.0),
    Part(place=(0, 0, 0)),
    Clamp(grid=2),
)
OTHERWISE = {"u95": "value", "u95_um": "error_um"}


def numbers(value):
    return np.ravel([*value.values()] if isinstance(value, dict) else value)


def pairs(found):
    """List each U95 with the number it belongs to."""
    for one in found if isinstance(found, list) else []:
        yield from pairs(one)
    for key, value in found.items() if isinstance(found, dict) else []:
        if key.startswith("u95"):
            own = found.get(OTHERWISE.get(key, key.removeprefix("u95_")))
            yield from zip(numbers(value), numbers(own), strict=True) if own is not None else ()
        else:
            yield from pairs(value)


@pytest.mark.parametrize("asked", QUESTIONS, ids=lambda one: one.name)
def test_one_error_makes_every_number_as_unsure_as_itself(asked, tmp_path):
    if isinstance(asked, WorkpieceAnalysis):
        trimesh.creation.box((40, 30, 20)).export(file := tmp_path / "box.stl")
        asked = replace(asked, file=str(file))
    found = asked.run(parse_scene(ALONE, "s"), lambda _: None).as_json()
    found.pop("u95_percent", None)  # no multiple of an error
    u95, value = np.array([*pairs(found)]).T
    assert (np.abs(value) > 0.1).any()
    np.testing.assert_allclose(u95, 2.0 * 1.5 / 20.0 * np.abs(value), atol=1e-6)


def test_numbers_of_errors_that_nobody_states_are_unknown():
    assert scene_uncertainty(load_scene("dvf5000_first")) is None
    scene = parse_scene(ALONE.replace("EC0Y = 1.5", "EXX = 1"), "s")
    for asked in (Form(nodes=3), Conformance(nodes=5, limit_um=40.0)):
        found = asked.run(scene, lambda _: None)
        assert all(u95 is None for u95, _ in pairs(found.as_json()))
        assert "uncertainty of EC0Y is unknown" in " ".join(found.caveats())
        assert any("± ?" in row for block in found.blocks() for row in getattr(block, "rows", ()))


def test_statistics_move_by_their_gradient():
    scene = parse_scene(TWO, "s")
    found, names = volume_uncertainty(scene, scene.view(), 21), ("mean_um", "rms_um", "max_um")
    grid = build_grid(scene.model, scene.workspace, 21)

    def numbers(key, by):
        more = scene.errors.with_amplitude(key, scene.errors.amplitude(key) + by, (0.0, 1.0))
        field = evaluate(replace(scene, errors=more), grid=21)
        of = volume_statistics(field, grid)
        return np.array([getattr(of, name) for name in names])

    slope = np.array([(numbers(k, 1e-3) - numbers(k, -1e-3)) / 2e-3 for k in found.errors.keys])
    matrix = np.array([[4.0, 3.0], [3.0, 9.0]])
    expected = coverage_factor(12) * np.sqrt(np.einsum("kn,kl,ln->n", slope, matrix, slope))
    np.testing.assert_allclose([found.statistics()[n] for n in names], expected, rtol=1e-4)


def test_k_is_two_or_what_student_says():
    # ISO/IEC Guide 98-3, table G.2, column 95.45 %
    printed = {1: 13.97, 2: 4.53, 5: 2.65, 10: 2.28, 20: 2.13, 50: 2.05, math.inf: 2.00}
    for freedom, factor in printed.items():
        assert coverage_factor(freedom) == pytest.approx(factor, abs=0.005)


def test_a_covariance_comes_back_from_its_text_and_from_a_file(tmp_path):
    scene = parse_scene(TWO, "s")
    assert parse_scene(scene_to_toml(scene), "s").covariance == scene.covariance
    reach = replace(scene.covariance, measured_range={"X": (-10.0, 20.0)}, dof=math.inf)
    other = replace(scene, covariance=reach)
    assert parse_scene(scene_to_toml(other), "s").covariance == reach
    np.savez(tmp_path / "c.npz", keys=np.array(["EC0Y", "EA0Z"]), matrix=[[4.0, 3.0], [3.0, 9.0]])
    text = TWO[: TWO.index("[uncertainty.")] + '[uncertainty]\ncovariance = "c.npz"\n'
    (tmp_path / "s.toml").write_text(text)
    read = load_scene(tmp_path / "s.toml").covariance
    assert read == Covariance(("EC0Y", "EA0Z"), ((4.0, 3.0), (3.0, 9.0)))
    (tmp_path / "c.npz").write_bytes(b"PK nothing")
    with pytest.raises(SceneError, match="expected a file of numpy"):
        load_scene(tmp_path / "s.toml")


MATRIX = "[[4.0], [3.0, 9.0]]"
KEYS = '["EC0Y", "EA0Z"]'


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (MATRIX, "[[4.0, 2.0], [3.0, 9.0]]", "is not symmetric"),
        (MATRIX, "[[4.0], [7.0, 9.0]]", "expected a positive matrix"),
        (MATRIX, "[[0.0], [0.0, 9.0]]", "its diagonal above 0"),
        (MATRIX, "[[4.0]]", "expected 2 rows of 2 numbers, or of 1 to 2"),
        (MATRIX, "[[4.0], [nan, 9.0]]", "matrix"),
        (KEYS, '["EC0Y", "EA0Q"]', "EA0Q"),
        (KEYS, '["EC0Y", "EC0Y"]', "expected each error once"),
        ("dof = 12", "freedom = 0", "dof"),
        ("dof = 12", "measured_range = { Q = [0, 1] }", "measured_range.Q"),
        ("[uncertainty.", "[uncertainty]\nEXX = 0\n[uncertainty.", "above 0"),
        ("[uncertainty.", "[uncertainty]\nEC0Y = 1\n[uncertainty.", "expected each error once"),
    ],
)
def test_bad_statements_are_refused_by_name(old, new, said):
    with pytest.raises(SceneError, match=said):
        parse_scene(TWO.replace(old, new), "s")


def test_p95_of_few_large_shares_is_not_certain():
    errors = scene_uncertainty(parse_scene(ALONE, "s"))
    error = np.arange(1.0, 301.0)[:, None] * [1.0, 0.0, 0.0]
    shares = np.r_[np.full(298, 0.4 / 298), 0.2, 0.4]  # none lies within 1 % of 95 %
    field = combine(errors, error[None], error, shares)
    summary = statistics(ErrorField(error, error, error), shares=shares)
    assert field.counts @ field.norm_um == pytest.approx(summary.four)
