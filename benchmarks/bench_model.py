"""Time of the model: a slider move and a new basis."""

from dataclasses import replace

import numpy as np
from table import Growth, Row, Section
from timing import best, in_turns

from warpspace import load_scene
from warpspace.analysis.statistics import volume_statistics
from warpspace.analysis.uncertainty.propagation import volume_uncertainty
from warpspace.field.evaluate import ErrorBasis, amplitudes_of
from warpspace.field.grid import build_grid
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import parameter
from warpspace.machine.errors import Constant, Covariance, ErrorSet
from warpspace.scene.library import parse_scene
from warpspace.scene.model import grid_basis
from warpspace.scene.starter import starter_text

NODES = 21
PARAMETERS = (5, 10, 20, 40)


COVARIANCE_SIZE = 60  # errors of a full covariance
AXES = "wC1B1FXYZUA2C2t"  # that a chain of eight axes has


def uncertainty_move() -> Row:
    """Measure U95 of a slider move: of mean, RMS, P95 and max, and at each node."""
    bare = parse_scene(starter_text(AXES, "eight axes"), "eight axes")
    rng, keys = np.random.default_rng(0), bare.parameter_keys[:COVARIANCE_SIZE]
    errors = ErrorSet({key: Constant(bare.axis_span(parameter(key).axis), 1.0) for key in keys})
    half = rng.standard_normal((COVARIANCE_SIZE, COVARIANCE_SIZE))
    rows = tuple(map(tuple, (half @ half.T).tolist()))
    scene = replace(bare, errors=errors, covariance=Covariance(keys, rows))
    grid = build_grid(scene.model, scene.workspace, NODES)
    basis, uncertainty = grid_basis(scene, grid), volume_uncertainty(scene, scene.view(), NODES)
    values = rng.standard_normal(len(basis.keys))
    moved = basis.evaluate(values).error_um

    def propagate() -> object:
        moved_uncertainty = replace(uncertainty, error_um=moved)
        return moved_uncertainty.statistics(), moved_uncertainty.u95_norm_um

    took, floor = in_turns(propagate, lambda: volume_statistics(basis.evaluate(values), grid), 50)
    label = f"U95 of a slider move, covariance of {COVARIANCE_SIZE} errors"
    return Row(label, took, "the move itself, with its statistics", floor, max_ratio=5.0)


def measure() -> Section:
    """Measure a slider move, and a basis for another place."""
    scene = load_scene("dvf5000_first")
    grid = build_grid(scene.model, scene.workspace, NODES)
    basis = grid_basis(scene, grid)
    amplitudes = amplitudes_of(scene.errors, basis.keys)
    all_amplitudes = np.arange(1.0, len(basis.keys) + 1.0)
    flat = np.random.default_rng(0).standard_normal((len(basis.keys), grid.nominal_mm.size))
    product = f"numpy's product, {flat.shape[0]} × {flat.shape[1]}"
    tilted = scene.workspace.moved({"B": -30.0, "C": 45.0})

    def new_basis(loop: Loop, nodes: int = NODES) -> object:
        return grid_basis(scene, build_grid(scene.model, tilted, nodes), scene.view(loop))

    rows = []
    for errors_text, values in (
        ("7 errors", amplitudes),
        (f"all {len(all_amplitudes)} errors", all_amplitudes),
    ):
        took, floor = in_turns(lambda: basis.evaluate(values), lambda: values @ flat, 50)  # noqa: B023
        rows.append(
            Row(
                f"slider move, position and tilt, {errors_text}",
                took,
                product,
                floor,
                max_value=5e-3,
            )
        )
    writing = "filling one array of its size"
    for loop in Loop:
        took, floor = in_turns(
            lambda: new_basis(loop),  # noqa: B023
            lambda: np.zeros(basis.position.shape) + 1.0,
        )
        rows.append(Row(f"basis for new B, C: {loop} loop", took, writing, floor, max_value=0.1))

    def part(count: int) -> ErrorBasis:
        selection = slice(count)
        return ErrorBasis(
            basis.keys[selection],
            basis.nominal_mm,
            basis.position[selection],
            basis.orientation[selection],
        )

    parts = {count: part(count) for count in PARAMETERS if count <= len(all_amplitudes)}
    growth = [
        Growth(
            f"slider move, {NODES}³ nodes",
            "errors",
            [*map(float, parts)],
            [best(lambda: small.evaluate(all_amplitudes[:n]), 50) for n, small in parts.items()],  # noqa: B023
        )
    ]
    rows.append(uncertainty_move())
    text = f"What the app works out, over {NODES}³ = {NODES**3} nodes."
    return Section("The model behind a slider", text, rows, growth)
