"""Overlays in the box: a part, and paths of a program and of a standard test.

Responses are cached; a slider move is a product.
"""

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from warpspace.acceptance_tests.acceptance import Acceptance
from warpspace.acceptance_tests.plans import default_plan, load_plan
from warpspace.analysis.commands.adjust import Adjust
from warpspace.app.evaluation.cache import Cache
from warpspace.app.state.app_state import AppState
from warpspace.app.state.form_values import TEST, option_values, read_form
from warpspace.app.state.leaf import Identity
from warpspace.bench.base import BenchTest, bench_names, find_test
from warpspace.bench.plan import BenchPlan, respond_sites
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.field.grid import seen_from_workpiece
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.parts import workpiece
from warpspace.parts.program import Program, ToolPath, trace_program
from warpspace.parts.workpiece import ActualPoints, Workpiece
from warpspace.scene.model import Scene
from warpspace.units import MM_PER_UM, Array

AT_LINE = "program.at_line"  # form of the selected line of the program
MOST_POINTS = 300_000  # of a part, or of the path of a program, that the app draws
MOST_SITES = 20_000  # places of one test
PIECE = 20_000  # points evaluated at once, which limits the memory of intermediate arrays
T = TypeVar("T")
CACHE: Cache[Any] = Cache(400_000_000)


@dataclass(frozen=True, eq=False)
class SceneOverlay(Generic[T]):
    """Points of a part or of a path in the drawing, in single precision."""

    of: T  # in the workpiece frame
    pose: Array  # [4, 4]; of that frame in the drawing
    at: NDArray[Any]  # indices of the corners of a part, [W], or of both ends of path segments
    coordinates: Mapping[str, Array]  # [n], or one for all: axis positions
    point_mm: Array  # [n, 3]; in R, where they are cut
    outside: NDArray[np.bool_]  # [n]; beyond the travel
    turn: Array  # [4, 4] or [n, 4, 4]; from there to the drawing
    nominal_mm: NDArray[Any]  # [n, 3]; as drawn
    response: NDArray[Any]  # [K, n * 3], µm per µm or µrad
    error_um: NDArray[Any]  # [n, 3]; of the tool against the workpiece

    def drawn_mm(self, exaggeration: float) -> NDArray[Any]:
        return self.nominal_mm + np.float32(exaggeration * MM_PER_UM) * self.error_um

    def with_errors(self, state: AppState) -> "SceneOverlay[T]":
        """Evaluate the errors to first order, or the residual errors of a compensation table."""
        controller, scene, point = state.controller, state.active_scene(), self.point_mm
        if controller is None:
            amplitudes = np.fromiter(state.active.values(), np.float32, len(state.amplitudes))
            return replace(self, error_um=(amplitudes @ self.response).reshape(-1, 3))
        prepared = CACHE.get(
            (Identity(controller), Identity(self)),
            lambda: controller.at(self.coordinates, point, scene, Loop.RELATIVE, point),
            lambda found: found.nbytes,
        )
        error = transforms.rotate(self.turn[..., :3, :3], prepared.field(scene.errors).error_um)
        return replace(self, error_um=error.astype(np.float32))


def _cached_overlay(
    state: AppState, arguments: tuple[Hashable, ...], build: Callable[[Scene], SceneOverlay[T]]
) -> SceneOverlay[T] | None:
    """Build an overlay, or return it from the cache, with errors; None where it cannot be built."""
    key = Identity(state.scene), tuple(state.positions.items()), state.placed, arguments
    try:
        overlay: SceneOverlay[T] = CACHE.get(
            key, lambda: build(state.standing), lambda found: found.response.nbytes
        )
        return overlay.with_errors(state)
    except WarpspaceError:  # reported in its section
        return None


