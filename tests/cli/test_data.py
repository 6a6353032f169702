"""Measured data on the command line: the commands test, calibrate and import."""

import csv
import itertools
import re
import struct

import numpy as np
import pytest
import trimesh

from warpspace.scene.library import load_scene

RUNS = "run,direction,target_mm,deviation_um\n" + "".join(
    f"{run},{sign},{target},{target / 100 + (0.5 if sign == '-' else 0.0) + 0.1 * run}\n"
    for run in (1, 2, 3) for sign in "+-" for target in (-200, -100, 0, 100, 200)
)  # fmt: skip


def test_json_of_positioning_data_has_the_keys_of_the_contract(warpspace, tmp_path):
    data = tmp_path / "runs.csv"
    data.write_text(RUNS, encoding="utf-8")
    found = warpspace("test", "positioning", "dvf5000_first", "--data", data, "--json").json
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
    assert "measured" in warpspace(*arguments).out
    assert "forward, measured" in plot.read_text("utf-8")


def test_readings_in_another_unit_are_said(warpspace, tmp_path):
    data = tmp_path / "circle.csv"
    rows = "".join(f"{angle},{(angle % 7) * 1000.0}\n" for angle in range(0, 360, 5))
    data.write_text("angle_deg,radial_um\n" + rows, encoding="utf-8")
    run = warpspace("test", "circular", "dvf5000_first", "--data", data, "--json")
    assert run.status == 0
    assert "are they in nm?" in run.err
    assert run.json["notes"]


TCP = ("calibrate", "fork_head_bc", "--data", "tcp_on.csv", "--kind", "sphere-tcp")


def test_calibrated_scene_opens_and_leaves_what_was_promised(warpspace, tmp_path):
    target = tmp_path / "fitted.toml"
    found = warpspace(*TCP, "-o", target, "--json").json
    scene = load_scene(str(target))
    assert scene.title == "Fork head B-C, a real machine, calibrated"
    for one in found["parameters"]:
        assert scene.errors.amplitude(one["key"]) == pytest.approx(one["value"])
    again = warpspace("calibrate", target, "--data", "tcp_on.csv", "--json").json
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
        found += [warpspace(*fit, path).json for path in (table, printed)]
    for one in found:
        values = [row["value"] for row in one["parameters"]]
        assert values == pytest.approx([25.0, -30.0, 12.0], rel=1e-6)
        assert not any("frame" in note for note in one["notes"])
    # a table that does not say its frame
    bare, text = tmp_path / "bare.csv", (tmp_path / "machine.csv").read_text(encoding="utf-8")
    bare.write_text(re.sub("error_relative_R_(.)_um", r"e\1_um", text), encoding="utf-8")
    wrong = warpspace(*fit, bare).json
    assert wrong["rms_after_mm"] > 5e-3
    (note,) = (note for note in wrong["notes"] if "likely wrong" in note)
    assert f"{1e3 * wrong['rms_after_mm']:.3g} µm" in note
    assert "expected the machine frame" in note
    right = warpspace(*fit, bare, "--frame", "machine").json
    assert right["rms_after_mm"] < 1e-8
    assert not any("frame" in note for note in right["notes"])
    # what contradicts itself, and what is no relative error
    warpspace(*fit, tmp_path / "machine.csv", "--frame", "workpiece").refused("machine frame")
    warpspace("field", scene, *AT, "--loop", "tool", "--csv", tmp_path / "tool.csv")
    expected = "expected errors in the relative loop"
    warpspace(*fit, tmp_path / "tool.csv").refused("error_tool_r_x_um", expected)
    placed = warpspace(*relative, "--placed", "--csv", tmp_path / "placed.csv", "--json").out
    (tmp_path / "placed.json").write_text(placed, encoding="utf-8")
    for name in ("placed.csv", "placed.json"):
        warpspace(*fit, tmp_path / name).refused("error_relative_placed_r", "kind tracker")
        read = warpspace(*fit, tmp_path / name, "--kind", "tracker").json
        assert [row["value"] for row in read["parameters"] if row["estimable"] == "yes"] == (
            pytest.approx([25.0, -30.0, 12.0], rel=1e-3)
        )
    held = scene.read_text(encoding="utf-8") + "[view]\nreference = { X = 0, Y = 0, Z = -100 }\n"
    scene.write_text(held, encoding="utf-8")
    warpspace(*relative, "--csv", tmp_path / "held.csv")
    warpspace(*fit, tmp_path / "held.csv").refused("error_relative_referenced_r")


SCENE = """machine = "dvf5000"
[workspace]
X = [-275, 275]
[errors]
EYX = { forward = { ramp = 2 }, backward = 1 }
EC0Y = 20
[uncertainty]
EYX = 0.5
"""


