"""Branches of motions without closed form: against the closed form where one exists, and of bent stators."""

import closed_form
import numpy as np
import pytest

import rubhpc
from rubhpc.integrate.periodic_motions.tolerances import BY_STEPS

CASE = {"speed_ratio": 0.75, "friction": 0.3, "keep": ()}
# Slips do not reverse, so that Coulomb's law, without closed form, is steady sliding, which has one. With all
# modes in both, what is left is of the steps.
LAWS = {"accuracy": 1e-7}, {"accuracy": 1e-7, "friction_law": "coulomb"}
SPAN = {"along": "clearance", "start": "100 um", "stop": "124 um", "largest_step": "4 um", "period": 2}
BENT = {"normal": "updated", "friction_law": "coulomb", "overrides": {"stator.geometry": "second_order"}}


@pytest.fixture(scope="module")
def both():
    return [closed_form.branch("mokhtar2017", **SPAN, **CASE, **law) for law in LAWS]


def test_branches_and_events_are_those_of_the_closed_form(both):
    exact, found = both
    assert [branch.period for branch in found] == [branch.period for branch in exact] == [2, 1, 2]
    for branch, expected in zip(found, exact, strict=True):
        assert branch.end == expected.end
        assert [name for name, _ in branch.events()] == [name for name, _ in expected.events()]
        values, known = ([value for _, value in one.events()] for one in (branch, expected))
        assert values == pytest.approx(known, abs=BY_STEPS.located * 24e-6)


def test_multipliers_are_those_of_the_closed_form(both):
    exact, found = (next(branch for branch in one if branch.period == 1) for one in both)
    values = np.linspace(1.05e-4, 1.2e-4, 4)
    largest = [
        np.interp(values, branch.values, [abs(point.multipliers[0]) for point in branch.points])
        for branch in (exact, found)
    ]
    assert largest[1] == pytest.approx(largest[0], abs=2e-5)


def test_a_fold_is_located():
    given = {"along": "speed_ratio", "start": 0.7495, "stop": 0.752, "largest_step": 0.001, "period": 2}
    exact, found = (
        closed_form.branch(
            "mokhtar2017", clearance="100 um", friction=0.3, doublings=0, keep=(), **given, **law
        )[0].events()
        for law in LAWS
    )
    assert [name for name, _ in found] == [name for name, _ in exact]
    assert dict(found)["fold"] == pytest.approx(dict(exact)["fold"], abs=1e-8)


def test_a_bent_stator_with_stick_branches():
    """Beyond the doubling the motion of one revolution is unstable; the contact-free one grazes."""
    span = SPAN | {"start": "118 um", "period": 1, "largest_step": "2 um"}
    once, twice = rubhpc.branch("mokhtar2017", **span, **CASE, **BENT)
    assert (once.period, twice.period) == (1, 2)
    (doubling, there), (grazing, at) = once.events()
    assert (doubling, grazing) == ("period_doubling", "grazing")
    assert there == pytest.approx(1.22058891e-4, abs=1e-10)
    point = once.points[1]
    motion = rubhpc.periodic("mokhtar2017", clearance=point.value, initial=point.state, **CASE, **BENT)
    assert motion.multipliers[0] == pytest.approx(point.multipliers[0], abs=1e-4)
    assert at > point.value


def test_hertz_contact_branches_along_friction():
    (found,) = rubhpc.branch(
        "mokhtar2017", along="friction", start=0.1, stop=0.3, largest_step=0.1, speed_ratio=0.75,
        clearance="84 um", law="hertz", stiffness="1e9 N/m^1.5", keep=(), overrides=BENT["overrides"],
    )  # fmt: skip
    assert (found.end, found.values[-1]) == ("the range ends", 0.3)
    data = found.to_dataset()
    assert data.stability.values.all()
    assert np.isfinite(data.peak_contact_force.values).all()


@pytest.mark.parametrize("ratio", [0.75, 1.3])
def test_the_least_force_is_that_of_the_closed_form(ratio):
    exact, found = (
        closed_form.periodic("mokhtar2017", **CASE | {"speed_ratio": ratio, "clearance": "20 um"}, **law)
        for law in LAWS
    )
    assert found.least_force == pytest.approx(exact.least_force, rel=0.01)
    assert found.least_gap == pytest.approx(exact.least_gap, rel=1e-4)
