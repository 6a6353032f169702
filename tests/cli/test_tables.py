"""Tables and sentences fit the terminal, lose no number, and are plain text outside of one."""

import json
import os
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable

import pytest

from warpspace.analysis import thesis as analysis_thesis
from warpspace.cli.tables import Column, number_columns, print_table, print_text
from warpspace.scene import verbs

AT = ("--at", "X=0,Y=-225,Z=-480", "--at", "X=10.5,B=-30.123456")
COMMANDS = {
    "scenes": ("scenes",),
    "check": ("check", "dvf5000_first"),
    "field": ("field", "dvf5000_first", *AT),
    "field over the grid": ("field", "dvf5000_first", "--grid", "5"),
    "gains": ("gains", "dvf5000_first"),
    "gains over the travel": ("gains", "dvf5000_general", "--max", "--loop", "workpiece"),
    "compare": ("compare", "dvf5000_first", "dvf5000_second", "--grid", "5"),
    "measured": ("measured", "dvf5000_first", "--tolerances", "dvf5000_proposed", "--grid", "5"),
    "contributions": ("contributions", "dvf5000_general"),
    "sobol": ("contributions", "dvf5000_proposed", "--sobol", "32"),
    "montecarlo": ("montecarlo", "dvf5000_proposed", "--samples", "500", "--spec-um", "40"),
    "allocate": ("allocate", "dvf5000_first", "--limit-um", "40", "--samples", "2000"),
    "ballbar": ("ballbar", "dvf5000_first", "--plane", "XY", "--radius", "50"),
    "test": ("test", "positioning", "dvf5000_first"),
    "list of tests": ("test", "--list"),
    "thesis": ("thesis",),
}
WITH_JSON = ("scenes", "check", "field", "compare", "measured", "montecarlo", "ballbar")


def numbers(text: str) -> Counter[str]:
    """Count the numbers of a text; the point counts, so that a number that is cut differs."""
    return Counter(re.findall(r"(?<![\w.])[-+]?\d[\d.]*", text))


def once(function: Callable[..., object]) -> Callable[..., object]:
    """Compute something at the first call only: the same numbers are printed in several widths."""
    found: list[object] = []

    def call(*arguments: object) -> object:
        if not found:
            found.append(function(*arguments))
        return found[0]

    return call


@pytest.mark.parametrize("name", COMMANDS)
def test_output_fits_and_has_every_number(warpspace, monkeypatch, name: str) -> None:
    for function in ((verbs, "thesis"), (analysis_thesis, "thesis_hypotheses")):
        monkeypatch.setattr(*function, once(getattr(*function)))
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
def test_help_fits(warpspace, monkeypatch, name: str) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    out = warpspace(COMMANDS[name][0], "-h").out
    assert max(map(len, out.splitlines())) <= 80


