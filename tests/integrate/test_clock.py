"""How time is counted, whatever the speed: kernels take steps of whole ticks."""

import math

import pytest
from closed_form import read_rig, simulate
from set_ups import prepared

from rubhpc import InputError
from rubhpc.integrate.modal_setup import CONTACT_STEPS, FINEST_TICK, LONGEST_TURN


def clock(speed: float, samples: int):
    setup = prepared(read_rig("mokhtar2017"), speed, samples=samples)
    return setup.clock


@pytest.mark.parametrize("samples", [16, 100, 128, 1024, 3000])
@pytest.mark.parametrize("speed", [1e-3, 1.0, 150.0, 1e4, 1e6, 1e8, -1e10, 1e14])
def test_steps_are_whole_ticks_and_resolve_a_contact(speed: float, samples: int) -> None:
    counted = clock(speed, samples)
    turn = 2.0 * math.pi / abs(speed)
    assert counted.tick * samples * 2**counted.sample_level == pytest.approx(turn)
    assert counted.tick <= FINEST_TICK
    assert 0 <= counted.contact_level <= counted.sample_level, "a shift by less is undefined"
    longest = counted.tick * 2**counted.contact_level
    assert longest <= min(turn / samples, turn / CONTACT_STEPS) * (1.0 + 1e-12)
    assert (
        2.0 * longest > min(turn / samples, turn / CONTACT_STEPS)
        or counted.contact_level == counted.sample_level
    )
    assert 0 <= counted.search_level <= counted.sample_level


def test_a_speed_at_which_ticks_cannot_be_counted_is_refused() -> None:
    slowest = 2.0 * math.pi / LONGEST_TURN
    assert clock(1.01 * slowest, 128).samples_per_revolution == 128
    with pytest.raises(
        InputError, match=r"too slow for events timed to 0\.19 ns; take 0\.0005 rad/s or more"
    ):
        simulate("mokhtar2017", speed=-0.9 * slowest, clearance="80 um", friction=0.1)
