"""Contact modes that follow the speed are those of each speed, but for an error of the third order."""

from dataclasses import replace

import numpy as np
import pytest
from calling import called
from test_filled_modes import MASKS, setup, tables_at

from rubhpc.integrate.changing_speed.mode_courses import NODES
from rubhpc.integrate.changing_speed.range_library import RangeLibrary, speeds_of
from rubhpc.kernels.contact_modes import enter, enter_rest

enter = called(enter)
enter_rest = called(enter_rest)

REACH = 20.0  # rad/s


def matrices_of(base, size):
    """The reduced model at places in the range, whose gyroscopic terms grow by those of a speed, rad/s."""
    reduced, rotor = base.reduced, base.model.rotor
    shape = reduced.basis[: rotor.n_dof]
    turning = shape.T @ rotor.gyroscopic @ shape

    def at(place):
        bearing = reduced.stiffness * (1.0 - 1e-4 * size * place)
        return replace(reduced, stiffness=bearing, damping=reduced.damping + place * size * turning)

    return at


def maps(tables, place):
    """What a set of contacts makes of any motion, free of how its modes are scaled."""
    m = int(tables.n_eigenmode[place])
    motion = tables.motion_re[place] + 1j * tables.motion_im[place]
    switch = tables.switch_re[place] + 1j * tables.switch_im[place]
    rate = tables.rate_re[place] + 1j * tables.rate_im[place]
    enter = (tables.enter_re[place] + 1j * tables.enter_im[place])[:, :m].T
    power = (tables.power_re[place] + 1j * tables.power_im[place])[2, :m]
    constant = tables.enter_constant[place]
    taken = (constant[:, 0] + 1j * constant[:, 1])[:, :m].T
    speed = np.sqrt(np.abs(tables.pace[place, :m]).mean())
    through = (motion[:, :m] @ enter).real
    n = len(through) // 2
    scale = np.repeat([speed, 1.0], n)
    return {
        "through": through * scale[:, None] / scale,
        "switch": ((switch[:, :m] * power) @ enter).real / scale,
        "rate": ((rate[:, :m] * power) @ enter).real / scale,
        "still": motion[:, m + 1 :],
        "taken": (motion[:, :m] @ taken).real,
        "response": motion[:, m],
        "forces": switch[:, m:],
    }


def library_of(base, at):
    phasor = (base.reduced.force[0] - 1j * base.reduced.force[1]) / base.spin**2
    return RangeLibrary(
        at(0.0),
        base.model,
        0.2,
        phasor=phasor,
        tick=base.tick,
        sample_level=base.sample_level,
        n_level=base.n_level,
        reach=REACH,
        beside=[at(place) for place in NODES[1:]],
        at_place=at,
        is_balanced=False,
    )


def error_at(base, at, masks, place):
    """What modes err by that follow the speed and the acceleration to a place, over the greatest."""
    library, spin = library_of(base, at), base.spin + place * REACH
    phasor, factor = library._phasor, complex(spin**2)
    held = base.spin, base.sample_level, REACH
    library.tune(speeds_of([spin], [factor], [0.0], [base.tick], *held), 0)
    force = np.stack([(phasor * factor).real, -(phasor * factor).imag])
    reduced = replace(at(place), spin=spin, force=force)
    levels = {"sample_level": base.sample_level, "n_level": base.n_level, "tick": base.tick}
    worst = 0.0
    for mask in masks:
        assert library.add(mask)
        assert library.interpolates(mask)
        assert not library.tables().loss.size
        tables, row = library.tables(), library.masks.index(mask)
        found = maps(tables, row)
        expected = tables_at(library, reduced, base, mask, levels | {"width": library.width})
        for name, true in maps(expected, 0).items():
            largest = max(np.abs(true).max(initial=0.0), 1e-30)
            worst = max(worst, np.abs(found[name] - true).max(initial=0.0) / largest)
    return worst


@pytest.mark.parametrize("q", [1, 3])
def test_modes_follow_the_speed_in_third_order(q):
    base = setup(q)
    errors = [error_at(base, matrices_of(base, size), MASKS[q], -1.0) for size in (20.0, 10.0)]
    assert errors[0] < 1e-3, errors
    assert errors[1] < 1e-7 or 5.0 < errors[0] / errors[1] < 14.0, errors


def test_what_entering_a_mode_leaves_of_a_motion_is_entered_too():
    base = setup(3)
    library, spin = library_of(base, matrices_of(base, 40.0)), base.spin - REACH
    library.tune(
        speeds_of([spin], [spin**2 + 0j], [0.0], [base.tick], base.spin, base.sample_level, REACH), 0
    )
    n, lost = len(base.reduced.stiffness), 0.0
    size = 1e-4 * np.repeat([1.0, base.spin], n)
    for mask in MASKS[3]:
        library.add(mask)
        tables, row = library.tables(), library.masks.index(mask)
        rows = [getattr(tables, name)[row] for name in ("motion_re", "motion_im", "enter_re", "enter_im")]
        steady, z = (np.full(tables.enter_constant.shape[1], 1e-4), 0.8, 0.6), np.zeros((2, library.width))
        enter(tables, row, *steady, np.random.default_rng(5).normal(size=2 * n) * size, z)
        motion = rows[0] @ z[0] - rows[1] @ z[1]  # one that the mode may have
        enter(tables, row, *steady, motion, z)
        lost = max(lost, np.abs((motion - rows[0] @ z[0] + rows[1] @ z[1]) / size).max())
        enter_rest(*rows, motion.copy(), z)
        assert np.abs((motion - rows[0] @ z[0] + rows[1] @ z[1]) / size).max() < 1e-11
    assert lost > 1e-8
