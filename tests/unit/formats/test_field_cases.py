"""Files as they are found in the shop, after public bug reports and manuals, with their numbers."""

import re
from dataclasses import replace

import numpy as np
import pytest

from bench_scenes import scene_with
from warpspace.bench.base import find_test, run_test
from warpspace.calibration.readings import parse_reading_table
from warpspace.calibration.registry import parse_readings
from warpspace.exceptions import SceneError
from warpspace.formats.measured import BACKWARD, FORWARD
from warpspace.formats.registry import ReadOptions, open_files, read_errors, recognise
from warpspace.formats.source import source_of_text
from warpspace.formats.to_scene import build_imported_scene
from warpspace.kinematics.chain import loop_error, nominal_point
from warpspace.kinematics.model import Loop
from warpspace.machine.errors import ErrorSet
from warpspace.scene.curve_reader import read_csv_runs
from warpspace.scene.library import load_scene, parse_scene
from warpspace.scene.text_files import match_column
from workbooks import xlsx


def imported_scene(text, name, base=None):
    options = ReadOptions(machine=base and base.machine)
    reading = read_errors([source_of_text(text, name)], options)
    return build_imported_scene(reading, base, "imported", name).scene


def read(text, name="file.txt", **options):
    return read_errors([source_of_text(text, name)], ReadOptions(**options)).imported


ENC = [
    "CHANDATA(1)",
    *(
        f"$AA_ENC_COMP[1,{i},X]={v}"
        for i, v in enumerate((0, 0.0031, 0.0058, 0.0092, 0.0121, 0.015))
    ),
    "$AA_ENC_COMP_STEP[1,X]=100",
    "$AA_ENC_COMP_MIN[1,X]=-500",
    "$AA_ENC_COMP_MAX[1,X]=0",
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
        (
            [line.replace("=", "  ") for line in ENC],
            "10 assignments without =, the first in line 2",
        ),
        (
            [line.replace("MODULO[1,X]=0", "MODULO[1,X]=-1") for line in ENC],
            "line 11: $AA_ENC_COMP_IS_MODULO is -1: the table does not repeat",
        ),
    ],
)
def test_sinumerik_programs_around_the_table(lines, note):
    imported = read("\n".join(lines), "x.ini")
    (exx,) = imported.series
    assert exx.positions == (-500.0, -400.0, -300.0, -200.0, -100.0, 0.0)
    assert exx.values == pytest.approx([0.0, 3.1, 5.8, 9.2, 12.1, 15.0])
    assert note in " ".join(imported.notes)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([*ENC, "$AA_ENC_COMP_STEP[1,X]=50"], r"line 12: \$AA_ENC_COMP_STEP\[1, X\] is repeated"),
        ([*ENC, "M6"], "line 12: 'M6'; expected"),
        ([*ENC[:2], ENC[2].replace(".", ","), *ENC[3:]], "line 3: .* has a decimal comma"),
        ([line.replace("MODULO[1,X]=0", "MODULO[1,X]=MAYBE") for line in ENC], "line 11: .*MAYBE"),
        (
            [line.replace("X]", "C]").replace("LO[1,C]=0", "LO[1,C]=-1") for line in ENC],
            "IS_MODULO is -1; expected 0 or 1 for a rotary axis",
        ),
    ],
)
def test_sinumerik_mutations_are_refused_with_their_line(lines, message):
    with pytest.raises(SceneError, match=message):
        read("\n".join(lines), "x.ini")


FORWARD_UM = (0.0, -2.1, -4.6, -6.3, -8.8, -10.4)
BACKWARD_UM = (4.2, 1.9, -0.3, -2.7, -4.9, -6.6)


