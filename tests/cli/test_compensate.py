"""The command compensate."""

import json
from pathlib import Path

import pytest

from warpspace.scene.library import load_scene

KEYS = ["mean_um", "rms_um", "p95_um", "max_um", "max_at_mm", "max_at_axes"]


def test_json_has_before_after_and_the_worst(tmp_path: Path, warpspace) -> None:
    target = tmp_path / "cec.ini"
    result = warpspace(
        "compensate",
        "dvf5000_first",
        "--format",
        "sinumerik-cec",
        "-o",
        target,
        "--grid",
        "5",
        "--json",
    )
    found = json.loads(result.out)
    assert list(found["before"]) == list(found["after"]) == KEYS
    assert found["before"]["max_um"] == pytest.approx(51.72, abs=0.01)
    assert found["before"]["mean_um"] == pytest.approx(30.89, abs=0.02)
    assert found["worst_after_um"] == found["after"]["max_um"] < 0.01
    assert found["points"] == {"X": 5, "Y": 5, "Z": 5}
    assert found["files"] == [str(target)]
    assert target.read_text(encoding="utf-8").startswith("%_N_NC_CEC_INI\nCHANDATA(1)\n")


def test_the_table_that_was_written_is_imported_again(tmp_path: Path, warpspace) -> None:
    target = tmp_path / "m.cma"
    assert (
        warpspace(
            "compensate",
            "dvf5000_first",
            "--format",
            "heidenhain",
            "-o",
            target,
            "--grid",
            "X=3,Y=9",
        ).status
        == 0
    )
    files = sorted(tmp_path.iterdir())
    assert [file.name for file in files] == ["m.cma", "m_X.COM", "m_Y.COM", "m_Z.COM"]
    scene = tmp_path / "back.toml"
    result = warpspace("import", *files, "--machine", "dvf5000_nominal", "-o", scene)
    assert result.status == 0, result.err
    assert {"EXX", "EYX", "EZX", "EYY"} <= set(load_scene(scene).errors)


@pytest.mark.parametrize("ending", ["png", "svg"])
def test_charts_are_drawn(ending: str, tmp_path: Path, warpspace) -> None:
    chart = tmp_path / f"c.{ending}"
    arguments = ("compensate", "dvf5000_first")
    table = ("--format", "linuxcnc-matrix", "-o", tmp_path / "m.hal")
    assert warpspace(*arguments, *table, "--plot", chart).status == 0
    assert chart.stat().st_size > 5000
    other = tmp_path / f"s.{ending}"
    result = warpspace(
        *arguments,
        "--sweep",
        "3,5",
        "--format",
        "sinumerik-enc",
        "--format",
        "marlin",
        "--plot",
        other,
    )
    assert result.status == 0, result.err
    assert "sinumerik-enc" in result.out
    assert other.stat().st_size > 5000


def test_a_sweep_in_json(warpspace) -> None:
    found = json.loads(
        warpspace(
            "compensate", "dvf5000_first", "--sweep", "3", "--format", "heidenhain", "--json"
        ).out
    )
    assert list(found["before"]) == KEYS
    (one,) = found["sweep"]
    assert (one["format"], one["points"], one["pitch"], one["numbers"]) == (
        "heidenhain",
        3,
        275.0,
        27,
    )
    assert one["worst_after_um"] == one["after"]["max_um"]


@pytest.mark.parametrize(
    ("arguments", "fragments"),
    [
        ((), ("--format", "-o")),
        (("--format", "sinumerik-enc"), ("-o",)),
        (("--format", "none", "-o", "{}/x"), ("unknown format 'none'",)),
        (("--format", "rtl", "-o", "{}/x"), ("read only",)),
        (("--format", "csv", "-o", "{}/x.csv", "--grid", "a"), ("--grid 'a'",)),
        (("--format", "csv", "-o", "{}/x.csv", "--resolution", "0.01"), ("--resolution",)),
        (("--format", "fanuc-3d", "-o", "{}/x.csv", "--grid", "90"), ("2 to 25 points",)),
        (("--format", "isg-csv", "-o", "{}/x.csv", "--orientation"), ("position only",)),
        (("--sweep", "a"), ("--sweep 'a'",)),
        (("--sweep", "3", "-o", "{}/x"), ("--sweep writes no table",)),
        (("--sweep", "2,3,4,5,6,7,8,9,10,11,12,13,14,15"), ("at most 32",)),
    ],
)
def test_bad_options_write_nothing(arguments, fragments, tmp_path: Path, warpspace) -> None:
    given = [part.format(tmp_path) for part in arguments]
    warpspace("compensate", "dvf5000_first", *given).refused(*fragments)
    assert not list(tmp_path.iterdir())


def test_existing_files_and_the_scene_itself_stay(tmp_path: Path, warpspace) -> None:
    table = tmp_path / "t_X.COM"
    table.write_text("mine", encoding="utf-8")
    target = tmp_path / "t.cma"
    arguments = ("compensate", "dvf5000_first", "--format", "heidenhain", "-o", target)
    warpspace(*arguments).refused("t_X.COM", "exists already")
    assert table.read_text(encoding="utf-8") == "mine"
    assert not target.exists()


def test_errors_by_direction_of_travel_are_told_in_both(tmp_path: Path, warpspace) -> None:
    scene = tmp_path / "s.toml"
    scene.write_text(
        'machine = "dvf5000"\n[workspace]\nX = [-275, 275]\nY = [-225, 225]\nZ = [-480, -80]\n'
        "[errors]\nEXX = { forward = { ramp = 8 }, backward = { ramp = 2 } }\n",
        encoding="utf-8",
    )
    for name, held in (("sinumerik-cec", True), ("sinumerik-enc", False)):
        command = ("compensate", scene, "--format", name, "-o", tmp_path / "t.ini", "--force")
        found = json.loads(warpspace(*command, "--json").out)
        assert found["before"]["max_um"] == pytest.approx(5.0)
        assert found["after"]["max_um"] < 0.01
        assert found["directions"]["forward"]["before"]["max_um"] == pytest.approx(8.0)
        assert found["directions"]["backward"]["before"]["max_um"] == pytest.approx(2.0)
        for way in ("forward", "backward"):
            left = found["directions"][way]["after"]["max_um"]
            assert left == pytest.approx(0.0 if held else 3.0, abs=0.01)
        said = [note for note in found["notes"] if "direction of travel is not held" in note]
        assert len(said) == (0 if held else 1)
        text = warpspace(*command).out
        for word in ("before forward", "after backward"):
            assert word in text
    plain = warpspace(
        "compensate", "dvf5000_first", "--format", "marlin", "-o", tmp_path / "m.gcode", "--json"
    )
    assert json.loads(plain.out)["directions"] == {}
