"""Circles that cannot be run."""

import pytest

import warpspace
from warpspace.exceptions import OptionError, UnknownNameError

SCENE = warpspace.load_scene("dvf5000_first")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"plane": "XY", "radius_mm": 226}, "Y would run -226 … 226 mm, the volume has -225 … 225"),
        ({"plane": "XY", "radius_mm": 226}, "largest radius about this centre: 225 mm"),
        ({"plane": "XZ", "radius_mm": 10, "centre": {"Z": 0.0}}, "Z would run -10 … 10"),
        ({"plane": "XY", "radius_mm": 10, "centre": {"Z": 5.0}}, "Z = 5 lies outside"),
        ({"plane": "XY", "radius_mm": 0}, "radius: 0 mm"),
        ({"plane": "XY", "radius_mm": float("nan")}, "radius: nan mm"),
        ({"plane": "ZX", "radius_mm": 10}, "plane 'ZX'; expected one of XY, XZ, YZ"),
        ({"plane": "XY", "radius_mm": 10, "points": 7}, "points: 7"),
    ],
)
def test_impossible_circles(options: dict, message: str) -> None:
    with pytest.raises(OptionError, match=message):
        warpspace.ballbar(SCENE, **options)


def test_circle_that_touches_the_limits_is_run() -> None:
    assert warpspace.ballbar(SCENE, plane="XY", radius_mm=225).radial_um.shape == (360,)


def test_unknown_axis_of_the_centre() -> None:
    with pytest.raises(UnknownNameError, match="axis 'A'"):
        warpspace.ballbar(SCENE, plane="XY", radius_mm=10, centre={"A": 1.0})


def test_plane_the_machine_does_not_have() -> None:
    scene = warpspace.load_scene("machine_scara")
    with pytest.raises(OptionError, match="has no axis X"):
        warpspace.ballbar(scene, plane="XY", radius_mm=0.5)
