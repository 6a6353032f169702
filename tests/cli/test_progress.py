"""Progress appears after a while, on a terminal only, and leaves nothing behind."""

import io
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from cli.test_tables import in_terminal
from warpspace.cli import progress as module
from warpspace.cli.progress import progress


class Terminal(io.StringIO):
    """Text that says it is a terminal."""

    def isatty(self) -> bool:
        return True


@contextmanager
def terminal(delay_s: float = 0.05) -> Iterator[Terminal]:
    """Stand in for stderr: pytest puts its own there between a fixture and its test."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.stderr", found := Terminal())
        patch.setenv("TERM", "xterm")
        patch.setattr(module, "DELAY_S", delay_s)
        yield found


def wait_for(terminal: Terminal, text: str) -> bool:
    """Wait until a text is shown."""
    end = time.monotonic() + 20.0
    while text not in terminal.getvalue() and time.monotonic() < end:
        time.sleep(0.05)
    return text in terminal.getvalue()


def test_a_bar_counts_what_is_done() -> None:
    with terminal() as shown, progress("sampling", 2000, "machines") as bar:
        bar.advance(500)
        assert wait_for(shown, "500 of 2,000 machines")
        assert "sampling" in shown.getvalue()
        bar.advance(500)
        assert wait_for(shown, "1,000 of 2,000 machines")


def test_work_without_steps_shows_that_it_goes_on() -> None:
    with terminal() as shown, progress("drawing [/b]"):
        assert wait_for(shown, "drawing [/b]")


def test_short_work_shows_nothing() -> None:
    with terminal(delay_s=60.0) as shown, progress("sampling", 3) as bar:
        bar.advance(3)
    assert shown.getvalue() == ""


def test_silent_work_shows_nothing() -> None:
    with terminal() as shown, progress("sampling", silent=True):
        time.sleep(0.3)
    assert shown.getvalue() == ""


def test_nothing_is_shown_where_stderr_is_no_terminal(capsys, monkeypatch) -> None:
    monkeypatch.setattr(module, "DELAY_S", 0.01)
    with progress("sampling"):
        time.sleep(0.3)
    assert capsys.readouterr() == ("", "")


def test_an_error_ends_the_bar_and_gives_the_cursor_back() -> None:
    def fail() -> None:
        with progress("drawing"):
            wait_for(shown, "drawing")
            raise ValueError("broken")

    with terminal() as shown:
        with pytest.raises(ValueError, match="broken"):
            fail()
        ended = shown.getvalue()
        assert "\x1b[?25h" in ended
        time.sleep(0.3)
        assert shown.getvalue() == ended


LONG = ("contributions", "dvf5000_proposed", "--sobol", "4096")


@pytest.mark.slow
def test_a_command_shows_progress_in_a_terminal_but_not_with_json() -> None:
    status, out = in_terminal(80, *LONG)
    assert status == 0
    assert "sampling" in out
    status, out = in_terminal(80, *LONG, "--json")
    assert status == 0
    assert not re.search(r"\x1b|sampling", out)
