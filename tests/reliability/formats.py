"""The files the program reads: for each format some good ones to begin with, and how it is read."""

import io
import re
import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from warpspace.acceptance_tests.plans import load_plan
from warpspace.analysis.adjuster_effects import adjuster_effects
from warpspace.analysis.adjustment_log import read_log
from warpspace.app.documents.transfers import unpack, upload_text
from warpspace.bench.base import find_test, run_test
from warpspace.calibration import read_readings
from warpspace.calibration.readings import bundled_data
from warpspace.diagnosis.symptoms import read_symptom
from warpspace.formats.compensation.compensate import Compensate, compensate
from warpspace.formats.registry import ReadOptions, find_format, formats, open_upload, read_errors
from warpspace.formats.to_scene import base_scene, build_imported_scene
from warpspace.parts.inspection_comparison import seal_prediction
from warpspace.parts.inspection_report import load_report
from warpspace.parts.part_shape import align
from warpspace.parts.program import Program
from warpspace.resources import assets_dir, find_data, scenes_dir
from warpspace.scene.library import load_scene, parse_scene, scene_names
from workbooks import xlsx


@dataclass(frozen=True)
class Format:
    name: str
    seeds: Callable[[], list[bytes]]
    read: Callable[[bytes, Path], object]
    share: float = 1.0
    text: bool = True
    words: tuple[bytes, ...] = ()  # of its own, what mutations put into it
    longest_s: float = 1.0


CSV_SCENE = b"""
machine = "dvf5000"
[errors]
EXX = { csv = "x.csv", column = "error" }
"""
WORDS = [
    *(b"nan", b"inf", b"-inf", b"1e308", b"5e-324", b"-0.0", b"1e5", b"true", b"false", b'""'),
    *(b"[", b"]", b"{", b"}", b"[[", b"]]", b"=", b".", b",", b"\n", b"\r\n", b"#", b'"', b"'"),
    *(b'"""', b"'''", b"\\u0000", b"\xff\xfe", b"\xef\xbb\xbf", b"\x00", b"\xf0\x9f\x98\x80"),
    *(b"machine", b"chain", b"wCBFXYZt", b"errors", b"EXX", b"EC0Y", b"ramp", b"poly", b"table"),
    *(b"harmonics", b"csv", b"column", b"tolerances", b"default", b"view", b"workspace", b"bodies"),
    *(b"../" * 8, b"/dev/zero", b"/proc/self/mem", b"[" * 500, b"a." * 500, b"9" * 400, b"0x"),
    *(b"<joint", b"</robot>", b"<!ENTITY x 'y'>", b"&x;", b"xyz=", b"rpy=", b"<mesh filename="),
]
"""What mutations put into texts: words of the formats, and what readers stumble over."""


def _put(content: bytes, folder: Path, name: str) -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


def _csvs() -> list[bytes]:
    rows = "\n".join(f"{x},{x / 100}" for x in range(-275, 276, 25))
    return [f"X,error\n{rows}\n".encode(), b"\xef\xbb\xbfX,error\r\n-275,0\r\n275,4.1\r\n"]


def _mesh_seeds(ending: str) -> list[bytes]:
    import trimesh

    shape = trimesh.creation.box((20.0, 30.0, 40.0))
    found = [shape.export(file_type=ending)]
    if ending == "stl":
        found += [shape.export(file_type="stl_ascii")]
        found += [b"\0" * 80 + struct.pack("<I", 2**31) + b"\0" * 50]
    if ending == "ply":
        found += [shape.export(file_type="ply", encoding="ascii")]
    return [each if isinstance(each, bytes) else each.encode() for each in found]


def _read_mesh(ending: str, content: bytes, folder: Path) -> object:
    from warpspace.bodies.mesh_files import load_mesh

    return load_mesh(_put(content, folder, f"x.{ending}"), "X")


