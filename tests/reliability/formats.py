"""The files the program reads: for each format some good ones to begin with, and how it is read.

A new format is one entry in `FORMATS`; those of measurements and controllers are there once they
are registered. `read` gets the bytes of a file and a folder that it may use; what it raises on
purpose is a `WarpspaceError`.
"""

import re
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from warpspace.app.documents.links import unpack
from warpspace.app.documents.received_files import upload_text
from warpspace.formats.registry import formats
from warpspace.resources import scenes_dir
from warpspace.scene.library import load_scene, parse_scene, scene_names


@dataclass(frozen=True)
class Format:
    """A format of files.

    Attributes
    ----------
    name : str
    seeds : callable
        Gives good files, as bytes.
    read : callable
        Reads the bytes of a file, in a folder that it may use.
    share : float
        How much of the count it gets, by that of others.
    text : bool
        Whether words of the format are put into it, beside changed bytes.
    """

    name: str
    seeds: Callable[[], list[bytes]]
    read: Callable[[bytes, Path], object]
    share: float = 1.0
    text: bool = True


FORMATS: list[Format] = []


def add(file_format: Format) -> None:
    """Add a format."""
    FORMATS.append(file_format)


CSV_SCENE = """
machine = "dvf5000"
[errors]
EXX = { csv = "x.csv", column = "error" }
"""
MESH_SCENE = """
machine = "dvf5000"
[bodies]
X = "x%s"
"""
WORDS = [
    *(b"nan", b"inf", b"-inf", b"1e308", b"5e-324", b"-0.0", b"1e5", b"true", b"false", b'""'),
    *(b"[", b"]", b"{", b"}", b"[[", b"]]", b"=", b".", b",", b"\n", b"\r\n", b"#", b'"', b"'"),
    *(b'"""', b"'''", b"\\u0000", b"\xff\xfe", b"\xef\xbb\xbf", b"\x00", b"\xf0\x9f\x98\x80"),
    *(b"machine", b"chain", b"wCBFXYZt", b"errors", b"EXX", b"EC0Y", b"ramp", b"poly", b"table"),
    *(b"harmonics", b"csv", b"column", b"tolerances", b"default", b"view", b"workspace", b"bodies"),
    *(
        b"../" * 8,
        b"/dev/zero",
        b"/proc/self/mem",
        b"[" * 500,
        b"a." * 500,
        b"9" * 400,
        b"0x",
        b"_",
    ),
    *(b"<joint", b"</robot>", b"<!ENTITY x 'y'>", b"&x;", b"xyz=", b"rpy=", b"<mesh filename="),
]
"""What mutations put into texts: words of the formats, and what readers stumble over."""


def _scenes() -> list[bytes]:
    return [(scenes_dir() / f"{name}.toml").read_bytes() for name in scene_names()]


def _read_scene(content: bytes, folder: Path) -> object:
    del folder
    return parse_scene(upload_text(content, "fuzz.toml"), "fuzz")


def _read_scene_file(content: bytes, folder: Path) -> object:
    (folder / "s.toml").write_bytes(content)
    return load_scene(folder / "s.toml")


def _read_link(content: bytes, folder: Path) -> object:
    del folder
    return unpack(content.decode("latin-1"))


def _csvs() -> list[bytes]:
    rows = "\n".join(f"{x},{x / 100}" for x in range(-275, 276, 25))
    return [
        f"X,error\n{rows}\n".encode(),
        b"\xef\xbb\xbfX,error\r\n-275,0\r\n275,4.1\r\n",
    ]


def _read_csv(content: bytes, folder: Path) -> object:
    (folder / "x.csv").write_bytes(content)
    (folder / "s.toml").write_text(CSV_SCENE, "utf-8")
    return load_scene(folder / "s.toml")


def _mesh_seeds(ending: str) -> Callable[[], list[bytes]]:
    def seeds() -> list[bytes]:
        import trimesh

        shape = trimesh.creation.box((20.0, 30.0, 40.0))
        found = shape.export(file_type=ending)
        seeds = [found if isinstance(found, bytes) else found.encode()]
        if ending == "stl":
            ascii_ = shape.export(file_type="stl_ascii")
            seeds.append(ascii_ if isinstance(ascii_, bytes) else ascii_.encode())
            seeds.append(b"\0" * 80 + struct.pack("<I", 2**31) + b"\0" * 50)
        if ending == "ply":
            seeds.append(shape.export(file_type="ply", encoding="ascii"))
        return seeds

    return seeds


def _read_mesh(ending: str) -> Callable[[bytes, Path], object]:
    def read(content: bytes, folder: Path) -> object:
        from warpspace.bodies.user_mesh import load_mesh

        path = folder / f"x.{ending}"
        path.write_bytes(content)
        return load_mesh(path, "X")

    return read


def _vts() -> list[bytes]:
    import tempfile

    from warpspace.outputs.exports.formats import write_export
    from warpspace.picture.scene_picture import evaluate_picture

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.vts"
        write_export(evaluate_picture(load_scene("dvf5000_first"), grid=3), path)
        return [path.read_bytes()]


