"""The container of a binary glTF 2.0 file: accessors, materials, meshes and nodes, byte for byte.

Only what the exports need. Vertices are metres, Y up, as glTF wants them; colours are linear.
"""

import json
import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpspace.geometry.colour import Bytes
from warpspace.units import Array

Json = dict[str, Any]
LINES, TRIANGLES = 1, 4
_FLOAT, _UNSIGNED_INT = 5126, 5125
_ARRAY_BUFFER, _ELEMENT_ARRAY_BUFFER = 34962, 34963
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
_MAGIC, _VERSION, _JSON, _BIN = 0x46546C67, 2, 0x4E4F534A, 0x004E4942
_UNLIT = "KHR_materials_unlit"
_M_PER_MM = 1e-3


def to_gltf(points_mm: Array) -> Array:
    """Turn points or vectors of R into glTF's frame.

    Parameters
    ----------
    points_mm : ndarray, [..., 3], mm
        Z up.

    Returns
    -------
    ndarray, [..., 3], m
        Y up: (x, z, −y).
    """
    x, y, z = np.moveaxis(np.asarray(points_mm), -1, 0)
    return np.stack([x, z, -y], -1) * _M_PER_MM


def srgb_to_linear(colours: Bytes) -> Array:
    """Decode sRGB bytes, [..., 3], to the linear values glTF stores, 0 … 1."""
    value = np.asarray(colours) / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


class GltfBuilder:
    """Collects the parts of a scene and joins them to one binary file."""

    def __init__(self) -> None:
        self._accessors: list[Json] = []
        self._views: list[Json] = []
        self._chunks: list[bytes] = []
        self._length = 0
        self._materials: list[Json] = []
        self._meshes: list[Json] = []
        self._nodes: list[Json] = []

    def add_material(
        self, name: str, srgb: Sequence[int] = (255, 255, 255), opacity: float = 1.0
    ) -> int:
        """Add a material that no light changes.

        Parameters
        ----------
        name : str
        srgb : sequence of int, (3,), optional
            Colour; vertex colours are multiplied with it.
        opacity : float, optional

        Returns
        -------
        int
            Its index.
        """
        linear = srgb_to_linear(np.asarray(srgb, dtype=np.uint8))
        material: Json = {
            "name": name,
            "doubleSided": True,
            "extensions": {_UNLIT: {}},
            "pbrMetallicRoughness": {
                "baseColorFactor": [*(round(float(part), 6) for part in linear), opacity],
                "metallicFactor": 0.0,
                "roughnessFactor": 1.0,
            },
        }
        if opacity < 1.0:
            material["alphaMode"] = "BLEND"
        self._materials.append(material)
        return len(self._materials) - 1

    def add_mesh(
        self,
        name: str,
        attributes: Mapping[str, Array],
        indices: NDArray[np.integer[Any]],
        material: int,
        *,
        targets: Mapping[str, Array] | None = None,
    ) -> int:
        """Add a mesh of triangles, [T, 3], or line segments, [S, 2].

        Parameters
        ----------
        name : str
        attributes : mapping of str to ndarray, [V, n]
            glTF attribute name to values; POSITION in metres, Y up.
        indices : ndarray, [T, 3] or [S, 2]
        material : int
        targets : mapping of str to ndarray, [V, 3], optional
            Morph targets: name to displacement of POSITION at weight 1.

        Returns
        -------
        int
            Its index.
        """
        primitive: Json = {
            "attributes": {
                key: self._add_accessor(values, bounds=key == "POSITION")
                for key, values in attributes.items()
            },
            "indices": self._add_accessor(indices.reshape(-1, 1), elements=True),
            "material": material,
            "mode": TRIANGLES if indices.shape[1] == 3 else LINES,
        }
        mesh: Json = {"name": name, "primitives": [primitive]}
        if targets:
            primitive["targets"] = [
                {"POSITION": self._add_accessor(values, bounds=True)} for values in targets.values()
            ]
            mesh["weights"] = [0.0] * len(targets)
            mesh["extras"] = {"targetNames": list(targets)}
        self._meshes.append(mesh)
        return len(self._meshes) - 1

    def add_node(self, name: str, *, mesh: int | None = None, children: Sequence[int] = ()) -> int:
        """Add a named node with a mesh, or one that holds other nodes; give its index."""
        node: Json = {"name": name}
        if mesh is not None:
            node["mesh"] = mesh
        if children:
            node["children"] = list(children)
        self._nodes.append(node)
        return len(self._nodes) - 1

    def _add_accessor(
        self,
        values: NDArray[np.floating[Any]] | NDArray[np.integer[Any]],
        *,
        bounds: bool = False,
        elements: bool = False,
    ) -> int:
        """Store an array, [n, components], as 32-bit floats or indices."""
        data = np.ascontiguousarray(values, dtype="<u4" if elements else "<f4")
        self._views.append(
            {
                "buffer": 0,
                "byteOffset": self._length,
                "byteLength": data.nbytes,
                "target": _ELEMENT_ARRAY_BUFFER if elements else _ARRAY_BUFFER,
            }
        )
        self._chunks.append(data.tobytes())
        self._length += data.nbytes
        accessor: Json = {
            "bufferView": len(self._views) - 1,
            "componentType": _UNSIGNED_INT if elements else _FLOAT,
            "count": len(data),
            "type": _TYPES[data.shape[1]],
        }
        if bounds:
            accessor["min"] = [float(value) for value in data.min(axis=0)]
            accessor["max"] = [float(value) for value in data.max(axis=0)]
        self._accessors.append(accessor)
        return len(self._accessors) - 1

    def to_bytes(self, root: int, generator: str, extras: Json) -> bytes:
        """Join everything to a .glb file.

        Parameters
        ----------
        root : int
            Node that holds all others.
        generator : str
            Program and version.
        extras : dict
            Goes into the metadata of the asset.

        Returns
        -------
        bytes
        """
        document: Json = {
            "asset": {"version": "2.0", "generator": generator, "extras": extras},
            "extensionsUsed": [_UNLIT],
            "scene": 0,
            "scenes": [{"nodes": [root]}],
            "nodes": self._nodes,
            "meshes": self._meshes,
            "materials": self._materials,
            "accessors": self._accessors,
            "bufferViews": self._views,
            "buffers": [{"byteLength": self._length}],
        }
        text = json.dumps(document, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
        head = _padded(text.encode(), b" ")
        body = _padded(b"".join(self._chunks), b"\0")
        total = 12 + 8 + len(head) + 8 + len(body)
        return b"".join(
            [
                struct.pack("<III", _MAGIC, _VERSION, total),
                struct.pack("<II", len(head), _JSON),
                head,
                struct.pack("<II", len(body), _BIN),
                body,
            ]
        )


def _padded(data: bytes, filler: bytes) -> bytes:
    """Fill up to a multiple of four bytes."""
    return data + filler * (-len(data) % 4)
