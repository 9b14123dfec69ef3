"""Bodies that come as matrices: bars and oscillators with known answers, and a rotor of ROSS."""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import periodic, read_rig, simulate

from rubhpc import LumpedStator, MatrixStator, Rig, State, Unbalance, assemble
from rubhpc.fem.modes import modes
from rubhpc.rig.reading import with_keys
from rubhpc.rig.rotors import MatrixRotor
from rubhpc.schema import DONE

SMALL = 1e-12  # m, a gap that is none


def below(**given):
    return LumpedStator(node=1, angle=math.pi, radius=1.0, **given)


def run(rig, duration, samples, *, clearance=SMALL, displacement=0.0, velocity=0.0, **given):
    """A record of one revolution; every degree of the rotor begins with this displacement and velocity."""
    rest = State.at_rest(assemble(rig))
    n_dof = rest.rotor_displacement.size
    wall = given.pop("wall", None)
    initial = replace(
        rest,
        rotor_displacement=np.full(n_dof, displacement),
        rotor_velocity=np.full(n_dof, velocity),
        stator_displacement=rest.stator_displacement if wall is None else (np.array([wall]),),
    )
    record = simulate(
        rig,
        speed=2 * math.pi / duration,
        clearance=clearance,
        friction=0.0,
        initial=initial,
        transient=0,
        revolutions=1,
        samples_per_revolution=samples,
        **given,
    )
    assert record.status == DONE
    return record


@pytest.mark.parametrize(("method", "step"), [("modal", None), ("central-difference", "2 us")])
@pytest.mark.parametrize("given", ["lumped", "matrices"])
def test_mass_meets_a_spring(method, step, given):
    """I1: 100 kg on 1e4 N/m meets a stop of 1e6 N/m, here with a tip of 0.1 g, at 1 m/s."""
    stop = below(mass=1e-4, stiffness=1e6)
    if given == "matrices":
        stop = MatrixStator(node=1, angle=math.pi, radius=1.0, mass=[[1e-4]], stiffness=[[1e6]])
    rig = Rig.from_matrices([[100.0]], None, [[1e4]], degrees=[(1, "v")], stators=[stop])
    duration = 0.04
    record = run(rig, duration, 4096, velocity=-1.0, method=method, step=step)
    assert record.contact_duration[0] == pytest.approx(31.260e-3, rel=1e-3)
    assert record.vertical.min() == pytest.approx(-9.95037e-3, rel=1e-4)
    assert record.peak_contact_force[0] == pytest.approx(9950.37, rel=1e-4)
    assert record.contact_impulse[0] == pytest.approx(198.020, rel=1e-4)
    leaves = record.final.rotor_velocity[0] / math.cos(10.0 * (duration - 31.260e-3))  # free since then
    assert leaves == pytest.approx(1.0, rel=1e-4)


@pytest.mark.parametrize("method", ["central-difference", "modal"])
@pytest.mark.parametrize(
    ("frequency", "restitution", "speed"), [(2.2, 0.7, 1.860859), (2.4, 0.8, 0.858441), (2.0, 0.6, 3.333333)]
)
def test_forced_oscillator_strikes_a_wall_once_a_period(method, frequency, restitution, speed):
    """I2: x'' + x = cos(w t), a wall at 0 (S. W. Shaw, P. J. Holmes, J. Sound Vib. 90 (1983) 129-155)."""
    rig = Rig.from_matrices(
        [[1.0]],
        None,
        [[1.0]],
        degrees=[(1, "v")],
        stators=[LumpedStator(node=1, rigid=True, radius=1.0)],
        unbalance=[Unbalance(node=1, mass=1.0, radius=1.0 / frequency**2)],
    )
    record = simulate(
        rig,
        speed=frequency,
        clearance=SMALL,
        friction=0.0,
        restitution=restitution,
        method=method,
        step=1e-3,
        transient=100,
        revolutions=2,
        samples_per_revolution=512,
    )
    assert (record.period, record.contacts_per_revolution[0]) == (1, 1)
    assert record.contact_impulse[0] / (1 + restitution) == pytest.approx(speed, rel=1e-4)