URDF = """<?xml version="1.0"?>
<robot name="r">
  <link name="base"/><link name="tool"><visual><geometry><box size="0.1 0.1 0.2"/></geometry>
  </visual></link><link name="slide"><visual><origin xyz="0 0 0.1" rpy="0 0.1 0"/>
  <geometry><cylinder radius="0.1" length="0.4"/></geometry></visual><visual><geometry>
  <mesh filename="package://r/x.stl" scale="1 1 1"/></geometry></visual></link>
  <joint name="x" type="prismatic"><parent link="base"/><child link="slide"/>
    <origin xyz="0 0 0.1" rpy="0 0 0"/><axis xyz="1 0 0"/>
    <limit lower="-0.2" upper="0.3" effort="1" velocity="1"/></joint>
  <joint name="b" type="revolute"><parent link="slide"/><child link="tool"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="1.5" effort="1" velocity="1"/></joint>
</robot>
"""


def _read_urdf(content: bytes, folder: Path) -> object:
    from warpspace.bodies.mesh_files import frame_meshes
    from warpspace.scene.urdf import imported_text, omitted_notes, place_robot, read_robot

    path = _put(content, folder, "r.urdf")
    loaded, others = read_robot(path)
    found = place_robot(loaded, str(path), "", "")
    _, unread, _ = frame_meshes(loaded, found.frame_of, folder)
    notes = [*found.notes, *unread, *omitted_notes(loaded, others, found.frame_of)]
    return parse_scene(imported_text(found.machine, path.name, notes, {}), "fuzz")


SPLIT = re.compile(rb"^%% (\S{1,20})\n", re.MULTILINE)
"""Before each file of those that belong together: its name."""
RTL = """HEADER::
MACHINE:DVF
TARGET DATA::
Filetype: linear
Target-count: 3
Targets : -200 0 200
Flags: 1 1 1
RUNS::
Run-count: 2
DEVIATIONS::
Run Target Data:
1 1 0.5
1 2 1.5
1 3 -2.5
2 3 -2.0
2 2 1.0
2 1 0.0
"""
ISG_LIST = """kopf.log_achs_name Y-ACHSE
kw.ssfk.interval 100000
kw.ssfk.kw_startpos -200000
kw.ssfk.kw_nr_max 2
kw.ssfk.unit 1
kw.ssfk.table[0].pos 0
kw.ssfk.table[1].pos -102
"""
READ_ONLY = {
    "isg-list": b"%% y.lis\n" + ISG_LIST.encode(),
    "rtl": b"%% x.rtl\n" + RTL.encode(),
    "reprapfirmware": b"%% config.g\nM556 S100 X0.7 Y-0.2 Z0.6\n",
}
"""Files of the formats that are not written."""


def _import_seeds(name: str) -> list[bytes]:
    if not find_format(name).can_write:
        return [READ_ONLY[name]]
    points = None if name in {"marlin", "klipper"} else 3
    found = compensate(load_scene("dvf5000_first"), Compensate(formats=(name,), points=points), 3)
    usual = found.format.endings[0]
    parts = (f"%% x{add or usual}\n{text}" for add, text in found.files.items())
    return ["".join(parts).encode()]


def _read_import(name: str | None, content: bytes, _: Path) -> object:
    """Read files as their format whatever their first lines say, or as what they look like."""
    base = base_scene("dvf5000")
    options = ReadOptions(base.machine, axis="X" if name in {None, "rtl"} else "")
    files = SPLIT.split(content)[1:] if name else []
    sources = [
        open_upload(file.decode("latin-1"), text)
        for file, text in zip(files[::2], files[1::2], strict=True)
    ] or [open_upload("x", content)]
    if name and (kind := find_format(name)).tables is not None:
        parts = [[each] for each in sources] if kind.independent_files else [sources]
        for part in parts:
            kind.tables(part, options)
    return build_imported_scene(
        read_errors(sources, options, *([name] if name else [])), base, "fuzz", "x"
    )


