"""Frames and tilted planes: the tip on the workpiece against rotations worked out by hand."""

import numpy as np
import pytest

import warpspace
from warpspace.kinematics.chain import branch_pose, tool_axis
from warpspace.kinematics.transforms import axis_rotation, inverse, rotate
from warpspace.parts.gcode.control_settings import ControlSettings
from warpspace.parts.gcode.interpreter import read_program
from warpspace.parts.program import ToolPath, trace_program
from warpspace.scene.library import parse_scene
from warpspace.scene.model import Scene

LINEAR = "X = [-900, 900]\nY = [-900, 900]\nZ = [-900, 900]\n"


def machine(chain: str, direction: str = "") -> Scene:
    tilt = "B" if "B" in chain else "A"
    travel = f"{LINEAR}{tilt} = [-120, 120]\nC = [-360, 360]"
    text = f'title = "m"\n[machine]\nchain = "{chain}"\ndirection = {{{direction}}}\n'
    text += "[machine.offset_mm]\nC = [0, 0, 40]\n"
    return parse_scene(
        f"{text}[machine.travel]\n{travel}\n[workspace]\n{LINEAR}{tilt} = 0\nC = 0", chain
    )


MACHINES = {
    "table": machine("wCBFXYZt"),
    "ISO 841": machine("wCAFXYZt", "A = -1, C = -1"),
    "head": machine("wXYFZCBt", "X = -1, Y = -1"),
    "mixed": machine("wCFXYZBt"),
}


def trace(scene: Scene, text: str, **options) -> ToolPath:
    options = {"length_mm": 60.0, **options}
    program = read_program(scene, text.splitlines(), ControlSettings(**options))
    assert program.refused == {}, program.reasons
    return trace_program(program, 1e-4)


def ends(path: ToolPath, *lines: int) -> np.ndarray:
    return np.array([path.tip_mm[path.line == line][-1] for line in lines])


def zero(scene: Scene) -> np.ndarray:
    """Compute the tip at words and rotary axes zero."""
    return ends(trace(scene, "G43 H1 G0 X0 Y0 Z0"), 1)[0]


def euler(*rotations: tuple[str, float]) -> np.ndarray:
    product = np.eye(3)
    for axis, angle in rotations:
        product = product @ axis_rotation("XYZ".index(axis), np.deg2rad(angle))
    return product


PLANE = (
    "G0 X0 Y0 Z300 {0}0 C0\n{1}\n{2}\nG0 X0 Y0\n{3} Z20\nG1 Z-5\nX30 Y10\nG2 X50 Y30 I0 J20\nG1 Z40"
)
WORDS = np.array([[0, 0, 20], [0, 0, -5], [30, 10, -5], [50, 30, -5], [50, 30, 40.0]])


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("dialect", ["fanuc", "sinumerik"])
def test_the_tip_follows_a_tilted_plane(name: str, dialect: str):
    scene = MACHINES[name]
    if dialect == "fanuc":
        plane = "G68.2 X5 Y-3 Z12 I25 J20 K-70", "G53.1", "G43 H1"
        matrix = euler(("Z", 25), ("X", 20), ("Z", -70))
    else:
        plane = 'CYCLE800(0,"T",0,27,5,-3,12,10,-20,35,0,0,0,-1,0,1)', "G64", "D1"
        matrix = euler(("Z", 35), ("Y", -20), ("X", 10))
    text = PLANE.format("B" if "B" in scene.machine.axes else "A", *plane)
    path = trace(scene, text, dialect=dialect)
    expected = WORDS @ matrix.T + [5, -3, 12] + zero(scene)
    assert ends(path, 5, 6, 7, 8, 9) == pytest.approx(expected, abs=1e-8)
    centre = matrix @ [30, 30, -5] + [5, -3, 12] + zero(scene)
    arc = path.tip_mm[path.line == 8]
    assert np.linalg.norm(arc - centre, axis=1) == pytest.approx(20.0)
    assert (arc - centre) @ matrix[:, 2] == pytest.approx(0.0, abs=1e-8)
    at = {axis: values[-1:] for axis, values in path.coordinates.items()}
    pose = branch_pose(scene.model, "workpiece", at)
    axis = rotate(inverse(pose)[..., :3, :3], tool_axis(scene.model, at))[0]
    assert axis == pytest.approx(matrix[:, 2], abs=1e-9)


