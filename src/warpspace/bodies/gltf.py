"""Binary glTF files, written by trimesh: coloured surfaces and lines that no light changes.

trimesh lays out the file. What it has no words for is set in the document before it is written:
unlit materials, colours as linear floats beyond 0 … 1, lines with numbered points, and places to
which a viewer can morph the points.
"""

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpspace.geometry.colour import srgb_to_linear
from warpspace.units import Array

Json = dict[str, Any]
UNLIT = "KHR_materials_unlit"
LINES = 1  # the mode of a primitive
_M_PER_MM = 1e-3
_COLOUR, _TARGET = "_linear_colour", "_target_"
_UINT16, _LARGEST_UINT16 = 5123, 65534
_VERTEX_BUFFER, _INDEX_BUFFER = 34962, 34963


@dataclass(frozen=True, slots=True)
class Material:
    """How a part is coloured."""

    name: str = "unlit"
    srgb: tuple[int, int, int] = (255, 255, 255)  # colours of the points are multiplied with it
    opacity: float = 1.0


@dataclass(frozen=True, slots=True)
class Part:
    """A surface or a set of lines, with a node of its own."""

    name: str
    points: Array  # [V, 3]; as they stand in the file: by the standard metres, Y up
    # [T, 3] or [S, 2]; numbers of the points of triangles, or of the ends of pieces of line
    indices: NDArray[np.integer[Any]]
    material: Material = Material()
    colours: NDArray[np.floating[Any]] | None = None  # [V, 3]; linear, any value
    # [V, n]; further values per point; the names begin with an underscore
    attributes: Mapping[str, Array] = field(default_factory=dict[str, Array])
    # [V, 3]; morph targets: name to displacement of the points at weight 1
    targets: Mapping[str, Array] = field(default_factory=dict[str, Array])
    group: str = ""  # name of the node that holds it; the root by default


def to_gltf(points_mm: Array) -> Array:
    """Turn points or vectors of R into glTF's frame."""
    x, y, z = np.moveaxis(np.asarray(points_mm), -1, 0)
    return np.stack([x, z, -y], -1) * _M_PER_MM


def build_gltf(
    parts: Sequence[Part],
    *,
    root: str = "scene",
    generator: str = "warpspace",
    extras: Mapping[str, Any] | None = None,
) -> bytes:
    """Write surfaces and lines to one binary file."""
    from trimesh import Scene
    from trimesh.exchange.gltf import export_glb

    parts = [part for part in parts if len(part.indices)]
    asset: Json = {"version": "2.0", "generator": generator}
    if extras:
        json.dumps(extras, allow_nan=False)
        asset["extras"] = dict(extras)
    scene = Scene()
    scene.graph.update(frame_to=root)
    for group in dict.fromkeys(part.group for part in parts if part.group):
        scene.graph.update(frame_to=group, frame_from=root)
    for part in parts:
        scene.add_geometry(
            _geometry(part), geom_name=part.name, parent_node_name=part.group or root
        )

    def complete(tree: Json) -> None:
        tree["asset"] = asset
        _complete(tree, parts)

    return export_glb(
        scene,
        include_normals=False,
        tree_postprocessor=complete,
        buffer_postprocessor=_narrow_indices,
    )


def _geometry(part: Part) -> Any:
    """Lay a part out as a mesh of trimesh.

    The pairs of lines fill its triangles up, the last pair up to three times: in the file both are
    a flat list of numbers.
    """
    from trimesh import Trimesh

    indices = part.indices
    if indices.shape[1] == 2:
        indices = np.concatenate([indices, indices[-1:].repeat(-len(indices) % 3, axis=0)])
    values: dict[str, NDArray[np.floating[Any]]] = dict(part.attributes)
    if part.colours is not None:
        values[_COLOUR] = part.colours
    for name, shift in part.targets.items():
        values[_TARGET + name] = shift
    return Trimesh(
        part.points,
        indices.reshape(-1, 3),
        vertex_attributes={key: np.asarray(value, "<f4") for key, value in values.items()},
        process=False,
    )


