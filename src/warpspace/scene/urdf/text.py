"""The scene of an imported robot, as the text of a file."""

from collections.abc import Mapping, Sequence

from warpspace.field.grid import Workspace
from warpspace.kinematics.model import Model
from warpspace.machine.axes import direction_index, is_linear
from warpspace.machine.description import Machine, Range
from warpspace.machine.tolerances import ToleranceSet
from warpspace.scene.model import Scene
from warpspace.scene.save import scene_to_toml
from warpspace.scene.starter.text import error_lines

TOLERANCES = {"translation": 10.0, "rotation": 20.0, "squareness": 25.0}
ARM_RANGE = 30.0
"""Half of the range that a rotary axis spans the volume with, degrees."""
LONGEST_NOTE = 300


def imported_text(
    machine: Machine, source: str, notes: Sequence[str], meshes: Mapping[str, str]
) -> str:
    """Spell the scene of a machine that was read from another format.

    Parameters
    ----------
    machine : Machine
    source : str
        Name of the file it was read from.
    notes : sequence of str
        What was taken in another way or left out: remarks at the beginning.
    meshes : mapping of str to str
        Frame to the name of the file with its mesh, mm.

    Returns
    -------
    str
        TOML.
    """
    scene = Scene(
        name="imported",
        title=machine.title or source,
        model=Model(machine),
        workspace=Workspace(_ranges(machine)),
        tolerances=ToleranceSet(TOLERANCES),
    )
    travel = {name: axis.travel for name, axis in machine.axes.items()}
    head = [f"# Read from {_plain(source)}. Lengths mm, angles degrees."]
    head += [f"# {_plain(note)}" for note in notes]
    parts = ["\n".join(head), scene_to_toml(scene).strip()]
    parts.append("\n".join(error_lines(machine.chain, travel)))
    if meshes:
        lines = ["[bodies]", *(f'{frame} = "{file}"' for frame, file in meshes.items())]
        parts.append("\n".join(lines))
    return "\n\n".join(parts) + "\n"


def _plain(text: str) -> str:
    """Keep a remark on one line."""
    shown = "".join(letter if letter.isprintable() else "?" for letter in text)
    return shown if len(shown) <= LONGEST_NOTE else shown[: LONGEST_NOTE - 1] + "…"


def _ranges(machine: Machine) -> dict[str, Range]:
    """Choose the working volume: linear axes by direction, else rotary ones of the tool side."""
    taken: set[int] = set()
    found: dict[str, Range] = {}
    for name, axis in machine.axes.items():
        low, high = axis.travel
        at = min(max(0.0, low), high)
        found[name] = (at, at)
        if is_linear(name) and direction_index(name) not in taken:
            taken.add(direction_index(name))
            found[name] = axis.travel
    free = 3 - len(taken)
    turning = [name for name in machine.chain.tool if not is_linear(name)]
    if free > 1:
        for name in turning[:free]:
            low, high = machine.axes[name].travel
            middle = min(max(0.0, low + ARM_RANGE), high - ARM_RANGE)
            ends = max(low, middle - ARM_RANGE), min(high, middle + ARM_RANGE)
            found[name] = ends if ends[0] < ends[1] else found[name]
    return found
