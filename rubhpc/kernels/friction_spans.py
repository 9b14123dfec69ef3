"""The span between two events under set-valued friction that is under way: what it is measured by."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_inline

Floats = NDArray[np.float64]

LONGEST = 128  # samples after which a span is ended without an event: forces are bounded by its beginning
# Columns of `Span.pair`. Of the force where a part begins: value, N, primitive, N s, steady part, N, growth,
# N/s, and by how much its means may exceed a parabola, N. Then the integral of the friction of a pair that
# sticks, and of the force of one that slides, N s.
VALUE, PRIMITIVE, STEADY, RAMP, EXCESS, RUBBED = range(6)


class Span(NamedTuple):
    """A span of m coordinates and q pairs, and work space of measuring it."""

    begun: Floats  # (2, m), coordinates at its begin
    given: Floats  # (q,), normal impulses of the event that ends it, N s
    pair: Floats  # (q, 6), of pairs
    path: Floats  # (4, 2, m), coordinates within it


def new_span(m: int, q: int) -> Span:
    """Room for a span of m coordinates and q pairs."""
    return Span(begun=np.zeros((2, m)), given=np.zeros(q), pair=np.zeros((q, 6)), path=np.zeros((4, 2, m)))


@jit_inline
def begin_span(span: Span, z: Floats) -> None:
    """Begin with the coordinates (2, m)."""
    copy_coordinates(z, span.begun)
    for i in range(span.given.size):
        span.given[i] = 0.0


@jit_inline
def copy_coordinates(z: Floats, target: Floats) -> None:
    """Copy coordinates (2, m)."""
    for part in range(2):
        for k in range(z.shape[1]):
            target[part, k] = z[part, k]
