"""Further tables of a contact mode for curved gaps, read by `kernels.curved_contact`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels.curved_contact import N_NODE, CurvedTables

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
    exponent = np.zeros(width, dtype=complex)
    exponent[:end] = mode.exponent
    motion = np.zeros((2 * n, width), dtype=complex)
    motion[:, :end] = mode.motion
    still = still_parts(mode, reduced, row, directions, width)
    n_step = n_tabulated(tick, n_level)
    return with_levels(
        still, tuned_parts(still, reduced, exponent, motion, tick * 2.0 ** (n_step - 1)), n_step
    )


def with_levels(still: StillParts, tuned: dict[str, Any], n_step: int) -> CurvedTables:
    """Tables of a mode, (1, ...) each, with room for steps of `n_step` lengths."""
    n_load, n_read, width = tuned["seen_re"].shape
    n_at, n_read = N_NODE - 1, (N_NODE - 1) * n_read
    parts = {
        "shift": still.shift,
        "moved": still.moved,
        "accel": still.accel,
        "accel_rate": still.accel_rate,
        "load_re": still.load.real,
        "load_im": still.load.imag,
        "is_filled": np.zeros(n_step, dtype=np.bool_),
        "node_re": np.zeros((n_step, n_at, width)),
        "node_im": np.zeros((n_step, n_at, width)),
        "weight_re": np.zeros((n_step, n_at, N_NODE, width)),
        "weight_im": np.zeros((n_step, n_at, N_NODE, width)),
        "lone": np.zeros((n_step, 2, width, n_read)),
        "reach": np.zeros((n_step, N_NODE * n_load, n_read)),
        "reached": np.zeros((n_step, n_read, n_at * n_load)),
        "sign": np.sign(still.size),
    }
    return CurvedTables(**{name: np.array(part, order="C")[None] for name, part in (parts | tuned).items()})


def n_tabulated(tick: float, n_level: int) -> int:
    """Number of tabulated steps, of 1, 2, 4... ticks (s), among those of a library."""
    return min(n_level, max(1, int(np.log2(LONGEST_STEP / tick))))


class StillParts(NamedTuple):
    """Parts of a mode's tables that do not depend on the spin speed, without terms of the unbalance."""

    row: Floats  # (q, 3 + b, n), `curved_bodies.motion_rows`
    first: int  # coordinate of the response to the unbalance
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
        shift=shift,
        moved=row @ shift.T,
        accel=flat @ elastic,
        accel_rate=flat @ damped,
        load=load,
        size=size,
        dampers=(np.sqrt(np.abs(size)) * shape).T,
    )


def tuned_parts(
    still: StillParts, reduced: ReducedModel, exponent: Complexes, motion: Complexes, longest: float
) -> dict[str, Any]:
    """Parts of a mode's tables that belong to the speed and the unbalance force of `reduced`, by name.

    Parameters
    ----------
    exponent, motion : (m,), (2 n, m)
        Of its coordinates, including that of the response.
    longest : float
        The longest step, s.
    """
    row, n = still.row, reduced.stiffness.shape[0]
    d = row.shape[1] - 1
    flat = row[:, :d]
    place, rate = motion[:n].view(np.float64), motion[n:].view(np.float64)  # NumPy would convert real factors
    elastic, damped = flat @ reduced.stiffness, flat @ reduced.damping
    read = np.concatenate([flat @ place, row @ rate, -elastic @ place - damped @ rate], axis=1).view(complex)
    read[:, 2 * d + 1 :, still.first] += flat @ (reduced.force[0] - 1j * reduced.force[1])
    is_lone = len(row) == 1
    seen = (
        read[0] * still.load[0, :, np.newaxis]
        if is_lone
        else np.zeros((d + 2, 0, exponent.size), dtype=complex)
    )
    growth = np.exp(np.maximum(exponent.real, 0.0) * longest)
    inverse = np.divide(1.0, exponent, out=np.zeros_like(exponent), where=exponent != 0.0)
    forces = np.concatenate([still.dampers, reduced.force])  # (r + 2, n)
    drain = (forces @ rate).view(complex)
    return {
        "used": np.flatnonzero(np.any(motion != 0.0, axis=0))[-1] + 1,
        "read_re": read.real,
        "read_im": read.imag,
        "bound": np.abs(read[:, :d]) * np.abs(exponent) ** 2 * growth,
        "exponent_re": exponent.real,
        "exponent_im": exponent.imag,
        "seen_re": seen.real,
        "seen_im": seen.imag,
        "inverse_re": inverse.real,
        "inverse_im": inverse.imag,
        "drain": np.stack([drain.real.T, -drain.imag.T]),
        "drain_moved": forces @ still.shift.T,
    }


def _losses(reduced: ReducedModel) -> tuple[Floats, Floats]:
    """Nonzero eigenvalues (r,) of the symmetric damping, and their shapes (n, r)."""
    size, shape = np.linalg.eigh(0.5 * (reduced.damping + reduced.damping.T))
    keep = np.abs(size) > UNDAMPED * np.abs(size).max()
    return size[keep], shape[:, keep]