def _measured() -> list[bytes]:
    files = (SPLIT.split(_import_seeds(one.name)[0])[1:] for one in formats())
    return [parts[1] for parts in files if len(parts) == 2]  # those that are one file


def _readings() -> list[bytes]:
    points = b"session,x_mm,z_mm,ex_um,ey_um,ez_um,u_um\na,0,0,1,2,3,1\nb,100,-200,4,5,6,1\n"
    rows = (find_data(name).read_bytes().splitlines() for name in bundled_data())
    return [*(b"\n".join(lines[:40]) for lines in rows), points]


def _tests() -> list[bytes]:
    rows = "\n".join(
        f"{run},{way},{target},{target / 50 + run / 10}"
        for run in (1, 2, 3)
        for way in "+-"
        for target in range(-200, 201, 100)
    )
    return [f"run,direction,target_mm,deviation_um\n{rows}\n".encode()]


def _read_csv(content: bytes, folder: Path) -> object:
    _put(content, folder, "x.csv")
    return load_scene(_put(CSV_SCENE, folder, "s.toml"))


def _read_data(content: bytes, folder: Path) -> object:
    scene = load_scene("ur10" if b"j6_deg" in content[:200].lower() else "fork_head_bc")
    return read_readings(str(_put(content, folder, "r.csv")), scene)


def _read_test(content: bytes, folder: Path) -> object:
    path = _put(content, folder, "t.csv")
    return run_test(load_scene("dvf5000_first"), find_test("positioning")(), path)


def _plans() -> list[bytes]:
    paths = sorted((assets_dir() / "acceptance").glob("*.toml"))
    at = b'[[acceptance]]\ntest = "r-test"\nball = [9, 0, 9]\nat = { X = 1 }\nlimit_um = 2\n'
    return [*(path.read_bytes() for path in paths), at]


def _read_plan(content: bytes, folder: Path) -> object:
    return load_plan(str(_put(content, folder, "p.toml")), load_scene("dvf5000_general"))


REPORT_WORDS = tuple(
    word.encode()
    for word in (
        *(
            "Nom X",
            "Nominal Y",
            "Sollwert X",
            "Istwert Y",
            "Meas Z",
            "Dev X",
            "Abw. Y",
            "Units: in",
        ),
        *(
            "mm",
            "Zoll",
            "µm",
            "Hole",
            "Bohrung",
            "Ø",
            "U95",
            ";",
            "\t",
            "1,5",
            "1.234,5",
            "9e99",
            "-",
        ),
    )
)


def _reports() -> list[bytes]:
    bundled = (
        (assets_dir() / "measurements/simulated_plates/plate_1.txt").read_bytes().splitlines()[:30]
    )
    german = (
        "Bohrung;Sollwert X;Sollwert Y;Abweichung X;Abweichung Y\n1;0;0;0,01;0\n2;100;50;0;0,02\n"
    )
    inches = (
        "Units: inch\nHole,Nom X,Nom Y,Nom Z,Meas X,Meas Y,Meas Z\n"
        "A,1,1,1,1.01,1,1\nB,9,4,2,9,4,2\n"
    )
    return [b"\n".join(bundled), german.encode("latin-1"), inches.encode()]


def _read_report(content: bytes, folder: Path, name: str = "report.txt") -> object:
    return align(load_report(_put(content, folder, name)))


def _workbooks() -> list[bytes]:
    return [
        xlsx([["Nom X", "Nom Y", "Dev X", "Dev Y"], [0.0, 0.0, 0.01, 0.0], [99.0, 5.0, 0.0, 0.02]])
    ]


def _seals() -> list[bytes]:
    seal = seal_prediction("none", load_scene("dvf5000_first"), (0.0,) * 6, ())
    return [seal.content.encode()]


def _read_seal(content: bytes, folder: Path) -> object:
    path = _put(content, folder, "seal.json")
    return seal_prediction(str(path), load_scene("dvf5000_first"), (0.0,) * 6, ())


