"""The text of a scene to start from."""

from collections.abc import Mapping, Sequence

import tomli_w

from warpspace.machine.axes import direction_index, is_linear
from warpspace.machine.description import ORIGIN, Chain, Range, parse_chain
from warpspace.machine.parameters import ErrorKind, default_keys, parameter
from warpspace.scene.library import parse_scene
from warpspace.scene.model import Scene
from warpspace.scene.starter.layout import Layout, layout

_COLUMN = 40
"""Where remarks begin."""
EXAMPLES = {
    "positioning": ("{ ramp = 12 }", "0 at the lower end of the axis, 12 at the upper"),
    "pitch": ("{ ramp = 30 }", "turns more and more along the axis"),
    "squareness": ("25", "the same everywhere"),
    "orientation": ("20", "the axis stands out of true"),
    "wobble": ("{ harmonics = [[1, 15, 0]] }", "once a turn: order, amplitude, phase in degrees"),
}


def starter_scene(chain: str | Chain, title: str = "", name: str = "") -> Scene:
    """Build the scene that `starter_text` spells.

    Parameters
    ----------
    chain : str or Chain
    title : str, optional
    name : str, optional
        The chain by default.

    Returns
    -------
    Scene

    Raises
    ------
    ChainError
        If the chain cannot be read.
    SceneError
        If the title is too long.
    """
    parsed = parse_chain(chain) if isinstance(chain, str) else chain
    return parse_scene(starter_text(parsed, title), name or str(parsed))


def starter_text(chain: str | Chain, title: str = "") -> str:
    """Spell a scene to start from: sizes that fit together, and a remark on what each line says.

    Parameters
    ----------
    chain : str or Chain
        For instance ``wCBFXYZt``.
    title : str, optional
        Of machine and scene; by default the chain with its number of axes.

    Returns
    -------
    str
        TOML.

    Raises
    ------
    ChainError
        If the chain cannot be read.
    """
    parsed = parse_chain(chain) if isinstance(chain, str) else chain
    sizes = layout(parsed)
    count = len(parsed.axes)
    name = title or f"{parsed}, {count} {'axis' if count == 1 else 'axes'}"
    spelled = tomli_w.dumps({"title": name}).strip()
    parts = [
        [
            "# A machine to start from. Lengths in mm, errors in µm, small angles in µrad, rotary",
            "# positions in degrees.",
            "# Change what is not yours; `warpspace check FILE` names whatever does not fit.",
            spelled,
        ],
        [
            "[machine]",
            spelled,
            _line("chain", f'"{parsed}"', "workpiece → frame F → tool"),
        ],
        _offsets(parsed, sizes),
        _travel(sizes),
        _direction(sizes),
        _choices(parsed),
        _workspace(sizes),
        _points(parsed, sizes),
        error_lines(parsed, sizes.travel),
        [
            "[tolerances]                            # half widths about 0, of each class",
            "default = { translation = 10, rotation = 20, squareness = 25 }  # µm, µrad, µrad",
        ],
    ]
    return "\n\n".join("\n".join(lines) for lines in parts if lines) + "\n"


def _line(key: str, value: str, remark: str = "") -> str:
    """Spell one entry with its remark."""
    text = f"{key} = {value}"
    return f"{text:<{_COLUMN - 1}} # {remark}" if remark else text


def _list(values: Sequence[float]) -> str:
    """Spell numbers, without decimals where they have none."""
    return "[" + ", ".join(f"{value:.10g}" for value in values) + "]"


def _range(low: float, high: float) -> str:
    """Spell a range, or the position that it is."""
    return f"{low:.10g}" if low == high else _list((low, high))


def _offsets(chain: Chain, sizes: Layout) -> list[str]:
    """Spell where the frames stand."""
    remarks = {
        "S": "spindle nose, in the last frame of the tool side",
        "t": "tool point, below the spindle nose: the tool's length",
        "w": "workpiece: middle of the table",
    }
    before = dict.fromkeys((chain.tool or ("",))[:1] + (chain.workpiece or ("",))[:1], "R")
    for branch in (chain.tool, chain.workpiece):
        before |= dict(zip(branch[1:], branch, strict=False))
    lines = [
        "[machine.offset_mm]                     # origin of each frame in the frame before it"
    ]
    for frame, offset in sizes.offset_mm.items():
        if frame in remarks:
            remark = remarks[frame]
        else:
            remark = f"in {before[frame]}" + (
                ", R in the middle of the table" if before[frame] == "R" else ""
            )
        if offset != ORIGIN or frame in remarks:
            lines.append(_line(frame, _list(offset), remark))
    return lines


def _travel(sizes: Layout) -> list[str]:
    """Spell how far axes move."""
    lines = ["[machine.travel]"]
    for axis, ends in sizes.travel.items():
        lines.append(_line(axis, _list(ends), "mm" if is_linear(axis) else "degrees"))
    return lines


