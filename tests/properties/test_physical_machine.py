"""Readings, tables and loops mean on every machine what a simulated one of rigid bodies does."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, reject, settings
from hypothesis import strategies as st

from physical_machine import LINEAR, PhysicalMachine, machines, placed_um, with_errors
from warpspace.analysis.commands.distance import Distance
from warpspace.analysis.commands.form import Form
from warpspace.analysis.commands.line import Line
from warpspace.bench.base import run_test
from warpspace.bench.data import parse_table
from warpspace.bench.kinds.circular import Circular
from warpspace.bench.kinds.diagonals import Diagonals
from warpspace.bench.kinds.positioning import Positioning
from warpspace.bench.kinds.rotary_axis import RotaryAxis, RTest
from warpspace.bench.kinds.straightness import Squareness, Straightness
from warpspace.exceptions import OptionError
from warpspace.formats.compensation.compensate import Compensate, compensate
from warpspace.formats.registry import ReadOptions, read_errors
from warpspace.formats.source import source_of_text
from warpspace.formats.to_scene import build_imported_scene
from warpspace.kinematics.relative_motion import angle_error
from warpspace.scene.library import parse_scene
from warpspace.scene.model import evaluate

LEAST = 20  # chains of each test
CHAINS = settings(
    max_examples=max(LEAST, settings.default.max_examples),
    # directions of three linear axes that share a plane are no machine
    suppress_health_check=[HealthCheck.filter_too_much],
)
PAIRS = ("XY", "XZ", "YZ")
ROUNDING = {"abs": 0.05, "rel": 1e-3}  # µm and µrad; and of the first order
MICRO = st.integers(-40, 40).map(float)


def ignore(_share: float) -> None:
    pass


@st.composite
def bent_machines(draw: st.DrawFn, *, rotary: int = 0) -> PhysicalMachine:
    """Machines with up to four errors of any kind, anywhere."""
    machine = draw(machines(rotary=rotary))
    keys = [
        f"E{letter}{middle}{body.name}"
        for letter in "XYZABC"
        for middle in ("", "0")
        for body in machine.bodies
    ]
    errors: dict[str, object] = {}
    for key in draw(st.lists(st.sampled_from(keys), min_size=1, max_size=4, unique=True)):
        low, high = machine.workspace[key.lstrip("E")[1:].lstrip("0")]
        middle = (low + high) / 2.0 + (0.0 if low < high else 0.5)
        table = ((low, draw(MICRO)), (middle, draw(MICRO)), (max(high, low + 1.0), draw(MICRO)))
        errors[key] = draw(MICRO) if "0" in key else table
    return with_errors(machine, errors)


def scene_of(machine):
    return parse_scene(machine.scene_text(), "simulated")


@CHAINS
@given(bent_machines(rotary=2))
def test_fields_are_those_of_rigid_bodies(machine):
    scene = scene_of(machine)
    for q in machine.nodes(2):
        field = evaluate(scene, at=q, exact=True, frame="workpiece", loop="relative")
        assert field.error_um == pytest.approx(machine.error_um(q), **ROUNDING)


@CHAINS
@given(bent_machines(rotary=1))
def test_instruments_read_along_programmed_directions(machine):
    scene = scene_of(machine)
    for axis in LINEAR:
        run = run_test(scene, Positioning(axis=axis)).model
        targets = run.plan.marks["target"]
        read = run.readings - run.readings[0]
        assert read == pytest.approx(machine.positioning_um(axis, targets), **ROUNDING)
        sensed = LINEAR[(LINEAR.index(axis) + 1) % 3]
        run = run_test(scene, Straightness(axis=axis, across=sensed.lower())).model
        places = run.plan.marks["position_mm"]
        read = run.readings - run.readings[0]
        assert read == pytest.approx(machine.across_um(axis, sensed, places), **ROUNDING)
    for first, second in PAIRS:
        outcome = run_test(scene, Squareness(plane=first + second)).model.outcome
        _, change = angle_error(scene.machine, first, second)
        angle = machine.squareness_urad(first, second)
        assert outcome["end_points_urad"] * change == pytest.approx(angle, abs=0.2, rel=1e-3)


RADIUS = 60.0  # mm; fits into every random volume


def about_centre(values, angle_deg):
    """Values without the part that another centre of the circle explains."""
    theta = np.deg2rad(angle_deg)
    centre = np.stack([np.cos(theta), np.sin(theta)], -1)
    return values - centre @ np.linalg.lstsq(centre, values, rcond=None)[0]


@CHAINS
@given(bent_machines(rotary=1), st.sampled_from(PAIRS))
def test_a_ball_bar_reads_distances_on_the_part(machine, plane):
    scene = scene_of(machine)
    test = Circular(plane=plane, radius_mm=RADIUS, points=24)
    run = run_test(scene, test).model
    angle = run.plan.marks["angle_deg"][:24]
    simulated = machine.circular_um(plane, RADIUS, angle)
    read = about_centre(run.readings[:24], angle)
    assert read == pytest.approx(about_centre(simulated, angle), **ROUNDING)
    rows = [f"+,{at:.6f},{um:.9f}" for at, um in zip(angle, simulated, strict=True)]
    text = "direction,angle_deg,radial_um\n" + "\n".join(rows)
    result = run_test(scene, test, parse_table(text, test.data_columns(scene), "bar.csv"))
    measured = result.measured.outcome
    for name in ("circular_deviation_um", "radius_difference_um"):
        assert measured[name] == pytest.approx(run.outcome[name], abs=0.1, rel=1e-3), name
    angle = run.outcome["squareness_urad"]  # 0.05 µm at a radius of 60 mm
    assert measured["squareness_urad"] == pytest.approx(angle, abs=2.0, rel=1e-3)


@CHAINS
@given(bent_machines())
def test_diagonals_are_displacements_on_the_part(machine):
    run = run_test(scene_of(machine), Diagonals(targets=3)).model
    places = {axis: np.asarray(at) for axis, at in run.plan.coordinates.items()}
    for which in range(4):
        rows = np.flatnonzero(run.plan.marks["diagonal"] == which)[:3]
        sites = [run.plan.site[row] for row in rows]
        nodes = [{axis: float(at[site]) for axis, at in places.items()} for site in sites]
        simulated = machine.diagonal_um(nodes[0], nodes)
        assert run.readings[rows] - run.readings[rows[0]] == pytest.approx(simulated, **ROUNDING)


@CHAINS
@given(bent_machines(rotary=2))
def test_an_r_test_and_an_encoder_read_rotary_axes(machine):
    scene = scene_of(machine)
    for axis in (body.name for body in machine.bodies if not body.is_linear):
        try:
            run = run_test(scene, RTest(axis=axis, points=6)).model
        except OptionError:  # the other axes cannot follow it: 1 machine in some hundreds
            reject()
        places = {name: np.asarray(at) for name, at in run.plan.coordinates.items()}
        read = run.readings.reshape(3, -1).T
        for row, site in enumerate(run.plan.site[: len(read)]):
            q = {name: float(at[site]) for name, at in places.items()}
            assert read[row] == pytest.approx(machine.ball_um(q), **ROUNDING)
        run = run_test(scene, RotaryAxis(axis=axis, points=8)).model
        angle = run.plan.marks["angle_deg"][:8]
        angular = run.readings.reshape(6, -1)[5]
        simulated = machine.angle_urad(axis, axis, angle)
        assert angular - angular[0] == pytest.approx(simulated, **ROUNDING)


@CHAINS
@given(bent_machines(), st.sampled_from(LINEAR))
def test_measured_readings_are_evaluated_along_programmed_directions(machine, axis):
    targets = np.linspace(*machine.workspace[axis], 5)
    deviations = machine.positioning_um(axis, targets)
    rows = [
        f"{run},{sign},{at:.6f},{um:.9f}"
        for run in (1, 2)
        for sign in "+-"
        for at, um in zip(targets, deviations, strict=True)
    ]
    text = "run,direction,target_mm,deviation_um\n" + "\n".join(rows)
    test, scene = Positioning(axis=axis), scene_of(machine)
    table = parse_table(text, test.data_columns(scene), "runs.csv")
    result = run_test(scene, test, table)
    assert result.measured.outcome["M_um"] == pytest.approx(np.ptp(deviations), abs=1e-6)
    assert result.rms_difference == pytest.approx(0.0, abs=0.05)


def imported(machine, text, name, kind):
    base = parse_scene(machine.scene_text(errors=False), "nominal")
    source = source_of_text(text, name)
    reading = read_errors([source], ReadOptions(base.machine, axis=""), kind)
    return build_imported_scene(reading, base, "", name).scene


RTL = """HEADER::
File type  : rtl

