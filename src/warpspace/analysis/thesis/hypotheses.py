"""What was tried where the thesis leaves a choice or contradicts itself, and what came out."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from warpspace.analysis.measured import measured
from warpspace.analysis.thesis.machines import MACHINES, judged
from warpspace.analysis.thesis.model import count_agreeing, tool_gains, workpiece_gains
from warpspace.analysis.thesis.rows import ThesisCase, printed_tables
from warpspace.analysis.thesis.sampling import Sampled
from warpspace.field.grid import Workspace
from warpspace.kinematics.model import ComponentErrors, Model
from warpspace.machine.description import Axis
from warpspace.machine.errors import Constant, ErrorSet

NAMES = ("tool_general", "tool_proposed", "workpiece_general", "workpiece_proposed")


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """One reading of the thesis.

    Attributes
    ----------
    question : str
        What is open.
    reading : str
        How it was read.
    result : str
        What came out.
    used : bool
        Whether it is the one the model uses.
    """

    question: str
    reading: str
    result: str
    used: bool = False


def thesis_hypotheses(case: ThesisCase) -> tuple[Hypothesis, ...]:
    """Compute what every reading gives.

    Parameters
    ----------
    case : ThesisCase

    Returns
    -------
    tuple of Hypothesis
        Grouped by question.
    """
    return (*_rotary(case), *_offset(case), *_squareness(case), *_sampling(case), *_machines(case))


def _agreeing(table: str, model: Model) -> str:
    """Count of agreeing gains, in words."""
    gains = tool_gains(model) if table == "table_4_3" else workpiece_gains(model)
    same, total = count_agreeing(table, gains)
    return f"{same} of {total} gains of {table.replace('_', ' ', 1).replace('_', '-')} agree"


def _rotary(case: ThesisCase) -> Iterator[Hypothesis]:
    question = (
        "Do the component errors of a rotary axis act before its motion (eqs. 3-18 to 3-22, 4-8,"
        " 4-9) or after it (eqs. 4-28 to 4-30)?"
    )
    for component_errors in ComponentErrors:
        model = replace(case.model, component_errors=component_errors)
        used = component_errors == case.model.component_errors
        yield Hypothesis(
            question, component_errors.replace("_", " "), _agreeing("table_4_4", model), used
        )


def _moved_axis(model: Model, axis: Axis) -> Model:
    """Give the model with one axis replaced."""
    machine = model.machine
    return replace(model, machine=replace(machine, axes={**machine.axes, axis.name: axis}))


def _offset(case: ThesisCase) -> Iterator[Hypothesis]:
    question = (
        "Where does C lie against B (table 4-1 prints 0, with one value too many in the row)?"
    )
    axis = case.model.machine.axes["C"]
    for height in (-50.0, 0.0):
        moved = replace(axis, offset_mm=(*axis.offset_mm[:2], height))
        result = _agreeing("table_4_4", _moved_axis(case.model, moved))
        yield Hypothesis(question, f"O_zC = {height:g} mm", result, height == axis.offset_mm[2])


def _squareness(case: ThesisCase) -> Iterator[Hypothesis]:
    question = "Does EA0Z (α_YZ) act once (eq. 4-7) or in both transformations (eqs. 4-3 and 4-4)?"
    gains = tool_gains(case.model)
    once = gains["EA0Z"]
    # Turning the Y frame about x as well: the lever of EC0Y's frame is that of the Y axis.
    _, y, z = gains["EC0Y"].lever_mm
    twice = (abs(once.y - z * 1e-3), abs(once.z + y * 1e-3))
    printed = printed_tables()["table_4_3"]["EA0Z"]
    text = "gives y {:.2f}, z {:.2f} µm/µrad; printed {:.2f}, {:.2f}"
    yield Hypothesis(question, "once", text.format(abs(once.y), abs(once.z), *printed[2:]), True)
    yield Hypothesis(question, "twice", text.format(*twice, *printed[2:]))


def _sampling(case: ThesisCase) -> Iterator[Hypothesis]:
    question = (
        "How were the machines of table 4-8 drawn? (mean / peak, µm; tool loop general, proposed;"
        " workpiece loop general, proposed; printed 41, 24, 15, 10)"
    )
    for distribution, clip, words in (
        ("uniform", False, "uniform"),
        ("normal", False, "normal, 3σ = half width"),
        ("normal", True, "the same, cut off at ±3σ"),
    ):
        for with_location in (False, True):
            sampled = Sampled(case, with_location)
            found = [sampled.run(name, distribution, clip=clip) for name in NAMES]
            result = "; ".join(f"{each.mean_um:.1f} / {each.mode_um:.0f}" for each in found)
            count = 41 if with_location else 37
            used = distribution == "uniform" and not with_location
            yield Hypothesis(question, f"{words}, {count} parameters", result, used)


def _machines(case: ThesisCase) -> Iterator[Hypothesis]:
    question = (
        "What do seven numbers per machine predict? (mean |E| of first and second machine, µm;"
        " LaserTRACER 32 and 15)"
    )
    sets = (case.first, case.second)
    flat = [_as_constants(errors) for errors in sets]
    swapped = [_swapped(errors) for errors in sets]
    yield Hypothesis(question, "ramps over the travel, 11³ nodes", _means(case, sets), True)
    yield Hypothesis(question, "the same, 21³ nodes", _means(case, sets, nodes=21))
    yield Hypothesis(question, "constants instead of ramps", _means(case, flat))
    yield Hypothesis(question, "EA0Z and EB0Z swapped as in table 5-5", _means(case, swapped))
    for lift in (51.0, 80.0):
        reading = f"ramps, working volume {lift:g} mm higher"
        yield Hypothesis(question, reading, _means(case, sets, lift_mm=lift))
    yield from _shapes(case)


def _as_constants(errors: ErrorSet) -> ErrorSet:
    """Give every curve its amplitude everywhere."""
    return ErrorSet(
        {key: Constant(each.span, each.amplitude) for key, each in errors.functions.items()}
    )


def _swapped(errors: ErrorSet) -> ErrorSet:
    """Exchange the squareness of YZ and XZ."""
    functions = errors.functions
    return ErrorSet({**functions, "EA0Z": functions["EB0Z"], "EB0Z": functions["EA0Z"]})


def _means(
    case: ThesisCase,
    sets: tuple[ErrorSet, ...] | list[ErrorSet],
    nodes: int = 11,
    lift_mm: float = 0.0,
) -> str:
    """Mean |E| of each error set, in words; ramps along Z are lifted with the volume."""
    ranges = dict(case.workspace.ranges)
    low, high = ranges["Z"]
    lifted = (low + lift_mm, high + lift_mm)
    workspace = Workspace({**ranges, "Z": lifted})
    means: list[float] = []
    for errors in sets:
        functions = {
            key: replace(each, span=lifted) if key.endswith("Z") else each
            for key, each in errors.functions.items()
        }
        result = measured(case.model, ErrorSet(functions), case.proposed, workspace, nodes=nodes)
        means.append(result.predicted_nodes.mean_um)
    return " and ".join(f"{mean:.2f}" for mean in means)


def _shapes(case: ThesisCase) -> Iterator[Hypothesis]:
    question = (
        "Which plane is out of square (figures 5-10 and 5-12)? (shear of the best affine fit to the"
        " predicted map: XY, XZ, YZ; it differs from the squareness put in because angular errors"
        " along the travel shear the volume too, which a ball bar cannot tell apart)"
    )
    for name, machine in zip(MACHINES, judged(case), strict=True):
        shears = ", ".join(f"{value:+.1f}" for value in machine.shear_urad.values())
        yield Hypothesis(question, f"{name} machine, ramps", f"{shears} µrad", True)
