"""Tables of controllers: what their manuals print, and what they do with it, by hand."""

import math
from itertools import product

import numpy as np
import pytest

from warpspace.formats.kinds.linuxcnc import squareness
from warpspace.formats.kinds.skew import skew_factor, skew_lengths
from warpspace.formats.measured import BACKWARD, FORWARD
from warpspace.formats.registry import ReadOptions, find_format, read_errors
from warpspace.formats.source import source_of_text
from warpspace.formats.terms import Grid3, Product


def sources(*texts, names=("file.txt",)):
    return [source_of_text(text, name) for text, name in zip(texts, names, strict=True)]


def tables(form, text, **options):
    return find_format(form).tables(sources(text), ReadOptions(**options))


def imported(*texts, **named):
    return read_errors(sources(*texts, **named), ReadOptions()).imported


PRINTED = {0: "0.003", 1: "0.01", 2: "0.012", 800: "-0.0"}
"""Values of the printed example; the points that it leaves out with dots are zero."""
SINUMERIK_242 = "\n".join([
    "%_N_AX_EEC_INI", "CHANDATA(1)",
    *(f"$AA_ENC_COMP[0,{i},X1]={PRINTED.get(i, '0.0')} ; compensation value" for i in range(801)),
    "$AA_ENC_COMP_STEP[0,X1]=1.0 ; Distance between interpolation points 1.0 mm",
    "$AA_ENC_COMP_MIN[0,X1]=-200.0 ; Compensation starts at -200.0 mm",
    "$AA_ENC_COMP_MAX[0,X1]=600.0 ; Compensation ends at +600.0 mm",
    "$AA_ENC_COMP_IS_MODULO[0,X1]=0 ; Compensation without modulo function", "M17",
])  # fmt: skip


def test_sinumerik_page_242_interpolates_linearly_and_holds_its_ends():
    (table,) = tables("sinumerik-enc", SINUMERIK_242).terms
    at = np.array([-300.0, -200.0, -199.5, -199.0, -198.25, 600.0, 900.0])
    # a positive value makes the axis move in the negative direction (page 238)
    expected = -np.array([0.003, 0.003, 0.0065, 0.01, 0.0115, 0.0, 0.0])
    assert table.corrections({"X": at})["X"] == pytest.approx(expected, abs=1e-12)


def test_sinumerik_page_242_is_a_positioning_error_in_um():
    (one,) = imported(SINUMERIK_242).series
    assert one.key == "EXX"
    assert one.values[:3] == pytest.approx([3.0, 10.0, 12.0])
    assert (one.positions[0], one.positions[-1], len(one.positions)) == (-200.0, 600.0, 801)


def test_sinumerik_modulo_repeats_the_table():
    text = (
        "$AA_ENC_COMP[0,0,C]=0.0\n$AA_ENC_COMP[0,1,C]=0.01\n$AA_ENC_COMP[0,2,C]=0.0\n"
        "$AA_ENC_COMP_STEP[0,C]=180\n$AA_ENC_COMP_MIN[0,C]=0\n$AA_ENC_COMP_MAX[0,C]=360\n"
        "$AA_ENC_COMP_IS_MODULO[0,C]=1\nM17\n"
    )
    (table,) = tables("sinumerik-enc", text).terms
    at = np.array([-90.0, 90.0, 450.0, 360.0])
    assert table.corrections({"C": at})["C"] == pytest.approx([-0.005, -0.005, -0.005, 0.0])


CEC = """%_N_NC_CEC_INI
CHANDATA(1)
$AN_CEC[0,0]=0 ; 1. Compensation value for X1: 0 um
$AN_CEC[0,1]=0.01
$AN_CEC[0,2]=0.012
$AN_CEC_INPUT_AXIS[0]=(Y1)
$AN_CEC_OUTPUT_AXIS[0]=(X1)
$AN_CEC_STEP[0]=400.0
$AN_CEC_MIN[0]=-400.0
$AN_CEC_MAX[0]=400.0
$AN_CEC_DIRECTION[0]={direction}
$AN_CEC_MULT_BY_TABLE[0]={other}
$AN_CEC_IS_MODULO[0]=0
$AN_CEC[1,0]=0
$AN_CEC[1,1]=1
$AN_CEC_INPUT_AXIS[1]=(Z1)
$AN_CEC_OUTPUT_AXIS[1]=(X1)
$AN_CEC_STEP[1]=100.0
$AN_CEC_MIN[1]=0.0
$AN_CEC_MAX[1]=100.0
M17
"""


