"""Readings of a measurement as a calibration takes them: where, what was read, how well."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from warpspace.calibration.table import ReadingTable, parse_table
from warpspace.exceptions import OptionError, SceneError
from warpspace.machine.limits import MAX_CSV_BYTES
from warpspace.resources import assets_dir
from warpspace.scene.files import read_text
from warpspace.scene.model import Scene
from warpspace.units import Array

if TYPE_CHECKING:
    from warpspace.calibration.circles import Circle


@dataclass(frozen=True, slots=True)
class Readings:
    """The readings of one file.

    Attributes
    ----------
    kind : str
        Name of the kind of measurement.
    coordinates : mapping of str to ndarray, [n], mm or degrees
        Commanded positions of all axes.
    nominal_mm : ndarray, [n, 3], mm
        Nominal tool point in the workpiece frame.
    observed_mm : ndarray, [n, d], mm
        What was read.
    sigma_mm : ndarray, [n], mm, or None
        Standard uncertainty of each reading.
    session : tuple of str, (n,)
        Readings of one session share what is unknown about the set-up.
    lines : tuple of int, (n,)
        Lines of the file.
    source : str
        Name of the file.
    notes : tuple of str
        What was assumed on reading it.
    circles : tuple of Circle
        About rotary axes, where the readings are such.
    """

    kind: str
    coordinates: Mapping[str, Array]
    nominal_mm: Array
    observed_mm: Array
    sigma_mm: Array | None
    session: tuple[str, ...]
    lines: tuple[int, ...]
    source: str
    notes: tuple[str, ...] = ()
    circles: "tuple[Circle, ...]" = ()

    def __len__(self) -> int:
        """Count the readings."""
        return len(self.lines)


def find_data(name: str) -> Path:
    """Find a file of readings: a path, or the name of a bundled one such as ``tcp_on.csv``."""
    path = Path(name)
    if path.exists() or path.name != name:
        return path
    bundled = sorted((assets_dir() / "measurements").glob(f"*/{name}"))
    return bundled[0] if bundled else path


def bundled_data() -> tuple[str, ...]:
    """Name the files of readings that come with warpspace."""
    return tuple(path.name for path in sorted((assets_dir() / "measurements").glob("*/*.csv")))


def read_readings(name: str, scene: Scene, kind: str | None = None) -> Readings:
    """Read a file of readings for a machine.

    Parameters
    ----------
    name : str
        A path, or the name of a bundled file.
    scene : Scene
    kind : str, optional
        Kind of measurement; by default the one whose columns the file has.

    Returns
    -------
    Readings

    Raises
    ------
    SceneError
        If the file cannot be read or lacks a column.
    OptionError
        If no kind fits.
    """
    path = find_data(name)
    return parse_readings(read_text(path, MAX_CSV_BYTES), str(path), scene, kind)


def parse_readings(text: str, source: str, scene: Scene, kind: str | None = None) -> Readings:
    """Read the text of a file of readings; see `read_readings`.

    Parameters
    ----------
    text : str
    source : str
        Name of the file, for messages; nothing is opened.
    scene : Scene
    kind : str, optional

    Returns
    -------
    Readings
    """
    from warpspace.calibration.kinds.registry import find_kind, recognise

    found = None if kind is None else find_kind(kind)
    if found is not None and found.own_columns:
        return found.read(ReadingTable(source, {}, {}, (), text), scene)
    table = parse_table(text, source)
    return (found or recognise(table, scene)).read(table, scene)


def axis_columns(
    table: ReadingTable, scene: Scene, names: Sequence[str], needed: Sequence[str] = ()
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Give positions of axes out of columns such as ``b_deg`` and ``x_mm``.

    Parameters
    ----------
    table : ReadingTable
    scene : Scene
    names : sequence of str
        Axes that may have a column; others stand where the scene has them.
    needed : sequence of str, optional
        Axes of which one at least must have a column.

    Returns
    -------
    coordinates : dict of str to ndarray, [n], mm or degrees
        All axes of the machine.
    notes : tuple of str
        Axes without a column, and where they are taken to stand.

    Raises
    ------
    SceneError
        If a column names an axis that the machine does not have, or all needed ones are missing.
    """
    axes = scene.machine.axes
    coordinates: dict[str, Array] = {}
    notes: list[str] = []
    for name in names:
        unit = "mm" if axes[name].is_linear else "deg"
        column = f"{name.lower()}_{unit}"
        if column in table.columns:
            coordinates[name] = table.columns[column]
    for column in table.columns:
        head, _, unit = column.rpartition("_")
        if unit == "deg" and head.upper() not in axes:
            known = ", ".join(name for name, axis in axes.items() if not axis.is_linear)
            found = f"has column {column}, but the machine has no axis {head.upper()}"
            raise SceneError(table.source, [f"{found}; expected {known or 'no rotary axis'}"])
    if needed and not any(name in coordinates for name in needed):
        spelled = ", ".join(f"{name.lower()}_deg" for name in needed)
        raise SceneError(table.source, [f"has no axis positions; expected a column of {spelled}"])
    rest = [name for name in names if name not in coordinates]
    if rest:
        stands = ", ".join(f"{name} {scene.workspace.positions[name]:g}" for name in rest)
        notes.append(f"{Path(table.source).name}: axes without a column stand at {stands}")
    for name in axes:
        if name not in coordinates:
            coordinates[name] = np.full(len(table), scene.workspace.positions[name])
    return coordinates, tuple(notes)


def uncertainties_mm(table: ReadingTable) -> Array | None:
    """Give standard uncertainties out of a column ``u_um`` or ``u_mm``, [n], mm; None without one.

    Raises
    ------
    SceneError
        If one is not above zero.
    """
    for name, factor in (("u_um", 1e-3), ("u_mm", 1.0)):
        if name in table.columns:
            values = table.columns[name] * factor
            for line, value in zip(table.lines, values, strict=True):
                if value <= 0.0:
                    found = f"line {line}, {name} = {value / factor:g}"
                    raise SceneError(table.source, [f"{found}; expected a number above 0"])
            return values
    return None


def sessions(table: ReadingTable) -> tuple[str, ...]:
    """Name the session of each row; one for all where the file does not tell."""
    return table.session or ("",) * len(table)


def check_poses(coordinates: Mapping[str, Array], source: str) -> None:
    """Refuse readings that were all taken at one pose.

    Raises
    ------
    SceneError
        If no axis moves.
    """
    if all(np.ptp(values) < 1e-9 for values in coordinates.values()):
        found = "has all readings at one pose: no error can be told from the place of the set-up"
        raise SceneError(source, [f"{found}; expected axes that move between readings"])


def check_spread(spread_mm: float, limit_mm: float, source: str, hint: str) -> None:
    """Refuse readings that lie further from the model than any machine: likely wrong units.

    Raises
    ------
    OptionError
        If they do.
    """
    if spread_mm > limit_mm:
        raise OptionError(
            f"{source}: the readings lie {spread_mm:.4g} mm from what the nominal machine gives;"
            f" expected less than {limit_mm:g} mm. {hint}"
        )
