"""What readings leave open is unknown, not exactly known: planted machines and closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from bench_scenes import MACHINE, vectors
from warpspace.analysis.uncertainty.propagation import scene_uncertainty, volume_uncertainty
from warpspace.calibration import Calibrate, calibrate
from warpspace.machine.errors import Constant
from warpspace.scene.library import load_scene, parse_scene
from warpspace.scene.scene_writer import scene_to_toml

KEYS = ("EXX:ramp", "EC0Y", "EA0Z", "EB0Z")
SCENE = parse_scene(MACHINE, "s")


def plane(z, seed=0, session="one"):
    """Read 25 points at each of some heights, 1 µm scatter, nothing planted."""
    grid = np.meshgrid(np.linspace(-100, 300, 5), np.linspace(-100, 100, 5), z)
    poses = {axis: part.ravel() for axis, part in zip("XYZ", grid, strict=True)}
    noise = np.random.default_rng(seed).standard_normal((len(poses["X"]), 3))
    return vectors(SCENE, poses, noise, session)


def test_squareness_of_an_axis_that_stood_still_is_open_and_makes_the_map_unknown():
    readings = plane([-150.0])
    found = calibrate(SCENE, [readings], Calibrate(fit=KEYS))
    known = found.scene.covariance
    assert known.undetermined == ("EA0Z", "EB0Z")
    assert known.keys == ("EXX", "EC0Y")
    # what is told is as sure as a straight line through the points: σ over the spread of y
    u = {one.key: one.standard_uncertainty for one in found.parameters}
    y = readings.coordinates["Y"]
    assert u["EC0Y"] == pytest.approx(1e6 * found.sigma_mm / np.sqrt(np.sum(y**2)), rel=1e-3)
    assert known.measured_range["Z"] == (-150.0, -150.0)
    back = parse_scene(scene_to_toml(found.scene), "s")
    assert back.covariance == known
    assert set(volume_uncertainty(back, back.view(), 3).statistics().values()) == {None}


def test_what_is_measured_all_over_leaves_nothing_open():
    found = calibrate(SCENE, [plane([-200.0, 0.0])], Calibrate(fit=KEYS))
    assert found.scene.covariance.undetermined == ()
    assert scene_uncertainty(found.scene).is_known


def test_what_was_open_and_is_found_or_stated_is_open_no_longer():
    flat = calibrate(SCENE, [plane([-150.0])], Calibrate(fit=KEYS)).scene
    high = calibrate(flat, [plane([-200.0, 0.0])], Calibrate(fit=("EA0Z", "EB0Z"))).scene
    assert high.covariance.undetermined == ()
    assert set(high.covariance.keys) == {"EXX", "EC0Y", "EA0Z", "EB0Z"}
    again = calibrate(high, [plane([-150.0])], Calibrate(fit=KEYS)).scene
    assert again.covariance.undetermined == ()  # held where the scene says how sure it is
    stated = {"EA0Z": Constant((-200.0, 0.0), 2.0), "EB0Z": Constant((-200.0, 0.0), 2.0)}
    told = replace(SCENE, uncertainty=stated)
    found = calibrate(told, [plane([-150.0])], Calibrate(fit=KEYS)).scene
    assert found.covariance.undetermined == ()
    assert found.uncertainty == stated


def test_tolerances_as_knowledge_are_what_is_known_of_what_readings_leave_open():
    width = {"translation": 10.0, "rotation": 20.0, "squareness": 30.0}
    scene = replace(SCENE, tolerances=replace(SCENE.tolerances, default=width))
    found = calibrate(scene, [plane([-150.0])], Calibrate(fit=KEYS, priors=True))
    assert found.scene.covariance.undetermined == ()
    u = {one.key: one.standard_uncertainty for one in found.parameters}
    assert u["EA0Z"] == pytest.approx(30.0 / np.sqrt(3.0), rel=1e-6)  # uniform, GUM 4.3.7


DVF = load_scene("dvf5000_nominal")


def test_places_that_act_alike_wherever_axes_stand_lose_nothing_by_one_held():
    """Two tables on each other that do not turn: only the sum of their places acts."""
    still = {"X": np.linspace(-200.0, 200.0, 9)}
    readings = vectors(DVF, still, np.random.default_rng(1).standard_normal((9, 3)))
    pair = Calibrate(fit=("EX0B", "EX0C"))
    found = calibrate(DVF, [readings], pair)
    assert found.rank.confounded == (("EX0C", "EX0B"),)
    assert found.scene.covariance.undetermined == ()
    (variance,) = found.scene.covariance.matrix.ravel()
    assert variance == pytest.approx((1e3 * found.sigma_mm) ** 2 / 9.0)
    # C rides on B: where B is turned they do not act alike, and nobody measured there
    ranges = {**DVF.workspace.ranges, "B": (30.0, 30.0)}
    turned = replace(DVF, workspace=replace(DVF.workspace, ranges=ranges))
    elsewhere = replace(readings, coordinates={**readings.coordinates, "B": np.zeros(9)})
    assert calibrate(turned, [elsewhere], pair).scene.covariance.undetermined == ("EX0C", "EX0B")


def test_a_model_that_misses_something_says_so_after_it_is_saved():
    readings = replace(plane([-200.0, 0.0]), sigma_mm=np.full(50, 0.2e-3))  # a fifth of the scatter
    found = calibrate(SCENE, [readings], Calibrate(fit=KEYS))
    assert found.lack_of_fit == pytest.approx(5.0, rel=0.15)
    back = parse_scene(scene_to_toml(found.scene), "s")
    assert back.covariance.lack_of_fit == found.lack_of_fit
    (said,) = scene_uncertainty(back).remarks()
    assert f"residuals of the calibration are {found.lack_of_fit:.1f} times" in said
    honest = replace(readings, sigma_mm=np.full(50, 1e-3))
    assert calibrate(SCENE, [honest], Calibrate(fit=KEYS)).scene.covariance.lack_of_fit == 0.0
