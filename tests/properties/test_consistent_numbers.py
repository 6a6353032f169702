"""Whatever the state: heading, legend, rows, sections, report and offline page state one number.

Mean and max are computed a second time, from the exact chain of the machine: the derivative of the
motion of the functional points with respect to a factor of all errors.
"""

import random
import re
from dataclasses import replace
from functools import cache
from html import unescape
from types import SimpleNamespace

import numpy as np
import pytest

from app.parts import Nobody
from warpspace.app.documents import offline_page
from warpspace.app.evaluation.compare import scene_side, with_pin, with_proposal, with_sides
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.panels.error_list import ErrorsPanel
from warpspace.app.panels.explanation import VolumePanel, WorstPanel
from warpspace.app.panels.file_dialogs import ReportDialog
from warpspace.app.panels.improve import BOXES, with_box
from warpspace.app.panels.overlay import HeadPanel, LegendPanel
from warpspace.app.panels.page_panels import TopPanel
from warpspace.app.state.app_state import AppState, Side, start_state
from warpspace.field.evaluate import error_values
from warpspace.formats.compensation.compensate import Compensate, compensate
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.model import Loop
from warpspace.outputs.report.review import ReportSettings, build_review, first_page
from warpspace.outputs.report.templating import Cards, Text
from warpspace.picture.formatting import LOOP_WORDS
from warpspace.scene.library import load_scene, scene_names

LIVE = LiveModel()
NODES = 3
STEP = 1e-2  # factor of the errors, of which the derivative is taken
LOOPS = {words: loop for loop, words in LOOP_WORDS.items()}
FACTORS = (0.0, 0.5, -1.0, 2.5)
TABLED = ("dvf5000_first", "machine_gantry_mill", "teach_tilted_c")  # compensated
SCENES = {name: load_scene(name) for name in scene_names()}

# --- Random states --------------------------------------------------------------------------------


@cache
def controller_of(name):
    return compensate(SCENES[name], Compensate(formats=("iso-text",), points=3), 3).controller


def changed(state: AppState, chance: random.Random) -> AppState:
    """Change some errors, exclude some, and turn rotary axes."""
    keys = [key for key in state.amplitudes if chance.random() < 0.3]
    sizes = {key: round(chance.uniform(-40.0, 40.0), 2) for key in keys}
    excluded = frozenset(key for key in state.amplitudes if chance.random() < 0.1)
    spans = state.position_spans
    turned = {axis: round(chance.uniform(span.low, span.high), 1) for axis, span in spans.items()}
    state = replace(state, amplitudes={**state.amplitudes, **sizes})
    if chance.random() < 0.3:
        state = replace(state, exclusions=replace(state.exclusions, excluded=excluded))
    return replace(state, positions=turned) if chance.random() < 0.3 else state


def random_state(seed: int) -> AppState:
    chance = random.Random(seed)
    name = chance.choice([*SCENES, *TABLED])
    state = changed(start_state(SCENES[name], nodes=NODES), chance)
    limit = chance.choice([None, None, 5.0, 50.0, round(chance.uniform(1.0, 90.0), 1)])
    look = replace(
        state.look, pass_fail=chance.random() < 0.3,
        drawing="rotary" if chance.random() < 0.2 else "volume",
    )  # fmt: skip
    state = replace(
        state, loop=chance.choice([*Loop]), placed=chance.random() < 0.1, look=look,
        component=chance.choice(["norm", "norm", "norm", "z"]),
        specification=replace(state.specification, limit_um=limit),
    )  # fmt: skip
    match chance.choice(["none", "pin", "scene", "preview", "table"]):
        case "pin":
            state = changed(with_pin(state), chance)
        case "scene":
            other = scene_side(SCENES[chance.choice([*SCENES])])
            state = with_sides(state, other, Side())
        case "preview":
            state = with_proposal(state, changed(state, chance).resulting_scene(), "after a shim")
        case "table" if name in TABLED:
            state = with_box(state, chance.choice([*BOXES]), controller_of(name))
        case _:
            pass
    shown = chance.choice(["a", "b", "difference"])
    return replace(state, comparison=replace(state.comparison, shown=shown))


