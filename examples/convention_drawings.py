"""
Drawings of the conventions
===========================

Draw the conventions of error sets into ``docs/images``, one drawing each.

    python examples/convention_drawings.py [--to docs/images]

`CONVENTIONS.md` shows them. Nothing in them is to scale: errors are drawn large enough to be seen.
"""

import argparse
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from PIL import Image

from warpspace.kinematics.conversion import ReferenceLine, fit_line

TO = Path(__file__).resolve().parents[1] / "docs" / "images"
INK, MUTED, ACTUAL, SECOND = "#1b2430", "#7b8494", "#c8283c", "#1f6fb2"
COLOURS = 24
"""Few are enough for lines and letters, and make small files."""
SIZE, DPI = (9.0, 3.6), 110
FONT = 13
Place = Any
"""Two coordinates."""


def sheet(columns: int = 2) -> tuple[Figure, list[Axes]]:
    """Begin a drawing with panels side by side."""
    figure = Figure(figsize=SIZE, dpi=DPI)
    panels = [figure.add_subplot(1, columns, number + 1) for number in range(columns)]
    for panel in panels:
        panel.set_aspect("equal")
        panel.axis("off")
    return figure, panels


def arrow(axes: Axes, start: Place, end: Place, colour: str = INK, width: float = 2.0) -> None:
    """Draw an arrow."""
    axes.annotate(
        "",
        xy=end,
        xytext=start,
        arrowprops={"arrowstyle": "-|>", "color": colour, "lw": width, "shrinkA": 0, "shrinkB": 0},
    )


def text(axes: Axes, x: float, y: float, label: str, colour: str = INK) -> None:
    """Write words."""
    axes.text(x, y, label, color=colour, fontsize=FONT, ha="center", va="center")


def body(axes: Axes, centre: Place, turn: float, colour: str, size: Place = (1.1, 0.6)) -> None:
    """Draw a body, turned by an angle in rad."""
    half = np.array(size) / 2.0
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    cosine, sine = np.cos(turn), np.sin(turn)
    turned = corners @ np.array([[cosine, sine], [-sine, cosine]]) + np.asarray(centre)
    axes.add_patch(Polygon(turned, closed=True, fill=False, edgecolor=colour, linewidth=2.0))


def order() -> Figure:
    """Component errors after and before the motion: a rotary table with a radial error."""
    figure, panels = sheet()
    titles = ("after the motion: errors ride on the body", "before the motion: fixed directions")
    for panel, title, rides in zip(panels, titles, (True, False), strict=True):
        for start, alpha in ((0.0, 0.35), (np.deg2rad(60.0), 1.0)):
            circle = np.linspace(0.0, 2.0 * np.pi, 100)
            panel.plot(np.cos(circle), np.sin(circle), color=MUTED, lw=1.5)
            panel.plot([0.0, np.cos(start)], [0.0, np.sin(start)], color=INK, lw=2, alpha=alpha)
            shift = start if rides else 0.0
            tip = 0.55 * np.array([np.cos(shift), np.sin(shift)])
            side = np.array([0.0, -0.08 if start == 0.0 else 0.08])
            if rides:
                side = np.array([np.sin(start), -np.cos(start)]) * 0.12
            arrow(panel, side, side + tip, ACTUAL, 2.6 if alpha == 1.0 else 1.6)
        text(panel, 1.46, 0.0, "C = 0°", MUTED)
        text(panel, 0.78, 1.05, "C = 60°")
        text(panel, 0.0, -1.25, "EXC", ACTUAL)
        text(panel, 0.0, 1.45, title)
        panel.set_xlim(-1.9, 1.9)
        panel.set_ylim(-1.5, 1.65)
    return figure


