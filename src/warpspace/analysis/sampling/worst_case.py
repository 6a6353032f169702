"""Worst case of tolerances: the largest |E| that any machine within them can have."""

from itertools import product

import numpy as np

from warpspace.units import Array

TILT = 1e-9  # generators are moved by this share, so that no three of them share a plane


def worst_case_um(gains: Array, centre: Array, half_width: Array) -> float:
    """Return the largest |E| at some points, over all errors within tolerance, µm.

    Parameters
    ----------
    gains
        Response of each error at each point, [3, K, N], µm per µm or µrad.
    centre, half_width
        Tolerances, [K], µm or µrad.

    Notes
    -----
    At one point the errors E = G (centre + s · half_width), |s| ≤ 1, fill a zonotope, and |E| is
    largest at one of its vertices. Each vertex is the farthest point of some direction normal to
    two generators, where the signs of all others follow from the direction and these two have
    either sign. Points whose bound by components is below the best so far are left out.
    """
    middle = np.einsum("ckn,k->cn", gains, centre)
    spans = gains * half_width[None, :, None]
    bound = np.linalg.norm(np.abs(middle) + np.abs(spans).sum(1), axis=0)
    largest = 0.0
    for point in np.argsort(-bound):
        if bound[point] <= largest:
            break
        largest = max(largest, _farthest(spans[:, :, point], middle[:, point]))
    return largest


def _farthest(spans: Array, middle: Array) -> float:
    """Return the largest |middle + spans s| over |s| ≤ 1, of the columns of spans, [3, K]."""
    spans = spans[:, np.abs(spans).max(axis=0) > 0.0]
    count = spans.shape[1]
    if count < 3:
        corners = np.array(list(product((-1.0, 1.0), repeat=count)))
        return float(np.linalg.norm(middle + corners @ spans.T, axis=1).max())
    noise = np.random.default_rng(0).standard_normal(spans.shape)
    tilted = spans + TILT * np.abs(spans).max() * noise
    first, second = np.triu_indices(count, 1)
    normals = np.cross(tilted.T[first], tilted.T[second])
    signs = np.sign(normals @ tilted)  # [P, K]
    rows = np.arange(len(first))
    signs[rows, first] = signs[rows, second] = 0.0
    base = signs @ spans.T
    edges = spans.T[first], spans.T[second]
    combined = (base + a * edges[0] + b * edges[1] for a in (-1.0, 1.0) for b in (-1.0, 1.0))
    errors = np.concatenate([side * error for error in combined for side in (-1.0, 1.0)])
    return float(np.linalg.norm(middle + errors, axis=1).max())
