"""The kinematic chain: which axes carry the workpiece and which the tool, in their order."""

import re
from dataclasses import dataclass

from warpspace.exceptions import ChainError
from warpspace.machine.axes import MAX_AXES, is_axis_name, sort_axes


@dataclass(frozen=True, slots=True)
class Chain:
    """Order of the axes from the workpiece through the frame to the tool.

    Attributes
    ----------
    workpiece : tuple of str
        Axes that carry the workpiece, from the frame outwards.
    tool : tuple of str
        Axes that carry the tool, from the frame outwards.
    """

    workpiece: tuple[str, ...]
    tool: tuple[str, ...]

    @property
    def axes(self) -> tuple[str, ...]:
        """All axes of the machine in the order X Y Z U V W A B C."""
        return sort_axes({*self.workpiece, *self.tool})

    def __str__(self) -> str:
        """Write the chain in its canonical spelling, for instance ``wCBFXYZt``."""
        return f"w{''.join(reversed(self.workpiece))}F{''.join(self.tool)}t"


def parse_chain(text: str) -> Chain:
    """Read a kinematic chain written from the workpiece over the frame to the tool.

    Parameters
    ----------
    text : str
        For instance ``wCBFXYZt``, ``(w)CBFXYZ(t)``, ``[w C' B' b X Y Z t]`` or ``wC2XFZC1t``.
        Brackets, primes, blanks, hyphens and a small ``b`` for the frame are accepted.

    Returns
    -------
    Chain

    Raises
    ------
    ChainError
        If it does not run from w to t over one frame with one to eight different axes.
    """
    bare = re.sub(r"[\s()\[\]{}'’′\-–_]", "", text)
    expected = (
        "expected w, axes (a letter of X Y Z U V W A B C and an optional digit), F (or b), axes, t;"
        " for instance wCBFXYZt or wC2XFZC1t"
    )
    matched = re.fullmatch(r"[wW]((?:[A-Z][0-9]*)*?)(b|F)((?:[A-EG-Z][0-9]*)*)[tT]", bare)
    if matched is None:
        raise ChainError(f"chain {text!r} cannot be read; {expected}")
    workpiece, tool = (tuple(re.findall(r"[A-Z][0-9]*", matched[side])) for side in (1, 3))
    axes = workpiece + tool
    unknown = sorted({name for name in axes if not is_axis_name(name)})
    if unknown:
        raise ChainError(f"chain {text!r} has unknown axis {', '.join(unknown)}; {expected}")
    twice = sorted({name for name in axes if axes.count(name) > 1})
    if twice:
        raise ChainError(
            f"chain {text!r} has axis {', '.join(twice)} twice; expected each name once"
            f" (a digit tells them apart: {twice[0][0]}1, {twice[0][0]}2)"
        )
    if not 1 <= len(axes) <= MAX_AXES:
        found = f"{len(axes)} axes" if axes else "no axis"
        raise ChainError(f"chain {text!r} has {found}; expected one to eight")
    return Chain(tuple(reversed(workpiece)), tool)
