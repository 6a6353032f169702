"""Draw what docs/model.md explains, with the numbers of the model: SVG into docs/images.

    python docs/drawings.py [FOLDER]

A drawing is a function here and a file ``model_<name>.svg``. Texts stay texts in the files, so that
a test can compare them with what the model gives now.
"""

import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("svg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from warpspace import evaluate, load_scene
from warpspace.field.grid import build_grid
from warpspace.kinematics.chain import branch_frames, branch_pose, columns, loop_error
from warpspace.kinematics.model import ComponentErrors, Loop, Model, complete_coordinates
from warpspace.machine.definition import build_machine

Points = NDArray[np.float64]

INK, FAINT, TOOL, WORK, ERROR = "#1b1f24", "#8a9099", "#1f6fb2", "#b2571f", "#c2185b"
AXES = ("#c62828", "#2e7d32", "#1565c0")
"""Colours of x, y and z."""
STYLE = {
    "svg.fonttype": "none",
    "svg.hashsalt": "warpspace",
    "font.size": 10,
    "font.family": "sans-serif",
    "text.color": INK,
    "axes.titlesize": 11,
}
ISO = np.array([[0.78, -0.62, 0.0], [0.30, 0.34, 0.89]])
"""A parallel projection: x to the right front, y to the left back, z upwards."""


def _flat(points: Points) -> Points:
    """Project points of R on the sheet."""
    return np.asarray(points) @ ISO.T


def _bare(axes: Axes) -> None:
    axes.set_aspect("equal")
    axes.set_axis_off()


def _beside(point: Points, right: float, up: float) -> tuple[float, float]:
    """Give the place of a word beside a point of the sheet."""
    return float(point[0]) + right, float(point[1]) + up


def _arrow(axes: Axes, start: Points, end: Points, colour: str, width: float = 1.6) -> None:
    axes.annotate(
        "",
        xy=tuple(end),
        xytext=tuple(start),
        annotation_clip=False,
        arrowprops={
            "arrowstyle": "-|>",
            "color": colour,
            "lw": width,
            "shrinkA": 0,
            "shrinkB": 0,
            "mutation_scale": 9,
        },
    )


def _triad(axes: Axes, pose: Points, name: str, shift: tuple[float, float], size: float) -> None:
    """Draw a frame: three coloured arrows and its name."""
    origin = _flat(pose[:3, 3])
    for index, colour in enumerate(AXES):
        _arrow(axes, origin, _flat(pose[:3, 3] + size * pose[:3, index]), colour, 1.3)
    axes.text(*_beside(origin, *shift), name, ha="center", va="center", weight="bold")


def frames() -> Figure:
    """Draw the frames of the DVF5000, from the frame of the machine to tool and workpiece."""
    scene = load_scene("dvf5000_nominal")
    at = complete_coordinates(scene.machine, {"X": 120.0, "Y": -80.0, "Z": -120.0})
    figure, axes = plt.subplots(figsize=(7.4, 6.4), layout="constrained")
    places = {"R": (-30, -34), "X": (62, 8), "Y": (-34, 34), "Z": (48, -30), "t": (62, -6)}
    places |= {"B": (-48, 26), "C": (-60, -4), "w": (78, -20)}
    volume = build_grid(scene.model, scene.workspace, 2).point_mm
    for along in range(3):
        for line in np.moveaxis(volume, along, 2).reshape(4, 2, 3):
            axes.plot(*_flat(line).T, "--", color=FAINT, lw=0.9)
    for side, colour in (("tool", TOOL), ("workpiece", WORK)):
        stops = [np.eye(4)]
        names = []
        for frame in branch_frames(scene.model, side, at):
            stops.append(np.asarray(frame.after))
            names.append(frame.axis.name)
        stops.append(np.asarray(branch_pose(scene.model, side, at)))
        names.append("t" if side == "tool" else "w")
        for before, after in pairwise(stops):
            line = _flat(np.stack([before[:3, 3], after[:3, 3]]))
            axes.plot(*line.T, color=colour, lw=2.2, alpha=0.55, solid_capstyle="round")
        for name, stop in zip(names, stops[1:], strict=True):
            _triad(axes, stop, name, places[name], 80.0 if name in "BCw" else 95.0)
    _triad(axes, np.eye(4), "R", places["R"], 150.0)
    for index, letter in enumerate("xyz"):
        axes.text(
            *_flat(np.eye(3)[index] * 172.0), letter, color=AXES[index], ha="center", va="center"
        )
    handles = [
        axes.plot([], [], color=TOOL, lw=3, alpha=0.55, label="tool branch: X, Y, Z, t")[0],
        axes.plot([], [], color=WORK, lw=3, alpha=0.55, label="workpiece branch: B, C, w")[0],
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=2, frameon=False)
    axes.set_title("wCBFXYZt: from the frame of the machine R outwards", loc="left")
    _bare(axes)
    axes.margins(0.08)
    return figure


def lever() -> Figure:
    """Draw how a rotation moves a point across its lever: the pitch of Y, along x."""
    scene = load_scene("dvf5000_nominal")
    at = complete_coordinates(scene.machine, {"X": 0.0, "Y": -225.0, "Z": -480.0})
    point = np.asarray(
        evaluate(scene, at={key: float(value) for key, value in at.items()}).nominal_mm
    )
    column = columns(scene.model, Loop.TOOL, ["EAY"], at, point)["EAY"]
    reach = np.asarray(column.lever_mm)
    origin, gain = point - reach, np.asarray(column.position)
    angle = 0.22  # rad, for the eye
    turned = origin + reach + angle * 1000.0 * gain
    figure, axes = plt.subplots(figsize=(7.4, 4.8), layout="constrained")
    for end, colour, style in ((point, INK, "-"), (turned, ERROR, "--")):
        axes.plot(*np.stack([origin, end])[:, 1:].T, style, color=colour, lw=1.8)
    _arrow(axes, point[1:], turned[1:], ERROR, 2.2)
    axes.plot(*origin[1:], "o", color=INK, ms=7)
    axes.plot(*point[1:], "o", color=INK, ms=5)
    axes.text(*_beside(origin[1:], 20, 20), "origin of frame Y", va="bottom")
    axes.text(*_beside(point[1:], -24, 0), "tool point", va="center", ha="right")
    middle = (origin + point)[1:] / 2
    axes.text(
        *_beside(middle, -90, 30),
        f"lever\ny {reach[1]:.0f}, z {reach[2]:.0f} mm\nlength {np.hypot(*reach[1:]):.0f} mm",
        ha="right",
        va="bottom",
    )
    label = f"1 µrad of EAY about x moves the point by\ny {gain[1]:+.3f} µm, z {gain[2]:+.3f} µm"
    axes.text(*_beside(turned[1:], 60, -12), label, color=ERROR, va="center")
    sweep = np.linspace(0.0, angle, 20)
    radius = 0.35 * np.hypot(*reach[1:])
    start = np.arctan2(reach[2], reach[1])
    arc = origin[1:, None] + radius * np.stack([np.cos(start + sweep), np.sin(start + sweep)])
    axes.plot(*arc, color=ERROR, lw=1.5)
    axes.set_title("gain = direction × lever", loc="left")
    _bare(axes)
    axes.margins(0.12)
    return figure


def _section(name: str, exaggeration: float) -> tuple[Points, Points, float]:
    """Give the YZ section of a scene's volume, nominal and drawn, and its largest error."""
    field = evaluate(load_scene(name), grid=9)
    middle = field.nominal_mm.shape[0] // 2
    nominal = np.asarray(field.nominal_mm)[middle][..., 1:]
    error = np.asarray(field.error_um)[middle][..., 1:]
    return (
        nominal,
        nominal + exaggeration * error * 1e-3,
        float(np.linalg.norm(error, axis=-1).max()),
    )


def exaggeration() -> Figure:
    """Draw one section of a measured volume at three display factors."""
    figure, row = plt.subplots(
        1, 3, figsize=(8.6, 3.4), layout="constrained", sharex=True, sharey=True
    )
    for axes, factor in zip(row, (1.0, 1000.0, 3000.0), strict=True):
        nominal, drawn, largest = _section("dvf5000_first", factor)
        border = np.concatenate([nominal[0], nominal[:, -1], nominal[-1, ::-1], nominal[::-1, 0]])
        for lines in (drawn, drawn.swapaxes(0, 1)):
            for line in lines:
                axes.plot(*line.T, color=TOOL, lw=1.0)
        axes.plot(*border.T, "--", color=FAINT, lw=1.2)
        words = "true scale" if factor == 1.0 else f"×{factor:g}"
        axes.set_title(
            f"{words}: {largest:.1f} µm drawn as {largest * factor / 1000:.3g} mm", fontsize=9
        )
        _bare(axes)
    return figure


def conventions() -> Figure:
    """Draw one error of a table after the motion and before it, at three positions of C."""
    machine = build_machine("wCFt")
    amount, table = 10.0, 1.0
    figure, grid = plt.subplots(2, 3, figsize=(7.4, 5.2), layout="constrained")
    kinds = (ComponentErrors.AFTER_MOTION, ComponentErrors.BEFORE_MOTION)
    for row, kind in zip(grid, kinds, strict=True):
        for axes, degrees in zip(row, (0.0, 45.0, 90.0), strict=True):
            at = complete_coordinates(machine, {"C": degrees})
            error, _ = loop_error(
                Model(machine, kind), Loop.WORKPIECE, at, {"EXC": amount}, np.zeros(3)
            )
            x, y = (np.asarray(error)[:2] / amount * 0.8).round(9)
            axes.add_patch(plt.Circle((0, 0), table, fill=False, color=FAINT, lw=1.4))
            turn = np.radians(degrees)
            axes.plot(
                np.cos(turn) * np.array([0.85, 1.15]),
                np.sin(turn) * np.array([0.85, 1.15]),
                color=WORK,
                lw=3,
            )
            _arrow(axes, np.zeros(2), np.array([x, y]), ERROR, 2.4)
            given = np.asarray(error).round(6) + 0.0
            axes.text(0, -1.32, f"x {given[0]:.1f}, y {given[1]:.1f} µm", ha="center", color=ERROR)
            axes.set_title(f"C {degrees:g}°", fontsize=10)
            axes.set_xlim(-1.5, 1.5)
            axes.set_ylim(-1.5, 1.35)
            _bare(axes)
        row[0].text(-1.75, 0, kind.value, rotation=90, ha="right", va="center", weight="bold")
    return figure


def squareness() -> Figure:
    """Draw the sign of a squareness: a positive EC0Y turns Y counter-clockwise about z."""
    scene = load_scene("teach_squareness")
    field = evaluate(scene, grid=7, loop="tool")
    nominal = np.asarray(field.nominal_mm)[:, :, 0, :2]
    error = np.asarray(field.error_um)[:, :, 0, :2]
    held = error - error[:, error.shape[1] // 2][error.shape[0] // 2]
    drawn = nominal + 5000.0 * held * 1e-3
    gamma = scene.errors.amplitude("EC0Y")
    figure, axes = plt.subplots(figsize=(6.4, 4.6), layout="constrained")
    border = np.concatenate([nominal[0], nominal[:, -1], nominal[-1, ::-1], nominal[::-1, 0]])
    axes.plot(*border.T, "--", color=FAINT, lw=1.3)
    for lines in (drawn, drawn.swapaxes(0, 1)):
        for line in lines:
            axes.plot(*line.T, color=TOOL, lw=1.1)
    centre = nominal[nominal.shape[0] // 2, nominal.shape[1] // 2]
    _arrow(axes, centre, np.asarray(_beside(centre, 330, 0)), AXES[0], 2.2)
    tip = centre + 1.12 * (drawn[drawn.shape[0] // 2, -1] - centre)
    _arrow(axes, centre, np.array([centre[0], tip[1]]), FAINT)
    _arrow(axes, centre, tip, AXES[1], 2.2)
    axes.set_ylim(top=tip[1] + 10.0)
    axes.set_xlim(right=centre[0] + 360.0)
    axes.text(*_beside(centre, 345, 0), "X", color=AXES[0], va="center", weight="bold")
    axes.text(*_beside(tip, -14, 0), "Y", color=AXES[1], ha="right", weight="bold")
    axes.set_title(f"EC0Y = +{gamma:g} µrad, the middle held still, drawn ×5000", loc="left")
    _bare(axes)
    return figure


DRAWINGS: dict[str, Callable[[], Figure]] = {
    "frames": frames,
    "lever": lever,
    "exaggeration": exaggeration,
    "conventions": conventions,
    "squareness": squareness,
}


def draw(name: str, folder: Path) -> Path:
    """Write one drawing.

    Parameters
    ----------
    name : str
    folder : Path

    Returns
    -------
    Path
    """
    path = folder / f"model_{name}.svg"
    with plt.rc_context(STYLE):
        figure = DRAWINGS[name]()
        figure.savefig(path, metadata={"Date": None, "Creator": None})
        plt.close(figure)
    return path


if __name__ == "__main__":
    where = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "images"
    for each in DRAWINGS:
        draw(each, where)
