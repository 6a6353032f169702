"""Two scenes over one working volume: common settings, and the change from A to B."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from warpspace.analysis.blocks import Block, Column, Table, number_columns
from warpspace.analysis.description import to_json
from warpspace.analysis.statistics import Statistics
from warpspace.exceptions import OptionError
from warpspace.machine.errors import ErrorSet
from warpspace.picture import model
from warpspace.picture.formatting import point_axes, spell_at, spell_point
from warpspace.picture.traces import TraceLines
from warpspace.scene.model import Scene

CHANGE = "B − A"  # how a change is called, and its sign
STATISTICS = {"mean": "mean_um", "RMS": "rms_um", "P95": "p95_um", "max": "max_um"}
"""Name of a statistic, and its attribute of `Statistics`."""


@dataclass(frozen=True, kw_only=True)
class DifferencePicture(model.ScenePicture):
    """The change from scene A to scene B, B − A; the bodies of its machine stand nominally."""

    a: model.ScenePicture
    b: model.ScenePicture

    @cached_property
    def traces(self) -> tuple[TraceLines, ...]:
        """Traces that both have, each displaced by the difference."""
        return model.subtract_traces(self.b.traces, self.a.traces)

    @cached_property
    def settings(self) -> dict[str, Any]:
        """Settings of both pictures; where they differ, a list of two."""
        pairs = {name: (value, self.b.settings[name]) for name, value in self.a.settings.items()}
        return {
            **{name: a if a == b else [a, b] for name, (a, b) in pairs.items()},
            "difference": CHANGE,
            "conditions": list(self.conditions),
        }

    @property
    def remarks(self) -> dict[str, str]:
        """Columns that are the same in all rows of a table, of both scenes where they differ."""
        pairs = zip(self.a.remarks.items(), self.b.remarks.values(), strict=True)
        merged = {name: a if a == b else f"{b} − {a}" for (name, a), b in pairs}
        return {**merged, "scene": self.scene.name, "conditions": "; ".join(self.conditions)}

    @cached_property
    def provenance(self) -> dict[str, Any]:
        """Program, settings and statistics of the difference, and the provenance of both scenes."""
        return {
            "program": self.a.provenance["program"],
            "scene": self.scene.name,
            "title": self.scene.title,
            "settings": self.settings,
            "statistics": to_json(self.statistics),
            "statistics_of": model.DIFFERENCE_LENGTH,
            "change": statistics_change(self.a.statistics, self.b.statistics),
            "a": self.a.provenance,
            "b": self.b.provenance,
        }


def statistics_change(a: Statistics, b: Statistics) -> dict[str, float]:
    """Subtract each statistic of A from that of B, µm, by the names of their attributes."""
    return {name: getattr(b, name) - getattr(a, name) for name in STATISTICS.values()}


def statistics_blocks(
    scene: Scene, names: Sequence[str], fields: Sequence[Statistics]
) -> Iterator[Block]:
    """Tabulate the statistics of fields over one volume, with the location of each maximum."""
    columns = [Column("|E|" if len(names) > 1 else "", leads=True)]
    columns += number_columns(names, unit="µm")
    change = statistics_change(*fields[:2]) if len(names) == 2 else {}
    if change:
        columns.append(Column(CHANGE, "+.2f", "µm", joins=True))
    if len(fields) > len(names):
        columns.append(Column(model.DIFFERENCE_LENGTH, ".2f", "µm", joins=True))
    rows = [
        (
            name, *(getattr(summary, key) for summary in fields[: len(names)]),
            *([change[key]] if change else []),
            *(getattr(summary, key) for summary in fields[len(names) :]),
        )
        for name, key in STATISTICS.items()
    ]  # fmt: skip
    yield Table(tuple(columns), rows)
    for name, part in zip((*names, model.DIFFERENCE_LENGTH), fields, strict=False):
        if part.max_um > 0.0:
            worst = point_axes(scene, part.max_at_axes)
            yield f"  max of {name} at {spell_point(worst, part.max_at_mm)} mm"
            yield f"  --at {spell_at(worst)}"


def conditions_of_both(a: Sequence[str], b: Sequence[str]) -> tuple[str, ...]:
    """List the conditions of two pictures: those of one with its letter, common ones once."""
    only_a = [f"A {condition}" for condition in a if condition not in b]
    only_b = [f"B {condition}" for condition in b if condition not in a]
    return (*only_a, *only_b, *(condition for condition in a if condition in b))


def scene_change(a: model.ScenePicture, b: model.ScenePicture) -> DifferencePicture:
    """Subtract the errors of evaluated scene A from those of B, B − A."""
    if not model.same_nodes(a.field.nominal_mm, b.field.nominal_mm):
        raise OptionError(
            f"{a.scene.name} and {b.scene.name} cannot be compared: their working volumes"
            " differ ([workspace] of both must give the same box)"
        )
    scene = replace(
        a.scene,
        name=f"{b.scene.name} minus {a.scene.name}",
        title=f"{CHANGE}: {b.scene.title} − {a.scene.title}",
        errors=ErrorSet(),
    )
    return DifferencePicture(
        view=a.view,
        grid=a.grid,
        field=b.field - a.field,
        exaggeration=a.exaggeration,
        component=a.component,
        quantity=a.quantity,
        is_difference=True,
        conditions=conditions_of_both(a.conditions, b.conditions),
        scene=scene,
        a=a,
        b=b,
    )


def share_exaggeration(
    pictures: Sequence[model.ScenePicture], exaggeration: model.Exaggeration
) -> tuple[model.ScenePicture, ...]:
    """Apply one display factor to pictures: as requested, the first scene's, or a round one."""
    factor = model.choose_exaggeration(
        exaggeration,
        pictures[0].scene.exaggeration,
        max(picture.statistics.max_um for picture in pictures),
        max(picture.size_mm for picture in pictures),
    )
    return tuple(replace(picture, exaggeration=factor) for picture in pictures)
