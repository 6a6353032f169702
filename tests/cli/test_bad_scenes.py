"""Malformed scenes and CSV files: exit 2, one message, nothing written, nothing read for long."""

import os
import tracemalloc
from pathlib import Path

import pytest

from warpspace.exceptions import SceneError
from warpspace.scene.curve_reader import read_csv_column

DVF = 'machine = "dvf5000"\n'
MALFORMED = {
    "10^400": (DVF + f"[errors]\nEAX = 1{'0' * 400}", "errors.EAX = a whole number of 1329 bits"),
    "10^5000": (DVF + f"[errors]\nEAX = 1{'0' * 5000}", "is not valid TOML", "4300 digits"),
    "16^5000": (DVF + f"view = 0x{'f' * 5000}", "view = a whole number of 20000 bits", "a table"),
    "thousands of problems": (
        f"{DVF}[errors]\n" + "".join(f"K{number} = 1\n" for number in range(20_000)),
        *("20000 problems", "… and 19960 more"),
    ),
    "huge value": (
        f'{DVF}view.exaggeration = "{"y" * 1_000_000}"',
        *("view.exaggeration", "…", '"auto" or a number above 0'),
    ),
}
"""Too long for tests/golden/refused."""


@pytest.mark.parametrize("case", MALFORMED)
def test_malformed_scene_is_refused_with_file_key_value_and_expectation(case, tmp_path, warpspace):
    text, *fragments = MALFORMED[case]
    path = tmp_path / "bad.toml"
    path.write_text(text, encoding="utf-8")
    warpspace("field", path, "--json").refused(f"{path}: ", *fragments)
    assert list(tmp_path.iterdir()) == [path]


def sparse(size):

    def make(path):
        with path.open("wb") as file:
            file.truncate(size)

    return make


NO_TEXT = {
    "folder": (Path.mkdir, "is a folder; expected a file"),
    "latin": (lambda path: path.write_bytes(b"q,pitch\n0,\xff\n"), "is not UTF-8 text (byte 10)"),
    "5 MB": (sparse(5 * 1024**2), "is 5,242,880 bytes long"),
    "1 GB": (sparse(1024**3), "is 1,073,741,824 bytes long"),
    "pipe": (os.mkfifo, "is no regular file; expected a file"),
    "device": (lambda path: path.symlink_to("/dev/zero"), "is no regular file; expected a file"),
}


@pytest.mark.parametrize("what", NO_TEXT)
def test_what_is_no_text_is_refused_unread_as_a_scene_and_as_its_csv(what, tmp_path, warpspace):
    make, said = NO_TEXT[what]
    make(tmp_path / "x.csv")
    scene = tmp_path / "scene.toml"
    scene.write_text(
        DVF + '[errors]\nEBX = { csv = "x.csv", column = "pitch" }\n', encoding="utf-8"
    )
    warpspace("check", tmp_path / "x.csv").refused(str(tmp_path / "x.csv"), said)
    if what != "5 MB":
        if what == "latin":  # a table may be in Windows-1252
            said = 'line 2: "ÿ"; expected a finite number'
        warpspace("check", scene).refused("errors.EBX", f"x.csv: {said}")


def test_text_of_a_spreadsheet_with_a_byte_order_mark_is_read(tmp_path, warpspace):
    text = '\ufeff"q [mm]","pitch"\r\n-275, -4\r\n\r\n275, 6\r\n'
    (tmp_path / "x.csv").write_bytes(text.encode())
    path = tmp_path / "bom.toml"
    text = DVF + '[errors]\nEBX = { csv = "x.csv", column = "pitch" }\n'
    path.write_text(text, encoding="utf-8-sig")
    assert warpspace("check", path).status == 0


def test_no_command_shows_the_help_on_stderr(warpspace):
    result = warpspace()
    assert (result.status, result.out) == (2, "")
    assert "Usage:" in result.err
    assert "Understand:" in result.err


LONG = {
    "short rows": ("q,pitch\n" + "0,1\n" * 1_000_000, "more than 20,000 rows"),
    "blank rows": ("q,pitch\n" + "\n" * 600_000, "has more than 500,000 lines"),
    "one row": ("q,pitch\n" + "," * 10_000_000, "line 2 is longer than 16,384 characters"),
    "many columns": ("q" + ",p" * 300 + "\n0,1\n", "line 1 has 301 fields; expected at most 256"),
    "row over many lines": ("q,pitch\n" + '"\n",' * 1_000_000, "line 22: is not valid CSV"),
}


@pytest.mark.parametrize("case", LONG)
def test_long_csv_is_read_in_little_memory(case, tmp_path, monkeypatch):
    """64 MB of short rows took 3.6 GB and 22 s, a million of them above 200 MB."""
    text, fragment = LONG[case]
    monkeypatch.setattr("warpspace.machine.limits.MAX_POINTS", 20_000)
    path = tmp_path / "x.csv"
    path.write_text(text, encoding="utf-8")
    del text
    tracemalloc.start()
    try:
        with pytest.raises(SceneError) as caught:
            read_csv_column(path, "pitch")
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert fragment in str(caught.value)
    assert peak < 5e6


def test_a_header_may_have_a_line_break_in_a_name(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text('"q\n[mm]",pitch\n0,1\n', encoding="utf-8")
    assert read_csv_column(path, "pitch") == [(0.0, 1.0)]


CIRCULAR = {
    "part.file": '[part]\nfile = "a.stl"\n',
    "bodies.X": '[bodies]\nX = "a.stl"\n',
    "uncertainty.covariance": '[uncertainty]\ncovariance = "a.stl"\n',
}


@pytest.mark.parametrize("key", CIRCULAR)
def test_links_in_a_circle_are_no_file(key, tmp_path, warpspace):
    (tmp_path / "a.stl").symlink_to(tmp_path / "b.stl")
    (tmp_path / "b.stl").symlink_to(tmp_path / "a.stl")
    path = tmp_path / "scene.toml"
    path.write_text(DVF + CIRCULAR[key], encoding="utf-8")
    warpspace("check", path).refused(f'{path}: {key} = "a.stl": there is no such file')
