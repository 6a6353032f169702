"""The kinds of measurement there are. A new one is a module beside this and a line below."""

from collections.abc import Mapping
from functools import lru_cache

from warpspace.calibration.kinds.bench import TestReadings, test_kinds
from warpspace.calibration.kinds.kind import Kind
from warpspace.calibration.kinds.lengths import Lengths
from warpspace.calibration.kinds.points import Points, Tracker
from warpspace.calibration.kinds.spheres import Sphere, SphereTcp
from warpspace.calibration.readings import ReadingTable
from warpspace.exceptions import SceneError, UnknownNameError
from warpspace.scene.model import Scene

KINDS: Mapping[str, Kind] = {
    kind.name: kind for kind in (Points(), Tracker(), Sphere(), SphereTcp(), Lengths())
}
"""By name."""


def find_kind(name: str) -> Kind:
    """Look up a kind: one of this table, or a test with its options (``circular:plane=XZ``)."""
    if name in KINDS:
        return KINDS[name]
    tests = test_kinds()
    if name.partition(":")[0] not in tests:
        raise UnknownNameError("kind of measurement", name, (*KINDS, *tests))
    return _test_kind(name)


@lru_cache(maxsize=256)
def _test_kind(text: str) -> Kind:
    return TestReadings(text)


def recognise(table: ReadingTable, scene: Scene) -> Kind:
    """Tell the kind of a file by its columns."""
    found = next((kind for kind in KINDS.values() if kind.fits(table, scene)), None)
    if found is None:
        there = ", ".join((*table.labels, *table.columns))
        kinds = "; ".join(f"{kind.name}: {kind.columns}" for kind in KINDS.values())
        raise SceneError(table.source, [f"has columns {there}; expected those of a kind: {kinds}"])
    return found
