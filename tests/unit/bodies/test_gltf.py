import numpy as np
import pytest
import trimesh

from glb import opened, values
from warpspace.bodies.gltf import GltfNode, Material, build_gltf
from warpspace.geometry.colour import linear_to_srgb

POINTS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.5]])
COLOURS = np.array([[0.0, 0.1, -0.2], [2.5, 0.0, 0.0], [0.0, 1.0, 0.0]], np.float32)
TRIANGLE = GltfNode("surface", POINTS, np.array([[0, 1, 2]]), colours=COLOURS)


def only_primitive(data):
    (mesh,) = opened(data)[0]["meshes"]
    (primitive,) = mesh["primitives"]
    return primitive


@pytest.mark.parametrize("count", [2, 3, 4, 5])
def test_lines_come_out_as_the_given_pairs(count):
    pairs = np.stack([np.arange(count - 1), np.arange(1, count)], -1)
    points = np.random.default_rng(count).normal(size=(count, 3)).astype(np.float32)
    data = build_gltf([GltfNode("lines", points, pairs, targets={"nominal": -points})])
    primitive = only_primitive(data)
    assert primitive["mode"] == 1
    np.testing.assert_array_equal(values(data, primitive["indices"]).reshape(-1, 2), pairs)
    np.testing.assert_array_equal(values(data, primitive["targets"][0]["POSITION"]), -points)
    assert set(primitive["attributes"]) == {"POSITION"}
    read = trimesh.load_scene(trimesh.util.wrap_as_stream(data), file_type="glb")
    entities = read.geometry["lines"].entities
    assert sum(len(entity.points) - 1 for entity in entities) == len(pairs)


@pytest.mark.parametrize(("points", "kind"), [(65535, 5123), (65536, 5125)])
def test_numbers_of_points_take_16_bits_where_they_fit(points, kind):
    many = np.arange(points)[:, None] * np.array([1.0, 0.0, 0.0])
    triangles = np.array([[0, 1, points - 1], [2, 3, 4], [5, 6, 7]])
    data = build_gltf([GltfNode("many", many, triangles)])
    accessor = only_primitive(data)["indices"]
    assert opened(data)[0]["accessors"][accessor]["componentType"] == kind
    np.testing.assert_array_equal(values(data, accessor), triangles.ravel())


def test_nodes_hang_under_root_and_groups_and_empty_parts_are_left_out():
    glass = Material("glass", (10, 20, 30), 0.25)
    triangle = np.array([[0, 1, 2]])
    parts = [
        GltfNode("a", POINTS, triangle),
        GltfNode("b", POINTS, triangle, glass, group="bodies"),
        GltfNode("b", POINTS + 1.0, triangle, glass, group="bodies"),
        GltfNode("none", POINTS, np.empty((0, 2), int)),
    ]
    document, _ = opened(build_gltf(parts, root="all ×2", generator="w 1", extras={"é": 1}))
    nodes = document["nodes"]
    (root,) = document["scenes"][document["scene"]]["nodes"]
    assert nodes[root]["name"] == "all ×2"
    children = {nodes[at]["name"]: nodes[at] for at in nodes[root]["children"]}
    assert set(children) == {"a", "bodies"}
    below = [nodes[at].keys() for at in children["bodies"]["children"]]
    assert below == [{"name", "mesh"}] * 2
    assert document["asset"] == {"version": "2.0", "generator": "w 1", "extras": {"é": 1}}
    assert [m["name"] for m in document["materials"]] == ["unlit", "glass"]
    assert document["materials"][1]["alphaMode"] == "BLEND"
    factor = document["materials"][1]["pbrMetallicRoughness"]["baseColorFactor"]
    np.testing.assert_allclose(linear_to_srgb(np.array(factor[:3])) * 255.0, (10, 20, 30), atol=0.1)
    assert factor[3] == 0.25


def test_nan_in_the_extras_is_refused():
    with pytest.raises(ValueError, match="JSON"):
        build_gltf([TRIANGLE], extras={"a": float("nan")})


def test_colours_are_stored_as_they_are_with_any_value():
    data = build_gltf([TRIANGLE])
    colours = values(data, only_primitive(data)["attributes"]["COLOR_0"])
    np.testing.assert_array_equal(colours, COLOURS)


def test_colours_of_bytes_are_stored_as_shares_of_a_lit_surface():
    colours = np.array([[255, 0, 10, 255]] * 3, np.uint8)
    lit, normals = Material("body", lit=True), np.eye(3)
    node = GltfNode("b", POINTS, np.array([[0, 1, 2]]), lit, colours, {"NORMAL": normals})
    data = build_gltf([node])
    document, attributes = opened(data)[0], only_primitive(data)["attributes"]
    assert document["accessors"][attributes["COLOR_0"]]["normalized"] is True
    np.testing.assert_array_equal(values(data, attributes["COLOR_0"]), colours)
    np.testing.assert_array_equal(values(data, attributes["NORMAL"]), normals)
    assert "extensions" not in document["materials"][0]
    assert "normalized" not in document["accessors"][attributes["POSITION"]]
