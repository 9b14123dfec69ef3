"""Further tables of a contact mode for curved gaps, read by `kernels.curved_contact`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels.curved_contact import (
    LAGRANGE,
    N_NODE,
    NODES,
    CurvedTables,
)

if TYPE_CHECKING:
    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.integrate.reduced_model.reduction import ReducedModel

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

LONGEST_STEP = 1e-3  # s, of closed contacts
# |x| below which the phi functions are series, which cancel less there, and number of terms.
SERIES = ((0.1, 10), (3.0, 26))
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
    exponent = np.zeros(width, dtype=complex)
    exponent[:end] = mode.exponent
    motion = np.zeros((2 * n, width), dtype=complex)
    motion[:, :end] = mode.motion
    still = still_parts(mode, reduced, row, directions, width)
    table = tuned_tables(still, reduced, exponent, motion, steps_of(tick, n_level))
    fields: list[Any] = [np.array(field[None], order="C") for field in table]
    return CurvedTables(*fields)


def steps_of(tick: float, n_level: int) -> Floats:
    """Lengths of the tabulated steps, among those of a library, s."""
    return np.ldexp(tick, np.arange(min(n_level, max(1, int(np.log2(LONGEST_STEP / tick))))))


class StillParts(NamedTuple):
    """Parts of a mode's tables that do not depend on the spin speed, without terms of the unbalance."""

    row: Floats  # (q, 3 + b, n), `curved_bodies.motion_rows`
    first: int  # coordinate of the response to the unbalance
    is_lone: bool  # whether there is a single pair, and it is closed
    shift: Floats  # (q, n), these as in `CurvedTables`
    moved: Floats
    accel: Floats
    accel_rate: Floats
    load: Complexes  # (q, 4 + b, m)
    size: Floats  # (r,), eigenvalues of the damping
    dampers: Floats  # (r, n), their shapes, times the roots of their sizes


def still_parts(
    mode: ContactMode, reduced: ReducedModel, row: Floats, directions: tuple[Floats, Floats], width: int
) -> StillParts:
    """Parts of the tables of a mode that belong to its matrices; arguments as of `tabulate_curved`."""
    n, q = reduced.stiffness.shape[0], len(row)
    closed = [i for i in range(q) if mode.mask >> i & 1]
    rate, along = directions[0][closed], directions[1][closed].T
    shift = np.zeros((q, n))
    if closed:
        shift[closed] = np.linalg.solve((rate @ along).T, along.T)
    elastic, damped = reduced.stiffness @ shift.T, reduced.damping @ shift.T
    d = row.shape[1] - 1
    flat = row[:, :d]
    project = np.eye(n) - shift[closed].T @ rate
    load = np.zeros((q, d + 2, width), dtype=complex)
    entry = mode.enter[:, n:] @ project
    for i in closed:
        columns = [elastic[:, i], damped[:, i], *flat[i]]
        load[i, :, : mode.n_eigenmode] = (entry @ np.array(columns).T).T
    size, shape = _losses(reduced)
    return StillParts(
        row=row,
        first=mode.n_eigenmode,
        is_lone=q == 1 and bool(closed),
        shift=shift,
        moved=row @ shift.T,
        accel=flat @ elastic,
        accel_rate=flat @ damped,
        load=load,
        size=size,
        dampers=(np.sqrt(np.abs(size)) * shape).T,
    )


def tuned_tables(
    still: StillParts, reduced: ReducedModel, exponent: Complexes, motion: Complexes, steps: Floats
) -> CurvedTables:
    """Tables of a mode at the speed and the unbalance force of `reduced`.

    Parameters
    ----------
    exponent, motion : (m,), (2 n, m)
        Of its coordinates, including that of the response.
    steps : (n_level,), s
    """
    row, n = still.row, reduced.stiffness.shape[0]
    d = row.shape[1] - 1
    flat = row[:, :d]
    free = -reduced.stiffness @ motion[:n] - reduced.damping @ motion[n:]
    free[:, still.first] += reduced.force[0] - 1j * reduced.force[1]
    read = np.concatenate([flat @ motion[:n], row @ motion[n:], flat @ free], axis=1)
    is_loaded = bool(still.load.any())  # without a closed pair there are no loads
    weight = np.zeros((steps.size, N_NODE - 1, N_NODE, exponent.size), dtype=complex)
    if is_loaded:
        weight = _weights(exponent, steps)
    growth = np.exp(np.maximum(exponent.real, 0.0) * steps[-1])
    inverse = np.divide(1.0, exponent, out=np.zeros_like(exponent), where=exponent != 0.0)
    node = np.exp(np.multiply.outer(np.multiply.outer(steps, NODES[1:]), exponent))
    width, n_read = exponent.size, (N_NODE - 1) * read.shape[1] if len(row) == 1 else 0
    lone = np.zeros((steps.size, 2, width, n_read))
    reach = np.zeros((steps.size, N_NODE * (d + 2), n_read))
    if still.is_lone:
        seen = node.swapaxes(1, 2)[..., np.newaxis] * read[0].T[:, np.newaxis]  # (l, m, 4, r)
        lone[:, 0] = seen.real.reshape(lone[:, 0].shape)
        np.negative(seen.imag.reshape(lone[:, 1].shape), out=lone[:, 1])
        reach[:] = _reach(weight, read[0], still.load[0]).reshape(reach.shape)
    forces = np.concatenate([still.dampers, reduced.force])  # (r + 2, n)
    drain = forces @ motion[n:]
    used = np.flatnonzero(np.any(motion != 0.0, axis=0))[-1] + 1
    return CurvedTables(
        used=np.array(used),
        read_re=read.real,
        read_im=read.imag,
        bound=np.abs(flat @ motion[:n]) * np.abs(exponent) ** 2 * growth,
        shift=still.shift,
        moved=still.moved,
        accel=still.accel,
        accel_rate=still.accel_rate,
        load_re=still.load.real,
        load_im=still.load.imag,
        weight_re=weight.real,
        weight_im=weight.imag,
        node_re=node.real,
        node_im=node.imag,
        lone=lone,
        reach=reach,
        reached=reach[:, d + 2 :].swapaxes(1, 2),
        inverse_re=inverse.real,
        inverse_im=inverse.imag,
        drain=np.stack([drain.real.T, -drain.imag.T]),
        sign=np.sign(still.size),
        drain_moved=forces @ still.shift.T,
    )


