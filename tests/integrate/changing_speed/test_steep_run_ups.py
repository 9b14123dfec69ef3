"""Steep run-ups of a rotor in three tabulated bearings, held to stepping of all its degrees.

The speed passes half of a natural frequency, which pieces of one revolution would excite at 2X. With rub,
contacts are rigid, and the reference is Moreau's: impulses that leave no pair approaching, in even steps.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import run_up
from set_ups import prepared
from trial_rig import STEEL

from rubhpc import LumpedStator, Probe, Rig, Unbalance, read_rig
from rubhpc.fem.assemble import assemble, model_at
from rubhpc.fem.probes import with_probes
from rubhpc.integrate.case import run_case
from rubhpc.integrate.changing_speed.case import record_run_up
from rubhpc.integrate.packing import whole_system
from rubhpc.rig.bearing_table import BearingTable
from rubhpc.rig.parts import Damping, Disc, ShaftSection, Torsion
from rubhpc.rig.rotors import Rotor
from rubhpc.study.initial import CONTACT_FREE, Initial
from rubhpc.study.speed_law import SpeedLaw
from rubhpc.study.study import Recording

SPEEDS = (150.0, 260.0, 380.0, 520.0)  # rad/s
PER_REVOLUTION, STEPS = 128, 8  # steps of the reference between samples
RUB = {"clearance": 1.6e-4, "friction": 0.1}
HIGHEST = 10  # order up to which signals are compared
PROBES = tuple(
    Probe(name=f"at_{node}", node=node, angle=angle, quantity="acceleration")
    for node, angle in ((1, -math.pi / 4), (5, math.pi / 4), (3, 0.3), (9, 0.1))
)


def bearing(node, share):
    return BearingTable(
        node=node,
        speed=SPEEDS,
        kyy=[share * k for k in (3e7, 2.2e7, 1.8e7, 1.7e7)],
        kzz=[share * k for k in (2e7, 1.5e7, 1.2e7, 1.1e7)],
        kyz=[share * k for k in (3e6, 1.5e6, 8e5, 5e5)],
        kzy=[share * k for k in (-1e6, -2e6, -2.4e6, -2.6e6)],
        cyy=[share * c for c in (9e3, 5e3, 3e3, 2e3)],
        czz=[share * c for c in (7e3, 4e3, 2.5e3, 2e3)],
    )


def machine(count=1):
    rotor = Rotor(
        shaft=(
            ShaftSection(length=0.9, outer_diameter=0.035, elements=6, **STEEL),
            ShaftSection(length=0.25, outer_diameter=0.03, elements=2, **STEEL),
        ),
        disc=(
            Disc(node=3, diameter=0.22, thickness=0.025, density=7850.0),
            Disc(node=9, diameter=0.2, thickness=0.03, density=7850.0),
        ),
        bearing=(bearing(1, 1.0), bearing(5, 1.2), bearing(7, 0.8)),
        unbalance=(
            Unbalance(node=9, mass=0.01, radius=0.07, phase=0.6),
            Unbalance(node=3, mass=0.02, radius=0.08, phase=-1.2),
        ),
        torsion=Torsion(fixed_node=1),
        damping=Damping(alpha=6.0, beta=1e-5),
        gravity=9.81,
    )
    stators = tuple(
        LumpedStator(node=9, angle=0.2 + 2.0 * math.pi * i / count, mass=0.3, stiffness=1e6, damping=300.0)
        for i in range(count)
    )
    return Rig(name="three bearings", rotor=rotor, stator=stators)


def system_of(base):
    """Mass, gyroscopic terms, unbalance at unit speed, constant load, and turning as one, of all degrees."""
    mass, damping, _, _ = whole_system(base, 0.0)
    n, rotor = len(mass), base.rotor
    phasor, load, spinning = np.zeros(n, complex), np.zeros(n), np.zeros(n)
    phasor[: rotor.n_dof] = base.unbalance_cosine - 1j * base.unbalance_sine
    load[: rotor.n_dof] = base.load
    spinning[: rotor.n_dof] = [name == "thx" for _, name in rotor.degrees]
    return mass, whole_system(base, 1.0)[1] - damping, phasor, load, spinning


def stepped(rig, law):
    """Accelerations at the probes, (4, n_sample), by Newmark's method with an even acceleration."""
    base = assemble(rig)
    mass, gyroscopic, phasor, load, spinning = system_of(base)
    grid = np.arange(min(law.speed) - 1.0, max(law.speed) + 1.0)
    tables = np.array([whole_system(model_at(base, speed), 0.0)[1:3] for speed in grid])

    def matrices(speed, rate):
        place = min(int(speed - grid[0]), grid.size - 2)
        share = speed - grid[place]
        held = (1.0 - share) * tables[place] + share * tables[place + 1]
        return held[0] + speed * gyroscopic, held[1] + rate * gyroscopic

    angles = 2.0 * math.pi * np.arange(law.n_revolution * PER_REVOLUTION * STEPS) / (PER_REVOLUTION * STEPS)
    times, speeds, rates = law.at_angle(angles)
    first, rate = speeds[0], rates[0]
    damper, spring = matrices(first, 0.0)
    whirl = np.linalg.solve(spring + 1j * first * damper - first**2 * mass, first**2 * phasor)
    u = whirl.real + np.linalg.solve(spring, load - rate * mass @ spinning)
    v = (1j * first * whirl).real

    def force(k):
        turned = (phasor * (speeds[k] ** 2 - 1j * rates[k]) * np.exp(1j * angles[k])).real
        return load + turned - rates[k] * mass @ spinning

    damper, spring = matrices(first, rate)
    a = np.linalg.solve(mass, force(0) - damper @ v - spring @ u)
    seen = [a]
    for k in range(1, angles.size):
        h = times[k] - times[k - 1]
        damper, spring = matrices(speeds[k], rates[k])
        ahead, onward = u + h * v + h**2 / 4 * a, v + h / 2 * a
        left = mass + h / 2 * damper + h**2 / 4 * spring
        a = np.linalg.solve(left, force(k) - damper @ onward - spring @ ahead)
        u, v = ahead + h**2 / 4 * a, onward + h / 2 * a
        if k % STEPS == 0:
            seen.append(a)
    rows = with_probes(base, rig, PROBES, first).probe_rows[2]
    return rows @ np.array(seen).T


