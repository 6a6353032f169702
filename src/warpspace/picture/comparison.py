"""Two scenes over one working volume: what they share, and the picture of their difference."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any, cast

from warpspace.exceptions import OptionError
from warpspace.machine.errors import ErrorSet
from warpspace.picture.exaggeration import Exaggeration, choose_exaggeration
from warpspace.picture.model import P, Picture, same_nodes, subtract_fields
from warpspace.picture.scene_picture import ScenePicture
from warpspace.picture.traces import TraceLines, subtract_traces


@dataclass(frozen=True, kw_only=True)
class DifferencePicture(ScenePicture):
    """The difference of two scenes, one − other; the bodies of its machine stand nominally.

    Attributes
    ----------
    one, other : ScenePicture
    sign : str
        How the two are called: "A − B" or "B − A".
    """

    one: ScenePicture
    other: ScenePicture
    sign: str

    @cached_property
    def traces(self) -> tuple[TraceLines, ...]:
        """Traces that both have, each displaced by the difference."""
        return subtract_traces(self.one.traces, self.other.traces)

    @cached_property
    def settings(self) -> dict[str, Any]:
        """How both were looked at; where they differ, a list of two."""
        pairs = {
            name: (value, self.other.settings[name]) for name, value in self.one.settings.items()
        }
        return {
            **{name: a if a == b else [a, b] for name, (a, b) in pairs.items()},
            "difference": self.sign,
        }

    @property
    def remarks(self) -> dict[str, str]:
        """What a table says of every row, of both scenes where they differ."""
        pairs = zip(self.one.remarks.items(), self.other.remarks.values(), strict=True)
        found = {name: a if a == b else f"{a} − {b}" for (name, a), b in pairs}
        return {**found, "scene": self.scene.name}

    @cached_property
    def provenance(self) -> dict[str, Any]:
        """Program, settings and statistics of the difference, and all of both scenes."""
        return {
            "program": self.one.provenance["program"],
            "scene": self.scene.name,
            "title": self.scene.title,
            "settings": self.settings,
            "statistics": asdict(self.statistics),
            "a": self.one.provenance,
            "b": self.other.provenance,
        }


def check_same_nodes(first: ScenePicture, second: ScenePicture) -> None:
    """Refuse two pictures whose nodes do not coincide.

    Raises
    ------
    OptionError
        With the names of the scenes.
    """
    if not same_nodes(first.field.nominal_mm, second.field.nominal_mm):
        raise OptionError(
            f"{first.scene.name} and {second.scene.name} cannot be compared: their working volumes"
            " differ ([workspace] of both must give the same box)"
        )


def subtract_scenes(one: ScenePicture, other: ScenePicture, sign: str) -> DifferencePicture:
    """Subtract one evaluated scene from another, one − other.

    Parameters
    ----------
    one, other : ScenePicture
    sign : str
        How the two are called: "A − B" or "B − A".

    Returns
    -------
    DifferencePicture
        Drawn with the factor, the component and the colours of `one`.

    Raises
    ------
    OptionError
        If the working volumes are not the same.
    """
    check_same_nodes(one, other)
    scene = replace(
        one.scene,
        name=f"{one.scene.name} minus {other.scene.name}",
        title=f"{sign}: {one.scene.title} − {other.scene.title}",
        errors=ErrorSet(),
    )
    return DifferencePicture(
        view=one.view,
        grid=one.grid,
        field=subtract_fields(one.field, other.field),
        exaggeration=one.exaggeration,
        component=one.component,
        quantity=one.quantity,
        colours=one.colours,
        scene=scene,
        one=one,
        other=other,
        sign=sign,
    )


def share_exaggeration(
    pictures: Sequence[P], wanted: Exaggeration, own: float | None
) -> tuple[P, ...]:
    """Give pictures one display factor: what is asked for, or a round one that suits all.

    Parameters
    ----------
    pictures : sequence of Picture
    wanted : float, "auto" or None
    own : float or None
        What the first scene says.

    Returns
    -------
    tuple of Picture
    """
    factor = choose_exaggeration(
        wanted,
        own,
        max(picture.statistics.max_um for picture in pictures),
        max(picture.size_mm for picture in pictures),
    )
    return tuple(cast("P", replace(cast("Picture", one), exaggeration=factor)) for one in pictures)
