"""Plug-ins: analyses, figures, formats, curves and conventions registered by other packages."""

import logging
import signal
import sys
from collections.abc import Mapping
from contextlib import redirect_stdout
from functools import cache
from importlib import import_module
from typing import Generic, TypeVar

from warpspace.exceptions import OptionError, UnknownNameError

T = TypeVar("T")
logger = logging.getLogger(__name__)
GROUP = "warpspace.plugins"
BUNDLED = ("warpspace.thesis_example",)
"""Modules of this package that register additions as those of other packages do."""


@cache
def load_plugins() -> None:
    """Import, once, the modules that installed packages name in the entry point group.

    A module registers what it adds when it is imported, see `docs/architecture.md`. One that
    cannot be imported, or ends the program then, is left out, and logged. What it prints goes to
    stderr: stdout may be read by a program.
    """
    from importlib.metadata import entry_points  # a sixth of the start of a short command

    for module in BUNDLED:
        import_module(module)
    for entry in entry_points(group=GROUP):
        try:
            with redirect_stdout(sys.stderr):
                entry.load()
        except BaseException as error:
            if _is_interrupt(error):
                raise
            logger.exception("the plug-in %s cannot be loaded and is ignored", entry.name)


def _is_interrupt(error: BaseException) -> bool:
    """Distinguish a signal, for which commands have a class, from an exception of a plug-in."""
    if type(error) is KeyboardInterrupt:
        return signal.getsignal(signal.SIGINT) is signal.default_int_handler
    return isinstance(error, KeyboardInterrupt)


class Registry(dict[str, T], Generic[T]):
    """Members of one kind by name: the bundled ones, and those that plug-ins register."""

    def __init__(self, kind: str, bundled: Mapping[str, T], key: str = "name") -> None:
        super().__init__(bundled)
        self._what, self._key = kind, key

    def register(self, member: T) -> None:
        """Add a member; it appears wherever the kind is listed."""
        name = getattr(member, self._key)
        if name in self:
            raise OptionError(f"{self._what} {name!r} is already registered; expected another name")
        self[name] = member

    def unregister(self, name: str) -> None:
        del self[name]

    def members(self) -> tuple[T, ...]:
        load_plugins()
        return tuple(self.values())

    def find(self, name: str) -> T:
        if name not in self:  # plug-ins are looked for only where they may matter
            load_plugins()
        if name not in self:
            raise UnknownNameError(self._what, name, self)
        return self[name]
