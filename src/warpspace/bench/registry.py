"""The tests there are: one entry here, one file each; plug-ins add theirs."""

from importlib import import_module

from warpspace.bench.base import BenchTest
from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.plugins import load_plugins

_HERE = "warpspace.bench.kinds"
_TESTS: dict[str, type[BenchTest] | str] = {
    "positioning": f"{_HERE}.positioning:Positioning",
    "circular": f"{_HERE}.circular:Circular",
    "diagonals": f"{_HERE}.diagonals:Diagonals",
    "straightness": f"{_HERE}.straightness:Straightness",
    "squareness": f"{_HERE}.squareness:Squareness",
    "rotary-axis": f"{_HERE}.rotary_axis:RotaryAxis",
    "sphere": f"{_HERE}.sphere:Sphere",
    "ball-plate": f"{_HERE}.ball_plate:BallPlate",
    "cone-frustum": f"{_HERE}.cone_frustum:ConeFrustum",
}


def register_test(test: type[BenchTest]) -> None:
    """Add a kind of test; it then appears on the command line and in the app.

    Raises
    ------
    OptionError
        If there is one of its name.
    """
    if test.name in _TESTS:
        raise OptionError(f"a test {test.name!r} is there already")
    _TESTS[test.name] = test


def unregister_test(name: str) -> None:
    """Take a kind of test away again."""
    del _TESTS[name]


def bench_names() -> tuple[str, ...]:
    """List the names of all tests."""
    load_plugins()
    return tuple(_TESTS)


def find_test(name: str) -> type[BenchTest]:
    """Look up a kind of test.

    Raises
    ------
    UnknownNameError
        If there is none of the name.
    """
    load_plugins()
    if name not in _TESTS:
        raise UnknownNameError("test", name, _TESTS)
    found = _TESTS[name]
    if isinstance(found, str):
        module, _, kind = found.partition(":")
        loaded: type[BenchTest] = getattr(import_module(module), kind)
        _TESTS[name] = found = loaded
    return found
