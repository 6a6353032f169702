"""What a format is and can: what it holds, how it is recognised, read, written and evaluated."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from warpspace.exceptions import OptionError
from warpspace.formats.compensation.wanted import Wanted
from warpspace.formats.measured import Imported
from warpspace.formats.source import Source
from warpspace.formats.terms import Tables
from warpspace.machine.description import Machine

ERROR, CORRECTION = "error", "correction"
"""What the numbers of a controller's table are: the error, which it subtracts, or what it adds."""
SIGNS = (ERROR, CORRECTION)
Files = Mapping[str, str]
"""Text of each file by what is added to the name that the user gives: "" is that file itself."""


@dataclass(frozen=True)
class ReadOptions:
    """What a user says about a file that the file itself does not.

    Attributes
    ----------
    machine : Machine or None
        The machine its errors are for; None where none is named.
    axis : str
        Axis of a file that names none.
    names : mapping of str to str
        Axis of the machine by its name in the file.
    sign : str
        "error" or "correction"; empty for what the documentation of the format says.
    variant : str
        Which of the published variants of a format it is; empty for the usual one.
    """

    machine: Machine | None = None
    axis: str = ""
    names: Mapping[str, str] = field(default_factory=dict[str, str])
    sign: str = ""
    variant: str = ""

    def factor(self, usual: str) -> float:
        """Give the factor from a number of a table to a correction: −1 where it is an error."""
        return -1.0 if (self.sign or usual) == ERROR else 1.0


@dataclass(frozen=True)
class Format:
    """A kind of file.

    Attributes
    ----------
    name, title : str
    source : str
        Where its structure is published.
    endings : tuple of str
        Usual endings of its files.
    holds, units, grid, limits : str
        For the list of formats.
    recognise : callable
        Tells by the first lines of a file and its name whether it is of this format.
    read : callable
        Gives the errors that files hold.
    tables : callable or None
        Gives what the controller evaluates after reading them; None where it is no controller's.
    write : callable or None
        Gives the files that compensate; None where it cannot be written.
    points : int
        Points per axis where none are asked for.
    most_points : int
        Points per axis that the controller takes.
    parametric : bool
        Whether it holds error parameters, from which the controller works out its corrections.
    variants : tuple of str
        Published variants, the usual one first.
    orientation : bool
        Whether corrections of rotary axes have a place in it.
    """

    name: str
    title: str
    source: str
    endings: tuple[str, ...]
    holds: str
    units: str
    grid: str
    limits: str
    recognise: Callable[[str, str], bool]
    read: Callable[[Sequence[Source], ReadOptions], Imported]
    tables: Callable[[Sequence[Source], ReadOptions], Tables] | None = None
    write: Callable[[Wanted], Files] | None = None
    points: int = 21
    most_points: int = 10_000
    parametric: bool = False
    variants: tuple[str, ...] = ()
    orientation: bool = False

    @property
    def can_write(self) -> bool:
        """Whether `warpspace compensate` writes it."""
        return self.write is not None


def resolve_axis(name: str, source: Source, line: int | None, options: ReadOptions) -> str:
    """Find the axis of the machine behind a name in a file: X1, MX1 and X mean X.

    Parameters
    ----------
    name : str
    source : Source
    line : int or None
    options : ReadOptions

    Returns
    -------
    str

    Raises
    ------
    UnsaidError
        If it means no axis, or none of the machine.
    """
    machine = options.machine
    bare = name.strip().strip('"').upper()
    given = options.names.get(bare, "")
    candidates = [given] if given else _candidates(bare)
    if machine is not None:
        for axis in candidates:
            if axis in machine.axes:
                return axis
        known = ", ".join(machine.axes)
        hint = "" if given else f" (--axis {bare or 'NAME'}=AXIS says which one it is)"
        found = f"axis {bare!r} is none of the machine {machine.chain}, which has {known}{hint}"
        raise source.unsaid(found, line)
    for axis in candidates:
        if len(axis) == 1 or given:
            return axis
    expected = f"expected X Y Z U V W A B C; --axis {bare or 'NAME'}=AXIS says which one it is"
    raise source.unsaid(f"axis {bare!r} is not known; {expected}", line)


def _candidates(bare: str) -> list[str]:
    """List the axes that a name may mean, the most likely first."""
    from warpspace.machine.axes import is_axis_name

    found = [bare] if is_axis_name(bare) else []
    stem = bare.removeprefix("M").rstrip("0123456789")
    if len(stem) == 1 and is_axis_name(stem) and stem not in found:
        found.append(stem)
    return found


def parse_axis_options(texts: Sequence[str]) -> tuple[str, dict[str, str]]:
    """Read what a user says of axes: one letter, or NAME=AXIS.

    Returns
    -------
    axis : str
        Axis of files that name none.
    names : dict of str to str

    Raises
    ------
    OptionError
    """
    from warpspace.machine.axes import is_axis_name

    axis, names = "", {}
    for text in texts:
        name, equals, target = text.partition("=")
        found = (target if equals else name).strip().upper()
        if not is_axis_name(found):
            raise OptionError(f"--axis {text!r}; expected an axis (X) or NAME=AXIS (AX1=X)")
        if equals:
            names[name.strip().upper()] = found
        else:
            axis = found
    return axis, names