def _direction(sizes: Layout) -> list[str]:
    """Spell which axes move against their name."""
    if not sizes.direction:
        return []
    lines = ["[machine.direction]                     # 1 if left out"]
    remark = "carries the workpiece: the tool moves with the name over it"
    return [*lines, *(_line(axis, str(value), remark) for axis, value in sizes.direction.items())]


def _choices(chain: Chain) -> list[str]:
    """Spell what may be said further, as remarks."""
    lines = ["# What else a machine may say (docs/scenes.md):"]
    rotary = [axis for axis in chain.axes if not is_linear(axis)]
    tilted = (rotary or list(chain.axes))[0]
    lines.append(
        f"# [machine.rotation_deg]\n# {tilted} = [45, 0, 0]"
        "   a frame that is turned about x, y, z: a nutating head, a slant bed"
    )
    if len(rotary) < len(chain.axes):
        linear = next(axis for axis in chain.axes if is_linear(axis))
        lines.append(
            f"# [machine.gantry]\n# {linear} = {{ span_mm = 1800 }}   two guides, each with"
            " errors of its own"
        )
    lines.append(
        '# [convention]\n# component_errors = { linear = "after_motion", rotary = "before_motion" }'
    )
    return lines


def _workspace(sizes: Layout) -> list[str]:
    """Spell the working volume."""
    lines = ["[workspace]                             # a range spans the volume, a number stands"]
    return [*lines, *(_line(axis, _range(*ends)) for axis, ends in sizes.workspace.items())]


def _points(chain: Chain, sizes: Layout) -> list[str]:
    """Spell the points that count."""
    rim = sizes.workpiece_mm
    lines = [
        "[points_mm]",
        _line("tool", "[0, 0, 0]", "the point whose error counts, in the tool frame"),
        _line("workpiece", _list(rim), "on the top rim of the largest workpiece, from w"),
    ]
    if any(not is_linear(axis) for axis in chain.workpiece):
        traced = f"[{_list((rim[1], 0.0, 0.0))}, {_list(rim)}]"
        lines.append(_line("traces", traced, "points whose way over a turn is drawn, from w"))
    return lines


def error_lines(chain: Chain, travel: Mapping[str, Range]) -> list[str]:
    """Spell example errors of a chain: a few that act, and a few to switch on.

    Parameters
    ----------
    chain : Chain
    travel : mapping of str to tuple of float, (2,), mm or degrees

    Returns
    -------
    list of str
        The lines of the section ``[errors]``.
    """
    given, further = _example_keys(chain)
    lines = [
        "[errors]                                # examples; what is absent is 0, # takes one out"
    ]
    for key, kind in given:
        value, why = EXAMPLES[kind]
        row = parameter(key)
        lines.append(_line(key, value, f"{row.name}, {row.unit}: {why}"))
    for key in further:
        row = parameter(key)
        low, high = travel[row.axis]
        table = f"{{ table = [[{low:g}, 0], [{high:g}, 5]] }}"
        lines.append(f"# {_line(key, table, f'{row.name}, {row.unit}: measured points')}")
    first = chain.axes[0]
    key = f"E{'XYZ'[(direction_index(first) + 2) % 3]}{first}"
    return [*lines, f'# {key} = {{ csv = "measured.csv", column = "{key}" }}']


def _example_keys(chain: Chain) -> tuple[list[tuple[str, str]], list[str]]:
    """Choose errors that show: those that act with the kind of example, and further ones."""
    given: list[tuple[str, str]] = []
    # those of the tool side first: the first picture is that of the tool point
    axes = sorted(chain.axes, key=lambda axis: axis not in chain.tool)
    linear = [axis for axis in axes if is_linear(axis)]
    rotary = [axis for axis in axes if not is_linear(axis)]
    rows = sorted(
        (parameter(key) for key in default_keys(chain.axes)),
        key=lambda row: row.axis not in chain.tool,
    )
    if linear:
        first = linear[0]
        own = direction_index(first)
        given.append((f"E{'XYZ'[own]}{first}", "positioning"))
        given.append((f"E{'ABC'[(own + 1) % 3]}{first}", "pitch"))
    given += [(row.key, "squareness") for row in rows if row.kind is ErrorKind.SQUARENESS][:1]
    given += [(row.key, "orientation") for row in rows if row.kind is ErrorKind.ORIENTATION][:1]
    if rotary:
        given.append((f"E{'ABC'[(direction_index(rotary[0]) + 1) % 3]}{rotary[0]}", "wobble"))
    return given, [f"E{'XYZ'[(direction_index(axis) + 1) % 3]}{axis}" for axis in linear[:1]]