ADJUSTERS = b"""
[machine]
chain = "wFXYZt"
[workspace]
X = [0, 400]
Y = [0, 300]
Z = [0, 200]
[errors]
EC0Y = 30
EZX = { table = [[0, 0], [200, 5], [400, -5]] }
""" + b"".join(
    b"[[machine.adjusters]]\nname = '%s'\nbody = '%s'\nkind = '%s'\nat_mm = [%s]\n"
    b"direction = [0, 0, 1]\npitch_mm = 0.05\nstep = 0.0625\nrange = [-2, 2]\n" % parts
    for parts in (
        (b"foot 1", b"Z", b"levelling foot", b"-300, -200, 0"),
        (b"foot 2", b"Z", b"levelling foot", b"300, -200, 0"),
        (b"foot 3", b"Z", b"levelling foot", b"0, 300, 0"),
    )
)
ADJUSTER_WORDS = (
    *(b"'shim'", b"'gib'", b"'scale factor'", b"'encoder offset'", b"'rail bolt'", b"'frame'"),
    *(
        b"direction",
        b"at_mm",
        b"pitch_mm",
        b"step",
        b"range",
        b"groups = ['a']",
        b"[0, 0, 0]",
        b"0",
    ),
)
LOG = (
    b"[[done]]\nacts = { 'front column bolts' = 0.01 }\nbefore = { EC0Y = 30, EA0Z = 33.9 }\n",
    b"[[done]]\nacts = {}\nbefore = {}\n[[done]]\nacts = {}\nbefore = { EB0Z = 18.1 }\n",
)
SYMPTOMS = (
    b"circle of 100 mm oval by 30 \xc2\xb5m at 45\xc2\xb0, same in both directions",
    b"plate of 300 x 200 mm: diagonals differ by 0.2 mm",
    b"taper 0.03 on 300 along X across Y",
    b"step of 20 um where Y reverses",
)


def _read_adjusters(content: bytes, folder: Path) -> object:
    scene = load_scene(_put(content, folder, "a.toml"))
    return adjuster_effects(scene) if scene.machine.adjusters else scene


def _covariances() -> list[bytes]:
    packed = io.BytesIO()
    np.savez(packed, keys=np.array(["EC0Y", "EA0Z"]), matrix=np.array([[4.0, 1.0], [1.0, 9.0]]))
    return [packed.getvalue()]


def _read_covariance(content: bytes, folder: Path) -> object:
    _put(content, folder, "c.npz")
    scene = b'machine = "dvf5000"\n[uncertainty]\ncovariance = "c.npz"\n'
    return load_scene(_put(scene, folder, "s.toml"))


CODES = "0 1 2 3 17 18 19 20 21 28 43 43.4 49 53 54 59 80 81 82 83 90 91 93 94 98 99 41 68.2 999"
PROGRAM_WORDS = tuple(
    word.encode()
    for word in (
        *(f"G{code} " for code in CODES.split()),
        *("X", "Y-", "Z", "B", "C", "I", "J", "K", "R", "P", "L", "Q", "H1 ", "F", "S1 ", "N", "O"),
        *("M30\n", "M98 P1 ", "%\n", "/", "(", ")", ";", "#1=", "[1]", "X" + "9" * 400, "1e400"),
        *("P9999999 ", "L9999999 ", "K30000 ", "P900 ", "Q.0001 ", ".000000000001 ", "99999 "),
        *("\u2028G91 G0 Z-300", "\x0bG0 Z-300", "\x85", "\x1b[2J", "X1" * 4000, "X" * 9000),
    )
)