@pytest.mark.parametrize("modulo", ["0", "-1"])
def test_sinumerik_tables_by_direction(modulo):
    lines: list[str] = []
    for table, way, values in ((0, 1, FORWARD_UM), (1, -1, BACKWARD_UM)):
        lines += [
            f"$AN_CEC_INPUT_AXIS[{table}]=(X1)", f"$AN_CEC_OUTPUT_AXIS[{table}]=(X1)",
            f"$AN_CEC_STEP[{table}]=100", f"$AN_CEC_MIN[{table}]=-500",
            f"$AN_CEC_MAX[{table}]=0", f"$AN_CEC_DIRECTION[{table}]={way}",
            f"$AN_CEC_IS_MODULO[{table}]={modulo}",
            *(f"$AN_CEC[{table},{i}]={v * 1e-3:.6f}" for i, v in enumerate(values)),
        ]  # fmt: skip
    (exx,) = read("\n".join([*lines, "M0", "M17"]), "COMP_X-X_CEC.SPF").series
    assert exx.in_direction(FORWARD) == pytest.approx(FORWARD_UM)
    assert exx.in_direction(BACKWARD) == pytest.approx(BACKWARD_UM)
    assert np.mean(exx.reversal) == pytest.approx(-3.967, abs=5e-4)


RTL = """HEADER::
File type  : rtl
TARGET DATA::
Filetype  : ISO
Target-count: 6
Targets :
0.000  100.000  200.000  300.000  400.000
500.000
Flags: 0 {flag} 2 0
USER-TEXT::
Date:2024-05-06 10:00:00
{axis}
RUNS::
Run-count:4
DEVIATIONS::
Run Target Data:
{rows}
EOF::
"""
LASER_RUNS = (
    (0.0, 1.2, 2.1, 3.4, 4.0, 5.2), (-1.0, 0.2, 1.1, 2.4, 3.0, 4.2),
    (0.2, 1.0, 2.3, 3.2, 4.2, 5.0), (-0.8, 0.0, 1.3, 2.2, 3.2, 4.0),
)  # fmt: skip


def laser_runs(*, unidirectional=False, axis="Axis:X"):
    runs = [
        np.zeros(6) if unidirectional and number % 2 else run
        for number, run in enumerate(LASER_RUNS)
    ]
    rows = [f"{n} {t} {um}" for n, run in enumerate(runs, 1) for t, um in enumerate(run, 1)]
    return RTL.format(flag=int(unidirectional), axis=axis, rows="\n".join(rows))


@pytest.mark.parametrize("unidirectional", [True, False])
def test_laser_runs_in_one_direction_and_in_both(unidirectional):
    (exx,) = read(laser_runs(unidirectional=unidirectional), "x.rtl").series
    assert exx.in_direction(FORWARD) == pytest.approx([0.1, 1.1, 2.2, 3.3, 4.1, 5.1])
    if unidirectional:  # the runs of zeros are empty
        assert exx.reversal is None
    else:
        assert np.mean(exx.reversal) == pytest.approx(1.0)


def test_laser_runs_without_an_axis_ask_for_it():
    text = laser_runs(axis="Location:lab")
    with pytest.raises(SceneError, match="does not state its axis; expected axis X"):
        read(text, "x.rtl")
    assert read(text, "x.rtl", axis="Y").keys == ("EYY",)


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


SAVED = "#*# [skew_correction {}]\n#*# xy_skew = 0.0026107\n#*# xz_skew = {}\n#*# yz_skew = {}\n"


def test_klipper_saved_factors():
    assert read(SAVED.format("CaliFlower", 0.0, 0.0)).constants == pytest.approx({"EC0Y": -2610.7})
    guarded = "{% if 'skew_correction default' in printer.configfile.settings %}\n"
    text = f"[gcode_macro START]\ngcode:\n    {guarded}      SKEW_PROFILE LOAD=default\n"
    factors = (0.0026107, -0.0011, 0.0008)  # x moves by -y·XY - z·(XZ - XY·YZ)
    assert read(text + SAVED.format("default", *factors[1:])).constants == pytest.approx(
        {"EC0Y": -2610.7, "EB0Z": -1100.0 - 2.6107 * 0.8, "EA0Z": -800.0}
    )


@pytest.mark.parametrize("probe", ["scanner", "cartographer", "bltouch", "dockable_probe"])
def test_klipper_probes_by_their_offset(probe):
    text = TWIST.replace("probe_eddy_current btt", probe).replace("-20", "0")
    imported = read(text, "printer.cfg")
    assert [error.key for error in imported.series] == ["EAX"]
    assert any("ignored zy_compensations: x_offset 0 mm" in note for note in imported.notes)


