"""Transients that end where the motion has settled."""

from types import SimpleNamespace

import numpy as np
import pytest
from closed_form import simulate

import rubhpc
from rubhpc.errors import InputError
from rubhpc.integrate.measuring.samples import new_accumulator, no_record
from rubhpc.integrate.periodic_motions import direct, solved_motion
from rubhpc.integrate.periodic_motions.direct import draws_near
from rubhpc.integrate.transient import has_settled
from rubhpc.schema import REGIME
from rubhpc.study.study import Recording

CASE = {"speed_ratio": 0.75, "friction": 0.3, "revolutions": 4}


@pytest.mark.parametrize(("clearance", "period"), [("84 um", 1), ("100 um", 2), ("1 mm", 1)])
def test_record_begins_where_a_long_transient_leads(clearance, period):
    """One of period 2 may begin with either of its cycles."""
    found = simulate("mokhtar2017", transient="auto", clearance=clearance, **CASE)
    settled = simulate("mokhtar2017", transient=400, clearance=clearance, **CASE)
    assert found.period == period
    assert found.transient_revolutions < 150
    distance = [
        np.sqrt(np.mean((np.roll(found.vertical, 256 * n) - settled.vertical) ** 2)) for n in range(period)
    ]
    assert min(distance) < 1e-4 * settled.vertical.std()


def test_tolerance_and_limit_are_kept():
    loose, tight, cut = (
        simulate("mokhtar2017", transient="auto", clearance="84 um", **extra, **CASE).transient_revolutions
        for extra in ({"transient_tolerance": 1e-2}, {"transient_tolerance": 1e-6}, {"transient_limit": 30})
    )
    assert loose < tight
    assert cut == 30
    assert simulate("mokhtar2017", transient=7, clearance="84 um", **CASE).transient_revolutions == 7


def test_central_difference_settles_too():
    found = simulate(
        "mokhtar2017",
        method="central-difference",
        step="2 us",
        transient="auto",
        clearance="84 um",
        speed_ratio=3.0,
        revolutions=1,
        overrides={"stator.youngs_modulus": "1 GPa", "stator.elements": 2},
        transient_tolerance=0.05,
    )
    assert 8 < found.transient_revolutions < 240
    assert (found.transient_revolutions - 1) % 12 in (8, 0)


def test_one_signal_that_changes_has_not_settled():
    cycle = np.array([[1.0, -2.0, 0.5], [1e-6, 3e-6, -1e-6], [0.0, 0.0, 0.0]])
    later = cycle.copy()
    later[1, 2] += 2e-9
    assert has_settled(later, cycle, 1e-3)
    assert not has_settled(later, cycle, 5e-4)


def test_a_signal_that_dies_out_has_settled():
    """Free ringing changes by the same share from cycle to cycle, however small it has become."""
    cycle, decay = np.array([[1.0, -1.0], [2e-5, -2e-5]]), np.array([[1.0], [0.5]])
    assert not has_settled(cycle * decay, cycle, 1e-3)
    assert not has_settled(cycle * decay, cycle, 1e-3, np.array([0.01, 1e-3]))
    assert has_settled(cycle * decay, cycle, 1e-3, np.array([0.01, 1e-2]))


def test_ringing_stators_do_not_prolong_the_transient():
    """After a knock without lasting contact tips and torsion ring down to nothing."""
    found = simulate(
        "mokhtar2017",
        transient="auto",
        clearance="300 um",
        initial={"from": "contact_free", "impulse": "0.1 N*s"},
        **(CASE | {"speed_ratio": 1.5, "friction": 0.1}),
    )
    assert REGIME[found.regime] == "no_contact"
    assert found.settled == 1
    assert 20 < found.transient_revolutions < 100


@pytest.mark.parametrize("key", ["transient_limit", "transient_tolerance"])
def test_keys_of_auto_go_with_it_alone(key):
    value = {"transient_limit": 50, "transient_tolerance": 1e-3}[key]
    with pytest.raises(InputError, match=f"{key}: has no effect without transient"):
        Recording(transient=120, **{key: value})
    assert Recording(transient="auto", **{key: value}).is_transient_auto
    assert Recording(transient="direct", **{key: value}).is_transient_direct
    with pytest.raises(InputError, match=r'or "auto", or "direct"$'):
        simulate("mokhtar2017", transient="long", clearance="84 um", **CASE)
    with pytest.raises(InputError, match=r'transient: "shared" is gone: write transient = "direct"$'):
        simulate("mokhtar2017", transient="shared", clearance="84 um", **CASE)


