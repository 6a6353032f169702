"""Vectors and matrices as tuples of their components, each an array over as few axes as it needs.

Over a grid a component that varies along one axis is an array over that axis only, and a constant
one is a float, so that zeros and ones cost nothing. Batches of any broadcastable shape are allowed,
and no array ends with a short dimension, which is slow in numpy.
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
    """Split vectors, [..., 3], into components; a constant one becomes a float."""
    return triple(simplify(vectors[..., index]) for index in range(3))


def split_rows(matrices: Array) -> Rows:
    """Split matrices, [..., 3, 3], into components; a constant one becomes a float."""
    return triple(split(matrices[..., index, :]) for index in range(3))


def join(components: Iterable[Number], out: Array) -> None:
    """Write components into vectors, [..., 3]."""
    for index, values in enumerate(components):
        out[..., index] = values


def plus(a: Number, b: Number) -> Number:
    if isinstance(a, float) and a == 0.0:
        return b
    if isinstance(b, float) and b == 0.0:
        return a
    return a + b


def times(a: Number, b: Number) -> Number:
    for first, second in ((a, b), (b, a)):
        if isinstance(first, float) and first in (0.0, 1.0):
            return second if first else 0.0
    return a * b


def dot(a: Triple, b: Triple) -> Number:
    x, y, z = map(times, a, b)
    return plus(plus(x, y), z)


def add(a: Triple, b: Triple) -> Triple:
    return triple(map(plus, a, b))


def subtract(a: Triple, b: Triple) -> Triple:
    return add(a, scale(-1.0, b))


def scale(factor: Number, vector: Triple) -> Triple:
    return triple(times(factor, value) for value in vector)


def cross(first: Triple, second: Triple) -> Triple:
    (a, b, c), (x, y, z) = first, scale(-1.0, second)
    u, v, w = second
    return (
        plus(times(b, w), times(c, y)),
        plus(times(c, u), times(a, z)),
        plus(times(a, v), times(b, x)),
    )


def rotate(rows: Rows, vector: Triple) -> Triple:
    return triple(dot(row, vector) for row in rows)


def move(transform: Array, point: Triple) -> Triple:
    """Transform a point from child to parent coordinates, [..., 4, 4]."""
    turned = rotate(split_rows(transform[..., :3, :3]), point)
    return add(turned, split(transform[..., :3, 3]))


def multiply(a: Rows, b: Rows) -> Rows:
    columns = transpose(b)
    return triple(triple(dot(row, column) for column in columns) for row in a)


def transpose(rows: Rows) -> Rows:
    (a, b, c), (d, e, f), (g, h, i) = rows
    return (a, d, g), (b, e, h), (c, f, i)


def simplify(values: Array) -> Number:
    """Return a component, a constant one as a float."""
    if not values.size:
        return values
    first = values.flat[0]  # most arrays differ at their ends
    return float(first) if first == values.flat[-1] and (values == first).all() else values
