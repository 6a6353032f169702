"""Programs from the field, each with the length of its path in closed form, or its first refusal.

Rebuilt after bug reports, manuals and posts of controls.
"""

from math import asin, cos, hypot, pi, radians, sin, sqrt, tau
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import warpspace
from warpspace.analysis.description import ignore_progress
from warpspace.cli.main import cli
from warpspace.exceptions import SceneError
from warpspace.parts.program import Program, ProgramResult
from warpspace.scene.library import parse_scene

MILL, PRINTER = "machine_gantry_mill", "machine_printer_3d"
BC, AC = "machine_trunnion_bc", "machine_trunnion_ac"
INCH = 25.4
H1 = {"offset": (("H1", 100.0),)}


def run(text: str, scene: Any = MILL, **options: Any) -> ProgramResult:
    loaded = warpspace.load_scene(scene) if isinstance(scene, str) else scene
    return Program(file="p.nc", text=text, **options).run(loaded, ignore_progress)


def arc(radius: float, chord: float) -> float:
    """Return the length of the shorter arc over a chord, at most a half circle."""
    return 2.0 * max(radius, chord / 2.0) * asin(min(chord / 2.0 / radius, 1.0))


def holes(depth: float, clear: float, pecks: list[float]) -> float:
    """Return the path of one G83 hole from its initial level and back, pecks added up."""
    cut = np.cumsum(pecks)
    return 2.0 * clear + depth + sum(pecks) + 2.0 * float(cut[:-1].sum())


def spiral(first: float, last: float, angle: float) -> float:
    turn = np.linspace(0.0, angle, 10_001)
    points = (first + (last - first) * turn / angle) * np.exp(1j * turn)
    return float(np.abs(np.diff(points)).sum())


def block(*lines: str) -> str:
    return "\n".join(lines)


