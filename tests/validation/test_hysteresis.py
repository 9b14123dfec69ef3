"""Two motions at one speed: a rotor in a ring of springs, whose jumps up and down are known in closed form.

Down: the contact-free orbit lasts as long as it fits into the ring. Up: the rub lasts to the fold of

    |r + H(w) F(r)| = |free orbit(w)|,  F = n k / (2 pi) (r (a + sin a cos a) - 2 g sin a),  cos a = g / r,

H the receptance of the rotor to a force that turns with it, F the force of n springs k of which those on the
half arc a to either side of the deflection are pressed (Winkler's foundation; without friction or inertia).
"""

import math
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from closed_form import Contact, periodic, read_rig
from scipy.optimize import brentq

from rubhpc import LumpedStator, State, assemble, run
from rubhpc.fem.response import first_lateral_frequency, steady_response
from rubhpc.study.axis_reading import make_axis
from rubhpc.study.study import Study
from rubhpc.study.tables import Recording

COUNT, STIFFNESS, CLEARANCE = 8, 1e5, 3e-4
SPRINGS = LumpedStator(node=8, radius=0.06, count=COUNT, mass=1e-3, damping=2.0, stiffness=STIFFNESS)
RIG = replace(read_rig("mokhtar2017"), stator=(SPRINGS,))
STEP = 0.01


def closed_form():
    """Of a speed ratio: the contact-free amplitude, and by how much a radius is off the balance of forces."""
    model = assemble(RIG)
    rotor, natural = model.rotor, first_lateral_frequency(model)
    rows = [rotor.index(8, name) for name in ("v", "w")]
    lateral = np.isin(rotor.part, rotor.part[rows])
    turning = np.zeros(rotor.n_dof, dtype=complex)
    turning[rows] = 1.0, -1j
    radius = CLEARANCE * np.geomspace(1 + 1e-9, 30, 20_000)
    half = np.arccos(CLEARANCE / radius)
    force = radius * (half + np.sin(half) * np.cos(half)) - 2 * CLEARANCE * np.sin(half)
    force *= COUNT * STIFFNESS / (2 * math.pi)

    def free(ratio: float) -> float:
        return abs(steady_response(model, ratio * natural)[rows[0]])

    def balance(ratio: float) -> np.ndarray:
        spin = ratio * natural
        gyro = rotor.damping + spin * rotor.gyroscopic
        dynamic = rotor.stiffness - spin**2 * rotor.mass + 1j * spin * gyro
        answer = np.zeros(rotor.n_dof, dtype=complex)
        answer[lateral] = np.linalg.solve(dynamic[np.ix_(lateral, lateral)], turning[lateral])
        return abs(radius + answer[rows[0]] * force) - free(ratio)

    return free, radius, balance


def jumps() -> tuple[float, float]:
    """Speed ratios at which the contact-free orbit just fits, and to which the rub lasts."""
    free, _, balance = closed_form()

    def least(ratio: float) -> float:
        return float(balance(ratio).min())

    return brentq(lambda ratio: free(ratio) - CLEARANCE, 1.05, 2.0), brentq(least, 1.21, 2.0)


def test_jumps_up_and_down_are_where_the_closed_form_has_them(tmp_path):
    fits, fold = jumps()
    assert fits < fold - 5 * STEP
    speeds = {"values": [1.17, 1.18, 1.19, 1.2, 1.22, 1.25, 1.28, 1.31, 1.33, 1.34, 1.35], "sweep": "both"}
    axes = tuple(
        make_axis(name, values, RIG)
        for name, values in (("speed_ratio", speeds), ("clearance", CLEARANCE), ("friction", 0.0))
    )
    recording = Recording(transient=30, revolutions=2, samples_per_revolution=32, keep=())
    run(
        Study(
            title="ring",
            rig=RIG,
            axes=axes,
            contact=Contact(),
            recording=recording,
            output=tmp_path / "ring.zarr",
        ),
        quiet=True,
    )
    store = xr.open_zarr(tmp_path / "ring.zarr").load().squeeze()
    touches = store.contact_fraction.max("stator") > 0
    last = [float(store.speed_ratio[touches.isel(direction=i).values].max()) for i in (0, 1)]
    print(f"\nup: rub to {last[0]:.2f}, closed form {fold:.4f}; down: from {last[1]:.2f}, {fits:.4f}")
    assert last[1] == pytest.approx(fits, abs=STEP)
    assert last[0] == pytest.approx(fold, abs=STEP)
    between = store.sel(speed_ratio=slice(fits + STEP, fold - STEP))
    assert between.sizes["speed_ratio"] == 5
    assert (between.regime.isel(direction=1) == 0).all()
    orbit = between.peak_to_peak_vertical
    assert (orbit.isel(direction=0) > 1.3 * orbit.isel(direction=1)).all()


def test_motion_between_the_two_is_unstable_and_has_the_radius_of_the_closed_form():
    """Three motions at 1.33: without contact, a rub, and an unstable rub of less radius.

    Eight springs are no ring without gaps: their radii are within 3 % of it.
    """
    ratio, case = 1.33, {"friction": 0.0, "keep": ()}
    rub = None
    for at in (1.17, 1.2, 1.23, 1.26, 1.29, 1.32, ratio):
        rub = periodic(
            RIG, speed_ratio=at, clearance=CLEARANCE, initial=None if rub is None else rub.state, **case
        )
    without = periodic(RIG, speed_ratio=ratio, clearance=2e-3, **case)
    halfway = State.unpacked(0.5 * (rub.state.packed() + without.state.packed()), assemble(RIG))
    halfway = replace(halfway, contact_force=np.zeros(COUNT))
    between = periodic(RIG, speed_ratio=ratio, clearance=CLEARANCE, initial=halfway, **case)
    assert rub.is_stable
    assert not between.is_stable
    assert between.residual < 1e-10
    growth = between.multipliers
    assert growth[0].real > 1
    assert growth[0].imag == 0
    assert abs(growth[1]) < 1
    _, radius, balance = closed_form()
    off = balance(ratio)
    roots = radius[:-1][off[:-1] * off[1:] < 0]
    found = [0.5 * motion.record.peak_to_peak_vertical for motion in (between, rub)]
    print(f"\nradii {found}, closed form {roots}")
    assert found == pytest.approx(roots, rel=0.03)
