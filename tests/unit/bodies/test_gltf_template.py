"""A file that is filled again equals one that is written anew."""

import io

import numpy as np
import trimesh

from warpspace.bodies.gltf import Part, build_gltf
from warpspace.bodies.gltf_template import GltfTemplate

RNG = np.random.default_rng(3)
TRIANGLES = np.array([[0, 1, 2], [1, 3, 2]])


def part(points: np.ndarray, colours: np.ndarray) -> Part:
    return Part("surface", points, TRIANGLES, colours=colours)


def read(data: bytes) -> trimesh.Trimesh:
    scene = trimesh.load_scene(io.BytesIO(data), file_type="glb", process=False)
    return next(iter(scene.geometry.values()))


def test_a_filled_template_is_the_file_written_anew() -> None:
    template = GltfTemplate("surface", TRIANGLES, 4)
    for _ in range(3):
        points, colours = RNG.normal(size=(4, 3)), RNG.normal(size=(4, 3))
        filled, anew = template.fill(points, colours), build_gltf([part(points, colours)])
        for data in (filled, anew):
            assert len(data) % 4 == 0
            assert int.from_bytes(data[8:12], "little") == len(data)
        one, other = read(filled), read(anew)
        np.testing.assert_array_equal(one.vertices, other.vertices)
        np.testing.assert_array_equal(one.faces, other.faces)
        assert np.frombuffer(colours.astype("<f4").tobytes(), np.uint8).tobytes() in filled


def test_an_earlier_file_keeps_its_bytes() -> None:
    template = GltfTemplate("surface", TRIANGLES, 4)
    first = template.fill(np.ones((4, 3)), np.ones((4, 3)))
    before = bytes(first)
    template.fill(np.full((4, 3), 2.0), np.zeros((4, 3)))
    assert first == before