ARCS_G18 = """%
(T1  D=0.375 CR=0 - ZMIN=-0.075 - flat end mill)
G90 G94
G17
G20
M9
T1 M6
S2000 M3
G54
G0 X0.5228 Y-0.1828
Z0.2
Z0.05
G1 Z-0.0375 F8
G18 G3 X0.4853 Z-0.075 I-0.0375
G1 X0.3125
X0.1625 F12
G17 G2 Y0.0852 J0.134
G1 X0.3125
G2 Y-0.1828 J-0.134
G1 X-0.1625
X-0.3125
G2 Y0.0852 J0.134
G1 X-0.1625
G18 G2 X-0.125 Z-0.0375 K0.0375 F8
G0 Z0.2
G17
M30
%"""
DRAG_KNIFE = """G90
G0 X0.0000 Y0.0000 Z0.8000
(Dragknife Toolpath3)
T1
F20.0
G0 X6.0004 Y9.2749
G1   Z-0.0500 F20.0
G3 X7.4141 Y9.2740 R1.0000 F50.0
G1 X10.0048 Y6.6781
G2 X8.5911 Y6.6790 R1.0000
G1 X9.7718 Y9.7373
G3 X8.3572 Y8.3234 R1.0000 F50.0
G0   Z0.8000"""
HALVES = """G0 Z0.0000
N10 ( NEXT SHAPE )
N20 G00 X34.8831 Y-4.3512 Z0.0000
N30 G01 Z-0.1000 F2000.0
N40 G03 X36.8831 Y-4.3512 R1.0000 F2000.0000
N50 G03 X34.8831 Y-4.3512 R1.0000
N90 G01 X34.8331 Y-8.3512
N100 G02 X36.9331 Y-8.3512 R1.0500 F2000.0000
N110 G02 X34.8331 Y-8.3512 R1.0500
N240 G00 Z0.0000"""
HELICES = """G90
G21
M0
G0 Z5.00
G0 X0.00 Y0.00
G0 Z5.00
G0 X0.00 Y9.80
G0 Z1.00
G3 X0.00 Y-9.80 Z0.00 R9.80 F150.00
G3 X0.00 Y9.80 Z-1.00 R9.80 F150.00
G3 X0.00 Y-9.80 R9.80 F300.00
G3 X0.00 Y9.80 R9.80
G1 X0.00 Y12.40 F300.00
G3 X0.00 Y-12.40 R12.40 F300.00
G3 X0.00 Y12.40 R12.40
G0 Z5.00"""
CIRCLE_DIAMOND = """(Circle Diamond Square, boundary cuts)
n0080 G90 M9
n0090 G43 H1 g20
n1140 G0 X+2.0 Y+0.375 Z+3.0 (start cut around circle)
n1150 G0 Z+2.1
n1160 G1 Z+1.6875
n1170 G2 X+0.375 Y+2.0 R+1.625
n1180 G2 X+2.0 Y+3.625 R+1.625
n1190 G2 X+3.625 Y+2.0 R+1.625
n1200 G2 X+2.0 Y+0.375 R+1.625
n1210 G1 Z+2.1 (end cut around circle)
n2160 G0 X+2.0884 Y+0.4116
n2180 G1 Z+1.8437
n2190 G2 X+1.9116 Y+0.4116 R+0.125
n2200 G1 X+0.4116 Y+1.9116
n2210 G2 X+0.4116 Y+2.0884 R+0.125
n2220 G1 X+1.9116 Y+3.5884
n2230 G2 X+2.0884 Y+3.5884 R+0.125
n2240 G1 X+3.5884 Y+2.0884
n2250 G2 X+3.5884 Y+1.9116 R+0.125
n2260 G1 X+2.0884 Y+0.4116
n2270 G1 Z+2.1
n3510 M2"""
CYCLES = """{}
g98
g90
g20
f10
{}
(one)
g81 {}1 {}1 {}-1 r1
g81 {}1 {}2 {}0.5 r3
g81 {}1 {}3 {}4 r5
m2"""
SHIFTED = "G17 G90 G54\nG0 X0 Y0 Z10\nTRANS X100 Y50\nG1 Z0 F300\nG1 X10\nTRANS\nG0 Z10\nM30"
REFERENCE = "G17 G90 G54\nG0 X0 Y0 Z10\nG1 X100 Y50 Z0 F300\nG1 X110\nG0 Z10\nM30"
ROTATED = """N13 G17 G90 G71
N15 T1 D1
N16 M6
N18 G54
TRANS X100 Y50
N19 G0 X0 Y0
N20 Z15
N21 G1 Z0 F300
N22 X10
AROT Z30
N23 G1 X20 Y0
TRANS
N25 G0 Z15
N26 M30"""
CORNERS = """G21 G90 G17
G0 X0 Y0 Z0
G7.1 C50
G1 C90 F100
G107
G68.1 R45
G1 X10
G71 I30 J0 K30 L4
G101 X0
G1 X20
G50.1 X0
G1 X30
M30"""
TCP = """%
O00234 (UMC)
G21 G90 G17 G40 G80
T1 M06
G00 G54 X0 Y0
{} H1 Z20.
G1 Z0 F500
G1 X50. B30. C45.
G1 X60. B40. C90.
G49
G00 Z20.
M30
%"""
WORK_OFFSET = TCP.replace("{} H1", "G254\nG43 H1").replace("G49", "G255")
MIRRORED = "G21 G90 G17\nG0 X0 Y0 Z0\nG1 X10 F100\nG101 X0\nG1 X20\nG100 X0\nG1 X30\nM30"
DEEP_HOLES = """%
O00083 (HAAS DEEP HOLE)
G21 G90 G17 G40 G80
T1 M06
G00 G54 X0 Y0
G43 H01 Z10.
G83 Z-40. R2. I10. J2. K3. F100.
X50.
X50. Y50.
G80
G00 Z10.
M30
%"""
PECKS = "G21 G90 G17\nG0 X0 Y0 Z10.\nG83 X10. Y10. Z-40. R2. Q10. {} F100.\nX50.\nG80\nM30"
TWO_HOLES = 10 * sqrt(2) + 40 + 2 * holes(42, 8, [10, 10, 10, 10, 2])
OKUMA = """$TEST.MIN%
O1001
(FACE)
G0 Z400 G40 G80 G17
G116 T1
G15 H1
S3000 M3
G0 X0 Y0
G56 H1 Z50
G1 Z0 F300
X50
G2 X60 Y-10 I0 J-10
G0 Z50
M2"""
OKUMA_REFERENCE = "G0 Z400 G40 G80 G17\nS3000 M3\nG0 X0 Y0\n{} H1 Z-150\nG1 Z-200 F300\nX50\nM2"
HEADED = "{}\nG21 G90 G17\nG0 X0 Y0 Z10\nG1 X50 F300\nM30\n%"
KLARTEXT = """BEGIN PGM 0011 MM
1 BLK FORM 0.1 Z X-262.532 Y-262.55 Z-75.95
2 BLK FORM 0.2 X262.532 Y262.55 Z0.05
3 TOOL CALL 3 Z S3263 DL+0.0 DR+0.0
4 L X-80.644 Y-95.2 Z+100.0 R0 FMAX M3
5 L Z-23.222 F333
6 CC X+0 Y+0
7 C X+80.644 Y+95.2 DR+
8 M30
END PGM 0011 MM"""
FACE = """{}
; 1001
N10 G90 G94
N11 G71
N12 G64
N13 G17
N14 G0 SUPA Z0 D0
; FACE1
N15 {}
N16 M6
N17 S2000 M3
N18 G54
N19 G0 X30 Y-20
N20 Z15 D1
N21 G1 Z0 F300
N22 X10
N23 G2 X0 Y-10 I=AC(10) J=AC(-10)
N24 G3 X-10 Y0 CR=10
N25 G0 Z15
N26 M30"""
SPACERS = """%
(1 ABSTANDSHALTER)
(T1  D=8. CR=0. - ZMIN=-10. - SCHAFTFRSER)
G90 G94 G17 G91.1
G21
G53 G0 Z0.
(2D-TASCHE1)
M9
M11
T1 M6
S13926 M3
G54
G0 X10. Y10.
G0 G43 Z15. H1
G1 Z-1. F350.
G1 X20.
G0 Z15.
M9 G30
T12 M6
S18000 M3
G54
M9
G0 X26.056 Y18.423
G0 G43 Z15. H12
G1 Z5. F350.
G1 X25.409 Y17.953 Z-2.5
G3 X23.65 Y14.5 I2.508 J-3.453
G1 Y2.
G2 X21.5 Y-0.15 I-2.15 J0.
G1 X1.5
G2 X-0.65 Y2. I0. J2.15
G53 G0 Z0.
M30
%"""
DRILLED = "G21 G90 G17\nG0 X0 Y0 Z0\nG98 {} X10 Y10 Z-10 R2 {} F100\nG80\nG1 X50 Y50 F300\nM30"
SUBPROGRAM = """(2drill3_big_7mm)
G017 G21 G49 G80 G90 G91.1
G0Z33.7919
M3 S9000
G52 X0Y0
M98 P23
G52 X0Y110
M98 P23
G52 X0Y0
G0X0.0000Y0.0000
M5
M30
%
O23
G0 X32.7650 Y29.0291 Z33.7910
G1   Z11.0000 F1500
M99"""
REPEATED = """G0 X10 Y10 Z2 F2000
M98 P12       (call sub once)
G0 X30 Y10 Z2
M98 P12 L2    (call sub twice)
M30
O12
G91
G1 Z-4
Y10
X10
G90
M99"""
WEAR = """%
O1000 (PIEZA1)
N100 (COMPENSATION-WEAR)
N1 G90 G17 G40 G80 G00
N108 M06 T1 ()
N112 G00 G54 G90 X30.749 Y-32.5 S3500 M03
N114 G43 H1 Z120.
N116 Z25.
N118 Z2.
N120 G01 Z-0.5 F50.
N122 G41 D1 X31. F1500.
N124 G03 X25. Y-26.5 I-6. J0.
N126 G01 X-25.
N128 G02 X-26.5 Y-25. I0. J1.5
N144 G01 G40 X19.251
M30
%"""
SWIVELLED = """N13 G17 G90 G71
N15 T1 D1
N16 M6
N18 G54
N19 G0 X0 Y0
N20 Z15
CYCLE800(1,"TC1",100000,57,0,0,0,0,90,0,0,0,0,1,100,1)
N21 G1 Z0 F300
N22 X10
CYCLE81(15,0,5,-10,0)
MCALL CYCLE83(15,0,2,-20,,-5,,2,0,0,1,0)
N30 X20 Y20
MCALL
N25 G0 Z15
N26 M30"""
SPOTS = """G21 G90 G17
G0 X23. Y9.615 Z10.
G82 Z-2.79 R0.21 P0 F200
  X40.2 Y9.615 Z0.21
  X57.4 Y9.615 Z0.21
G80
"""
SPOTS_MM = 9.79 + 3 + 12.79 + 2 * (17.2 + 2 * 9.79)
SLICED = """; generated by PrusaSlicer
M73 P0 R10
M201 X1000 Y1000 Z200 E5000 ; sets maximum accelerations
G90 ; use absolute coordinates
M83 ; extruder relative mode
M104 S215
{} ; home all without mesh bed level
G80 ; mesh bed leveling
G92 E0.0
G1 Y-3.0 F1000.0
G1 X60.0 E9.0 F1000.0 ; intro line
G1 Z0.2 F720
G92 E0.0
G1 X90.5 Y90 E1.2
G2 X95 Y95 I2.5 J2.5 E.2
G1 E-.8 F2100
M107"""
SPIRAL = spiral(hypot(2.5, 2.5), hypot(2, 2.5), pi - np.angle(complex(2, 2.5) / complex(2.5, 2.5)))
SLICED_MM = 3 + 60 + 0.2 + hypot(30.5, 93) + SPIRAL
LIMITS = """M201 X500.00 Y500.00 Z100.00 E5000.00; Setup machine max acceleration
M203 X500.00 Y500.00 Z10.00 E50.00
M205 X8.00 Y8.00 Z0.40 E5.00
G28; Home
M92 X80 Y80 Z400 E99
"""
PRINT = "G28; Home\nG1 Z2.0 F3000\nG1 X10.1 Y20 Z0.28 F5000.0\nG1 X10.1 Y90.0 Z0.28 F1500.0 E15"
PRINT_MM = 2 + sqrt(10.1**2 + 20**2 + 1.72**2) + 70