def test_sinumerik_cec_adds_tables_and_the_product_of_two():
    both = tables("sinumerik-cec", CEC.format(direction=0, other=2))
    at = {"Y": np.array(-200.0), "Z": np.array(50.0)}
    # 0.005 of table 0, 0.5 of table 1, and their product is added (page 249)
    assert both.corrections(at)["X"] == pytest.approx(-(0.005 + 0.5 + 0.005 * 0.5))
    multiplied = next(term for term in both.terms if isinstance(term, Product))
    assert multiplied.corrections(at)["X"] == pytest.approx(-0.0025)


def test_sinumerik_cec_direction_acts_in_one_direction_of_travel():
    text, at = CEC.format(direction=1, other=0), {"Y": np.array(400.0), "Z": np.array(0.0)}
    directed = tables("sinumerik-cec", text)
    moves = [directed.corrections(at, direction)["X"] for direction in (1, -1)]
    assert moves == pytest.approx([-0.012, 0.0])
    keys = {one.key: one for one in imported(text).series}  # the sag of X over Y, what Z adds
    assert set(keys) == {"EXY", "EXZ"}
    assert keys["EXY"].mean(FORWARD)[-1] == pytest.approx(12.0)
    assert keys["EXY"].mean(BACKWARD)[-1] == pytest.approx(0.0)


def test_fanuc_trilinear_formula_for_one_cell():
    corners = np.array([3.0, 7.0, -2.0, 5.0, 11.0, -6.0, 4.0, 9.0])
    values = corners.reshape(2, 2, 2, 1)
    places = ((0.0, 10.0), (0.0, 20.0), (0.0, 40.0))
    shares = [[1.0 - share, share] for share in (0.3, 0.6, 0.25)]
    expected = np.einsum("i,j,k,ijk", *shares, values[..., 0])
    grid = Grid3(("X", "Y", "Z"), places, np.broadcast_to(values, (2, 2, 2, 3)))
    at = {"X": np.array(3.0), "Y": np.array(12.0), "Z": np.array(10.0)}
    assert grid.corrections(at)["X"] == pytest.approx(expected, abs=1e-12)
    assert expected == pytest.approx(2.77, abs=1e-9)


def test_fanuc_counts_are_detection_units_times_the_magnification():
    head = "# three-dimensional error compensation\n# detection unit = 0.0001 mm\n"
    rows = [f"{head}# magnification = 3\npoint,X [mm],Y [mm],Z [mm],CX,CY,CZ"]
    for number, (z, y, x) in enumerate(product((0, 10), repeat=3), start=1):
        rows.append(f"{number},{x},{y},{z},{number},0,{-number}")
    at = {"X": np.array(10.0), "Y": np.array(0.0), "Z": np.array(0.0)}
    found = tables("fanuc-3d", "\n".join(rows)).corrections(at)
    assert (found["X"], found["Z"]) == (pytest.approx(6e-4), pytest.approx(-6e-4))


TYPE_0 = "-1.000 -1.005 -0.995\n0.000 0.002 -0.003\n1.000 1.003 0.998\n"
TYPE_1 = "-1.000 0.005 -0.005\n0.000 0.002 -0.003\n1.000 0.003 -0.004\n"


def both_ways(text, variant, places):
    (table,) = tables("linuxcnc-comp", text, axis="X", variant=variant).terms
    at = {"X": np.array(places)}
    return [table.corrections(at, direction)["X"] for direction in (1, -1)]


def test_linuxcnc_type_0_example_adds_nominal_minus_actual():
    forward, reverse = both_ways(TYPE_0, "type-0", [-2.0, -1.0, -0.5, 0.0, 1.0, 5.0])
    assert forward == pytest.approx([0.005, 0.005, 0.0015, -0.002, -0.003, -0.003])
    assert reverse == pytest.approx([-0.005, -0.005, -0.001, 0.003, 0.002, 0.002])


