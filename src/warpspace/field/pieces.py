"""A large batch in pieces that stay in the processor's cache."""

from collections.abc import Iterable, Iterator
from math import prod
from typing import Any, TypeAlias, TypeVar, cast

import numpy as np

from warpspace.units import Array

NODES = 32_768
"""Points that are evaluated at a time: a number of each of them takes 256 kB."""

Piece: TypeAlias = tuple[slice, ...]
"""One slice for each dimension of a batch."""
T = TypeVar("T")


def pieces(shape: tuple[int, ...]) -> Iterator[Piece]:
    """Cut a batch along its first dimensions into pieces of at most `NODES` points.

    Parameters
    ----------
    shape : tuple of int

    Yields
    ------
    tuple of slice
    """
    if not shape:
        yield ()
        return
    first, rest = shape[0], shape[1:]
    if prod(rest) > NODES:
        for index in range(first):
            for piece in pieces(rest):
                yield (slice(index, index + 1), *piece)
        return
    step = max(1, NODES // max(prod(rest), 1))
    for start in range(0, first, step):
        yield (slice(start, start + step), *(slice(None) for _ in rest))


def is_small(arrays: Iterable[Array]) -> bool:
    """Tell whether each of some arrays fits into a piece."""
    return all(array.size <= NODES for array in arrays)


def cut(array: Array, piece: Piece) -> Array:
    """Give the part of an array, [...] or broadcastable to it, that a piece needs."""
    own = piece[len(piece) - array.ndim :]
    return array[
        tuple(
            slice(None) if size == 1 else part for size, part in zip(array.shape, own, strict=True)
        )
    ]


def cut_all(values: T, piece: Piece) -> T:
    """Cut all arrays of nested tuples."""
    if isinstance(values, np.ndarray):
        return cast("T", cut(values, piece))
    if isinstance(values, tuple):
        parts = [cut_all(value, piece) for value in cast("tuple[object, ...]", values)]
        kind = cast("Any", type(values))
        return kind(*parts) if hasattr(kind, "_fields") else kind(parts)
    return values
