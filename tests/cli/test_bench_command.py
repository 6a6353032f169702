"""The command `test`: keys of the contract, data beside the model, refusals that leave nothing."""

import json

import pytest

RUNS = "run,direction,target_mm,deviation_um\n" + "".join(
    f"{run},{sign},{target},{target / 100 + (0.5 if sign == '-' else 0.0) + 0.1 * run}\n"
    for run in (1, 2, 3) for sign in "+-" for target in (-200, -100, 0, 100, 200)
)  # fmt: skip


def test_json_of_positioning_data_has_the_keys_of_the_contract(warpspace, tmp_path):
    data = tmp_path / "runs.csv"
    data.write_text(RUNS, encoding="utf-8")
    found = json.loads(
        warpspace("test", "positioning", "dvf5000_first", "--data", data, "--json").out
    )
    for key in ("A_um", "E_um", "M_um", "R_um", "B_um"):
        assert isinstance(found[key], float)
    for way in ("forward", "backward"):
        assert {f"A_{way}_um", f"E_{way}_um", f"R_{way}_um"} <= found.keys()
    assert found["of"] == "measured"
    assert found["B_um"] == pytest.approx(0.5)
    assert found["M_um"] == pytest.approx(4.0)
    assert found["model"]["E_um"] == pytest.approx(0.0, abs=1e-6)
    assert 1.0 < found["rms_difference"] < 1.5  # a slope of 1 µm in 100 mm; the zero is free


def test_figure_with_data_over_the_model(warpspace, tmp_path):
    data, plot = tmp_path / "runs.csv", tmp_path / "plot.svg"
    data.write_text(RUNS, encoding="utf-8")
    arguments = ("test", "positioning", "dvf5000_first", "--data", data, "--plot", plot)
    out = warpspace(*arguments).out
    assert "measured" in out
    text = plot.read_text("utf-8")
    assert "forward, measured" in text
    warpspace(*arguments).refused("exists already")
    plot.unlink()
    data.write_text(RUNS.replace("0.6", "nan"), encoding="utf-8")
    warpspace(*arguments).refused(str(data), "expected a finite number")
    assert not plot.exists()
    warpspace("test", "positioning", "dvf5000_first", "--data", plot).refused("no such file")


def test_readings_in_another_unit_are_said(warpspace, tmp_path):
    data = tmp_path / "circle.csv"
    rows = "".join(f"{angle},{(angle % 7) * 1000.0}\n" for angle in range(0, 360, 5))
    data.write_text("angle_deg,radial_um\n" + rows, encoding="utf-8")
    run = warpspace("test", "circular", "dvf5000_first", "--data", data, "--json")
    assert run.status == 0
    assert "are they in nm?" in run.err
    assert json.loads(run.out)["notes"]
