"""Which errors the panel lists: those that a search finds, or all, or those that are not zero."""

import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import lru_cache

from warpspace.app.state.app_state import AppState
from warpspace.machine.axes import Parameter, parameter

# --- Finding error parameters by what people call them --------------------------------------------
# Key, symbol, plain name, axis, kind.

MAX_QUERY = 80
_GREEK = {"δ": "delta", "ε": "epsilon", "α": "alpha", "β": "beta", "γ": "gamma"}
_FILLER = frozenset({"of", "the", "to", "in", "about", "axis", "error", "errors"})
_NEAR = 0.75


def find_parameters(query: str, keys: Sequence[str]) -> tuple[str, ...]:
    """Find the parameters that a user asks for."""
    tokens = _tokens(query)
    if not tokens:
        return tuple(keys)
    rows = [parameter(key) for key in keys]
    exact = tuple(row.key for row in rows if all(_fits(token, row) for token in tokens))
    if exact:
        return exact
    known = {word for row in rows for word in _words(row) if len(word) > 2}
    corrected = [_corrected(token, known) for token in tokens]
    return tuple(row.key for row in rows if all(_fits(token, row) for token in corrected))


def _tokens(query: str) -> list[str]:
    """Cut a query into words that mean something; what is only filler stays."""
    words = fold(query[:MAX_QUERY]).split()
    return [word for word in words if word not in _FILLER] or words


def fold(text: str) -> str:
    """Fold case, accents and spelling of Greek letters away; punctuation becomes blanks."""
    plain = unicodedata.normalize("NFKD", text).casefold()
    for letter, name in _GREEK.items():
        plain = plain.replace(letter, f" {name} ")
    return "".join(c if c.isalnum() else " " for c in plain if not unicodedata.combining(c))


@lru_cache(maxsize=256)
def _words(row: Parameter) -> tuple[str, ...]:
    symbol = fold(row.symbol)
    return tuple(
        dict.fromkeys(
            (
                row.key.casefold(),
                *symbol.split(),
                symbol.replace(" ", ""),
                *fold(row.name).split(),
                *fold(row.kind.value).split(),
                row.axis.casefold(),
                row.unit.casefold(),
                fold(row.unit).strip(),
            )
        )
    )


def _fits(token: str, row: Parameter) -> bool:
    """Tell whether a word fits a parameter: a single letter its axis, a longer one any beginning.

    A key fits from its second letter as well, so that "c0y" finds EC0Y.
    """
    words = _words(row)
    if len(token) == 1:
        return token == row.axis.casefold() or token in fold(row.name).split()
    return any(word.startswith(token) for word in words) or token in row.key.casefold()


def _corrected(token: str, known: Iterable[str]) -> str:
    close = get_close_matches(token, list(known), n=1, cutoff=_NEAR)
    return close[0] if close else token


@dataclass(frozen=True, slots=True)
class Listing:
    """What a user has chosen to see of the errors."""

    query: str = ""  # what is searched for, among all errors; empty for no search
    # without a search, only errors that are not zero now or were not when the scene was opened
    not_zero: bool = False
    by_effect: bool = False  # sorted by effect instead of by axis

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
    """List the errors to be shown."""
    everything = tuple(state.amplitudes)
    if listing.query.strip():
        keys = find_parameters(listing.query, everything)
    else:
        keys = used_keys(state) if listing.not_zero else everything
    if effects is None:
        return keys
    return tuple(sorted(keys, key=lambda key: -effects.get(key, 0.0)))
