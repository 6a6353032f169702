"""The command line: the commands, and the options, tables and progress bars they share."""

from warpspace.cli.main import main, register_command

__all__ = ["main", "register_command"]
