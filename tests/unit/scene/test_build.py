"""From text to a scene: defaults, spans, references, and machines of one's own."""

from pathlib import Path

import numpy as np
import pytest

from warpspace.exceptions import SceneError
from warpspace.field.grid import build_grid
from warpspace.kinematics.model import ComponentErrors
from warpspace.machine.errors import Constant, Harmonics, Poly, Ramp, Table
from warpspace.machine.tolerances import Tolerance
from warpspace.scene.library import parse_scene
from warpspace.scene.pipeline import evaluate
from warpspace.scene.save import scene_to_toml

DVF = 'machine = "dvf5000"\n'


def test_everything_but_the_machine_has_a_default() -> None:
    scene = parse_scene(DVF, "bare")
    assert (scene.name, scene.title, scene.description) == ("bare", "bare", "")
    assert scene.workspace.ranges["X"] == (-275.0, 275.0)
    assert scene.workspace.ranges["Z"] == (-480.0, 0.0)
    assert scene.workspace.ranges["B"] == scene.workspace.ranges["C"] == (0.0, 0.0)
    assert scene.model.component_errors == ComponentErrors.AFTER_MOTION
    assert (scene.exaggeration, scene.reference) == (None, None)
    assert list(scene.errors) == []
    assert not scene.tolerances


