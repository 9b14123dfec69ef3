"""Set-up of the paper's integrator: steps of one length, and matrices packed for them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

from rubhpc.errors import InputError
from rubhpc.fem.response import step_limit
from rubhpc.integrate.measuring.divergence import energy_limit
from rubhpc.integrate.packing import Packed, law_of, pack
from rubhpc.integrate.scheme import Scheme
from rubhpc.kernels.central_difference import Stepper
from rubhpc.kernels.laws import MULTIPLIER

if TYPE_CHECKING:
    from rubhpc.fem.model import Model
    from rubhpc.kernels.laws import Law
    from rubhpc.rig.rig import Rig
    from rubhpc.study.study import Contact, Integrator


@dataclass(frozen=True, kw_only=True, eq=False)
class CentralDifferenceSetup:
    """Set-up that the cases of one rig and speed share."""

    scheme: ClassVar[Scheme] = Scheme.CENTRAL_DIFFERENCE
    model: Model
    packed: Packed
    spin: float  # rad/s
    step: float  # s
    steps_per_sample: int
    samples_per_revolution: int
    is_updated: bool  # normal
    displacement_limit: float  # m
    law: Law = MULTIPLIER

    @cached_property
    def stepper(self) -> Stepper:
        """The bodies and the steps, as the kernel takes them."""
        return Stepper(
            linear=self.packed.linear,
            spin=self.spin,
            step=self.step,
            samples_per_revolution=self.samples_per_revolution,
            displacement_limit=self.displacement_limit,
            output_row=self.packed.output_row,
            probe=self.packed.probe,
        )

    @cached_property
    def energy_limit(self) -> float:
        """Mechanical energy, J, beyond which a motion has diverged."""
        return energy_limit(self.model, self.spin, self.displacement_limit)


def prepare_steps(
    model: Model,
    rig: Rig,
    speed: float,
    *,
    contact: Contact,
    integrator: Integrator,
    samples_per_revolution: int,
) -> CentralDifferenceSetup:
    """Choose the step and pack the matrices; a whole number of steps fills a sample's interval.

    Raises
    ------
    InputError
        If the step asked for is above the stability limit of the assembled matrices.
    """
    limit = step_limit(model)
    if integrator.step is not None and integrator.step >= limit:
        raise InputError(
            f"[integrator] step: {integrator.step:.4g} s is above the stability limit of rig {rig.name}; "
            f"use less than {limit:.4g} s"
        )
    interval = 2.0 * math.pi / (abs(speed) * samples_per_revolution)
    steps_per_sample = math.ceil(interval / integrator.step_within(limit) * (1.0 - 1e-12))
    step = interval / steps_per_sample
    return CentralDifferenceSetup(
        model=model,
        packed=pack(model, speed, step),
        spin=speed,
        step=step,
        steps_per_sample=steps_per_sample,
        samples_per_revolution=samples_per_revolution,
        is_updated=contact.normal == "updated",
        law=law_of(contact),
        displacement_limit=rig.rotor.displacement_limit,
    )
