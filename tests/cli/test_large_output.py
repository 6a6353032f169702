"""What a fine grid prints or writes takes little memory, or is refused with its size."""

import json
from pathlib import Path

import numpy as np

from warpspace import evaluate, load_scene
from warpspace.cli.commands.field import POINTS_AT_ONCE
from warpspace.cli.options import spell_json


def test_json_that_is_printed_in_pieces_is_one_object_with_every_point(warpspace) -> None:
    grid = 23
    assert grid**3 > 2 * POINTS_AT_ONCE
    result = warpspace("field", "dvf5000_first", "--grid", grid, "--json")
    assert result.status == 0, result.err
    assert result.out.count("\n") == 1
    found = json.loads(result.out)
    assert set(found) == {"points", "statistics", "statistics_nodes"}
    errors = np.array([point["error_um"] for point in found["points"]])
    expected = evaluate(load_scene("dvf5000_first"), grid=grid).error_um.reshape(-1, 3)
    np.testing.assert_array_equal(errors, expected)


def test_json_is_never_held_as_a_whole(monkeypatch, warpspace) -> None:
    """A grid of 101 took 2.2 GB."""
    lengths: list[int] = []

    def count(value: object) -> str:
        lengths.append(len(value))
        return spell_json(value)

    monkeypatch.setattr("warpspace.cli.commands.field.spell_json", count)
    assert warpspace("field", "dvf5000_first", "--grid", 23, "--json").status == 0
    assert sum(lengths[:-2]) == 23**3
    assert max(lengths) <= POINTS_AT_ONCE


def test_page_of_a_fine_grid_is_refused_with_its_size(tmp_path: Path, warpspace) -> None:
    """A grid of 101 took 2.1 GB."""
    result = warpspace("export", "dvf5000_first", "-o", tmp_path / "x.html", "--grid", 75)
    result.refused(
        "grid 75: the page needs about 0.8 GB of memory", "expected at most 0.6 GB", "--grid "
    )
    assert not list(tmp_path.iterdir())
