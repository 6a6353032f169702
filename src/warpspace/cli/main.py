"""The command `warpspace`: its group, its commands, errors as messages, signals."""

import atexit
import builtins
import gc
import io
import logging
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Generator
from contextlib import contextmanager, suppress
from keyword import iskeyword
from pathlib import Path
from pkgutil import resolve_name
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

import click

from warpspace.analysis.registry import TASKS, entries
from warpspace.cli.analyses import command_of
from warpspace.cli.file_arguments import Commands
from warpspace.cli.tables import echo, plain
from warpspace.exceptions import WarpspaceError, shorten
from warpspace.resources import GARBAGE_THRESHOLDS, __version__

if TYPE_CHECKING:
    from warpspace.analysis.description import Task

BAD_INPUT = 2
NO_MEMORY = "not enough memory for this; try a smaller grid"
SIGNS_OF_NO_MEMORY = ("failed to map segment", "cannot allocate memory", "can't start new thread")
"""Messages of libraries that cannot be loaded and of threads that cannot be started."""

COMPLETION_HELP = """
\b
Shell completion (bash; zsh and fish likewise):
  eval "$(_WARPSPACE_COMPLETE=bash_source warpspace)"
"""


BUNDLED: "dict[Task, str]" = {
    "see": "view draw compare export report",
    "understand": "field",
    "measure": "test import test-piece",
    "machine": "check notes merge list new-machine thesis",
}
"""Commands that are no analyses, by task, in the module of `warpspace.cli.commands`."""


TASK_OF_BUNDLED: "dict[str, Task]" = {
    name: task for task, names in BUNDLED.items() for name in names.split()
}


def _build(name: str) -> click.Command:
    if name not in TASK_OF_BUNDLED:  # plug-ins are looked for only where they may matter
        return command_of({entry.name: entry for entry in entries()}[name].load())
    task = TASK_OF_BUNDLED[name]
    function = name.replace("-", "_")
    if iskeyword(function) or hasattr(builtins, function):
        function += "_"
    return resolve_name(f"warpspace.cli.commands.{task}:{function}")


COMMANDS = Commands(lambda: (*TASK_OF_BUNDLED, *(entry.name for entry in entries())), _build)


def register_command(command: click.Command) -> None:
    """Add a command of a plug-in; it appears in ``warpspace --help`` beside the bundled ones."""
    if not command.name or command.name in COMMANDS:
        raise ValueError(f"a command {command.name!r} exists already; expected another name")
    COMMANDS[command.name] = command


class TaskGroup(click.Group):
    """The commands under headings by task; analyses are listed without being imported."""

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        analyses = {entry.name: entry for entry in entries()}
        tasks: dict[str, list[tuple[str, str]]] = {words: [] for words in TASKS.values()}
        room = formatter.width - 6 - max(map(len, self.commands))
        for name in self.list_commands(ctx):
            entry = analyses.get(name)
            command = click.Command(name, help=entry.sentence) if entry else self.commands[name]
            task = entry.task if entry else TASK_OF_BUNDLED.get(name, "machine")
            tasks[TASKS[task]].append((name, command.get_short_help_str(room)))
        for heading, rows in tasks.items():
            if rows:
                with formatter.section(heading):
                    formatter.write_dl(rows)


@click.group(
    cls=TaskGroup,
    commands=COMMANDS,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog=COMPLETION_HELP,
)
@click.version_option(__version__, prog_name="warpspace")
def cli() -> None:
    """Visualise how the geometric errors of a machine tool deform its working volume.

    SCENE is a bundled name (see `warpspace list`) or the path of a TOML file. Lengths are mm,
    errors µm, small angles µrad, rotary positions degrees.
    """


def main() -> None:
    """Run the command line; expected errors are one message on stderr and exit status 2."""
    gc.set_threshold(*GARBAGE_THRESHOLDS)
    atexit.register(gc.freeze)  # the end of the process frees what a last collection would
    # before numpy is loaded: products are short, and threads of OpenBLAS that wait for the next one
    # take the time of a core from the program, its workers and a browser that renders in software
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    _open_standard_streams()
    _silence_libraries()
    with handle_signals() as ending:
        try:
            Path.cwd()  # libraries fail obscurely in a deleted folder
            cli.main(standalone_mode=False)
            if ending.number:  # threads may still run in C libraries
                sys.stdout.flush()
                os._exit(0)
        except click.exceptions.Exit as stop:
            sys.exit(stop.exit_code)
        except click.ClickException as error:
            page = io.StringIO()
            error.show(file=page)
            _exit(shorten(page.getvalue().removesuffix("\n")))
        except (click.exceptions.Abort, KeyboardInterrupt):
            _end(ending)
        except WarpspaceError as error:
            if ending.number:  # its renderer was terminated
                _end(ending)
            _refuse(str(error))
        except OSError as error:
            if _working_folder_is_deleted():
                _refuse("the working folder no longer exists; change to another one")
            _refuse(f"{error.filename or 'output'}: {error.strerror or error}")
        except MemoryError:
            _refuse(NO_MEMORY)
        except (ImportError, RuntimeError) as error:
            if not any(sign in str(error) for sign in SIGNS_OF_NO_MEMORY):
                raise
            _refuse(NO_MEMORY)


