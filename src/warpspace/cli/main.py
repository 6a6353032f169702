"""The command `warpspace`: its group, and the one place where errors become messages."""

import os
import sys

import click

from warpspace import __version__
from warpspace.cli.registry import COMMANDS
from warpspace.exceptions import WarpspaceError

BAD_INPUT = 2
INTERRUPTED = 130

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
    try:
        cli.main(standalone_mode=False)
    except click.exceptions.Exit as stop:
        sys.exit(stop.exit_code)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message(), err=True)
        sys.exit(BAD_INPUT)
    except click.ClickException as error:
        error.show()
        sys.exit(BAD_INPUT)
    except WarpspaceError as error:
        click.echo(f"warpspace: {error}", err=True)
        sys.exit(BAD_INPUT)
    except (click.exceptions.Abort, KeyboardInterrupt):
        click.echo("warpspace: interrupted", err=True)
        sys.exit(INTERRUPTED)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except OSError as error:
        click.echo(f"warpspace: {error.filename or 'output'}: {error.strerror or error}", err=True)
        sys.exit(BAD_INPUT)
    except MemoryError:
        click.echo("warpspace: not enough memory for this; try a smaller grid", err=True)
        sys.exit(BAD_INPUT)
