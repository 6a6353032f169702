"""What the tab "Concepts" sets side by side: the machines, and how they are compared; clamped."""

from dataclasses import dataclass, replace

from warpspace.app.state.ranges import Span
from warpspace.machine.limits import MOST_CONCEPTS
from warpspace.scene.model import Scene

LIMIT_UM = Span(0.1, 10_000.0, 0.1)
PRESENT = "the present machine"
TOLERANCES = {"those of A, for all": False, "own of each": True}
"""Words to whether each machine has its own tolerances."""
OVERS = {"everywhere": "max", "a random point": "sampled"}
LOOPS = {"tool against workpiece": "relative", "tool": "tool", "workpiece": "workpiece"}


@dataclass(frozen=True, slots=True)
class Chosen:
    """A machine that was chosen."""

    title: str
    scene: Scene | None = None  # none is what is steered, as it stands when machines are compared
    picture: str = ""  # name of the machine in the library that shows it; empty for none

    def is_same(self, other: "Chosen") -> bool:
        """Tell whether both mean one scene."""
        return self.scene is other.scene or (self.scene is not None and self.scene == other.scene)


@dataclass(frozen=True, slots=True)
class ConceptChoice:
    """What is compared, and how."""

    # in their order; tolerances are those of the first
    machines: tuple[Chosen, ...] = (Chosen(PRESENT),)
    limit_um: float = 50.0
    own_tolerances: bool = False
    over: str = "max"  # "sampled" or "max", as the command has it
    loop: str = "relative"

    def holds(self, machine: Chosen) -> bool:
        """Tell whether a machine is chosen."""
        return any(machine.is_same(one) for one in self.machines)

    def toggled(self, machine: Chosen) -> "ConceptChoice":
        """Choose a machine, or no longer; what would be one too many changes nothing."""
        rest = tuple(one for one in self.machines if not machine.is_same(one))
        if len(rest) == len(self.machines):
            rest = (*rest, machine) if len(rest) < MOST_CONCEPTS else rest
        return replace(self, machines=rest)

    def with_limit(self, value: float) -> "ConceptChoice":
        """Set the limit, µm, within its range; what is no number changes nothing."""
        return replace(self, limit_um=LIMIT_UM.clamp(value, self.limit_um))

    def with_words(self, tolerances: str, over: str, loop: str) -> "ConceptChoice":
        """Take over what three lists show; a word that is in none of them changes nothing."""
        return replace(
            self,
            own_tolerances=TOLERANCES.get(tolerances, self.own_tolerances),
            over=OVERS.get(over, self.over),
            loop=LOOPS.get(loop, self.loop),
        )
