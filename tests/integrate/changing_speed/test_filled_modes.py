"""Tables filled for a speed are those made again for it."""

from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest
from calling import called
from trial_rig import trial_rig

from rubhpc.case_arguments import case_of, read_probes
from rubhpc.integrate.changing_speed.range_library import RangeLibrary, speeds_of
from rubhpc.integrate.reduced_model.contact_mode import SlidingPairs, solve_contact_mode
from rubhpc.integrate.reduced_model.mode_tables import energies_of, tabulate
from rubhpc.integrate.reduced_model.touching import (
    mode_among,
    open_bodies,
)
from rubhpc.kernels.closed_form.measuring import energies_gained
from rubhpc.kernels.contact_modes import enter

energies_gained = called(energies_gained)
enter = called(enter)


def setup(q):
    case = {"speed": 200.0, "clearance": "100 um", "friction": 0.2, "model": "mokhtar2017"}
    probe = {"name": "a", "node": 1, "angle": 0.3, "quantity": "acceleration"}
    probes = read_probes("test", [probe])
    return case_of(
        "test", trial_rig(q), case, samples_per_revolution=64, initial={"from": "rest"}, probes=probes
    ).setup


def measured(mode, reduced, slip, friction, *, width, **levels):
    """Tables of a mode with its energies."""
    energies = energies_of(mode, reduced, friction, width)
    return tabulate(mode, reduced, slip, energies=energies, width=width, **levels)


MASKS = MappingProxyType({1: (0, 1), 3: (0, 2, 5)})


def tables_at(library, reduced, base, mask, levels):
    """Tables of a mode solved for a speed."""
    opened = solve_contact_mode(reduced, library.gap_jacobian, library.force_direction, 0)
    pairs = SlidingPairs(library.gap_jacobian, library.force_direction)
    mode = mode_among(open_bodies(reduced, base.model, opened), reduced, pairs, mask)
    return measured(mode, reduced, library.slip, library._friction_of(mode), **levels)


@pytest.mark.parametrize("q", [1, 3])
def test_a_tuned_mode_is_the_mode_at_that_speed(q):
    base, masks = setup(q), MASKS[q]
    phasor = (base.reduced.force[0] - 1j * base.reduced.force[1]) / base.spin**2
    levels = {"sample_level": base.sample_level, "n_level": base.n_level}
    library = RangeLibrary(
        base.reduced,
        base.model,
        0.2,
        phasor=phasor,
        tick=base.tick,
        reach=40.0,
        **levels,
    )
    for mask in masks:
        library.add(mask)
    spin, tick = 231.0, 0.9 * base.tick
    factor = (spin**2 - 40.0j) * np.exp(0.7j)
    columns = [170.0, spin], [0.5 + 0.3j, factor], [3.0, 0.0], [base.tick, tick]
    speeds = speeds_of(*columns, base.spin, base.sample_level, 40.0)
    library.tune(speeds, 0)
    for mask in masks:
        library.add(mask)
    library.tune(speeds, 1)
    assert not any(mask >= 0 for mask in library.masks)  # they wait until they are met
    force = np.stack([(phasor * factor).real, -(phasor * factor).imag])
    reduced = replace(base.reduced, spin=spin, force=force)
    levels |= {"width": library.width, "tick": tick}
    for mask in masks:
        library.add(mask)
        found, place = library.tables(), library.masks.index(mask)
        expected = tables_at(library, reduced, base, mask, levels)
        for name in expected._fields:
            values, anew = getattr(found, name)[place], getattr(expected, name)[0]
            if name == "output" and library._pairs.closed(mask):  # only the first sample is read
                values, anew = values[:, : len(library._output)], anew[:, : len(library._output)]
            largest = np.abs(anew).max(initial=0.0)
            assert np.abs(values - anew).max(initial=0.0) <= 1e-9 * largest, name


@pytest.mark.parametrize("growth", [0.0, 1e-4, 9.0])
def test_energy_balances_while_the_unbalance_force_grows(growth):
    """What the motion gains is the work of the unbalance less what damping and friction take."""
    base, spin = setup(3), 231.0
    phasor = (base.reduced.force[0] - 1j * base.reduced.force[1]) / base.spin**2
    factor = (spin**2 - 40.0j) * np.exp(0.7j)
    levels = {"sample_level": base.sample_level, "n_level": base.n_level}
    library = RangeLibrary(base.reduced, base.model, 0.2, phasor=phasor, tick=base.tick, **levels)
    library.tune(speeds_of([spin], [factor], [growth], [base.tick], base.spin, base.sample_level), 0)
    reduced, n, time = base.reduced, len(base.reduced.stiffness), 1e-3
    for mask in MASKS[3]:
        library.add(mask)
        tables, place = library.tables(), library.masks.index(mask)
        first = tables.n_eigenmode[place]
        exponent = library._solved_modes[mask][1].exponent
        assert exponent[first] == complex(growth, spin)
        shape = tables.motion_re[place] + 1j * tables.motion_im[place]
        if mask == 0:
            s = exponent[first]
            impedance = s**2 * np.eye(n) + s * reduced.damping + reduced.stiffness
            response = np.linalg.solve(impedance, factor * phasor)
            assert np.abs(shape[:n, first] - response).max() < 1e-9 * np.abs(response).max()
        free = tables.motion_re[place] @ np.linalg.pinv(tables.motion_re[place])  # of the gaps that are held
        motion = free @ np.random.default_rng(3).normal(size=2 * n) * 1e-4
        z = np.zeros((2, library.width))
        enter(tables, place, np.zeros(3), 0.8, 0.6, motion, z)
        later = np.exp(exponent * time) * (z[0] + 1j * z[1])
        held, gained, ends = [], np.zeros(2), (z, np.array([later.real, later.imag]))
        energies_gained(tables, place, *ends, gained)
        for at in ends:
            u, v = (shape @ (at[0] + 1j * at[1])).real.reshape(2, n)
            held.append(0.5 * (v @ v + u @ reduced.stiffness @ u))
        loss, work = gained + tables.steady_power[place] * time
        assert held[1] - held[0] == pytest.approx(work - loss, abs=1e-9 * max(abs(held[0]), abs(work)))