def bar(n_element, wall):
    """The bar of Doyen, Ern and Piperno, SIAM J. Sci. Comput. 33 (2011) 223-249, in lumped masses."""
    length, stiffness = 10.0 / n_element, 900.0 * n_element / 10.0
    mass = np.full(n_element + 1, length)
    mass[[0, -1]] /= 2
    chain = 2 * np.eye(n_element + 1) - np.eye(n_element + 1, k=1) - np.eye(n_element + 1, k=-1)
    chain[[0, -1], [0, -1]] = 1.0
    return Rig.from_matrices(
        np.diag(mass),
        None,
        stiffness * chain,
        degrees=[(node, "v") for node in range(1, n_element + 2)],
        stators=[wall],
        displacement_limit=1e9,
    )


def test_bar_bounces_off_a_rigid_wall():
    """W1: the energy that the node on the wall loses halves with the mesh."""
    loss = []
    for n_element in (100, 200):
        rig = bar(n_element, below(rigid=True))
        step = 0.5 * 10.0 / n_element / 30.0  # half the time that a wave takes through an element
        samples = 2 * math.ceil(0.75 / step)
        record = run(
            rig,
            1.5,
            samples,
            clearance=5.0,
            velocity=-10.0,
            method="central-difference",
            step=1.5 / samples * 1.000001,
        )
        force, end = record.contact_force[0], record.final
        touching = np.flatnonzero(force)
        assert touching[0] * step == pytest.approx(0.5, rel=0.01)
        assert (touching[-1] + 1) * step == pytest.approx(7 / 6, rel=0.01)
        assert record.contacts_per_revolution[0] == 1
        assert np.median(force[touching]) == pytest.approx(300.0, rel=2e-3)
        rebound = (rig.rotor.mass @ end.rotor_velocity).sum() / 10.0
        assert rebound == pytest.approx(record.contact_impulse[0] / 10.0 - 10.0, rel=1e-6)
        motion = end.rotor_velocity @ rig.rotor.mass @ end.rotor_velocity
        strain = end.rotor_displacement @ rig.rotor.stiffness @ end.rotor_displacement
        loss.append(1 - (motion + strain) / 1000.0)
        assert record.energy_residual < 1e-6
    assert record.contact_impulse[0] == pytest.approx(200.0, rel=5e-3)
    assert loss[0] < 0.005
    assert loss[1] == pytest.approx(loss[0] / 2, rel=0.02)


