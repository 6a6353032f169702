"""Hypothesis strategies for machines with any chain, and the one finite-difference helper."""

from collections.abc import Sequence

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from warpspace.kinematics.chain import loop_error
from warpspace.kinematics.model import Loop, Model, convention_names
from warpspace.machine.axes import AXIS_NAMES, MAX_AXES, is_linear
from warpspace.machine.definition import FIXED_FRAMES, Chain, build_machine

MAX_OFFSET_MM = 1000.0
MAX_LINEAR_MM = 500.0
TURNED = st.sampled_from((False, False, True))
STEP = 50.0
"""Step of the central difference, µm or µrad: cubic terms and rounding are both far below 1e-6."""


def lengths(limit: float = MAX_OFFSET_MM) -> st.SearchStrategy[float]:
    return st.integers(-int(limit * 1000), int(limit * 1000)).map(lambda um: um / 1000.0)


def vectors(limit: float = MAX_OFFSET_MM) -> st.SearchStrategy[tuple[float, float, float]]:
    return st.tuples(lengths(limit), lengths(limit), lengths(limit))


@st.composite
def chains(draw: st.DrawFn) -> Chain:
    plain = st.permutations("XYZABC")
    any_names = st.lists(st.sampled_from(AXIS_NAMES), min_size=1, max_size=MAX_AXES, unique=True)
    order = draw(plain | any_names)
    count = draw(st.integers(1, len(order)))
    split = draw(st.integers(0, count))
    return Chain(tuple(order[:split]), tuple(order[split:count]))


@st.composite
def models(draw: st.DrawFn, component_errors: str | None = None) -> Model:
    chain = draw(chains())
    frames = (*chain.axes, *FIXED_FRAMES)
    machine = build_machine(
        chain,
        offset_mm={frame: draw(vectors()) for frame in frames},
        rotation_deg={frame: draw(vectors(180.0)) for frame in frames if draw(TURNED)},
        direction={axis: draw(st.sampled_from((1, -1))) for axis in chain.axes},
    )
    names = st.sampled_from(convention_names())
    convention, own = component_errors or draw(names), ()
    if component_errors is None:
        own = tuple((axis, draw(names)) for axis in chain.axes if draw(TURNED))
    return Model(machine, convention, draw(vectors(300.0)), draw(vectors(300.0)), own)


def positions(
    model: Model, shape: tuple[int, ...] = ()
) -> st.SearchStrategy[dict[str, np.ndarray]]:
    limits = {axis: MAX_LINEAR_MM if is_linear(axis) else 180.0 for axis in model.machine.axes}
    return st.fixed_dictionaries(
        {axis: hnp.arrays(float, shape, elements=lengths(limit)) for axis, limit in limits.items()}
    )


def central_differences(
    model: Model,
    loop: Loop,
    keys: Sequence[str],
    coordinates: dict[str, np.ndarray],
    point_mm: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of the exact chain, at zero errors, for single coordinates."""
    steps = STEP * np.eye(len(keys))

    def at(sign: float) -> tuple[np.ndarray, np.ndarray]:
        values = dict(zip(keys, sign * steps, strict=True))
        return loop_error(model, loop, coordinates, values, point_mm)

    position, tilt = (
        np.broadcast_to((up - down) / (2.0 * STEP), (len(keys), 3))
        for up, down in zip(at(1.0), at(-1.0), strict=True)
    )
    return position, tilt
