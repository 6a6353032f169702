"""The difference of two scenes as an export: every displacement is A − B."""

from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from warpspace.analysis.statistics import statistics
from warpspace.machine.errors import ErrorSet
from warpspace.outputs.exports.drawing import Drawing, DrawnTrace
from warpspace.picture.difference import SAME_MM, difference_field


@dataclass(frozen=True, kw_only=True)
class Difference(Drawing):
    """Two scenes over one working volume, the second subtracted from the first.

    Attributes
    ----------
    one, other : Drawing
    """

    one: Drawing
    other: Drawing

    @cached_property
    def traces(self) -> tuple[DrawnTrace, ...]:
        """Traces that both have, each displaced by the difference."""
        return tuple(
            replace(first, error_um=first.error_um - second.error_um)
            for first, second in zip(self.one.traces, self.other.traces, strict=False)
            if first.nominal_mm.shape == second.nominal_mm.shape
            and np.abs(first.nominal_mm - second.nominal_mm).max() <= SAME_MM
        )

    @cached_property
    def settings(self) -> dict[str, Any]:
        """How both were looked at; where they differ, a list of two."""
        pairs = {
            name: (value, self.other.settings[name]) for name, value in self.one.settings.items()
        }
        return {
            **{name: a if a == b else [a, b] for name, (a, b) in pairs.items()},
            "difference": "A − B",
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
            "statistics": asdict(self.picture.statistics),
            "a": self.one.provenance,
            "b": self.other.provenance,
        }


def subtract_drawings(one: Drawing, other: Drawing) -> Difference:
    """Subtract one evaluated scene from another, A − B.

    Parameters
    ----------
    one, other : Drawing
        A and B.

    Returns
    -------
    Difference
        Drawn with the factor, the component and the colours of A. The bodies of its machine stand
        where they nominally are.

    Raises
    ------
    OptionError
        If the working volumes are not the same.
    """
    field = difference_field(other.picture, one.picture)
    scene = replace(
        one.scene,
        name=f"{one.scene.name} minus {other.scene.name}",
        title=f"A − B: {one.scene.title} − {other.scene.title}",
        errors=ErrorSet(),
    )
    picture = replace(one.picture, scene=scene, field=field, statistics=statistics(field))
    return Difference(
        picture,
        one.exaggeration,
        one.component,
        one.tilts,
        one.colours,
        one=one,
        other=other,
    )
