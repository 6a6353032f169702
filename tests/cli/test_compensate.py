"""The command compensate."""

import pytest

from products import first
from warpspace.scene.library import load_scene


def test_the_table_that_was_written_is_imported_again(tmp_path, warpspace):
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


@pytest.mark.parametrize("ending", first("svg", "png"))
def test_charts_are_drawn(ending, tmp_path, warpspace):
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


def test_existing_files_and_the_scene_itself_stay(tmp_path, warpspace):
    table = tmp_path / "t_X.COM"
    table.write_text("mine", encoding="utf-8")
    target = tmp_path / "t.cma"
    arguments = ("compensate", "dvf5000_first", "--format", "heidenhain", "-o", target)
    warpspace(*arguments).refused("t_X.COM", "exists already")
    assert table.read_text(encoding="utf-8") == "mine"
    assert not target.exists()
