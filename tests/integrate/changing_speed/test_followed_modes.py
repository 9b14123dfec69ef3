"""Contact modes that follow the speed are those of each speed, but for an error of the third order."""

from dataclasses import replace

import numpy as np
import pytest
from test_retuned_modes import LAWS, setup

from rubhpc.integrate.changing_speed.followed_modes import NODE
from rubhpc.integrate.changing_speed.mode_parts import speeds_of

REACH = 20.0  # rad/s


def matrices_of(base, size):
    """The reduced model at a place in the range: gyroscopic terms grow by those of a speed, rad/s."""
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


@pytest.mark.parametrize("q", [1, 3])
@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_modes_follow_the_speed_in_third_order(q, law):
    base = setup(q)
    phasor = (base.reduced.force[0] - 1j * base.reduced.force[1]) / base.spin**2
    levels = {"sample_level": base.sample_level, "n_level": base._n_level}
    spin, masks = base.spin - REACH, law.masks[q]
    errors = []
    for size in (20.0, 10.0):
        at = matrices_of(base, size)
        library = law.kind(
            at(0.0),
            base.model,
            0.2,
            phasor=phasor,
            known={},
            tick=base.tick,
            **levels,
            **law.keys(base),
            beside=[at(-NODE), at(NODE)],
            at_place=at,
            is_balanced=False,
        )
        factor = complex(spin**2)
        speeds = speeds_of([spin], [factor], [0.0], [base.tick], base.spin, base.sample_level, REACH)
        library.tune(speeds, 0)
        force = np.stack([(phasor * factor).real, -(phasor * factor).imag])
        reduced = replace(at(-1.0), spin=spin, force=force)
        off = []
        for mask in masks:
            assert library.add(mask)
            assert library.follows(mask)
            assert not library.tables().loss.size
            found = maps(library.tables(), library.masks.index(mask))
            expected = law.tables(
                library, reduced, base, mask, levels | {"width": library.width, "tick": base.tick}
            )
            for name, true in maps(expected, 0).items():
                error = np.abs(found[name] - true).max(initial=0.0) / max(
                    np.abs(true).max(initial=0.0), 1e-30
                )
                if name == "through":  # an inverse has to be one
                    assert error < 1e-7, (mask, error)
                else:
                    off.append(error)
        errors.append(max(off))
    assert errors[0] < 1e-3, errors
    assert errors[1] < 1e-7 or 5.0 < errors[0] / errors[1] < 14.0, errors
