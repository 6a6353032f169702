"""The commands, one module each: module and function carry the name of the command.

`warpspace.cli.registry` finds them here; a new command is one new file. A command imports what it
needs when it runs, so that help is instant.
"""
