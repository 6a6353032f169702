"""Errors over two axes in the own table: read in any order, written, refused."""

import random
from dataclasses import replace

import numpy as np
import pytest

from warpspace.exceptions import SceneError
from warpspace.formats.compensation.compensate import Plan, compensate
from warpspace.formats.importing import read_errors
from warpspace.formats.kind import ReadOptions
from warpspace.formats.parts.csv_writing import surface_template
from warpspace.formats.registry import recognise
from warpspace.formats.source import source_of_text
from warpspace.formats.to_scene import into_scene
from warpspace.machine.curves.two_arguments import TwoArguments
from warpspace.machine.errors import ErrorSet
from warpspace.scene.library import load_scene

BASE = load_scene("dvf5000_nominal")
HEAD = "Y [mm],Z [mm],EXY [um],EAY [arcsec]\n"
ROWS = "-200,-400,0,0\n-200,-100,1.25,1\n0,-400,2,0.5\n0,-100,5.5,-1\n200,-400,-1,0\n200,-100,3,2\n"


def read(text: str):
    """Read a table."""
    return read_errors([source_of_text(text, "s.csv")], ReadOptions(BASE.machine))


def test_a_table_over_two_axes_is_bilinear_between_its_points() -> None:
    scene = into_scene(read(HEAD + ROWS), BASE, "", "s.csv").scene
    curve = scene.errors.functions["EXY"]
    assert isinstance(curve, TwoArguments)
    assert curve.axes == ("Y", "Z")
    at = {"Y": np.array([-100.0, 300.0]), "Z": np.array([-250.0, -100.0])}
    # the mean of the four corners of a cell; beyond the table its edge
    expected = [(0 + 1.25 + 2 + 5.5) / 4.0, 3.0]
    assert scene.errors.evaluate_at("EXY", at) == pytest.approx(expected)
    assert scene.errors.functions["EAY"].values[2][1] == pytest.approx(2 * 4.848136811)


def test_rows_stand_in_any_order_and_the_own_axis_in_either_column() -> None:
    rows = ROWS.splitlines()
    random.Random(7).shuffle(rows)
    swapped = [",".join([row.split(",")[i] for i in (1, 0, 2, 3)]) for row in rows]
    expected = read(HEAD + ROWS).found.planes
    assert read(HEAD + "\n".join(rows)).found.planes == expected
    head = "Z [mm],Y [mm],EXY [um],EAY [arcsec]\n"
    assert read(head + "\n".join(swapped)).found.planes == expected


def test_what_is_written_is_read_again_to_the_printed_digits() -> None:
    values = np.round(np.random.default_rng(3).uniform(-20, 20, (7, 5)), 6)
    first, second = np.linspace(-225, 225, 7), np.linspace(-480, -80, 5)
    curve = TwoArguments(
        BASE.axis_span("Y"),
        ("Y", "Z"),
        (tuple(first.tolist()), tuple(second.tolist())),
        tuple(map(tuple, values.tolist())),
    )
    scene = replace(BASE, errors=ErrorSet({"EXY": curve}))
    for points in (2, 41):  # a table over two axes keeps its own points
        found = compensate(scene, Plan("csv", points), 3)
        sources = [source_of_text(text, f"c{add}") for add, text in found.files.items()]
        assert recognise(sources).name == "csv"
        back = into_scene(read_errors(sources, ReadOptions(BASE.machine)), BASE, "", "c").scene
        assert back.errors.functions["EXY"] == curve


@pytest.mark.parametrize(
    ("text", "fragments"),
    [
        (HEAD + ROWS + "0,-400,7,7\n", ("line 8", "Y 0, Z -400", "line 4", "every point once")),
        (HEAD + ROWS.replace("0,-100,5.5,-1\n", ""), ("EXY", "Y 0, Z -100", "every point")),
        (HEAD + ROWS.replace("5.5", ""), ("line 5", "EXY has no value at Y 0, Z -100")),
        (HEAD + ROWS.replace("5.5", "", 1) + "0,-100,,\n", ("line 8", "Y 0, Z -100", "line 5")),
        (HEAD.replace("Y [mm]", "Y") + ROWS, ("line 1", "Y has no unit")),
        (HEAD.replace("EXY [um]", "EXX [um]") + ROWS, ("line 1", "EXX", "errors of Y or Z")),
        ("Y [mm],Z [mm],run,EXY [um]\n0,0,1,1\n", ("line 1", "column run", "one value a point")),
        ("Y [mm],Z [mm],EXY [um],u(EXY) [um]\n0,0,1,1\n", ("line 1", "u(EXY)")),
        (
            "Y [mm],Z [mm],direction,EXY [um]\n0,0,+,1\n0,0,-,1\n0,9,-,1\n",
            ("line 3", "other points backward"),
        ),
        (
            "Y [mm],Z [mm],direction,EXY [um]\n0,0,+,1\n0,0,,1\n",
            ("line 3", "no direction", "+ or -"),
        ),
        (
            "Y [mm],Z [mm],direction,EXY [um]\n0,0,+,1\n0,0,+,1\n",
            ("line 3", "Y 0, Z 0 forward", "line 2"),
        ),
        ("X [mm],Y [mm],Z [mm],EXY [um]\n0,0,0,1\n", ("line 1", "3 columns of positions")),
    ],
)
def test_a_bad_table_over_two_axes_is_refused(text: str, fragments: tuple[str, ...]) -> None:
    with pytest.raises(SceneError) as caught:
        read(text)
    for fragment in ("s.csv", "expected", *fragments):
        assert fragment in str(caught.value), (fragment, str(caught.value))


def test_the_table_to_fill_in_is_recognised_and_read_once_it_is_filled() -> None:
    text = surface_template(("X", "C"), ((-100.0, 100.0), (0.0, 90.0, 180.0)))
    assert "X [mm],C [deg],EXX [um]" in text
    filled = "\n".join(
        line if line.startswith(("#", "X")) else line.replace(",,,,,,", ",1,2,3,4,5,6")
        for line in text.splitlines()
    )
    found = read(filled).found
    assert [plane.key for plane in found.planes] == ["EXX", "EYX", "EZX", "EAX", "EBX", "ECX"]
    assert found.planes[0].axes == ("X", "C")
    assert found.planes[2].values == ((3.0,) * 3,) * 2
