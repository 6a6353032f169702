"""The commands there are, by name: those of `warpspace.cli.commands`, and those of plug-ins."""

from collections.abc import Iterator, MutableMapping
from importlib import import_module
from pkgutil import iter_modules

import click

from warpspace.cli import commands as bundled


def _module_names() -> dict[str, str]:
    """Name each command by its module: `new_machine` holds new-machine, `import_` holds import."""
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
        """Import the command if it is not there yet."""
        if name not in self._loaded:
            module = self._modules[name]
            home = import_module(f"{bundled.__name__}.{module}")
            self._loaded[name] = getattr(home, module)
        return self._loaded[name]

    def __setitem__(self, name: str, command: click.Command) -> None:
        """Add a command."""
        self._loaded[name] = command

    def __delitem__(self, name: str) -> None:
        """Take away a command that was added."""
        del self._loaded[name]

    def __iter__(self) -> Iterator[str]:
        """Go through all names, imported or not."""
        return iter(dict.fromkeys((*self._modules, *self._loaded)))

    def __len__(self) -> int:
        """Count the commands."""
        return len({*self._modules, *self._loaded})


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