@pytest.mark.parametrize("name", MACHINES)
def test_a_tilted_plane_is_that_of_the_tool_centre_point(name: str):
    """A program with G43.4 at the same rotary axis positions, words rotated by hand."""
    scene, matrix = MACHINES[name], euler(("Z", 90), ("X", 30))
    tilt = "B" if "B" in scene.machine.axes else "A"
    start = f"G0 X0 Y0 Z300 {tilt}0 C0\n"
    plane = trace(scene, f"{start}G68.2 X0 Y0 Z0 I90 J30 K0\nG53.1\nG43 H1 G0 X4 Y5 Z6\nG1 X40")
    at = " ".join(f"{x}{plane.coordinates[x][-1]:.9f}" for x in (tilt, "C"))
    first, last = matrix @ [4, 5, 6], matrix @ [40, 5, 6]
    blocks = [f"G1 X{x:.9f} Y{y:.9f} Z{z:.9f}" for x, y, z in (first, last)]
    tcp = trace(scene, f"{start}G43.4 H1 {at}\n{blocks[0]}\n{blocks[1]}", tcp_frame="zero")
    assert ends(plane, 4, 5) == pytest.approx(ends(tcp, 3, 4), abs=1e-6)
    for axis in scene.machine.axes:
        assert plane.coordinates[axis][-1] == pytest.approx(tcp.coordinates[axis][-1], abs=1e-6)


def test_drilling_in_a_tilted_plane_without_length_compensation():
    scene, matrix = MACHINES["table"], euler(("X", 30))
    text = "G0 X0 Y0 Z300 B0 C0\nG68.2 X0 Y0 Z0 I0 J30 K0\nG53.1\n{}G81 X7 Y8 Z-10 R5\nG80\nG69"
    for words, depth in (("G0 X0 Y0\nG43 H1 Z50\n", -10.0), ("G0 X0 Y0\nZ50\n", -70.0)):
        path = trace(scene, text.format(words))
        lowest = path.tip_mm[((path.tip_mm - zero(scene)) @ matrix[:, 2]).argmin()]
        assert lowest == pytest.approx(matrix @ [7, 8, depth] + zero(scene), abs=1e-8)


def test_the_frame_of_a_turned_table():
    scene = warpspace.load_scene("machine_trunnion_ac")
    text = "G0 X0 Y0 Z0 A0 C90.\nG43.4 H1 Z-100.\nX50. Y0\nC180."
    for frame, ends_xy in (
        ("present", [(50, 0), (0, 50)]), ("auto", [(50, 0), (0, 50)]), ("zero", [(0, 50), (-50, 0)])
    ):  # fmt: skip
        path = trace(scene, text, offset=(("H1", 100.0),), tcp_frame=frame)
        for line, place in zip((3, 4), ends_xy, strict=True):
            at = [path.coordinates[x][path.line == line][-1] for x in "XY"]
            assert at == pytest.approx(place, abs=1e-9)


