"""Bodies for any chain: what stands under the tool, what carries it, and the bed under all."""

from functools import lru_cache

from warpspace.bodies.generated.bed import build_bed
from warpspace.bodies.generated.head import build_head
from warpspace.bodies.generated.horizontal import build_behind
from warpspace.bodies.generated.layout import UP, build_layout
from warpspace.bodies.generated.overhead import build_overhead
from warpspace.bodies.generated.parts import Parts
from warpspace.bodies.generated.table import build_table
from warpspace.bodies.mesh import Body
from warpspace.machine.body_source import TOOL_SHAPES
from warpspace.machine.description import Axis, Machine, Vector

_LYING = 0.7
"""Upward part of a tool axis below which the machine is built as one with a horizontal spindle."""
_Key = tuple[str, tuple[Axis, ...], tuple[tuple[str, Vector], ...], tuple[tuple[str, Vector], ...]]


def generate_bodies(machine: Machine) -> tuple[Body, ...]:
    """Generate the schematic bodies of a machine from its chain, offsets and travels.

    Parameters
    ----------
    machine : Machine

    Returns
    -------
    tuple of Body
        Kept: the same machine gives the same bodies at once.
    """
    key = (
        str(machine.chain),
        tuple(machine.axes.values()),
        tuple(sorted(machine.fixed_mm.items())),
        tuple(sorted(machine.fixed_deg.items())),
    )
    source = machine.bodies.get("t")
    return _generate(key, (source.shape if source else "") or TOOL_SHAPES[0])


@lru_cache(maxsize=32)
def _generate(key: _Key, tool: str) -> tuple[Body, ...]:
    """Generate the bodies of a machine described by values that can be compared."""
    from warpspace.machine.description import parse_chain

    chain, axes, fixed_mm, fixed_deg = key
    machine = Machine(
        parse_chain(chain),
        {axis.name: axis for axis in axes},
        dict(fixed_mm),
        fixed_deg=dict(fixed_deg),
    )
    layout = build_layout(machine)
    parts = Parts(layout.poses)
    stack = build_table(layout, parts)
    mount = build_head(layout, parts, tool)
    if abs(float(layout.tool_axis @ UP)) < _LYING:
        build_behind(layout, parts, mount, stack)
    else:
        build_overhead(layout, parts, mount, stack)
    build_bed(layout, parts, stack)
    return parts.bodies()
