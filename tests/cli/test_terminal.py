"""Titles and file names cannot steer the terminal; odd surroundings give a clear message."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from products import pairwise
from warpspace.cli.tables import escape_json, plain

EVIL = "red\x1b[31m\x9b2J\x07 \u202egpj.exe\u2066 end"
STEERING = ("\x1b", "\x9b", "\x07", "\u202e", "\u2066")
MAIN = "from warpspace.cli import main; main()"


def run(
    *arguments,
    code=MAIN,
    start=None,
    cwd=None,
    stdout=subprocess.PIPE,
    stderr=subprocess.PIPE,
    **variables,
):
    command = [sys.executable, "-c", code, *arguments]
    how = {"cwd": cwd, "env": {**os.environ, **variables}, "preexec_fn": start}
    return subprocess.run(command, stdout=stdout, stderr=stderr, check=False, timeout=120, **how)


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


COMMANDS = (
    "check SCENE",
    "check SCENE --json",
    "field SCENE --at X=0",
    "gains SCENE",
    "test circular SCENE --radius 100",
    "check SCENE --against own",
    "montecarlo SCENE --samples 100",
)


def is_harmless(result):
    return not any(character in result.out + result.err for character in STEERING)


@pytest.mark.parametrize("command", COMMANDS)
def test_a_description_reaches_the_terminal_harmless(command, tmp_path, warpspace):
    path = tmp_path / "s.toml"
    half_widths = "default = { translation = 10, rotation = 20, squareness = 25 }"
    head = f'title = "t"\ndescription = {json.dumps(EVIL)}\nmachine = "dvf5000"\n'
    path.write_text(f"{head}[errors]\nEC0Y = 5\n[tolerances]\n{half_widths}", "utf-8")
    result = warpspace(*(path if word == "SCENE" else word for word in command.split()))
    assert result.status == 0, result.err
    assert is_harmless(result)


def test_a_title_with_control_characters_is_refused_harmlessly(tmp_path, warpspace):
    path = tmp_path / "s.toml"
    path.write_text(f'title = {json.dumps(EVIL)}\nmachine = "dvf5000"\n', "utf-8")
    result = warpspace("check", path)
    assert (result.status, is_harmless(result)) == (2, True)


@pytest.mark.parametrize(
    "arguments",
    [("check", EVIL), (EVIL,), ("check", f"--{EVIL}"), ("gains", "dvf5000_first", "--loop", EVIL)],
    ids=["scene", "command", "option", "value"],
)
def test_a_refused_word_reaches_the_terminal_harmless(arguments, warpspace):
    result = warpspace(*arguments)
    assert (result.status, is_harmless(result)) == (2, True)


def test_a_file_name_that_is_no_text(tmp_path, warpspace):
    scene, target, missing = (
        tmp_path / os.fsdecode(name) for name in (b"\xff.toml", b"\xfe.csv", b"\xfd.toml")
    )
    scene.write_text('title = "t"\nmachine = "dvf5000"\n', "utf-8")
    done = warpspace("export", scene, "--grid", "3", "-o", target)
    assert done.status == 0, done.err
    assert r"\xfe.csv" in done.out
    assert target.stat().st_size > 100
    warpspace("check", missing).refused(r"\xfd.toml")


def test_a_working_folder_that_is_gone(tmp_path):
    folder = tmp_path / "gone"
    folder.mkdir()
    code = f"import os; os.rmdir({str(folder)!r}); {MAIN}"
    done = run("check", "dvf5000_first", code=code, cwd=folder)
    is_refusal(done, "the working folder no longer exists")


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


def add_plug_in(folder, *lines):
    """Write a package whose only module is a plug-in; return the variable that installs it."""
    about = folder / "additions-1.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: additions\nVersion: 1\n", "utf-8")
    (about / "entry_points.txt").write_text("[warpspace.plugins]\nadded = additions\n", "utf-8")
    (folder / "additions.py").write_text("\n".join(lines), "utf-8")
    return {"PYTHONPATH": os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])}


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (("raise SystemExit(5)",), "SystemExit: 5"),
        (("raise KeyboardInterrupt",), "KeyboardInterrupt"),
        (("raise ValueError('a\\x1b[31mb')",), r"ValueError: a\x1b[31mb"),
        (("print('hello')",), "hello\n"),
        (("import warnings", "warnings.warn('a\\x1b[31mb')"), ""),
        (("import logging", "logging.warning('a\\x1b[31mb')"), ""),
    ],
    ids=["exit", "interrupt", "escape", "print", "warning", "log"],
)
def test_a_plug_in_neither_ends_the_program_nor_mixes_with_its_output(lines, message, tmp_path):
    done = run("list", "--json", **add_plug_in(tmp_path, *lines))
    text = done.stderr.decode()
    assert done.returncode == 0, text
    assert json.loads(done.stdout)["scenes"]
    assert message in text if message else not text
    assert "\x1b" not in text
    assert ("the plug-in added cannot be loaded" in text) == ("raise" in lines[0])


def test_a_signal_while_a_plug_in_is_imported_ends_the_program(tmp_path):
    lines = "import os, signal, time", "os.kill(os.getpid(), signal.SIGTERM)", "time.sleep(0.1)"
    done = run("list", **add_plug_in(tmp_path, *lines))
    assert (done.returncode, done.stderr) == (128 + signal.SIGTERM, b"\nwarpspace: terminated\n")


def test_a_defect_shows_its_traceback_as_plain_text():
    code = """
