"""A binary glTF file with one unlit mesh in vertex colours, written by hand.

viser has no mesh with colours per vertex that arrive as given; `KHR_materials_unlit` with float
colours does. Only what that needs is written: positions, colours, indices.
"""

import json
import struct
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from warpspace.app.evaluation.cache import Identity
from warpspace.app.viewport.tone_map import Floats
from warpspace.units import Array

_FLOAT, _UINT16, _UINT32 = 5126, 5123, 5125
_VERTEX_BUFFER, _INDEX_BUFFER = 34962, 34963
_LINES, _TRIANGLES = 1, 4
_SMALL = 65535
_ALIGN = 4
_CUT = "bounds"


def _padded(data: bytes, fill: bytes) -> bytes:
    """Fill a chunk up to a multiple of four bytes."""
    return data + fill * (-len(data) % _ALIGN)


@lru_cache(maxsize=32)
def _header(vertices: int, indices: int, mode: int) -> tuple[str, str, str]:
    """Spell the JSON chunk for a number of vertices and indices, cut where the bounds belong."""
    small = vertices <= _SMALL
    floats = 12 * vertices
    index_bytes = (2 if small else 4) * indices
    document = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "surface"}],
        "meshes": [
            {
                "primitives": [
                    {
                        "attributes": {"POSITION": 0, "COLOR_0": 1},
                        "indices": 2,
                        "material": 0,
                        "mode": mode,
                    }
                ]
            }
        ],
        "materials": [
            {
                "doubleSided": True,
                "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 1]},
                "extensions": {"KHR_materials_unlit": {}},
            }
        ],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": _FLOAT,
                "count": vertices,
                "type": "VEC3",
                "min": _CUT,
                "max": _CUT,
            },
            {"bufferView": 1, "componentType": _FLOAT, "count": vertices, "type": "VEC3"},
            {
                "bufferView": 2,
                "componentType": _UINT16 if small else _UINT32,
                "count": indices,
                "type": "SCALAR",
            },
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": floats, "target": _VERTEX_BUFFER},
            {"buffer": 0, "byteOffset": floats, "byteLength": floats, "target": _VERTEX_BUFFER},
            {
                "buffer": 0,
                "byteOffset": 2 * floats,
                "byteLength": index_bytes,
                "target": _INDEX_BUFFER,
            },
        ],
        "buffers": [{"byteLength": 2 * floats + index_bytes}],
    }
    before, between, after = json.dumps(document, separators=(",", ":")).split(f'"{_CUT}"')
    return before, between, after


@lru_cache(maxsize=8)
def _indices(triangles: Identity, kind: str) -> bytes:
    """Write vertex numbers; those of one array once."""
    return triangles.thing.astype(kind).tobytes()


def build_glb(vertices: Array, triangles: NDArray[np.integer], colours: Floats) -> bytes:
    """Write one unlit mesh, or lines.

    Parameters
    ----------
    vertices : ndarray, [M, 3]
    triangles : ndarray of int, [T, 3] or [S, 2]
        Vertex numbers of triangles, or of the ends of pieces of line (drawn a pixel wide).
    colours : ndarray of float32, [M, 3]
        Linear; any value.

    Returns
    -------
    bytes
        A complete GLB file, vertices and colours as 32-bit floats.
    """
    points = np.ascontiguousarray(vertices, dtype="<f4")
    columns = np.ascontiguousarray(points.T)
    low, high = columns.min(axis=1).tolist(), columns.max(axis=1).tolist()
    indices = _indices(Identity(triangles), "<u2" if len(points) <= _SMALL else "<u4")
    before, between, after = _header(
        len(points), triangles.size, _LINES if triangles.shape[-1] == 2 else _TRIANGLES
    )
    text = _padded(f"{before}{low}{between}{high}{after}".encode(), b" ")
    body = _padded(points.tobytes() + colours.astype("<f4").tobytes() + indices, b"\0")
    length = 12 + 8 + len(text) + 8 + len(body)
    return b"".join(
        (
            struct.pack("<4sII", b"glTF", 2, length),
            struct.pack("<I4s", len(text), b"JSON"),
            text,
            struct.pack("<I4s", len(body), b"BIN\0"),
            body,
        )
    )
