"""A binary glTF file taken apart by its specification."""

import json
import struct

import numpy as np


def opened(data):
    """Give the JSON document and the bytes behind it."""
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    json_length = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20 : 20 + json_length]), data[28 + json_length :]


def values(data, accessor):
    document, body = opened(data)
    found = document["accessors"][accessor]
    kind = {5121: "|u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}[found["componentType"]]
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[found["type"]]
    view = document["bufferViews"][found["bufferView"]]
    assert view["byteLength"] >= found["count"] * width * np.dtype(kind).itemsize
    start = view["byteOffset"] + found.get("byteOffset", 0)
    read = np.frombuffer(body, kind, found["count"] * width, start)
    return read if width == 1 else read.reshape(-1, width)
