"""A field over many nodes, beside copying its errors once."""

import tracemalloc
from dataclasses import replace

import numpy as np
from table import Growth, Row, Section
from timing import best

from warpspace import evaluate, load_scene
from warpspace.field.grid import build_grid
from warpspace.machine.axes import parameter
from warpspace.machine.errors import Constant, ErrorSet, TableCurve
from warpspace.scene.model import Scene

NODES = 101
GROWING = (11, 21, 41, 61, 81, 101)
PARAMETERS = (5, 10, 20, 40, 60)
CURVE = ((-500.0, 1.0), (-100.0, 6.0), (0.0, -4.0), (500.0, 3.0))


def with_errors(scene: Scene, count: int) -> Scene:
    """Set a curve for every parameter: the worst case of a field."""
    keys = [key for key in scene.machine.allowed_keys if parameter(key).axis in scene.machine.axes]
    spread = [keys[index] for index in np.linspace(0, len(keys) - 1, count).round().astype(int)]
    functions = {
        key: Constant((-500.0, 500.0), 7.0)
        if parameter(key).is_constant
        else TableCurve((-500.0, 500.0), CURVE)
        for key in spread
    }
    return replace(scene, errors=ErrorSet(functions))


def peak_bytes(run) -> int:
    """Most memory that arrays take during a run, bytes."""
    tracemalloc.start()
    try:
        run()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def measure() -> Section:
    """Measure a million nodes, and what fewer nodes or errors take."""
    plain = load_scene("dvf5000_first")
    count = len(plain.machine.allowed_keys)
    full = with_errors(plain, count)
    result = np.ones((NODES, NODES, NODES, 3))
    target = np.empty_like(result)

    def copy() -> None:
        np.copyto(target, result)

    rows = []
    floor = "copying the errors once"
    for errors_text, scene in (("7 curves", plain), (f"all {count} errors, curves", full)):
        for model, exact, limit in (("first order", False, 120.0), ("exact", True, 400.0)):
            took = best(lambda: evaluate(scene, grid=NODES, exact=exact))  # noqa: B023
            copied = best(copy, 20)
            label = f"{NODES}³ nodes, {model}, {errors_text}"
            rows.append(Row(label, took, floor, copied, max_ratio=limit))
    for model, exact in (("first order", False), ("exact", True)):
        peak = peak_bytes(lambda: evaluate(full, grid=NODES, exact=exact))  # noqa: B023
        label = f"memory of {NODES}³ nodes, {model}"
        rows.append(Row(label, peak / 1e6, "the errors", result.nbytes / 1e6, "MB", max_ratio=4.0))
    took = best(lambda: build_grid(plain.model, plain.workspace, NODES))
    rows.append(Row(f"the grid of {NODES}³ nodes alone", took, floor, best(copy, 20)))
    nodes = [float(n**3) for n in GROWING]
    growth = [
        Growth(
            f"field, {model}, all errors",
            "nodes",
            nodes,
            [best(lambda: evaluate(full, grid=n, exact=exact), 3) for n in GROWING],  # noqa: B023
        )
        for model, exact in (("first order", False), ("exact", True))
    ]
    several = [with_errors(plain, n) for n in PARAMETERS if n <= count]
    growth += [
        Growth(
            f"field of 61³ nodes, {model}",
            "errors",
            [float(len(scene.errors.functions)) for scene in several],
            [best(lambda: evaluate(scene, grid=61, exact=exact), 3) for scene in several],  # noqa: B023
        )
        for model, exact in (("first order", False), ("exact", True))
    ]
    text = (
        "The field of a five-axis machine over its working volume, grid included: position and"
        " orientation error of every node. Errors of one axis are evaluated along that axis,"
        " sums and products in pieces that stay in the cache."
    )
    return Section("A field of a million nodes", text, rows, growth)
