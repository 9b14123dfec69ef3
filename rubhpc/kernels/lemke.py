"""Linear complementarity without a P-matrix, by Lemke's method, for set-valued friction.

Find `z >= 0` with `w = A z + b >= 0` such that one of the two is zero in every row. Pivots act on a tableau
`w - A z - z0 = b` whose artificial column z0 makes every row feasible at first; the method ends when z0
leaves the basis (Cottle, Pang, Stone, The Linear Complementarity Problem, SIAM 2009, Algorithm 4.4.5).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit, linked
from rubhpc.kernels.complementarity import UNSOLVED

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

PIVOT = 1e-13  # entries of the tableau are of order one; smaller ones count as zero
TIE = 1e-12
PIVOTS_A_ROW = 20


@linked
def exchange(tableau: Floats, basis: Ints, n: int, row: int, column: int) -> int:
    """Exchange the variable of `column` into the basis at `row`, of n rows; returns the one that leaves."""
    width = 2 * n + 2
    pivot = tableau[row, column]
    for k in range(width):
        tableau[row, k] /= pivot
    for i in range(n):
        factor = tableau[i, column]
        if i != row and factor != 0.0:
            for k in range(width):
                tableau[i, k] -= factor * tableau[row, k]
    leaving = basis[row]
    basis[row] = column
    return int(leaving)


@jit
def solve_lemke(tableau: Floats, basis: Ints, n: int) -> int:
    """Solve a problem of n rows; returns the number of pivots, or UNSOLVED.

    Parameters
    ----------
    tableau : (n or more, 2 n + 2 or more)
        Columns of w (the identity), of z (-A), of z0 (-1), and b. On return the last column holds the values
        of the basic variables.
    basis : (n or more,)
        Filled with the basic variable of each row: k for w_k, n + k for z_k. All others are zero.
    """
    if n == 0:
        return 0
    z0, last = 2 * n, 2 * n + 1
    row = 0
    for i in range(n):
        basis[i] = i
        if tableau[i, last] < tableau[row, last]:
            row = i
    if not tableau[row, last] < 0.0:
        return 0
    leaving = exchange(tableau, basis, n, row, z0)
    for n_pivot in range(1, PIVOTS_A_ROW * n):
        entering = leaving + n if leaving < n else leaving - n
        row, finish = -1, -1
        least = np.inf
        for i in range(n):
            if tableau[i, entering] > PIVOT:
                ratio = tableau[i, last] / tableau[i, entering]
                if ratio < least:
                    row, least = i, ratio
                if basis[i] == z0:
                    finish = i
        if row < 0:
            return UNSOLVED
        # Among rows that are equal up to rounding z0 leaves: the problem is then solved.
        if finish >= 0 and tableau[finish, last] <= least * (1.0 + TIE) * tableau[finish, entering]:
            row = finish
        leaving = exchange(tableau, basis, n, row, entering)
        if leaving == z0:
            return n_pivot
    return UNSOLVED
