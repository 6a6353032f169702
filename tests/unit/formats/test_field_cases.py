"""Files as they are found in the shop, after public bug reports and manuals, with their numbers."""

from dataclasses import replace

import numpy as np
import pytest

from warpspace.exceptions import SceneError
from warpspace.formats.measured import BACKWARD, FORWARD
from warpspace.formats.registry import ReadOptions, read_errors
from warpspace.formats.source import source_of_text
from warpspace.formats.to_scene import build_imported_scene
from warpspace.kinematics.chain import loop_error, nominal_point
from warpspace.kinematics.model import Loop
from warpspace.machine.errors import ErrorSet
from warpspace.scene.library import load_scene, parse_scene


def imported_scene(text, name, base=None):
    options = ReadOptions(machine=base and base.machine)
    reading = read_errors([source_of_text(text, name)], options)
    return build_imported_scene(reading, base, "imported", name).scene


def read(text, name="file.txt", **options):
    return read_errors([source_of_text(text, name)], ReadOptions(**options)).imported


ENC = [
    "CHANDATA(1)",
    *(f"$AA_ENC_COMP[1,{i},X]={v}" for i, v in enumerate((0, 0.0031, 0.0058, 0.0092))),
    "$AA_ENC_COMP_STEP[1,X]=100",
    "$AA_ENC_COMP_MIN[1,X]=-500",
    "$AA_ENC_COMP_MAX[1,X]=-200",
    "$AA_ENC_COMP_IS_MODULO[1,X]=0",
]


@pytest.mark.parametrize(
    ("lines", "note"),
    [
        ([*ENC, "M0", "M30", "M17"], ""),
        ([*ENC, "m0", "m30", "RET"], ""),
        (["%_N_NC_EEC_INI", ";$PATH=/_N_NCK_DIR", *ENC, "M2"], ""),
        ([line.replace("MODULO[1,X]=0", "MODULO[1,X]=FALSE") for line in ENC], ""),
        ([" ".join(ENC[1:3]), *ENC[3:]], ""),
        ([line.replace("=", "  ") for line in ENC], "8 assignments without =, the first in line 2"),
        ([line.replace("MODULO[1,X]=0", "MODULO[1,X]=-1") for line in ENC], "X does not repeat"),
    ],
)
def test_sinumerik_programs_around_the_table(lines, note):
    imported = read("\n".join(lines), "x.ini")
    (exx,) = imported.series
    assert exx.values == pytest.approx([0.0, 3.1, 5.8, 9.2])
    assert note in " ".join(imported.notes)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([*ENC, "$AA_ENC_COMP_STEP[1,X]=50"], r"line 10: \$AA_ENC_COMP_STEP\[1, X\] is repeated"),
        ([*ENC, "M6"], "line 10: 'M6'; expected"),
        ([*ENC[:2], ENC[2].replace(".", ","), *ENC[3:]], "line 3: .* has a decimal comma"),
        ([line.replace("MODULO[1,X]=0", "MODULO[1,X]=MAYBE") for line in ENC], "line 9: .*MAYBE"),
    ],
)
def test_sinumerik_mutations_are_refused_with_their_line(lines, message):
    with pytest.raises(SceneError, match=message):
        read("\n".join(lines), "x.ini")


def test_sinumerik_tables_by_direction_with_modulo_minus_one():
    lines: list[str] = []
    for table, way, values in ((0, 1, (0.0, -0.0021)), (1, -1, (0.0042, 0.0019))):
        lines += [
            f"$AN_CEC_INPUT_AXIS[{table}]=(X1)", f"$AN_CEC_OUTPUT_AXIS[{table}]=(X1)",
            f"$AN_CEC_STEP[{table}]=100", f"$AN_CEC_MIN[{table}]=-500",
            f"$AN_CEC_MAX[{table}]=-400", f"$AN_CEC_DIRECTION[{table}]={way}",
            f"$AN_CEC_IS_MODULO[{table}]=-1",
            *(f"$AN_CEC[{table},{i}]={v:.6f}" for i, v in enumerate(values)),
        ]  # fmt: skip
    (exx,) = read("\n".join([*lines, "M0", "M17"]), "COMP_X-X_CEC.SPF").series
    assert exx.in_direction(FORWARD) == pytest.approx([0.0, -2.1])
    assert exx.in_direction(BACKWARD) == pytest.approx([4.2, 1.9])


def test_heidenhain_columns_without_content():
    head = "BEGIN b.COM MM\nNR   AXISPOS    BACKLASH   X          Y\n"
    rows = "0    -500       +0.0000    +0.0000\n1    -400       +0.0030    +0.0020\n[END]\n"
    (exx,) = read(head + rows, "b.COM", axis="X").series
    assert exx.in_direction(FORWARD) == pytest.approx([0.0, 2.0])
    assert exx.in_direction(BACKWARD) == pytest.approx([0.0, 3.0])


