"""What the cases of one rig and speed share: assembled, checked and factorised once."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rubhpc.errors import InputError
from rubhpc.fem.assemble import assemble
from rubhpc.fem.response import step_limit
from rubhpc.packing import Packed, pack

if TYPE_CHECKING:
    from rubhpc.fem.model import Model
    from rubhpc.rig import Rig
    from rubhpc.study import Contact, Integrator

PAPER_STEP = 0.5e-6  # s
SAFE_SHARE = 0.9  # of the stability limit, where the paper's step would be above it
DIVERGED_SHARE = 0.1  # of the shaft's length: lateral motion that no rig survives


@dataclass(frozen=True, kw_only=True, eq=False)
class Setup:
    """All that the cases of one rig and speed share."""

    model: Model
    packed: Packed
    spin: float  # rad/s
    step: float  # s
    steps_per_sample: int
    samples_per_revolution: int
    is_updated: bool  # normal
    displacement_limit: float  # m


def prepare(
    rig: Rig, speed: float, *, contact: Contact, integrator: Integrator, samples_per_revolution: int
) -> Setup:
    """Assemble, check the step and factorise: once per rig and speed.

    The step is shortened so that a whole number of steps fills a sample's interval.

    Raises
    ------
    InputError
        If the step asked for is above the stability limit of the assembled matrices, the rig has no stator,
        or the speed is zero.
    """
    if not rig.stator:
        raise InputError(f"rig {rig.name}: [[stator]]: none; a rub case needs at least one")
    if speed == 0.0 or not math.isfinite(speed):
        raise InputError(f"speed: {speed} rad/s; sampling is locked to the shaft, so it has to turn")
    model = assemble(rig)
    limit = step_limit(model)
    if integrator.step is not None and integrator.step >= limit:
        raise InputError(
            f"[integrator] step: {integrator.step:.4g} s is above the stability limit of rig {rig.name}; "
            f"take less than {limit:.4g} s"
        )
    wanted = integrator.step if integrator.step is not None else min(PAPER_STEP, SAFE_SHARE * limit)
    interval = 2.0 * math.pi / (abs(speed) * samples_per_revolution)
    steps_per_sample = math.ceil(interval / wanted * (1.0 - 1e-12))
    step = interval / steps_per_sample
    return Setup(
        model=model,
        packed=pack(model, speed, step),
        spin=speed,
        step=step,
        steps_per_sample=steps_per_sample,
        samples_per_revolution=samples_per_revolution,
        is_updated=contact.normal == "updated",
        displacement_limit=DIVERGED_SHARE * sum(section.length for section in rig.rotor.shaft),
    )