def error(found, expected):
    window = np.hanning(expected.size)
    own, full = np.fft.rfft([(s - s.mean()) * window for s in (found, expected)])
    kept = HIGHEST * expected.size // PER_REVOLUTION
    return np.linalg.norm((own - full)[:kept]) / np.linalg.norm(full[:kept])


@pytest.mark.parametrize("speeds", [(300.0, 345.0), (352.0, 310.0)], ids=["up", "down"])
def test_accelerations_of_a_steep_passage(speeds):
    """By 90 rad/s2, accelerations at all nodes are within 0.5 %, those at a bearing that hardly moves too."""
    rig, law = machine(), SpeedLaw(time=(0.0, 0.5), speed=speeds)
    expected = stepped(rig, law)
    found = run_up(
        rig,
        start=speeds[0],
        stop=speeds[1],
        time=0.5,
        clearance=1.0,
        friction=0.0,
        probes=PROBES,
        samples_per_revolution=PER_REVOLUTION,
    )
    off = {p.name: error(found[f"probe_{p.name}"].values, s) for p, s in zip(PROBES, expected, strict=True)}
    assert max(off.values()) < 5e-3, off


@pytest.mark.parametrize("at_rest", [False, True])
def test_the_sag_follows_the_bearings(at_rest):
    """Without unbalance a shaft stands in the sag at each speed, and its weight on the bearings.

    The sag moves evenly, and what moves with it does not swing.
    """
    whole, law = machine(), SpeedLaw(time=(0.0, 0.5), speed=(200.0, 345.0))
    rig = replace(whole, rotor=replace(whole.rotor, unbalance=()))
    probes = [Probe(name=f"p{node}", node=node, quantity="bearing_force") for node in (1, 5, 7)]
    found = run_up(
        rig,
        start=200.0,
        stop=345.0,
        time=0.5,
        clearance=1.0,
        probes=probes,
        samples_per_revolution=PER_REVOLUTION,
        initial={"from": "rest"} if at_rest else None,
    )
    turned = 2.0 * np.pi / PER_REVOLUTION * np.arange(found.sizes["sample"])
    base, speeds = assemble(rig), law.at_angle(turned)[1]
    row = base.rotor.index(9, "v")
    sag = np.array([model_at(base, speed).sag[row] for speed in speeds])
    off = np.abs(found.vertical.values - sag).max() / np.ptp(sag)
    assert off < 0.01, off
    up = np.array([float(name == "v") for _, name in base.rotor.degrees])
    weight = 9.81 * up @ base.rotor.mass @ up
    carried = sum(found[f"probe_p{node}"].values for node in (1, 5, 7))
    assert np.abs(carried + weight).max() < 1e-3 * weight


