"""The conventions there are. A new one is a module beside this and a line below."""

from warpspace.exceptions import UnknownNameError
from warpspace.kinematics.conventions.after_motion import AfterMotion
from warpspace.kinematics.conventions.before_motion import BeforeMotion
from warpspace.kinematics.conventions.convention import Convention

_CONVENTIONS: dict[str, Convention] = {
    convention.name: convention for convention in (AfterMotion(), BeforeMotion())
}


def convention_names() -> tuple[str, ...]:
    """List the names of all conventions."""
    return tuple(_CONVENTIONS)


def find_convention(name: str) -> Convention:
    """Find a convention by its name.

    Raises
    ------
    UnknownNameError
        If there is none.
    """
    if name not in _CONVENTIONS:
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
    ValueError
        If the name is taken.
    """
    if convention.name in _CONVENTIONS:
        raise ValueError(
            f"a convention {convention.name!r} cannot be added: expected a name of its own"
        )
    _CONVENTIONS[convention.name] = convention


def unregister_convention(name: str) -> None:
    """Take away a convention that was added."""
    del _CONVENTIONS[name]
