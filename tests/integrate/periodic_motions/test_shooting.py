"""Why a search for a periodic motion ends without one."""

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

import rubhpc
from rubhpc.errors import NoPeriodicMotion
from rubhpc.integrate import periodic_motion
from rubhpc.integrate.periodic_motions.shooting import NEAR_GRAZING, _grazing, shoot

CASE = {"speed_ratio": 0.75, "clearance": "84 um", "friction": 0.3, "transient": 5, "keep": ()}


@pytest.mark.parametrize(
    ("limit", "text"),
    [
        ({"most_events": 1}, "more than 1 events in a revolution"),
        ({"most_residual": 1e-12}, "the beginning is far from closing, residual "),
        ({"most_iterations": 1}, "no convergence within 1 iterations, residual "),
    ],
)
def test_limit_that_is_reached_is_named(monkeypatch, limit, text):
    monkeypatch.setattr(periodic_motion, "shoot", partial(shoot, **limit))
    monkeypatch.setattr(periodic_motion, "SPANS", ())
    with pytest.raises(NoPeriodicMotion, match=text):
        rubhpc.periodic("mokhtar2017", **CASE)


def test_contact_that_grazes_is_named():
    """A touch far slower than the others."""

    def trial(*speeds):
        pieces = [SimpleNamespace(approach=np.array([speed])) for speed in speeds]
        return SimpleNamespace(revolutions=[SimpleNamespace(pieces=pieces)])

    assert _grazing(trial(0.4, 0.3 * NEAR_GRAZING)) == (
        ": a contact grazes, its speed of approach is 3e-05 m/s"
    )
    assert _grazing(trial(0.4, 0.3)) == _grazing(trial()) == ""
