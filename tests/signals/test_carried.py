"""Where carriers are on average, and orbits among stators that move with one."""

from dataclasses import replace

import numpy as np
import pytest
import synthetic_store
import xarray as xr
from closed_form import read_rig

from postproc.figures.drawing import house_style, new_figure
from postproc.figures.orbit import draw_orbit
from postproc.signals.waveforms import mean_shift, orbit_data
from postproc.store.select import select
from rubhpc import Carrier

ONE = {"speed_ratio": 0.75, "clearance": 84e-6, "friction": 0.3, "stator_youngs_modulus": 3e9}


def carried_rig(count):
    base = read_rig("mokhtar2017")
    stator = replace(base.stator[0], count=count, carrier="casing")
    casing = Carrier(name="casing", mass=2.0, stiffness=5e5, inertia=0.02, torsional_stiffness=2e4)
    return replace(base, stator=(stator,), carrier=(casing,))


def test_shift_is_that_of_a_carrier_that_translates_and_turns():
    """Two of eight stators are pressed on, and deflected besides."""
    rig, rng = carried_rig(8), np.random.default_rng(3)
    v, w, s = rng.normal(size=(3, 5))
    angle = np.array([stator.angle for stator in rig.stator])[:, np.newaxis]
    axial = v * np.cos(angle) + w * np.sin(angle)
    lateral = w * np.cos(angle) - v * np.sin(angle) + s
    force = np.zeros_like(axial)
    force[3:5], axial[3:5], lateral[3:5] = 1.0, axial[3:5] + 0.5, lateral[3:5] + 2.0
    signals = {"stator_axial": axial, "stator_lateral": lateral, "contact_force": force}
    tips = xr.Dataset(
        {name: (("stator", "sample"), values) for name, values in signals.items()},
        attrs={"rig": rig.as_dict()},
    )
    np.testing.assert_allclose(mean_shift(tips), np.tile([v.mean(), w.mean()], (8, 1)), atol=1e-12)


def test_orbit_is_drawn_among_stators_moved_with_their_carrier():
    case = select(synthetic_store.make(), ONE).assign_attrs(rig=carried_rig(1).as_dict())
    case["stator_axial"] = xr.full_like(case["stator_axial"], 50e-6)
    case["stator_lateral"] = xr.full_like(case["stator_lateral"], 20e-6)
    case["contact_force"] = xr.zeros_like(case["contact_force"])
    data = orbit_data(case)
    shift = mean_shift(case[["stator_axial", "stator_lateral", "contact_force"]])[0] * 1e6
    with house_style():
        ax = new_figure()[1][0]
        draw_orbit(data, ax)
    circle = next(p for p in ax.patches if hasattr(p, "get_radius"))
    assert circle.center == pytest.approx((shift[1], shift[0]))
    face = next(line for line in ax.lines if len(line.get_xdata()) == 2)
    assert face.get_ydata() == pytest.approx([84.0 + shift[0]] * 2)
    assert shift[0] == pytest.approx(50.0)