@pytest.mark.parametrize(
    ("text", "length", "options"),
    [
        # lead-in arcs in G18, inches
        (ARCS_G18, 3.10348 * INCH, {}),
        # arcs by their radius; a chord a little above the diameter is a half circle
        (DRAG_KNIFE, hypot(6.0004, 9.2749) + 0.85 + 2 * arc(1, hypot(1.4137, 0.0009))
         + hypot(2.5907, 2.5959) + hypot(1.1807, 3.0583) + arc(1, hypot(1.4146, 1.4139)) + 0.85,
         {}),
        (HALVES, 0.1 + tau + hypot(0.05, 4) + tau * 1.05 + 0.1, {}),
        (HELICES, 5 + 9.8 - 1 + 2 * hypot(9.8 * pi, 1) + tau * 9.8 + 2.6 + tau * 12.4 + 6, {}),
        (block("G90 G21 G17", "G0 X32.7 Y4.44 Z0", "G3 X30. Y0.0 R5.", "G2 I-30.",
               "G3 X32.7 Y-4.44 R5."), 2 * arc(5, hypot(2.7, 4.44)) + 60 * pi, {}),
        (block("G21 G90", "G0 X0 Y0 Z0", "G3 X41.089 Y-28.164 I20.5445 J-14.082 F1256",
               "X0 Y0 I-20.5445 J14.082", "M2"), tau * hypot(20.5445, 14.082), {}),
        ("G17 G21 G90 G90 G94 G54 M0 M5 M9\nG0 X10 Y10.0 Z0\nG02 X20 Y0 R-10", 15 * pi, {}),
        # cycles of LinuxCNC in two planes
        (CYCLES.format("g17 ; XY", "g0 x0 y0 z2", *"xyz" * 3), 19.41421 * INCH, {}),
        (CYCLES.format("g19 ; YZ", "g0 x2 y0 z0", *"yzx" * 3), 19.41421 * INCH, {}),
        # the sample program of a circle and a diamond
        (CIRCLE_DIAMOND, 554.0823, {}),
        # words after shifts and rotations
        (REFERENCE, sqrt(100**2 + 50**2 + 10**2) + 10 + 10, {}),
        (ROTATED, 15 + 10 + hypot(20 * cos(radians(30)) - 10, 20 * sin(radians(30))) + 15, {}),
        # G234 is G43.4; mirror of Haas
        (TCP.format("G234"), 105.28, {"scene": BC, **H1}),
        (TCP.format("G43.4"), 105.28, {"scene": BC, **H1}),
        (MIRRORED, 10 + 30 + 50, {"dialect": "haas"}),
        # G83 with Q; pecks of Haas without it, or with a least peck K that has no effect
        (PECKS.format(""), TWO_HOLES, {}),
        (PECKS.format("K0.2"), TWO_HOLES, {"dialect": "haas"}),
        (PECKS.format("K3."), TWO_HOLES, {"dialect": "haas"}),
        (DEEP_HOLES, 100 + 3 * holes(42, 8, [10, 8, 6, 4, 3, 3, 3, 3, 2]), H1),
        # tool length of Okuma, with its header
        (OKUMA_REFERENCE.format("G56"), 450 + 50 + 50, H1),
        (OKUMA_REFERENCE.format("G43"), 450 + 50 + 50, H1),
        (OKUMA, 250 + 50 + 50 + 5 * pi + 50, H1),
        (OKUMA, 350 + 50 + 50 + 5 * pi + 50, {}),
        # headers, and bytes of punched tapes
        (HEADED.format("%\n<FLANGE_OP1>(FLANGE)"), 50, {}),
        (HEADED.format("%\nO<FLANGE_OP1>(FLANGE)"), 50, {}),
        (HEADED.format("% PART 1234-5 REV B\nO1001"), 50, {}),
        (HEADED.format("\0\0\0%\nO1001") + "\n\0\0", 50, {}),
        (FACE.format("%_N_1001_MPF\n;$PATH=/_N_WKS_DIR", 'T="FACE_50"'), 65 + 10 * pi, {}),
        # rounded and chamfered corners
        (block("O100 (CORNER)", "G21 G90 G17", "G0 X0 Y0 Z0", "G1 X50 ,R5. F300", "Y50 ,C2.", "X0",
               "M30"), 45 + 2.5 * pi + 43 + 8**0.5 + 48, {}),
        # everyday words
        (SPACERS, 15 + 16 + 10 + 16 + 10 + sqrt(0.647**2 + 0.47**2 + 7.5**2)
         + arc(hypot(2.508, 3.453), hypot(1.759, 3.453)) + 12.5 + 20 + 2.15 * pi + 2.5, {}),
        (block("%", "O1", "G21 G90 G17", "G91 G30 Z0", "T1 M6", "G90 G54 G0 X0 Y0", "G43 H1 Z10",
               "G1 Z0 F100", "X50", "M30", "%"), 60, {}),
        *((DRILLED.format(code, q), 2 + 10 * sqrt(2) + 12 + 12 + 40 * sqrt(2), {})
          for code, q in (("G73", "Q2"), ("G84", ""), ("G85", ""))),
        (block("G20", "G90", "G40", "G17", "G92X0.0Y0.0Z0.", "G0 X10.375 Y5.8438", "M3",
               "G3 I-4.5312 F100.0", "M5", "M30"), tau * 4.5312 * INCH, {}),
        (SUBPROGRAM, 2 * 22.791 + hypot(110, 22.791) + hypot(32.765, 139.0291), {}),
        (REPEATED, 24 + sqrt(20**2 - 20**2 + 10**2 + 10**2 + 4**2) + 48, {}),
        (WEAR, 95 + 23 + 2.5 + 0.251 + 3 * pi + 50 + 0.75 * pi + 45.751,
         {"offset": (("D1", 0.0),)}),
        # rotation in the plane; names of tools
        ("G17 G90\nG0 X0 Y0 Z0\nROT RPL=45\nG1 X10 F100\nM30", 10, {}),
        (FACE.format(";$PATH=/_N_WKS_DIR", "T1"), 65 + 10 * pi, {}),
        (block("N13 G17 G90", 'N15 T="FACE_50"', "N16 M6", "N18 G54", "N19 G0 X0 Y0", "N20 Z15",
               "N22 X10", "N26 M30"), 10, {}),
        # E without a blank
        ("G21G90G17\nG0X0Y0Z0\nG187P3E0.01\nG1X10.F100\nM30", 10, {}),
        ("G21G90G17\nG0X0Y0Z0\nG187 P3 E0.01\nG1X10.F100\nM30", 10, {}),
        # a move with a new tool length
        ("G21 G90 G17\nG0 X0 Y0 Z0\nG43 H1 Z-200\nG1 X10 F100\nM30", 110, H1),
        # a depth that is the R plane
        (f"{SPOTS}M30", SPOTS_MM, {}),
        # numbers without a decimal point
        (HEADED.replace("10\n", "10000\n").replace("X50 F300", "X50000 F300\nY50000").format("%"),
         100_000, {}),
        (HEADED.replace("10\n", "10000\n").replace("X50 F300", "X50000 F300\nY50000").format("%"),
         100, {"least_increment": 0.001}),
        # words of slicers, parameters of M words
        (block("G90", "M82", "G28", "G0F3600X90.1Y89.2Z0.3", "G1F1800X100.2Y89.2E0.5",
               "G1X101Y90E0.7", "M400"), sqrt(90.1**2 + 89.2**2 + 0.3**2) + 10.1 + hypot(0.8, 0.8),
         {"scene": PRINTER}),
        ("M115 U3.9.1\nG28\nG1 X10 Y10 Z1\nG1 X20 E1", sqrt(201) + 10, {"scene": PRINTER}),
        (SLICED.format("G28"), SLICED_MM, {"scene": PRINTER}),
        (SLICED.format("G28 W"), SLICED_MM, {"scene": PRINTER}),
        (LIMITS + PRINT, PRINT_MM, {"scene": PRINTER}),
        (PRINT, PRINT_MM, {"scene": PRINTER}),
    ],
)  # fmt: skip
def test_the_whole_program_is_executed(text: str, length: float, options: dict[str, Any]):
    result = run(text, **options)
    assert result.program.refused == {}
    assert result.length_mm == pytest.approx(length, abs=2e-3)


