"""Bodies of an arm: rotary joints in series that carry the tool, as in a robot."""

from dataclasses import replace
from itertools import pairwise, takewhile
from typing import Any

import numpy as np

from warpspace.bodies.ends import Head
from warpspace.bodies.schematic import MachineLayout, Parts, about, cylinder, pair, rod
from warpspace.kinematics.chain import BASE

_FEWEST_JOINTS, _MOST_SLIDES = 4, 1
_THICK, _THIN = 0.055, 0.03
"""Radii of the first and the last joint, relative to the length of the arm."""
_DRUM, _TUBE, _FOOT, _PEDESTAL = 1.2, 0.8, 1.6, 0.9
"""Half length of a drum, radii of tubes and of the foot, height of the pedestal, in radii."""
_FLANGE, _SHORT = 0.15, 0.35
"""Thickness of the tool flange, largest half of the last drum, relative to the tool."""
_APART_MM = 1.0  # between points that are drawn apart


def is_arm(layout: MachineLayout) -> bool:
    """Check that the tool hangs on at least four rotary axes in series, alone or on one slide."""
    slides = list(takewhile(lambda axis: axis.is_linear, layout.tool))
    joints = layout.tool[len(slides) :]
    in_series = len(joints) >= _FEWEST_JOINTS and not any(axis.is_linear for axis in joints)
    return in_series and len(slides) <= _MOST_SLIDES


class Arm:
    """An arm while it is built: a drum about each joint, and a tapered tube to the next one."""

    def __init__(self, parts: Parts, tool: str) -> None:
        self.parts, self.layout, self.tool = parts, parts.layout, tool
        self.slides = [axis for axis in self.layout.tool if axis.is_linear]
        self.joints = [axis for axis in self.layout.tool if not axis.is_linear]
        self.tip_mm, spindle = self.layout.tip_mm, self.layout.poses["S"][:3, 3]
        # [J + 1, 3]; origins of the joints and of the tool flange
        self.points_mm = np.array([*(axis.origin_mm for axis in self.joints), spindle])
        steps = np.diff([*self.points_mm, self.tip_mm], axis=0)
        self.length_mm = float(np.linalg.norm(steps, axis=1).sum()) or self.layout.half_mm.max()
        self.radii_mm = self.length_mm * np.linspace(_THICK, _THIN, len(self.joints) + 1)

    def build(self, bed_mm: float | None) -> float:
        """Build the arm, on a bed where there is one; return the height of its foot, mm."""
        nose = self._add_tool()
        for number, (axis, (start, end)) in enumerate(
            zip(self.joints, pairwise(self.points_mm), strict=True)
        ):
            radius, next_radius = self.radii_mm[number : number + 2]
            half = _DRUM * radius
            if axis is self.joints[-1]:
                half = min(half, _SHORT * nose)
            out = half * axis.direction
            self.parts.add(axis.name, "joint", rod(start - out, start + out, radius))
            if min(np.linalg.norm(end - start), np.linalg.norm(end - self.tip_mm)) > _APART_MM:
                tube = rod(start, end, _TUBE * radius, _TUBE * next_radius)
                self.parts.add(axis.name, "link", tube)
        return self._add_base(bed_mm)

    def _add_tool(self) -> float:
        """Add flange and tool from the last point apart; return its distance to the tool point."""
        from trimesh import geometry

        radius, tip = float(self.radii_mm[-1]), self.tip_mm
        apart = [tip - point for point in self.points_mm if np.linalg.norm(tip - point) > _APART_MM]
        to_tip = apart[-1] if apart else -2.0 * radius * self.layout.poses["t"][:3, 2]
        length = float(np.linalg.norm(to_tip))
        pose: Any = geometry.align_vectors([0, 0, 1], -to_tip / length)
        pose[:3, 3] = tip
        far = (1.0 - _SHORT) * length
        flange = rod(tip - to_tip, tip - (far - _FLANGE * length) / length * to_tip, radius)
        self.parts.add("S", "flange", flange)
        layout = replace(self.layout, unit_mm=radius, poses={**self.layout.poses, "t": pose})
        Head(replace(self.parts, layout=layout), self.tool).add_tool(far)
        return length if apart else np.inf

    def _add_base(self, bed_mm: float | None) -> float:
        layout, parts, u = self.layout, self.parts, float(self.radii_mm[0])
        axis, at = self.joints[0], self.points_mm[0]
        slide = self.slides[0] if self.slides else None
        up = 1.0 if (self.points_mm[1:, 2] - at[2]).mean() >= -0.1 * self.length_mm else -1.0
        reach = np.zeros(3)
        if slide is not None:
            reach[slide.k] = slide.reach_mm
        near = np.abs(at - layout.tip_mm) < layout.half_mm + reach + _FOOT * u + layout.gap_mm
        drum = up * float(at[2]) - _DRUM * u * abs(float(axis.direction[2]))  # heights along up
        below = up * float(layout.tip_mm[2]) - float(layout.half_mm[2]) - layout.gap_mm
        top = min(drum, below) if near[:2].all() else drum
        foot = top - _PEDESTAL * u
        if up > 0.0:
            foot = min(foot, 0.0 if bed_mm is None else bed_mm)
        frame = BASE if slide is None else slide.name

        def ends(low: float, high: float) -> tuple[float, float]:
            first, last = sorted((up * low, up * high))
            return first, last

        if top < drum:
            parts.add(axis.name, "link", cylinder(_TUBE * u, ends(top, drum), at))
        parts.add(frame, "base", cylinder(u, ends(foot, top), at))
        parts.add(frame, "base", cylinder(_FOOT * u, ends(foot, foot + 0.25 * u), at))
        if slide is None:
            return foot
        if slide.k == 2:
            low = foot - 2.0 * slide.reach_mm - u
            parts.add(frame, "lift", cylinder(u, ends(low, foot), at))
            parts.add(BASE, "column", cylinder(1.3 * u, ends(low - u, foot - slide.reach_mm), at))
            return low - u
        k, low = slide.k, foot - 0.3 * u
        i = about(float(at[k]), slide.reach_mm + 2.0 * _FOOT * u)
        j = about(float(at[1 - k]), _FOOT * u)
        for line in pair(float(at[1 - k]), u, 0.2 * u):
            parts.box(BASE, "rails", i, line, ends(low, foot), along=k)
        if up > 0.0:
            parts.stand(i, j, along=k)
        else:
            parts.box(BASE, "beam", i, j, ends(low - u, low), along=k)
        return low