from warpspace.cli.main import cli, main
def fail(**options):
    raise RuntimeError(chr(27) + "[31m")
cli.main = fail
main()
"""
    done = run(code=code)
    assert done.returncode == 1
    assert done.stderr.strip().endswith(b"RuntimeError: \\x1b[31m")


@pytest.mark.parametrize(
    "closed",
    [(1,), *(pytest.param(n, marks=pytest.mark.nightly) for n in ((2,), (0, 1, 2)))],
    ids=str,
)
@pytest.mark.parametrize(
    ("arguments", "status"),
    [
        (("gains", "dvf5000_first"), 0),
        (("field", "dvf5000_first", "--grid", "3", "--csv", "x.csv"), 0),
        (("check", "nothing"), 2),
        pytest.param(("report", "dvf5000_first", "--grid", "3", "-o", "x.html"), 0,
                     marks=pytest.mark.nightly),
    ],
    ids=lambda value: value[0] if isinstance(value, tuple) else "",
)  # fmt: skip
def test_a_stream_that_is_closed_at_the_start(arguments, status, closed, tmp_path):
    done = run(*arguments, cwd=tmp_path, start=lambda: [os.close(number) for number in closed])
    assert done.returncode == status, done.stderr
    assert b"Traceback" not in done.stderr
    written = [path.name for path in tmp_path.iterdir()]
    assert written == [name for name in arguments if name.startswith("x.")]


@pytest.mark.parametrize("arguments", [("gains", "dvf5000_first"), ("list", "--json"), ("--help",)])
def test_a_reader_that_has_ended(arguments):
    reading, writing = os.pipe()
    os.close(reading)
    assert run(*arguments, stdout=writing).stderr == b""
    os.close(writing)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")
def test_a_message_that_cannot_be_written_changes_no_exit_status():
    with Path("/dev/full").open("w") as full:
        assert run("check", "nothing", stderr=full).returncode == 2


@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_an_output_without_greek_letters(encoding):
    done = run("gains", "dvf5000_first", LC_ALL="C", PYTHONIOENCODING=encoding)
    assert (done.returncode, done.stderr) == (0, b"")
    assert ("α_YZ" if encoding == "ascii" else r"\u03b1_YZ").encode() in done.stdout


@pytest.mark.skipif(sys.platform != "linux", reason="other systems draw without EGL")
@pytest.mark.parametrize(
    "arguments",
    [("draw", "-o", "x.png"), pytest.param(("report", "-o", "x.html"), marks=pytest.mark.nightly)],
)
def test_a_machine_without_egl(arguments, tmp_path):
    command, *output = arguments
    empty = {"__EGL_VENDOR_LIBRARY_DIRS": str(tmp_path / "none")}
    done = run(command, "dvf5000_first", "--grid", "3", *output, cwd=tmp_path, **empty)
    is_refusal(done, "VTK cannot draw off screen here", "apt-get install libegl1")
    assert done.stderr.count(b"\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_folders_that_cannot_be_written(tmp_path):
    nowhere = str(tmp_path / "none" / "none")
    places = dict.fromkeys(("HOME", "TMPDIR", "XDG_CACHE_HOME", "XDG_CONFIG_HOME"), nowhere)
    places["MPLCONFIGDIR"] = "/dev/null/none"
    done = run("gains", "dvf5000_first", "--plot", "x.svg", cwd=tmp_path, **places)
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"wrote x.svg" in done.stdout