@pytest.mark.parametrize(
    ("text", "length", "refusal", "options"),
    [
        # X and Y are not programmed after the shift
        (SHIFTED, 0, (4, "G1", "expected X, Y before"), {"offset": (("G54Z", -400.0),)}),
        # words of Fanuc that bend the path; mirror without a dialect; a turned work offset
        (CORNERS, 0, (3, "G7.1", "expected a word that is executed"), {}),
        (MIRRORED, 10, (4, "G101", "dialect haas"), {}),
        (WORK_OFFSET, 20, (9, "B30", "G254 cancelled before"), {"scene": BC, **H1}),
        # repetitions or the least peck
        (PECKS.format("K0.2"), 0, (3, "K0.2", "dialect haas"), {}),
        (PECKS.format("K3."), 0, (3, "K3", "dialect haas"), {}),
        # a corner next to an arc
        (block("G17", "G54X0Y0", "G01X10.Y10.,R20.", "G02X40.Y15.R20.,R0.5", "G01Y20.", "X50.,R2.",
               "X50.Y0", "M02"), 10 * sqrt(2), (4, ",R0.5", "no ,R with G2"), {}),
        # an unknown wear
        (WEAR, 95 + 23 + 2.5, (11, "G41", "the offset D1=0"), {}),
        # a plane without rotary axes, and with X and Y that are not programmed in it
        (SWIVELLED, 0, (7, "CYCLE800", "two rotary axes"), {}),
        (SWIVELLED, 0, (8, "G1", "expected X before"), {"scene": AC}),
        (SWIVELLED.replace("CYCLE800", ";"), 25, (10, "CYCLE81", "expected a word"), {}),
        # no pecks
        (SPOTS + "G83 Z-7.732 R0.21 Q0. P0 F200\n  X40.2 Y9.615 Z0.21\nG80\nM30",
         SPOTS_MM, (7, "G83", "pecks of Q above 0"), {}),
        # a shift of SINUMERIK
        (block("G17 G90", "G54", "G0 X0 Y0 Z0", "G58 X10 Y20", "G1 X5 F100", "G500", "G1 X30",
               "M30"), 0, (4, "G58", "expected a word that is executed"), {}),
    ],
)  # fmt: skip
def test_the_path_ends_before_the_first_word_not_executed(
    text: str, length: float, refusal: tuple[int, str, str], options: dict[str, Any]
):
    line, word, reason = refusal
    result = run(text, **options)
    assert next(iter(result.program.refused.items())) == (line, word)
    assert reason in result.program.reasons[line]
    assert result.length_mm == pytest.approx(length, abs=2e-3)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (KLARTEXT, "line 1: BEGIN PGM; HEIDENHAIN Klartext; expected G-code"),
        (block("%", "(Max material length needed (X): 70.0000 in / 1778.0 mm)", "G0 X0 Y0 Z10"),
         r"line 2: \(MAX; expected the end of the comment"),
    ],
)  # fmt: skip
def test_the_program_is_no_program(text: str, problem: str):
    with pytest.raises(SceneError, match=problem):
        run(text)


