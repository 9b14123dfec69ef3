"""Why a search for a periodic motion ends without one."""

from functools import partial

import pytest
from closed_form import periodic, read_rig, simulate
from equal_stators import in_ring

from rubhpc.errors import NoPeriodicMotion
from rubhpc.integrate import periodic_motion
from rubhpc.integrate.periodic_motions.shooting import shoot

CASE = {"speed_ratio": 0.75, "clearance": "84 um", "friction": 0.3, "transient": 5, "keep": ()}


@pytest.mark.parametrize(
    ("limit", "text"),
    [
        ({"most_events": 1}, "more than 1 events in a revolution"),
        ({"most_residual": 1e-12}, "the initial state is far from periodic, residual "),
        ({"most_iterations": 1}, "no convergence within 1 iterations at a residual of "),
    ],
)
def test_limit_that_is_reached_is_named(monkeypatch, limit, text):
    monkeypatch.setattr(periodic_motion, "shoot", partial(shoot, **limit))
    monkeypatch.setattr(periodic_motion, "SPANS", ())
    with pytest.raises(NoPeriodicMotion, match=text):
        periodic("mokhtar2017", **CASE)


def test_motion_that_the_last_step_closes_is_found(monkeypatch):
    needed = periodic("mokhtar2017", **CASE).iterations
    assert needed > 1
    monkeypatch.setattr(periodic_motion, "SPANS", ())
    for allowed in (needed, needed - 1):
        monkeypatch.setattr(periodic_motion, "shoot", partial(shoot, most_iterations=allowed))
        if allowed < needed:
            with pytest.raises(NoPeriodicMotion, match="no convergence"):
                periodic("mokhtar2017", **CASE)
        else:
            assert periodic("mokhtar2017", **CASE).iterations == needed


@pytest.mark.parametrize(
    ("speed_ratio", "clearance_ratio", "restitution", "friction", "period"),
    [
        (3.4296531943401862, 0.9999991992188095, 0.4939844811586281, 0.020656714440243987, 2),
        (2.7741097412215225, 0.9999996466041114, 0.3603394111113876, 0.06254780995066507, 1),
    ],
)
def test_motion_that_has_just_touched_grazes(speed_ratio, clearance_ratio, restitution, friction, period):
    """Rebounds from millionths of the clearance: no motion of such a period is left there.

    The accuracy is that of the modes for which the clearances were found.
    """
    with pytest.raises(
        NoPeriodicMotion, match=r"a contact grazes, its speed of approach is .*e-0[56] m/s; give"
    ):
        periodic(
            "mokhtar2017", speed_ratio=speed_ratio, clearance_ratio=clearance_ratio, friction=friction,
            restitution=restitution, period=period, transient=1, initial={"from": "contact_free"}, keep=(),
            samples_per_revolution=32, accuracy=2e-3,
        )  # fmt: skip


def test_whip_of_more_than_a_thousand_events_in_a_slow_revolution(monkeypatch):
    """Three stators are rolled around 105 times, each with a touch, a stick, a slip and a release."""
    rig = in_ring(read_rig("mokhtar2017"), 3)
    case = {
        "speed_ratio": 0.03, "clearance": "3 um", "friction": 0.5, "friction_law": "coulomb", "keep": (),
        "samples_per_revolution": 256,
    }  # fmt: skip
    whip = simulate(rig, transient=2, revolutions=1, initial={"vertical_velocity": 0.5}, **case)
    assert whip.contacts_per_revolution.sum() > 250
    monkeypatch.setattr(periodic_motion, "SPANS", ())  # seconds later it is the same
    with pytest.raises(NoPeriodicMotion, match="more than 1000 events in a revolution; give another period"):
        periodic(rig, initial=whip.final, **case)
