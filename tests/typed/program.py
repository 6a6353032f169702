"""A small program as a user types it: checked in strict mode, against the types that come along.

`make lint` checks it against the sources, `make packaging` against the installed wheel, with
pyright and mypy; `tests/unit/test_package.py` runs it.
"""

import numpy as np
from numpy.typing import NDArray

import warpspace
from warpspace import ErrorField, Scene, SceneError


def worst(field: ErrorField) -> tuple[float, NDArray[np.float64]]:
    """Give the largest error in µm, and where it is in mm."""
    norm: NDArray[np.float64] = field.norm_um
    index = np.unravel_index(int(norm.argmax()), norm.shape)
    return float(norm[index]), field.nominal_mm[index]


def largest_gain(scene: Scene) -> tuple[str, float]:
    """Give the error with the largest gain in the middle of the volume."""
    first = warpspace.gains(scene)[0]
    return first.key, first.norm


def load(name: str) -> Scene | None:
    """Load a scene, or say why not."""
    try:
        return warpspace.load_scene(name)
    except SceneError as error:
        print(error)
        return None


def main() -> tuple[float, str, float]:
    """Load, evaluate, rank and sample."""
    scene = load("dvf5000_proposed")
    if scene is None:
        raise SystemExit(2)
    measured = warpspace.load_scene(warpspace.scene_names()[0])
    largest, place_mm = worst(warpspace.evaluate(measured, grid=5, loop="tool"))
    key, _ = largest_gain(scene)
    sampled = warpspace.montecarlo(scene, samples=1000, seed=1)
    mean: float = sampled.mean_um
    print(f"{largest:.2f} µm at {place_mm.round(1)}, {key}, {mean:.1f} µm")
    return largest, key, mean


if __name__ == "__main__":
    main()
