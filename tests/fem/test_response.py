"""Response without contact against closed forms, time marching and the scheme's own growth."""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import read_rig

from rubhpc.errors import InputError
from rubhpc.fem.assemble import assemble
from rubhpc.fem.modes import modes
from rubhpc.fem.response import (
    contact_free_amplitude,
    contact_free_reach,
    first_lateral_frequency,
    steady_response,
    step_limit,
)
from rubhpc.rig.parts import Bearing, Damping, Disc, ShaftSection
from rubhpc.rig.rig import Rig
from rubhpc.rig.rotors import Load, Rotor, Unbalance
from rubhpc.rig.stators import Bore, LumpedStator

# all but rigid and massless: a mass on two bearings
RIGID = ShaftSection(
    length=0.4, outer_diameter=0.1, elements=4, youngs_modulus=2.1e15, shear_modulus=8e14, density=1e-3
)
MASS = 10.0
STEEL = {"youngs_modulus": 2.1e11, "shear_modulus": 8e10, "density": 7800.0}


def jeffcott(**support):
    unbalance = (Unbalance(node=3, mass=0.01, radius=0.05),)
    disc = Disc(node=3, mass=MASS, diametral_inertia=0.05, polar_inertia=0.08)
    bearings = tuple(Bearing(node=node, **support) for node in (1, 5))
    return assemble(
        Rig(name="rigid", rotor=Rotor(shaft=(RIGID,), disc=(disc,), bearing=bearings, unbalance=unbalance))
    )


def uneven():
    """A stepped rotor on coupled, damped bearings, unbalanced at two nodes out of phase."""
    return Rig(
        name="uneven",
        rotor=Rotor(
            shaft=(
                ShaftSection(length=0.3, outer_diameter=0.03, elements=3, **STEEL),
                ShaftSection(length=0.3, outer_diameter=0.05, inner_diameter=0.02, elements=3, **STEEL),
            ),
            disc=(Disc(node=3, diameter=0.15, thickness=0.02, density=7800.0),),
            bearing=(
                Bearing(node=1, kyy=2e7, kzz=1e7, kyz=3e6, kzy=-2e6, cyy=2e3, czz=1e3),
                Bearing(node=7, kyy=1e7, kzz=3e7, cyy=1e3, czz=4e3),
            ),
            unbalance=(
                Unbalance(node=3, mass=1e-3, radius=0.07, phase=0.4),
                Unbalance(node=6, mass=2e-3, radius=0.02, phase=-1.9),
            ),
            damping=Damping(alpha=5.0, beta=1e-5),
        ),
    )


@pytest.mark.parametrize("spin", [200.0, 447.2, 900.0, -200.0])
def test_disc_on_equal_bearings_whirls_in_a_circle(spin):
    stiffness, damping = 1e6, 300.0
    model = jeffcott(stiffness=stiffness, damping=damping)
    response = steady_response(model, spin)
    v, w = (response[model.rotor.index(3, name)] for name in ("v", "w"))
    pull = 0.01 * 0.05 * spin**2
    expected = pull / (2 * stiffness - MASS * spin**2 + 2j * damping * spin)
    assert v == pytest.approx(expected, rel=1e-5)
    assert w == pytest.approx(-1j * expected, rel=1e-5)  # a quarter turn behind: y to z
    assert contact_free_amplitude(model, spin) == pytest.approx(abs(expected), rel=1e-5)


def test_amplitude_is_the_largest_deflection_of_the_orbit():
    model = assemble(uneven())
    spin = 350.0
    for node in (1, 3, 6):
        v, w = (steady_response(model, spin)[model.rotor.index(node, name)] for name in ("v", "w"))
        turn = np.exp(1j * np.linspace(0, 2 * np.pi, 20001))
        deflection = np.hypot((v * turn).real, (w * turn).real)
        assert deflection.min() < 0.999 * deflection.max()
        # 20000 points miss the top by 1e-8 of it
        assert contact_free_amplitude(model, spin, node) == pytest.approx(deflection.max(), rel=1e-6)
    assert contact_free_amplitude(model, spin) == contact_free_amplitude(model, spin, model.output_node)


def test_response_satisfies_the_equation_of_motion_at_every_angle():
    model, spin = assemble(uneven()), 350.0
    response = steady_response(model, spin)
    body = model.rotor
    for angle in (0.0, 1.0, 2.5, 4.0):
        turn = np.exp(1j * angle)
        u, rate, acceleration = (((1j * spin) ** k * response * turn).real for k in range(3))
        inner = body.mass @ acceleration + (body.damping + spin * body.gyroscopic) @ rate + body.stiffness @ u
        pull = spin**2 * (model.unbalance_cosine * math.cos(angle) + model.unbalance_sine * math.sin(angle))
        assert inner == pytest.approx(pull, abs=1e-7 * np.abs(body.stiffness @ u).max())


def test_undamped_rotor_at_its_resonance_is_refused():
    model = jeffcott(stiffness=1e6)
    # unit masses on springs of 4 N/m, in numbers without rounding: at 2 rad/s the matrix is exactly singular
    lateral = [row for row, (_, name) in enumerate(model.rotor.degrees) if name in ("v", "w")]
    exact = np.eye(model.rotor.n_dof)
    body = replace(
        model.rotor, mass=exact, stiffness=4.0 * exact, damping=0.0 * exact, gyroscopic=0.0 * exact
    )
    unbalance = np.zeros(body.n_dof)
    unbalance[lateral] = 1.0
    resonant = replace(model, rotor=body, unbalance_cosine=unbalance, unbalance_sine=0.0 * unbalance)
    with pytest.raises(InputError, match="damping"):
        steady_response(resonant, 2.0)
    assert steady_response(resonant, 1.0)[lateral] == pytest.approx(1 / 3)


