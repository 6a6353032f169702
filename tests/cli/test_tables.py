"""Tables, sentences and progress fit the terminal and are plain text outside of one."""

import io
import os
import re
import subprocess
import sys
import time
from collections import Counter
from contextlib import contextmanager

import pytest
from rich.cells import cell_len

from warpspace.analysis.blocks import Column, number_columns
from warpspace.cli import tables as module
from warpspace.cli.tables import print_table, print_text, progress
from warpspace.thesis_example import rows as thesis_rows

AT = ("--at", "X=0,Y=-225,Z=-480", "--at", "X=10.5,B=-30.123456")
COMMANDS = {
    "scenes": ("list", "scenes"),
    "check": ("check", "dvf5000_first"),
    "field": ("field", "dvf5000_first", *AT),
    "field over the grid": ("field", "dvf5000_first", "--grid", "5"),
    "gains": ("gains", "dvf5000_first"),
    "gains over the travel": ("gains", "dvf5000_general", "--max", "--loop", "workpiece"),
    "compare": ("compare", "dvf5000_first", "dvf5000_second", "--grid", "5"),
    "against": ("check", "dvf5000_first", "--against", "dvf5000_proposed", "--grid", "5"),
    "contributions": ("contributions", "dvf5000_general"),
    "sobol": ("contributions", "dvf5000_proposed", "--loop", "tool", "--sobol", "32"),
    "montecarlo": ("montecarlo", "dvf5000_proposed", "--samples", "500", "--limit", "40"),
    "allocate": ("allocate", "dvf5000_first", "--limit", "40", "--samples", "500"),
    "circular": ("test", "circular", "dvf5000_first", "--radius", "50"),
    "test": ("test", "positioning", "dvf5000_first"),
    "list of tests": ("test", "--list"),
    "thesis": ("thesis",),
}


def numbers(text):
    """Count the numbers of a text; the point counts, so that a number that is cut differs."""
    return Counter(re.findall(r"(?<![\w.])[-+]?\d[\d.]*", text))


def once(function):
    """Compute something at the first call only: the same numbers are printed in several widths."""
    found: list[object] = []

    def call(*arguments):
        if not found:
            found.append(function(*arguments))
        return found[0]

    return call


@pytest.mark.parametrize("name", COMMANDS)
def test_output_fits_and_has_every_number(warpspace, monkeypatch, name):
    monkeypatch.setattr(thesis_rows, "thesis", once(thesis_rows.thesis))
    monkeypatch.setenv("COLUMNS", "1000")
    whole = warpspace(*COMMANDS[name]).out
    for width in (60, 80):
        monkeypatch.setenv("COLUMNS", str(width))
        result = warpspace(*COMMANDS[name])
        assert (result.status, result.err) == (0, "")
        lines = result.out.splitlines()
        assert max(map(len, lines)) <= width
        assert lines == [line.rstrip() for line in lines]
        missing = numbers(whole) - numbers(result.out)
        assert not missing, (width, missing)
        assert all(c == "\n" or c.isprintable() for c in result.out)
        assert not re.search(r"[─━│┃]", result.out)


@pytest.mark.parametrize("name", COMMANDS)
def test_help_fits(warpspace, monkeypatch, name):
    monkeypatch.setenv("COLUMNS", "80")
    out = warpspace(COMMANDS[name][0], "-h").out
    assert max(map(len, out.splitlines())) <= 80


