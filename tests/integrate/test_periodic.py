"""Periodic motions of the packaged rig: found, recorded, stable or not."""

import numpy as np
import pytest
from closed_form import branch, periodic, simulate

from rubhpc import NoPeriodicMotion, RubError
from rubhpc.errors import InputError
from rubhpc.schema import REGIME

BITES = {"speed_ratio": 0.75, "clearance": "100 um"}


def test_solution_is_what_a_long_simulation_settles_on():
    motion = periodic("mokhtar2017", **BITES, period=2)
    record = simulate("mokhtar2017", **BITES, transient=200, revolutions=2)
    assert (motion.period, motion.is_stable, record.period) == (2, True, 0)
    assert motion.residual < 1e-10
    for name in ("vertical", "horizontal", "torsion", "contact_force", "spectrum_torsion"):
        found, expected = getattr(motion.record, name), getattr(record, name)
        assert found == pytest.approx(expected, abs=2e-6 * np.abs(expected).max())
    assert motion.record.peak_contact_force == pytest.approx(record.peak_contact_force, rel=1e-6)
    assert motion.record.regime == REGIME.index("periodic")
    assert motion.record.lyapunov_exponent == pytest.approx(np.log(abs(motion.multipliers[0])) / 2)
    assert [event.kind for event in motion.events] == ["touch", "release"] * 2
    assert np.array_equal(np.abs(motion.multipliers), np.sort(np.abs(motion.multipliers))[::-1])


def test_shortest_period_is_found_and_records_repeat():
    motion = periodic("mokhtar2017", **BITES, period=4, repeat=3)
    assert motion.period == 2
    assert motion.record.vertical.size == 3 * 2 * 256
    assert np.array_equal(motion.record.vertical[:512], motion.record.vertical[512:1024])
    amplitude = motion.record.spectrum_vertical
    assert amplitude[np.arange(amplitude.size) % 3 != 0].max() < 1e-9 * amplitude.max()


def test_two_motions_of_one_case():
    """Besides the motion that repeats itself after two revolutions there is a stable one of a single."""
    twice = periodic("mokhtar2017", **BITES, period=2)
    once = periodic("mokhtar2017", **BITES, period=1, initial=twice.state)
    assert (once.period, once.is_stable) == (1, True)
    assert simulate("mokhtar2017", **BITES, initial=once.state, transient=20, revolutions=4).period == 1


SOFT = {"law": "penalty", "stiffness": "5 MN/m"}
LAWS = {
    "sliding": {},
    "coulomb": {"friction_law": "coulomb"},
    "restitution": {"restitution": 0.5},
    "penalty": SOFT,
    "damped penalty": SOFT | {"damping": "20 N*s/m"},
    "penalty and coulomb": SOFT | {"friction_law": "coulomb"},
}
RUBS = {"speed_ratio": 1.1, "friction": 0.1, "overrides": {"stator.youngs_modulus": "30 GPa"}, "keep": ()}


def assert_ends_where_it_starts(state, record):
    for end, start in (
        (record.final.displacement, state.displacement),
        (record.final.velocity, state.velocity),
        (record.final.contact_force, state.contact_force),
    ):
        assert end == pytest.approx(start, abs=1e-6 * max(np.abs(start).max(), 1e-6))


@pytest.mark.parametrize("law", LAWS)
def test_record_ends_where_it_starts(law):
    """Under the penalty in contact, which is closed at the angle 0."""
    motion = periodic("mokhtar2017", **RUBS, clearance="100 um", **LAWS[law], accuracy=1e-7)
    assert_ends_where_it_starts(motion.state, motion.record)
    assert bool(motion.state.contact_force.any()) == ("penalty" in law)
    if law == "penalty":
        assert motion.record.peak_contact_force == pytest.approx([155.74], abs=0.01)


def test_records_of_a_branch_end_where_they_start():
    (found,) = branch(
        "mokhtar2017", **RUBS, along="clearance", start="100 um", stop="98 um", largest_step="2 um", **SOFT,
        accuracy=1e-7,
    )  # fmt: skip
    for i, point in enumerate(found.points):
        assert point.state.contact_force.any()
        assert_ends_where_it_starts(point.state, found.record(i))


def test_motion_without_contact_is_the_steady_response():
    motion = periodic("mokhtar2017", speed_ratio=0.75, clearance="300 um", period=1)
    assert motion.iterations <= 1
    assert motion.events == ()
    assert motion.record.regime == REGIME.index("no_contact")
    amplitude = motion.record.contact_free_amplitude
    assert motion.record.peak_to_peak_vertical == pytest.approx(2 * amplitude, rel=1e-3)
    assert motion.least_gap == pytest.approx([3e-4 - amplitude], rel=1e-2)
    assert np.isinf(motion.least_force).all()


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"period": 0}, "period: 0 is out of range; it must be from 1 to 64"),
        ({"period": 1.5}, "periodic: period: 1.5 is not a whole number"),
        ({"period": "2"}, "periodic: period: .2. is not a whole number"),
        ({"repeat": 2.5}, "periodic: repeat: 2.5 is not a whole number"),
        ({"repeat": 0}, "repeat: 0 is out of range"),
        ({"method": "central-difference"}, "it needs .integrator. method"),
        ({"initial": 1.0}, "periodic: initial: 1.0 is neither a State nor a dict"),
        ({"frction": 0.2}, "periodic: frction: unknown argument; did you mean friction"),
        ({"slip_speed": ["0 m"]}, "periodic: slip_speed: value 1: "),
    ],
)
def test_bad_arguments_are_refused(arguments, text):
    with pytest.raises(InputError, match=text) as caught:
        periodic("mokhtar2017", **BITES | arguments)
    assert "\n" not in str(caught.value)


def test_failure_says_why():
    """Near the onset of chaos at 30 GPa nothing of seven revolutions is found."""
    case = {"speed_ratio": 4.55, "clearance_ratio": 0.7, "friction": 0.3}
    with pytest.raises(NoPeriodicMotion, match="no motion of period 7 was found: ") as caught:
        periodic("mokhtar2017", **case, overrides={"stator.youngs_modulus": "30 GPa"}, period=7, transient=30)
    assert isinstance(caught.value, RubError)