def test_linuxcnc_type_1_example_is_added_as_it_stands():
    forward, reverse = both_ways(TYPE_1, "type-1", [-1.0, 0.0, 1.0])
    assert forward == pytest.approx([0.005, 0.002, 0.003])
    assert reverse == pytest.approx([-0.005, -0.003, -0.004])


def test_matrixkins_squareness_of_printed_diagonals():
    assert squareness(140.4, 142.8) == pytest.approx(0.016950, abs=5e-7)


def test_matrixkins_shear_is_the_squareness_of_y():
    text = "setp matrixkins.C_xx 1\nsetp matrixkins.C_xy 0.01695\nsetp matrixkins.C_yy 1.0001\n"
    found = imported(text)
    # the joints are C·p: without the matrix the machine stands at C⁻¹·p
    assert found.constants == {"EC0Y": pytest.approx(16950.0 / 1.0001)}
    # the joint moves 0.1 mm/m further than commanded: the axis would be that much short, were it
    # not for the cosine of its rotation
    cosine = math.cos(16950.0e-6 / 1.0001)
    scale_um_per_mm = 1e3 * (1.0 / 1.0001 - cosine)
    assert found.curves["EYY"] == {"poly": [0.0, pytest.approx(scale_um_per_mm, abs=1e-4)]}
    assert {key for key, curve in found.curves.items() if abs(curve["poly"][1]) > 1e-3} == {"EYY"}


def test_klipper_printed_lengths():
    # by hand: side² = (2·140.4² + 2·142.8² − 4·99.8²) / 4, then cot of the angle at A
    ac, bd, ad = 140.4, 142.8, 99.8
    side = math.sqrt((2 * ac**2 + 2 * bd**2 - 4 * ad**2) / 4)
    cosine = (ac**2 - side**2 - ad**2) / (2 * side * ad)
    assert skew_factor(ac, bd, ad) == pytest.approx(cosine / math.sqrt(1 - cosine**2), rel=1e-12)
    assert skew_factor(ac, bd, ad) == pytest.approx(-0.0169507, abs=5e-8)
    text = "SET_SKEW XY=140.4,142.8,99.8 XZ=141.6,141.4,99.8 YZ=142.4,140.5,99.5\n"
    found = imported(text)
    assert set(found.constants) == {"EC0Y", "EA0Z", "EB0Z"}
    # the diagonal in X+/Y+ is the shorter one: Y leans towards −x, which is +γ about z
    assert found.constants["EC0Y"] == pytest.approx(16950.7, abs=0.1)


@pytest.mark.parametrize("factor", [-0.3, -1e-5, 0.0, 2e-4, 0.1])
def test_skew_lengths_are_the_inverse_of_the_factor(factor):
    assert skew_factor(*skew_lengths(factor)) == pytest.approx(factor, abs=1e-12)


def test_marlin_corrects_x_over_z_by_both_factors():
    at = {"X": np.array(0.0), "Y": np.array(10.0), "Z": np.array(100.0)}
    found = tables("marlin", "M852 I0.01 J0.02 K0.03\n").corrections(at)
    # planner.h: x −= y·xy + z·(xz − xy·yz), y −= z·yz
    assert found["X"] == pytest.approx(-(10 * 0.01 + 100 * (0.02 - 0.01 * 0.03)))
    assert (found["Y"], found["Z"]) == (pytest.approx(-3.0), pytest.approx(0.0))


COM = """BEGIN TAB_Z.COM MM
NR    AXISPOS     BACKLASH    Y
0     -990                    0
1     -973.616                -0.06
2     -957.232                -0.09
3     -940.848
4     -924.464
5     -908.08                 -0.12
[END]
"""
CMA = """BEGIN CONFIG.CMA MM
NR    ACTIVE      Y           Z
0     *                       TAB_Z
[END]
"""


