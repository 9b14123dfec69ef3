"""Parts of contact modes that do not depend on the spin speed."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.changing_speed.followed_modes import NOTHING
from rubhpc.kernels.contact_modes import LANES, SAMPLES_AT_ONCE
from rubhpc.kernels.contact_pairs import AXIAL, LATERAL
from rubhpc.kernels.retuning import HeldMode, Speeds
from rubhpc.kernels.retuning_laws import NO_RIM, RimPart

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from rubhpc.integrate.changing_speed.near_modes import Linear
    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.integrate.reduced_model.reduction import ReducedModel
    from rubhpc.kernels.contact_modes import ModeTables
    from rubhpc.kernels.retuning_laws import Springs

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

_NONE = np.zeros(0, dtype=np.complex128)
WITHOUT_RIM = RimPart(
    one=NO_RIM,
    motion=_NONE,
    entered=_NONE,
    switch=_NONE,
    fixed=_NONE,
    rate=_NONE,
    loss=np.zeros((0, 0)),
    power=0.0,
    velocity=_NONE,
    resisting=_NONE,
    row=_NONE,
    work=_NONE,
    growing=np.zeros(0, dtype=np.int64),
    speed=np.zeros(0),
)


def output_operators(reduced: ReducedModel) -> tuple[Floats, Floats, Floats]:
    """Rows of tables (`kernels.contact_modes`): of displacements, rates and accelerations, (o, n) each."""
    none = np.zeros_like(reduced.output)
    position, rate = [reduced.output, none, none[2:]], [none, reduced.output, none[2:]]
    acceleration = [none, none, reduced.output[2:]]
    for place in (*(degree[[AXIAL, LATERAL]] for degree in reduced.degree), *reduced.carrier):
        position += [place, 0.0 * place[1:]]
        rate += [0.0 * place, place[1:]]
        acceleration += [0.0 * place, 0.0 * place[1:]]
    of_probes = reduced.probe
    position.append(of_probes[0])
    rate.append(of_probes[1])
    acceleration.append(of_probes[2])
    return np.concatenate(position), np.concatenate(rate), np.concatenate(acceleration)


def with_slip(row: ModeTables, slip: Complexes, exponent: Complexes) -> ModeTables:
    """Tables of a mode, (1, ...), with complete slip speeds (q, coordinates) and their rates."""
    end, width = exponent.size, row.slip_re.shape[-1]
    speed = np.zeros((1, len(slip), width), dtype=np.complex128)
    speed[0, :, :end] = slip
    rate = speed.copy()
    rate[0, :, :end] *= exponent
    return row._replace(
        slip_re=speed.real.copy(),
        slip_im=speed.imag.copy(),
        slip_rate_re=rate.real.copy(),
        slip_rate_im=rate.imag.copy(),
    )


def without_renewed(row: ModeTables, n_row: int) -> ModeTables:
    """Tables of a mode, (1, ...), without the parts computed for each speed; they have `n_row` outputs."""
    width = row.motion_re.shape[-1]
    n_output = -(-SAMPLES_AT_ONCE * n_row // LANES) * LANES
    shapes = {"output": (1, 2 * width, n_output)} | {
        name: getattr(row, name).shape for name in ("power_re", "power_im", "bound")
    }
    return row._replace(**{name: np.broadcast_to(0.0, shape) for name, shape in shapes.items()})


def held_mode(
    mode: ContactMode,
    reduced: ReducedModel,
    linear: Linear,
    *,
    slip: Floats,
    phasor: Complexes,
    output: Floats,
    width: int,
    n_ahead: int,
    springs: Springs,
    is_balanced: bool,
) -> HeldMode:
    """Speed-independent part of a mode of m eigenmodes; its tables have a width.

    Parameters
    ----------
    linear : Linear
        Linear maps of the set of states.
    slip : (q, n)
        Slip speed with the motion of pairs, unless the switch functions contain it.
    phasor : (n,), complex, kg m
        Unbalance at unit speed.
    output : (o, 3 n)
        `output_operators`, side by side.
    n_ahead : int
        Samples that are read from one set of coordinates.
    springs : Springs
        The pressed ones.
    is_balanced : bool
        Whether energies are needed; otherwise there are no resisting forces.
    """
    m, n = mode.n_eigenmode, slip.shape[1]
    end = mode.exponent.size
    motion: Complexes = np.zeros((2 * n, width), dtype=np.complex128)
    exponent = np.zeros(width, dtype=np.complex128)
    motion[:, :end], exponent[:end] = mode.motion, mode.exponent
    position, velocity, acceleration = np.hsplit(output, 3)
    seen = position @ motion[:n] + velocity @ motion[n:]
    seen += (acceleration @ motion[n:]) * exponent
    # An inverse shape times its shape is 2 where a mode represents a conjugate pair, and is doubled.
    enter = mode.enter[:m]
    doubled = np.einsum("ka,ak->k", enter, mode.motion[:, :m]).real
    resistance, resisting = np.zeros((n, 2 * n)), np.zeros_like(motion[:n])
    if is_balanced:
        skew = 0.5 * (reduced.stiffness - reduced.stiffness.T)
        against = np.hstack([skew, linear.damping])
        resistance, resisting = against - linear.across @ linear.switch, against @ motion
        resisting[:, :end] -= linear.across @ mode.switch
    return HeldMode(
        n_coordinate=end,
        n_ahead=n_ahead,
        exponent=exponent,
        is_pair=doubled > 1.5,
        drive=enter[:, n:] @ linear.seen,
        mirrored_drive=enter[:, n:].conj() @ linear.seen,
        switch=linear.switch,
        reaction=linear.reaction,
        slip=np.ascontiguousarray(slip),
        resistance=resistance,
        rate=np.ascontiguousarray(motion[n:].T),
        rubbed=linear.across @ linear.reaction,
        resisting=np.ascontiguousarray(resisting.T),
        phasor=phasor,
        work=np.stack([phasor @ motion[n:], phasor.conj() @ motion[n:]]),
        output=output,
        row=seen,
        rim=WITHOUT_RIM,
        springs=springs,
        varying=NOTHING,
    )


def speeds_of(
    spin: ArrayLike,
    factor: ArrayLike,
    growth: ArrayLike,
    tick: ArrayLike,
    held_spin: float,
    sample_level: int,
    reach: float = math.inf,
    rise: float = 0.0,
) -> Speeds:
    """Speeds (rad/s) to which modes are tuned whose matrices are those at `held_spin`, or within `reach`.

    `factor` (1/s^2) is what the unbalance at unit speed acts by, which grows by `growth` (1/s), `tick` (s)
    the resolution of events, `rise` the place of their acceleration (`followed_modes`).
    """
    spins, ticks = np.asarray(spin, dtype=np.float64), np.asarray(tick, dtype=np.float64)
    factors = np.asarray(factor, dtype=np.complex128)
    grown = np.asarray(growth, dtype=np.float64)
    return Speeds(
        spin=spins,
        share=np.abs(spins / held_spin),
        within=(spins - held_spin) / reach,
        rise=np.full(spins.size, rise),
        factor=factors,
        growth=grown,
        tick=ticks,
        interval=ticks * 2.0**sample_level,
    )
