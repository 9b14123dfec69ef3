"""Parts of contact modes that the spin speed leaves alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels.contact_pairs import AXIAL, LATERAL
from rubhpc.kernels.retuning_laws import NO_RIM, RimPart

if TYPE_CHECKING:
    from rubhpc.integrate.reduced_model.reduction import ReducedModel

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


class Linear(NamedTuple):
    """What a set of states makes of the motion: n reduced degrees, r switch functions."""

    seen: Complexes  # (n,), what the constraints leave of the unbalance at unit speed
    switch: Floats  # (r, 2 n), switch functions of the motion
    reaction: Complexes  # (r,), what they lose by the unbalance at unit speed
    across: Floats  # (n, r), friction forces by switch functions
    damping: Floats  # (n, n)


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
