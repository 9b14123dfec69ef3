"""What steps of one length need of a closed contact with curved gaps, filled as the first one is taken."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked, linked_sum
from rubhpc.kernels.curved_contact import LAGRANGE, N_NODE, NODES, CurvedTables
from rubhpc.kernels.retuning_exponentials import exponential

Floats = NDArray[np.float64]

_INVERSE = np.array([1.0 / math.factorial(k) for k in range(40)])  # of the factorials
# |x|^2 up to which the last phi function is a series of so many terms, whose sum cancels less there.
_SERIES = ((1e-2, 10), (1.0, 16), (9.0, 26))
# For the nodes after the first: coefficients of the phi functions in the responses to the loads.
_WEIGHTS = np.ascontiguousarray(
    LAGRANGE * NODES[1:, np.newaxis, np.newaxis] ** np.arange(N_NODE) / _INVERSE[:N_NODE]
)


@linked
def phi_functions(x: complex) -> tuple[complex, complex, complex, complex, complex, complex]:
    """phi_0 to phi_5: `phi_k = (phi_(k-1) - 1 / (k - 1)!) / x`, phi_0 the exponential.

    Of small x the last one is a series, and `phi_(k-1) = x phi_k + 1 / (k - 1)!` gives those before.
    """
    size = x.real * x.real + x.imag * x.imag
    for limit, n_term in _SERIES:
        if size <= limit:
            fifth = complex(_INVERSE[N_NODE + n_term - 1], 0.0)
            for k in range(N_NODE + n_term - 2, N_NODE - 1, -1):
                fifth = x * fifth + _INVERSE[k]
            fourth = x * fifth + 1.0 / 24.0
            third = x * fourth + 1.0 / 6.0
            second = x * third + 0.5
            first = x * second + 1.0
            return x * first + 1.0, first, second, third, fourth, fifth
    whole, inverse = exponential(x, 1.0), complex(x.real / size, -x.imag / size)
    first = (whole - 1.0) * inverse
    second = (first - 1.0) * inverse
    third = (second - 0.5) * inverse
    fourth = (third - 1.0 / 6.0) * inverse
    return whole, first, second, third, fourth, (fourth - 1.0 / 24.0) * inverse


@linked_sum
def fill_level(tables: CurvedTables, mode: int, level: int, step: float) -> None:
    """Fill the tables of a mode for steps of 2^level ticks (s).

    The response of a coordinate with the exponent l to the load (s / h)^k is `h c^(k+1) k! phi_(k+1)(c l h)`
    at the time c h.
    """
    exponent_re, exponent_im = tables.exponent_re[mode], tables.exponent_im[mode]
    node_re, node_im = tables.node_re[mode, level], tables.node_im[mode, level]
    weight_re, weight_im = tables.weight_re[mode, level], tables.weight_im[mode, level]
    for node in range(N_NODE - 1):
        time = step * NODES[node + 1]
        for k in range(exponent_re.size):
            phi = phi_functions(complex(exponent_re[k] * time, exponent_im[k] * time))
            node_re[node, k], node_im[node, k] = phi[0].real, phi[0].imag
            for power in range(N_NODE):
                value = phi[1 + power]
                weight_re[node, power, k], weight_im[node, power, k] = value.real, value.imag
        _combine(_WEIGHTS[node], time, weight_re[node])
        _combine(_WEIGHTS[node], time, weight_im[node])
    if tables.lone.shape[4] > 0:
        _fill_lone(tables, mode, level)
    tables.is_filled[mode, level] = True


@linked_sum
def _combine(factor: Floats, time: float, values: Floats) -> None:
    """Replace values (5, m) by their combinations `time factor values`."""
    for k in range(values.shape[1]):
        a, b, c, d, e = values[0, k], values[1, k], values[2, k], values[3, k], values[4, k]
        for i in range(N_NODE):
            row = factor[i]
            values[i, k] = time * (row[0] * a + row[1] * b + row[2] * c + row[3] * d + row[4] * e)


@linked_sum
def _fill_lone(tables: CurvedTables, mode: int, level: int) -> None:
    """Fill what the readings of a single pair at the nodes have of the coordinates and of the loads."""
    n_read, n_load = tables.read_re.shape[2], tables.load_re.shape[2]
    read_re, read_im = tables.read_re[mode, 0], tables.read_im[mode, 0]
    lone, reach, reached = tables.lone[mode, level], tables.reach[mode, level], tables.reached[mode, level]
    for node in range(N_NODE - 1):
        re, im = tables.node_re[mode, level, node], tables.node_im[mode, level, node]
        first = node * n_read
        for k in range(re.size):
            for r in range(n_read):
                lone[0, k, first + r] = re[k] * read_re[r, k] - im[k] * read_im[r, k]
                lone[1, k, first + r] = -re[k] * read_im[r, k] - im[k] * read_re[r, k]
        for a in range(N_NODE):
            w_re, w_im = tables.weight_re[mode, level, node, a], tables.weight_im[mode, level, node, a]
            for j in range(n_load):
                row = a * n_load + j
                for r in range(n_read):
                    seen_re, seen_im = tables.seen_re[mode, j, r], tables.seen_im[mode, j, r]
                    total = 0.0
                    for k in range(re.size):
                        total += w_re[k] * seen_re[k] - w_im[k] * seen_im[k]
                    reach[row, first + r] = total
                    if a > 0:
                        reached[first + r, row - n_load] = total