# --- The numbers, from the chain ------------------------------------------------------------------


def moved_mm(model, loop, at, point_mm, values):
    """Compute where points of R, [..., 3], come to with errors, in a loop."""

    def moved(side):
        nominal, actual = branch_pose(model, side, at), branch_pose(model, side, at, values)
        step = actual @ np.linalg.inv(nominal)
        return np.einsum("...ij,...j->...i", step[..., :3, :3], point_mm) + step[..., :3, 3]

    tool, workpiece = moved("tool"), moved("workpiece")
    return {Loop.TOOL: tool, Loop.WORKPIECE: workpiece, Loop.RELATIVE: tool - workpiece}[loop]


def first_order_um(state, loop, at, point_mm):
    model = state.scene.model
    values = error_values(model, state.active_scene().errors, at)

    def scaled(by):
        return moved_mm(model, loop, at, point_mm, {key: by * v for key, v in values.items()})

    return (scaled(STEP) - scaled(-STEP)) / (2.0 * STEP) * 1e3


def tool_mm(model, at):
    """Compute the nominal tool point in R: where the tool frame carries its functional point."""
    return branch_pose(model, "tool", at)[..., :3, :] @ [*model.tool_point_mm, 1.0]


def volume(state, nodes):
    """Lay nodes over the axes that span the volume; return positions and shares of the volume."""
    workspace = state.scene.workspace.moved(state.positions)
    axes, positions = state.scene.machine.axes, workspace.positions
    at = {axis: np.asarray(float(positions.get(axis, 0.0))) for axis in axes}
    spanning, weights = [axis for axis in workspace.volume_axes if axis in at], np.ones(())
    share = np.ones(nodes)
    share[[0, -1]] = 0.5
    for _ in spanning:
        weights = weights[..., None] * share / share.sum()
    lines = [np.linspace(*workspace.ranges[axis], nodes) for axis in spanning]
    at |= dict(zip(spanning, np.meshgrid(*lines, indexing="ij", sparse=True), strict=True))
    return at, weights


def placement_um(state, at, point_mm):
    """Fit three shifts and rotations of the workpiece in its frame; return their effect."""
    model = state.scene.model

    def columns(at, point_mm):
        pose = branch_pose(model, "workpiece", at)
        turn = np.broadcast_to(pose[..., :3, :3], (*point_mm.shape[:-1], 3, 3))
        lever = np.einsum("...ji,...j->...i", turn, point_mm - pose[..., :3, 3])
        rotations = np.cross(np.eye(3), lever[..., None, :])  # [..., rotation, 3]
        return np.concatenate([turn, np.einsum("...ij,...kj->...ik", turn, rotations)], axis=-1)

    nodes, weights = volume(state, 21)
    points = np.broadcast_to(tool_mm(model, nodes), (*weights.shape, 3))
    root = np.sqrt(weights)[..., None]
    error = first_order_um(state, Loop.RELATIVE, nodes, points)
    design = (columns(nodes, points) * root[..., None]).reshape(-1, 6)
    fitted = np.linalg.lstsq(design, (error * root).reshape(-1), rcond=1e-9)[0]
    return columns(at, point_mm) @ fitted


def expected_um(state, at, point_mm, loop=None):
    """Compute the errors that a state has at points: first order, or the residual of its table."""
    scene, loop = state.scene, loop or state.loop
    if state.controller is not None:
        return state.controller.field(at, point_mm, state.active_scene(), loop, point_mm).error_um
    placed = state.placed and loop is Loop.RELATIVE

    def absolute(at, point_mm):
        error = first_order_um(state, loop, at, point_mm)
        return error - placement_um(state, at, point_mm) if placed else error

    error = absolute(at, point_mm)
    if scene.reference is not None:
        fixed = {axis: np.asarray(scene.reference.get(axis, p)) for axis, p in at.items()}
        error = error - absolute(fixed, tool_mm(scene.model, fixed))
    return error


