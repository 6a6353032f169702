"""Both ends of every limit pass through the whole program; just beyond is refused in one line."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from warpspace import evaluate
from warpspace.analysis.sampling.cases import SamplingPlan
from warpspace.app.documents.scene_file import open_text, state_to_toml
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.state.app_state import EXAGGERATION, NODES, start_state
from warpspace.app.state.edits import half_width_span
from warpspace.app.state.look import RANGE_TOP
from warpspace.app.state.tree import put
from warpspace.exceptions import OptionError, SceneError
from warpspace.field.grid import node_counts
from warpspace.machine import limits
from warpspace.machine.errors import Harmonics
from warpspace.outputs.drawing.settings import FigureSettings, check_size, evaluate_for
from warpspace.scene.library import parse_scene
from warpspace.scene.scene_writer import scene_to_toml

SMALL, LARGE = limits.MIN_NUMBER, limits.MAX_ERROR
LOW, HIGH = limits.EXAGGERATION
HALF = limits.MIN_HALF_WIDTH


@dataclass(frozen=True)
class Case:
    """A line of a scene, values at the ends of its limit, and values just beyond."""

    line: str
    within: tuple[float, ...]
    beyond: tuple[float, ...]


def above(value):
    return math.nextafter(value, math.inf)


def below(value):
    return math.nextafter(value, -math.inf)


ERROR = Case(
    "errors.EXX = {}",
    (-LARGE, -SMALL, 0.0, SMALL, LARGE),
    (below(-LARGE), above(LARGE), below(SMALL), 5e-324, -5e-324),
)
CASES = {
    "exaggeration": Case(
        "view.exaggeration = {}", (LOW, HIGH), (below(LOW), above(HIGH), 1e7, 5e-324)
    ),
    "error": ERROR,
    "constant": Case("errors.EC0Y = {}", ERROR.within, ERROR.beyond),
    "ramp": Case("errors.EXX.ramp = {}", ERROR.within, ERROR.beyond),
    "polynomial": Case("errors.EXX.poly = [{}]", ERROR.within, ERROR.beyond),
    "harmonics": Case("errors.EXX.harmonics = [[1, {}, 0]]", ERROR.within, ERROR.beyond),
    "table": Case("errors.EXX.table = [[0, {}]]", ERROR.within, ERROR.beyond),
    "tolerance": Case(
        "tolerances.EXX = {}", (0.0, HALF, LARGE), (below(HALF), above(LARGE), 5e-324, -HALF)
    ),
    "default tolerance": Case(
        "tolerances.default.rotation = {}", (0.0, HALF, LARGE), (below(HALF), above(LARGE))
    ),
    "centre": Case(
        "tolerances.EXX = {{ centre = {}, half_width = 0 }}", ERROR.within, ERROR.beyond
    ),
    "functional point": Case(
        "points_mm.tool = [{}, 0, 0]",
        (-limits.MAX_LENGTH_MM, SMALL, limits.MAX_LENGTH_MM),
        (below(-limits.MAX_LENGTH_MM), above(limits.MAX_LENGTH_MM), 5e-324),
    ),
    "upper end of the workspace": Case(
        "workspace.X = [0, {}]",
        (limits.MIN_SPAN, limits.MAX_LENGTH_MM),
        (below(limits.MIN_SPAN), above(limits.MAX_LENGTH_MM)),
    ),
}
WITHIN = [(name, value) for name, case in CASES.items() for value in case.within]
BEYOND = [(name, value) for name, case in CASES.items() for value in case.beyond]


def text_of(name, value):
    return f'machine = "dvf5000"\n{CASES[name].line.format(repr(value))}\n'


@pytest.mark.parametrize(("name", "value"), WITHIN)
def test_an_end_passes_through_the_program(name, value):
    scene = parse_scene(text_of(name, value), "x")
    assert np.isfinite(evaluate(scene, grid=3).error_um).all()
    picture = evaluate_for(FigureSettings(grid=3, exaggeration=scene.exaggeration), scene)
    assert LOW <= picture.exaggeration <= HIGH
    state = start_state(scene, nodes=3)
    live = LiveModel().evaluate(state)
    assert np.isfinite(live.drawn_mm).all()
    for key in state.amplitudes:
        assert half_width_span(state, key).high <= LARGE
    opened, _ = open_text(state_to_toml(state), "x", "x.toml")
    assert opened.amplitudes == pytest.approx(state.amplitudes, abs=1e-12)
    assert opened.tolerances == state.tolerances
    assert opened.exaggeration == state.exaggeration
    assert parse_scene(scene_to_toml(scene), "x") == scene


@pytest.mark.parametrize(("name", "value"), BEYOND)
def test_just_beyond_is_refused_in_one_line(name, value):
    with pytest.raises(SceneError) as caught:
        parse_scene(text_of(name, value), "x", "folder/x.toml")
    message = str(caught.value)
    key = CASES[name].line.partition(" ")[0].removesuffix(".poly")
    assert message.startswith(f"folder/x.toml: {key}")
    assert "expected" in message
    assert "\n" not in message


def test_every_number_that_a_slider_gives_can_be_saved():
    text = 'machine = "dvf5000"\nerrors.EXX = 90000\ntolerances.EXX = 90000\n'
    state = start_state(parse_scene(text, "x"))
    state = put(put(state, "amplitudes.EXX", "1e9"), "tolerances.EXX", "1e9")
    opened, _ = open_text(state_to_toml(state), "x", "x.toml")
    assert opened.amplitudes["EXX"] == LARGE
    assert opened.tolerances.individual["EXX"].half_width == LARGE
    tiny = put(state, "tolerances.EXX", repr(HALF / 2.0))
    opened, _ = open_text(state_to_toml(tiny), "x", "x.toml")
    assert opened.tolerances.individual["EXX"].half_width == 0.0


def test_widgets_and_options_take_the_limits_of_files():
    assert (EXAGGERATION.low, EXAGGERATION.high) == limits.EXAGGERATION
    assert (RANGE_TOP.low, RANGE_TOP.high) == limits.RANGE_TOP
    assert (NODES.low, NODES.high) == limits.LIVE_NODES


@pytest.mark.parametrize(
    ("make", "pair"),
    [
        (lambda value: FigureSettings(exaggeration=value), limits.EXAGGERATION),
        (lambda value: FigureSettings(range_top=value), limits.RANGE_TOP),
        (node_counts, limits.GRID_NODES),
        (lambda value: SamplingPlan(samples=value).check(), limits.SAMPLES),
    ],
    ids=["exaggeration", "range", "grid", "samples"],
)
def test_options_take_both_ends_and_refuse_what_lies_beyond(make, pair):
    low, high = pair
    for end in pair:
        make(end)
    outside = (below(low), above(high)) if isinstance(low, float) else (low - 1, high + 1)
    for value in outside:
        with pytest.raises(OptionError, match="expected"):
            make(value)


def test_figures_take_both_ends_of_their_size():
    width, height = limits.MIN_FIGURE_PX
    side = limits.MAX_FIGURE_SIDE_PX
    other = limits.MAX_FIGURE_AREA_PX // side
    check_size((width, height))
    check_size((side, other))
    for size in ((width - 1, height), (width, height - 1), (side + 1, 400), (side, other + 1)):
        with pytest.raises(OptionError, match="expected"):
            check_size(size)


def test_the_peak_of_a_curve_is_looked_for_once_and_costs_no_more_than_a_limit():
    """36 curves of 64 terms took 10 s to open, and each later step as long."""
    wave = Harmonics((-1e5, 1e5), tuple((1000.0, 1.0, float(n)) for n in range(limits.MAX_TERMS)))
    assert wave.cosines <= 2_000_000
    calls: list[int] = []

    class Counted(Harmonics):
        def evaluate(self, position):
            calls.append(np.size(position))
            return super().evaluate(position)

    counted = Counted((0.0, 360.0), ((1.0, 2.0, 0.0),))
    assert [counted.amplitude for _ in range(5)] == [2.0] * 5
    counted.with_amplitude(3.0)
    assert len(calls) == 1


def test_many_fine_harmonics_are_remarked_on():
    terms = ", ".join(f"[{900 + n}, 0.1, 0]" for n in range(64))
    keys = [f"E{d}{axis}" for axis in "XYZ" for d in "XYZABC"]
    lines = "\n".join(f"{key} = {{ harmonics = [{terms}] }}" for key in keys)
    scene = parse_scene(f'machine = "dvf5000"\n[errors]\n{lines}\n', "x")
    assert any("18 curves with 1152 harmonics" in note for note in scene.notes)
    few = parse_scene('machine = "dvf5000"\nerrors.EXX.harmonics = [[36, 1, 0]]\n', "x")
    assert few.notes == parse_scene('machine = "dvf5000"\n', "x").notes
