"""Option values that cannot be: exit 2, one message with option, value and what was expected."""

from pathlib import Path

import pytest

FIELD = ("field", "dvf5000_first")
OPTIONS = {
    "grid of zero": (("--grid", "0"), "grid: 0 nodes; expected 2 to 101"),
    "grid of one": (("--grid", "1"), "grid: 1 nodes; expected 2 to 101"),
    "negative grid": (("--grid", "-5"), "grid: -5 nodes; expected 2 to 101"),
    "grid of 102": (("--grid", "102"), "grid: 102 nodes; expected 2 to 101"),
    "grid of 10^30": (("--grid", "1" + "0" * 30), "grid: 1000", "expected 2 to 101"),
    "grid of a fraction": (("--grid", "2.5"), "'--grid'", "'2.5' is not a valid int"),
    "grid of a text": (("--grid", "many"), "'--grid'", "'many' is not a valid int"),
    "loop of no kind": (("--loop", "machine"), "'--loop'", "'machine'", "relative"),
    "frame of no kind": (("--frame", "tool"), "'--frame'", "'tool'", "workpiece"),
    "no axis": (("--at", "hello"), "--at 'hello'", "expected axis=number pairs"),
    "nothing": (("--at", ""), "--at ''", "expected axis=number pairs"),
    "no number": (("--at", "X=abc"), "--at 'X=abc'", "expected axis=number pairs"),
    "no value": (("--at", "X="), "--at 'X='", "expected axis=number pairs"),
    "trailing comma": (("--at", "X=1,"), "--at 'X=1,'", "expected axis=number pairs"),
    "nan": (("--at", "X=nan"), "--at 'X=nan'", "expected axis=number pairs"),
    "infinite": (("--at", "X=-inf"), "--at 'X=-inf'", "expected axis=number pairs"),
    "1e9": (("--at", "X=1e9"), "--at 'X=1e9'", "at most ±100000"),
    "axis of another machine": (("--at", "A=1"), "--at 'A=1'", "unknown axis A", "X, Y, Z, B, C"),
    "axis twice": (("--at", "X=1,x=2"), "--at 'X=1,x=2'", "axis X is given twice"),
    "second point bad": (("--at", "X=1", "--at", "Q=2"), "--at 'Q=2'", "unknown axis Q"),
    "points and grid": (("--at", "X=1", "--grid", "5"), "--at and --grid exclude each other"),
    "csv in no folder": (("--csv", "nowhere/x.csv"), "nowhere/x.csv", "does not exist"),
    "csv is a folder": (("--csv", "."), ".: is a folder"),
    "csv of no name": (("--csv", ""), "is a folder"),
    "csv is a device": (("--csv", "/dev/null"), "/dev/null: is no regular file"),
    "csv with a long name": (("--csv", "x" * 300), "cannot be written", "too long"),
    "field in no format": (("-o", "x.txt"), "unknown ending '.txt'", ".parquet", ".npz", ".vts"),
    "points as a grid": (("--at", "X=1", "-o", "x.vts"), "x.vts", "holds a grid", ".parquet"),
    "field in no folder": (("-o", "nowhere/x.parquet"), "nowhere/x.parquet", "does not exist"),
    "unknown option": (("--girds", "5"), "--girds"),
    "option without value": (("--grid",), "--grid"),
}


@pytest.mark.parametrize("case", OPTIONS)
def test_impossible_option_is_refused_and_leaves_no_file(
    case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, warpspace
) -> None:
    options, *fragments = OPTIONS[case]
    monkeypatch.chdir(tmp_path)
    for extra in ((), ("--json",)):
        warpspace(*FIELD, *extra, *options).refused(*fragments)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "fragment"),
    [
        (("check",), "Missing argument 'SCENE'"),
        (("field",), "Missing argument 'SCENE'"),
        (("scenes", "extra"), "extra"),
        (("check", "dvf5000_first", "--jason"), "--jason"),
        (("filed", "dvf5000_first"), "filed"),
    ],
)
def test_impossible_command_is_refused(arguments, fragment: str, warpspace) -> None:
    warpspace(*arguments).refused(fragment)


def test_no_command_shows_the_help_on_stderr(warpspace) -> None:
    result = warpspace()
    assert (result.status, result.out) == (2, "")
    assert "Usage:" in result.err
    assert "Commands:" in result.err


def test_position_where_a_curve_leaves_the_model_is_refused(tmp_path: Path, warpspace) -> None:
    path = tmp_path / "steep.toml"
    path.write_text(
        'machine = "dvf5000"\n[workspace]\nX = [0, 1]\n[errors]\nEXX = { ramp = 1000 }\n',
        encoding="utf-8",
    )
    assert warpspace("field", path).status == 0
    warpspace("field", path, "--at", "X=5000", "--json").refused(
        "EXX reaches 5e+06 µm", "expected at most ±100000"
    )


def test_failed_write_keeps_the_file_that_was_there(tmp_path: Path, warpspace) -> None:
    target = tmp_path / "points.csv"
    target.write_text("mine", encoding="utf-8")
    warpspace("field", "dvf5000_first", "--at", "Q=1", "--csv", target, "--force").refused(
        "unknown axis Q"
    )
    assert target.read_text(encoding="utf-8") == "mine"
    assert list(tmp_path.iterdir()) == [target]