def test_bar_bounces_under_gravity():
    """W2, seen from a frame that falls with the bar: the wall comes up with 10 m/s2.

    It is a mass of 1e12 kg at the end of a swing of 1e-3 rad/s that begins 1e7 m out, where the bar is too.
    """
    frequency, gravity = 1e-3, 10.0
    wall = below(mass=1e12, stiffness=1e12 * frequency**2)
    n_element, duration = 200, 5.0
    step = 0.5 * 10.0 / n_element / 30.0
    samples = 2 * math.ceil(duration / step / 2)
    out = gravity / frequency**2
    record = run(
        bar(n_element, wall),
        duration,
        samples,
        clearance=5.0,
        displacement=-out,
        wall=out,
        method="central-difference",
        step=duration / samples * 1.000001,
    )
    force, step = record.contact_force[0], duration / samples
    first = np.flatnonzero(force[: int(2.5 / step)])
    assert record.contacts_per_revolution[0] >= 2
    assert first[0] * step == pytest.approx(1.0, rel=5e-3)
    assert (first[-1] + 1) * step == pytest.approx(5 / 3, rel=5e-3)
    assert force[first].sum() * step == pytest.approx(800 / 3, rel=5e-3)
    # The force rises by the gravity of what a wave has passed; its jumps at both ends ring.
    inner = slice(len(first) // 10, -len(first) // 10)
    slope, start = np.polyfit((first[inner] + 0.5) * step - 1.0, force[first[inner]], 1)
    assert start == pytest.approx(300.0, rel=5e-3)
    assert start + slope * 2 / 3 == pytest.approx(500.0, rel=5e-3)
    again = np.flatnonzero(force[int(2.5 / step) :] > 50.0) * step + 2.5
    assert again[0] == pytest.approx(11 / 3, rel=0.01)


class RossRotor:
    """What ROSS 2.3.0 gives for the packaged rotor without damping, as `tests/data` keeps it.

    Made by 14 `ShaftElement(0.8 / 14, 0, 0.02)`, `DiskElement(n=7, m=2.6465, Id=2.580e-3, Ip=4.764e-3)`
    and `BearingElement(kxx=1e6, cxx=0)` at nodes 0 and 14, of steel with E = 210 GPa and G = 79.6 GPa.
    """

    number_dof, L, bearing_elements, nodes = 6, 0.8, (), range(15)

    def __init__(self, folder):
        self._entries = np.load(folder / "ross_2.3.0_mokhtar2017.npz")

    def _matrix(self, name):
        entries = np.zeros((90, 90))
        entries[tuple(self._entries[f"{name}_at"])] = self._entries[name]
        return entries

    def M(self, frequency):  # noqa: N802
        return self._matrix("M")

    def C(self, frequency):  # noqa: N802
        return self._matrix("C")

    def K(self, frequency):  # noqa: N802
        return self._matrix("K")

    def G(self):  # noqa: N802
        return self._matrix("G")


@pytest.mark.parametrize("spin", [170.0, -170.0])
def test_rotor_of_ross_rubs_as_the_packaged_one(request, spin):
    packaged = with_keys(read_rig("mokhtar2017"), {"rotor.damping.alpha": 0.0})
    rotor = RossRotor(request.path.parents[1] / "data")
    stators = [replace(packaged.stator[0], radius=0.06, angle=2.0)]
    theirs = Rig.from_ross(rotor, stators=stators, unbalance=packaged.rotor.unbalance)
    ours = replace(packaged, stator=tuple(stators))
    for one, other in zip(*(modes(assemble(rig).rotor, spin) for rig in (theirs, ours)), strict=True):
        assert one.frequency == pytest.approx(other.frequency, rel=1e-8)
        assert (one.kind, one.whirl) == (other.kind, other.whirl)
    rub = {"speed": spin, "clearance": "60 um", "transient": 1, "revolutions": 2}
    one, other = simulate(theirs, **rub), simulate(ours, **rub)
    assert other.contact_impulse[0] > 0
    for name in ("vertical", "horizontal", "torsion", "contact_force"):
        found, known = getattr(one, name), getattr(other, name)
        assert found == pytest.approx(known, abs=1e-8 * abs(known).max()), name


RESTS = [(1.6, None, 1.896764), (0.4, 0.5, 6.497982)]


@pytest.mark.parametrize(("frequency", "restitution", "impulse"), RESTS)
def test_rotor_of_one_degree_rests_on_a_wall_in_each_cycle(frequency, restitution, impulse):
    """x'' + x = cos w t against a wall in the middle; impulses by flights in closed form, root by root.

    On the wall nothing is left free to move.
    """
    force = Unbalance(node=1, mass=1 / frequency**2, radius=1.0)
    rotor = MatrixRotor(mass=[[1.0]], stiffness=[[1.0]], degrees=((1, "v"),), unbalance=(force,))
    rig = Rig(name="oscillator", rotor=rotor, stator=(LumpedStator(node=1, radius=1.0, rigid=True),))
    case = {"speed": frequency, "clearance": 0.1 * SMALL, "friction": 0.0, "restitution": restitution}
    motion = periodic(rig, **case)
    assert motion.multipliers == pytest.approx([0.0, 0.0])  # what rests has no past
    assert motion.record.contact_impulse == pytest.approx([impulse], abs=1e-6)
    for transient in (20, "direct"):
        record = simulate(rig, **case, transient=transient)
        assert record.contact_impulse == pytest.approx([impulse], abs=1e-6)
        assert record.period == 1