def _narrow_indices(buffers: dict[Any, bytes], tree: Json) -> None:
    keys, accessors = list(buffers), list(tree["accessors"].values())
    for at in {p["indices"] for mesh in tree["meshes"] for p in mesh["primitives"]}:
        accessor = accessors[at]
        if accessor["max"][0] <= _LARGEST_UINT16:
            key = keys[accessor["bufferView"]]
            data = np.frombuffer(buffers[key], "<u4").astype("<u2").tobytes()
            buffers[key] = data + bytes(-len(data) % 4)
            accessor["componentType"] = _UINT16


def _complete(tree: Json, parts: Sequence[Part]) -> None:
    materials = list(dict.fromkeys(part.material for part in parts))
    tree["materials"] = [_material(material) for material in materials]
    tree["extensionsUsed"] = [UNLIT]
    for mesh, part in zip(tree["meshes"], parts, strict=True):
        (primitive,) = mesh["primitives"]
        attributes: dict[str, int] = primitive["attributes"]
        primitive["material"] = materials.index(part.material)
        if part.indices.shape[1] == 2:
            primitive["mode"] = LINES
            tree["accessors"][primitive["indices"]]["count"] = part.indices.size
        if part.colours is not None:
            attributes["COLOR_0"] = attributes.pop(_COLOUR)
        if part.targets:
            primitive["targets"] = [
                {"POSITION": attributes.pop(_TARGET + name)} for name in part.targets
            ]
            mesh["weights"] = [0.0] * len(part.targets)
            mesh["extras"]["targetNames"] = list(part.targets)
        for accessor, target in (
            *((at, _VERTEX_BUFFER) for at in attributes.values()),
            (primitive["indices"], _INDEX_BUFFER),
        ):
            tree["bufferViews"][tree["accessors"][accessor]["bufferView"]]["target"] = target


def _material(material: Material) -> Json:
    linear = srgb_to_linear(np.array(material.srgb) / 255.0)
    spelled: Json = {
        "name": material.name,
        "doubleSided": True,
        "extensions": {UNLIT: {}},
        "pbrMetallicRoughness": {
            "baseColorFactor": [*(round(float(part), 6) for part in linear), material.opacity],
            "metallicFactor": 0.0,
            "roughnessFactor": 1.0,
        },
    }
    if material.opacity < 1.0:
        spelled["alphaMode"] = "BLEND"
    return spelled


# --- A binary glTF file that is written again and again with other points and colours -------------
# trimesh lays the file out once, which takes it a millisecond or two; a slider move then replaces
# positions, colours and bounds in it.

_HEAD = 20  # bytes before the document: header of the file, and of the first chunk


class GltfTemplate:
    """The file of one coloured part."""

    def __init__(self, name: str, indices: NDArray[np.integer[Any]], count: int) -> None:
        # trimesh stores equal arrays once: points and colours must differ
        numbers = np.arange(3.0 * count).reshape(-1, 3)
        data = build_gltf([Part(name, numbers, indices, colours=-1.0 - numbers)])
        (length,) = struct.unpack("<I", data[12:16])
        self._document: dict[str, Any] = json.loads(data[_HEAD : _HEAD + length])
        self._body = data[_HEAD + length + 8 :]
        attributes = self._document["meshes"][0]["primitives"][0]["attributes"]
        self._position, self._colour = attributes["POSITION"], attributes["COLOR_0"]

    def fill(self, points: Array, colours: NDArray[np.floating[Any]]) -> bytes:
        """Write the file with other points and colours."""
        body = bytearray(self._body)
        vertices = np.ascontiguousarray(points, "<f4")
        for accessor, values in ((self._position, vertices), (self._colour, colours)):
            view = self._document["bufferViews"][
                self._document["accessors"][accessor]["bufferView"]
            ]
            start, content = view["byteOffset"], np.ascontiguousarray(values, "<f4").tobytes()
            body[start : start + len(content)] = content
        bounds = self._document["accessors"][self._position]
        columns = np.ascontiguousarray(vertices.T)
        bounds["min"], bounds["max"] = columns.min(axis=1).tolist(), columns.max(axis=1).tolist()
        text = json.dumps(self._document, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        total = _HEAD + len(text) + 8 + len(body)
        return b"".join(
            (
                struct.pack("<4sII", b"glTF", 2, total),
                struct.pack("<I4s", len(text), b"JSON"),
                text,
                struct.pack("<I4s", len(body), b"BIN\0"),
                body,
            )
        )
