"""Spans between two events under set-valued friction, kept to be measured together.

What a span is measured by are the tables of its contact mode, larger than those that a case needs to go on.
Spans are therefore kept until some are there, and measured mode by mode.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked
from rubhpc.kernels._struct import Struct
from rubhpc.kernels.contact_modes import SAMPLES_AT_ONCE

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_SPANS = 128
MOST_PARTS = 1024  # of the spans, which samples part
LONGEST = 128  # samples after which a span is ended without an event
ROWS_AT_ONCE = 4  # of outputs
AT_ONCE = 12  # spans for which a form is read once, a multiple of four
BEFORE, AFTER, IMPULSE, MOST = range(4)  # columns of `Spans.force`
# Columns of `Spans.pair`. Of the force where a part begins: value, N, primitive, N s, steady part, N, growth,
# N/s, and by how much its means may exceed a parabola, N. Then the integral of the friction of a pair that
# sticks, and of the force of one that slides, N s.
VALUE, PRIMITIVE, STEADY, RAMP, EXCESS, RUBBED = range(6)


class Spans(Struct):
    """Spans that are not measured yet, m coordinates, q pairs, and work space of measuring them."""

    noted: Ints  # (2,), of spans and at most of parts; the one that has begun, if any, is the next
    mode: Ints  # (n_span,), as its index in the tables
    tick: Ints  # (n_span, 2), begin and end
    first: Ints  # (n_span + 1,), part with which each begins
    begun: Floats  # (n_span + 1, 2, m), coordinates at its begin
    ended: Floats  # (n_span, 2, m), at its end
    given: Floats  # (n_span, q), normal impulses of the events that end them, N s
    force: Floats  # (n_part, q, 4), of the parts: force at both ends, N, impulse, N s, bound on the force, N
    value: Floats  # ((n_part + SAMPLES_AT_ONCE) o,), outputs sample by sample
    pair: Floats  # (n_span, q, 6), of pairs
    path: Floats  # (4, 2, m), coordinates within a span
    alike: Ints  # (n_span,), spans in one contact mode
    sample: Ints  # (SAMPLES_AT_ONCE,), samples that are not read yet
    point: Floats  # (SAMPLES_AT_ONCE, 2, m), coordinates there
    read: Floats  # (SAMPLES_AT_ONCE whole_rows(o),), their outputs
    gained: Floats  # (product_forms.AT_ONCE,), by forms in some spans


def no_spans() -> Spans:
    """Room for none."""
    return _with_room(0, 0, 0, 0, 0)


def new_spans(m: int, q: int, n_row: int) -> Spans:
    """Room for spans of m coordinates and q pairs, and for samples with `n_row` outputs."""
    return _with_room(MOST_SPANS, MOST_PARTS, m, q, n_row)


def _with_room(n_span: int, n_part: int, m: int, q: int, n_row: int) -> Spans:
    return Spans(
        noted=np.zeros(2, dtype=np.int64),
        mode=np.zeros(n_span, dtype=np.int64),
        tick=np.zeros((n_span, 2), dtype=np.int64),
        first=np.zeros(n_span + 1, dtype=np.int64),
        begun=np.zeros((n_span + 1, 2, m)),
        ended=np.zeros((n_span, 2, m)),
        given=np.zeros((n_span, q)),
        force=np.zeros((n_part, q, 4)),
        value=np.zeros((n_part + SAMPLES_AT_ONCE) * n_row),
        pair=np.zeros((n_span, q, 6)),
        path=np.zeros((4, 2, m)),
        alike=np.zeros(n_span, dtype=np.int64),
        sample=np.zeros(SAMPLES_AT_ONCE, dtype=np.int64),
        point=np.zeros((SAMPLES_AT_ONCE, 2, m)),
        read=np.zeros(SAMPLES_AT_ONCE * whole_rows(n_row)),
        gained=np.zeros(AT_ONCE),
    )


def whole_rows(n_row: int) -> int:
    """How many output rows are read: a multiple of four."""
    return -(-n_row // ROWS_AT_ONCE) * ROWS_AT_ONCE


@linked
def begin_span(spans: Spans, z: Floats) -> None:
    """Note the coordinates (2, m) with which a span begins."""
    copy_coordinates(z, spans.begun[spans.noted[0]])


@linked
def has_room(spans: Spans, n_part: int) -> bool:
    """Whether there is room for the span that has begun, and as many parts of it."""
    return bool(spans.noted[0] < spans.mode.size and spans.noted[1] + n_part <= spans.force.shape[0])


@linked
def note_span(spans: Spans, mode: int, begin: int, end: int, n_part: int, z: Floats) -> None:
    """Keep the span that has begun, from one tick to another one, where it has the coordinates (2, m)."""
    k = spans.noted[0]
    spans.mode[k], spans.tick[k, 0], spans.tick[k, 1] = mode, begin, end
    copy_coordinates(z, spans.ended[k])
    for i in range(spans.given.shape[1]):
        spans.given[k, i] = 0.0
    spans.noted[0], spans.noted[1] = k + 1, spans.noted[1] + n_part


@linked
def note_impulse(spans: Spans, i: int, impulse: float) -> None:
    """Keep what pair i got by the event that has ended the last span, N s."""
    spans.given[spans.noted[0] - 1, i] = impulse


@linked
def forget_spans(spans: Spans) -> None:
    """Make room: all but the one that may have begun are measured."""
    copy_coordinates(spans.begun[spans.noted[0]], spans.begun[0])
    spans.noted[0] = spans.noted[1] = 0


@linked
def copy_coordinates(z: Floats, target: Floats) -> None:
    """Copy coordinates (2, m)."""
    for part in range(2):
        for k in range(z.shape[1]):
            target[part, k] = z[part, k]