def test_klipper_heights_with_a_decimal_comma_are_refused():
    with pytest.raises(SceneError, match="line 7: z_compensations -0,030000"):
        read(TWIST.replace("= -0.03", "= -0,03"), "printer.cfg")


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


def skew_urad(ac, bd, ad):
    """Skew of a parallelogram by its diagonals: AC² - BD² = 4·AD·AB·cos."""
    ab = np.sqrt((ac * ac + bd * bd) / 2.0 - ad * ad)
    return -1e6 / np.tan(np.arccos((ac * ac - bd * bd) / (4.0 * ad * ab)))


@pytest.mark.parametrize(
    "lengths", [(140.9, 141.4, 100.0), (141.1, 141.6, 100.6), (140.7, 142.2, 99.96)]
)
def test_marlin_measured_diagonals(lengths):
    names = ("DIAG_AC", "DIAG_BD", "SIDE_AD")
    text = "#define SKEW_CORRECTION\n" + "".join(
        f"  #define XY_{name} {length}    //08/19/18\n"
        for name, length in zip(names, lengths, strict=True)
    )
    expected = {"EC0Y": pytest.approx(skew_urad(*lengths))}
    assert read(text, "Configuration.h").constants == expected


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
        ("M852 I0.1 j0.2", "line 1: .* expected M852 with I, J, K or S"),
        ("echo:Skew Factor: XY: -0.003 XQ: 0.1", "line 1: .* expected XY: number"),
        ("SET_SKEW XY=141,142,100 xz=141,142,100", "line 1: .* expected SET_SKEW with XY="),
        ("setp matrixkins.C_xy 0.1\nsetp matrixkin.C_yx 0.1\n", "line 2: 'setp matrixkin.C_yx"),
        ("setp matrixkins.C_xy 0.1\nsetp matrixkins.C_yx\n", "line 2: 'setp matrixkins.C_yx'"),
        ("M556 S100 X0.7 0.2", "line 1: .*each once"),
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


def test_linuxcnc_corrections_in_inches():
    """Type 1 adds its numbers: 1.0 0.002 -0.003 in inches is -50.8 and +76.2 µm at 25.4 mm."""
    ini = (
        COMP["g.ini"].replace("= mm", "= inch").replace("COMP_FILE_TYPE = 0", "COMP_FILE_TYPE = 1")
    )
    sources = [source_of_text(ini, "g.ini")]
    sources.append(source_of_text("1.0 0.002 -0.003\n2.0 0.001 -0.002\n", "x.comp"))
    (exx,) = read_errors(sources, ReadOptions()).imported.series
    assert exx.positions == pytest.approx([25.4, 50.8])
    assert exx.in_direction(FORWARD) == pytest.approx([-50.8, -25.4])
    assert exx.in_direction(BACKWARD) == pytest.approx([76.2, 50.8])


def test_linuxcnc_actual_positions():
    text = "-20 -20.0015 -19.9985\n-10 -10.001 -9.999\n0 0 0.002\n10 10.001 10.003\n"
    (exx,) = read(text, "x_type0.comp", axis="X").series
    assert exx.in_direction(FORWARD) == pytest.approx([-1.5, -1.0, 0.0, 1.0])
    assert exx.in_direction(BACKWARD) == pytest.approx([1.5, 1.0, 2.0, 3.0])


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


NAMED = {
    "a list of Renishaw": "Renishaw compensation\nCompensation type: Mean\n",
    "pitch error data of FANUC": "%\nN10000 Q1 P0\nN10001 Q1 P-1\nN03620 Q0 A1 P1 A2 P40\n%\n",
    "a screw compensation table of Centroid": "24 -1448819\n0\n-32\n-38\n",
    "a HEIDENHAIN digital readout": "#\nND-280 MM\nAXIS X1 = 0\n",
    "an EasyRoute control": "unit = mm\n[X]\n0, 0.000, 0.010\n",
    "a screw map of Mach3": "-10.0,-10.001\n0,0\n10,10.002\n",
    "a list of cross or plane compensation of ISG": "kopf.achs_nr 2\nkw.crosscomp.unit 1\n",
    "a bed mesh of Klipper": "[bed_mesh]\n",
}


