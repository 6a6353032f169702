"""Another chain, another order, the other side, another machine of the library."""

from dataclasses import replace

from warpspace.exceptions import ChainError, OptionError, UnknownNameError
from warpspace.machine.description import Chain, parse_chain
from warpspace.scene.editing.edited import Edited, rearranged, with_machine
from warpspace.scene.model import Scene
from warpspace.scene.starter.text import starter_scene

MOST_CHAIN_TEXT = 100
"""Characters of a chain, as in a file."""
FRAME = "F"
STEPS = {"left": -1, "right": 1}
"""Ways in which an axis moves along the written chain: towards the workpiece, towards the tool."""


def change_chain(scene: Scene, text: str) -> Edited:
    """Give the machine of a scene another chain as a user has typed it.

    Parameters
    ----------
    scene : Scene
    text : str
        For instance ``wCBFXYZt``.

    Returns
    -------
    Edited
        Axes that stay keep everything they have.

    Raises
    ------
    ChainError
        If it is no chain; the message says what was expected.
    SceneError
        If the scene could not be saved with it.
    """
    if len(text) > MOST_CHAIN_TEXT:
        raise ChainError(
            f"chain of {len(text)} characters; expected at most {MOST_CHAIN_TEXT},"
            " for instance wCBFXYZt"
        )
    chain = parse_chain(text)
    if chain == scene.machine.chain:
        return Edited(scene)
    return with_machine(scene, rearranged(scene.machine, chain))


def move_axis(scene: Scene, axis: str, way: str) -> Edited:
    """Move an axis by one place along the written chain; across the frame it changes sides.

    Parameters
    ----------
    scene : Scene
    axis : str
    way : str
        "left" or "right"; at the end of the chain nothing changes.

    Raises
    ------
    UnknownNameError
        If there is no such axis or way.
    SceneError
        If the scene could not be saved with it.
    """
    scene.machine.axis(axis)
    if way not in STEPS:
        raise UnknownNameError("way", way, STEPS)
    chain = scene.machine.chain
    places = [*reversed(chain.workpiece), FRAME, *chain.tool]
    place = places.index(axis)
    other = place + STEPS[way]
    if not 0 <= other < len(places):
        return Edited(scene)
    places[place], places[other] = places[other], places[place]
    return _placed(scene, places)


def switch_side(scene: Scene, axis: str) -> Edited:
    """Let an axis carry the tool instead of the workpiece, or the other way; next to the frame.

    Raises
    ------
    UnknownNameError
        If there is no such axis.
    SceneError
        If the scene could not be saved with it.
    """
    scene.machine.axis(axis)
    chain = scene.machine.chain
    carries_tool = axis in chain.tool
    places = [name for name in (*reversed(chain.workpiece), FRAME, *chain.tool) if name != axis]
    places.insert(places.index(FRAME) + (0 if carries_tool else 1), axis)
    return _placed(scene, places)


def remove_axis(scene: Scene, axis: str) -> Edited:
    """Take an axis away.

    Raises
    ------
    UnknownNameError
        If there is no such axis.
    OptionError
        If it is the last one.
    SceneError
        If the scene could not be saved without it.
    """
    scene.machine.axis(axis)
    chain = scene.machine.chain
    if len(chain.axes) == 1:
        raise OptionError(f"axis {axis} is the only one; expected a machine with at least one")
    sides = ((name for name in side if name != axis) for side in (chain.workpiece, chain.tool))
    return with_machine(scene, rearranged(scene.machine, Chain(*map(tuple, sides))))


def take_machine(scene: Scene, library: Scene) -> Edited:
    """Take machine, working volume and points of a scene of the library.

    Parameters
    ----------
    scene : Scene
        Errors and tolerances of axes that both have, and its title, are kept.
    library : Scene

    Raises
    ------
    SceneError
        If the scene could not be saved with it.
    """
    points = replace(
        scene,
        model=replace(
            scene.model,
            tool_point_mm=library.model.tool_point_mm,
            workpiece_point_mm=library.model.workpiece_point_mm,
        ),
        trace_points_mm=library.trace_points_mm,
    )
    machine = library.machine
    if not machine.body_dir:  # it stands in a scene, and comes to stand in this one
        machine = replace(machine, name=scene.name)
    return with_machine(points, machine, library.workspace)


def take_sizes(scene: Scene) -> Edited:
    """Give the machine of a scene the sizes of a new one with its chain.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    Edited
        With offsets, travels, directions, working volume and points that fit together.

    Raises
    ------
    SceneError
        If the scene could not be saved with it.
    """
    return take_machine(scene, starter_scene(scene.machine.chain))


def _placed(scene: Scene, places: list[str]) -> Edited:
    """Read the chain from its axes and the frame between them."""
    frame = places.index(FRAME)
    chain = Chain(tuple(reversed(places[:frame])), tuple(places[frame + 1 :]))
    return with_machine(scene, rearranged(scene.machine, chain))
