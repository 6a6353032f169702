"""Exceptions of warpspace.

All derive from `WarpspaceError`, whose text is fit to be shown to a user as it is: it names what
was given, what was expected and, where there is one, the near miss.
"""

import re
from collections.abc import Callable, Iterable, Sequence

SHOWN_PROBLEMS = 40  # problems of a file that a message lists; it counts the others
_DIGITS = re.compile(r"(\d{10})[\d.,_]{20,}(\d{10})")
_LONG = re.compile(r"(?<!\S)(\S{80})\S{40,}(\S{80})|^(.{2000}).+(.{80})$", re.MULTILINE)


def shorten(text: str) -> str:
    """Shorten very long numbers, words and lines of a message to their ends."""
    return _LONG.sub(r"\1\3…\2\4", _DIGITS.sub(r"\1…\2", text))


class WarpspaceError(Exception):
    """Base of all exceptions; the message is meant for the user.

    The text names an option of an analysis as ``{its_name}``; `with_names` puts in what it is
    called where it is read: a flag on the command line, a label on a page.
    """

    def with_names(self, name_of: Callable[[str], str]) -> str:
        """Return the message with each option named as the reader knows it."""
        text = re.sub(r"\{([a-z_]+)\}", lambda found: name_of(found[1]), super().__str__())
        return shorten(text)

    def __str__(self) -> str:
        return self.with_names(lambda name: name)


class ChainError(WarpspaceError):
    """An invalid kinematic chain string."""


class OptionError(WarpspaceError):
    """An invalid value of an option, argument or widget."""


class RenderError(WarpspaceError):
    """A picture that cannot be rendered on this system."""


class NoRendererError(RenderError):
    """A system without a renderer; the message lists what to install."""


class OutputError(WarpspaceError):
    """A file that could not be written."""


class WorkersLostError(WarpspaceError):
    """Worker processes or machines that were lost during a computation."""


class UnknownNameError(WarpspaceError):
    """An unknown name."""

    def __init__(self, what: str, name: str, expected: Iterable[str]) -> None:
        self.name = name
        self.known = tuple(expected)
        super().__init__(f"unknown {what} {name!r}{near_miss(name, self.known)}")


class SceneError(WarpspaceError):
    """A scene or machine file with one or more problems.

    Parameters
    ----------
    source : str
        File name (or bundled name) the problems were found in.
    problems : sequence of str
        One line each: key, value and what was expected.
    """

    def __init__(self, source: str, problems: Sequence[str]) -> None:
        self.source = source
        self.problems = tuple(problems)
        if len(self.problems) == 1:
            text = f"{source}: {self.problems[0]}"
        else:
            lines = [f"\n  - {problem}" for problem in self.problems[:SHOWN_PROBLEMS]]
            if len(self.problems) > SHOWN_PROBLEMS:
                lines.append(f"\n  … and {len(self.problems) - SHOWN_PROBLEMS} more")
            text = f"{source}: {len(self.problems)} problems{''.join(lines)}"
        super().__init__(text)


def near_miss(name: str, expected: Iterable[str]) -> str:
    from difflib import get_close_matches  # only messages need it

    names = list(expected)
    folded = {candidate.casefold(): candidate for candidate in names}
    close = get_close_matches(name.casefold(), folded, n=2, cutoff=0.6)
    if close:
        return ": did you mean " + " or ".join(repr(folded[match]) for match in close) + "?"
    if 0 < len(names) <= 24:
        return "; expected one of " + ", ".join(names)
    return ""