def _respond(scene: Scene, of: T, made: ActualPoints, at: NDArray[Any]) -> SceneOverlay[T]:
    count, keys = len(made.point_mm), scene.parameter_keys
    if count > MOST_POINTS:
        raise OptionError(f"{count:,} points; expected at most {MOST_POINTS:,} in the app")
    stand = complete_coordinates(scene.machine, {}, scene.workspace.positions)
    pose = np.asarray(branch_pose(scene.model, "workpiece", stand))
    response = np.empty((len(keys), count, 3), np.float32)
    for rows in np.array_split(np.arange(count), -(-count // PIECE) or 1):
        response[:, rows] = workpiece.point_basis(scene, made, rows=rows).position @ pose[:3, :3].T
    nominal = transforms.apply(pose, made.point_mm).astype(np.float32)
    made_pose = branch_pose(scene.model, "workpiece", made.coordinates)
    point, turn = transforms.apply(made_pose, made.point_mm), (pose @ transforms.inverse(made_pose))
    flat = response.reshape(len(keys), -1)
    return SceneOverlay(
        of, pose, at, made.coordinates, point, made.outside, turn, nominal, flat, nominal
    )


# --- A part ---------------------------------------------------------------------------------------


def part_overlay(state: AppState) -> SceneOverlay[Workpiece] | None:
    """Build the part as it is cut; None where there is none, or it cannot be placed."""
    mesh, place = state.part.mesh, state.part.place
    if mesh is None or not state.part.shown:
        return None

    def clamp(scene: Scene) -> SceneOverlay[Workpiece]:
        part = workpiece.place_workpiece(mesh, scene, place)
        made = workpiece.evaluate_points(scene, part.vertices_mm)
        return _respond(scene, part, made, part.corners.corner_of)

    return _cached_overlay(state, (Identity(mesh), place), clamp)


def moved_place(part: Workpiece, stand: Array) -> tuple[float, ...]:
    """Compute the placement of a part from a pose of its middle, [4, 4], in the workpiece frame."""
    placement = transforms.placed(part.place[:3], part.place[3:])
    pose = stand @ transforms.translation(-part.middle_mm) @ placement
    angles = transforms.roll_pitch_yaw_deg(pose[:3, :3])
    return tuple((np.round([*pose[:3, 3], *angles], 3) + 0.0).tolist())


# --- Paths ----------------------------------------------------------------------------------------


def path_overlay(state: AppState) -> SceneOverlay[ToolPath] | None:
    """Build the path of the program; None where there is none, or it cannot be traced."""
    text = state.part.program
    if text is None:
        return None

    def trace(scene: Scene) -> SceneOverlay[ToolPath]:
        path = trace_program(program_of(state, scene).read(scene))
        made = ActualPoints(path.tip_mm, path.coordinates, path.error_um, path.outside)
        ends = np.flatnonzero(path.step_mm.any(axis=1))
        return _respond(scene, path, made, np.stack([ends - 1, ends], axis=1))

    return _cached_overlay(state, (text, *sorted(_program_options(state).items())), trace)


def _program_options(state: AppState) -> Mapping[str, str]:
    return option_values(state, Program.name) | {"at_line": ""}


def program_of(state: AppState, scene: Scene) -> Program:
    """Build the program of a state, with its options."""
    program = read_form(Program, Program.options(), _program_options(state), scene)
    return replace(program, file=state.part.program_name, text=state.part.program)


def chosen_test(state: AppState) -> type[BenchTest] | None:
    name = state.forms.get(TEST, "")
    return find_test(name) if name in bench_names() else None


def plan_test(test: BenchTest, scene: Scene) -> BenchPlan:
    plan = test.plan(scene)
    if len(plan.point_mm) > MOST_SITES:
        raise OptionError(
            f"{len(plan.point_mm):,} places; expected at most {MOST_SITES:,} in the app"
        )
    return plan


def planned_adjusters(state: AppState) -> list[tuple[str, Array, Array]]:
    """List the adjusters drawn while *Adjustment* is open: text, place, [3], mm, direction, [3].

    The text is the act; it is empty for further members of a group.
    """
    page = state.page
    if page.task != Adjust.task or Adjust.name not in page.open:
        return []
    return [
        (
            "" if index else str(act),
            np.array(member.at_mm),
            np.sign(act.change) * np.array(member.direction),
        )
        for act in page.acts
        for index, member in enumerate(act.members)
        if member in state.scene.machine.adjusters and not member.kind.is_parameter
    ]


def planned_tests(state: AppState) -> str | None:
    """Return the plan of acceptance tests whose paths are drawn, a name or its text; else None."""
    page, plan = state.page, option_values(state, Acceptance.name).get("plan")
    is_open = Acceptance.name in page.open and page.task == Acceptance.task
    return (plan or default_plan(state.scene)) if is_open else None


def bench_overlay(state: AppState) -> SceneOverlay[str] | None:
    """Build the paths of the selected test, or of a plan; None where none can be drawn.

    A test is of the uncompensated machine, so that no path is drawn in a compensated box.
    """
    planned = planned_tests(state)
    kind, option_texts = chosen_test(state), option_values(state, TEST)
    if state.controller is not None or (
        not planned and (kind is None or option_texts.get("path") == "0")
    ):
        return None

    def tests(scene: Scene) -> list[BenchTest]:
        if planned:
            return [entry.test for entry in load_plan(planned, scene)]
        return [] if kind is None else [read_form(kind, kind.settings(), option_texts, scene)]

    def lay(scene: Scene) -> SceneOverlay[str]:
        plans = [plan_test(test, scene) for test in tests(scene)]
        point = np.concatenate([plan.point_mm for plan in plans])
        at = {
            axis: np.concatenate([plan.coordinates[axis] for plan in plans])
            for axis in plans[0].coordinates
        }
        nominal = seen_from_workpiece(scene.model, at, scene.workspace, point)
        keys = scene.parameter_keys
        responses = [respond_sites(scene, plan, keys).reshape(len(keys), -1) for plan in plans]
        starts = np.cumsum([0, *(len(plan.point_mm) for plan in plans)])
        pieces = np.concatenate(
            [
                start + np.stack([rows[:-1], rows[1:]], 1)
                for start, plan in zip(starts, plans, strict=False)
                for rows in plan.path
            ]
        )
        still, inside = np.eye(4), np.zeros(len(point), bool)
        response = np.concatenate(responses, axis=1)
        title = "acceptance tests" if planned or kind is None else kind.title
        return SceneOverlay(
            title, still, pieces, at, point, inside, still, nominal, response, nominal
        )

    return _cached_overlay(state, (planned or kind, *sorted(option_texts.items())), lay)