@pytest.mark.parametrize(
    ("text", "scene"), [(SHIFTED, MILL), (CORNERS, MILL), (WORK_OFFSET, BC), (MIRRORED, MILL)]
)
def test_no_corrected_program_is_written(text: str, scene: str, tmp_path: Path):
    (tmp_path / "a.nc").write_text(text)
    arguments = ["program", scene, str(tmp_path / "a.nc"), "-o", str(tmp_path / "b.nc")]
    assert CliRunner().invoke(cli, arguments).exit_code
    assert not (tmp_path / "b.nc").exists()


def test_lengths_of_the_lines_of_cycles():
    """Cycles of RS274NGC: absolute and incremental, repeated, in inches."""
    text = """g20
    g0 x0 y0 z3
    n0020 g17 f16
    n0030 g81 x3 y4 r0.2 z-1.1
    n0040     x1 y0 r0 g91 l3 (three more)
    n0050     y-2 r0.1 (one more g81)
    n0060 g82 g90 x4 y5 r0.2 z-1.1 p0.6
    n0070     x2 z-3.0 (one more G82)
    g80
    m2"""
    path = run(text).path
    step = np.linalg.norm(path.step_mm, axis=1)
    lengths = [step[path.line == line].sum() for line in (4, 5, 6, 7, 8)]
    assert lengths == pytest.approx([335.28, 243.84, 109.22, 302.401, 14 * INCH], abs=1e-3)