def without_contact(rig, law):
    return run_up(
        rig,
        speed_law=list(zip(law.time, law.speed, strict=True)),
        clearance=1.0,
        friction=0.0,
        probes=PROBES,
        samples_per_revolution=PER_REVOLUTION,
    )


def test_bends_and_the_start_leave_no_spikes():
    """Fast modes of a bearing that hardly moves do not ring where the speed goes on evenly."""
    rig, law = machine(), SpeedLaw(time=(0.0, 0.05, 0.09, 0.16), speed=(300.0, 301.0, 319.0, 321.1))
    expected = stepped(rig, law)
    found = without_contact(rig, law)
    for probe, signal in zip(PROBES, expected, strict=True):
        off = np.abs(found[f"probe_{probe.name}"].values - signal).max()
        assert off < 0.05 * np.abs(signal).max(), (probe.name, off / np.abs(signal).max())


def test_without_contact_the_normal_does_not_matter():
    """Modes and sag follow the speed, whatever integrates the contacts; for collocation piece by piece."""
    probes = [Probe(name=f"at_{node}", node=node, quantity="bearing_force") for node in (1, 7)]
    given = {"start": 240.0, "stop": 300.0, "time": 0.4, "clearance": 1.0, "probes": probes}
    found, known = (
        run_up(machine(), **given, samples_per_revolution=PER_REVOLUTION, normal=normal)
        for normal in ("updated", "fixed")
    )
    for name in ("vertical", "horizontal", "probe_at_1", "probe_at_7"):
        expected = known[name].values
        assert np.abs(found[name].values - expected).max() < 1e-3 * np.ptp(expected), name


def test_pairs_that_part_are_not_struck_again():
    """What modes that follow the speed leave of an overlap as a pair opens makes no chatter of events."""
    law = SpeedLaw(time=(0.0, 0.1, 0.14, 0.24), speed=(300.0, 302.0, 320.0, 323.0))
    recording = Recording(transient=0, revolutions=law.n_revolution, samples_per_revolution=PER_REVOLUTION)
    setup = prepared(machine(8), 323.0, samples=PER_REVOLUTION)
    case = {"recording": recording, "initial": Initial(from_=CONTACT_FREE), **RUB}
    passage, steady = record_run_up(setup, law, **case), run_case(setup, **case)
    assert passage.measures["contact_fraction"].sum() > 1.0
    assert passage.measures["steps"] < 1.1 * steady.measures["steps"]


def test_reversals_are_counted_as_at_constant_speed():
    """Three stators at 200 rad/s: the rim slips backwards several times a revolution, also between pieces."""
    law = SpeedLaw(time=(0.0, 1.0), speed=(200.0, 200.4))
    recording = Recording(transient=0, revolutions=law.n_revolution, samples_per_revolution=PER_REVOLUTION)
    rig = read_rig("mokhtar2017").with_geometry("linear")
    three = replace(rig, stator=(replace(rig.stator[0], count=3),))
    setup = prepared(three, 200.4, samples=PER_REVOLUTION, friction_law="coulomb")
    case = {"recording": recording, "initial": Initial(), "clearance": 60e-6, "friction": 0.3}
    passage, steady = record_run_up(setup, law, **case).measures, run_case(setup, **case).measures
    for name in ("reversals_per_revolution", "contacts_per_revolution", "stick_fraction"):
        assert passage[name] == pytest.approx(steady[name], rel=0.1), name
    assert steady["reversals_per_revolution"].min() > 3.0


EVEN_STEP = 2e-6  # s