BC = load_scene("machine_trunnion_bc").machine
ISG = """# list of the Y axis
kopf.log_achs_nr      2
kopf.log_achs_name    Y-ACHSE
kw.ssfk.interval      0
kw.ssfk.kw_nr_max     3
kw.ssfk.unit          1   /* 0: increments 1: metric */
kw.ssfk.bilateral     1
kw.ssfk.table[0].setpoint -200000
kw.ssfk.table[1].setpoint -199306
kw.ssfk.table[2].setpoint -198667
kw.ssfk.table[0].pos  0
kw.ssfk.table[1].pos  24
kw.ssfk.table[2].pos  -102
kw.ssfk.table[0].neg  0
kw.ssfk.table[1].neg  67
kw.ssfk.table[2].neg  80
"""
EQUAL_STEPS = (
    ISG.replace("interval      0", "interval      20000\nkw.ssfk.kw_startpos   -909000")
    .replace("bilateral     1", "bilateral     0")
    .replace("Y-ACHSE", "X_ACHSE")
)
EQUAL_STEPS = "\n".join(
    line for line in EQUAL_STEPS.splitlines() if not re.search(r"neg|setp", line)
)


def test_isg_lists_in_both_directions():
    """The example of TF5200: programmed 19866.7 µm, measured 10.2 µm less is -102."""
    imported = read(ISG, "achskw2.lis")
    (eyy,) = imported.series
    assert eyy.key == "EYY"
    assert eyy.positions == pytest.approx((-20.0, -19.9306, -19.8667))
    assert eyy.in_direction(FORWARD) == pytest.approx([0.0, 2.4, -10.2])
    assert eyy.in_direction(BACKWARD) == pytest.approx([0.0, 6.7, 8.0])
    assert any("actual − nominal" in text for text in imported.assumed)
    (reversed_sign,) = read(ISG, "achskw2.lis", sign="correction").series
    assert reversed_sign.in_direction(FORWARD) == pytest.approx([0.0, -2.4, 10.2])


def test_isg_lists_with_equal_steps_in_one_direction():
    (exx,) = read(EQUAL_STEPS, "x.lis").series
    assert (exx.key, exx.positions) == ("EXX", pytest.approx((-90.9, -88.9, -86.9)))
    assert exx.reversal is None
    assert exx.values == pytest.approx([0.0, 2.4, -10.2])
    (ecc,) = read(EQUAL_STEPS.replace("X_ACHSE", "C AXIS"), "c.lis", machine=BC).series
    assert ecc.values == pytest.approx(np.array([0.0, 0.0024, -0.0102]) * np.pi / 180.0 * 1e6)


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("unit          1", "unit          0", "line 6: unit 0: increments .*; expected unit 1"),
        ("kw.ssfk.unit", "kw.ssfk.unity", "has no kw.ssfk.unit"),
        (
            "bilateral     1",
            "bilateral     0",
            r"line 14: .*\[0\].neg is not used; expected setpoint and",
        ),
        ("nr_max     3", "nr_max     4", r"has no kw.ssfk.table\[3\].setpoint; expected 4 points"),
        (
            "nr_max     3",
            "nr_max     2",
            r"line 10: .*\[2\].setpoint is not used; .* below 2",
        ),
        ("-199306", "-200306", "line 9: position -20.0306 after -20"),
        ("pos  24", "pos  2,4", "line 12: pos '2,4' has a decimal comma"),
        ("[1].pos  24", "[0].pos  24", r"line 12: kw.ssfk.table\[0\].pos is repeated"),
        ("[1].pos  24", "[1].pso  24", r"line 12: kw.ssfk.table\[1\].pso is not used"),
        ("[1].pos  24", "[1].pos", "line 12: .*; expected kw.ssfk.NAME NUMBER"),
        ("Y-ACHSE", "Spindel", "line 3: axis 'SPINDEL' is unknown"),
    ],
)
def test_isg_lists_that_are_not_understood_are_refused(before, after, message):
    assert before in ISG
    with pytest.raises(SceneError, match=message):
        read(ISG.replace(before, after), "y.lis")