LIGHT = {
    "overrides": {"rotor.damping.alpha": 4.0},
    "keep": ("section",),
    "samples_per_revolution": 64,
    "revolutions": 6,
}


@pytest.mark.parametrize(
    ("speed_ratio", "clearance_ratio", "friction", "period"),
    [(0.9, 0.523, 0.3, 1), (1.3, 0.968, 0.269, 1), (2.0, 0.637, 0.016, 3), (0.9, 1.5, 0.3, 1)],
)
def test_direct_way_leads_where_a_long_simulation_does(speed_ratio, clearance_ratio, friction, period):
    """A rotor damped by 1 %: in 128 revolutions what 1000 lead to, a shift by revolutions apart."""
    case = {"speed_ratio": speed_ratio, "clearance_ratio": clearance_ratio, "friction": friction} | LIGHT
    found = simulate("mokhtar2017", transient="direct", **case)
    settled = simulate("mokhtar2017", transient=1000, **case)
    assert found.transient_revolutions <= 2 * direct.FIRST
    assert found.period == settled.period == period
    expected = settled.section_vertical
    away = [np.abs(np.roll(found.section_vertical, k) - expected).max() for k in range(period)]
    assert min(away) < 2e-7 * np.abs(expected).max()


def test_direct_way_takes_up_a_motion_that_it_found_too_early(monkeypatch):
    """Found after 64 revolutions, at 0.7 of its size away; followed after 128, and not sought again."""
    solved = []
    shoot = direct.shoot
    monkeypatch.setattr(direct, "shoot", lambda *a, **k: (solved.append(a[3]), shoot(*a, **k))[1])
    case = {"speed_ratio": 3.0, "clearance_ratio": 0.5, "friction": 0.2} | LIGHT
    case["overrides"] = {"rotor.damping.alpha": 0.8}
    found = simulate("mokhtar2017", transient="direct", transient_limit=1000, **case)
    assert 2 * direct.FIRST <= found.transient_revolutions < 5 * direct.FIRST
    assert solved == [2, 2]  # the case returns nearer after two revolutions than after one
    settled = simulate("mokhtar2017", transient=5000, **case)
    away = [np.abs(np.roll(found.section_vertical, k) - settled.section_vertical).max() for k in range(2)]
    assert min(away) < 2e-7 * np.abs(settled.section_vertical).max()


def test_direct_way_does_not_watch_a_motion_that_the_case_knows_nothing_of(monkeypatch):
    """Period 1 is found first, and the case strays from it by more than its distance."""
    solved, watched = [], []
    shoot, watch = direct.shoot, direct.draws_near
    monkeypatch.setattr(direct, "shoot", lambda *a, **k: (solved.append(a[3]), shoot(*a, **k))[1])
    monkeypatch.setattr(direct, "draws_near", lambda *a: (watched.append(a[1].solved.period), watch(*a))[1])
    case = {"speed_ratio": 0.9, "clearance_ratio": 0.523, "friction": 0.3} | LIGHT
    case["overrides"] = {"rotor.damping.alpha": 0.8}
    found = simulate("mokhtar2017", transient="direct", transient_limit=1000, **case)
    assert found.period == 3
    assert (solved, watched) == ([1, 1, 3, 3], [3])  # each once more from rounded numbers


def test_direct_way_meets_a_motion_that_is_reached_exactly():
    """Without contact; the linear theory leaves a distance of 0 to the last bit."""
    case = {"speed": 70.5, "clearance": "100 um", "samples_per_revolution": 1024, "revolutions": 1}
    found, settled = (simulate("mokhtar2017", transient=n, **case) for n in ("direct", 100))
    assert found.transient_revolutions == direct.FIRST
    assert found.section_vertical == pytest.approx(settled.section_vertical, rel=1e-9)


