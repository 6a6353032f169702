"""A binary glTF file that is written again and again with other points and colours.

trimesh lays the file out once, which takes it a millisecond or two; a slider move then replaces
positions, colours and bounds in it.
"""

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpspace.bodies.gltf import Part, build_gltf
from warpspace.units import Array

_HEAD = 20
"""Bytes before the document: header of the file, and of the first chunk."""


class GltfTemplate:
    """The file of one coloured part.

    Parameters
    ----------
    name : str
        Of the part.
    indices : ndarray of int, [T, 3] or [S, 2]
    count : int
        Number of points.
    """

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
        """Write the file with other points and colours.

        Parameters
        ----------
        points : ndarray, [V, 3]
        colours : ndarray, [V, 3]
            Linear, any value.

        Returns
        -------
        bytes
        """
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
