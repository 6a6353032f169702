"""What a result proposes, as a card: the errors from and to, max and mean before and after."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from markupsafe import Markup

from warpspace.analysis.description import Change
from warpspace.analysis.statistics import Statistics, volume_statistics
from warpspace.app.browser.html import EMPTY, button, join, number, rows, tag
from warpspace.app.state.app_state import AppState
from warpspace.exceptions import WarpspaceError
from warpspace.field.grid import build_grid
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import parameter
from warpspace.scene.model import Scene, evaluate_grid

MOST_STEPS = 4  # errors that a card names one by one
SAME = 1e-9  # µm or µrad; an error that moves by less stays


@dataclass(frozen=True, slots=True)
class Seen:
    """How the volume is looked at while scenes are set beside each other."""

    loop: Loop
    placed: bool
    nodes: int

    @classmethod
    def of(cls, state: AppState) -> "Seen":
        """Give how a state looks at its volume."""
        return cls(state.loop, state.placed, state.nodes)

    def statistics(self, scene: Scene) -> Statistics | None:
        """Evaluate a scene over its volume; None where it cannot be."""
        scene = replace(scene, placed=self.placed)
        try:
            grid = build_grid(scene.model, scene.workspace, self.nodes)
            return volume_statistics(evaluate_grid(scene, grid, scene.view(self.loop)), grid)
        except WarpspaceError:
            return None


@dataclass(frozen=True, slots=True)
class Card:
    """A proposed scene and what it changes."""

    change: Change
    steps: tuple[str, ...]  # the errors that move, the largest step first
    before: Statistics | None
    after: Statistics | None

    def html(self, part: str, index: int, *, stale: bool = False) -> Markup:
        """Say it, with buttons that preview and apply it."""
        words = [tag("b", one) for one in self.steps[:MOST_STEPS]] or [tag("b", self.change.words)]
        if more := len(self.steps) - MOST_STEPS:
            words += [tag("span", f"and {more} more", class_="ws-quiet")] if more > 0 else []
        buttons = join((
            button("Preview", f"{part}:preview", index, disabled=stale,
                   hint="Draw the result beside the present state"),
            button("Apply", f"{part}:apply", index, kind="main", disabled=stale,
                   hint="Change the errors; the state before it is kept as A"),
        ))  # fmt: skip
        lines = join(tag("div", one) for one in words)
        return tag("div", lines + self._numbers() + tag("div", buttons, class_="ws-actions"),
                   class_="ws-card")  # fmt: skip

    def _numbers(self) -> Markup:
        before, after = self.before, self.after
        if before is None or after is None:
            return EMPTY
        pairs = (("max", before.max_um, after.max_um), ("mean", before.mean_um, after.mean_um))
        return rows((name, f"{number(was)} → {number(then)} µm") for name, was, then in pairs)


def make_cards(scene: Scene, changes: Sequence[Change], seen: Seen) -> tuple[Card, ...]:
    """Set each proposed scene beside the present one."""
    if not changes:
        return ()
    before = seen.statistics(scene)
    return tuple(
        Card(one, steps(scene, one.scene), before, seen.statistics(one.scene)) for one in changes
    )


def steps(scene: Scene, proposed: Scene) -> tuple[str, ...]:
    """Say which errors a proposal moves, the largest step first."""
    pairs = {
        key: (scene.errors.amplitude(key), proposed.errors.amplitude(key))
        for key in {**scene.errors.functions, **proposed.errors.functions}
    }
    moved = sorted(pairs, key=lambda key: -abs(pairs[key][1] - pairs[key][0]))
    return tuple(
        f"{key} {number(pairs[key][0])} → {number(pairs[key][1])} {parameter(key).unit}"
        for key in moved
        if abs(pairs[key][1] - pairs[key][0]) > SAME
    )