@pytest.mark.parametrize("title", NAMED)
def test_a_file_that_is_not_read_is_named_with_an_alternative(title):
    with pytest.raises(SceneError, match=f"{title}.*; expected another file: .+"):
        read(NAMED[title], "x.dat", axis="X")


FOREIGN = {
    "points.xyz": "1 2 3\n4 -5 6\n7 8 9\n",
    "x.comp": "a screw\n",
    "m.COM": "BEGIN PGM 1 MM\nL X+1\n",
    "m.cma": "some text\n",
    "x.tab": "a,b\n1,2\n",
    "x.map": "0 1 2\n5 9 1\n",
    "x.rtl": "HEADER\n",
    "m.gcode": "G1 X1\n",
    "m.hal": "loadrt trivkins\n",
    "printer.cfg": "[stepper_x]\n",
    "config.g": "M92 X80\n",
    "v.exc": "1;2\n",
}


@pytest.mark.parametrize("name", FOREIGN)
def test_a_file_is_not_recognised_by_its_ending(name):
    with pytest.raises(SceneError, match="matches no known format"):
        recognise([source_of_text(FOREIGN[name], name)])


def test_a_file_is_recognised_under_another_ending():
    assert recognise([source_of_text("BEGIN X.CMA MM\n", "x.tab")]).name == "heidenhain"
    assert recognise([source_of_text(COMP["x.comp"], "x.map")]).name == "linuxcnc-comp"


def test_linuxcnc_settings_that_are_not_read_are_reported():
    text = COMP["g.ini"].replace("[JOINT_1]", "[JOINT_3]\nBACKLASH = 0.02\n[JOINT_1]")
    sources = [source_of_text(text, "g.ini"), source_of_text(COMP["x.comp"], "x.comp")]
    notes = " ".join(read_errors(sources, ReadOptions()).imported.notes)
    assert "line 9: ignored BACKLASH = 0.02" in notes
    assert "y1.comp of Y: not among the files" in notes


RUNS = {
    (1, "+"): (0.4, 1.7, 2.5), (1, "-"): (-2.3, -1.1, 0.1),
    (2, "+"): (0.3, 1.0, 2.4), (2, "-"): (-2.2, -1.0, 0.2),
}  # fmt: skip
TARGETS = (6.711, 175.077, 353.834)
ROWS = [
    (run, way, target, value)
    for (run, way), values in RUNS.items()
    for target, value in zip(TARGETS, values, strict=True)
]


def sheet(head="run,direction,target_mm,deviation_um", ways=("+", "-"), scale=1.0):
    spelled = dict(zip("+-", ways, strict=True))
    lines = [f"{run},{spelled[way]},{q!r},{scale * v:.7g}" for run, way, q, v in ROWS]
    return "\n".join([head, *lines]) + "\n"


def german(text):
    return text.replace(",", ";").replace(".", ",")