def test_heidenhain_y_over_z_of_the_manual_interpolates_lines_without_entry():
    # TNC 306, page 4-21: Y = F(Z), lines 3 and 4 without entry
    files = sources(COM, CMA, names=("TAB_Z.COM", "CONFIG.CMA"))
    (table,) = find_format("heidenhain").tables(files, ReadOptions()).terms
    assert (table.source, table.target) == ("Z", "Y")
    at = np.array([-1000.0, -981.808, -940.848, -924.464, -908.08, 0.0])
    assert table.corrections({"Z": at})["Y"] == pytest.approx(
        [0.0, 0.03, 0.10, 0.11, 0.12, 0.12], abs=1e-12
    )
    found = read_errors(files, ReadOptions()).imported
    assert [one.key for one in found.series] == ["EYZ"]


ETALON = """// Every parameter is specified in a block.
[C0B]
VALUE = 0.000022355737
[A0B]
VALUE = 0.000047622950
[EXY]
Gridpoints = {
          -280.0 -0.001358635132
          -270.0 -0.000240680764
          -260.0 0.000877273605
          260.0 -0.001297146744
          270.0 -0.000316265101
}  // end of EXY
"""
ISG_TWO = """// The argument "Z" now crops up in the header.
Z      X      EXX    EYX    EZX    EAX    EBX    ECX
// In the first block Z is always = 0.
0.0    0.0    0.02   0.01   0.07   0.00   0.0042 0.003
0.0    10.0   0.00   -0.1   0.01   0.00   0.0011 0.002
// In the second block Z is always = 100.
100.0  0.0    0.01   0.02   0.03   0.07   0.0040 0.003
100.0  10.0   0.03   -0.09  0.03   0.06   0.0015 0.000
"""


def test_etalon_example_in_um_and_urad():
    found = imported(ETALON)
    assert found.constants == {"EC0B": pytest.approx(22.355737), "EA0B": pytest.approx(47.622950)}
    (one,) = found.series
    assert one.key == "EXY"
    assert one.values[0] == pytest.approx(-1.358635132)
    assert one.positions == (-280.0, -270.0, -260.0, 260.0, 270.0)


def test_isg_example_of_two_arguments():
    found = imported(ISG_TWO)
    assert [plane.key for plane in found.surfaces] == ["EXX", "EYX", "EZX", "EAX", "EBX", "ECX"]
    first = found.surfaces[0]
    assert (first.axes, first.first, first.second) == (("X", "Z"), (0.0, 10.0), (0.0, 100.0))
    assert first.values == ((20.0, 10.0), (0.0, 30.0))
    pitch = found.surfaces[4]
    assert np.array(pitch.values) == pytest.approx(np.array([[4200.0, 4000.0], [1100.0, 1500.0]]))


def test_mean_reversal_and_repeatability_of_five_targets_and_five_runs(tmp_path):
    targets = (0.0, 100.0, 200.0, 300.0, 400.0)
    rng = np.random.default_rng(230)
    there = np.round(rng.normal(2.0, 0.5, (5, 5)), 1)
    back = np.round(rng.normal(0.5, 0.5, (5, 5)), 1)
    lines = ["X [mm],run,direction,EXX [um]"]
    for run in range(5):
        lines += [f"{q},{run + 1},+,{there[run, i]}" for i, q in enumerate(targets)]
        lines += [f"{q},{run + 1},-,{back[run, 4 - i]}" for i, q in enumerate(reversed(targets))]
    (one,) = imported("\n".join(lines)).series
    mean_up, mean_down = there.sum(axis=0) / 5, back.sum(axis=0) / 5
    assert one.mean(FORWARD) == pytest.approx(mean_up)
    assert one.mean(BACKWARD) == pytest.approx(mean_down)
    assert one.values == pytest.approx((mean_up + mean_down) / 2)
    assert one.reversal == pytest.approx(mean_up - mean_down)
    s_up = np.sqrt(((there - mean_up) ** 2).sum(axis=0) / 4)
    s_down = np.sqrt(((back - mean_down) ** 2).sum(axis=0) / 4)
    expected = np.maximum.reduce(
        [2 * s_up + 2 * s_down + np.abs(mean_up - mean_down), 4 * s_up, 4 * s_down]
    )
    assert one.repeatability == pytest.approx(expected)