TARGET DATA::
Filetype  : ISO
Target-count: {count}
Targets :
{targets}
Flags: 0 1 2 0

USER-TEXT::
Axis:{axis}

RUNS::
Run-count:1

DEVIATIONS::
Run Target Data:
{rows}

EOF::
"""


@CHAINS
@given(machines(), *[st.sampled_from(LINEAR)] * 2, st.lists(MICRO, min_size=4, max_size=4))
def test_deviations_are_read_along_programmed_directions(machine, axis, sensed, deviations):
    targets = np.round(np.linspace(*machine.workspace[axis], 4), 3)
    rows = "\n".join(f"1 {number} {um}" for number, um in enumerate(deviations, 1))
    shown = " ".join(f"{at:.3f}" for at in targets)
    rtl = RTL.format(count=4, targets=shown, axis=axis, rows=rows)
    table = f"{axis} [mm],E{sensed}{axis} [um]\n" + "\n".join(
        f"{at},{um}" for at, um in zip(targets, deviations, strict=True)
    )
    for text, name, kind, along in (
        (rtl, "a.rtl", "rtl", machine.direction(axis, machine.middle)),
        (table, "a.csv", "csv", machine.direction(sensed, machine.middle)),
    ):
        scene = imported(machine, text, name, kind)
        places = {**machine.middle, axis: targets}
        field = evaluate(scene, at=places, frame="workpiece", loop="relative")
        assert field.error_um == pytest.approx(np.outer(deviations, along), abs=1e-6)


@CHAINS
@given(machines(rotary=2), st.lists(MICRO, min_size=4, max_size=4))
def test_angles_of_rotary_axes_are_read_about_programmed_directions(machine, angles):
    for axis in (body.name for body in machine.bodies if not body.is_linear):
        low, high = machine.workspace[axis]
        targets = np.round(np.linspace(low, max(high, low + 1.0), 4), 3)
        rows = "\n".join(f"{at},{urad}" for at, urad in zip(targets, angles, strict=True))
        scene = imported(machine, f"{axis} [deg],E{axis[0]}{axis} [urad]\n{rows}", "a.csv", "csv")
        table = tuple(
            (float(at), float(scene.errors.evaluate_at(f"E{axis[0]}{axis}", {axis: at})))
            for at in targets
        )
        read = with_errors(machine, {f"E{axis[0]}{axis}": table}).angle_urad(axis, axis, targets)
        assert read == pytest.approx(np.array(angles) - angles[0], **ROUNDING)


@CHAINS
@given(machines(), st.sampled_from(PAIRS), st.integers(-3000, 3000).map(lambda n: n * 1e-6))
def test_skew_factors_are_the_error_that_they_correct(machine, plane, factor):
    letter = dict(zip(PAIRS, "IJK", strict=True))[plane]
    marlin = imported(machine, f"M852 {letter}{factor:.9f}\n", "a.gcode", "marlin")
    first, second = (axis.lower() for axis in plane)
    matrix = f"setp matrixkins.C_{first}{second} {-factor:.9f}\n"
    linuxcnc = imported(machine, matrix, "a.hal", "linuxcnc-matrix")
    nodes = machine.nodes()
    points = np.array([machine.relative(q, errors=False)[:3, 3] for q in nodes])
    # what the machine does with the correction is what its errors do, with the sign changed
    moved = [{plane[0]: -factor * q[plane[1]]} for q in nodes]
    correction = [machine.corrected_um(q, moves) for q, moves in zip(nodes, moved, strict=True)]
    expected = placed_um(points, -np.array(correction))
    for scene in (marlin, linuxcnc):
        exact = scene is linuxcnc  # its slopes make the exact chain equal to the matrix
        errors = [
            evaluate(scene, at=q, exact=exact, frame="workpiece", loop="relative").error_um
            for q in nodes
        ]
        shape = placed_um(points, np.array(errors))
        assert shape == pytest.approx(expected, abs=0.05 + 4e-3 * np.abs(expected).max())


WRITTEN = ("sinumerik-enc", "sinumerik-cec", "heidenhain", "linuxcnc-comp", "linuxcnc-matrix",
           "marlin", "klipper", "fanuc-3d")  # fmt: skip


GRIDLESS = ("linuxcnc-matrix", "marlin", "klipper")


@CHAINS
@given(bent_machines(), st.sampled_from(WRITTEN), st.booleans())
def test_a_table_leaves_what_it_says(machine, name, placed):
    scene = scene_of(machine)
    options = Compensate(formats=(name,), loop="relative", placed=placed)
    placed_scene = replace(scene, placed=placed)
    found = compensate(placed_scene, options, 3)
    nodes = machine.nodes(4)
    positions = {axis: np.array([q[axis] for q in nodes]) for axis in scene.machine.axes}
    moves = found.controller.moves(positions)
    by_node = np.stack([np.broadcast_to(move, len(nodes)) for move in moves.values()], -1)
    remaining = [
        machine.corrected_um(q, dict(zip(moves, node.tolist(), strict=True)))
        for q, node in zip(nodes, by_node, strict=True)
    ]
    points = np.array([machine.relative(q, errors=False)[:3, 3] for q in nodes])
    reported = found.controller.field(positions, points, scene).error_um
    rotation = machine.side(machine.workpiece, machine.middle, errors=False)[:3, :3]
    assert reported @ rotation == pytest.approx(np.array(remaining), **ROUNDING)
    if name in GRIDLESS:  # placement and factors are fitted together: they never do harm
        before = [machine.error_um(q) for q in nodes]
        rms = [
            np.sqrt(np.mean(placed_um(points, np.array(errors)) ** 2))
            for errors in (remaining, before)
        ]
        assert rms[0] <= rms[1] + 0.1


@CHAINS
@given(bent_machines(), st.sampled_from(WRITTEN[:-1]))  # a 3D grid leaves a remainder, reported
def test_a_table_that_is_imported_is_the_error_that_it_corrects(machine, name):
    scene = scene_of(machine)
    written = compensate(scene, Compensate(formats=(name,), loop="relative"), 3)
    kind = written.format
    sources = [
        source_of_text(text, f"compensation{add}{'' if add else kind.endings[0]}")
        for add, text in written.files.items()
    ]
    base = parse_scene(machine.scene_text(errors=False), "nominal")
    reading = read_errors(sources, ReadOptions(base.machine), name)
    scene = build_imported_scene(reading, base, "", "table").scene
    nodes, bare = machine.nodes(3), machine.without_errors()
    positions = {axis: np.array([q[axis] for q in nodes]) for axis in base.machine.axes}
    moves = written.controller.moves(positions)
    by_node = np.stack([np.broadcast_to(move, len(nodes)) for move in moves.values()], -1)
    corrected = -np.array(
        [
            bare.corrected_um(q, dict(zip(moves, node.tolist(), strict=True)))
            for q, node in zip(nodes, by_node, strict=True)
        ]
    )
    errors = [evaluate(scene, at=q, frame="workpiece", loop="relative").error_um for q in nodes]
    points = np.array([machine.relative(q, errors=False)[:3, 3] for q in nodes])
    if name in GRIDLESS:
        errors, corrected = (placed_um(points, np.array(part)) for part in (errors, corrected))
    assert np.array(errors) == pytest.approx(corrected, **ROUNDING)


@CHAINS
@given(bent_machines(), st.sampled_from(("iso-text", "isg-csv")))
def test_error_parameters_of_a_control_are_those_of_the_machine(machine, name):
    written = compensate(scene_of(machine), Compensate(formats=(name,)), 3)
    base = parse_scene(machine.scene_text(errors=False), "nominal")
    reading = read_errors(
        [source_of_text(written.files[""], "v.txt")], ReadOptions(base.machine), name
    )
    scene = build_imported_scene(reading, base, "", "table").scene
    for q in machine.nodes(3):
        field = evaluate(scene, at=q, exact=True, frame="workpiece", loop="relative")
        assert field.error_um == pytest.approx(machine.error_um(q), **ROUNDING)


@CHAINS
@given(bent_machines())
def test_form_distance_and_line_are_those_of_the_part(machine):
    scene = scene_of(machine)
    squareness = {
        deviation.of: deviation.value
        for deviation in Form(loop="relative", nodes=3).run(scene, ignore).deviations
        if deviation.kind == "squareness"
    }
    for first, second in PAIRS:
        angle = machine.squareness_urad(first, second)
        # by three points the least-squares line has the slope of the end points
        assert squareness[f"{second} to {first}"] == pytest.approx(angle, abs=0.2, rel=1e-3)
    ends = [{axis: machine.workspace[axis][end] for axis in LINEAR} for end in (0, 1)]
    points = [
        [machine.relative({**machine.middle, **end}, errors=errors)[:3, 3] for end in ends]
        for errors in (False, True)
    ]
    nominal, actual = (np.linalg.norm(end - start) for start, end in points)
    between = {"start": tuple(ends[0].items()), "end": tuple(ends[1].items())}
    distance = Distance(**between, loop="relative", exact=True).run(scene, ignore)
    assert distance.difference_um == pytest.approx((actual - nominal) * 1e3, **ROUNDING)
    assert Line(**between, points=5).run(scene, ignore).length_mm == pytest.approx(nominal)
