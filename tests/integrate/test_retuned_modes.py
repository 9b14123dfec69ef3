"""Tables tuned to a speed are those made anew for it; matrices are held where that changes little."""

from dataclasses import replace

import numpy as np
import pytest
from trial_rig import trial_rig

from rubhpc.case_arguments import case_of, read_probes
from rubhpc.integrate.contact_mode import solve_contact_mode
from rubhpc.integrate.held_matrices import RESPONSE, held_range
from rubhpc.integrate.mode_tables import tabulate
from rubhpc.integrate.retuned_modes import RetunedLibrary


def setup(q):
    case = {"speed": 200.0, "clearance": "100 um", "friction": 0.2}
    probe = {"name": "a", "node": 1, "angle": 0.3, "quantity": "acceleration"}
    probes = read_probes("test", [probe])
    return case_of(
        "test", trial_rig(q), case, samples_per_revolution=64, initial={"from": "rest"}, probes=probes
    ).setup


@pytest.mark.parametrize(("q", "masks"), [(1, (0, 1)), (3, (0, 2, 5))])
def test_a_tuned_mode_is_the_mode_at_that_speed(q, masks):
    base = setup(q)
    phasor = (base.reduced.force[0] - 1j * base.reduced.force[1]) / base.spin**2
    levels = {"sample_level": base.sample_level, "n_level": base._n_level}
    library = RetunedLibrary(base.reduced, base.model, 0.2, phasor=phasor, known={}, tick=base.tick, **levels)
    for mask in masks:
        library.add(mask)
    spin, tick = 231.0, 0.9 * base.tick
    factor = (spin**2 - 40.0j) * np.exp(0.7j)
    library.tune(spin, factor, tick)
    assert [mask for mask in library.masks if mask >= 0] == [0]  # others wait until they are met
    force = np.stack([(phasor * factor).real, -(phasor * factor).imag])
    reduced = replace(base.reduced, spin=spin, force=force)
    for mask in masks:
        library.add(mask)
        found, place = library.tables(), library.masks.index(mask)
        mode = solve_contact_mode(reduced, library.gap_jacobian, library.force_direction, mask)
        friction = library._friction_of(mode)
        expected = tabulate(
            mode, reduced, library.slip, friction=friction, width=library.width, tick=tick, **levels
        )
        for name in expected._fields:
            values, anew = getattr(found, name)[place], getattr(expected, name)[0]
            assert values == pytest.approx(anew, rel=1e-9, abs=1e-9 * np.abs(anew).max()), name


def test_matrices_are_held_while_the_response_errs_little():
    """A tilting disc without coupling: its exponents move by half of Ip/It a unit of speed at standstill."""
    stiffness, damping = np.eye(2) * 400.0**2, np.eye(2) * 2.0 * 0.02 * 400.0
    gyroscopic = 0.1 * np.array([[0.0, 1.0], [-1.0, 0.0]])

    def found(speed, acceleration):
        drift = np.zeros((2, 2)), gyroscopic
        return held_range(stiffness, damping + speed * gyroscopic, drift, speed, acceleration)

    def response(speed, held):
        matrix = stiffness - speed**2 * np.eye(2) + 1j * speed * (damping + held * gyroscopic)
        return np.linalg.solve(matrix, [1.0, -1j])

    for speed in (100.0, 250.0, 370.0, 415.0, 600.0):
        half = found(speed, 1e-3)
        for at in (speed - half, speed + half):
            exact = response(at, at)
            assert np.abs(response(at, speed) - exact).max() < 1.5 * RESPONSE * np.abs(exact).max()
    assert found(415.0, 1e-3) < 0.2 * found(600.0, 1e-3)
    assert found(415.0, 1e3) > found(415.0, 1e-3)  # a fast passage leaves no time to respond