def _reach(weight: Complexes, read: Complexes, load: Complexes) -> Floats:
    """Readings (r, m) at nodes under unit loads (j, m) at all of them, (step, 5, j, 4, r)."""
    n_step, n_at, n_node, width = weight.shape
    both = (read[:, np.newaxis] * load).reshape(-1, width)  # (r j, m)
    columns = np.concatenate([both.real, -both.imag], axis=1).T
    rows = np.concatenate([weight.real, weight.imag], axis=-1).reshape(-1, 2 * width)
    found = (rows @ columns).reshape(n_step, n_at, n_node, len(read), len(load))
    reached: Floats = found.transpose(0, 2, 4, 1, 3)
    return reached


def _losses(reduced: ReducedModel) -> tuple[Floats, Floats]:
    """Nonzero eigenvalues (r,) of the symmetric damping, and their shapes (n, r)."""
    size, shape = np.linalg.eigh(0.5 * (reduced.damping + reduced.damping.T))
    keep = np.abs(size) > UNDAMPED * np.abs(size).max()
    return size[keep], shape[:, keep]


def _weights(exponent: Complexes, steps: Floats) -> Complexes:
    """Response at the nodes of steps after the first to loads at all of them, (step, 4, 5, m), s.

    That of a coordinate with the exponent l to the load (s / h)^k is `h c^(k+1) k! phi_(k+1)(c l h)` at the
    time c h.
    """
    reached = np.multiply.outer(steps, NODES[1:])
    # All steps together: for one step NumPy's overhead exceeds the computation.
    phi = phi_functions(np.multiply.outer(reached, exponent).ravel())
    phi = phi.reshape(N_NODE, *reached.shape, exponent.size)
    for power in range(N_NODE):
        phi[power] *= (reached * NODES[1:] ** power * math.factorial(power))[..., np.newaxis]
    # In real numbers: NumPy would convert a real matrix to a complex one.
    found = (LAGRANGE @ phi.reshape(N_NODE, -1).view(np.float64)).view(np.complex128)
    weights: Complexes = np.moveaxis(found.reshape(phi.shape), 0, 2)
    return weights


def phi_functions(x: Complexes) -> Complexes:
    """phi_1 to phi_5 (5, m): `phi_k = (phi_(k-1) - 1 / (k - 1)!) / x`, phi_0 the exponential.

    Of small x the last one is a series, and `phi_(k-1) = x phi_k + 1 / (k - 1)!` gives those before.
    """
    phi = np.empty((N_NODE, x.size), dtype=complex)
    size, least = np.abs(x), -1.0
    for limit, n_term in SERIES:
        these = np.flatnonzero((size > least) & (size <= limit))
        small, least = x[these], limit
        total = np.full(small.shape, 1.0 / math.factorial(N_NODE + n_term - 1), dtype=complex)
        for k in range(N_NODE + n_term - 2, N_NODE - 1, -1):
            total *= small
            total += 1.0 / math.factorial(k)
        phi[-1, these] = total
        for k in range(N_NODE - 1, 0, -1):
            total = small * total + 1.0 / math.factorial(k)
            phi[k - 1, these] = total
    those = np.flatnonzero(size > least)
    large = x[those]
    before, inverse = np.exp(large), 1.0 / large
    for k in range(N_NODE):
        before = (before - 1.0 / math.factorial(k)) * inverse
        phi[k, those] = before
    return phi