def _read_vts(content: bytes, folder: Path) -> object:
    from warpspace.outputs.exports import load_stored_field

    (folder / "x.vts").write_bytes(content)
    return load_stored_field(folder / "x.vts")


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
    from warpspace.bodies.urdf_meshes import frame_meshes
    from warpspace.scene.urdf.left_out import left_out
    from warpspace.scene.urdf.placing import place_robot
    from warpspace.scene.urdf.reading import read_robot
    from warpspace.scene.urdf.text import imported_text

    path = folder / "r.urdf"
    path.write_bytes(content)
    loaded, others = read_robot(path)
    found = place_robot(loaded, str(path), "", "")
    _, unread, _ = frame_meshes(loaded, found.frame_of, folder)
    notes = [*found.notes, *unread, *left_out(loaded, others, found.frame_of)]
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


def _import_seeds(name: str) -> Callable[[], list[bytes]]:
    """Give files of a format of measurements or of a controller, as the program writes them."""

    def seeds() -> list[bytes]:
        from warpspace.formats.compensation.compensate import Plan, compensate
        from warpspace.formats.registry import find_format

        if not find_format(name).can_write:
            return [b"%% x.rtl\n" + RTL.encode()]
        points = None if name in {"marlin", "klipper"} else 3
        found = compensate(load_scene("dvf5000_first"), Plan(name, points), 3)
        usual = found.format.endings[0]
        parts = (f"%% x{add or usual}\n{text}" for add, text in found.files.items())
        return ["".join(parts).encode()]

    return seeds


def _read_import(name: str) -> Callable[[bytes, Path], object]:
    """Read files as their format whatever their first lines say, and as its controller does."""

    def read(content: bytes, folder: Path) -> object:
        del folder
        from warpspace.formats.importing import open_upload, read_errors
        from warpspace.formats.kind import ReadOptions
        from warpspace.formats.registry import find_format
        from warpspace.formats.to_scene import base_scene, into_scene

        base = base_scene("dvf5000")
        options = ReadOptions(base.machine, axis="X" if name == "rtl" else "")
        parts = SPLIT.split(content)[1:]
        sources = [
            open_upload(file.decode("latin-1"), text)
            for file, text in zip(parts[::2], parts[1::2], strict=True)
        ]
        if not sources:
            sources = [open_upload("x", content)]
        kind = find_format(name)
        if kind.tables is not None:
            kind.tables(sources, options)
        return into_scene(read_errors(sources, options, name), base, "fuzz", "x")

    return read


def _measured() -> list[bytes]:
    """Give files of all formats of measurements and controllers that are one file."""
    files = (SPLIT.split(_import_seeds(one.name)()[0])[1:] for one in formats())
    return [parts[1] for parts in files if len(parts) == 2]


def _read_measured(content: bytes, folder: Path) -> object:
    """Read a file as what it looks like, as the app does."""
    del folder
    from warpspace.formats.importing import open_upload, read_errors
    from warpspace.formats.kind import ReadOptions
    from warpspace.formats.to_scene import base_scene, into_scene

    base = base_scene("dvf5000")
    reading = read_errors([open_upload("x", content)], ReadOptions(base.machine, axis="X"))
    return into_scene(reading, base, "fuzz", "x")


def _readings() -> list[bytes]:
    from warpspace.calibration.readings import bundled_data, find_data

    points = b"session,x_mm,z_mm,ex_um,ey_um,ez_um,u_um\na,0,0,1,2,3,1\nb,100,-200,4,5,6,1\n"
    return [*(find_data(name).read_bytes() for name in bundled_data()), points]


def _read_readings(content: bytes, folder: Path) -> object:
    from warpspace.calibration import read_readings

    path = folder / "r.csv"
    path.write_bytes(content)
    return read_readings(str(path), load_scene("fork_head_bc"))


def _tests() -> list[bytes]:
    rows = "\n".join(
        f"{run},{way},{target},{target / 50 + run / 10}"
        for run in (1, 2, 3)
        for way in "+-"
        for target in range(-200, 201, 100)
    )
    return [f"run,direction,target_mm,deviation_um\n{rows}\n".encode()]


def _read_test(content: bytes, folder: Path) -> object:
    from warpspace.bench.registry import find_test
    from warpspace.bench.run import run_test

    path = folder / "t.csv"
    path.write_bytes(content)
    return run_test(load_scene("dvf5000_first"), find_test("positioning")(), path)


add(Format("scene", _scenes, _read_scene, 6.0))
add(Format("scene file", _scenes, _read_scene_file, 2.0))
add(Format("csv", _csvs, _read_csv, 2.0))
add(Format("stl", _mesh_seeds("stl"), _read_mesh("stl"), text=False))
add(Format("obj", _mesh_seeds("obj"), _read_mesh("obj")))
add(Format("ply", _mesh_seeds("ply"), _read_mesh("ply"), text=False))
add(Format("glb", _mesh_seeds("glb"), _read_mesh("glb"), text=False))
add(Format("vts", _vts, _read_vts))
add(Format("urdf", lambda: [URDF.encode()], _read_urdf))
add(Format("link", lambda: [b"ZXJyb3JzPUVBWDo1", b"Y29sb3VyPXg"], _read_link, 0.5))
add(Format("measured", _measured, _read_measured))
for _one in formats():
    add(Format(f"import {_one.name}", _import_seeds(_one.name), _read_import(_one.name), 0.5))
add(Format("readings", _readings, _read_readings))
add(Format("test", _tests, _read_test))