def test_a_dynamic_work_offset_follows_the_table():
    """A hole at G54 zero is reached with the table turned, words along the machine axes."""
    scene, offset = MACHINES["table"], (("G54X", 40.0), ("G54Y", -25.0), ("G54Z", 70.0))
    text = "G0 X0 Y0 Z90 B0 C0\nB30 C45\n{}\nG43 H1 G0 X0 Y0\nZ0\nG1 X3"
    path = trace(scene, text.format("G254"), dialect="haas", offset=offset)
    reference = trace(scene, "G43 H1 G0 X0 Y0 Z0", offset=offset)
    assert ends(path, 5)[0] == pytest.approx(ends(reference, 1)[0], abs=1e-9)
    x = path.coordinates["X"][path.line >= 5]
    assert x[-1] - x[0] == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("text", "places"),
    [
        ("TRANS X100 Y50\nG1 X0 Y0 Z0\nX10\nTRANS\nG0 X0 Y0", [[100, 50], [110, 50], [0, 0]]),
        ("TRANS X100 Y50\nAROT Z30\nG1 X20 Y0\nTRANS X1\nG0 X0 Y0",
         [[100 + 20 * np.cos(np.pi / 6), 60], [1, 0]]),
        ("ROT RPL=45\nG1 X10\nROT\nG0 X0 Y0", [[50**0.5, 50**0.5], [0, 0]]),
        ("MIRROR X0\nG1 X10 Y5\nG2 X20 Y5 I5 J0\nMIRROR\nG0 X0 Y0", [[-10, 5], [-20, 5], [0, 0]]),
    ],
)  # fmt: skip
def test_frames_of_sinumerik(text: str, places: list[list[float]]):
    path = trace(MACHINES["table"], f"G0 X0 Y0 Z0\n{text}", dialect="sinumerik", length_mm=0.0)
    lines = np.unique(path.line)[1:]
    at = [[path.coordinates[x][path.line == line][-1] for x in "XY"] for line in lines]
    assert np.array(at) == pytest.approx(np.array(places), abs=1e-9)


def test_a_rotation_in_space_without_swivelling():
    text = "G0 X0 Y0 Z0\nROT X90\nG1 X0 Y10 Z0\nG17 G2 X10 Y0 I0 J-10\nROT\nG0 X0 Y0 Z0"
    path = trace(MACHINES["table"], text, dialect="sinumerik", length_mm=0.0)
    arc = path.tip_mm[path.line == 4] - path.tip_mm[0]
    assert np.linalg.norm(arc, axis=1) == pytest.approx(10.0)
    assert arc[:, 1] == pytest.approx(0.0, abs=1e-9)
    assert arc[-1] == pytest.approx([10, 0, 0], abs=1e-9)
    assert arc[:, 2].min() >= -1e-9


def test_traori_is_the_tool_centre_point():
    start, moves = "G0 X0 Y0 Z50 B0 C0\n", "\nG1 X10 Y5 Z20 B20 C30\nX40 C70\n"
    for name in ("table", "head"):
        path = trace(MACHINES[name], f"{start}D1\nTRAORI{moves}TRAFOOF", dialect="sinumerik")
        tcp = trace(MACHINES[name], f"{start}\nG43.4 H1{moves}G49")
        assert ends(path, 4, 5) == pytest.approx(ends(tcp, 4, 5), abs=1e-9)


@pytest.mark.parametrize(
    ("text", "length"),
    [
        ("G1 X10\nG51.1 X0\nG1 X20\nG50.1 X0\nG1 X30", 90.0),
        ("G51.1 X5\nG1 X0 Y0\nG2 X10 Y0 R5", 10.0 + 5 * np.pi),
        ("G51.1 X0\nG1 X5\nG69\nX9", 9.0),
        ("G68 X0 Y0 R180\nG50.1\nG1 X5 Y0\nX-5", 15.0),
        ("G52 X10\nG0 X0\nG51.1 X0 Y0\nG1 X3 Y4", 10 + 5.0),
    ],
)
def test_mirror(text: str, length: float):
    path = trace(MACHINES["table"], f"G0 X0 Y0 Z0\n{text}", length_mm=0.0)
    assert np.linalg.norm(path.step_mm, axis=1).sum() == pytest.approx(length, abs=1e-3)


