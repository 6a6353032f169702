"""CSV files of a scene that cannot be used: the message names scene, key, CSV file and line."""

import os
import tracemalloc
from pathlib import Path

import pytest

from warpspace.exceptions import SceneError
from warpspace.scene.csv_column import read_csv_column

CSV_PROBLEMS = {
    "ragged": ("q,pitch\n0,1\n1,2,3\n", "line 3 has 3 fields; expected 2 as in the header"),
    "not a number": ("q,pitch\n0,1\n\n1,x\n", 'line 4: "x"; expected a finite number'),
    "nan": ("q,pitch\n0,nan\n", 'line 2: "nan"; expected a finite number'),
    "infinite position": ("q,pitch\ninf,1\n", 'line 2: "inf"; expected a finite number'),
    "empty field": ("q,pitch\n0,\n", 'line 2: ""; expected a finite number'),
    "unknown column": ("q,Pitch\n0,1\n", "column 'pitch' not found: did you mean 'Pitch'?"),
    "column is the position": ("pitch,yaw\n0,1\n", "column 'pitch' not found; expected one of yaw"),
    "column twice": ("q,pitch,pitch\n0,1,2\n", "column 'pitch' stands there twice"),
    "not sorted": ("q,pitch\n1,1\n0,1\n", "line 3: position 0 after 1; expected ascending"),
    "too large": ("q,pitch\n0,1e9\n", "line 2: 1e+09; expected at most ±100000"),
    "far position": ("q,pitch\n-1e9,1\n", "line 2: -1e+09; expected at most ±100000"),
    "only a header": ("q,pitch\n", "has 0 rows below the header"),
    "empty": ("", "expected a header"),
    "open quote": ('q,pitch\n0,"1\n', "is not valid CSV"),
    "too many rows": ("q,pitch\n" + "0,1\n" * 100_001, "expected a header and 1 to 100000 rows"),
}


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """A scene whose EBX follows the column "pitch" of x.csv beside it."""
    path = tmp_path / "scene.toml"
    path.write_text(
        'machine = "dvf5000"\n[errors]\nEBX = { csv = "x.csv", column = "pitch" }\n',
        encoding="utf-8",
    )
    return path


@pytest.mark.parametrize("case", CSV_PROBLEMS)
def test_csv_that_cannot_be_used_is_refused(case, scene: Path, warpspace) -> None:
    text, fragment = CSV_PROBLEMS[case]
    csv = scene.with_name("x.csv")
    csv.write_text(text, encoding="utf-8")
    warpspace("check", scene).refused(f"{scene}: errors.EBX: {csv}: ", fragment)


def test_missing_csv_is_refused(scene: Path, warpspace) -> None:
    warpspace("check", scene).refused("errors.EBX", "x.csv: no such file")


def test_folder_as_csv_is_refused(scene: Path, warpspace) -> None:
    scene.with_name("x.csv").mkdir()
    warpspace("check", scene).refused("errors.EBX", "x.csv: is a folder; expected a file")


def test_csv_that_is_not_utf_8_is_refused(scene: Path, warpspace) -> None:
    scene.with_name("x.csv").write_bytes(b"q,pitch\n0,\xff\n")
    warpspace("check", scene).refused("errors.EBX", "x.csv: is not UTF-8 text (byte 10)")


def test_sparse_gigabyte_as_csv_is_refused_unread(scene: Path, warpspace) -> None:
    with scene.with_name("x.csv").open("wb") as file:
        file.truncate(1024**3)
    warpspace("check", scene).refused("errors.EBX", "is 1,073,741,824 bytes long")


@pytest.mark.parametrize("name", ['"x\\u0000.csv"', f'"{"x" * 1000}.csv"'])
def test_name_no_file_can_have_is_refused(name: str, tmp_path: Path, warpspace) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(
        f'machine = "dvf5000"\n[errors]\nEBX = {{ csv = {name}, column = "p" }}\n', encoding="utf-8"
    )
    warpspace("check", path).refused("errors.EBX")


def test_csv_from_a_spreadsheet_is_read(scene: Path, warpspace) -> None:
    text = '\ufeff"q [mm]", "pitch"\r\n-275, -4\r\n\r\n275, 6\r\n'
    scene.with_name("x.csv").write_bytes(text.replace(', "', ',"').encode())
    result = warpspace("field", scene, "--at", "X=0,Y=0,Z=0", "--json")
    assert result.status == 0, result.err


@pytest.mark.parametrize("name", ["/dev/zero", "/dev/null", "pipe"])
def test_device_or_pipe_is_refused_unread(name: str, tmp_path: Path, warpspace) -> None:
    if name == "pipe":
        os.mkfifo(tmp_path / name)
    path = tmp_path / "scene.toml"
    path.write_text(
        f'machine = "dvf5000"\n[errors]\nEBX = {{ csv = "{name}", column = "p" }}\n',
        encoding="utf-8",
    )
    warpspace("check", path).refused("errors.EBX", "is no regular file; expected a file")


LONG = {
    "short rows": ("q,pitch\n" + "0,1\n" * 1_000_000, "has more than 100000 rows"),
    "blank rows": ("q,pitch\n" + "\n" * 600_000, "has more than 500,000 lines"),
    "one row": ("q,pitch\n" + "," * 10_000_000, "line 2 is longer than 16,384 characters"),
    "many columns": ("q" + ",p" * 300 + "\n0,1\n", "line 1 has 301 fields; expected at most 256"),
    "row over many lines": ("q,pitch\n" + '"\n",' * 1_000_000, "is not valid CSV: line 22"),
}


@pytest.mark.parametrize("case", LONG)
def test_long_csv_is_read_in_little_memory(case: str, tmp_path: Path) -> None:
    """64 MB of short rows took 3.6 GB and 22 s, a million of them above 200 MB."""
    text, fragment = LONG[case]
    path = tmp_path / "x.csv"
    path.write_text(text, encoding="utf-8")
    del text
    tracemalloc.start()
    try:
        with pytest.raises(SceneError) as caught:
            read_csv_column(path, "pitch", 1e5, 100_000)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert fragment in str(caught.value)
    assert peak < 20e6


def test_a_header_may_have_a_line_break_in_a_name(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text('"q\n[mm]",pitch\n0,1\n', encoding="utf-8")
    assert read_csv_column(path, "pitch", 1e5, 10) == [(0.0, 1.0)]
