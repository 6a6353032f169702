"""Binary glTF files: coloured surfaces, unlit or lit, and lines."""

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
LINES, _TRIANGLES = 1, 4  # modes of a primitive
_M_PER_MM = 1e-3
_LARGEST_UINT16 = 65534
_VERTICES, _INDICES = 34962, 34963  # targets of buffer views
_COMPONENTS = {"|u1": 5121, "<u2": 5123, "<u4": 5125, "<f4": 5126}
_BYTE = "|u1"  # bytes are stored as shares of 255
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


@dataclass(frozen=True, slots=True)
class Material:
    """Colour of a part."""

    name: str = "unlit"
    srgb: tuple[int, int, int] = (255, 255, 255)  # colours of the points are multiplied with it
    opacity: float = 1.0
    lit: bool = False


@dataclass(frozen=True, slots=True)
class GltfNode:
    """A surface or a set of lines, with a node of its own."""

    name: str
    points: Array  # [V, 3]; as in the file: metres, Y up
    # [T, 3] or [S, 2]; numbers of the points of triangles, or of the ends of pieces of line
    indices: NDArray[np.integer[Any]]
    material: Material = Material()
    # [V, 3], or with opacity [V, 4]; linear, any value; or bytes, shares of 255
    colours: NDArray[Any] | None = None
    # [V, n]; further values per point: NORMAL, or names that begin with an underscore
    attributes: Mapping[str, Array] = field(default_factory=dict[str, Array])
    # [V, 3]; morph targets: name to displacement of the points at weight 1
    targets: Mapping[str, Array] = field(default_factory=dict[str, Array])
    group: str = ""  # name of the node that holds it; the root by default


def to_gltf(points_mm: Array) -> Array:
    x, y, z = np.moveaxis(np.asarray(points_mm), -1, 0)
    return np.stack([x, z, -y], -1) * _M_PER_MM


def build_gltf(
    parts: Sequence[GltfNode],
    *,
    root: str = "scene",
    generator: str = "warpspace",
    extras: Mapping[str, Any] | None = None,
) -> bytes:
    parts = [part for part in parts if len(part.indices)]
    materials = list(dict.fromkeys(part.material for part in parts))
    groups = list(dict.fromkeys(part.group for part in parts if part.group))
    children: dict[str, list[int]] = {name: [] for name in ("", *groups)}
    children[""] += range(1, len(children))
    for at, part in enumerate(parts, len(children)):
        children[part.group].append(at)
    arrays = _Arrays()
    document: Json = {
        "asset": {
            "version": "2.0",
            "generator": generator,
            **({"extras": extras} if extras else {}),
        },
        "extensionsUsed": [UNLIT],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [
            *({"name": name or root, "children": below} for name, below in children.items()),
            *({"name": part.name, "mesh": at} for at, part in enumerate(parts)),
        ],
        "materials": [_material(material) for material in materials],
        "meshes": [_mesh(part, materials.index(part.material), arrays) for part in parts],
        "accessors": arrays.accessors,
        "bufferViews": arrays.views,
        "buffers": [{"byteLength": len(arrays.body)}],
    }
    text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    return b"".join(
        (
            struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(arrays.body)),
            struct.pack("<I4s", len(text), b"JSON"),
            text,
            struct.pack("<I4s", len(arrays.body), b"BIN\0"),
            arrays.body,
        )
    )


class _Arrays:
    """A buffer of arrays; equal ones are stored once."""

    def __init__(self) -> None:
        self.body = bytearray()
        self.views: list[Json] = []
        self.accessors: list[Json] = []
        self._known: dict[tuple[str, int, bytes], int] = {}

    def put(self, values: NDArray[Any], kind: str, target: int | None = None) -> int:
        """Store numbers, [n] or [n, 1 to 4]; return the number of their accessor and view."""
        rows = np.asarray(values, kind).reshape(len(values), -1)
        data = rows.tobytes()
        at = self._known.setdefault((kind, rows.shape[1], data), len(self.views))
        if at == len(self.views):
            view = {"buffer": 0, "byteOffset": len(self.body), "byteLength": len(data)}
            self.views.append(view)
            self.body += data + bytes(-len(data) % 4)
            columns = np.ascontiguousarray(rows.T)  # ten times as fast to search as rows
            self.accessors.append(
                {
                    "bufferView": at,
                    "componentType": _COMPONENTS[kind],
                    "count": len(rows),
                    "type": _TYPES[rows.shape[1]],
                    "min": columns.min(axis=1).tolist(),
                    "max": columns.max(axis=1).tolist(),
                    **({"normalized": True} if kind == _BYTE else {}),
                }
            )
        if target is not None:
            self.views[at]["target"] = target
        return at


def _mesh(part: GltfNode, material: int, arrays: _Arrays) -> Json:
    values: dict[str, NDArray[Any]] = {"POSITION": part.points, **part.attributes}
    if part.colours is not None:
        values["COLOR_0"] = part.colours
    kind = "<u2" if part.indices.max() <= _LARGEST_UINT16 else "<u4"
    primitive: Json = {
        "attributes": {
            key: arrays.put(of, _BYTE if of.dtype == np.uint8 else "<f4", _VERTICES)
            for key, of in values.items()
        },
        "indices": arrays.put(part.indices.reshape(-1), kind, _INDICES),
        "mode": LINES if part.indices.shape[1] == 2 else _TRIANGLES,
        "material": material,
    }
    mesh: Json = {"name": part.name, "primitives": [primitive]}
    if part.targets:
        shifts = part.targets.values()
        primitive["targets"] = [{"POSITION": arrays.put(shift, "<f4")} for shift in shifts]
        mesh["weights"] = [0.0] * len(shifts)
        mesh["extras"] = {"targetNames": list(part.targets)}
    return mesh


def _material(material: Material) -> Json:
    linear = srgb_to_linear(np.array(material.srgb) / 255.0)
    entries: Json = {
        "name": material.name,
        "doubleSided": True,
        "pbrMetallicRoughness": {
            "baseColorFactor": [*(round(float(part), 6) for part in linear), material.opacity],
            "metallicFactor": 0.0,
            "roughnessFactor": 1.0,
        },
    }
    if not material.lit:
        entries["extensions"] = {UNLIT: {}}
    if material.opacity < 1.0:
        entries["alphaMode"] = "BLEND"
    return entries
