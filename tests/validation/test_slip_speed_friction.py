"""Friction that depends on the slip speed: an oscillator on a moving rim and its equation."""

import math

import numpy as np
import pytest
from closed_form import Contact, simulate
from scipy.integrate import solve_ivp
from test_coulomb import PRESSED, pressed_onto_a_rim

from rubhpc import Rig
from rubhpc.errors import InputError
from rubhpc.kernels import laws
from rubhpc.kernels._jit import plain
from rubhpc.rig.rotors import Load
from rubhpc.rig.stators import LumpedStator

RIM, FRICTION, DURATION = 0.5, 0.2, 1.2  # m/s, 1, s
STRIBECK = Contact(friction_law="stribeck", static_friction_ratio=2.0, stribeck_speed=0.2)
TABLE = Contact(friction_law="table", slip_speed=(0.0, 0.3, 0.8), friction_ratio=(1.8, 1.5, 0.9))
RATIO = {
    "stribeck": lambda slip: 1.0 + np.exp(-slip / 0.2),
    "table": lambda slip: np.interp(slip, TABLE.slip_speed, TABLE.friction_ratio),
}


@pytest.mark.parametrize("scheme", ["central-difference", "modal"])
@pytest.mark.parametrize("contact", [STRIBECK, TABLE], ids=lambda contact: contact.friction_law)
def test_a_falling_coefficient_feeds_a_vibration(contact, scheme):
    """1 kg on 100 N/m slides on the rim; the coefficient falls with the slip, and the swing grows."""
    ratio = RATIO[contact.friction_law]
    middle = -FRICTION * float(ratio(RIM)) * PRESSED / 100.0
    record = pressed_onto_a_rim(
        contact,
        FRICTION,
        RIM,
        scheme,
        horizontal=middle,
        velocity=0.05,
        duration=DURATION,
        per_revolution=4000,  # the coefficient is that of the slip before a step: first order
        step=4e-5,
    )

    def motion(_, state):
        w, rate = state
        slip = RIM + rate
        assert slip > 0.0
        return [rate, -100.0 * w - FRICTION * ratio(slip) * PRESSED]

    times = np.arange(4000) * DURATION / 4000
    exact = solve_ivp(
        motion, (0.0, DURATION), [middle, 0.05], t_eval=times, rtol=1e-10, atol=1e-12, max_step=1e-3
    )
    assert record.horizontal == pytest.approx(exact.y[0], abs=1e-5)
    assert abs(record.horizontal[-1400:] - middle).max() > 1.2 * abs(record.horizontal[:1400] - middle).max()
    assert record.energy_residual < 1e-4


@pytest.mark.parametrize("contact", [STRIBECK, TABLE], ids=lambda contact: contact.friction_law)
def test_stick_and_slip(contact):
    """Stick holds up to the coefficient of rest; the slide after it obeys the law, until the slip stops."""
    rim, ratio = 0.1, RATIO[contact.friction_law]
    rest = FRICTION * float(ratio(0.0)) * PRESSED / 100.0
    record = pressed_onto_a_rim(
        contact,
        FRICTION,
        rim,
        "modal",
        horizontal=0.0,
        velocity=-rim,
        duration=3.0,
        per_revolution=3000,
        step=4e-5,
    )

    def slide(_, state):
        return [state[1], -100.0 * state[0] - FRICTION * ratio(max(rim + state[1], 0.0)) * PRESSED]

    def stopped(time, state):
        return rim + state[1] if time > 0.01 else 1.0

    stopped.terminal = True
    cycle = solve_ivp(slide, (0.0, 2.0), [-rest, -rim + 1e-9], events=stopped, rtol=1e-10, atol=1e-12)
    w = record.horizontal
    assert w.min() == pytest.approx(cycle.y[0].min(), rel=2e-3)
    period = cycle.t[-1] + (cycle.y[0, -1] + rest) / rim  # the slide, and the way back with the rim
    turns = np.flatnonzero((w[1:-1] > w[:-2]) & (w[1:-1] >= w[2:])) * 1e-3
    assert len(turns) > 2
    assert np.diff(turns) == pytest.approx(np.full(len(turns) - 1, period), rel=5e-3)
    assert record.stick_fraction[0] > 0.05