WIDE = "\n".join([
    "Target [mm];1↑;1↓;2↑;2↓",
    *(
        f"{target};" + ";".join(str(values[index]) for values in RUNS.values())
        for index, target in enumerate(TARGETS)
    ),
])  # fmt: skip
SHEETS = {
    "as documented": sheet().encode(),
    "German": german(sheet()).encode("utf-8-sig"),
    "UTF-16": german(sheet()).replace(";", "\t").encode("utf-16"),
    "Windows-1252": sheet("run,direction,Target [mm],deviation [µm]").encode("cp1252"),
    "mm": sheet("run,direction,target_mm,deviation_mm", scale=1e-3).encode(),
    "inch": sheet("run,direction,target_mm,deviation_in", scale=1 / 25_400).encode(),
    "arrows": sheet(ways=("↑", "↓")).encode(),
    "words": sheet(ways=("Forward", "Reverse")).encode(),
    "U+2212": sheet(ways=("+", "−")).replace(",-", ",−").encode(),
    "point names": "\n".join(f"{a},{b}" for a, b in zip(
        ["pt", *("P1" for _ in ROWS)], sheet().splitlines(), strict=True,
    )).encode(),
    "runs in columns": WIDE.encode(),
    "runs in columns with unit": WIDE.replace("↑", " + [µm]").replace("↓", " - [µm]").encode(),
    "runs in rows": "\n".join([
        "Target [mm];" + ";".join(map(str, TARGETS)),
        *(f"{run} {way};" + ";".join(map(str, values)) for (run, way), values in RUNS.items()),
    ]).encode(),
    "blanks": sheet("run direction target_mm deviation [um]").replace(",", "  ").encode(),
    "headings in German": sheet("Lauf,Richtung,Sollposition [mm],Abweichung [µm]").encode(),
    "preamble": f"Report;laser\nDate;2024-05-01\n\n{WIDE}".encode(),
}  # fmt: skip


@pytest.mark.parametrize("name", SHEETS)
def test_laser_sheets_are_read_alike_by_test_and_import(name, tmp_path):
    path = tmp_path / "laser.csv"
    path.write_bytes(SHEETS[name])
    measured = run_test(scene_with(), find_test("positioning")(axis="X"), path).runs[1]
    assert sorted(measured.readings.tolist()) == pytest.approx(sorted(row[3] for row in ROWS))
    (exx,) = read_errors(open_files([path]), ReadOptions(axis="X")).imported.series
    assert exx.in_direction(FORWARD) == pytest.approx([0.35, 1.35, 2.45])
    assert exx.in_direction(BACKWARD) == pytest.approx([-2.25, -1.05, 0.15])
    if name in ("headings in German", "point names"):  # a scene names its column
        return
    runs = read_csv_runs(path, "deviation", "measured.EXX")
    points = {(run.direction, *point) for run in runs for point in run.points}
    assert len(points) == len(ROWS)
    assert sorted({place for _, place, _ in points}) == pytest.approx(TARGETS)
    assert sorted(value for *_, value in points) == pytest.approx(sorted(row[3] for row in ROWS))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (sheet(ways=("+", "sideways")), 'line 5, direction: "sideways"; expected'),
        (sheet(ways=("cw", "ccw")), 'line 2, direction: "cw"; expected'),
        (sheet("run,direction,target_mm,deviation"), "'deviation_um' not found"),
        (sheet("run,direction,target_mm,deviation_deg"), "'deviation_um' not found"),
        (sheet("run,direction,target_V,deviation_um"), "'target_mm' not found"),
    ],
)
def test_laser_sheets_that_are_not_understood_are_refused(text, message, tmp_path):
    path = tmp_path / "laser.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SceneError, match=message):
        run_test(scene_with(), find_test("positioning")(axis="X"), path)


@pytest.mark.parametrize(
    ("text", "position"),
    [
        ("Position X [mm];Abweichung [µm]\n0;0\n100;1,5\n", 100.0),
        ("X [mm] EXX [um]\n0 0\n1 1.5", 1.0),
    ],
)
def test_headings_with_blanks_and_in_german(text, position):
    (exx,) = read(text, "x.csv").series
    assert (exx.key, exx.positions) == ("EXX", (0.0, position))
    assert exx.values == pytest.approx([0.0, 1.5])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("Target [mm];0;100\n1↑;0;1\nmean;0;1\n", 'line 3: "mean"; expected a run such as 2 ↑'),
        ("Target [mm];0;100\n1↑ [mm];0;1\n", 'line 2: "1↑ .mm."; expected a run such as 2 ↑'),
        ("Target [mm];0;100\n1↑;0;1;2\n", "line 2: 4 fields; expected 3"),
        ("Target [mm];1↑ [foo];1↓ [foo]\n0;0;1\n", "line 1: .*foo"),
    ],
)
def test_runs_in_rows_that_are_not_understood_are_refused(text, message):
    with pytest.raises(SceneError, match=message):
        read(text, "laser.csv", axis="X")