def test_fields_have_a_direction_and_an_uncertainty(warpspace, tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(SCENE)
    field = ("field", path, "--at", "X=275", "--json")
    (point,) = warpspace(*field, "--direction", "difference").json["points"]
    assert point["error_um"] == pytest.approx([0.0, 1.0, 0.0])
    told = warpspace(*field).json  # of EC0Y nothing is stated
    assert (told["unknown"], "u95_um" in told["points"][0]) == (["EC0Y"], False)
    path.write_text(SCENE.replace("EC0Y = 20\n", ""))
    (point,) = warpspace(*field).json["points"]
    assert point["u95_um"] == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)
    table = tmp_path / "points.csv"
    result = warpspace("field", path, "--grid", "3", "--json", "--csv", table)
    assert all(point["u95_norm_um"] == pytest.approx(1.0) for point in result.json["points"])
    rows = csv.DictReader(table.read_text("utf-8").splitlines())
    assert {float(row["u95_R_y_um"]) for row in rows} == {1.0}
    table = tmp_path / "f.csv"
    warpspace("export", str(path), "-o", str(table), "--grid", "2", "--direction", "difference")
    assert "reversal: forward − backward" in table.read_text("utf-8")


def test_a_table_that_is_cut_says_so(warpspace, tmp_path, monkeypatch):
    monkeypatch.setattr("warpspace.analysis.commands.convert.MAX_SHOWN", 2)
    wishes = ("--to", "component_errors=before_motion", "--to", "squareness=over_90")
    found = warpspace("convert", "dvf5000_first", *wishes, "-o", tmp_path / "a.toml", "--json")
    count = len(found.json["changed"])
    printed = warpspace("convert", "dvf5000_first", *wishes, "-o", tmp_path / "b.toml").out
    assert count > 2
    assert f"and {count - 2} more, all in the JSON output" in printed


ROBOT = """<robot name="mill"><link name="base"><visual><geometry><box size="1 1 0.1"/></geometry>
</visual></link><link name="tool"><visual><geometry><mesh filename="package://mill/{mesh}"
scale="0.001 0.001 0.001"/></geometry></visual></link><joint name="slide" type="prismatic">
<parent link="base"/><child link="tool"/><axis xyz="0 0 1"/><origin xyz="0 0 0.5"/>
<limit lower="-0.2" upper="0.1" effort="1" velocity="1"/></joint></robot>"""


def test_a_machine_goes_out_and_comes_back(warpspace, tmp_path):
    robot, back = tmp_path / "dvf.urdf", tmp_path / "back.toml"
    result = warpspace("export", "dvf5000_first", "-o", robot, "--grid", "3")
    assert result.status == 0, result.err
    assert "a URDF file holds the nominal machine only" in " ".join(result.out.split())
    result = warpspace("import", robot, "-o", back)
    assert result.status == 0, result.err
    assert "wCBFXYZt, 5 axes" in result.out
    own, found = load_scene("dvf5000_first").machine, load_scene(back).machine
    for name, axis in own.axes.items():
        assert found.axes[name].offset_mm == pytest.approx(axis.offset_mm, abs=1e-9)
        assert found.axes[name].travel == pytest.approx(axis.travel, abs=1e-9)
    saddle = trimesh.load(tmp_path / "back_X.stl", force="mesh")
    written = trimesh.load(tmp_path / "dvf_X.stl", force="mesh")
    assert saddle.bounds == pytest.approx(written.bounds, abs=1e-3)
    before = back.read_bytes()
    warpspace("import", robot, "-o", back).refused("--force")
    assert back.read_bytes() == before


def test_meshes_come_in_millimetres_and_missing_ones_are_named(warpspace, tmp_path):
    trimesh.creation.box(extents=(20.0, 30.0, 40.0)).export(tmp_path / "tool.stl")
    robot = tmp_path / "mill.urdf"
    robot.write_text(ROBOT.format(mesh="tool.stl"), encoding="utf-8")
    result = warpspace("import", robot, "-o", tmp_path / "mill.toml")
    assert result.status == 0, result.err
    assert "joint 'slide' is axis Z" in result.out
    mesh = trimesh.load(tmp_path / "mill_Z.stl", force="mesh")
    assert mesh.extents == pytest.approx([20.0, 30.0, 40.0], abs=1e-3)
    base = trimesh.load(tmp_path / "mill_R.stl", force="mesh")
    assert base.extents == pytest.approx([1000.0, 1000.0, 100.0], abs=1e-2)
    scene = load_scene(tmp_path / "mill.toml")
    assert scene.machine.axes["Z"].travel == (-200.0, 100.0)
    assert not list(scene.errors)
    robot.write_text(ROBOT.format(mesh="gone.stl"), encoding="utf-8")
    result = warpspace("import", robot, "-o", tmp_path / "other.toml")
    assert "mesh 'package://mill/gone.stl' is missing" in " ".join(result.out.split())
    assert "gone.stl" in (tmp_path / "other.toml").read_text(encoding="utf-8")