def test_help_cuts_no_sentence(warpspace, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    out = warpspace("--help").out.partition("See:")[2]
    assert "..." not in out.replace("FILES...", "")


def printed(capsys, *arguments, **options):
    print_table(*arguments, **options)
    return capsys.readouterr().out.splitlines()


def test_numbers_are_aligned_at_the_right_below_heading_and_unit(capsys):
    columns = (Column("key"), *number_columns(("mean", "max"), "s", "µm"))
    assert printed(capsys, columns, [("A", "1.50", "12.25"), ("BB", "-10.00", "3.00")]) == [
        "         mean    max",
        "  key    [µm]   [µm]",
        "  A      1.50  12.25",
        "  BB   -10.00   3.00",
    ]


def test_a_table_that_fits_is_drawn_as_by_rich():
    columns = (Column("key"), *number_columns(("mean", "max"), ".2f", "µm"), Column("", wraps=True))
    rows = [("A  b", "−1.50 ", "12.25", "two words"), ("√Δ", "", "3", "  x\ny")] * 41
    drawn = module._draw(columns, rows, 2, 40)
    assert drawn.count("key") == 3
    heads = [["\nkey", "mean\n[µm]", "max\n[µm]", "\n"]]
    repeated = [*heads, *rows[:40], [""] * 4, *heads, *rows[40:80], [""] * 4, *heads, *rows[80:]]
    assert drawn == module._draw_wrapped(columns, repeated, 2, 40, has_header=True)


def test_a_narrow_character_takes_one_cell():
    characters = [chr(code) for code in range(0x110000) if module._NARROW.fullmatch(chr(code))]
    assert {*"A~µ°±−²Δ…√≤"} < {*characters}
    assert {cell_len(character) for character in characters if character != "\n"} == {1}


def test_a_heading_is_bold_in_a_terminal(monkeypatch):
    monkeypatch.setattr("sys.stdout", Terminal())
    for term, is_bold in (("xterm", True), ("dumb", False)):
        monkeypatch.setenv("TERM", term)
        head, row = module._draw((Column("key"),), [("A",)], 2, 40).splitlines()
        assert (head, row) == ("\x1b[1mkey\x1b[0m" if is_bold else "key", "A")


def test_a_wide_table_goes_on_below_with_its_first_columns(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "16")
    columns = (
        Column("key", leads=True),
        *number_columns(("a", "b"), "s"),
        Column("c"),
        Column("d"),
    )
    rows = [("K1", "1000", "2000", "3000", "4000"), ("K2", "1", "2", "", "")]
    assert printed(capsys, columns, rows, indent=0) == [
        *("key     a     b", "K1   1000  2000", "K2      1     2", ""),
        *("key  c     d", "K1   3000  4000"),
    ]


def test_columns_that_join_are_not_parted(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "16")
    columns = (Column("key", leads=True), Column("long"), *number_columns(("x", "y", "z"), "s"))
    lines = printed(capsys, columns, [("K", "abcdef", "1.5", "2.5", "3.5")], indent=0)
    assert lines[-2:] == ["key   x   y   z", "K   1.5 2.5 3.5"]


def test_long_tables_repeat_their_headings(capsys):
    columns = (Column("key"), Column("value", unit="µm"))
    lines = printed(capsys, columns, [(str(n), "1") for n in range(85)])
    assert sum(line.split() == ["key", "[µm]"] for line in lines) == 3


def test_a_terminal_that_is_too_narrow_cuts_nothing(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "5")
    columns = (Column("name", wraps=True, leads=True), Column("value", "s"))
    out = "\n".join(printed(capsys, columns, [("straightness of X", "-123456.789")]))
    assert "straightness" in out
    assert "-123456.789" in out


@pytest.mark.parametrize("text", ["[bold]a[/bold]", "[/]", "a :smile: b", "[µm]", "a [link=x] b"])
def test_brackets_of_users_are_no_markup(capsys, text):
    assert printed(capsys, (Column(), Column(wraps=True)), [("A", text)]) == [f"  A  {text}"]
    print_text(text)
    assert capsys.readouterr().out == f"{text}\n"


def test_sentences_wrap_below_their_beginning(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "24")
    print_text("  mean 31.27, RMS 32.15, max 51.72 µm")
    out = capsys.readouterr().out
    assert out.splitlines() == ["  mean 31.27, RMS 32.15,", "    max 51.72 µm"]


def test_a_number_stays_with_its_unit_and_an_axis_with_its_position(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "21")
    print_text("largest error 51.72 µm at X 100, Y -20")
    assert capsys.readouterr().out.splitlines() == [
        *("largest error", "  51.72 µm at X 100,", "  Y -20")
    ]


def in_terminal(width, *arguments, **environment):
    fcntl, pty, struct, termios = map(pytest.importorskip, ("fcntl", "pty", "struct", "termios"))
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, width, 0, 0))
    unset = {"COLUMNS", "LINES", "NO_COLOR", "FORCE_COLOR", "TERM"}
    kept = {key: value for key, value in os.environ.items() if key not in unset}
    command = [sys.executable, "-m", "warpspace", *arguments]
    streams = dict.fromkeys(("stdin", "stdout", "stderr"), theirs)
    shown = {**kept, "TERM": "xterm-256color", **environment}
    process = subprocess.Popen(command, env=shown, **streams)
    os.close(theirs)
    found = b""
    try:
        while chunk := os.read(ours, 65536):
            found += chunk
    except OSError:
        pass  # Linux reports the end of a pseudo-terminal as an error
    finally:
        os.close(ours)
        status = process.wait(timeout=60)
    return status, found.decode("utf-8")


