"""Parts of the tables of contact modes, and the speeds to which they are filled."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels.contact_modes import LANES, SAMPLES_AT_ONCE
from rubhpc.kernels.contact_pairs import AXIAL, LATERAL
from rubhpc.kernels.filling import Speeds

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from rubhpc.integrate.reduced_model.reduction import ReducedModel
    from rubhpc.kernels.contact_modes import ModeTables

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


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


def without_filled(row: ModeTables, n_row: int) -> ModeTables:
    """Tables of a mode, (1, ...), without the parts filled in for each speed; they have `n_row` outputs."""
    width = row.motion_re.shape[-1]
    n_output = -(-SAMPLES_AT_ONCE * n_row // LANES) * LANES
    shapes = {"output": (1, 2 * width, n_output)} | {
        name: getattr(row, name).shape for name in ("power_re", "power_im", "bound")
    }
    return row._replace(**{name: np.broadcast_to(0.0, shape) for name, shape in shapes.items()})


def speeds_of(
    spin: ArrayLike,
    factor: ArrayLike,
    growth: ArrayLike,
    tick: ArrayLike,
    held_spin: float,
    sample_level: int,
    reach: float = math.inf,
) -> Speeds:
    """Speeds (rad/s) to which tables are filled whose matrices are those at `held_spin`, or within `reach`.

    `factor` (1/s^2) is what the unbalance at unit speed acts by, which grows by `growth` (1/s), `tick` (s)
    the resolution of events.
    """
    spins, ticks = np.asarray(spin, dtype=np.float64), np.asarray(tick, dtype=np.float64)
    factors = np.asarray(factor, dtype=np.complex128)
    grown = np.asarray(growth, dtype=np.float64)
    return Speeds(
        spin=spins,
        within=(spins - held_spin) / reach,
        factor=factors,
        growth=grown,
        tick=ticks,
        interval=ticks * 2.0**sample_level,
    )
