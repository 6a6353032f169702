"""Draw the thumbnails of the bundled scenes into ``scenes/thumbnails``.

    python examples/thumbnails.py [SCENE …]

`make thumbnails` runs it. The first scene of each machine shows the machine, others the volume
with the machine pale around it.
"""

import sys
from dataclasses import replace
from io import BytesIO

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

from warpspace.bodies.placed import place_bodies
from warpspace.geometry import surfaces
from warpspace.machine.axes import is_linear
from warpspace.outputs.drawing import map3d, off_screen
from warpspace.outputs.drawing.canvas import Canvas
from warpspace.outputs.drawing.settings import LIGHT, FigureSettings, evaluate_for
from warpspace.outputs.figures.machine_figures import draw_bodies
from warpspace.resources import scenes_dir
from warpspace.scene.library import load_scene, scene_names

SIZE = (160, 120)
TIMES = 4  # larger while drawn
QUALITY = 90


def draw(name: str) -> Image.Image:
    scene = load_scene(name)
    width, height = (TIMES * side for side in SIZE)
    canvas = Canvas(width, height, LIGHT)
    picture = evaluate_for(FigureSettings(), scene)
    placed = place_bodies(scene, picture.view, 0.0)
    volume_mm, bodies_mm = map3d.map_points_mm(picture), [part.vertices_mm for part in placed]
    alike = [other for other in scene_names() if load_scene(other).machine == scene.machine]
    is_machine = name == alike[0]
    content = np.concatenate([volume_mm, *(bodies_mm if is_machine else ())])
    margin = 0.03 * width if is_machine else 0.12 * width
    room = (margin, margin, width - margin, height - margin)
    projection = off_screen.fit_projection("iso", content, room)
    draw_bodies(canvas, placed, projection, opacity=1.0 if is_machine else 0.2, nominal=False)
    whole = replace(picture, cut=False)
    shape, nodes = whole.shape, whole.drawn_mm.reshape(-1, 3)
    faces = surfaces.outer_faces(shape)
    volume = off_screen.render_bodies(map3d.surface_bodies(whole, faces), projection)
    if volume is not None:
        is_around = not any(is_linear(axis) for axis in scene.workspace.ranges)  # an arm
        opacity = 0.25 if is_around else 0.8 if is_machine else 0.95
        map3d.draw_raster(canvas, volume, opacity, 2.0)
    creases = surfaces.crease_lines(faces, shape) or surfaces.box_edges(shape)
    lines, _ = off_screen.split_visible((nodes[line] for line in creases), projection, volume)
    canvas.lines(lines, width=4.0, zorder=3.0)
    map3d.draw_lone_line(canvas, whole, projection)
    buffer = BytesIO()
    FigureCanvasAgg(canvas.figure).print_png(buffer)
    with Image.open(buffer) as drawn:
        return drawn.convert("RGB").resize(SIZE, Image.Resampling.LANCZOS)


def main() -> None:
    folder = scenes_dir() / "thumbnails"
    folder.mkdir(exist_ok=True)
    for name in sys.argv[1:] or scene_names():
        path = folder / f"{name}.webp"
        draw(name).save(path, quality=QUALITY, method=6)
        print(f"{path.name}: {path.stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
