"""Variation between parts: the session term of inspection reports."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from warpspace.analysis.uncertainty.propagation import t_quantile
from warpspace.calibration.instruments import effective_dof
from warpspace.calibration.part_reports import measured_part
from warpspace.calibration.readings import Readings
from warpspace.kinematics import transforms
from warpspace.units import MM_PER_UM, UM_PER_MM, Array

UNSEEN = 3.0  # with it 95 % of intervals hold (simulated) where the scatter hides the variation


@dataclass(frozen=True)
class SessionTerms:
    """Variation between parts: standard uncertainty of each number of the shape of one part."""

    parts: tuple[Readings, ...]  # (m,), reports
    unknown: Mapping[str, float]  # fitted unknowns of set-ups, mm or mrad
    sigma_mm: float  # standard deviation of a reading that states none
    scatter_dof: float
    values: Array  # [m, s], µm/m and µrad: shape of each part less that of the mean part
    u: float | None  # µm/m and µrad; None where one report does not tell
    dof: float
    source: str  # stated, estimated or unknown

    @classmethod
    def of(
        cls,
        sets: Sequence[Readings],
        unknown: Mapping[str, float],
        covariance: Array,
        scatter: tuple[float, float],
        stated: float | None,
    ) -> "SessionTerms | None":
        """Estimate the variation by moments: squared terms less their variance from the scatter.

        The numbers of the shape are pooled. The degrees of freedom are reduced by the variance that
        is subtracted, so that those of the sum are s·(m − 1), and `UNSEEN` times that where no
        variation is seen.
        `covariance`, [u, u], is that of the unknowns; `scatter` is sigma, mm, and its dof.
        """
        parts = tuple(readings for readings in sets if readings.part)
        if not parts:
            return None
        names, unknowns = measured_part(parts[0]).shape.names, [*unknown]
        select = np.zeros((len(parts), len(names), len(unknowns)))
        for at, readings in enumerate(parts):
            for other, factor in measured_part(readings).terms:
                for number, name in enumerate(names):
                    select[at, number, unknowns.index(f"{other} {name}")] = factor * UM_PER_MM
        values = select @ np.array([*unknown.values()])
        variance = float(np.einsum("tnu,uv,tnv->", select, covariance, select))
        build = partial(cls, parts, unknown, *scatter, values)
        free = values.size - len(names)
        if stated is not None:
            return build(stated, np.inf, "stated")
        if not free:
            return build(None, np.inf, "unknown")
        total, least = float(np.sum(values**2)), max(variance * (1.0 + 1e-6), 1e-18)
        if total < least:  # no variation is seen
            total, free = least, UNSEEN * free
        u = float(np.sqrt((total - variance) / free))
        return build(u, free * (1.0 - variance / total) ** 2, "estimated")

    def columns(self, sets: Sequence[Readings]) -> Array:
        """Compute the change of all readings by one u of each number of the shape, [N, s], mm."""
        rows = [
            measured_part(readings).shape.columns[1]
            if readings.part
            else np.zeros((readings.observed_mm.size, self.values.shape[1]))
            for readings in sets
        ]
        return (self.u or 0.0) * MM_PER_UM * np.vstack(rows)

    def notes(self) -> Iterator[str]:
        if self.u is None:
            yield (
                f"{self.parts[0].session[0]}: intervals hold for this part only; expected several"
                " reports or the variation between parts (session-u) for those of the machine"
            )

    def as_json(self) -> dict[str, Any]:
        variation = {
            "standard_uncertainty": self.u,
            "degrees_of_freedom": self.values.size - self.values.shape[1]
            if self.source == "estimated"
            else None,
            "source": self.source,
        }
        rows = {"sessions": self._session_rows(), "shape": self._shape_rows()}
        return {**rows, "between_parts": variation}

    def _shape_rows(self) -> list[dict[str, Any]]:
        """Evaluate the shape of the mean part, with intervals for it and for the next part.

        The next part is measured as these are. Without u both intervals are None, and that of the
        mean holds for the measured part alone.
        """
        shapes, scatters = list[Array](), list[Array]()
        for readings in self.parts:
            inverse = measured_part(readings).shape.inverses[1]
            sigma_mm = self.sigma_mm if readings.sigma_mm is None else readings.sigma_mm
            shapes.append(UM_PER_MM * inverse @ readings.observed_mm.ravel())
            scatters.append(
                np.sum((UM_PER_MM * inverse) ** 2, axis=1) * np.mean(np.square(sigma_mm))
            )
        means, scatter = np.mean(shapes, axis=0), np.mean(scatters, axis=0)
        count, variance = len(self.parts), np.full_like(scatter, (self.u or 0.0) ** 2)
        shape = measured_part(self.parts[0]).shape
        halves: list[Array] = []
        for factor in (1.0 / count, 1.0 + 1.0 / count):
            terms = np.array([scatter, variance]) * factor
            dof = effective_dof(terms, [self.scatter_dof, self.dof])
            halves.append(t_quantile(0.975, dof) * np.sqrt(terms.sum(axis=0)))
        return [
            {
                "measure": name,
                "unit": unit,
                "value": float(mean),
                "interval_95": [float(mean - half), float(mean + half)],
                "next_part_95": None
                if self.u is None
                else [float(mean - wide), float(mean + wide)],
            }
            for name, unit, mean, half, wide in zip(
                shape.names, shape.units, means, *halves, strict=True
            )
        ]

    def _session_rows(self) -> list[dict[str, Any]]:
        """Return placement and term of each report."""
        rows: list[dict[str, Any]] = []
        for readings, values in zip(self.parts, self.values, strict=True):
            part, label, unknown = measured_part(readings), readings.session[0], self.unknown
            size = part.shape.size
            move = np.array([unknown[f"{label} {x}"] for x in "xyz"[:size]] + [0.0] * (3 - size))
            turn = np.array([unknown.get(f"{label} turn {x}", 0.0) for x in "xyz"]) * MM_PER_UM
            pose = part.alignment @ transforms.rigid(transforms.vector_rotation(turn), move)
            angles = transforms.roll_pitch_yaw_deg(pose[:3, :3])
            names = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
            placement = dict(zip(names, [*pose[:3, 3].tolist(), *angles.tolist()], strict=True))
            if size == 2:
                placement = {name: placement[name] for name in ("x_mm", "y_mm", "c_deg")}
            term = dict(zip(part.shape.keys, values.tolist(), strict=True))
            rows.append({"file": label, "placement": placement, "term": term})
        return rows
