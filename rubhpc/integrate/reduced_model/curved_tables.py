"""Further tables of a contact mode for curved gaps, read by `kernels.curved_contact`."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels.curved_contact import N_NODE, CurvedTables
from rubhpc.kernels.curved_tuning import tune_curved

if TYPE_CHECKING:
    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.integrate.reduced_model.reduction import ReducedModel

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

LONGEST_STEP = 1e-3  # s, of closed contacts
UNDAMPED = 1e-14  # eigenvalue of the damping over the largest; smaller ones count as zero


def tabulate_curved(
    mode: ContactMode,
    reduced: ReducedModel,
    row: Floats,
    directions: tuple[Floats, Floats],
    *,
    width: int,
    tick: float,
    n_level: int,
) -> CurvedTables:
    """Tables of one mode, (1, ...) each, its coordinates padded to `width`.

    Parameters
    ----------
    row : (q, 3 + b, n)
        `curved_bodies.motion_rows`.
    directions : (q, n), (q, n)
        Gap Jacobian Q and contact-force directions P with the fixed normal. `E = P (Q P)^-1` changes the gaps
        of the closed pairs; its projection is zero, as that of contact forces.
    n_level : int
        As in `mode_library.ModeLibrary`.
    """
    n, end = reduced.stiffness.shape[0], mode.exponent.size
    exponent, enter = np.zeros(width, dtype=complex), np.zeros((width, 2 * n), dtype=complex)
    exponent[:end], enter[: len(mode.enter)] = mode.exponent, mode.enter
    motion = np.zeros((2 * n, width)), np.zeros((2 * n, width))
    motion[0][:, :end], motion[1][:, :end] = mode.motion.real, mode.motion.imag
    still, n_step = still_parts(mode, reduced, row, directions), n_tabulated(tick, n_level)
    tables = empty_tables(still, width, n_step)
    push(tables, 0, still, reduced, enter)
    tune(tables, 0, still, reduced, exponent, motion, tick * 2.0 ** (n_step - 1))
    return tables


def empty_tables(still: StillParts, width: int, n_step: int) -> CurvedTables:
    """Tables of a mode, (1, ...) each, for steps of `n_step` lengths, without what belongs to matrices."""
    q, d = len(still.row), still.row.shape[1] - 1
    n_loss, n_at = still.size.size, N_NODE - 1
    n_read, n_load = 3 * d + 1, d + 2
    n_seen = n_read if q == 1 else 0
    drain_moved = np.zeros((1, n_loss + 2, q))
    drain_moved[0, :n_loss] = (still.shift @ still.dampers).T
    return CurvedTables(
        used=np.full(1, width),
        read_re=np.zeros((1, q, n_read, width)),
        read_im=np.zeros((1, q, n_read, width)),
        bound=np.zeros((1, q, d, width)),
        shift=still.shift[np.newaxis],
        moved=still.moved[np.newaxis],
        accel=np.zeros((1, q, d, q)),
        accel_rate=np.zeros((1, q, d, q)),
        load_re=np.zeros((1, q, n_load, width)),
        load_im=np.zeros((1, q, n_load, width)),
        exponent_re=np.zeros((1, width)),
        exponent_im=np.zeros((1, width)),
        is_filled=np.zeros((1, n_step), dtype=np.bool_),
        node_re=np.zeros((1, n_step, n_at, width)),
        node_im=np.zeros((1, n_step, n_at, width)),
        weight_re=np.zeros((1, n_step, n_at, N_NODE, width)),
        weight_im=np.zeros((1, n_step, n_at, N_NODE, width)),
        seen_re=np.zeros((1, n_load, n_seen, width)),
        seen_im=np.zeros((1, n_load, n_seen, width)),
        lone=np.zeros((1, n_step, 2, width, n_at * n_seen)),
        reach=np.zeros((1, n_step, N_NODE * n_load, n_at * n_seen)),
        reached=np.zeros((1, n_step, n_at * n_seen, n_at * n_load)),
        inverse_re=np.zeros((1, width)),
        inverse_im=np.zeros((1, width)),
        drain=np.zeros((1, 2, width, n_loss + 2)),
        sign=np.sign(still.size)[np.newaxis],
        drain_moved=drain_moved,
    )


def n_tabulated(tick: float, n_level: int) -> int:
    """Number of tabulated steps, of 1, 2, 4... ticks (s), among those of a library."""
    return min(n_level, max(1, int(np.log2(LONGEST_STEP / tick))))


class StillParts(NamedTuple):
    """Parts of a mode's tables that do not depend on the spin speed."""

    row: Floats  # (q, 3 + b, n), `curved_bodies.motion_rows`
    first: int  # coordinate of the response to the unbalance
    closed: list[int]
    shift: Floats  # (q, n), as in `CurvedTables`
    moved: Floats
    passed: Floats  # (n, n), what the closed pairs leave of a force
    size: Floats  # (r,), eigenvalues of the damping
    dampers: Floats  # (n, r), their shapes, times the roots of their sizes


