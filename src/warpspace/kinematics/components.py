"""Vectors and matrices as tuples of their components, each an array over as few axes as it needs.

Over a grid a component that varies along one axis is held once for all nodes along the others, and
one that never varies is a plain float: zeros and ones then cost nothing. Batches of any shape that
broadcasts go together, and no array ends with a short dimension, which numpy is slow at.
"""

from collections.abc import Iterable
from typing import TypeAlias, TypeVar

from warpspace.units import Array

T = TypeVar("T")
Number: TypeAlias = Array | float  # one component, [...]; a float where it is the same everywhere.
Triple: TypeAlias = tuple[Number, Number, Number]  # components of a vector along x, y and z
Rows: TypeAlias = tuple[Triple, Triple, Triple]  # rows of a matrix of three by three

ZERO: Triple = (0.0, 0.0, 0.0)
ZERO_ROWS: Rows = (ZERO, ZERO, ZERO)


def triple(values: Iterable[T]) -> tuple[T, T, T]:
    x, y, z = values
    return x, y, z


def split(vectors: Array) -> Triple:
    """Split vectors, [..., 3], into components; one that never varies becomes a float."""
    return triple(_plain(vectors[..., index]) for index in range(3))


def split_rows(matrices: Array) -> Rows:
    """Split matrices, [..., 3, 3], into components; one that never varies becomes a float."""
    return triple(split(matrices[..., index, :]) for index in range(3))


def join(components: Iterable[Number], out: Array) -> None:
    """Write components into vectors, [..., 3]."""
    for index, values in enumerate(components):
        out[..., index] = values


def plus(one: Number, other: Number) -> Number:
    if isinstance(one, float) and one == 0.0:
        return other
    if isinstance(other, float) and other == 0.0:
        return one
    return one + other


def times(one: Number, other: Number) -> Number:
    for first, second in ((one, other), (other, one)):
        if isinstance(first, float) and first in (0.0, 1.0):
            return second if first else 0.0
    return one * other


def dot(one: Triple, other: Triple) -> Number:
    x, y, z = map(times, one, other)
    return plus(plus(x, y), z)


def add(one: Triple, other: Triple) -> Triple:
    return triple(map(plus, one, other))


def subtract(one: Triple, other: Triple) -> Triple:
    return add(one, scale(-1.0, other))


def scale(factor: Number, vector: Triple) -> Triple:
    return triple(times(factor, value) for value in vector)


def cross(one: Triple, other: Triple) -> Triple:
    (a, b, c), (x, y, z) = one, scale(-1.0, other)
    u, v, w = other
    return (
        plus(times(b, w), times(c, y)),
        plus(times(c, u), times(a, z)),
        plus(times(a, v), times(b, x)),
    )


def rotate(rows: Rows, vector: Triple) -> Triple:
    return triple(dot(row, vector) for row in rows)


def move(transform: Array, point: Triple) -> Triple:
    """Take a point from child to parent coordinates by a transformation, [..., 4, 4]."""
    turned = rotate(split_rows(transform[..., :3, :3]), point)
    return add(turned, split(transform[..., :3, 3]))


def multiply(one: Rows, other: Rows) -> Rows:
    columns = transpose(other)
    return triple(triple(dot(row, column) for column in columns) for row in one)


def add_rows(one: Rows, other: Rows) -> Rows:
    return triple(map(add, one, other))


def subtract_rows(one: Rows, other: Rows) -> Rows:
    return triple(map(subtract, one, other))


def transpose(rows: Rows) -> Rows:
    (a, b, c), (d, e, f), (g, h, i) = rows
    return (a, d, g), (b, e, h), (c, f, i)


def _plain(values: Array) -> Number:
    if not values.size:
        return values
    first = values.flat[0]
    return float(first) if (values == first).all() else values