TWIST = """[probe_eddy_current btt]
x_offset: -20
y_offset: 25.0
[axis_twist_compensation]
calibrate_y: 175
#*# [axis_twist_compensation]
#*# z_compensations = -0.030000, -0.010000, 0.040000
#*# compensation_start_x = 30.0
#*# compensation_end_x = 320.0
#*# zy_compensations = 0.010000, 0.000000, -0.010000
#*# compensation_start_y = 20.0
#*# compensation_end_y = 330.0
#*# [bed_mesh default]
#*# version = 1
"""


def test_klipper_twist_of_both_axes():
    imported = read(TWIST, "printer.cfg")
    eax, eby = imported.series
    assert (eax.key, eby.key) == ("EAX", "EBY")
    assert eax.values == pytest.approx([-1200.0, -400.0, 1600.0])
    assert eby.values == pytest.approx([500.0, 0.0, -500.0])  # a rotation b lifts dx by -b·dx
    assert any("[bed_mesh]" in note for note in imported.notes)


@pytest.mark.parametrize("probe", ["scanner", "cartographer", "bltouch", "dockable_probe"])
def test_klipper_probes_by_their_offset(probe):
    text = TWIST.replace("probe_eddy_current btt", probe).replace("-20", "0")
    imported = read(text, "printer.cfg")
    assert [error.key for error in imported.series] == ["EAX"]
    assert any("ignored zy_compensations: x_offset 0 mm" in note for note in imported.notes)


def test_klipper_twist_with_two_probes_is_refused():
    with pytest.raises(SceneError, match=r"line 7: .* with probe_eddy_current, scanner"):
        read(f"{TWIST}[scanner]\ny_offset: 3\n", "printer.cfg")


@pytest.mark.parametrize(
    "text",
    [
        "M852 I-0.003540",
        "echo:; Skew Factor: \necho:  M852 I-0.003540 J0.000000 K0.000000\n",
        "> M852\nRecv: echo:Skew Factor: XY: -0.003540 XZ: 0.000000 YZ: 0.000000\nok\n",
    ],
)
def test_marlin_commands_and_reports(text):
    assert read(text).constants == pytest.approx({"EC0Y": 3540.0})


LENGTHS = (
    "#define SKEW_CORRECTION\n#define XY_DIAG_AC 141.05\n#define XY_DIAG_BD 141.46\n"
    "#define XY_SIDE_AD 100.89\n"
)


def test_a_marlin_factor_overrides_the_lengths_and_is_reported():
    imported = read(f"{LENGTHS}#define XY_SKEW_FACTOR 0.0\n", "Configuration.h")
    assert not imported.keys
    assert "XY_SKEW_FACTOR 0 overrides XY_DIAG_AC, XY_DIAG_BD" in imported.notes[0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"{LENGTHS}#define XY_DIAG_AC 141,1\n", "line 5: .* decimal comma"),
        (f"{LENGTHS}#define XY_DIAG_AC 141.1\n", "line 5: XY_DIAG_AC is defined twice"),
        ("M852 I0.1 S0.2", "line 1: M852 sets XY twice"),
        ("M556 X-0.5", "line 1: .* without a length"),
        ("M556 S100 X0.7 X0.2", "line 1: .*each once"),
        ("M556 S100 X0.7 Q1", "line 1: .*each once"),
        ("M556 S100 X0.7 P2", "line 1: M556 P"),
    ],
)
def test_mutations_of_skew_commands_are_refused_with_their_line(text, message):
    with pytest.raises(SceneError, match=message):
        read(text)


def test_reprapfirmware_skew():
    """Duet documentation: M556 S100 X0.7 Y-0.2 Z0.6 reports XY 0.007, YZ -0.002, ZX 0.006."""
    text = "; config.g\nM556 S100 X0.7 Y-0.2 Z0.6\n"
    # X += 0.007·Y makes an obtuse angle square
    expected = {"EC0Y": 7000.0, "EA0Z": -2000.0, "EB0Z": -6000.0}
    assert read(text, "config.g").constants == pytest.approx(expected)
    reversed_xy = read("M556 S100 X0.7 P1", "config.g")
    assert reversed_xy.curves["EYX"] == {"poly": [0.0, pytest.approx(-7.0)]}