@pytest.mark.parametrize(
    ("text", "dialect", "word", "reason"),
    [
        ("G68.2 X0 Y0 Z0 I0 J30 K0\nG1 X5 Y5", "fanuc", "G1", "expected G53.1 before"),
        ("G53.1", "fanuc", "G53.1", "expected G68.2 before"),
        ("G68.2 X0 Y0 Z0 I0 J170 K0\nG53.1", "fanuc", "G53.1", "reach within their travel"),
        ("G68.2 X0 Y0 Z0 I0 J30", "fanuc", "G68.2", "expected X Y Z and I J K"),
        ("G68.2 P1 X0 Y0 Z0 I0 J3 K0", "fanuc", "P1", "expected no P"),
        ("G68.2 X0 Y0 Z0 I0 J30 K0\nG53.1\nG1 X5", "fanuc", "G1", "expected Y before"),
        ("G68.2 X0 Y0 Z0 I0 J30 K0\nG53.1\nG0 X5 C10", "fanuc", "C10", "tilted plane"),
        ("G68.2 X0 Y0 Z0 I0 J30 K0\nG53.1\nG43.4 H1", "fanuc", "G43.4", "expected G69"),
        ("TRANS X100 Y50\nG1 Z5", "sinumerik", "G1", "expected X, Y before"),
        ("TRANS C30", "sinumerik", "TRANS", "expected X, Y, Z in"),
        ("ROT X10 Z30", "sinumerik", "ROT", "expected one angle"),
        ("TRANS X5\nG91 X5", "sinumerik", "X5", "expected G90"),
        ("SCALE X2", "sinumerik", "SCALE", "expected a word"),
        ("CYCLE800(0,\"T\",0,192,0,0,0,0,30,0,0,0,0,-1)", "sinumerik", "CYCLE800", "axis by axis"),
        ("CYCLE800(0,\"T\",0,57,0,0,0,0,30)", "sinumerik", "CYCLE800", "expected 14 arguments"),
        ("CYCLE800(0,\"T\",0,57,0,0,0,0,30,0,0,0,0,-1) X5", "sinumerik", "CYCLE800", "no axes"),
        ("CYCLE800(0,\"T\",0,57,0,0,0,0,30,0,0,0,0,-1)\nCYCLE800()\nG1 X5 Y5 Z5", "sinumerik", "G1",
         "expected B"),
        ("CYCLE800(0,\"T\",0,57,0,0,0,0,nan,0,0,0,0,-1)", "sinumerik", "CYCLE800", "all numbers"),
        ("CYCLE800(0,\"T\",0,57,0,0,0,0,3_0,0,0,0,0,-1)", "sinumerik", "CYCLE800", "all numbers"),
        ("G1 X9 RND=1 CHF=1\nY9", "sinumerik", None, "expected one corner"),
        ("TRANS X5 AROT Z30", "sinumerik", "AROT", "in another block than TRANS"),
        ("ATRANS ATRANS X5", "sinumerik", "ATRANS", "in another block"),
        ("G1 TRANS X5", "sinumerik", "TRANS", "expected it first in its block"),
        ("X5 TRANS", "sinumerik", "TRANS", "expected it first in its block"),
        ("TRANS X5 M99", "sinumerik", "M99", "expected a word that is executed"),
        ("G51.1 X5", "sinumerik", "G51.1", "expected a word that is executed"),
        ("G52 G51.1 X5", "fanuc", "G51.1", "in another block than G52"),
        ("M98 P8 M99", "fanuc", "M99", "in another block than M98"),
        ("G1 X50 RND=5", "sinumerik", ",R", "expected G1 after a corner"),
        ("G1 X50\nCHF=2", "sinumerik", "CHF2", "expected one corner and a move"),
        ("G1 X50 ,C2\nX9", "fanuc", ",C", "not back"),
        ("CYCLE800(0,T\",0,57,0,0,0,0,30,0,0,0,0,-1)", "sinumerik", "CYCLE800", "but the second"),
        ("G101 X5", "haas", "X5", "expected X0"),
        ("C5\nG254\nG0 X5 Y5\nG1 Z5\nG0 C9", "haas", "C9", "G254 cancelled"),
        ("C5\nG254\nG55", "haas", "G55", "the table is turned"),
        ("G68 R30\nG51.1 X0", "fanuc", "G51.1", "cancelled before"),
    ],
)  # fmt: skip
def test_what_a_frame_cannot_do_is_refused(text: str, dialect: str, word: str, reason: str):
    start = "G0 X7 Y8 Z9 B0 C0\n"
    options = ControlSettings(dialect=dialect)  # type: ignore[arg-type]
    program = read_program(MACHINES["table"], (start + text).splitlines(), options)
    line, refused = next(iter(program.refused.items()))
    if word:
        assert (refused, line) == (word, 1 + len(text.splitlines()))
    assert reason in program.reasons[line]