SHADES = r"\x1b\[[\d;]*m"


@pytest.mark.parametrize(
    ("width", "columns", "most"), [*((n, {}, n) for n in (60, 120)), (120, {"COLUMNS": "70"}, 70)]
)
def test_a_table_fits_a_real_terminal_or_the_columns_that_are_wanted(width, columns, most):
    status, out = in_terminal(width, "gains", "dvf5000_first", **columns)
    assert status == 0
    plain = re.sub(SHADES, "", out)
    assert max(len(line) for line in plain.replace("\r", "").split("\n")) <= most
    assert "\x1b" not in plain


def test_no_color_means_no_colour():
    status, out = in_terminal(80, "gains", "dvf5000_first", NO_COLOR="1")
    assert status == 0
    assert not re.search(r"\x1b\[[\d;]*(3|4|9|10)\d", out)


class Terminal(io.StringIO):
    def isatty(self):
        return True


@contextmanager
def terminal(delay_s=0.05):
    """Stand in for stderr: pytest puts its own there between a fixture and its test."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.stderr", found := Terminal())
        patch.setenv("TERM", "xterm")
        patch.setattr(module, "DELAY_S", delay_s)
        yield found


def wait_for(terminal, text):
    end = time.monotonic() + 20.0
    while text not in terminal.getvalue() and time.monotonic() < end:
        time.sleep(0.05)
    return text in terminal.getvalue()


def test_a_bar_counts_what_is_done():
    with terminal() as shown, progress("sampling", 2000, "machines") as bar:
        bar.advance(500)
        assert wait_for(shown, "500 of 2,000 machines")
        assert "sampling" in shown.getvalue()
        bar.advance(500)
        assert wait_for(shown, "1,000 of 2,000 machines")


def test_work_without_steps_shows_that_it_goes_on():
    with terminal() as shown, progress("drawing [/b]"):
        assert wait_for(shown, "drawing [/b]")


@pytest.mark.parametrize(("delay_s", "silent"), [(60.0, False), (0.05, True)])
def test_short_and_silent_work_show_nothing(delay_s, silent):
    with terminal(delay_s) as shown, progress("sampling", silent=silent):
        time.sleep(0.3)
    assert shown.getvalue() == ""


def test_nothing_is_shown_where_stderr_is_no_terminal(capsys, monkeypatch):
    monkeypatch.setattr(module, "DELAY_S", 0.01)
    with progress("sampling"):
        time.sleep(0.3)
    assert capsys.readouterr() == ("", "")


def test_an_error_ends_the_bar_and_gives_the_cursor_back():
    def fail():
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


@pytest.mark.nightly
def test_a_command_shows_progress_in_a_terminal_but_not_with_json():
    status, out = in_terminal(80, *LONG)
    assert status == 0
    assert "sampling" in out
    status, out = in_terminal(80, *LONG, "--json")
    assert status == 0
    assert not re.search(r"\x1b|sampling", out)