def test_stick_of_a_slow_cycle_at_the_default_step():
    """In 0.25 us a slow mass slips by less than the last bits of its position: that is no reversal."""
    mass, spring, pressed, rim, rest = 0.7, 450.0, 6.0, 0.2, 1.6
    held = rest * 0.25 * pressed / spring

    def slide(_, state):
        ratio = 1.0 + (rest - 1.0) * np.exp(-max(rim - state[1], 0.0) / 0.15)
        return [state[1], (0.25 * ratio * pressed - spring * state[0]) / mass]

    def stopped(time, state):
        return rim - state[1] if time > 1e-3 else 1.0

    stopped.terminal = True
    cycle = solve_ivp(slide, (0.0, 2.0), [held, rim - 1e-9], events=stopped, rtol=1e-10, atol=1e-13)
    stuck = (held - cycle.y[0, -1]) / rim
    spin = 2 * math.pi / (cycle.t[-1] + stuck)
    rig = Rig.from_matrices(
        np.diag([mass, mass]),
        np.zeros((2, 2)),
        np.diag([1e4, spring]),
        degrees=[(1, "v"), (1, "w")],
        stators=LumpedStator(node=1, rigid=True, radius=rim / spin),
        load=Load(node=1, vertical=pressed + 1.0),
    )
    record = simulate(
        rig,
        speed=spin,
        clearance=1e-4,
        friction=0.25,
        friction_law="stribeck",
        static_friction_ratio=rest,
        stribeck_speed=0.15,
        transient=0,
        revolutions=1,
        keep=("waveform",),
        initial={"horizontal": -held, "horizontal_velocity": -0.9999 * rim},
    )
    assert record.stick_fraction[0] == pytest.approx(stuck * spin / (2 * math.pi), rel=2e-3)
    assert record.reversals_per_revolution[0] == 0.0
    assert abs(record.horizontal).max() == pytest.approx(cycle.y[0].max(), rel=1e-3)


def test_limits_are_coulombs_law():
    """A table without a slope, and a decay within 10 nm/s, on the packaged rig."""
    given = {
        "speed_ratio": 0.75,
        "clearance": "84 um",
        "transient": 1,
        "revolutions": 2,
        "method": "central-difference",
    }
    coulomb = simulate("mokhtar2017", friction_law="coulomb", **given)
    flat = simulate(
        "mokhtar2017", friction_law="table", slip_speed=[0.0, 1.0], friction_ratio=[1.0, 1.0], **given
    )
    steep = simulate(
        "mokhtar2017", friction_law="stribeck", static_friction_ratio=2.0, stribeck_speed=1e-8, **given
    )
    for record in (flat, steep):
        np.testing.assert_array_equal(record.signals["torsion"], coulomb.signals["torsion"])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"friction_law": "stribeck"}, 'static_friction_ratio: missing; friction_law = "stribeck" needs one'),
        ({"friction_law": "stribeck", "static_friction_ratio": 1.2}, "stribeck_speed: missing"),
        ({"friction_law": "table", "slip_speed": [0, 1]}, "friction_ratio: missing"),
        ({"friction_law": "table", "slip_speed": [0.1, 1], "friction_ratio": [1, 1]}, "does not rise from 0"),
        ({"friction_law": "table", "slip_speed": [0, 1, 1], "friction_ratio": [1, 1, 1]}, "does not rise"),
        (
            {"friction_law": "table", "slip_speed": [0, 1], "friction_ratio": [1]},
            "1 values for 2 slip speeds",
        ),
        ({"friction_law": "table", "slip_speed": [0, 1], "friction_ratio": [1, -1]}, "at least 0"),
        ({"friction_law": "coulomb", "stribeck_speed": 0.1}, "stribeck_speed: other laws have no such speed"),
        ({"static_friction_ratio": 1.2}, 'this law has no such ratio; set friction_law = "coulomb"'),
    ],
)
def test_keys_that_do_not_agree_are_refused(given, message):
    with pytest.raises(InputError, match=message):
        simulate("mokhtar2017", speed_ratio=0.75, clearance=1e-4, **given)


def test_kernel_and_python_interpolate_alike():
    at, values = np.array([0.0, 0.3, 0.8]), np.array([1.8, 1.5, 0.9])
    law = laws.Law(friction_law=laws.TABLE, slip_speed=at, friction_ratio=values)
    for x in (0.0, 0.1, -0.2, 0.3, 0.79, 0.8, 5.0, -math.pi):
        ratio, slope = plain(laws.sliding_friction)(law, 0.5, x)
        assert ratio == pytest.approx(0.5 * np.interp(abs(x), at, values), rel=1e-15)
        beside = plain(laws.sliding_friction)(law, 0.5, x + 1e-6)[0]
        assert slope == pytest.approx((beside - ratio) / 1e-6, abs=1e-9)
