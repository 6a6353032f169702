"""Finding error parameters by what people call them: key, symbol, plain name, axis, kind."""

import unicodedata
from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from functools import lru_cache

from warpspace.machine.parameters import Parameter, parameter

MAX_QUERY = 80
_GREEK = {"δ": "delta", "ε": "epsilon", "α": "alpha", "β": "beta", "γ": "gamma"}
_FILLER = frozenset({"of", "the", "to", "in", "about", "axis", "error", "errors"})
_NEAR = 0.75


def find_parameters(query: str, keys: Sequence[str]) -> tuple[str, ...]:
    """Find the parameters that a user asks for.

    Parameters
    ----------
    query : str
        Words in any order and case, for instance "roll x", "EAX", "γ", "squareness y", "ε_xX".
    keys : sequence of str
        Keys to choose from.

    Returns
    -------
    tuple of str
        Those that every word fits, in the order given; all for an empty query. Where none fits,
        those that fit near misses of the words ("squarness").
    """
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
    """Fold case, accents and spelling of Greek letters away; punctuation becomes blanks.

    Returns
    -------
    str
        Lower-case words.
    """
    plain = unicodedata.normalize("NFKD", text).casefold()
    for letter, name in _GREEK.items():
        plain = plain.replace(letter, f" {name} ")
    return "".join(c if c.isalnum() else " " for c in plain if not unicodedata.combining(c))


@lru_cache(maxsize=256)
def _words(row: Parameter) -> tuple[str, ...]:
    """List the words a parameter goes by."""
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
    """Replace a word by the known one nearest to it."""
    close = get_close_matches(token, list(known), n=1, cutoff=_NEAR)
    return close[0] if close else token