XYZBC = """
title = "xyzbc-trt"
[machine]
chain = "wCBFXYZt"
direction = {{ B = {0}, C = {0} }}
[machine.travel]
X = [-300, 300]
Y = [-250, 250]
Z = [-400, 400]
B = [-120, 120]
C = [-360, 360]
[workspace]
X = [-300, 300]
Y = [-250, 250]
Z = [-400, 400]
B = 0
C = 0
"""
JOINTS = block("G21 G90 G43.4 H1", "G1 X1 Y0 Z2 B0 C0 F500", "X1 Y0 Z2 B90 C0", "X1 Y0 Z2 B0 C90",
               "X1 Y0 Z2 B90 C90", "G49", "M30")  # fmt: skip
TURNED = "G21 G90 G17 G54\nG0 X0 Y0 Z0 A0 C{}\nG43.4 H1 Z-100.\nX50. Y0\nC{}\nG49\nM30"


@pytest.mark.parametrize(
    ("text", "scene", "options", "line", "expected"),
    [
        # kinematics of LinuxCNC; a table by ISO 841 turns against its letter
        (JOINTS, parse_scene(XYZBC.format(-1), "iso"), {}, 3, {"X": -2, "Y": 0, "Z": 1}),
        (JOINTS, parse_scene(XYZBC.format(-1), "iso"), {}, 4, {"X": 0, "Y": -1, "Z": 2}),
        (JOINTS, parse_scene(XYZBC.format(1), "by the letter"), {}, 3, {"X": 2, "Y": 0, "Z": -1}),
        (JOINTS, parse_scene(XYZBC.format(1), "by the letter"), {}, 4, {"X": 0, "Y": 1, "Z": 2}),
        ("G21 G90 G43.4\nG1 X50 Y0 Z100 B0 C90 F500\nM30", parse_scene(XYZBC.format(-1), "iso"),
         {}, 2, {"X": 0, "Y": -50, "Z": 100}),
        # the length counts
        (OKUMA_REFERENCE.format("G56"), MILL, H1, 5, {"Z": -100}),
        # frame of the table at G43.4 (FANUC), or at rotary zero
        (TURNED.format("90.", "180."), AC, H1, 4, {"X": 50, "Y": 0, "C": 90}),
        (TURNED.format("90.", "180."), AC, {**H1, "tcp_frame": "zero"}, 4, {"X": 0, "Y": 50}),
        (TURNED.format("0", "90."), AC, H1, 4, {"X": 50, "Y": 0}),
        (TURNED.format("0", "90."), AC, H1, 5, {"X": 0, "Y": 50, "C": 90}),
    ],
)  # fmt: skip
def test_axis_positions_at_the_end_of_a_line(
    text: str, scene: Any, options: Any, line: int, expected: dict[str, float]
):
    point = run(text, scene, at_line=line, **options).line
    assert point
    assert {x: point.axes[x] for x in expected} == pytest.approx(expected, abs=1e-9)


def test_words_that_were_assumed_are_reported():
    assert "H12 without a length (line 24)" in str(run(SPACERS).as_json()["remarks"])
    assert "Z10 (line 3)" in str(run(HEADED.format("%")).as_json()["remarks"])