def test_direct_way_goes_on_to_the_limit_where_nothing_is_periodic():
    found = simulate(
        "mokhtar2017", transient="direct", transient_limit=70, clearance_ratio=0.696, speed_ratio=0.75,
        friction=0.014, **LIGHT,
    )  # fmt: skip
    assert found.transient_revolutions == 70
    plain = simulate(
        "mokhtar2017", transient=70, clearance_ratio=0.696, speed_ratio=0.75, friction=0.014, **LIGHT,
    )  # fmt: skip
    assert found.section_vertical == pytest.approx(plain.section_vertical, rel=1e-6)


@pytest.mark.parametrize("restitution", [None, 0.3])
def test_a_record_shorter_than_the_period_is_known_to_be_periodic(restitution):
    case = {"speed_ratio": 2.0, "clearance_ratio": 0.637, "friction": 0.016, "restitution": restitution}
    found = simulate("mokhtar2017", transient="direct", **LIGHT | case | {"revolutions": 2})
    assert (REGIME[found.regime], found.period, found.settled) == ("periodic", 3, 1)
    assert 0.9 < found.largest_multiplier < 1.0


COLLOCATED = [
    {"friction_law": "coulomb", "clearance": "100 um"},
    {"law": "penalty", "stiffness": "1 MN/m"},
    {"law": "hertz", "stiffness": "1e9 N/m^1.5", "friction_law": "stribeck", "static_friction_ratio": 1.3,
     "stribeck_speed": 0.2},
    {"normal": "updated"},
    {"model": None, "friction": 0.1},
]  # fmt: skip


@pytest.mark.parametrize("law", COLLOCATED)
def test_direct_way_is_one_for_every_law(law):
    """A rotor damped by 1 %: the end of 400 revolutions after fewer of them."""
    case = {"speed_ratio": 0.75, "clearance": "84 um", "friction": 0.3} | LIGHT | law
    run = rubhpc.simulate if "model" in case else simulate
    found, settled = (run("mokhtar2017", transient=n, **case) for n in ("direct", 400))
    assert found.transient_revolutions < 240
    assert found.period == settled.period > 0
    assert found.largest_multiplier == pytest.approx(settled.largest_multiplier, rel=1e-3)
    assert found.peak_contact_force == pytest.approx(settled.peak_contact_force, rel=1e-3)
    away = np.abs(found.section_vertical - settled.section_vertical).max()
    assert away < 1e-4 * np.abs(settled.section_vertical).max()


def test_what_simulation_cannot_resolve_has_arrived():
    """Events are resolved to some 1e-9 s, so that no simulation came nearer than 4e-8 of the motion."""
    found = simulate(
        "mokhtar2017", transient="direct", clearance_ratio=0.781, speed_ratio=1.3995, friction=0.379,
        **LIGHT | {"overrides": {"stator.youngs_modulus": "28 GPa"}}, initial=simulate(
            "mokhtar2017", transient=100, clearance_ratio=0.781, speed_ratio=1.3995, friction=0.379,
            **LIGHT | {"overrides": {"stator.youngs_modulus": "28 GPa"}},
        ).final,
    )  # fmt: skip
    assert found.transient_revolutions == direct.FIRST
    assert found.period == 1


class Spiral:
    """A motion about a periodic one whose multipliers are 0.98 e^(+-0.7 i), which it obeys or not."""

    def __init__(self, change, begin=(0.3, 0.0), most=400):
        self.change, self.at, self.most, self.n_revolution = change, np.array(begin), most, 0
        self.passed = np.array([self.at + ORBIT.motion])

    @property
    def n_left(self):
        return self.most - self.n_revolution

    def simulate(self, n_revolution):
        assert n_revolution <= self.n_left
        self.n_revolution += n_revolution
        for _ in range(n_revolution):
            self.at = self.change(self.at)
            self.passed = np.vstack([self.passed, self.at + ORBIT.motion])

    def stay(self):
        """It goes on from where it is."""


TURN = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
ORBIT = SimpleNamespace(motion=np.array([1.0, 0.0]), monodromy=0.98 * TURN, period=1)
STILL = SimpleNamespace(
    n=1,
    setup=SimpleNamespace(spin=1.0, tick=1e-9),
    size=np.linalg.norm,
    energy=np.ones(2),
    bodies=SimpleNamespace(stiffness=np.eye(1)),
)


