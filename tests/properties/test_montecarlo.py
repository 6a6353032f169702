"""What holds for sampled machines whatever the machine, the loop and the seed."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from warpspace.analysis.loop_parameters import loop_keys
from warpspace.analysis.sampling.cases import Case, Reduction, SamplingPlan, reduce_nodes
from warpspace.analysis.sampling.distribution import Distribution, Stream, build_draws
from warpspace.analysis.sampling.machine_sampling import montecarlo
from warpspace.field.evaluate import View
from warpspace.field.grid import Workspace
from warpspace.kinematics.model import Loop, Model
from warpspace.machine.definition import build_machine
from warpspace.machine.errors import ToleranceSet

CHAINS = ("wCBFXYZt", "wYFXZAt", "wFXYZt", "wAFZt", "wZABFXYCt")


def run(chain, loop, scale, **plan):
    model = Model(build_machine(chain), workpiece_point_mm=(0.0, 100.0, 200.0))
    ranges = {
        name: axis.travel if axis.is_linear else (0.0, 0.0)
        for name, axis in model.machine.axes.items()
    }
    widths = {"translation": 10 * scale, "rotation": 20 * scale, "squareness": 25 * scale}
    keys = loop_keys(model, loop, model.machine.parameter_keys)
    draws = build_draws(ToleranceSet(widths), keys, Distribution.UNIFORM)
    return montecarlo(Case(model, draws, Workspace(ranges), View(loop), SamplingPlan(**plan)))


@given(
    st.sampled_from(CHAINS),
    st.sampled_from([Loop.TOOL, Loop.RELATIVE]),
    st.sampled_from(list(Reduction)),
    st.integers(0, 2**32),
    st.floats(0.1, 10.0),
)
def test_errors_scale_with_the_tolerance_and_quantiles_are_in_order(chain, loop, over, seed, scale):
    plan = {"samples": 300, "seed": seed, "reduction": over, "nodes": 3, "spec_um": 20.0 * scale}
    one, scaled = run(chain, loop, 1.0, **plan), run(chain, loop, scale, **plan)
    np.testing.assert_allclose(scaled.mean_um, scale * one.mean_um, rtol=1e-9)
    assert one.median_um <= one.p95_um <= one.p99_um <= one.max_um
    assert 0.0 <= one.mean_um <= one.rms_um <= one.max_um
    assert one.histogram.counts.sum() == 300
    kept = scaled.probability
    assert 0.0 <= kept.low <= kept.probability <= kept.high <= 1.0


@given(st.integers(1, 400), st.integers(1, 12), st.integers(1, 2000), st.integers(0, 2**32))
def test_blocks_of_any_size_give_what_one_product_gives(machines, keys, nodes, seed):
    rng = np.random.default_rng(seed)
    amplitudes, gains = rng.standard_normal((machines, keys)), rng.standard_normal((3, keys, nodes))
    whole = np.linalg.norm(np.einsum("nk,ckm->cnm", amplitudes, gains), axis=0)
    np.testing.assert_allclose(reduce_nodes(amplitudes, gains, "max"), whole.max(axis=1))
    np.testing.assert_allclose(reduce_nodes(amplitudes, gains, "mean"), whole.mean(axis=1))


@given(st.lists(st.floats(0.0, 1e5), min_size=1, max_size=200), st.integers(1, 7))
def test_a_stream_does_not_depend_on_how_it_is_cut(values, parts):
    whole, cut = Stream(len(values)), Stream(len(values))
    whole.add(np.array(values))
    for chunk in np.array_split(np.array(values), parts):
        if len(chunk):
            cut.add(chunk)
    assert whole.max_um == cut.max_um == max(values)
    assert whole.quantile(0.5) == cut.quantile(0.5)
    assert whole.display_histogram().counts.sum() == len(values)
    np.testing.assert_allclose(whole.mean_um, cut.mean_um)
