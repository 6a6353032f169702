"""The conventions there are. A new one is a module beside this and a line below."""

from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.kinematics.conventions.after_motion import AfterMotion
from warpspace.kinematics.conventions.before_motion import BeforeMotion
from warpspace.kinematics.conventions.convention import Convention
from warpspace.plugins import load_plugins

_CONVENTIONS: dict[str, Convention] = {
    convention.name: convention for convention in (AfterMotion(), BeforeMotion())
}


def convention_names() -> tuple[str, ...]:
    """List the names of all conventions."""
    load_plugins()
    return tuple(_CONVENTIONS)


def find_convention(name: str) -> Convention:
    """Find a convention by its name.

    Raises
    ------
    UnknownNameError
        If there is none.
    """
    # Asked for each parameter of a Jacobian: plug-ins are looked for only where they may matter.
    if name not in _CONVENTIONS and name not in convention_names():
        raise UnknownNameError("convention", name, _CONVENTIONS)
    return _CONVENTIONS[name]


def register_convention(convention: Convention) -> None:
    """Add a convention; it appears in scene files, the app, reports and figures.

    Parameters
    ----------
    convention : Convention
        With a name of its own.

    Raises
    ------
    OptionError
        If the name is taken.
    """
    if convention.name in _CONVENTIONS:
        raise OptionError(f"convention {convention.name!r} is there already")
    _CONVENTIONS[convention.name] = convention


def unregister_convention(name: str) -> None:
    """Take a convention away again."""
    del _CONVENTIONS[name]
