"""Standard uncertainties and readings that are kept with a scene."""

from pathlib import Path

import numpy as np
import pytest

from warpspace.exceptions import SceneError
from warpspace.machine.errors import Constant, Table
from warpspace.machine.measurement import Measurement, Run
from warpspace.scene.library import load_scene, parse_scene
from warpspace.scene.save import scene_to_toml

HEAD = 'machine = "dvf5000"\n'
SCENE = (
    HEAD
    + """[errors]
EXX = 3
[uncertainty]
EXX = 0.4
EYX = { table = [[-275, 0.1], [275, 0.2]] }
EC0Y = 1
[measured.EXX]
runs = [
  { direction = "+", points = [[-275, 1], [275, 2]] },
  { direction = "-", points = [[275, 1.5], [-275, 2.5]] },
  { points = [[0, 0.5]] },
]
"""
)


def test_they_are_read_and_reload_equal() -> None:
    scene = parse_scene(SCENE, "s")
    assert scene.uncertainty["EXX"] == Constant((-275.0, 275.0), 0.4)
    assert scene.uncertainty["EYX"] == Table((-275.0, 275.0), ((-275.0, 0.1), (275.0, 0.2)))
    runs = scene.measured["EXX"].runs
    assert [run.direction for run in runs] == ["+", "-", ""]
    assert runs[1].points == ((275.0, 1.5), (-275.0, 2.5))
    assert parse_scene(scene_to_toml(scene), "s") == scene


def test_readings_come_by_direction() -> None:
    runs = (Run("+", ((0.0, 1.0),)), Run("-", ((0.0, 2.0),)), Run("+", ((5.0, 3.0),)))
    measurement = Measurement(runs)
    assert measurement.count == 3
    np.testing.assert_array_equal(measurement.scatter["+"], [[0.0, 1.0], [5.0, 3.0]])
    np.testing.assert_array_equal(measurement.scatter["-"], [[0.0, 2.0]])


def test_readings_may_stand_in_a_file_beside_the_scene(tmp_path: Path) -> None:
    (tmp_path / "runs.csv").write_text(
        "X,EYX,EXX,run,direction\n-275,9,1,1,+\n275,9,2,1,+\n275,9,1.5,1,-\n-275,9,2.5,2,-\n"
    )
    text = HEAD + '[measured.EXX]\ncsv = "runs.csv"\ncolumn = "EXX"\n'
    (tmp_path / "s.toml").write_text(text)
    scene = load_scene(tmp_path / "s.toml")
    assert scene.measured["EXX"].runs == (
        Run("+", ((-275.0, 1.0), (275.0, 2.0))),
        Run("-", ((275.0, 1.5),)),
        Run("-", ((-275.0, 2.5),)),
    )
    assert parse_scene(scene_to_toml(scene), "s") == scene  # needs no other file


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[uncertainty]\nEXX = -1", r"uncertainty\.EXX = -1.0: a standard uncertainty is not neg"),
        ("[uncertainty]\nEXX = { ramp = 1 }", "expected a number or { table"),
        ("[uncertainty]\nEXQ = 1", r"uncertainty\.EXQ: unknown error parameter"),
        ("[uncertainty]\nEXA = 1", r"uncertainty\.EXA: the machine wCBFXYZt has no axis A"),
        ("[uncertainty]\nEC0Y = { table = [[1, 1]] }", "is constant along its axis"),
        ("[uncertainty]\nEXX = { table = [[1, -1]] }", "is not negative"),
        ("[measured.EXX]\nruns = []", r"measured\.EXX\.runs = \[\]: expected at least 1"),
        ("[measured.EXX]\nruns = 3", "expected a list"),
        ("[measured.EXX]\nruns = [3]", r"measured\.EXX\.runs\[0\] = 3: expected a table"),
        ("[measured]\nEXX = 3", r"measured\.EXX = 3: expected a table"),
        ("[measured.EXX]\nrun = 3", r"measured\.EXX\.run: unknown key; expected runs"),
        ('[measured.EXX]\nruns = [{ direction = "u", points = [[1, 2]] }]', r'expected "\+", "-"'),
        ("[measured.EXX]\nruns = [{ points = [[1, 2, 3]] }]", r"expected \[position, value\]"),
        ("[measured.EXX]\nruns = [{ points = [[1, nan]] }]", r"points\[0\]\[1\] = nan: expected a"),
        ('[measured.EXX]\nruns = [{ direction = "+" }]', r"runs\[0\]\.points: is missing"),
        ('[measured.EXX]\ncsv = "a.csv"', r"measured\.EXX\.column: is missing"),
        ('[measured.EXX]\ncsv = "a.csv"\ncolumn = "v"', "CSV files are not read here"),
    ],
)
def test_what_is_none_is_refused_in_words(text: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        parse_scene(HEAD + text, "s")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("X,v\n", "has 0 rows below the header"),
        ("", "column 'v' not found"),
        ("X,w\n1,2\n", "column 'v' not found"),
        ("X,v\n1,2,3\n", "line 2 has 3 fields; expected 2"),
        ("X,v\n1,a\n", 'line 2: "a"; expected a finite number'),
        ("X,v,direction\n1,2,up\n", 'line 2: direction "up"; expected'),
        ("X,v\n1,2e9\n", r"line 2: 2e\+09; expected at most ±100000"),
    ],
)
def test_a_file_that_holds_no_runs_is_refused_in_words(
    tmp_path: Path, content: str, message: str
) -> None:
    (tmp_path / "runs.csv").write_text(content)
    text = HEAD + '[measured.EXX]\ncsv = "runs.csv"\ncolumn = "v"\n'
    (tmp_path / "s.toml").write_text(text)
    with pytest.raises(SceneError, match=message):
        load_scene(tmp_path / "s.toml")
