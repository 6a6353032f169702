"""The commands there are, by name: those of `warpspace.cli.commands`, and those of plug-ins."""

from collections.abc import Iterator, MutableMapping
from importlib import import_module
from pkgutil import iter_modules
from typing import TYPE_CHECKING

import click

from warpspace.analysis.catalogue import entries
from warpspace.cli import commands as bundled
from warpspace.cli.guard import guarded
from warpspace.cli.options import FORMER, RenamedCommand

if TYPE_CHECKING:
    from warpspace.analysis.description import Task

_BUNDLED: "dict[Task, str]" = {
    "see": "view draw compare export report",
    "understand": "field",
    "measure": "test import",
}


def task_of(name: str) -> "Task":
    """Give the task that a command belongs to; those of plug-ins stand with scenes and machines."""
    for entry in entries():
        if entry.name == name:
            return entry.task
    for task, names in _BUNDLED.items():
        if name in names.split():
            return task
    return "machine"


def _module_names() -> dict[str, str]:
    names = (module.name for module in iter_modules(bundled.__path__))
    return {name.rstrip("_").replace("_", "-"): name for name in names}


class CommandTable(MutableMapping[str, click.Command]):
    """Commands by name; a bundled one is imported when it is first asked for.

    One command therefore does not pay for the imports of all others.
    """

    def __init__(self) -> None:
        self._modules = _module_names()
        self._loaded: dict[str, click.Command] = {}

    def __getitem__(self, name: str) -> click.Command:
        """Import the command, or make it from its analysis, if it is not there yet."""
        if name not in self._loaded and name in (described := {e.name: e for e in entries()}):
            from warpspace.cli.analyses import build_command

            self._loaded[name] = guarded(build_command(described[name]))
        elif name not in self._loaded and name in FORMER:
            now, prefix = FORMER[name]
            self._loaded[name] = RenamedCommand(name, self[now], prefix)
        elif name not in self._loaded:
            module = self._modules[name]
            home = import_module(f"{bundled.__name__}.{module}")
            self._loaded[name] = guarded(getattr(home, module))
        return self._loaded[name]

    def __setitem__(self, name: str, command: click.Command) -> None:
        """Add a command."""
        self._loaded[name] = guarded(command)

    def __delitem__(self, name: str) -> None:
        """Take away a command that was added."""
        del self._loaded[name]

    def __iter__(self) -> Iterator[str]:
        """Go through all names, imported or not; former ones are understood only."""
        names = (*self._modules, *(entry.name for entry in entries()), *self._loaded)
        return iter(dict.fromkeys(name for name in names if name not in FORMER))

    def __len__(self) -> int:
        """Count the commands."""
        return sum(1 for _ in self)


COMMANDS = CommandTable()
"""The commands of `warpspace`."""


def register_command(command: click.Command) -> None:
    """Add a command of a plug-in; it appears in ``warpspace --help`` beside the bundled ones.

    Parameters
    ----------
    command : click.Command
        With a name that no other command has.

    Raises
    ------
    ValueError
        If it has no name, or one that is taken.
    """
    if not command.name or command.name in COMMANDS:
        raise ValueError(f"a command {command.name!r} cannot be added: expected a name of its own")
    COMMANDS[command.name] = command
