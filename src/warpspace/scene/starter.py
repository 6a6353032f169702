"""Starter scenes: any chain, with consistent dimensions and a remark on every line."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import tomli_w

from warpspace.machine.axes import ErrorKind, direction_index, is_linear, parameter
from warpspace.machine.definition import ORIGIN, Chain, Range, Vector, build_machine, parse_chain
from warpspace.scene.library import parse_scene
from warpspace.scene.model import Scene, spanning_axes

HORIZONTAL_DEG: Vector = (90.0, 0.0, 180.0)
"""Turns the frames of a machine with a horizontal spindle, degrees: y points up, z to the rear."""
LEVEL_TRAVEL: Mapping[int, Range] = {0: (-300.0, 300.0), 1: (-250.0, 250.0), 2: (-250.0, 250.0)}
"""Of the first linear axis along a level direction x, y or z, mm."""
UP_TRAVEL: Mapping[int, Range] = {1: (0.0, 400.0), 2: (-400.0, 0.0)}
"""Of the first one that is upright, y or z, mm: the tool touches the table at its lower end."""
SECOND_TRAVEL = (-100.0, 100.0)  # of a further linear axis along a direction, mm
TILT_TRAVEL, TURN_TRAVEL, ARM_TRAVEL = (-90.0, 90.0), (0.0, 360.0), (-150.0, 150.0)
"""Of axes that tilt, of the upright one, and of arms that turn about z in series, degrees."""
ARM_RANGES = ((-60.0, 60.0), (20.0, 140.0))  # of such arms within the working volume, degrees
ARMS_AT = ((-350.0, -200.0), (-50.0, -200.0))
ARM_END = (200.0, -200.0)  # in a plan view with all arms at zero, mm
TOOL_LENGTH, PIVOT, TURNING_HEAD = 150.0, 250.0, 400.0
"""From the tool point along the spindle to its nose, to a tilting and to a turning head, mm."""
ABOVE_TABLE = 100.0  # height of the tool point where no linear axis is upright, mm
TILTS_AT = 50.0  # height of a tilting axis above the table, mm
WORKPIECE_HEIGHT, WORKPIECE_SHARE = 200.0, 0.8


@dataclass(frozen=True, slots=True)
class StarterDimensions:
    """Dimensions of a machine with all axes at zero."""

    # origin of each frame in the previous one; R is in the middle of the table
    offset_mm: Mapping[str, Vector]
    # of the first frame on either side, where the spindle is horizontal
    rotation_deg: Mapping[str, Vector]
    travel: Mapping[str, Range]  # mm or degrees
    # −1 for linear axes that carry the workpiece: the tool moves along the name of the axis
    direction: Mapping[str, int]
    # mm or degrees; ranges of the axes that span the volume, and the positions of the others
    workspace: Mapping[str, Range]
    # A point of the lower and one of the top rim of the largest workpiece
    traces_mm: tuple[Vector, Vector]


def compute_dimensions(chain: Chain) -> StarterDimensions:
    spanning = spanning_axes(chain.axes)
    turning = [direction_index(axis) for axis in chain.workpiece if not is_linear(axis)]
    horizontal = 2 not in turning and turning[-1:] == [1]
    up = 1 if horizontal else 2
    arms = () if horizontal else _arms(chain)
    travel = {axis: _travel(axis, up, axis in spanning, axis in arms) for axis in chain.axes}
    ranges = {axis: travel[axis] if axis in spanning else (0.0, 0.0) for axis in chain.axes}
    ranges |= dict(zip(arms, ARM_RANGES, strict=False))
    half = [min(map(abs, travel[axis])) for axis in spanning if direction_index(axis) != up]
    radius = WORKPIECE_SHARE * min(half, default=LEVEL_TRAVEL[1][1])
    lowest = [0.0 - travel[axis][0] for axis in spanning if direction_index(axis) == up]
    tool = _tool_places(chain, arms, max(lowest, default=ABOVE_TABLE), horizontal=horizontal)
    workpiece = _workpiece_places(chain, up)
    first = (next(iter(tool)), next(iter(workpiece))) if horizontal else ()
    rim = (0.0, radius, WORKPIECE_HEIGHT)
    return StarterDimensions(
        {**_steps(tool, horizontal=horizontal), **_steps(workpiece, horizontal=horizontal)},
        dict.fromkeys(first, HORIZONTAL_DEG),
        travel,
        dict.fromkeys(chain.workpiece, -1),
        ranges,
        ((radius, 0.0, 0.0), _turned(rim) if horizontal else rim),
    )


def _arms(chain: Chain) -> tuple[str, ...]:
    if any(direction_index(axis) != 2 for axis in spanning_axes(chain.axes)):
        return ()
    turning = [axis for axis in chain.tool if not is_linear(axis) and direction_index(axis) == 2]
    return tuple(turning[: len(ARM_RANGES)])


def _travel(axis: str, up: int, spans: bool, is_arm: bool) -> Range:
    index = direction_index(axis)
    if is_linear(axis):
        return SECOND_TRAVEL if not spans else (UP_TRAVEL if index == up else LEVEL_TRAVEL)[index]
    if is_arm:
        return ARM_TRAVEL
    return TURN_TRAVEL if index == up else TILT_TRAVEL


def _tool_places(
    chain: Chain, arms: tuple[str, ...], tip: float, *, horizontal: bool
) -> dict[str, Vector]:
    linear = [axis for axis in chain.tool if is_linear(axis)]
    plan_mm = ARM_END if len(arms) == len(ARMS_AT) else ARMS_AT[1] if arms else (0.0, 0.0)
    places: dict[str, Vector] = {}
    for axis in chain.tool:
        if axis in arms:
            x, y = ARMS_AT[arms.index(axis)]
            places[axis] = (x, y, TURNING_HEAD)
        elif is_linear(axis):
            # guides are behind the tool, each nearer to it than the one that carries it
            nearer = (linear.index(axis) + 1) / (len(linear) + 1)
            y = plan_mm[1] if arms else round(600.0 * (1.0 - nearer), -1)
            places[axis] = (plan_mm[0], y, 250.0 + round(200.0 * nearer, -1))
        else:
            places[axis] = (*plan_mm, TURNING_HEAD if direction_index(axis) == 2 else PIVOT)
    places |= {"S": (*plan_mm, TOOL_LENGTH), "t": (*plan_mm, 0.0)}
    if horizontal:
        return {frame: (x, y + along, tip) for frame, (x, y, along) in places.items()}
    return {frame: (x, y, tip + along) for frame, (x, y, along) in places.items()}


def _workpiece_places(chain: Chain, up: int) -> dict[str, Vector]:
    places: dict[str, Vector] = {}
    for axis in chain.workpiece:
        if is_linear(axis):
            places[axis] = (0.0, 0.0, -400.0 + 100.0 * len(places))
        else:
            places[axis] = (0.0, 0.0, 0.0 if direction_index(axis) == up else TILTS_AT)
    return {**places, "w": ORIGIN}


def _steps(places: Mapping[str, Vector], *, horizontal: bool) -> dict[str, Vector]:
    before: Vector = ORIGIN
    steps: dict[str, Vector] = {}
    for frame, (x, y, z) in places.items():
        step = (x - before[0], y - before[1], z - before[2])
        # the first frame is placed in R
        steps[frame] = _turned(step) if horizontal and steps else step
        before = (x, y, z)
    return steps


def _turned(vector: Vector) -> Vector:
    x, y, z = vector
    return (0.0 - x, z, y)


_COLUMN = 40  # where remarks begin
EXAMPLES = {
    "positioning": ("{ ramp = 12 }", "0 at the lower end of the axis, 12 at the upper"),
    "pitch": ("{ ramp = 30 }", "turns more and more along the axis"),
    "squareness": ("25", "the same everywhere"),
    "orientation": ("20", "the axis stands out of true"),
    "wobble": ("{ harmonics = [[1, 15, 0]] }", "once a turn: order, amplitude, phase in degrees"),
}


def starter_scene(chain: str | Chain, title: str = "", name: str = "") -> Scene:
    parsed = parse_chain(chain) if isinstance(chain, str) else chain
    return parse_scene(starter_text(parsed, title), name or str(parsed))


def starter_text(chain: str | Chain, title: str = "") -> str:
    """Write a starter scene: consistent dimensions, and a remark on each line."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    parsed = parse_chain(chain) if isinstance(chain, str) else chain
    sizes = compute_dimensions(parsed)
    count = len(parsed.axes)
    name = title or f"{parsed}, {count} {'axis' if count == 1 else 'axes'}"
    templates = Environment(
        loader=PackageLoader("warpspace.scene"),
        autoescape=False,  # noqa: S701 - TOML
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return templates.get_template("starter.toml.j2").render(
        chain=parsed,
        linear=[axis for axis in parsed.axes if is_linear(axis)],
        sizes=sizes,
        title=tomli_w.dumps({"title": name}).strip(),
        errors=error_lines(parsed, sizes.travel),
        line=_line,
        row=lambda key, value, why="": _line(f"{key} = {_spell(value)}", why),
    )


def _line(text: str, remark: str = "") -> str:
    return f"{text:<{_COLUMN - 1}} # {remark}" if remark else text


def _spell(value: Any) -> str:
    return f"[{', '.join(map(_spell, value))}]" if isinstance(value, tuple) else f"{value:.10g}"


def error_lines(chain: Chain, travel: Mapping[str, Range]) -> list[str]:
    examples, table_keys = _example_keys(chain)
    lines = [_line("[errors]", "examples; what is absent is 0, # takes one out")]
    for key, kind in examples:
        (value, why), row = EXAMPLES[kind], parameter(key)
        lines.append(_line(f"{key} = {value}", f"{row.name}, {row.unit}: {why}"))
    for key in table_keys:
        row = parameter(key)
        low, high = travel[row.axis]
        table = f"{key} = {{ table = [[{low:g}, 0], [{high:g}, 5]] }}"
        lines.append(f"# {_line(table, f'{row.name}, {row.unit}: measured points')}")
    first = chain.axes[0]
    key = f"E{'XYZ'[(direction_index(first) + 2) % 3]}{first}"
    return [*lines, f'# {key} = {{ csv = "measured.csv", column = "{key}" }}']


def _example_keys(chain: Chain) -> tuple[list[tuple[str, str]], list[str]]:
    examples: list[tuple[str, str]] = []
    # tool side first: the first picture shows the tool point
    axes = sorted(chain.axes, key=lambda axis: axis not in chain.tool)
    linear = [axis for axis in axes if is_linear(axis)]
    rotary = [axis for axis in axes if not is_linear(axis)]
    rows = sorted(
        (parameter(key) for key in build_machine(chain).parameter_keys),
        key=lambda row: row.axis not in chain.tool,
    )
    if linear:
        first = linear[0]
        index = direction_index(first)
        examples.append((f"E{'XYZ'[index]}{first}", "positioning"))
        examples.append((f"E{'ABC'[(index + 1) % 3]}{first}", "pitch"))
    examples += [(row.key, "squareness") for row in rows if row.kind is ErrorKind.SQUARENESS][:1]
    examples += [(row.key, "orientation") for row in rows if row.kind is ErrorKind.ORIENTATION][:1]
    if rotary:
        examples.append((f"E{'ABC'[(direction_index(rotary[0]) + 1) % 3]}{rotary[0]}", "wobble"))
    return examples, [f"E{'XYZ'[(direction_index(axis) + 1) % 3]}{axis}" for axis in linear[:1]]
