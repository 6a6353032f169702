"""Draws, places and the stream of samples."""

import numpy as np
import pytest
from scipy import stats

import warpspace
from warpspace.analysis import distribution as streams
from warpspace.analysis.distribution import Stream, round_width
from warpspace.analysis.draws import Distribution, Draws, build_draws
from warpspace.analysis.points import (
    Cylinder,
    average_places,
    choose_cylinder,
    extreme_places,
    random_places,
    spread_places,
)
from warpspace.exceptions import OptionError, SceneError
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.model import Loop, Model
from warpspace.kinematics.transforms import apply, inverse
from warpspace.machine.tolerances import Tolerance, ToleranceSet

SCENE = warpspace.load_scene("dvf5000_general")


def draws(distribution: str, *, clip: bool = False) -> Draws:
    return Draws(
        ("EAX", "EXX"), np.array([5.0, 0.0]), np.array([6.0, 0.0]), Distribution(distribution), clip
    )


@pytest.mark.parametrize(
    ("distribution", "clip"), [("uniform", False), ("normal", False), ("normal", True)]
)
def test_variance_mean_and_limits(distribution: str, clip: bool) -> None:
    chosen = draws(distribution, clip=clip)
    values = chosen.draw(np.random.default_rng(0), 400_000)
    np.testing.assert_allclose(values.mean(axis=0), [5.0, 0.0], atol=0.03)
    np.testing.assert_allclose(values.var(axis=0), chosen.variance, rtol=0.01)
    outside = np.abs(values[:, 0] - 5.0) > 6.0
    if distribution == "normal" and not clip:
        assert outside.mean() == pytest.approx(0.0027, abs=0.0004)
    else:
        assert not outside.any()
    assert np.all(values[:, 1] == 0.0)


def test_clipped_normal_is_the_truncated_normal() -> None:
    expected = 4.0 * stats.truncnorm.var(-3.0, 3.0)
    assert draws("normal", clip=True).variance[0] == pytest.approx(expected)


@pytest.mark.parametrize("clip", [False, True])
@pytest.mark.parametrize("distribution", list(Distribution))
def test_inverse_distribution_has_the_same_variance(distribution: str, clip: bool) -> None:
    chosen = draws(distribution, clip=clip)
    unit = np.repeat((np.arange(200_000)[:, None] + 0.5) / 200_000, 2, axis=1)
    np.testing.assert_allclose(chosen.from_unit(unit).var(axis=0), chosen.variance, rtol=1e-3)


def test_bad_tolerances() -> None:
    with pytest.raises(SceneError, match="has no tolerances"):
        build_draws(ToleranceSet(), ["EAX"])
    with pytest.raises(SceneError, match="no half width for EAX, EC0Y"):
        build_draws(ToleranceSet({"translation": 1.0}), ["EXX", "EAX", "EC0Y"])
    with pytest.raises(SceneError, match="half width -1"):
        build_draws(ToleranceSet(own={"EAX": Tolerance(0.0, -1.0)}), ["EAX"])
    with pytest.raises(SceneError, match="half width nan"):
        build_draws(ToleranceSet(own={"EAX": Tolerance(0.0, float("nan"))}), ["EAX"])
    with pytest.raises(OptionError, match="distribution 'beta'"):
        build_draws(ToleranceSet({"rotation": 1.0}), ["EAX"], "beta")


def test_workpiece_points_fill_the_cylinder_uniformly() -> None:
    size = choose_cylinder(SCENE.model)
    assert size == Cylinder(550.0, 450.0)
    rng = np.random.default_rng(1)
    places = random_places(SCENE.model, Loop.WORKPIECE, SCENE.workspace, size, rng, 50_000)
    pose = branch_pose(SCENE.model, "workpiece", places.coordinates)
    x, y, z = apply(inverse(pose), places.point_mm).T
    radius = np.hypot(x, y)
    assert radius.max() <= 275.0 + 1e-6
    assert z.min() >= -1e-6
    assert z.max() <= 450.0 + 1e-6
    assert np.mean(radius**2) == pytest.approx(275.0**2 / 2.0, rel=0.01)
    assert np.mean(z) == pytest.approx(225.0, rel=0.01)
    assert places.coordinates["B"].min() == pytest.approx(-120.0, abs=0.1)
    assert places.coordinates["C"].max() == pytest.approx(360.0, abs=0.1)


