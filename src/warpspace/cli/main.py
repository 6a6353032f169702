"""The command `warpspace`: its group, and the one place where errors become messages."""

import io
import os
import sys
from pathlib import Path
from typing import NoReturn

import click

from warpspace import __version__
from warpspace.cli.registry import COMMANDS
from warpspace.cli.signals import handle_signals
from warpspace.cli.terminal import echo, plain
from warpspace.exceptions import WarpspaceError

BAD_INPUT = 2

COMPLETION_HELP = """
\b
Shell completion (bash; zsh and fish likewise):
  eval "$(_WARPSPACE_COMPLETE=bash_source warpspace)"
"""


@click.group(
    commands=COMMANDS,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog=COMPLETION_HELP,
)
@click.version_option(__version__, prog_name="warpspace")
def cli() -> None:
    """See and steer how a machine tool's geometric errors bend the space it works in.

    SCENE is a bundled name (see `warpspace scenes`) or the path of a TOML file. Lengths are mm,
    errors µm, small angles µrad, rotary positions degrees.
    """


def main() -> None:
    """Run the command line; every foreseen error is one message on stderr and exit status 2."""
    with handle_signals() as ending:
        try:
            Path.cwd()  # a folder that is gone breaks libraries in ways nobody could read
            cli.main(standalone_mode=False)
        except click.exceptions.Exit as stop:
            sys.exit(stop.exit_code)
        except click.exceptions.NoArgsIsHelpError as error:
            echo(error.format_message(), err=True)
            sys.exit(BAD_INPUT)
        except click.ClickException as error:
            click.echo(_shown(error), err=True, nl=False)
            sys.exit(BAD_INPUT)
        except (click.exceptions.Abort, KeyboardInterrupt):
            _refuse(ending.word, ending.status)
        except WarpspaceError as error:
            if ending.number:  # because its renderer was ended
                _refuse(ending.word, ending.status)
            _refuse(str(error))
        except BrokenPipeError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            sys.exit(0)
        except OSError as error:
            if _is_nowhere():
                _refuse("the working folder does not exist any more; change to another one")
            _refuse(f"{error.filename or 'output'}: {error.strerror or error}")
        except MemoryError:
            _refuse("not enough memory for this; try a smaller grid")


def _refuse(message: str, status: int = BAD_INPUT) -> NoReturn:
    """End with a message."""
    echo(f"warpspace: {message}", err=True)
    sys.exit(status)


def _shown(error: click.ClickException) -> str:
    """Give what click says of an error, with the usage where it belongs to a command."""
    page = io.StringIO()
    error.show(file=page)
    return plain(page.getvalue())


def _is_nowhere() -> bool:
    """Tell whether the working folder was deleted."""
    try:
        Path.cwd()
    except OSError:
        return True
    return False