def squareness() -> Figure:
    """A positive squareness by the right-hand rule, and what it does to the angle."""
    figure, panels = sheet()
    cases = (
        ("EC0Y > 0: angle over 90°", "X", "Y", 0.2, "out of the page: Z"),
        ("EB0Z > 0: angle under 90°", "X", "Z", -0.2, "into the page: Y"),
    )
    for panel, (title, first, second, turn, view) in zip(panels, cases, strict=True):
        arrow(panel, (0, 0), (1.6, 0))
        panel.plot([0, 0], [0, 1.5], color=MUTED, lw=1.5, ls="--")
        tip = 1.5 * np.array([-np.sin(turn), np.cos(turn)])
        arrow(panel, (0, 0), tuple(tip), ACTUAL, 2.4)
        angle = np.linspace(0.0, np.pi / 2.0 + turn, 60)
        panel.plot(0.45 * np.cos(angle), 0.45 * np.sin(angle), color=SECOND, lw=1.8)
        text(panel, 0.62, 0.52, f"90° {'+' if turn > 0 else '−'} |ε|", SECOND)
        text(panel, 1.75, 0.0, first)
        text(panel, float(tip[0]) + 0.16 * np.sign(-turn), float(tip[1]), second, ACTUAL)
        text(panel, 0.6, 1.85, title)
        text(panel, 0.6, -0.3, view, MUTED)
        panel.set_xlim(-0.9, 2.2)
        panel.set_ylim(-0.5, 2.05)
    return figure


def measuring_line() -> Figure:
    """A pitch seen along a line away from the origin of the axis: the Abbe arm."""
    figure, (panel,) = sheet(1)
    turn = 0.16
    panel.plot([-2.6, 3.4], [0, 0], color=MUTED, lw=1.5)
    text(panel, 3.1, -0.22, "motion of X", MUTED)
    body(panel, (0, 0), 0.0, MUTED, (1.6, 0.7))
    body(panel, (0, 0), -turn, ACTUAL, (1.6, 0.7))
    panel.plot([0], [0], "o", color=INK)
    text(panel, -0.05, -0.62, "origin of the axis")
    lever = np.array([0.0, 1.7])
    direction = 1.7 * np.array([np.sin(turn), np.cos(turn)])
    panel.plot([0, lever[0]], [0, lever[1]], color=MUTED, lw=1.5, ls="--")
    panel.plot([0, direction[0]], [0, direction[1]], color=ACTUAL, lw=2)
    panel.plot([-2.6, 3.4], [1.7, 1.7], color=SECOND, lw=1.8, ls="-.")
    text(panel, -1.75, 1.95, "measuring line", SECOND)
    arrow(panel, (0, 1.7), (direction[0] + 0.02, 1.7), ACTUAL, 2.4)
    text(panel, 1.55, 2.0, "seen: EXX + EBX · p", ACTUAL)
    text(panel, -0.35, 1.05, "arm p", MUTED)
    text(panel, 0.75, 0.75, "pitch EBX", ACTUAL)
    panel.set_xlim(-2.9, 3.8)
    panel.set_ylim(-0.9, 2.3)
    return figure


POSITION = np.array([0.0, 100.0, 200.0, 300.0, 400.0])
STRAIGHT = np.array([0.0, 4.4, 1.2, 3.4, 4.8])


def reference_line() -> Figure:
    """The three reference lines of one straightness curve, and where their tilt goes."""
    figure = Figure(figsize=SIZE, dpi=DPI)
    panels = [figure.add_subplot(1, 3, number + 1) for number in range(3)]
    titles = ("end points", "least squares", "minimum zone")
    for panel, line, title in zip(panels, ReferenceLine, titles, strict=True):
        offset, slope = fit_line(POSITION, STRAIGHT, line)
        along = offset + slope * POSITION
        residual = STRAIGHT - along
        panel.plot(POSITION, STRAIGHT, "o-", color=ACTUAL, lw=1.8, ms=5)
        panel.plot(POSITION, along, color=SECOND, lw=2)
        panel.fill_between(
            POSITION, along + residual.min(), along + residual.max(), color=SECOND, alpha=0.15
        )
        panel.set_title(title, fontsize=FONT, color=INK)
        panel.set_xlabel("Y  [mm]", fontsize=FONT - 1)
        panel.tick_params(labelsize=FONT - 2)
        panel.set_ylim(-2.0, 7.0)
        panel.text(
            390, -1.5, f"tilt {1e3 * slope:.1f} µrad\nband {np.ptp(residual):.2f} µm",
            fontsize=FONT - 2, ha="right", va="bottom", color=SECOND,
        )  # fmt: skip
        for side in ("top", "right"):
            panel.spines[side].set_visible(False)
    panels[0].set_ylabel("EXY  [µm]", fontsize=FONT - 1)
    figure.subplots_adjust(left=0.08, right=0.98, bottom=0.17, top=0.9, wspace=0.22)
    return figure