class PlainFormatter(logging.Formatter):
    """Log lines without control characters."""

    def format(self, record: logging.LogRecord) -> str:
        return plain(super().format(record))


def _open_standard_streams() -> None:
    """Connect closed streams to the null device: files opened later would get their numbers."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            number = os.open(os.devnull, os.O_RDWR)
            os.set_inheritable(number, True)
            setattr(sys, name, os.fdopen(number, mode))
    if isinstance(sys.stdout, io.TextIOWrapper):  # its encoding may have no Greek letters
        sys.stdout.reconfigure(errors="backslashreplace")


def _silence_libraries() -> None:
    """Hide warnings of libraries; print the log and tracebacks as plain text.

    The option -W of Python and the variable PYTHONWARNINGS still show warnings.
    """
    if not sys.warnoptions:
        logging.captureWarnings(True)
    sys.excepthook = lambda *raised: echo("".join(traceback.format_exception(*raised)), err=True)
    terminal = logging.lastResort
    if terminal is not None:
        terminal.setFormatter(PlainFormatter())
        terminal.addFilter(_is_for_users)
        logging.getLogger().addHandler(terminal)  # libraries then add none


def _is_for_users(record: logging.LogRecord) -> bool:
    """Check whether a message comes from this package or its server."""
    return record.name.partition(".")[0] in {"warpspace", "asyncio", "websockets"}


def _refuse(message: str) -> NoReturn:
    _exit(f"warpspace: {message}")


def _exit(text: str) -> NoReturn:
    with suppress(OSError):  # stderr is closed
        echo(text, err=True)
    sys.exit(BAD_INPUT)


def _end(ending: "Ending") -> NoReturn:
    """Print the signal and exit at once: C libraries may crash while threads still run."""
    echo(f"warpspace: {ending.word}", err=True)
    if ending.number:
        os._exit(ending.status)
    sys.exit(ending.status)


def _working_folder_is_deleted() -> bool:
    try:
        Path.cwd()
    except OSError:
        return True
    return False


_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")
_PATIENCE_S = 1.0
"""Repetitions within this time are ignored: some programs send a signal twice."""
_LONGEST_IMPORT_S = 5.0  # how long a signal waits for the end of an import


class Ended(KeyboardInterrupt):
    """A signal that ends the program.

    A subclass, since after a plain KeyboardInterrupt has passed through `exec`, as during imports,
    Python finally ends itself with SIGINT regardless of the exit status.
    """


class Ending:
    """State of the termination by a signal."""

    def __init__(self) -> None:
        self.number = 0
        self._first = 0.0
        self._since = 0.0
        self._is_lost = False

    @property
    def status(self) -> int:
        """Exit status after a signal, as in shells."""
        return 128 + (self.number or signal.SIGINT)

    @property
    def word(self) -> str:
        return "interrupted" if self.number in (0, signal.SIGINT) else "terminated"

    def handle(self, number: int, frame: FrameType | None) -> None:
        now = time.monotonic()
        if self.number and not self._is_lost:
            if now - self._since > _PATIENCE_S:
                os._exit(self.status)
            return
        self._first = self._first or now
        self.number, self._since, self._is_lost = number, now, False
        if _is_importing(frame) and now - self._first < _LONGEST_IMPORT_S:
            self._again()
            return
        # loaded only by commands that draw
        kill_pools = getattr(sys.modules.get("warpspace.outputs.processes"), "kill_pools", None)
        if kill_pools:
            kill_pools()
        raise Ended

    def _again(self) -> None:
        self._is_lost = True
        threading.Timer(0.01, os.kill, [os.getpid(), self.number]).start()

    def handle_lost(self, about: "sys.UnraisableHookArgs") -> None:
        """Raise `Ended` again after Python dropped it in a finalizer or a callback."""
        if isinstance(about.exc_value, Ended):
            self._again()
        else:
            sys.__unraisablehook__(about)


def _is_importing(frame: FrameType | None) -> bool:
    """Check whether a package is being imported: VTK crashes if that is interrupted."""
    while frame is not None:
        if frame.f_code.co_filename == "<frozen importlib._bootstrap>":
            return True
        frame = frame.f_back
    return False


@contextmanager
def handle_signals() -> Generator[Ending]:
    ending = Ending()
    before = {}
    if threading.current_thread() is threading.main_thread():
        for name in _SIGNALS:
            number = getattr(signal, name, None)
            # nohup and shells ignore some signals of background commands
            if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, ending.handle)
    sys.unraisablehook, hook = ending.handle_lost, sys.unraisablehook
    try:
        yield ending
    finally:
        sys.unraisablehook = hook
        if not ending.number:
            for number, handler in before.items():
                signal.signal(number, handler)