def still_parts(
    mode: ContactMode, reduced: ReducedModel, row: Floats, directions: tuple[Floats, Floats]
) -> StillParts:
    """Parts of the tables of a mode that do not depend on the speed; arguments as of `tabulate_curved`.

    Energies, for which the damping is taken apart, are not requested where it depends on the speed.
    """
    n, q = reduced.stiffness.shape[0], len(row)
    closed = [i for i in range(q) if mode.mask >> i & 1]
    rate, along = directions[0][closed], directions[1][closed].T
    shift = np.zeros((q, n))
    if closed:
        shift[closed] = np.linalg.solve((rate @ along).T, along.T)
    size, shape = _losses(reduced)
    return StillParts(
        row=row,
        first=mode.n_eigenmode,
        closed=closed,
        shift=shift,
        moved=row @ shift.T,
        passed=np.eye(n) - shift[closed].T @ rate,
        size=size,
        dampers=np.sqrt(np.abs(size)) * shape,
    )


def push(
    tables: CurvedTables, place: int, still: StillParts, reduced: ReducedModel, enter: Complexes
) -> None:
    """Fill what belongs to the matrices, but not to the speed; `enter` (m, 2 n) are the coordinates."""
    row, n = still.row, reduced.stiffness.shape[0]
    flat = row[:, :-1]
    elastic, damped = reduced.stiffness @ still.shift.T, reduced.damping @ still.shift.T
    tables.accel[place], tables.accel_rate[place] = flat @ elastic, flat @ damped
    for i in still.closed:
        columns = still.passed @ np.column_stack([elastic[:, i], damped[:, i], *flat[i]])
        load = (enter[: still.first, n:] @ columns).T
        tables.load_re[place, i, :, : still.first] = load.real
        tables.load_im[place, i, :, : still.first] = load.imag


def tune(
    tables: CurvedTables,
    place: int,
    still: StillParts,
    reduced: ReducedModel,
    exponent: Complexes,
    motion: tuple[Floats, Floats],
    longest: float,
) -> None:
    """Fill what belongs to the speed and the unbalance force of `reduced`.

    Parameters
    ----------
    exponent, motion : (m,), two of (2 n, m)
        Of the coordinates, including that of the response; the motion by its real and its imaginary part.
    longest : float
        The longest step, s.
    """
    tune_curved(
        tables,
        place,
        still.first,
        not still.closed,
        longest,
        exponent,
        *motion,
        still.row,
        still.dampers,
        reduced.stiffness,
        reduced.damping,
        reduced.force,
        np.empty((2, len(reduced.stiffness))),
    )


def _losses(reduced: ReducedModel) -> tuple[Floats, Floats]:
    """Nonzero eigenvalues (r,) of the symmetric damping, and their shapes (n, r)."""
    size, shape = np.linalg.eigh(0.5 * (reduced.damping + reduced.damping.T))
    keep = np.abs(size) > UNDAMPED * np.abs(size).max()
    return size[keep], shape[:, keep]
