"""Titles and file names cannot steer the terminal; odd surroundings give a clear message."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from products import pairwise
from warpspace.cli.tables import escape_json, plain

EVIL = "red\x1b[31m\x9b2J\x07 \u202egpj.exe\u2066 end"
STEERING = ("\x1b", "\x9b", "\x07", "\u202e", "\u2066")
MAIN = "from warpspace.cli import main; main()"


def run(*arguments, code=MAIN, start=None, cwd=None, **variables):
    command = [sys.executable, "-c", code, *arguments]
    how = {"cwd": cwd, "env": {**os.environ, **variables}, "preexec_fn": start}
    return subprocess.run(command, capture_output=True, check=False, timeout=120, **how)


def is_refusal(result, *fragments):
    text = result.stderr.decode()
    assert result.returncode == 2, text
    assert "Traceback" not in text
    for fragment in fragments:
        assert fragment in text


def test_steering_characters_are_spelt_out():
    assert plain(EVIL) == r"red\x1b[31m\x9b2J\x07 \u202egpj.exe\u2066 end"
    assert plain("a\nb\tc") == "a\nb\tc"
    assert plain(os.fsdecode(b"\xff.toml")) == r"\xff.toml"
    assert plain("µm · ×5 δ 面") == "µm · ×5 δ 面"
    text = json.dumps(EVIL, ensure_ascii=False)
    assert json.loads(escape_json(text)) == EVIL
    assert not any(character in escape_json(text) for character in STEERING)


@pytest.mark.parametrize(
    "command",
    [
        ("check",),
        ("check", "--json"),
        ("field", "--at", "X=0"),
        ("gains",),
        ("ballbar", "--plane", "XY", "--radius", "100"),
        ("measured",),
        ("montecarlo", "--samples", "100"),
    ],
    ids=lambda command: " ".join(command[:2]),
)
def test_a_title_reaches_the_terminal_harmless(command, tmp_path, warpspace):
    path = tmp_path / "s.toml"
    title = json.dumps(EVIL)
    half_widths = "default = { translation = 10, rotation = 20, squareness = 25 }"
    text = f'title = {title}\nmachine = "dvf5000"\n[errors]\nEC0Y = 5\n[tolerances]\n{half_widths}'
    path.write_text(text, "utf-8")
    result = warpspace(command[0], path, *command[1:])
    assert result.status == 0, result.err
    assert not any(character in result.out + result.err for character in STEERING)


@pytest.mark.parametrize(
    "arguments",
    [("check", EVIL), (EVIL,), ("check", f"--{EVIL}"), ("gains", "dvf5000_first", "--loop", EVIL)],
    ids=["scene", "command", "option", "value"],
)
def test_a_refused_word_reaches_the_terminal_harmless(arguments, warpspace):
    result = warpspace(*arguments)
    assert result.status == 2
    assert not any(character in result.out + result.err for character in STEERING)


def test_a_file_name_that_is_no_text(tmp_path):
    folder = os.fsencode(tmp_path)
    (tmp_path / os.fsdecode(b"\xff.toml")).write_text('title = "t"\nmachine = "dvf5000"\n', "utf-8")
    target = folder + b"/\xfe.csv"
    done = run("export", folder + b"/\xff.toml", "--grid", "3", "-o", target)
    assert done.returncode == 0, done.stderr
    assert rb"\xfe.csv" in done.stdout
    assert Path(os.fsdecode(target)).stat().st_size > 100
    is_refusal(run("check", folder + b"/\xfd.toml"), r"\xfd.toml")


def test_a_working_folder_that_is_gone(tmp_path):
    folder = tmp_path / "gone"
    folder.mkdir()
    code = f"import os; os.rmdir({str(folder)!r}); {MAIN}"
    done = run("check", "dvf5000_first", code=code, cwd=folder)
    is_refusal(done, "the working folder does not exist any more")


def limit_addresses():
    """Limit the address space as `ulimit -v 400000` does."""
    import resource

    resource.setrlimit(resource.RLIMIT_AS, (400_000 * 1024, 400_000 * 1024))


@pytest.mark.skipif(sys.platform != "linux", reason="others do not keep the limit")
@pytest.mark.parametrize(
    ("arguments", "threads"),
    pairwise(
        [
            ("field", "dvf5000_first", "--grid", "41", "--csv", "x.csv"),
            ("gains", "dvf5000_first", "--plot", "x.svg"),
            ("draw", "dvf5000_first", "-o", "x.png"),
            ("report", "dvf5000_first", "-o", "x.html"),
            ("test", "circular", "dvf5000_first", "--plot", "x.svg"),
            ("view", "--no-browser"),
        ],
        ["1", ""],
    ),
)
def test_a_small_address_space_gives_one_message(arguments, threads, tmp_path):
    few = {"OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads}
    found = run(*arguments, cwd=tmp_path, start=limit_addresses, **few)
    is_refusal(found, "warpspace: not enough memory: the address space is limited to")
    assert found.stdout == b""
    assert found.stderr.count(b"\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.nightly
def test_an_unknown_window_of_vtk(tmp_path):
    done = run(
        *("draw", "dvf5000_first", "--grid", "3", "-o", str(tmp_path / "x.png")),
        VTK_DEFAULT_OPENGL_WINDOW="bogus",
    )
    is_refusal(done, "VTK_DEFAULT_OPENGL_WINDOW is 'bogus'", "unset it")
    assert b"apt-get" not in done.stderr