def test_every_kind_of_error_function_is_built(tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text("q,yaw,pitch\n-275,1,-4\n275,2,6\n", encoding="utf-8")
    text = DVF + (
        "[workspace]\nZ = [-480, -80]\n[errors]\nEXX = 3\nEAZ = { ramp = -22.5 }\n"
        "EYX = { poly = [0, 0.02] }\nEXC = { harmonics = [[1, 3, 90]] }\n"
        "EZX = { table = [[-275, 0], [275, 4.1]] }\n"
        'EBX = { csv = "m.csv", column = "pitch" }\n'
    )
    functions = parse_scene(text, "all", folder=tmp_path).errors.functions
    travel, turn = (-275.0, 275.0), (0.0, 360.0)
    assert functions["EXX"] == Constant(travel, 3.0)
    assert functions["EAZ"] == Ramp((-480.0, -80.0), -22.5)
    assert functions["EYX"] == Poly(travel, (0, 0.02))
    assert functions["EXC"] == Harmonics(turn, ((1, 3, 90),))
    assert functions["EZX"] == Table(travel, ((-275, 0), (275, 4.1)))
    assert functions["EBX"] == Table(travel, ((-275.0, -4.0), (275.0, 6.0)))


def test_ramp_runs_over_the_travel_where_the_axis_stands_still() -> None:
    scene = parse_scene(DVF + "[workspace]\nZ = -100\n[errors]\nEAZ = { ramp = 8 }\n", "x")
    assert scene.errors.evaluate("EAZ", np.array([-480.0, 0.0])).tolist() == [0.0, 8.0]


def test_csv_is_refused_where_there_is_no_folder() -> None:
    text = DVF + '[errors]\nEBX = { csv = "/etc/hostname", column = "pitch" }\n'
    with pytest.raises(SceneError, match="CSV files are not read here"):
        parse_scene(text, "upload")


@pytest.mark.parametrize("chain", ["wXYZABCFt", "wFXYZABCt", "wBFt", "(w)C'Y-b X Z (t)"])
def test_machine_of_any_chain_can_stand_in_the_scene(chain: str) -> None:
    scene = parse_scene(f'[machine]\nchain = "{chain}"\ntitle = "Mine"\n', "mine")
    assert scene.machine.title == "Mine"
    assert set(scene.workspace.ranges) == set(scene.machine.axes)


def test_own_machine_takes_offsets_travels_and_directions() -> None:
    text = (
        '[machine]\nchain = "wCFXt"\noffset_mm.X = [1, 2, 3]\noffset_mm.t = [0, 0, -9]\n'
        "travel.X = [0, 800]\ndirection.C = -1\n"
    )
    machine = parse_scene(text, "mine").machine
    assert machine.axis("X").offset_mm == (1, 2, 3)
    assert machine.axis("X").travel == (0, 800)
    assert machine.axis("C").direction == -1
    assert machine.end_frames("tool")[1][1] == (0, 0, -9)


def test_constant_beyond_the_default_ones_becomes_a_parameter_of_the_scene() -> None:
    free = '[convention]\nreference_axis = "free"\n[errors]\nEC0X = 5\n[tolerances]\nEY0X = 3\n'
    scene = parse_scene(DVF + free, "x")
    assert len(scene.parameter_keys) == 43
    assert {"EC0X", "EY0X"} < set(scene.parameter_keys)
    assert parse_scene(scene_to_toml(scene), "x") == scene


def test_rotation_of_the_reference_axis_is_taken_for_a_slip() -> None:
    with pytest.raises(SceneError, match=r"EC0X = 5: .* did you mean 'EC0Y'.*reference_axis"):
        parse_scene(DVF + "[errors]\nEC0X = 5\nEX0X = 1\n", "x")


def test_tolerances_are_a_half_width_or_a_range() -> None:
    text = DVF + "[tolerances]\ndefault = { rotation = 20 }\nEXB = 5\nEAX = { centre = -8, "
    tolerances = parse_scene(text + "half_width = 6 }\n", "x").tolerances
    assert tolerances.own == {"EXB": Tolerance(0.0, 5.0), "EAX": Tolerance(-8.0, 6.0)}
    assert tolerances.default == {"rotation": 20.0}


def test_reference_is_a_point_even_where_the_scene_names_one_axis() -> None:
    scene = parse_scene(DVF + "[view]\nreference = { Y = 100 }\nexaggeration = 2000\n", "x")
    assert scene.reference == {"X": 0.0, "Y": 100.0, "Z": -240.0}
    assert scene.exaggeration == 2000.0


def test_unusable_machine_does_not_hide_the_other_problems_nor_invent_any() -> None:
    text = (
        'machine = "dvf"\n[workspace]\nA = 5\nX = [0, 2000]\n'
        "[errors]\nEXX = { poly = [0, 0, 10] }\nEBA = 5\nEZZZ = 1\n"
    )
    with pytest.raises(SceneError) as caught:
        parse_scene(text, "x")
    assert [line.split(":")[0] for line in caught.value.problems] == [
        'machine = "dvf"',
        "errors.EZZZ",
    ]


def test_upload_is_called_by_its_name_in_messages() -> None:
    with pytest.raises(SceneError, match=r"^upload: machine: is missing"):
        parse_scene("", "upload")


def test_squareness_of_an_axis_that_carries_the_other_is_remarked_on() -> None:
    text = '[machine]\nchain = "{}"\n[errors]\nEC0Y = 5\n'
    (note,) = parse_scene(text.format("wFYXZt"), "x").notes
    assert "EC0Y turns X as well" in note
    for chain in ("wFXYZt", "wYFXZt", "wXFYZt"):
        assert parse_scene(text.format(chain), "x").notes == ()


NUTATING = """
title = "Two tables and a nutating head"
[machine]
chain = "wC2FXYZC1B1t"
[machine.offset_mm]
B1 = [0, 0, -100]
[machine.rotation_deg]
B1 = [45, 0, 0]
t = [0, 10, -20]
[convention]
component_errors = { linear = "after_motion", rotary = "before_motion", C1 = "after_motion" }
[workspace]
C1 = 30
[errors]
EXC1 = 5.0
EA0C2 = 20.0
EBB1 = { table = [[-90, 0.0], [90, 12.0]] }
"""


def test_repeated_letters_rotations_and_mixed_conventions_are_read_and_written() -> None:
    scene = parse_scene(NUTATING, "nutating")
    machine, model = scene.machine, scene.model
    assert machine.axis("B1").rotation_deg == (45.0, 0.0, 0.0)
    assert machine.end_frames("tool")[1] == ("t", (0.0, 0.0, 0.0), (0.0, 10.0, -20.0))
    names = {axis: model.convention(axis).name for axis in machine.axes}
    assert names == {
        **dict.fromkeys(("X", "Y", "Z", "C1"), "after_motion"),
        **dict.fromkeys(("B1", "C2"), "before_motion"),
    }
    again = parse_scene(scene_to_toml(scene), "nutating")
    assert again == scene


def test_a_rotated_head_points_where_its_rotation_says() -> None:
    """B at 45° about x: its axis is (0, 1, 1)/√2; half a turn about it turns the tool round."""
    scene = parse_scene(NUTATING.replace("t = [0, 10, -20]\n", ""), "nutating")
    at = {"X": 0.0, "Y": 0.0, "Z": 0.0, "C1": 0.0, "C2": 0.0, "B1": 0.0}
    tool = [
        evaluate(scene, at={**at, "B1": angle}, loop="tool").nominal_mm.reshape(3)
        for angle in (0.0, 180.0)
    ]
    assert tool[0] == pytest.approx(tool[1])  # the tool point lies in the pivot
    scene = parse_scene(NUTATING.replace("t = [0, 10, -20]", "").replace(
        "B1 = [0, 0, -100]", "B1 = [0, 0, -100]\nt = [0, 0, -100]"), "nutating")  # fmt: skip
    tool = [
        evaluate(scene, at={**at, "B1": angle}, loop="tool").nominal_mm.reshape(3)
        for angle in (0.0, 180.0)
    ]
    s = 100.0 / 2.0**0.5
    assert tool[0] == pytest.approx([0.0, s, -100.0 - s])
    assert tool[1] == pytest.approx([0.0, -s, -100.0 + s])


def test_rotary_axes_span_the_volume_of_a_robot() -> None:
    scene = parse_scene(
        'title = "r"\n[machine]\nchain = "wFZC1C2t"\n'
        "offset_mm = { C2 = [300, 0, 0], t = [250, 0, 0] }\n"
        "[workspace]\nZ = [0, 100]\nC1 = [-90, 90]\nC2 = [10, 150]\n[errors]\nECC1 = 50\n",
        "robot",
    )
    assert scene.workspace.volume_axes == ("C1", "C2", "Z")
    grid = build_grid(scene.model, scene.workspace, (7, 5, 3))
    assert grid.shape == (7, 5, 3)
    reach = np.hypot(grid.nominal_mm[..., 0], grid.nominal_mm[..., 1])
    assert reach[0, 0, 0] == pytest.approx(np.hypot(300 + 250 * np.cos(np.radians(10)),
                                                    250 * np.sin(np.radians(10))))  # fmt: skip
    assert evaluate(scene, grid=5).norm_um.max() == pytest.approx(0.05 * reach.max())


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ("C1 = 30", None),
        ("C1 = [0, 30]", "expected one position in degrees for a rotary axis"),
        ("C9 = 30", "unknown axis of this machine"),
    ],
)
def test_ranges_that_are_too_many_are_named(change: str, problem: str | None) -> None:
    text = NUTATING.replace("C1 = 30", change)
    if problem is None:
        parse_scene(text, "n")
        return
    with pytest.raises(SceneError, match=problem):
        parse_scene(text, "n")


