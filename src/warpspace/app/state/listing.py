"""Which errors the panel lists: those that a search finds, or all, or those that are not zero."""

from collections.abc import Mapping
from dataclasses import dataclass

from warpspace.app.state.app_state import AppState
from warpspace.app.state.search import find_parameters


@dataclass(frozen=True, slots=True)
class Listing:
    """What a user has chosen to see of the errors.

    Attributes
    ----------
    query : str
        What is searched for, among all errors; empty for no search.
    not_zero : bool
        Without a search, only errors that are not zero now or were not when the scene was opened.
    by_effect : bool
        Sorted by effect instead of by axis.
    """

    query: str = ""
    not_zero: bool = False
    by_effect: bool = False

    @property
    def why_empty(self) -> str:
        """Why no error is listed, should there be none."""
        if self.query.strip():
            return "No error goes by this name."
        return "All errors are zero; uncheck *Hide errors that are zero* to see them."


def used_keys(state: AppState) -> tuple[str, ...]:
    """Give the errors that are not zero now, or were not when the scene was opened."""
    return tuple(key for key, value in state.amplitudes.items() if value or state.start[key])


def is_mostly_zero(state: AppState) -> bool:
    """Tell whether most errors of a scene are zero, but not all."""
    return 0 < 2 * len(used_keys(state)) < len(state.amplitudes)


def listed_keys(
    state: AppState, listing: Listing, effects: Mapping[str, float] | None = None
) -> tuple[str, ...]:
    """List the errors to be shown.

    Parameters
    ----------
    state : AppState
    listing : Listing
    effects : mapping of str to float, optional
        Effect of every error: the largest comes first. Without it the order is that of the
        parameter table.

    Returns
    -------
    tuple of str
    """
    everything = tuple(state.amplitudes)
    if listing.query.strip():
        keys = find_parameters(listing.query, everything)
    else:
        keys = used_keys(state) if listing.not_zero else everything
    if effects is None:
        return keys
    return tuple(sorted(keys, key=lambda key: -effects.get(key, 0.0)))
