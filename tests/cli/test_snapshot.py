"""Commands `snapshot` and `compare`."""

import json
from pathlib import Path

import pytest

from cli.conftest import Command
from warpspace.outputs.figures import catalogue

SMALL = ("--size", "400x300", "--grid", "3")


def test_the_command_names_every_figure_of_one_scene(warpspace: Command) -> None:
    words = warpspace("snapshot", "--help").out.replace(",", " ").replace(".", " ").split()
    assert set(catalogue.figure_names()) <= set(words)


@pytest.mark.render
@pytest.mark.usefixtures("renderer")
@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_a_snapshot_is_written(warpspace: Command, tmp_path: Path, ending: str) -> None:
    target = tmp_path / f"map.{ending}"
    result = warpspace("snapshot", "dvf5000_first", "-o", target, *SMALL)
    assert result.status == 0, result.err
    assert target.stat().st_size > 5000
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.render
@pytest.mark.usefixtures("renderer")
def test_an_existing_file_needs_force(warpspace: Command, tmp_path: Path) -> None:
    target = tmp_path / "map.png"
    target.write_bytes(b"precious")
    warpspace("snapshot", "dvf5000_first", "-o", target, *SMALL).refused("map.png", "--force")
    assert target.read_bytes() == b"precious"
    result = warpspace("snapshot", "dvf5000_first", "-o", target, "--force", *SMALL)
    assert result.status == 0
    assert target.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("options", "fragments"),
    [
        (("--size", "0x0"), ("0x0", "400x300")),
        (("--size", "100000x100000"), ("100000x100000", "12000")),
        (("--size", "big"), ("'big'", "WIDTHxHEIGHT")),
        (("--exaggeration", "nan"), ("nan",)),
        (("--exaggeration", "0"), ("exaggeration 0",)),
        (("--exaggeration", "lots"), ("lots", "auto")),
        (("--component", "w"), ("'w'", "norm")),
        (("--view", "left"), ("'left'", "iso")),
        (("--grid", "1"), ("1 nodes", "2 to 101")),
        (("--grid", "1000"), ("1000 nodes",)),
        (("--loop", "none"), ("'none'", "tool")),
        (("--figure", "slizes"), ("'slizes'", "did you mean 'slices'")),
        (("--figure", "comparison"), ("compare A B",)),
    ],
)
def test_bad_options(
    warpspace: Command, tmp_path: Path, options: tuple[str, str], fragments: tuple[str, ...]
) -> None:
    target = tmp_path / "map.png"
    warpspace("snapshot", "dvf5000_first", "-o", target, *options).refused(*fragments)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["map.gif", "map", "no/such/folder/map.png", "."])
def test_bad_targets(warpspace: Command, tmp_path: Path, name: str) -> None:
    warpspace("snapshot", "dvf5000_first", "-o", tmp_path / name).refused(str(tmp_path))
    assert not list(tmp_path.iterdir())


def test_compare_prints_statistics(warpspace: Command) -> None:
    result = warpspace("compare", "dvf5000_first", "dvf5000_second", "--grid", "11", "--json")
    assert result.status == 0
    found = json.loads(result.out)
    assert set(found) == {"a", "b", "difference", "change", "statistics_nodes"}
    assert found["statistics_nodes"]["a"]["mean_um"] == pytest.approx(31.66, abs=0.02)
    assert found["statistics_nodes"]["b"]["mean_um"] == pytest.approx(14.58, abs=0.02)
    # trapezoidal rule over the nodes, by numpy.trapezoid along each axis
    assert found["a"]["mean_um"] == pytest.approx(30.9465, abs=1e-4)
    assert found["b"]["mean_um"] == pytest.approx(14.5584, abs=1e-4)
    keys = {"mean_um", "rms_um", "p95_um", "max_um", "max_at_mm", "max_at_axes"}
    assert set(found["difference"]) == keys
    for key, change in found["change"].items():
        assert change == pytest.approx(found["b"][key] - found["a"][key])
    text = warpspace("compare", "dvf5000_first", "dvf5000_first")
    head = next(line for line in text.out.splitlines() if "B − A" in line)
    assert head.split()[-3:] == ["|E_B", "−", "E_A|"]
    row = next(line for line in text.out.splitlines() if line.strip().startswith("mean"))
    assert row.split() == ["mean", "30.89", "30.89", "+0.00", "0.00"]


def test_compare_refuses_different_volumes(warpspace: Command, tmp_path: Path) -> None:
    other = tmp_path / "other.toml"
    other.write_text('title="o"\nmachine="dvf5000"\n[workspace]\nX=[0,9]\nY=[0,9]\nZ=[-9,0]\n')
    warpspace("compare", "dvf5000_first", other).refused("working volumes differ")


@pytest.mark.render
@pytest.mark.usefixtures("renderer")
def test_compare_draws_both(warpspace: Command, tmp_path: Path) -> None:
    target = tmp_path / "both.png"
    result = warpspace("compare", "dvf5000_first", "dvf5000_second", "-o", target, *SMALL)
    assert result.status == 0, result.err
    assert target.read_bytes().startswith(b"\x89PNG")
