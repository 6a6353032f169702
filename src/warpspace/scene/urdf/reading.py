"""Reading a URDF file: its links and joints, checked to be a tree of joints that one can follow."""

import io
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from warpspace.exceptions import OptionError, SceneError
from warpspace.machine.limits import MAX_SCENE_BYTES
from warpspace.scene.files import read_text

MOVING = ("revolute", "continuous", "prismatic")
JOINT_TYPES = (*MOVING, "fixed", "floating", "planar")


def read_robot(path: Path) -> tuple[Any, tuple[str, ...]]:
    """Read the links and joints of a URDF file.

    Parameters
    ----------
    path : Path

    Returns
    -------
    robot : yourdfpy.urdf.Robot
        A tree of links with one root.
    others : tuple of str
        Names of the further elements of the file, which nothing is made of.

    Raises
    ------
    SceneError
        If it cannot be read, is no URDF, or its joints are no tree; one message each.
    OptionError
        If yourdfpy is not installed.
    """
    source = str(path)
    text = read_text(path, MAX_SCENE_BYTES)
    others = _check_xml(text, source)
    robot = _parse(text, source)
    problems = list(_problems(robot))
    if problems:
        raise SceneError(source, problems)
    return robot, others


def _check_xml(text: str, source: str) -> tuple[str, ...]:
    """Refuse what is no XML of a robot, and XML that defines text of its own.

    Returns
    -------
    tuple of str
        Names of the elements beside links, joints and materials.
    """
    try:
        from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]
    except ImportError:
        raise _not_installed() from None
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise SceneError(source, ["defines a document type; expected a plain URDF file"])
    parser = etree.XMLParser(resolve_entities=False, no_network=True, huge_tree=False)
    try:
        root = etree.fromstring(text.encode(), parser)
    except etree.XMLSyntaxError as error:
        raise SceneError(source, [f"is not valid XML: {error.msg}"]) from None
    if root.tag != "robot":
        raise SceneError(source, [f"is no URDF: begins with <{root.tag}>; expected <robot>"])
    names = [element.tag for element in root.iter() if isinstance(element.tag, str)]
    if any("xacro" in name for name in names):
        problem = "holds xacro macros; expected plain URDF (`xacro FILE > robot.urdf` expands it)"
        raise SceneError(source, [problem])
    return tuple(
        element.tag
        for element in root
        if isinstance(element.tag, str) and element.tag not in ("link", "joint", "material")
    )


def _parse(text: str, source: str) -> Any:
    """Have yourdfpy read the text; no mesh is opened."""
    try:
        from yourdfpy import URDF
    except ImportError:
        raise _not_installed() from None
    try:
        # numbers that are not finite are refused by name later
        with np.errstate(all="ignore"):
            loaded = URDF.load(
                io.BytesIO(text.encode()), build_scene_graph=False, load_meshes=False, mesh_dir=""
            )
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, AssertionError) as error:
        # yourdfpy reads without checking: what is missing or no number ends in one of these
        reason = f"{type(error).__name__}: {error}".replace("\n", " ")[:200]
        problem = (
            f"is no complete URDF ({reason}); expected links, and joints with parent and child"
        )
        raise SceneError(source, [problem]) from None
    return loaded.robot


def _not_installed() -> OptionError:
    """Say what is missing."""
    return OptionError(
        "URDF files need the package yourdfpy; expected it installed"
        " (pip install 'warpspace[urdf]')"
    )


def _problems(robot: Any) -> Iterable[str]:
    """Find what keeps the joints from being a tree."""
    links = [link.name for link in robot.links]
    for name in _twice(links):
        yield f"link {name!r} is there twice; expected each name once"
    for name in _twice([joint.name for joint in robot.joints]):
        yield f"joint {name!r} is there twice; expected each name once"
    if not links:
        yield "has no link"
        return
    parents: dict[str, str] = {}
    for joint in robot.joints:
        where = f"joint {joint.name!r}"
        if joint.type not in JOINT_TYPES:
            yield f"{where}: type {joint.type!r}; expected one of {', '.join(JOINT_TYPES)}"
        for end in (joint.parent, joint.child):
            if end not in links:
                yield f"{where}: there is no link {end!r}"
        if joint.child in parents:
            yield (
                f"link {joint.child!r} hangs on joints {parents[joint.child]!r} and {joint.name!r}:"
                " a loop; expected one parent for each link"
            )
        parents[joint.child] = joint.name
    roots = [name for name in links if name not in parents]
    if not roots:
        yield "every link has a parent: a loop; expected one link that hangs on nothing"
    elif len(roots) > 1:
        shown = ", ".join(map(repr, roots[:6]))
        yield f"links {shown} hang on nothing; expected one such link, the frame of the machine"


def _twice(names: list[str]) -> list[str]:
    """List the names that are there more than once."""
    return sorted({str(name) for name in names if names.count(name) > 1})


def root_of(robot: Any) -> str:
    """Give the name of the link that hangs on nothing."""
    children = {joint.child for joint in robot.joints}
    return next(link.name for link in robot.links if link.name not in children)


def path_to(robot: Any, link: str) -> list[Any]:
    """List the joints from the root to a link."""
    by_child = {joint.child: joint for joint in robot.joints}
    found: list[Any] = []
    while link in by_child and len(found) <= len(by_child):
        found.append(by_child[link])
        link = by_child[link].parent
    return found[::-1]
