"""Bodies of machines as meshes, and mesh files opened by trimesh."""

import io
import json
import logging
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
from numpy.typing import NDArray

from warpspace.exceptions import OptionError, SceneError
from warpspace.machine import limits
from warpspace.scene.text_files import read_bytes
from warpspace.units import Array

_STL_HEAD = 84
_STL_ROW = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
_UNKNOWN_COUNTS = 0, 2**32 - 1  # of writers that do not return to the header
_MIXERS = 0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9  # odd numbers of 64 bits
_GROUPS = re.compile(r"^[ \t]*(?:usemtl|mtllib|[ogs])\b[^\n]*", re.MULTILINE)
_NEXT_SOLID = re.compile(rb"(?mi)^[ \t]*+endsolid[^\n]*+\n\s*+solid[^\n]*+")
_DECIMAL_COMMA = re.compile(rb"(?<=\d),(?=\d)")
_POINT = re.compile(rb"(?i)vertex[^\n]*\d\.\d")
_FACE = re.compile("^f([^\n]*)", re.MULTILINE)
_PLY_BYTES = {
    **dict.fromkeys(("char", "uchar", "int8", "uint8"), 1),
    **dict.fromkeys(("short", "ushort", "int16", "uint16"), 2),
    **dict.fromkeys(("double", "float64"), 8),
}
_GLB_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_GLB_COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_REFERENCES = 20
"""Nodes of a DAE or 3MF file by reference: each may hold others, so that they multiply."""
NUMBERS_PER_TRIANGLE, WORDS_PER_TRIANGLE, BYTES_PER_TRIANGLE = 12, 40, 200
"""Limits per triangle of a file: numbers in lists or lines; words of a text, 21 in STL; bytes."""


def repair_stl(data: bytes) -> tuple[bytes, list[str]]:
    """Complete an STL file where its triangles are unambiguous, and report what was wrong."""
    stored, spare = divmod(max(len(data) - _STL_HEAD, 0), _STL_ROW.itemsize)
    stated = int.from_bytes(data[_STL_HEAD - 4 : _STL_HEAD], "little")
    if _is_binary(data):
        return data, []
    text, notes = data.lower(), list[str]()
    if b"vertex" not in text:
        if stated == stored:
            notes.append(f"{spare} bytes after its last triangle are ignored")
        elif stated in _UNKNOWN_COUNTS and stored and not spare:
            notes.append(f"its header states {stated:,} triangles; all {stored:,} stored are read")
        else:
            rest = f" and {spare} bytes" * bool(spare)
            raise ValueError(
                f"its header states {stated:,} triangles; {stored:,} triangles{rest} follow"
            )
        count, end = stored.to_bytes(4, "little"), _STL_HEAD + stored * _STL_ROW.itemsize
        return data[: _STL_HEAD - 4] + count + data[_STL_HEAD:end], notes
    comma, last = _DECIMAL_COMMA.search(data, text.find(b"vertex")), text.rfind(b"endfacet")
    if comma:
        line = 1 + data.count(b"\n", 0, comma.start())
        if _POINT.search(data):
            raise ValueError(f"line {line}: decimal commas and decimal points in one file")
        data = _DECIMAL_COMMA.sub(b".", data)
        notes.append(f"line {line}: decimal commas are read as decimal points")
    if text.rfind(b"endsolid") < last:
        if text[last + len(b"endfacet") :].strip():
            count = data.rstrip().count(b"\n") + 1
            raise ValueError(f"line {count}: the file ends within a facet; expected endfacet")
        data += b"\nendsolid\n"
        notes.append("endsolid is missing at its end; all its facets are read")
    return data, notes


def count_mesh(data: bytes, ending: str, max_triangles: int = limits.MAX_TRIANGLES) -> bytes:
    """Raise an error for a mesh file above the limits; return its normalised content."""
    if ending == ".obj":
        text = data.decode("utf-8", "replace").replace("\r\n", "\n").replace("\\\n", "")
        data = _GROUPS.sub("", text).encode()
    elif ending == ".stl" and not _is_binary(data):
        data = _NEXT_SOLID.sub(b"", data)
    _COUNTERS[ending](data, max_triangles)
    return data