def mean_and_max(picture):
    """Compute both again for what is drawn: volume or traces, of a side or a difference."""
    compared = picture.compared
    sides = [picture.drawn_state]
    if compared is not None and picture.is_difference:
        sides = [*compared.sides[::-1]]

    def errors(state):
        if not picture.is_rotary:
            at, weights = volume(state, picture.state.nodes)
            point = np.broadcast_to(tool_mm(state.scene.model, at), (*weights.shape, 3))
            return expected_um(state, at, point).reshape(-1, 3), weights.reshape(-1)
        groups = [of.group for of in LIVE.evaluate(state).traces]
        each = [expected_um(state, of.coordinates, of.nominal_mm, of.loop) for of in groups]
        together = np.concatenate([np.zeros((0, 3)), *(part.reshape(-1, 3) for part in each)])
        return together, np.full(len(together), 1.0 / max(len(together), 1))

    values, weights = errors(sides[0])
    norm = np.linalg.norm(values - (errors(sides[1])[0] if len(sides) > 1 else 0.0), axis=-1)
    return float(norm @ weights), float(norm.max(initial=0.0))


# --- What is stated -------------------------------------------------------------------------------


def text_of(html) -> str:
    text = unescape(re.sub(r"<[^>]*>", " ", str(html))).replace("\N{MINUS SIGN}", "-")
    return " ".join(text.split())


def numbers_after(words: str, text: str) -> list[float]:
    return [float(n) for n in re.findall(rf"{words} (-?[\d.]+)", text)]


def limits_in(text: str) -> set[float]:
    return set(numbers_after(r"(?:of the volume within|limit of|Limit:)", text))


def near(stated, number, digits=1, rel=1e-4):
    assert stated, "not stated"
    assert stated == pytest.approx([number] * len(stated), abs=0.51 * 10.0**-digits, rel=rel)


def check_page(state: AppState) -> None:
    picture = LIVE.evaluate(state)
    mean, largest = mean_and_max(picture)
    limit = state.specification.limit_um
    head = text_of(HeadPanel(None).render(picture)["head"])
    near(numbers_after("mean", head)[:1], mean)
    near(numbers_after("max", head)[:1], largest)
    near(numbers_after("(?:rrors|Change) up to", head)[:1] or [0.0], largest)
    stated_loops = {LOOPS[words] for words in LOOPS if words in head.split(" at ")[0]}
    pieces = LegendPanel(None).render(picture)
    kept, legend = text_of(pieces["head.kept"]), text_of(pieces["legend"])
    if picture.is_difference:
        assert not stated_loops
    elif not picture.is_rotary:
        assert stated_loops == {picture.drawn_state.loop}
        assert limits_in(kept) == ({limit} if limit else set())
        assert ("no limit set" in kept) is (limit is None)
        assert ("all of the volume" in kept) is (limit is not None and largest <= limit)
    if picture.component == "norm" and largest:  # no errors, no marks
        near(numbers_after("mean", legend)[:1], mean)
        near(numbers_after("max", legend)[:1], largest)
        judged = limit is not None and not picture.is_difference and not picture.is_rotary
        assert ("limit" in legend) is judged
    check_sections(picture, mean, largest)