@pytest.mark.parametrize("machine", [None, "machine_c_frame_mill"])
def test_matrixkins_exact_inverse(machine):
    """Joints are C·p: without the matrix the machine stands at C⁻¹·p."""
    matrix = np.array([[1.0, 0.02, -0.01], [0.03, 1.0, 0.015], [-0.02, 0.01, 1.001]])
    text = "".join(
        f"setp matrixkins.C_{'xyz'[row]}{'xyz'[column]} {matrix[row, column]}\n"
        for row in range(3)
        for column in range(3)
    )
    base = None if machine is None else load_scene(machine)
    if base is not None:
        base = replace(base, errors=ErrorSet({}))
    scene = imported_scene(text, "m.hal", base)
    loop = Loop.TOOL if base is None else Loop.RELATIVE
    corners = np.array([[0.0, 0.0, 0.0], [100.0, 100.0, 100.0]])
    coordinates = {axis: corners[:, index] for index, axis in enumerate("XYZ")}
    values = {key: scene.errors.evaluate_at(key, coordinates) for key in scene.errors}
    point_mm = nominal_point(scene.model, Loop.TOOL, coordinates)
    error_um, _ = loop_error(scene.model, loop, coordinates, values, point_mm)
    motion_um = error_um[1] - error_um[0]
    assert motion_um == pytest.approx(
        (np.linalg.inv(matrix) - np.eye(3)) @ corners[1] * 1e3, abs=0.02
    )
    assert motion_um == pytest.approx([-901.0, -4486.9, 925.9], abs=0.06)


GANTRY = """title = "gantry"
[machine]
chain = "wFYXZt"
[machine.travel]
Y = [0, 400]
X = [0, 400]
Z = [0, 50]
[machine.gantry]
Y = { span_mm = 1000 }
[errors]
EYY = { guides = [-10, 10] }
"""
INI = "[TRAJ]\nLINEAR_UNITS = mm\n[KINS]\nKINEMATICS = trivkins coordinates=XYYZ kinstype=BOTH\n"
INI += "".join(
    f"[JOINT_{joint}]\nCOMP_FILE = {name}\nCOMP_FILE_TYPE = 0\n"
    for joint, name in enumerate(("x.comp", "y1.comp", "y2.comp"))
)
COMP = {
    "g.ini": INI,
    "x.comp": "0 0 0\n100 100.005 100.003\n",
    "y2.comp": "0 0 0\n400 400.030 400.030\n",
    "y1.comp": "0 0 0\n400 400.010 400.010\n",
}


def read_comp(*names, machine=None):
    sources = [source_of_text(COMP[name], name) for name in names]
    return read_errors(sources, ReadOptions(machine=machine)).imported


def test_linuxcnc_joints_of_the_two_guides_of_a_gantry():
    machine = parse_scene(GANTRY, "gantry").machine
    errors = {error.key: error for error in read_comp(*COMP, machine=machine).series}
    assert errors["EYY"].values == pytest.approx([0.0, 20.0])
    # the second guide leads by 20 µm over 1 m
    gantry = machine.gantries["Y"]
    assert errors["ECY"].values == pytest.approx([0.0, 20.0 * gantry.rotation_weight])
    assert abs(errors["ECY"].values[1]) == pytest.approx(20.0)
    assert errors["EXX"].in_direction(BACKWARD) == pytest.approx([0.0, 3.0])


@pytest.mark.parametrize(
    ("names", "has_machine", "message"),
    [
        (tuple(COMP), False, "two joints of Y, the guides of a gantry.*span_mm"),
        (("g.ini", "x.comp", "y1.comp"), True, "two joints of Y; expected the files of both"),
    ],
)
def test_linuxcnc_guides_without_their_distance_or_file(names, has_machine, message):
    machine = parse_scene(GANTRY, "gantry").machine if has_machine else None
    with pytest.raises(SceneError, match=message):
        read_comp(*names, machine=machine)


@pytest.mark.parametrize(
    ("variant", "text", "message"),
    [
        ("type-1", COMP["x.comp"], "looks like actual positions, but is type-1"),
        ("type-0", "0 0 0\n100 0.005 0.003\n", "looks like corrections, but is type-0"),
    ],
)
def test_linuxcnc_tables_of_the_other_type_are_refused(variant, text, message):
    with pytest.raises(SceneError, match=message):
        read(text, "x.comp", axis="X", variant=variant)


def test_linuxcnc_settings_that_are_not_read_are_reported():
    text = COMP["g.ini"].replace("[JOINT_1]", "[JOINT_3]\nBACKLASH = 0.02\n[JOINT_1]")
    sources = [source_of_text(text, "g.ini"), source_of_text(COMP["x.comp"], "x.comp")]
    notes = " ".join(read_errors(sources, ReadOptions()).imported.notes)
    assert "line 9: ignored BACKLASH = 0.02" in notes
    assert "y1.comp of Y: not among the files" in notes
