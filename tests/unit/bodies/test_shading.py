"""Surfaces of bodies as they are drawn: closed, bevelled, shaded and tinted."""

import numpy as np
import pytest
import trimesh

from warpspace.bodies.mesh import MIDDLE, build_body
from warpspace.bodies.placed import load_bodies
from warpspace.bodies.schematic import box, cylinder
from warpspace.bodies.shading import shade_bodies
from warpspace.scene.machine_library import load_machine, machine_names

HERE = np.eye(4).tobytes()


def body(mesh, frame="R"):
    return build_body(mesh, f"{frame}_body", frame, MIDDLE)


def closed(surface):
    mesh = trimesh.Trimesh(surface.vertices_mm, surface.triangles, process=False)
    assert mesh.is_watertight
    assert mesh.volume > 0.0
    return mesh


@pytest.mark.parametrize("name", machine_names())
def test_bevelled_bodies_are_closed_lie_within_the_sharp_ones_and_keep_their_volume(name):
    machine = load_machine(name)
    bodies = load_bodies(machine)
    for sharp, surface in zip(bodies, shade_bodies(bodies, (HERE,) * len(bodies)), strict=True):
        mesh = closed(surface)
        volume = trimesh.Trimesh(sharp.vertices_mm, sharp.triangles, process=False).volume
        assert 0.93 < mesh.volume / volume < 1.001, sharp.name
        low, high = sharp.vertices_mm.min(axis=0), sharp.vertices_mm.max(axis=0)
        assert (mesh.bounds[0] > low - 0.1).all()
        assert (mesh.bounds[1] < high + 0.1).all()
        assert len(mesh.faces) <= 4 * len(sharp.triangles)


def test_a_bevelled_box_has_24_vertices_with_normals_of_its_sides_and_faces_between():
    (surface,) = shade_bodies((body(box((0, 1000), (0, 800), (0, 600))),), (HERE,))
    assert len(surface.vertices_mm) == 24
    assert surface.normals is not None
    np.testing.assert_allclose(np.abs(surface.normals).max(axis=1), 1.0, atol=1e-9)
    normals = np.unique(np.round(np.abs(closed(surface).face_normals), 6), axis=0)
    r, s = np.sqrt(0.5), np.sqrt(1.0 / 3.0)
    expected = {(1, 0, 0), (0, 1, 0), (0, 0, 1), (r, r, 0), (r, 0, r), (0, r, r), (s, s, s)}
    assert {tuple(np.round(n, 3)) for n in normals} == {tuple(np.round(n, 3)) for n in expected}


def test_a_surface_is_darker_near_the_floor_and_beside_another_body():
    post, wall = box((0, 100), (0, 100), (0, 1000)), box((100, 200), (0, 100), (500, 1000))
    shaded, beside = shade_bodies((body(post), body(wall)), (HERE, HERE))
    brightness = shaded.colours.max(axis=1)
    at = shaded.vertices_mm
    free = brightness[(at[:, 0] < 50) & (at[:, 2] > 500)]
    assert brightness[(at[:, 0] < 50) & (at[:, 2] < 500)].min() < free.min()
    assert brightness[(at[:, 0] > 50) & (at[:, 2] > 500)].min() < free.min()
    assert beside.colours.max() <= MIDDLE[2] / 255.0


def test_moving_bodies_carry_the_hue_of_their_axis_and_the_bed_none():
    shapes = [box((k, k + 10), (0, 10), (0, 10)) for k in (0, 1000, 2000, 3000)]
    bodies = tuple(body(shape, frame) for shape, frame in zip(shapes, "RXYZ", strict=True))
    bed, *moving = shade_bodies(bodies, (HERE,) * 4)
    grey = np.array(MIDDLE) / np.linalg.norm(MIDDLE)
    ratio = bed.colours / np.linalg.norm(bed.colours, axis=1, keepdims=True)
    np.testing.assert_allclose(ratio, np.tile(grey, (24, 1)), atol=1e-9)
    for k, surface in enumerate(moving):
        hue = surface.colours / np.linalg.norm(surface.colours, axis=1, keepdims=True) - grey
        assert (np.argmax(hue, axis=1) == k).all()
        assert np.ptp(surface.colours, axis=1).max() < 0.16  # restrained: colour means error


def test_an_open_or_a_very_large_body_is_drawn_as_it_is():
    half = cylinder(50.0, (0.0, 100.0))
    half.update_faces(np.arange(len(half.faces)) > 3)
    large = trimesh.creation.icosphere(subdivisions=6, radius=100.0)
    assert len(large.faces) > 20_000
    for shape in (half, large):
        sharp = body(shape)
        (surface,) = shade_bodies((sharp,), (HERE,))
        assert surface.normals is None
        assert surface.triangles is sharp.triangles


def test_the_brightness_of_a_flat_side_is_linear_so_that_its_triangles_do_not_show():
    plate = box((0, 1000), (0, 100), (0, 1000))
    post = box((0, 300), (-200, 0), (0, 300))  # beside one corner of the plate
    shaded, _ = shade_bodies((body(plate), body(post)), (HERE, HERE))
    at, brightness = shaded.vertices_mm, shaded.colours[:, 2]
    front = shaded.normals[:, 1] < -0.9
    basis = np.insert(at[front][:, [0, 2]], 2, 1.0, axis=1)
    fitted = basis @ np.linalg.lstsq(basis, brightness[front])[0]
    np.testing.assert_allclose(brightness[front], fitted, atol=1e-9)
    assert np.ptp(brightness[front]) > 0.01