def _programs() -> list[bytes]:
    part = (
        b"%\nO1 (a part)\nN10 G90 G21 G54 G0 X10 Y0 Z-100\nG43 H1 Z-110 S900 M3 ; fast\n"
        b"G1 X20 F500\nG2 X30 Y10 J10\nG3 X20 R8\nG2 I5 P2\nG91 G1 X5\nG28 Z0\nM30\n%\n"
    )
    return [
        part,
        b"G0 X0 Y0 Z-100\nG81 X10 Y10 Z-120 R-102 L2\nG83 X20 Z-120 Q3\nG82 G98 X30 P20\nG80\n",
        b"G0 X10 Y0 Z-200 B0 C0\nG43.4 H1 Z-190\nG1 B20 C40 F100\nX50 Y30 B-30 C90\nG49 X0\n",
    ]


def _run_program(content: bytes, folder: Path) -> object:
    """Run a program and write the corrected one, as the command does."""
    program = Program(file=str(_put(content, folder, "p.ngc")), offset=(("G54X", 5.0),))
    outcome = program.run(load_scene("dvf5000_first"), lambda _: None)
    outcome.json_fields()
    lines = "".join(outcome.output_files().values()).split("\n")
    last = (n for n, line in enumerate(lines) if n and re.search(r"^%|M(0?2|30)(?![0-9])", line))
    lines = lines[: next(last, None)]  # what stands behind the end of a program is no program
    if bad := [line for line in lines if line and not line.isprintable()]:
        raise AssertionError(f"a corrected program holds {bad[0]!r}")
    code = "\n".join(re.sub(r"\([^()]*\)|;.*", "", line) for line in lines)
    if bad := re.search(r"[0-9]{41}|(?i:[A-Z]\s*-?(inf|nan)\b)", code):
        raise AssertionError(f"a corrected program holds {bad[0]!r}")
    return outcome


# a scene with a part names files that are not beside the copy
SCENES = [
    text
    for name in scene_names()
    if b"[part]" not in (text := (scenes_dir() / f"{name}.toml").read_bytes())
]
LINKS = [b"ZXJyb3JzPUVBWDo1", b"Y29sb3VyPXg"]
FORMATS: list[Format] = [
    Format("scene", lambda: SCENES, lambda text, _: parse_scene(upload_text(text, "f"), "f"), 6),
    Format("scene file", lambda: SCENES, lambda *given: load_scene(_put(*given, "s.toml")), 2),
    Format("csv", _csvs, _read_csv, 2),
    *(
        Format(ending, partial(_mesh_seeds, ending), partial(_read_mesh, ending), text=text)
        for ending, text in (("stl", False), ("obj", True), ("ply", False), ("glb", False))
    ),
    Format("urdf", lambda: [URDF.encode()], _read_urdf),
    Format("link", lambda: LINKS, lambda text, _: unpack(text.decode("latin-1")), 0.5),
    Format("measured", _measured, partial(_read_import, None)),
    *(
        Format(f"import {name}", partial(_import_seeds, name), partial(_read_import, name), 0.5)
        for name in (one.name for one in formats())
    ),
    Format("readings", _readings, _read_data),
    Format("test", _tests, _read_test),
    Format("plan", _plans, _read_plan),
    Format("report", _reports, _read_report, 2, words=REPORT_WORDS),
    Format("report xlsx", _workbooks, partial(_read_report, name="report.xlsx"), text=False),
    Format("seal", _seals, _read_seal, 0.5),
    Format("adjusters", lambda: [ADJUSTERS], _read_adjusters, words=ADJUSTER_WORDS),
    Format(
        "adjustment log",
        lambda: [*LOG],
        lambda text, folder: read_log(
            str(_put(text, folder, "l.toml")), load_scene("dvf5000_first")
        ),
    ),
    Format("covariance", _covariances, _read_covariance, 0.5, text=False),
    Format(
        "symptom",
        lambda: [*SYMPTOMS],
        lambda text, _: read_symptom(text.decode("utf-8", "replace"), load_scene("dvf5000_first")),
    ),
]
PROGRAM = Format("program", _programs, _run_program, words=PROGRAM_WORDS, longest_s=12.0)
EVERY = [*FORMATS, PROGRAM]
