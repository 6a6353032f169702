"""The machines to start from: those of the bundled scenes, each once."""

from dataclasses import dataclass
from functools import cache

from warpspace.exceptions import WarpspaceError
from warpspace.scene.library import load_scene, scene_names
from warpspace.scene.model import Scene


@dataclass(frozen=True, slots=True)
class MachineType:
    """A machine to start from.

    Attributes
    ----------
    name : str
        Of the machine, or of its scene where it is written there.
    scene : Scene
        Brings its working volume and points.
    """

    name: str
    scene: Scene

    @property
    def title(self) -> str:
        """Full name of the machine."""
        return self.scene.machine.title


@cache
def machine_types() -> tuple[MachineType, ...]:
    """List the machines of the bundled scenes, in the order of the scenes."""
    found: dict[str, MachineType] = {}
    for name in scene_names():
        try:
            scene = load_scene(name)
        except WarpspaceError:  # a scene that was put beside the others is no reason to fail
            continue
        found.setdefault(scene.machine.name, MachineType(scene.machine.name, scene))
    return tuple(found.values())


def library_scene(name: str) -> Scene | None:
    """Give the scene of a machine of the library; None for a name that is none."""
    return next((entry.scene for entry in machine_types() if entry.name == name), None)
