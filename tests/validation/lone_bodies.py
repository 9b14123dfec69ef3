"""Bodies of a few degrees against walls, belts and springs: set-ups without a rig."""

from __future__ import annotations

import math

import numpy as np

from rubhpc.fem.model import Body, Model, StatorModel
from rubhpc.integrate.modal_setup import ModalSetup
from rubhpc.integrate.packing import law_of, pack
from rubhpc.integrate.reduced_model.reduction import reduce_model
from rubhpc.integrate.scheme import scheme_of
from rubhpc.integrate.setup import CentralDifferenceSetup
from rubhpc.study.tables import Integrator


def body(mass, stiffness, degrees, damping=0.0):
    """Body of the given matrices; a damping factor is that of the mass."""
    mass, stiffness = np.atleast_2d(mass).astype(float), np.atleast_2d(stiffness).astype(float)
    return Body(
        mass=mass,
        damping=damping * mass,
        gyroscopic=np.zeros_like(mass),
        stiffness=stiffness,
        degrees=degrees,
    )


def tip(stator_body, angle, *, radius=1.0, axial=0, lateral=-1):
    """A stator of any body, at an angle (rad) around node 1 of the other; rows of -1 are held."""
    return StatorModel(
        body=stator_body,
        node=1,
        angle=angle,
        radius=radius,
        clearance_offset=0.0,
        length=1.0,
        euler_load=math.inf,
        axial=axial,
        lateral=lateral,
    )


def _model(rotor, stators, spin, force, load):
    force = np.zeros(rotor.n_dof) if force is None else np.asarray(force)
    return Model(
        load=np.zeros(rotor.n_dof) if load is None else np.asarray(load),
        rotor=rotor,
        unbalance_cosine=force.real / spin**2,
        unbalance_sine=-force.imag / spin**2,
        stators=tuple(stators),
        output_node=1,
        sag=np.zeros(rotor.n_dof) if load is None else np.linalg.solve(rotor.stiffness, load),
    )


def set_up(rotor, stators, spin, per_revolution, contact, *, force=None, load=None, steps_per_sample=1):
    """Central difference of a body and its stators; `force` (n_dof,), N, is the phasor of exp(i spin t).

    `load` (n_dof,), N, is constant.
    """
    model = _model(rotor, stators, spin, force, load)
    step = 2 * math.pi / (abs(spin) * per_revolution * steps_per_sample)
    return CentralDifferenceSetup(
        model=model,
        packed=pack(model, spin, step),
        spin=spin,
        step=step,
        steps_per_sample=steps_per_sample,
        samples_per_revolution=per_revolution,
        is_updated=contact.normal == "updated",
        displacement_limit=math.inf,
        law=law_of(contact),
    )


def set_up_modal(rotor, stators, spin, per_revolution, contact, *, force=None, load=None, step=2e-6):
    """Modal scheme of a body and its stators; `step` (s) is that in contact."""
    model = _model(rotor, stators, spin, force, load)
    return ModalSetup(
        scheme=scheme_of(contact, Integrator()),
        model=model,
        reduced=reduce_model(model, spin, 1e-3),
        spin=spin,
        step=step,
        samples_per_revolution=per_revolution,
        is_updated=contact.normal == "updated",
        displacement_limit=math.inf,
        law=law_of(contact),
        accuracy=1e-6,
    )