def zero() -> Figure:
    """A curve that is zero at a position, and the constant that keeps the field."""
    figure = Figure(figsize=SIZE, dpi=DPI)
    panels = [figure.add_subplot(1, 2, number + 1) for number in range(2)]
    at = np.linspace(0.0, 400.0, 200)
    value = 4.0 + 3.0 * np.sin(at / 110.0)
    offset = 4.0 + 3.0 * np.sin(150.0 / 110.0)
    for panel, shift, title in zip(
        panels, (0.0, offset), ("as measured", "zero at Y 150"), strict=True
    ):
        panel.axhline(0.0, color=MUTED, lw=1)
        panel.axvline(150.0, color=MUTED, lw=1, ls="--")
        panel.plot(at, value - shift, color=ACTUAL, lw=2.2)
        panel.plot([150.0], [offset - shift], "o", color=SECOND)
        panel.set_title(title, fontsize=FONT, color=INK)
        panel.set_xlabel("Y  [mm]", fontsize=FONT - 1)
        panel.tick_params(labelsize=FONT - 2)
        panel.set_ylim(-7.5, 8.5)
        for side in ("top", "right"):
            panel.spines[side].set_visible(False)
    panels[0].set_ylabel("EYY  [µm]", fontsize=FONT - 1)
    panels[1].text(
        395,
        5.6,
        f"EY0Y = {offset:.2f} µm\nmakes up for it",
        fontsize=FONT,
        ha="right",
        color=SECOND,
    )
    figure.subplots_adjust(left=0.08, right=0.98, bottom=0.17, top=0.9, wspace=0.18)
    return figure


def held_point() -> Figure:
    """Absolute errors, and those with one point held still."""
    figure, panels = sheet()
    for panel, title, fixed_point in zip(
        panels, ("absolute", "a reference point held still"), (False, True), strict=True
    ):
        grid = np.stack(np.meshgrid(np.linspace(0, 2, 5), np.linspace(0, 1.4, 4)), -1)
        error = np.stack([0.25 + 0.0 * grid[..., 0], 0.12 + 0.1 * grid[..., 0]], -1)
        error[..., 0] -= 0.16 * grid[..., 1]
        moved = grid + error - (error[1, 2] if fixed_point else 0.0)
        for points, colour, width in ((grid, MUTED, 1.0), (moved, ACTUAL, 1.8)):
            for rows in (points, points.transpose(1, 0, 2)):
                for row in rows:
                    panel.plot(row[:, 0], row[:, 1], color=colour, lw=width)
        panel.plot(*grid[1, 2], "o", color=SECOND, ms=8, zorder=5)
        text(panel, 1.1, 1.95, title)
        panel.set_xlim(-0.35, 2.6)
        panel.set_ylim(-0.3, 2.15)
    return figure


DRAWINGS: dict[str, Callable[[], Figure]] = {
    "convention_order": order,
    "convention_squareness": squareness,
    "convention_measuring_line": measuring_line,
    "convention_reference_line": reference_line,
    "convention_zero": zero,
    "convention_held_point": held_point,
}
"""File name to drawing."""


def main() -> None:
    """Draw all of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--to", type=Path, default=TO)
    folder = parser.parse_args().to
    folder.mkdir(parents=True, exist_ok=True)
    for name, draw in DRAWINGS.items():
        target = folder / f"{name}.png"
        content = io.BytesIO()
        draw().savefig(content, format="png", facecolor="white")
        drawing = Image.open(content).convert("RGB").quantize(COLOURS)
        drawing.save(target, optimize=True)
        print(target)


if __name__ == "__main__":
    main()