def test_two_ranges_along_one_direction_are_refused() -> None:
    text = 'title = "z"\n[machine]\nchain = "wFXYZWt"\n[workspace]\nZ = [0, 9]\nW = [0, 5]\n'
    with pytest.raises(SceneError, match=r"workspace\.W.*W has a range beside Z; expected one pos"):
        parse_scene(text, "z")
    scene = parse_scene(text.replace("W = [0, 5]\n", ""), "z")
    assert scene.workspace.ranges["W"] == (0.0, 0.0)


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("B1 = [45, 0, 0]", 'B1 = "x"', r"machine.rotation_deg.B1 = \"x\": expected \[x, y, z\]"),
        ("B1 = [45, 0, 0]", "B1 = [45, 0, 999]", "rotation_deg.B1.*expected at most 360"),
        ("B1 = [45, 0, 0]", "B7 = [45, 0, 0]", "rotation_deg.B7: unknown frame of this machine"),
        ('C1 = "after_motion"', 'C9 = "after_motion"', "component_errors.C9: unknown kind or axis"),
        ('C1 = "after_motion"', 'C1 = "during"', "component_errors.C1.*expected \"after_motion\""),
    ],
)  # fmt: skip
def test_bad_rotations_and_conventions_are_named(old: str, new: str, problem: str) -> None:
    with pytest.raises(SceneError, match=problem):
        parse_scene(NUTATING.replace(old, new), "n")


def test_messages_name_axes_with_a_digit() -> None:
    text = 'title = "d"\n[machine]\nchain = "wFX1Yt"\n[errors]\nEA0X1 = 5.0\n'
    with pytest.raises(SceneError, match="X1 being the reference axis"):
        parse_scene(text, "d")
    text = 'title = "d"\n[machine]\nchain = "wFY1X1t"\n[errors]\nEC0Y1 = 5.0\n'
    (note,) = parse_scene(text, "d").notes
    assert note.startswith("errors.EC0Y1 turns X1 as well, which rides on Y1")


def test_a_rotation_of_zero_is_none() -> None:
    text = 'title = "z"\n[machine]\nchain = "wFXt"\nrotation_deg = { t = [0, 0, 0] }\n'
    scene = parse_scene(text, "z")
    assert scene.machine.fixed_deg == {}
    assert parse_scene(scene_to_toml(scene), "z") == scene