def test_help_cuts_no_sentence(warpspace, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert "..." not in warpspace("--help").out.partition("Commands:")[2]


@pytest.mark.parametrize("name", WITH_JSON)
def test_json_stays_one_object_whatever_the_width(warpspace, monkeypatch, name: str) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    result = warpspace(*COMMANDS[name], "--json")
    assert (result.status, result.err) == (0, "")
    assert result.out.count("\n") == 1
    assert isinstance(json.loads(result.out), dict)


def printed(capsys: pytest.CaptureFixture[str], *arguments, **options) -> list[str]:
    """Print a table and give its lines."""
    print_table(*arguments, **options)
    return capsys.readouterr().out.splitlines()


def test_numbers_are_aligned_at_the_right_below_heading_and_unit(capsys) -> None:
    columns = (Column("key"), *number_columns(("mean", "max"), "µm"))
    assert printed(capsys, columns, [("A", "1.50", "12.25"), ("BB", "-10.00", "3.00")]) == [
        "         mean    max",
        "  key    [µm]   [µm]",
        "  A      1.50  12.25",
        "  BB   -10.00   3.00",
    ]


def test_a_wide_table_goes_on_below_with_its_first_columns(capsys, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "16")
    columns = (Column("key", leads=True), *number_columns(("a", "b")), Column("c"), Column("d"))
    rows = [("K1", "1000", "2000", "3000", "4000"), ("K2", "1", "2", "", "")]
    assert printed(capsys, columns, rows, indent=0) == [
        *("key     a     b", "K1   1000  2000", "K2      1     2", ""),
        *("key  c     d", "K1   3000  4000"),
    ]


def test_columns_that_join_are_not_parted(capsys, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "16")
    columns = (Column("key", leads=True), Column("long"), *number_columns(("x", "y", "z")))
    lines = printed(capsys, columns, [("K", "abcdef", "1.5", "2.5", "3.5")], indent=0)
    assert lines[-2:] == ["key   x   y   z", "K   1.5 2.5 3.5"]


def test_a_terminal_that_is_too_narrow_cuts_nothing(capsys, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "5")
    columns = (Column("name", wraps=True, leads=True), Column("value", is_number=True))
    out = "\n".join(printed(capsys, columns, [("straightness of X", "-123456.789")]))
    assert "straightness" in out
    assert "-123456.789" in out


@pytest.mark.parametrize("text", ["[bold]a[/bold]", "[/]", "a :smile: b", "[µm]", "a [link=x] b"])
def test_brackets_of_users_are_no_markup(capsys, text: str) -> None:
    assert printed(capsys, (Column(), Column(wraps=True)), [("A", text)]) == [f"  A  {text}"]
    print_text(text)
    assert capsys.readouterr().out == f"{text}\n"


def test_a_title_with_brackets_is_printed_as_it_stands(warpspace, tmp_path) -> None:
    scene = tmp_path / "s.toml"
    scene.write_text('title = "[red]x[/red] [/]"\nmachine = "dvf5000"\n', encoding="utf-8")
    for command in (("check",), ("field", "--grid", "3"), ("measured", "--grid", "3")):
        assert "[red]x[/red] [/]" in warpspace(*command, scene).out


def test_sentences_wrap_below_their_beginning(capsys, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "24")
    print_text("  mean 31.27, RMS 32.15, max 51.72 µm")
    out = capsys.readouterr().out
    assert out.splitlines() == ["  mean 31.27, RMS 32.15,", "    max 51.72 µm"]


def test_a_number_stays_with_its_unit_and_an_axis_with_its_position(capsys, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "21")
    print_text("largest error 51.72 µm at X 100, Y -20")
    assert capsys.readouterr().out.splitlines() == [
        *("largest error", "  51.72 µm at X 100,", "  Y -20")
    ]


def in_terminal(width: int, *arguments: str, **environment: str) -> tuple[int, str]:
    """Run the command in a pseudo-terminal of a width; its status and what the terminal gets."""
    fcntl, pty, struct, termios = map(pytest.importorskip, ("fcntl", "pty", "struct", "termios"))
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, width, 0, 0))
    unset = {"COLUMNS", "LINES", "NO_COLOR", "FORCE_COLOR", "TERM"}
    kept = {key: value for key, value in os.environ.items() if key not in unset}
    process = subprocess.Popen(
        [sys.executable, "-m", "warpspace", *arguments],
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        env={**kept, "TERM": "xterm-256color", **environment},
    )
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


@pytest.mark.parametrize("width", [60, 80, 120])
def test_a_table_fits_a_real_terminal(width: int) -> None:
    status, out = in_terminal(width, "gains", "dvf5000_first")
    assert status == 0
    plain = re.sub(SHADES, "", out)
    assert max(len(line) for line in plain.replace("\r", "").split("\n")) <= width
    assert "\x1b" not in plain


def test_no_color_means_no_colour() -> None:
    status, out = in_terminal(80, "measured", "dvf5000_first", "--grid", "3", NO_COLOR="1")
    assert status == 0
    assert not re.search(r"\x1b\[[\d;]*(3|4|9|10)\d", out)


def test_columns_overrules_the_terminal() -> None:
    _, out = in_terminal(120, "gains", "dvf5000_first", COLUMNS="70")
    assert max(len(line) for line in re.sub(SHADES, "", out).splitlines()) <= 70
