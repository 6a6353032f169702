"""The commands gains, montecarlo, contributions, ballbar, measured and thesis."""

import pytest

from products import pairwise

FORMATS = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}
PLOTS = {
    "gains": ("gains", "dvf5000_general", "--at", "Y=-225,Z=-480"),
    "gains over the travel": ("gains", "dvf5000_general", "--loop", "workpiece", "--max"),
    "montecarlo": ("montecarlo", "dvf5000_general", "--samples", "2000", "--spec-um", "50"),
    "contributions": ("contributions", "dvf5000_general"),
    "sobol": ("contributions", "dvf5000_proposed", "--sobol", "64"),
    "ballbar": ("ballbar", "dvf5000_first", "--plane", "YZ", "--radius", "150"),
    "ballbar without errors": ("ballbar", "dvf5000_nominal", "--plane", "XY", "--radius", "50"),
}


@pytest.mark.parametrize(("plot", "ending"), pairwise([*PLOTS], [*FORMATS]))
def test_plots_are_written_twice_alike(warpspace, tmp_path, plot, ending):
    files = [tmp_path / f"{run}{ending}" for run in "ab"]
    for file in files:
        result = warpspace(*PLOTS[plot], "--plot", file)
        assert (result.status, result.err) == (0, "")
    first, second = (file.read_bytes() for file in files)
    assert first.startswith(FORMATS[ending])
    assert first == second
    assert len(first) > 3000
    assert {file.name for file in tmp_path.iterdir()} == {file.name for file in files}
