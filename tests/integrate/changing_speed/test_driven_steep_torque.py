"""A drive whose torque falls steeply with the speed, as a motor's at its synchronous speed."""

import math

import numpy as np
import pytest
from closed_form import read_rig, run_up
from scipy.optimize import brentq

from rubhpc import assemble
from rubhpc.fem.free_spin import unit_rotation

INERTIA, FIRST, HELD = 1e-3, 1450.0 * math.pi / 30.0, 1500.0 * math.pi / 30.0  # kg m^2, rad/s


@pytest.mark.parametrize("torque", [1.0, 10.0, 100.0, 1000.0])  # at 100 rpm from the speed that it holds
def test_the_spin_approaches_the_speed_that_the_drive_holds(torque):
    rotor = assemble(read_rig("mokhtar2017")).rotor
    one = unit_rotation(rotor)
    rate = torque / (100.0 * math.pi / 30.0) / (one @ rotor.mass @ one + INERTIA)  # 1/s
    found = run_up(
        "mokhtar2017",
        drive={
            "torque": [torque, -torque],
            "speed": ["1400 rpm", "1600 rpm"],
            "start": FIRST,
            "revolutions": 6,
            "inertia": INERTIA,
        },
        clearance=1.0,
        friction=0.0,
        samples_per_revolution=64,
    )

    def turned(time):
        return HELD * time + (FIRST - HELD) / rate * (1.0 - math.exp(-rate * time))

    times = [brentq(lambda t, k=k: turned(t) - 2.0 * math.pi * k, 0.0, 1.0) for k in range(7)]
    expected = 2.0 * math.pi / np.diff(times)
    assert found["speed"].values == pytest.approx(expected, rel=1e-4)
    assert found.attrs["last_speed"] == pytest.approx(
        HELD - (HELD - FIRST) * math.exp(-rate * times[-1]), rel=1e-5
    )
    assert found.attrs["energy_residual"] < 1e-9