def check_sections(picture, mean, largest) -> None:
    state, drawn = picture.state, picture.drawn_state
    limit = state.specification.limit_um
    if not picture.is_rotary:
        volume_text = text_of(VolumePanel(None).body(picture))
        near(numbers_after(r"(?<!tilt, )mean", volume_text)[:1], mean)
        near(numbers_after(r"(?<!tilt, )max", volume_text)[:1], largest)
        assert LOOP_WORDS[drawn.loop] in volume_text
        worst = WorstPanel(None).heading(picture)
        if not picture.is_difference and drawn.controller is None:
            near(numbers_after("point:", worst) or [0.0], largest)
    rows = ErrorsPanel(None).render(picture)
    chosen, view = state.comparison, picture.compared and picture.compared.view
    others = {"difference": True, "a": chosen.a.state, "b": chosen.b and chosen.b.state}
    assert ("the drawing shows" in rows["errors"]) is (others.get(view) is not None)
    for key, value in state.amplitudes.items():
        stated = re.search(r'data-text="([^"]*)"', rows[f"error.{key}"])[1]
        assert float(stated.replace("\N{MINUS SIGN}", "-")) == pytest.approx(value)
        is_off = "ws-error-head off" in rows[f"error.{key}"]
        assert is_off is not state.exclusions.active(key)
    store, page = SimpleNamespace(undoes="", redoes=""), SimpleNamespace(report=None)
    context = Nobody(store=store, page=page, report_results=[])
    top = text_of(TopPanel(context).render(picture)["top"])
    assert state.scene.title in top
    dialog = text_of(ReportDialog(context).body(picture))
    assert limits_in(dialog) == ({limit} if limit else set())
    assert ("No limit is set" in dialog) is (limit is None)


@pytest.mark.parametrize("seeds", [
    range(80), *(pytest.param(range(start, start + 300), marks=pytest.mark.nightly)
                  for start in range(80, 10_000, 300)),
])  # fmt: skip
def test_heading_legend_rows_and_sections_state_the_same(seeds):
    for seed in seeds:
        try:
            check_page(random_state(seed))
        except AssertionError as error:
            raise AssertionError(f"state {seed}: {error}") from error


def check_files(state: AppState) -> None:
    """Check the text of the offline page, and the first page of the report of a single machine."""
    picture = LIVE.evaluate(state)
    mean, largest = mean_and_max(picture)
    limit = state.specification.limit_um
    step = offline_page.PageStep(picture, offline_page._usual_camera(picture))
    heading, column, _ = map(text_of, offline_page._step_pieces(step, picture.title))
    near(numbers_after("mean", heading)[:1], mean)
    near(numbers_after("max", heading)[:1], largest)
    if not picture.is_rotary and not picture.is_difference:
        near(numbers_after("mean", column)[-1:], mean)
        near(numbers_after("max", column)[-1:], largest)
        assert limits_in(heading) == ({limit} if limit else set())
        assert ("no limit set" in heading) is (limit is None)
        assert LOOP_WORDS[picture.drawn_state.loop] in heading
    if picture.compared is not None or picture.is_rotary or state.controller is not None:
        return
    settings = ReportSettings(loop=state.loop, grid=NODES, spec_um=limit, samples=100)
    review = build_review([state.active_scene()], settings)
    lead, cards, *_ = first_page(review, Text(""))
    assert isinstance(lead, Text)
    assert isinstance(cards, Cards)
    assert review.scenes[0].scene.title == picture.title
    stated = {name: float(value.split()[0]) for name, value, *_ in cards.cards}
    near([stated["mean |E|"]], mean)
    near([stated["max"]], largest)
    words = text_of(lead.text)
    if not largest:
        assert "The error is zero" in words
        return
    assert ("No limit is set" in words) is (limit is None)
    assert limits_in(words) == ({limit} if limit else set())
    if limit is not None:
        assert words.startswith("Pass" if largest <= limit else "Fail")


@pytest.mark.parametrize("block", [
    0, *(pytest.param(block, marks=pytest.mark.nightly) for block in range(1, 17)),
])  # fmt: skip
def test_offline_page_and_report_state_the_same(block):
    for seed in range(6 * block, 6 * (block + 1)):
        try:
            check_files(random_state(seed))
        except AssertionError as error:
            raise AssertionError(f"state {seed}: {error}") from error