def _check_count(count: int, limit: int, what: str) -> None:
    if count > limit:
        raise OptionError(f"it holds {count:,} {what}; expected at most {limit:,}")


def _count_stl(data: bytes, max_triangles: int) -> None:
    if _is_binary(data):
        _check_count((len(data) - _STL_HEAD) // _STL_ROW.itemsize, max_triangles, "triangles")
        return
    _count_text(data, max_triangles)
    text = data.lower()
    _check_count(text.count(b"endsolid"), limits.MAX_SOLIDS, "solids")
    _check_count(text.count(b"vertex") // 3, max_triangles, "triangles")


def _is_binary(data: bytes) -> bool:
    stated = int.from_bytes(data[_STL_HEAD - 4 : _STL_HEAD], "little")
    return len(data) == _STL_HEAD + _STL_ROW.itemsize * stated


def _merge_stl(data: bytes) -> Any:
    """Read a binary STL with equal corners merged; None for a collision of keys."""
    import pyarrow as pa
    import trimesh

    rows = np.frombuffer(data, _STL_ROW, offset=_STL_HEAD)
    corner = rows["corners"].reshape(-1, 3) + np.float32(0.0)  # −0 becomes 0
    key = np.zeros(len(corner), np.uint64)
    for column, mixer in zip(corner.view(np.uint32).T, _MIXERS, strict=True):
        key ^= column * np.uint64(mixer)
    faces = pa.array(key).dictionary_encode().indices.to_numpy()  # in the order of the file
    vertices = np.empty((faces.max(initial=-1) + 1, 3), np.float32)
    vertices[faces] = corner
    if not np.array_equal(vertices[faces], corner):
        return None
    return trimesh.Scene(trimesh.Trimesh(vertices, faces.reshape(-1, 3), process=False))


def _count_text(data: bytes, max_triangles: int) -> int:
    _check_count(data.count(b"\n"), NUMBERS_PER_TRIANGLE * max_triangles, "lines")
    blank = np.frombuffer(b" " + data, dtype=np.uint8) <= ord(" ")
    n_words = int(np.count_nonzero(blank[:-1] & ~blank[1:]))
    _check_count(n_words, WORDS_PER_TRIANGLE * max_triangles, "words")
    return n_words


def _count_obj(data: bytes, max_triangles: int) -> None:
    _count_text(data, max_triangles)
    faces = _FACE.finditer(data.decode())
    triangles = sum(max(len(face[1].split()) - 2, 0) for face in faces)
    _check_count(triangles, max_triangles, "triangles")


def _count_ply(data: bytes, max_triangles: int) -> None:
    rows, total, scalars, smallest, at = 0, 0, 0, 4, 0
    is_text = b"ascii" in data[:100].lower()
    while at < len(data):
        end = data.find(b"\n", at) + 1 or len(data)
        _check_count(end, limits.MAX_MESH_HEADER[".ply"], "bytes of header")
        fields = data[at:end].decode("utf-8", "replace").split()
        at = end
        if "end_header" in fields:
            break
        if len(fields) == 3 and "element" in fields[0]:
            rows = max(int(fields[2]), 0)
            total += rows
            _check_count(rows, 3 * max_triangles, f"rows of {fields[1][:40]!r}")
        elif len(fields) == 3 and "property" in fields[0]:
            scalars += rows * (1 if is_text else _PLY_BYTES.get(fields[1], 4))
        elif len(fields) == 5 and "property" in fields[0]:
            smallest = min(smallest, _PLY_BYTES.get(fields[3], 4))
    if is_text:
        _check_count(data.count(b"\n", at), total + 100, "lines")
    n_numbers = _count_text(data[at:], max_triangles) if is_text else (len(data) - at) // smallest
    scalars //= 1 if is_text else smallest
    _check_count(n_numbers - scalars, NUMBERS_PER_TRIANGLE * max_triangles, "numbers in lists")


def _count_glb(data: bytes, max_triangles: int) -> None:
    size = int.from_bytes(data[12:16], "little")
    if data[:4] != b"glTF" or size > len(data):
        return  # the reader reports the problem
    _check_count(size, limits.MAX_MESH_HEADER[".glb"], "bytes of description")
    offset, chunks = 20 + size, 0
    while offset + 8 <= len(data) and chunks <= limits.MAX_MESH_PARTS:
        offset += 8 + int.from_bytes(data[offset : offset + 4], "little")
        chunks += 1
    _check_count(chunks, limits.MAX_MESH_PARTS, "chunks")
    document = json.loads(data[20 : 20 + size])
    for name, entries in document.items():
        if isinstance(entries, list):
            _check_count(len(entries), limits.MAX_MESH_PARTS, name)  # pyright: ignore[reportUnknownArgumentType]
    primitives = [mesh["primitives"] for mesh in document.get("meshes", [])]
    _check_count(sum(map(len, primitives)), limits.MAX_MESH_PARTS, "primitives")
    accessors = [max(int(accessor["count"]), 0) for accessor in document.get("accessors", [])]
    _check_count(sum(accessors), NUMBERS_PER_TRIANGLE * max_triangles, "points and indices")
    stored = sum(max(int(view["byteLength"]), 0) for view in document.get("bufferViews", []))
    _check_count(stored, BYTES_PER_TRIANGLE * max_triangles, "bytes in views of its data")
    arrays = sum(
        count * _GLB_COLUMNS[accessor["type"]] * _GLB_BYTES[accessor["componentType"]]
        for count, accessor in zip(accessors, document.get("accessors", []), strict=True)
    )
    _check_count(arrays, BYTES_PER_TRIANGLE * max_triangles, "bytes of points and indices")
    placed = [primitive for mesh in _placed(document) for primitive in primitives[mesh]]
    _check_count(len(placed), limits.MAX_MESH_PARTS, "primitives, each placing counted")
    corners = sum(
        accessors[part["indices"] if "indices" in part else part["attributes"]["POSITION"]]
        for part in placed
    )
    _check_count(corners // 3, max_triangles, "triangles, each placing counted")


def _placed(document: Any) -> Iterator[int]:
    nodes, scenes = document.get("nodes", []), document.get("scenes", [])
    roots = scenes[document.get("scene", 0)].get("nodes", []) if scenes else []
    waiting = [(root, 1) for root in roots]
    visited: set[int] = set()
    while waiting:
        node, depth = waiting.pop()
        if node in visited:
            raise OptionError(f"it holds node {node} twice in its scene; expected a tree of nodes")
        visited.add(node)
        _check_count(depth, limits.MAX_MESH_DEPTH, "nodes below each other")
        waiting += [(child, depth + 1) for child in nodes[node].get("children", [])]
        if "mesh" in nodes[node]:
            yield nodes[node]["mesh"]


def _count_dae(data: bytes, max_triangles: int) -> None:
    _check_count(data.count(b"<"), 2 * limits.MAX_MESH_PARTS, "XML tags")
    _check_count(data.count(b"<instance_node"), _REFERENCES, "nodes by reference")
    _count_text(data, max_triangles)


def _count_3mf(data: bytes, max_triangles: int) -> None:
    with ZipFile(io.BytesIO(data)) as archive:
        size = sum(entry.file_size for entry in archive.infolist())
        _check_count(size, BYTES_PER_TRIANGLE * max_triangles, "bytes unpacked")
        models = [archive.read(name) for name in archive.namelist() if name.endswith(".model")]
    for tag, limit in ("triangle ", max_triangles), ("component ", _REFERENCES):
        _check_count(sum(model.count(b"<" + tag.encode()) for model in models), limit, f"{tag}tags")


def _check_step(data: bytes, _max_triangles: int) -> None:
    if not data.lstrip().startswith(b"ISO-10303-21;"):
        raise ValueError("line 1: expected ISO-10303-21;")
    if not data.rstrip(b"\0 \r\n").endswith(b"END-ISO-10303-21;"):
        line = data.count(b"\n") + 1
        raise ValueError(f"line {line}: the file is cut off; expected END-ISO-10303-21;")


_COUNTERS: dict[str, Callable[[bytes, int], object]] = {
    ".stl": _count_stl,
    ".obj": _count_obj,
    ".ply": _count_ply,
    ".glb": _count_glb,
    ".dae": _count_dae,
    ".3mf": _count_3mf,
    ".step": _check_step,
    ".stp": _check_step,
}


LIGHT, MIDDLE, DARK, METAL = (206, 210, 216), (178, 184, 192), (104, 112, 124), (150, 157, 167)
CREASE_DEG = 30.0  # angle from flat above which an edge is drawn


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """One body of a machine, in its frame."""

    name: str  # for instance ``X_saddle``
    frame: str  # R, an axis, S, t or w
    colour: tuple[int, int, int]  # sRGB; greys, since colour means error
    vertices_mm: Array  # [V, 3]
    triangles: NDArray[np.int32]  # [T, 3]; Counter-clockwise seen from outside
    edges_mm: Array  # [E, 2, 3]; ends of the edges worth drawing
    warnings: tuple[str, ...] = ()  # on its surface
    lines_mm: Array | None = None  # [L, 2, 3]; those of the edges that are drawn on its surface


def build_body(
    mesh: Any, name: str, frame: str, colour: tuple[int, int, int], lines_mm: Array | None = None
) -> Body:
    """Build a body from a mesh of trimesh, mm, with its sharp edges."""
    is_sharp = mesh.face_adjacency_angles > np.deg2rad(CREASE_DEG)
    edges = np.asarray(mesh.vertices[mesh.face_adjacency_edges[is_sharp]], dtype=float)
    return Body(
        name,
        frame,
        colour,
        np.array(mesh.vertices, dtype=float),
        np.array(mesh.faces, dtype=np.int32),
        edges if lines_mm is None else np.concatenate([edges, lines_mm]),
        lines_mm=lines_mm,
    )


def _check_geometry(scene: Any, max_triangles: int) -> None:
    """Raise an error for plane points or missing vertices, which trimesh does not check."""
    for mesh in scene.geometry.values():
        mesh.metadata.clear()  # of a PLY file a copy of all data
        if np.shape(getattr(mesh, "vertices", ()))[1:] != (3,):
            raise ValueError("it has points without three coordinates")
        faces = np.asarray(getattr(mesh, "faces", ()))
        if faces.size and not (int(faces.min()) >= 0 and int(faces.max()) < len(mesh.vertices)):
            raise ValueError("a triangle refers to a missing vertex")
        if len(faces) > max_triangles:
            raise ValueError(f"{len(faces):,} triangles; expected at most {max_triangles:,}")


def open_meshes(
    path: Path,
    what: str,
    max_triangles: int = limits.MAX_TRIANGLES,
    data: bytes | None = None,
    *,
    has_materials: bool = False,
) -> Any:
    """Open a mesh file, by default without its materials, whose memory is unlimited."""
    try:
        data = read_bytes(path, BYTES_PER_TRIANGLE * max_triangles) if data is None else data
    except SceneError as error:
        raise OptionError(str(error)) from None
    if not data:
        raise OptionError(f"{path}: the file is empty; expected a {what}")
    import trimesh

    # it logs tracebacks of damaged files; the error message suffices
    logging.getLogger("trimesh").addHandler(logging.NullHandler())
    try:
        with np.errstate(all="ignore"):
            ending, notes = path.suffix.lower(), list[str]()
            if ending == ".stl":
                data, notes = repair_stl(data)
            data = count_mesh(data, ending, max_triangles)
            merged = _merge_stl(data) if ending == ".stl" and _is_binary(data) else None
            file = io.BytesIO(data)
            scene = merged or trimesh.load_scene(
                file, file_type=ending[1:], process=False, skip_materials=not has_materials
            )
            _check_geometry(scene, max_triangles)
            scene.metadata["notes"] = [f"{path}: {note}" for note in notes]
            return scene
    except OptionError as error:
        raise OptionError(f"{path}: {error}. Reduce it before") from None
    except ImportError as error:
        extra = "step" if error.name == "cascadio" else "3mf"
        install = f"pip install 'warpspace[{extra}]'"
        raise OptionError(f"{path}: a {what} needs {error.name}: {install}") from None
    except Exception as error:  # noqa: BLE001  # trimesh raises any error for a damaged file
        reason = str(error) or type(error).__name__
        raise OptionError(f"{path}: no {what} that can be read ({reason})") from None
