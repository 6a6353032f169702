"""The command calibrate."""

import itertools
import json
import re

import pytest

from warpspace.scene.library import load_scene

TCP = ("calibrate", "fork_head_bc", "--data", "tcp_on.csv", "--kind", "sphere-tcp")


def test_calibrated_scene_opens_and_leaves_what_was_promised(warpspace, tmp_path):
    target = tmp_path / "fitted.toml"
    found = json.loads(warpspace(*TCP, "-o", target, "--json").out)
    scene = load_scene(str(target))
    assert scene.title == "Fork head B-C, a real machine, calibrated"
    for one in found["parameters"]:
        assert scene.errors.amplitude(one["key"]) == pytest.approx(one["value"])
    again = json.loads(warpspace("calibrate", target, "--data", "tcp_on.csv", "--json").out)
    assert again["rms_before_mm"] == pytest.approx(found["rms_after_mm"])
    warpspace(*TCP, "-o", target).refused("fitted.toml", "exists")


AT = tuple(
    word
    for a, c, x in itertools.product((-90, -30, 30), (0, 100, 260), (-200, 200))
    for word in ("--at", f"X={x},Y={x / 2 + a},Z={-200 + a - c / 4},A={a},C={c}")
)


def test_what_field_writes_is_read_in_its_own_frame(warpspace, tmp_path):
    """Trunnion A-C: the same errors out of R, out of the workpiece frame, out of JSON."""
    nominal, found = tmp_path / "nominal.toml", []
    nominal.write_text('machine = "trunnion_ac"\n', encoding="utf-8")
    errors = "EC0Y = 25\nEB0A = -30\nEX0C = 12\n"
    scene = tmp_path / "scene.toml"
    scene.write_text(f'machine = "trunnion_ac"\n[errors]\n{errors}', encoding="utf-8")
    relative = ("field", scene, *AT, "--loop", "relative", "--exact")
    fit = ("calibrate", nominal, "--fit", "EC0Y,EB0A,EX0C", "--json", "--data")
    for frame in ("machine", "workpiece"):
        table, printed = tmp_path / f"{frame}.csv", tmp_path / f"{frame}.json"
        out = warpspace(*relative, "--frame", frame, "--csv", table, "--json").out
        printed.write_text(out, encoding="utf-8")
        found += [json.loads(warpspace(*fit, path).out) for path in (table, printed)]
    for one in found:
        values = [row["value"] for row in one["parameters"]]
        assert values == pytest.approx([25.0, -30.0, 12.0], rel=1e-6)
        assert not any("frame" in note for note in one["notes"])
    # a table that does not say its frame
    bare, text = tmp_path / "bare.csv", (tmp_path / "machine.csv").read_text(encoding="utf-8")
    bare.write_text(re.sub("error_relative_R_(.)_um", r"e\1_um", text), encoding="utf-8")
    wrong = json.loads(warpspace(*fit, bare).out)
    assert wrong["rms_after_mm"] > 5e-3
    (note,) = (note for note in wrong["notes"] if "likely wrong" in note)
    assert f"{1e3 * wrong['rms_after_mm']:.3g} µm" in note
    assert "--frame machine" in note
    right = json.loads(warpspace(*fit, bare, "--frame", "machine").out)
    assert right["rms_after_mm"] < 1e-8
    assert not any("frame" in note for note in right["notes"])
    # what contradicts itself, and what is no relative error
    warpspace(*fit, tmp_path / "machine.csv", "--frame", "workpiece").refused("machine frame")
    warpspace("field", scene, *AT, "--csv", tmp_path / "tool.csv")
    warpspace(*fit, tmp_path / "tool.csv").refused("error_tool_r_x_um", "--loop relative")
    placed = warpspace(*relative, "--placed", "--csv", tmp_path / "placed.csv", "--json").out
    (tmp_path / "placed.json").write_text(placed, encoding="utf-8")
    for name in ("placed.csv", "placed.json"):
        warpspace(*fit, tmp_path / name).refused("error_relative_placed_r", "--kind tracker")
        read = json.loads(warpspace(*fit, tmp_path / name, "--kind", "tracker").out)
        assert [row["value"] for row in read["parameters"] if row["told"] == "yes"] == (
            pytest.approx([25.0, -30.0, 12.0], rel=1e-3)
        )
    held = scene.read_text(encoding="utf-8") + "[view]\nreference = { X = 0, Y = 0, Z = -100 }\n"
    scene.write_text(held, encoding="utf-8")
    warpspace(*relative, "--csv", tmp_path / "held.csv")
    warpspace(*fit, tmp_path / "held.csv").refused("error_relative_referenced_r")
    warpspace(*TCP, "--frame", "machine").refused("--frame", "no file holds error vectors")