def candidate():
    return direct.Candidate(STILL, solved_motion.SolvedMotion(STILL, ORBIT))


def size_of(at):
    return float(np.linalg.norm(at))


@pytest.mark.parametrize(
    ("change", "is_expected", "least"),
    [
        (lambda at: 0.98 * TURN @ at, True, 48),  # to half of its distance
        # As fast at first, in the end as linear:
        (lambda at: (0.98 - size_of(at) ** 2 / 9) * TURN @ at, True, 32),
        (lambda at: TURN @ at, False, 16),  # a torus
        # One that beats:
        (lambda at: (1 + 0.1 * np.cos(np.arctan2(at[1], at[0]) / 2)) * TURN @ at, False, 16),
        (lambda at: (0.98 + 0.015 * (size_of(at) > 0.1)) * TURN @ at, False, 100),  # too slow
        # As fast, but it turns the other way: of another motion.
        (lambda at: 0.98 * TURN.T @ at, False, 16),
        (lambda at: (0.98 if size_of(at) > 0.25 else 1.06) * TURN @ at, False, 16),  # it passes by
    ],
)
def test_motion_that_draws_near_loses_its_distance_as_the_linear_theory_says(change, is_expected, least):
    """Those that do not are watched until 100 revolutions, or given up where they disobey the theory."""
    case = Spiral(change)
    is_near, reason = draws_near(case, candidate(), 100)
    assert reason is None
    assert is_near == is_expected
    if is_expected:
        assert case.n_revolution == pytest.approx(least, abs=3)
    else:
        assert case.n_revolution >= least


def test_last_revolutions_show_that_a_motion_draws_near():
    """40 of them: the case is simulated no further."""
    case = Spiral(lambda at: 0.98 * TURN @ at)
    case.simulate(40)
    assert draws_near(case, candidate(), 100) == (True, None)
    assert case.n_revolution == 40


def test_transient_ends_before_a_motion_has_drawn_near():
    case = Spiral(lambda at: 0.98 * TURN @ at, most=12)
    assert draws_near(case, candidate(), 100) == (False, None)
    assert case.n_revolution == 12


def test_transient_of_more_calls_than_a_double_has_doublings():
    """The stride between kernel calls doubled until it was infinite, after 960 of them."""
    found = simulate(
        "mokhtar2017", transient="auto", transient_limit=3600, transient_tolerance=1e-15, clearance="1 mm",
        speed_ratio=0.75, revolutions=1, samples_per_revolution=16, keep=(),
    )  # fmt: skip
    assert found.transient_revolutions == 3600


def test_another_contact_ahead_is_seen():
    """All that 16 revolutions show is a motion of period 1; some time later an impact leads to one of 3."""
    case = {
        "speed_ratio": 4.916663378697454, "clearance_ratio": 0.6121089155906496,
        "friction": 0.159196499531838, "overrides": {"rotor.damping.alpha": 0.6290159617851263},
        "samples_per_revolution": 64, "revolutions": 6, "keep": (),
    }  # fmt: skip
    assert simulate("mokhtar2017", transient="direct", transient_limit=3000, **case).period == 3


LAWS = [
    {},
    {"restitution": 0.5},
    {"law": "penalty", "stiffness": "1 MN/m"},
    {"friction_law": "coulomb"},
    {"friction_law": "coulomb", "law": "penalty", "stiffness": "1 MN/m"},
    {"friction_law": "stribeck", "static_friction_ratio": 1.5, "stribeck_speed": 0.1},
    {"normal": "updated"},
    {"method": "central-difference"},
]


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("transient", [12, "auto", "direct"])
def test_what_is_not_recorded_leaves_the_shared_accumulator_as_it_is(law, transient):
    limit = {"transient_limit": 40} if isinstance(transient, str) else {}
    case = {"speed_ratio": 0.75, "clearance_ratio": 0.6, "transient": transient, "revolutions": 2}
    simulate("mokhtar2017", **case, **limit, **law)
    for shared, new in zip(no_record(1, 1)[1], new_accumulator(1), strict=True):
        np.testing.assert_array_equal(shared, new)