def test_speed_reference_is_the_lowest_lateral_mode_and_no_other():
    rig = read_rig("mokhtar2017")
    # a shaft soft in shear only: torsion falls to 31 Hz / 10, far below the lateral modes
    soft = replace(rig.rotor.shaft[0], shear_modulus=2e7, shear=False)
    model = assemble(replace(rig, rotor=replace(rig.rotor, shaft=(soft,))))
    assert next(mode.kind for mode in modes(model.rotor)) == "torsional"
    assert first_lateral_frequency(model) / (2 * math.pi) == pytest.approx(31.56, abs=0.05)


def test_speed_reference_is_no_rigid_body_mode_in_a_bore():
    rig = read_rig("mokhtar2017")
    hinged = replace(rig.rotor, bearing=(rig.rotor.bearing[0], replace(rig.rotor.bearing[1], stiffness=0.0)))
    bore = Bore(node=15, rigid=True, radius=0.01)
    model = assemble(replace(rig, rotor=hinged, stator=(bore,)))
    free = [mode.frequency for mode in modes(model.rotor) if mode.kind == "lateral"]
    assert free[:2] == pytest.approx([math.sqrt(model.rotor.softness) / (2 * math.pi)] * 2)
    assert first_lateral_frequency(model) / (2 * math.pi) == pytest.approx(free[2])


def test_speed_reference_leaves_out_damping_and_takes_the_softer_plane():
    model = jeffcott(kyy=4e6, kzz=1e6, damping=5e3)
    assert first_lateral_frequency(model) == pytest.approx(math.sqrt(2 * 1e6 / MASS), rel=1e-6)


def test_speed_reference_of_coupled_bearings():
    # v + i w: M w^2 = 2 (k - i kc), undamped
    model = jeffcott(kyy=1e6, kzz=1e6, kyz=1e5, kzy=-1e5)
    expected = abs(np.sqrt(2 * (1e6 - 1e5j) / MASS))
    assert first_lateral_frequency(model) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("spin", [0.0, 4000.0])
def test_step_limit_parts_growth_from_decay(spin):
    # no coupling in the bearings: circulating forces feed the rotor at any step
    rotor = replace(
        uneven().rotor,
        bearing=(Bearing(node=1, stiffness=2e7, damping=2e3), Bearing(node=7, kyy=1e7, kzz=3e7)),
    )
    model = assemble(replace(uneven(), rotor=rotor))
    body, limit = model.rotor, step_limit(model)

    def growth(step):
        # the centred scheme: (M/h^2 + C/2h) u+ = (2M/h^2 - K) u - (M/h^2 - C/2h) u-
        C = body.damping + spin * body.gyroscopic
        ahead, behind = body.mass / step**2 + C / (2 * step), body.mass / step**2 - C / (2 * step)
        n = body.n_dof
        march = np.block(
            [
                [
                    np.linalg.solve(ahead, 2 * body.mass / step**2 - body.stiffness),
                    -np.linalg.solve(ahead, behind),
                ],
                [np.eye(n), np.zeros((n, n))],
            ]
        )
        return np.abs(np.linalg.eigvals(march)).max()

    assert growth(0.999 * limit) < 1.0
    assert growth(1.02 * limit) > 1.0


def test_step_limit_is_that_of_the_stiffest_body():
    rig = read_rig("mokhtar2017")
    soft = assemble(rig)
    stiff = assemble(replace(rig, stator=(replace(rig.stator[0], youngs_modulus=30e9),)))
    assert step_limit(stiff) == pytest.approx(step_limit(soft) / math.sqrt(10))
    # without stator only the rotor counts, whose mesh ends about 62 kHz
    bare = assemble(replace(rig, stator=()))
    assert 1 / (math.pi * step_limit(bare)) == pytest.approx(62e3, rel=0.02)


def test_the_reach_is_the_clearance_at_which_the_orbit_meets_a_stator():
    """Against the orbit itself, point by point about the sagged shaft; the lower stator is farther away."""
    rig = uneven()
    stators = tuple(
        LumpedStator(node=4, angle=angle, radius=0.05, mass=0.1, stiffness=1e6, clearance_offset=offset)
        for angle, offset in ((0.6, 0.0), (math.pi, 3e-6))
    )
    spin = 700.0
    reaches = []
    for load in (0.0, -60.0):
        rotor = replace(rig.rotor, load=(Load(node=4, vertical=load),))
        model = assemble(replace(rig, rotor=rotor, stator=stators))
        rows = [model.rotor.index(4, name) for name in ("v", "w")]
        turns = np.exp(1j * np.linspace(0, 2 * math.pi, 20001))
        v, w = ((steady_response(model, spin)[row] * turns).real + model.sag[row] for row in rows)
        gaps = [o - (v * math.cos(a) + w * math.sin(a)).max() for a, o in ((0.6, 0.0), (math.pi, 3e-6))]
        reaches.append((-gaps[0], -gaps[1]))
        assert contact_free_reach(model, spin) == pytest.approx(max(reaches[-1]), rel=1e-6)
    assert reaches[0][0] > reaches[0][1]  # without the load the upper stator is met first, with it the lower
    assert reaches[1][1] > reaches[1][0]
