"""The same task by hand: volumetric error map of a three-axis machine, with numpy and matplotlib.

    python benchmarks/plain_map.py map.png

Twenty-one errors of a travelling-gantry mill, first order, over 21³ nodes; the deformed volume,
coloured, and a slider for one squareness. What it does not have: checks of its input, an exact
model, errors as curves, other chains, scale bars, hidden lines, exports.
"""

import sys
from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.widgets import Slider
from mpl_toolkits.mplot3d.art3d import Line3DCollection

RANGES = {"X": (-1500.0, 1500.0), "Y": (-900.0, 900.0), "Z": (-900.0, 0.0)}
OFFSETS = {"X": (-600.0, 0.0, 900.0), "Y": (300.0, 0.0, 500.0), "Z": (300.0, 0.0, -250.0)}
TOOL = (0.0, 0.0, -300.0)
# µm and µrad; a component error grows from zero to this value along its axis
COMPONENTS = {
    "X": (15.0, 0.0, 0.0, -8.0, 10.0, 0.0),
    "Y": (0.0, -11.0, 0.0, -12.0, 14.0, 0.0),
    "Z": (0.0, 0.0, -11.0, 10.0, 0.0, 14.0),
}
SQUARENESS = {"Y": [0.0, 0.0, 18.0], "Z": [-12.0, 14.0, 0.0]}
EXAGGERATION = 1000.0


def evaluate(grid):
    """Nominal points, mm, and errors of the tool point, µm, [n, n, n, 3] each."""
    tip = np.broadcast_to(TOOL, (*grid["X"].shape, 3)).copy()
    errors_um = np.zeros_like(tip)
    for name in ("Z", "Y", "X"):  # from the tool to the bed
        low, high = RANGES[name]
        share = ((grid[name] - low) / (high - low))[..., None]
        component = share * np.array(COMPONENTS[name])
        errors_um += component[..., :3] + np.cross(component[..., 3:], tip) * 1e-3
        tip[..., "XYZ".index(name)] += grid[name]
        if name in SQUARENESS:
            errors_um += np.cross(SQUARENESS[name], tip) * 1e-3
        tip += OFFSETS[name]
    return tip, errors_um


def lines(points):
    """Grid lines on the faces of the volume, every fifth node."""
    chosen = []
    for axis in range(3):
        moved = np.moveaxis(points, axis, 2)[::5, ::5]
        at = [(i, j) for i in range(5) for j in range(5) if i in (0, 4) or j in (0, 4)]
        chosen += [moved[i, j] for i, j in at]
    return np.array(chosen)


def pieces(points):
    """Pieces of the grid lines, each with a colour of its own."""
    return [piece for line in lines(points) for piece in pairwise(line)]


def main():
    axes = [np.linspace(*RANGES[name], 21) for name in "XYZ"]
    grid = dict(zip("XYZ", np.meshgrid(*axes, indexing="ij"), strict=True))
    figure = plt.figure(figsize=(16, 12), dpi=100)
    plot = figure.add_axes((0.02, 0.1, 0.9, 0.85), projection="3d")
    nominal, _ = evaluate(grid)
    collection = Line3DCollection(pieces(nominal), cmap="viridis")
    plot.add_collection3d(Line3DCollection(lines(nominal), colors="0.8", linewidths=0.5))
    plot.add_collection3d(collection)
    plot.set(xlabel="X in mm", ylabel="Y in mm", zlabel="Z in mm")
    limits = [(nominal[..., at].min() - 100.0, nominal[..., at].max() + 100.0) for at in range(3)]
    plot.set(xlim=limits[0], ylim=limits[1], zlim=limits[2])
    plot.set_box_aspect([high - low for low, high in limits])
    bar = figure.colorbar(collection, ax=plot, shrink=0.6, label="position error in µm")
    place = figure.add_axes((0.2, 0.04, 0.5, 0.02))
    slider = Slider(place, "EC0Y in µrad", -50.0, 50.0, valinit=18.0)

    def draw(value):
        SQUARENESS["Y"][2] = value
        nominal, errors_um = evaluate(grid)
        norm_um = np.linalg.norm(errors_um, axis=-1)
        collection.set_segments(pieces(nominal + EXAGGERATION * errors_um * 1e-3))
        collection.set_array(np.mean(pieces(norm_um[..., None]), axis=(1, 2)))
        collection.set_clim(0.0, norm_um.max())
        bar.update_normal(collection)
        plot.set_title(
            f"mean {norm_um.mean():.2f} µm, max {norm_um.max():.2f} µm, ×{EXAGGERATION:g}"
        )
        figure.canvas.draw_idle()

    slider.on_changed(draw)
    draw(slider.val)
    print(plot.get_title())
    if len(sys.argv) > 1:
        figure.savefig(sys.argv[1])
    else:
        plt.show()


if __name__ == "__main__":
    main()
