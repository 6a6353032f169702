"""Commands `draw` and `compare`."""

import pytest

from products import first
from warpspace.outputs.figures import catalogue

SMALL = ("--size", "400x300", "--grid", "3")


def test_the_command_names_every_figure_of_one_scene(warpspace):
    words = warpspace("draw", "--help").out.replace(",", " ").replace(".", " ").split()
    assert set(catalogue.figure_names()) <= set(words)


@pytest.mark.render
@pytest.mark.usefixtures("renderer")
@pytest.mark.parametrize("ending", first("png", "svg", "pdf"))
def test_a_snapshot_is_written(warpspace, tmp_path, ending):
    target = tmp_path / f"map.{ending}"
    result = warpspace("draw", "dvf5000_first", "-o", target, *SMALL)
    assert result.status == 0, result.err
    assert target.stat().st_size > 5000
    assert list(tmp_path.iterdir()) == [target]