@pytest.mark.parametrize("loop", list(Loop))
def test_places_have_one_point_per_node(loop: Loop) -> None:
    size = choose_cylinder(SCENE.model)
    spread = spread_places(SCENE.model, loop, SCENE.workspace, size, 5)
    assert spread.point_mm.reshape(-1, 3).shape == (125, 3)
    extreme = extreme_places(SCENE.model, loop, SCENE.workspace, size, 5)
    assert len(extreme.point_mm) == (8 if loop is not Loop.WORKPIECE else 2 * 5 * 5 * 5)
    assert average_places(SCENE.model, loop, SCENE.workspace, size).point_mm.shape[-1] == 3


@pytest.mark.parametrize("size", [(0.0, 5.0), (5.0, -1.0), (1e6, 1.0), (float("nan"), 1.0)])
def test_impossible_cylinders(size) -> None:
    with pytest.raises(OptionError, match="cylinder"):
        choose_cylinder(SCENE.model, Cylinder(*size))


def test_a_workpiece_point_on_the_axis_stands_for_no_cylinder() -> None:
    with pytest.raises(OptionError, match="--cylinder"):
        choose_cylinder(Model(SCENE.machine))


@pytest.fixture
def both(monkeypatch: pytest.MonkeyPatch) -> tuple[Stream, Stream, np.ndarray]:
    """The same samples kept whole and as a fine histogram."""
    values = np.random.default_rng(3).gamma(4.0, 10.0, 60_000)
    exact = Stream(len(values), 50.0)
    monkeypatch.setattr(streams, "EXACT_SAMPLES", 10)
    fine = Stream(len(values), 50.0)
    for chunk in np.array_split(values, 7):
        exact.add(chunk)
        fine.add(chunk)
    return exact, fine, values


def test_fine_histogram_keeps_its_resolution(both) -> None:
    exact, fine, values = both
    assert exact.exact_quantiles
    assert not fine.exact_quantiles
    for share in (0.01, 0.5, 0.95, 0.99):
        assert exact.quantile(share) == pytest.approx(np.quantile(values, share), rel=1e-12)
        assert fine.quantile(share) == pytest.approx(exact.quantile(share), rel=2e-4)
    assert fine.mean_um == pytest.approx(values.mean(), rel=1e-12)
    assert fine.max_um == values.max()
    assert fine.mode_um() == pytest.approx(exact.mode_um(), abs=0.2)


def test_histograms_lose_no_sample(both) -> None:
    exact, fine, values = both
    for stream in (exact, fine):
        found = stream.display_histogram()
        assert found.counts.sum() == len(values)
        assert found.edges_um[0] == 0.0
        assert 32 <= len(found.counts) <= 81
    assert np.abs(exact.display_histogram().counts - fine.display_histogram().counts).max() < 30


def test_mode_is_the_peak() -> None:
    stream = Stream(400_000)
    stream.add(np.random.default_rng(3).gamma(4.0, 10.0, 400_000))
    assert stream.mode_um() == pytest.approx(30.0, abs=0.7)


def test_probability_is_the_wilson_interval() -> None:
    stream = Stream(1000, 0.25)
    stream.add(np.arange(1000) / 1000.0)
    found = stream.probability()
    p, z, n = 0.251, stats.norm.ppf(0.975), 1000
    centre = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    assert found.probability == p
    assert (found.low, found.high) == pytest.approx((centre - half, centre + half))


def test_all_zero_samples() -> None:
    stream = Stream(5)
    stream.add(np.zeros(5))
    assert stream.mode_um() == 0.0
    assert stream.display_histogram().counts.tolist() == [5]


@pytest.mark.parametrize(("least", "width"), [(0.0, 1.0), (0.7, 1.0), (1.3, 2.0), (0.021, 0.05)])
def test_round_width(least: float, width: float) -> None:
    assert round_width(least) == pytest.approx(width)
