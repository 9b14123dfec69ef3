"""Set-up of an integration: what all cases of one rig and speed share, prepared once."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, TypeAlias

import numpy as np

from rubhpc.errors import InputError
from rubhpc.fem.assemble import assemble, model_at
from rubhpc.fem.free_spin import release
from rubhpc.fem.probes import with_probes
from rubhpc.fem.response import step_limit
from rubhpc.fem.statics import sag_at_stators
from rubhpc.integrate.measuring.divergence import energy_limit
from rubhpc.integrate.modal_setup import FINEST_TICK, LONGEST_TURN, ModalSetup, Release
from rubhpc.integrate.packing import Packed, degrees_of, law_of, pack
from rubhpc.integrate.reduced_model.reduction import reduce_model, reduced_sag
from rubhpc.integrate.reduced_model.truncation import touch_of
from rubhpc.integrate.scheme import Scheme, scheme_of
from rubhpc.kernels.central_difference.march import Stepper
from rubhpc.kernels.contact_pairs import LATERAL, V, W
from rubhpc.kernels.laws import MULTIPLIER
from rubhpc.rig.rotors import Rotor
from rubhpc.study.tables import SEARCH_STEP

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.reduced_model.reduction import ReducedModel
    from rubhpc.kernels.laws import Law
    from rubhpc.rig.probes import Probe
    from rubhpc.rig.rig import Rig
    from rubhpc.study.contact_keys import Contact
    from rubhpc.study.drive_law import DriveLaw
    from rubhpc.study.tables import Integrator

    Floats = NDArray[np.float64]


ACROSS = 1e-12  # share of a motion across the axis of a stator that is rounding


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


Setup: TypeAlias = CentralDifferenceSetup | ModalSetup


def moves_across(model: Model) -> bool:
    """Whether a stator's tip and disc can move across its axis, so that their line of centres turns."""
    aside = np.abs(sag_at_stators(model)[1])
    for stator, rows, off in zip(model.stators, degrees_of(model), aside, strict=True):
        weight = {V: math.sin(stator.angle), W: math.cos(stator.angle), LATERAL: 1.0}
        moves = any(rows[degree] >= 0 and abs(share) > ACROSS for degree, share in weight.items())
        if moves or off > ACROSS * stator.radius:
            return True
    return False


def prepare(
    rig: Rig,
    speed: float,
    *,
    contact: Contact,
    integrator: Integrator,
    samples_per_revolution: int,
    model: Model | None = None,
    probes: Sequence[Probe] = (),
    drive: DriveLaw | None = None,
    reduced: ReducedModel | None = None,
    is_measured: bool = True,
) -> Setup:
    """Assemble, check the step and factorise: once per rig and speed.

    `model` is the assembled rig, if known, `probes` are its measuring points, `drive` turns a rotor of free
    speed, and `reduced` is the model in modal coordinates, if known. A motion that is followed but never
    recorded need not be measured.

    Raises
    ------
    InputError
        If the requested step is above the stability limit of the assembled matrices, the rig has no stator,
        the speed is zero or, for the modal scheme, nearly zero, or a probe has nothing to measure.
    """
    if not rig.stator:
        raise InputError(f"rig {rig.name}: [[stator]]: none; a rub case needs at least one")
    if speed == 0.0 or not math.isfinite(speed):
        raise InputError(f"speed: {speed} rad/s; sampling is locked to the shaft, so it has to turn")
    model, free_spin = model or assemble(rig), None
    if drive is not None:
        model, free_spin = release(model, drive.inertia)
    bare = model_at(model, speed)
    model = with_probes(bare, rig, probes, speed)
    is_bent = any(stator.squared_slope is not None for stator in model.stators)
    has_bore = any(stator.is_bore for stator in model.stators)
    is_updated = contact.normal == "updated" and (has_bore or moves_across(model))
    scheme = scheme_of(
        contact,
        integrator,
        is_bent=is_bent,
        is_updated=is_updated,
        has_harmonics=bool(model.harmonics),
        stators=rig.stator,
    )
    if integrator.method == "modal":
        if 2.0 * math.pi / abs(speed) > LONGEST_TURN:
            least = 2.0 * math.pi / LONGEST_TURN
            raise InputError(
                f"speed: {speed:.3g} rad/s is too slow for events timed to {1e9 * FINEST_TICK:.2g} ns; take "
                f"{least:.1g} rad/s or more"
            )
        law = law_of(contact)
        touch = touch_of(model, law, is_updated=is_updated)
        reduced = reduced or reduce_model(model, speed, integrator.accuracy, free_spin, touch=touch)
        limit, later = rig.rotor.displacement_limit, None
        if model.rotor.softness:
            model = with_probes(replace(bare, sag=reduced_sag(model, reduced)), rig, probes, speed)
            limit += float(np.abs(model.sag).max())
        if isinstance(rig.rotor, Rotor) and rig.rotor.until is not None:
            after = replace(rig, rotor=rig.rotor.let_go())
            alone = assemble(after)  # stators stay where they are set about the shaft before
            caught = prepare(
                after,
                speed,
                contact=contact,
                integrator=integrator,
                samples_per_revolution=samples_per_revolution,
                model=replace(alone, stators=bare.stators, carriers=bare.carriers),
                probes=probes,
                drive=drive,
                is_measured=is_measured,
            )
            assert isinstance(caught, ModalSetup)
            later = Release(rig.rotor.until, caught)
        return ModalSetup(
            scheme=scheme,
            model=model,
            reduced=reduced,
            release=later,
            is_measured=is_measured,
            free_spin=free_spin,
            spin=speed,
            step=SEARCH_STEP if integrator.step is None else integrator.step,
            accuracy=integrator.accuracy,
            samples_per_revolution=samples_per_revolution,
            is_updated=is_updated,
            law=law,
            displacement_limit=limit,
        )
    return prepare_steps(
        model,
        rig,
        speed,
        contact=contact,
        integrator=integrator,
        samples_per_revolution=samples_per_revolution,
    )