def test_a_sheet_without_its_axis_asks_for_it():
    with pytest.raises(SceneError, match="line 1: column 'target_mm' does not state its axis"):
        read(sheet(), "laser.csv")


def test_ball_bar_directions_in_words(tmp_path):
    figures: list[object] = []
    for ways in (("+", "-"), ("CCW", "cw")):
        rows = [
            f"{way},{q},{np.sin(q + n)}" for n, way in enumerate(ways) for q in range(0, 360, 5)
        ]
        path = tmp_path / "bar.csv"
        path.write_text("\n".join(["direction,angle_deg,radial_um", *rows]), encoding="utf-8")
        figures.append(
            run_test(scene_with(), find_test("circular")(), path).runs[1].readings.tolist()
        )
    assert figures[0] == figures[1]


def test_a_short_column_of_positions_is_no_deviation():
    assert match_column("x_um", ["x_mm"]) is None
    assert match_column("x_mm", ["X_in"]) == (0, pytest.approx(25.4))
    assert match_column("j1_deg", ["j1_rad"]) == (0, pytest.approx(180.0 / np.pi))
    assert match_column("radial_um", ["radius_mm"]) is None


def test_calibration_ignores_columns_that_it_does_not_need():
    table = parse_reading_table("Pt,Date,j1_rad,x_mm\nP1,2024-05-01,1.5,2\n", "t.csv")
    assert table.require(("j1_deg", "x_mm"))[0] == pytest.approx([np.rad2deg(1.5), 2.0])
    with pytest.raises(SceneError, match='line 2, pt: "P1"; expected a finite number'):
        table.require(("pt",))


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ("j1_deg,j2_deg,j3_deg,j4_deg,j5_deg,j6_deg", "axis positions only.*closed loop"),
        ("Timestamp,shoulder_pan_joint,x_mm,y_mm,z_mm", "has no column j1_deg, j2_deg.*shoulder_"),
    ],
)
def test_robot_readings_without_positions_or_joints_are_refused(header, message):
    row = ",".join("1" for _ in header.split(","))
    with pytest.raises(SceneError, match=message):
        parse_readings(f"{header}\n{row}\n", "r.csv", load_scene("ur10"), "positions")


def test_a_table_of_fanuc_with_a_decimal_comma_is_refused():
    text = (
        "# three-dimensional error compensation; g\n# detection unit = 0,001 mm\n"
        "# magnification = 1\npoint;X [mm];Y [mm];Z [mm];CX;CY;CZ\n1;-275;-225;-480;-4;-47;8\n"
    )
    with pytest.raises(SceneError, match="line 2: detection unit '0,001' has a decimal comma"):
        read(text, "gde.csv")


@pytest.mark.parametrize("mark", [" ", ";"])
def test_volumetric_lists_of_isg(mark):
    rows = ["X EXX EYX EAX", "-100 0.0 0.0 0.00001", "0 0.001 0.002 0.00002"]
    rows += ["100 0.003 0.001 0.00003", "#", "C0Y", "0.00002"]
    imported = read("\n".join(["// ISG csv", *rows]).replace(" ", mark), "v.csv")
    values = {error.key: error.values.tolist() for error in imported.series}
    assert values["EXX"] == pytest.approx([0.0, 1.0, 3.0])
    assert values["EYX"] == pytest.approx([0.0, 2.0, 1.0])
    assert values["EAX"] == pytest.approx([10.0, 20.0, 30.0])
    assert imported.constants == pytest.approx({"EC0Y": 20.0})


def test_spreadsheets(tmp_path):
    pytest.importorskip("python_calamine")
    rows = [["Laser report"], ["X [mm]", "EXX [µm]"], [0.0, 0.0], [100.0, -1.5]]
    path = tmp_path / "laser.xlsx"
    path.write_bytes(xlsx(rows))
    imported = read_errors(open_files([path]), ReadOptions()).imported
    (exx,) = imported.series
    assert exx.positions == (0.0, 100.0)
    assert exx.values == pytest.approx([0.0, -1.5])
    assert "read sheet 'Laser'" in imported.notes
