"""Dry whirl from receptances: closed forms of a disc in a ring, and what does not depend on modes."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from rubhpc import Bore, InputError, Load, Rig, dry_whirl
from rubhpc.fem.assemble import assemble
from rubhpc.fem.dry_whirl import in_words
from rubhpc.fem.receptance import RIGID, Receptance, turning_receptances
from rubhpc.fem.whirl_balance import ROLLING, SLIPPING, Balance
from rubhpc.rig.carriers import Carrier
from rubhpc.rig.normal_law import NormalLaw
from rubhpc.rig.parts import Bearing, Damping, Disc, ShaftSection, Torsion
from rubhpc.rig.rotors import Rotor

K, C, R0 = 0.04, 0.1, 1.05  # of the classics, in units of mass and contact stiffness
SPRING = NormalLaw(kind="penalty", stiffness=1.0)
HARD = NormalLaw()
PLANE = ((1, "v"), (1, "w"), (1, "thx"))
STEEL = {"youngs_modulus": 2.1e11, "shear_modulus": 8e10, "density": 7800.0}


def disc(bore, *, k=K, c=C, **given):
    """A rigid disc of mass 1 on a spring and damper, free to twist on a soft spring, in a bore."""
    stiffness, damping = np.diag([k, k, 1e-3]), np.diag([c, c, 1e-2])
    return Rig.from_matrices(
        np.diag([1.0, 1.0, 1.0]), damping, stiffness, degrees=PLANE, stators=[bore], **given
    )


def listed(found, *names):
    return [tuple(float(found[f"whirl_{name}"][i]) for name in names) for i in range(found.sizes["whirl"])]


@pytest.mark.parametrize(
    ("friction", "frequency", "ratio"), [(0.2, 0.570156, 1.39875), (0.3, 0.427008, 1.16596)]
)
def test_whip_in_a_ring_that_yields_along_the_normal(friction, frequency, ratio):
    """`mu (m w^2 - k) = c w` and `r / r0 = 1 / (1 - (m w^2 - k) / k_s)`; no false forward whirl."""
    bore = Bore(node=1, radius=1e6, rigid=True)
    found = dry_whirl(disc(bore), [1.0], [R0], [friction], law=SPRING)
    slipping = found.isel(whirl=found.whirl_kind.values == SLIPPING)
    ((w, orbit, growth),) = listed(slipping, "frequency", "orbit", "growth_rate")
    assert w == pytest.approx(-frequency, abs=1e-6)
    assert orbit / R0 == pytest.approx(ratio, abs=1e-5)
    assert growth > 0.0, "the threshold between rub and whip"
    assert bool((found.whirl_frequency < 0.0).all())


@pytest.mark.parametrize("seed", range(8))
def test_whip_and_rolling_of_any_disc_in_any_ring(seed):
    """Roots of the polynomial of `Im gamma + mu sgn(s) Re gamma`, which needs no modes."""
    draw = np.random.default_rng(seed)
    k, c, mass, stiffness = draw.uniform(0.01, 1.0), draw.uniform(0.01, 0.5), draw.uniform(0.02, 5.0), 2.0
    damping, gap, radius, mu = 10.0 ** draw.uniform(-3.0, 0.0), draw.uniform(0.3, 2.0), 2.0, 0.5
    spin = draw.choice([-1.0, 1.0]) * draw.uniform(0.3, 4.0)
    ring = Bore(node=1, radius=radius, mass=mass, stiffness=stiffness, damping=damping)
    found = dry_whirl(disc(ring, k=k, c=c), [spin], [gap], [mu], most_frequency=math.inf)
    rim, hole = np.poly1d([-1.0, 1j * c, k]), np.poly1d([-mass, 1j * damping, stiffness])
    product = ((rim + hole) * np.poly1d((rim * hole).coeffs.conj())).coeffs

    def gamma(w):
        return 1.0 / rim(w) + 1.0 / hole(w)

    expected = []
    for sign in (1.0, -1.0):
        roots = np.roots(product.imag + sign * mu * product.real)
        for w in roots[np.abs(roots.imag) < 1e-9].real:
            if gamma(w).real < 0.0 and np.sign(radius * spin + gap * w) == sign:
                expected.append(w)
    is_slipping = found.whirl_kind.values == SLIPPING
    forward = np.sign(spin) * found.whirl_frequency.values
    assert forward[is_slipping] == pytest.approx(np.sort(expected), rel=1e-7)
    rolling = -radius * spin / gap
    value = gamma(rolling)
    rolls = value.real < 0.0 and abs(value.imag) <= -mu * value.real
    assert forward[~is_slipping] == pytest.approx([rolling] * int(rolls))


def test_bodies_without_damping_whirl_at_their_resonances():
    """Of a disc in a hard bore: at its natural frequency, with next to no friction; and it rolls."""
    found = dry_whirl(disc(Bore(node=1, radius=3.0, rigid=True), c=0.0), [1.0], [1.0], [0.1])
    assert found.whirl_frequency.values == pytest.approx([-3.0, -math.sqrt(K)], rel=1e-6)
    assert found.least_friction.item() < 1e-6


def test_whip_needs_the_friction_at_which_the_spring_gives_way():
    """`mu* = (c / k_s) sqrt((k + k_s) / m)`, of a rim that is never too slow to slip."""
    bore = Bore(node=1, radius=1e9, rigid=True)
    found = dry_whirl(disc(bore), [1.0], [R0], law=SPRING)
    assert found.least_friction.item() == pytest.approx(C * math.sqrt(1.0 + K), rel=1e-8)


def test_ring_on_springs_that_friction_pushes_aside():
    """No dry whirl below 0.27929, at 0.3 two: `z = n (r0 + a (1 + i mu))`, of a massless ring."""
    ring = Bore(node=1, radius=1e6, mass=1e-7, stiffness=1.0, damping=1e-9)
    found = dry_whirl(disc(ring), [1.0], [R0], [0.27, 0.3], most_frequency=2.0)
    assert found.least_friction.item() == pytest.approx(0.27929, abs=5e-6)
    assert found.threshold_frequency.item() == pytest.approx(-0.62613, abs=1e-5)
    assert not (found.whirl_friction == 0.27).any()
    (w1, r1), (w2, r2) = listed(found, "frequency", "orbit")
    assert (w1, r1 / R0) == pytest.approx((-0.733838, 1.97307), abs=2e-5)
    assert (w2, r2 / R0) == pytest.approx((-0.514193, 1.28649), abs=2e-5)


@pytest.mark.parametrize("spin", [1.3, -1.3])
def test_a_disc_in_a_hard_bore_rolls_or_slips(spin):
    """Rolling at `-r_d spin / c`; slip at `mu (m w^2 - k) = c w` grows by `2 mu |w| - c / m`."""
    k, c, gap, radius, mu = 0.3, 0.05, 0.7, 1.1, 0.2
    found = dry_whirl(disc(Bore(node=1, radius=radius, rigid=True), k=k, c=c), [spin], [gap], [mu])
    rolls = found.whirl_kind.values == ROLLING
    ((w, orbit, force),) = listed(found.isel(whirl=rolls), "frequency", "orbit", "normal_force")
    assert w == pytest.approx(-radius * abs(spin) / gap), "positive forward, in the sense of the spin"
    assert (orbit, force) == pytest.approx((gap, gap * (w**2 - k)))
    ((slow, growth),) = listed(found.isel(whirl=~rolls), "frequency", "growth_rate")
    assert mu * (slow**2 - k) == pytest.approx(c * abs(slow))
    assert growth == pytest.approx(2 * mu * abs(slow) - c)
    assert found.least_friction.item() == pytest.approx(c * abs(w) / (w**2 - k)), "of rolling"
    assert not bool(found.is_approximate)


def test_force_and_orbit_by_the_law_of_hertz():
    k, c, gap, mu, stiffness = 0.3, 0.05, 0.7, 0.2, 2.0
    bore = Bore(node=1, radius=1e6, rigid=True, law=NormalLaw(kind="hertz", stiffness=stiffness))
    found = dry_whirl(disc(bore, k=k, c=c), [1.0], [gap], [mu])
    slipping = found.isel(whirl=found.whirl_kind.values == SLIPPING)
    ((w, orbit, force),) = listed(slipping, "frequency", "orbit", "normal_force")
    x = brentq(lambda x: stiffness * x**1.5 - (w**2 - k) * (gap + x), 0.0, 10.0, xtol=1e-14)
    assert (orbit, force) == pytest.approx((gap + x, stiffness * x**1.5), rel=1e-9)


def single(mass, damping, stiffness):
    """The receptance of a mass on a spring and damper that turn with nothing."""
    poles = np.roots([mass, damping, stiffness]).astype(complex)
    residue = 1.0 / (mass * (poles[0] - poles[1]))
    return Receptance(pole=poles, residue=np.array([residue, -residue]))


@pytest.mark.parametrize("law", ["penalty", "hertz", "lagrange"])
@pytest.mark.parametrize("kind", [SLIPPING, ROLLING])
def test_growth_rate_is_that_of_the_equations_of_motion(law, kind):
    """Of a rotor that twists and a hole with mass, by differences of the motion in the turning frame.

    Rolling is the limit of a friction that grows fast with the slip, a hard bore that of a stiff spring.
    """
    m, c, k, m_h, c_h, k_h, inertia, c_t, k_t = 1.0, 0.1, 0.04, 0.3, 0.2, 2.0, 0.02, 0.01, 0.05
    mu, gap, radius, spin, viscous = 0.45, 1.0, 0.9, 0.75 if kind == ROLLING else 5.0, 3e5
    stiff, damp = (3e5, 0.0) if law == "lagrange" else (3.0, 0.1)
    contact = HARD if law == "lagrange" else NormalLaw(kind=law, stiffness=stiff, damping=damp)
    rotor, hole = single(m, c, k), single(m_h, c_h, k_h)
    twist = single(inertia, c_t, k_t).scaled(radius**2)
    balance = Balance(rotor, hole, twist, spin=spin, radius=radius, clearance=gap, law=contact)
    whirls = [whirl for whirl in balance.whirls(mu) if whirl.kind == kind]
    assert whirls

    def force(approach, rate):
        spring = approach**1.5 if law == "hertz" else approach
        return stiff * spring * (1.0 + damp * rate) if law == "hertz" else stiff * spring + damp * rate

    def motion(state, w, held, sign):
        (z, dz, h, dh), (angle, turn) = state[:8].view(complex), state[8:]
        d, rate = z - h, dz - dh
        n = d / abs(d)
        N = force(abs(d) - gap, (rate * n.conjugate()).real)
        slip = radius * (spin + turn) + (rate * n.conjugate()).imag
        T = held + viscous * slip if kind == ROLLING else sign * mu * N
        push = (N + 1j * T) * n
        turning = [
            dz - 1j * w * z,
            (-push - c * dz - k * z) / m - 1j * w * dz,
            dh - 1j * w * h,
            (push - c_h * dh - k_h * h) / m_h - 1j * w * dh,
        ]
        return np.append(
            np.array(turning).view(float), [turn, (-radius * T - c_t * turn - k_t * angle) / inertia]
        )

    for whirl in whirls:
        w, rho = whirl.frequency, whirl.radius + (whirl.normal_force / stiff if law == "lagrange" else 0.0)
        T = -whirl.radius * (1.0 / complex((rotor + hole).at(w))).imag
        push = whirl.normal_force + 1j * T
        z, h = -rotor.at(w) * push, hole.at(w) * push
        z = h + rho * (z - h) / abs(z - h)
        planar = np.array([z, 1j * w * z, h, 1j * w * h])
        state = np.append(planar.view(float), [-radius * T / k_t, 0.0])
        steps = 1e-6 * np.eye(state.size)
        sign = np.sign(spin * radius + w * rho)
        columns = [(motion(state + e, w, T, sign) - motion(state - e, w, T, sign)) / 2e-6 for e in steps]
        n = state.size if kind == ROLLING else 8  # the twist does not act on a slip
        values = np.linalg.eigvals(np.array(columns).T[:n, :n])
        expected = np.delete(values, np.abs(values).argmin()).real.max()
        is_limit = kind == ROLLING or law == "lagrange"
        assert balance.growth_rate(whirl) == pytest.approx(expected, rel=1e-4 if is_limit else 1e-6)


def test_stability_needs_no_modes_far_above_the_whirl(monkeypatch):
    """Static flexibility in place of 12 fast modes of 20, against all of them."""
    frequencies = np.geomspace(1.0, 300.0, 20)
    rotor = sum((single(1.0, 0.01 * w, w**2) for w in frequencies[1:]), single(1.0, 0.01, 1.0))
    given = {"spin": 20.0, "radius": 1.0, "clearance": 1.0, "law": HARD, "most_frequency": 1.5}
    balance = Balance(rotor, single(0.5, 0.05, 4.0), RIGID, **given)
    rates = [balance.growth_rate(whirl) for whirl in balance.whirls(0.3)]
    monkeypatch.setattr("rubhpc.fem.whirl_balance._FAST", math.inf)
    whole = Balance(rotor, single(0.5, 0.05, 4.0), RIGID, **given)
    assert rates == pytest.approx([whole.growth_rate(whirl) for whirl in whole.whirls(0.3)], rel=1e-3)
    few, limit = rotor.reduced(30.0), 30.0
    assert (len(few.pole), len(rotor.pole)) == (2 * (frequencies < limit).sum() + 2, 40)
    assert few.residue.sum() == pytest.approx(rotor.residue.sum(), abs=1e-9)
    assert complex(few.at(0.0)) == pytest.approx(complex(rotor.at(0.0)))


@pytest.mark.parametrize("seed", range(6))
def test_no_whirl_is_missed_however_narrow(seed):
    """Against a scan of 40 samples in each width of each of 8 modes, of damping ratios from 1e-7 on."""
    draw = np.random.default_rng(seed)
    frequencies, ratios = np.sort(draw.uniform(1.0, 10.0, 8)), 10.0 ** draw.uniform(-7.0, -1.0, 8)
    modes = [
        single(1.0 / share, 2.0 * ratio * w / share, w**2 / share)
        for w, ratio, share in zip(frequencies, ratios, draw.uniform(0.0, 1.0, 8), strict=True)
    ]
    rotor = sum(modes[1:], modes[0])
    hole = single(0.02, 0.05, 4.0)
    balance = Balance(rotor, hole, RIGID, spin=20.0, radius=1.0, clearance=1.0, law=HARD)
    mu = 0.15
    spread = np.tan(np.linspace(-1.0, 1.0, 4001) * (math.pi / 2 - 1e-4))
    grid = np.concatenate([-w + ratio * w * spread for w, ratio in zip(frequencies, ratios, strict=True)])
    grid = np.unique(np.append(grid[(grid > -20.0) & (grid < 0.0)], np.linspace(-20.0, 0.0, 20001)))
    value = (rotor + hole).at(grid)
    excess = value.imag + mu * value.real
    at = np.flatnonzero((excess[:-1] * excess[1:] < 0.0) & (value.real[:-1] < 0.0))
    found = [whirl.frequency for whirl in balance.whirls(mu) if whirl.kind == SLIPPING]
    assert len(found) == at.size > 0
    assert np.all((grid[at] <= found) & (found <= grid[at + 1]))


def shaft(*stators, **changed):
    """A shaft with gyroscopic discs on isotropic bearings."""
    bearing = {"stiffness": 2e6, "damping": 800.0}
    given = {
        "shaft": (ShaftSection(length=0.8, outer_diameter=0.03, elements=6, **STEEL),),
        "disc": (Disc(node=1, diameter=0.3, thickness=0.03, density=7800.0),),
        "bearing": (Bearing(node=3, **bearing), Bearing(node=7, **bearing)),
        "torsion": Torsion(fixed_node=7),
        "damping": Damping(alpha=5.0),
    }
    return Rig(name="shaft", rotor=Rotor(**(given | changed)), stator=stators)


def test_whirl_of_a_machine_balances_all_degrees_of_freedom():
    """`rho = -gamma (N + i T)` with gamma by one linear solve of the full matrices."""
    bore = Bore(node=1, mass=2.0, stiffness=3e6, damping=100.0)
    rig, spin, gap, mu = shaft(bore, Bore(node=5, radius=0.015, rigid=True)), 300.0, 2e-4, 0.4
    found = dry_whirl(rig, [spin], [gap], [mu])
    body = assemble(rig).rotor
    some = found.isel(whirl=np.flatnonzero((found.whirl_stator == 1) & (found.whirl_kind == SLIPPING)))
    assert some.sizes["whirl"] >= 2
    for w, force in listed(some, "frequency", "normal_force"):
        rows = [body.index(1, "v"), body.index(1, "w")]
        push = np.zeros(body.n_dof, dtype=complex)
        push[rows] = 1.0, -1j
        dynamic = body.stiffness - w**2 * body.mass + 1j * w * (body.damping + spin * body.gyroscopic)
        response = np.linalg.solve(dynamic, push)[rows]
        gamma = (response[0] + 1j * response[1]) / 2 + 1.0 / (3e6 - w**2 * 2.0 + 1j * w * 100.0)
        assert -gamma * force * (1.0 + 1j * mu) == pytest.approx(gap, rel=1e-8)
    assert not bool(found.is_approximate.any())


def test_mean_of_an_anisotropic_body_or_a_shaft_off_the_centre_is_approximate():
    bore = Bore(node=1, rigid=True)
    uneven = (
        Bearing(node=3, kyy=2e6, kzz=3e6, cyy=800.0, czz=800.0),
        Bearing(node=7, stiffness=2e6, damping=800.0),
    )
    springs = {"mass": 1.0, "stiffness_y": 1e6, "stiffness_z": 2e6, "damping": 50.0}
    for rig in (
        shaft(bore, bearing=uneven),
        shaft(Bore(node=1, **springs)),
        shaft(bore, load=(Load(node=1, vertical=-20.0),)),
        shaft(replace(bore, centre=(1e-5, 0.0))),
    ):
        found = dry_whirl(rig, [300.0], [2e-4], [0.3])
        assert bool(found.is_approximate.all())
        assert in_words(found)[0].endswith("(approximate).")
    mean = turning_receptances(assemble(shaft(bore, bearing=uneven)).rotor, [(0, 1)])
    assert mean[0].is_mean


def test_bores_of_their_own_friction_and_on_a_carrier():
    bore = Bore(node=1, rigid=True)
    on = Carrier(name="casing", mass=20.0, stiffness=5e6, damping=500.0)
    alone = dry_whirl(shaft(Bore(node=1, mass=20.0, stiffness=5e6, damping=500.0)), [300.0], [2e-4])
    carried = dry_whirl(
        replace(shaft(), stator=(replace(bore, carrier="casing"),), carrier=(on,)), [300.0], [2e-4]
    )
    assert carried.least_friction.item() == pytest.approx(alone.least_friction.item(), rel=1e-9)
    plain, slick = (dry_whirl(shaft(replace(bore, friction_factor=f)), [300.0], [2e-4]) for f in (1.0, 0.5))
    assert slick.least_friction.item() == pytest.approx(2.0 * plain.least_friction.item())
    none = dry_whirl(shaft(replace(bore, friction_factor=0.0)), [300.0], [2e-4], [0.3])
    assert math.isinf(none.least_friction.item())
    assert not none.sizes["whirl"]


def test_what_cannot_be_asked_for():
    with pytest.raises(InputError, match="rig shaft: has no bore; add a"):
        dry_whirl(shaft(), [300.0], [2e-4])
    bore = Bore(node=1, rigid=True, clearance_offset=-3e-4)
    with pytest.raises(InputError, match=r"stator 1 has a radial clearance of -0\.0001 m; give one above 0"):
        dry_whirl(shaft(bore), [300.0], [2e-4])
    with pytest.raises(InputError, match="clearance: missing"):
        dry_whirl(shaft(bore))