def rubbed(rig, law, until, *, is_round=False):
    """Vertical, horizontal and torsional motion at the rim, (3, n_step), and work of friction, J.

    `is_round`: along the line of centres in the middle of each step.
    """
    base = assemble(rig)
    mass, gyroscopic, phasor, load, spinning = system_of(base)
    n, rotor, q = len(mass), base.rotor, len(base.stators)
    lateral, torsion = [rotor.index(9, name) for name in ("v", "w")], rotor.index(9, "thx")
    axis = np.exp(1j * np.array([stator.angle for stator in base.stators]))
    tip = [first + stator.axial for first, stator in zip(base.stator_start, base.stators, strict=True)]
    radius = np.array([stator.radius for stator in base.stators])
    pair = np.arange(q)

    def contacts(u):
        """Gaps (q,), and their slopes and those of the ways of the rim, (q, n)."""
        line = (radius + RUB["clearance"] + u[tip]) * axis - complex(*u[lateral])
        normal = line / abs(line) if is_round else axis
        gap, along = np.zeros((2, q, n))
        gap[:, lateral] = -np.stack([normal.real, normal.imag], axis=1)
        along[:, lateral] = np.stack([-normal.imag, normal.real], axis=1)
        along[:, torsion] = radius
        gap[pair, tip] = (normal * axis.conj()).real
        along[pair, tip] = (normal.conj() * axis).imag
        return (line * normal.conj()).real - radius, gap, along

    h, rate = EVEN_STEP, float(law.acceleration[0])
    spring = whole_system(model_at(base, law.speed[0]), law.speed[0])[2]
    u, v = np.linalg.solve(spring, load - rate * mass @ spinning), np.zeros(n)
    seen, work, held = [], 0.0, -1.0
    for k in range(math.ceil(until / h)):
        seen.append(u[[*lateral, torsion]])
        middle = (k + 0.5) * h
        spin, angle = law.speed[0] + rate * middle, law.speed[0] * middle + rate * middle**2 / 2
        if abs(spin - held) > 0.05:
            held = spin
            _, damper, spring, _ = whole_system(model_at(base, held), held)
            spring = spring + rate * gyroscopic
            inverse = np.linalg.inv(mass + h / 2 * damper + h**2 / 4 * spring)
            by_motion = inverse @ np.hstack([mass - h / 2 * damper - h**2 / 4 * spring, -h * spring])
            still, turned = h * inverse @ (load - rate * mass @ spinning), h * inverse @ phasor
        force = (spin**2 - 1j * rate) * np.exp(1j * angle)
        ahead = by_motion @ np.concatenate([v, u]) + still + (turned * force).real
        opened, gap, along = contacts(u + h / 2 * v)
        closed, impulse = np.flatnonzero(opened <= 0.0), np.zeros(q)
        if closed.size:
            by_impulse = inverse @ (gap - RUB["friction"] * along).T
            met = gap @ by_impulse
        for _ in range(20 if closed.size else 0):
            for i in closed:
                impulse[i] = max(0.0, impulse[i] - (gap[i] @ ahead + met[i] @ impulse) / met[i, i])
        if impulse.any():
            ahead = ahead + by_impulse @ impulse
            slip = [stator.radius * spin for stator in base.stators] + along @ (v + ahead) / 2
            work += RUB["friction"] * float(impulse @ slip)
        u, v = u + h / 2 * (v + ahead), ahead
    return np.array(seen).T, work


@pytest.mark.parametrize(("count", "normal"), [(1, "fixed"), (8, "fixed"), (1, "updated"), (3, "updated")])
def test_rigid_rub_in_a_steep_passage(count, normal):
    """Six revolutions from rest under gravity, speeding up by 90 rad/s2: one stator, and rings."""
    rig, law = machine(count), SpeedLaw(time=(0.0, 0.13), speed=(300.0, 311.7))
    end = float(law.at_angle(12.0 * math.pi)[0])
    steps, work = rubbed(rig, law, end, is_round=normal == "updated")
    found = run_up(
        rig,
        start=300.0,
        stop=311.7,
        time=0.13,
        **RUB,
        normal=normal,
        initial={"from": "rest"},
        samples_per_revolution=PER_REVOLUTION,
    )
    assert (found.contact_fraction[:6] > 0.0).any(dim="stator").sum() >= 5
    n = 6 * PER_REVOLUTION
    times = law.at_angle(2.0 * math.pi * np.arange(n) / PER_REVOLUTION)[0]
    for signal, own in zip(steps, (found.vertical, found.horizontal, found.torsion), strict=True):
        expected = np.interp(times, EVEN_STEP * np.arange(signal.size), signal)
        assert np.linalg.norm(own.values[:n] - expected) < 2e-3 * np.linalg.norm(expected - expected.mean())
    assert float(found.friction_work[:6].sum()) == pytest.approx(work, rel=2e-3)
