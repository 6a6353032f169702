"""From text to a scene: defaults, spans, references, and machines of one's own."""

from pathlib import Path

import numpy as np
import pytest

from warpspace.exceptions import SceneError
from warpspace.kinematics.model import ComponentErrors
from warpspace.machine.errors import Constant, Harmonics, Poly, Ramp, Table
from warpspace.machine.tolerances import Tolerance
from warpspace.scene.library import parse_scene
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
    assert machine.end_offsets_mm("tool")[1] == (0, 0, -9)


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