def test_a_mesh_that_is_read_is_never_replaced(warpspace, tmp_path):
    trimesh.creation.box(extents=(20.0, 30.0, 40.0)).export(tmp_path / "mill_Z.stl")
    before = (tmp_path / "mill_Z.stl").read_bytes()
    robot = tmp_path / "mill.urdf"
    robot.write_text(ROBOT.format(mesh="mill_Z.stl"), encoding="utf-8")
    warpspace("import", robot, "-o", tmp_path / "mill.toml", "--force").refused(
        "is an input of its own output"
    )
    assert (tmp_path / "mill_Z.stl").read_bytes() == before
    assert not (tmp_path / "mill.toml").exists()


def test_an_export_never_replaces_a_mesh_of_its_scene(warpspace, tmp_path):
    mesh = tmp_path / "mill_Z.stl"
    trimesh.creation.box(extents=(20.0, 30.0, 40.0)).export(mesh)
    before, scene = mesh.read_bytes(), tmp_path / "own.toml"
    assert warpspace("new-machine", "wFXZt", "-o", scene).status == 0
    scene.write_text(f'{scene.read_text(encoding="utf-8")}\n[bodies]\nZ = "mill_Z.stl"\n', "utf-8")
    robot = tmp_path / "mill.urdf"
    warpspace("export", scene, "-o", robot, "--grid", "3", "--force").refused(
        "is an input of its own output"
    )
    assert mesh.read_bytes() == before
    assert {file.name for file in tmp_path.iterdir()} == {"own.toml", "mill_Z.stl"}
    assert warpspace("export", scene, "-o", tmp_path / "other.urdf", "--grid", "3").status == 0


def test_meshes_stay_within_the_folder_of_the_robot_or_that_of_the_option(warpspace, tmp_path):
    package = tmp_path / "mill"
    (package / "urdf").mkdir(parents=True)
    (package / "meshes").mkdir()
    outside = tmp_path / "other.stl"
    for file in (outside, package / "meshes" / "a.stl"):
        trimesh.creation.box(extents=(20.0, 30.0, 40.0)).export(file)
    (package / "urdf" / "link.stl").symlink_to(outside)
    robot = package / "urdf" / "mill.urdf"
    names = ("meshes/a.stl", "../../other.stl", "urdf/link.stl")
    for inside, (name, root) in enumerate((name, root) for root in (0, 1) for name in names):
        robot.write_text(ROBOT.format(mesh=name), encoding="utf-8")
        option = ("--mesh-root", package) if root else ()
        target = tmp_path / f"made{inside}.toml"
        result = warpspace("import", robot, "-o", target, *option)
        assert result.status == 0, result.err
        is_read = bool(root) and name == "meshes/a.stl"
        assert target.with_name(f"made{inside}_Z.stl").exists() == is_read, (name, root, result.out)
    for name in (outside, f"file://{outside}", "../../other.stl", "link.stl"):
        robot.write_text(ROBOT.replace("package://mill/", "").format(mesh=name), encoding="utf-8")
        result = warpspace("import", robot, "-o", tmp_path / "last.toml", "--force")
        assert "leads out of" in " ".join(result.out.split())
        assert not (tmp_path / "last_Z.stl").exists()


@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_a_mesh_of_a_robot_with_a_vertex_that_is_not_finite_is_left_out(
    warpspace, tmp_path, number
):
    box = bytearray(trimesh.creation.box(extents=(20.0, 30.0, 40.0)).export(file_type="stl"))
    struct.pack_into("<f", box, 84 + 12, number)
    (tmp_path / "a.stl").write_bytes(box)
    robot = tmp_path / "mill.urdf"
    robot.write_text(ROBOT.replace("package://mill/", "").format(mesh="a.stl"), encoding="utf-8")
    result = warpspace("import", robot, "-o", tmp_path / "made.toml")
    assert "not finite; left out" in " ".join(result.out.split())
    assert (result.status, result.err) == (0, "")
    assert not (tmp_path / "made_Z.stl").exists()


@pytest.mark.parametrize(("name", "flag"), [("allocate", "--limit"), ("convert", "--to")])
def test_a_report_refuses_an_appendix_that_needs_options(warpspace, tmp_path, name, flag):
    report = ("report", "dvf5000_nominal", "--grid", "3", "-o", tmp_path / "r.html", "--with")
    warpspace(*report, name).refused(f"--with {name}: needs {flag}; run `warpspace {name}` instead")
    assert not [*tmp_path.iterdir()]
