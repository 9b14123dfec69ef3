"""Contacts that come and go where a pair parts at a touch for a moment only."""

import numpy as np
import pytest
from closed_form import Contact, read_rig

from rubhpc.integrate import modal_setup
from rubhpc.integrate.branches.branching import Branching
from rubhpc.integrate.branches.grazing import grazing_between, touches
from rubhpc.integrate.branches.search import shot, simulated
from rubhpc.integrate.periodic_motions.family import Family, Operation
from rubhpc.study.initial import Initial
from rubhpc.study.tables import Integrator, Recording

RIG = """
name = "overhung"
[rotor]
gravity = "9.81 m/s^2"
torsion.fixed_node = 1
damping.alpha = 8.0
[[rotor.shaft]]
length = "0.9 m"
outer_diameter = "35 mm"
elements = 6
youngs_modulus = "210 GPa"
shear_modulus = "81 GPa"
density = "7850 kg/m^3"
[[rotor.disc]]
node = 4
diameter = "0.24 m"
thickness = "30 mm"
density = "7850 kg/m^3"
[[rotor.disc]]
node = 7
diameter = "0.18 m"
thickness = "25 mm"
density = "7850 kg/m^3"
[[rotor.bearing]]
node = 2
stiffness = "7e6 N/m"
damping = "400 N s/m"
[[rotor.bearing]]
node = 6
stiffness = "6e6 N/m"
damping = "500 N s/m"
[[rotor.unbalance]]
node = 7
mass = "2 g"
radius = "80 mm"
[[stator]]
node = 7
radius = "90 mm"
count = 6
mass = "20 g"
stiffness = "2e6 N/m"
damping = "20 N s/m"
"""


@pytest.fixture(scope="module")
def branching(tmp_path_factory):
    """With ticks of 1.5 ns, at which impacts of another send pairs away for a moment."""
    path = tmp_path_factory.mktemp("rig") / "rig.toml"
    path.write_text(RIG)
    operation = Operation(
        rig=read_rig(path), clearance=150e-6, friction=0.1, contact=Contact(), integrator=Integrator(),
        samples_per_revolution=256,
    )  # fmt: skip
    ends = (450.0, 600.0)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(modal_setup, "FINEST_TICK", 1.5e-9)
        yield Branching(Family(operation.at("speed", 500.0), "speed", ends), 3.0)


@pytest.mark.parametrize(
    ("begin", "end", "row"), [(564.9, 565.05, 0), (557.5, 556.07, 1)], ids=["sent away", "not pressed"]
)
def test_a_touch_for_a_moment_is_located_in_few_motions(branching, begin, end, row):
    """One touch less from a place on, on whose sides motions are solved for with the speed held.

    Halving took 24 motions. What vanishes there is the excess of speed, or the force, of `staying_closed`.
    """
    recording = Recording(transient=100, samples_per_revolution=256, keep=())
    _, piecewise = simulated(branching, begin, Initial(), recording)
    first = shot(branching, begin, piecewise, (1,))
    held = np.append(np.zeros(first.motion.size), 1.0)
    last = branching.correct(first, (end - begin) / branching.step * held, held)
    assert (touches(first) - touches(last)).total() + (touches(last) - touches(first)).total() == 1
    before = branching._n_found
    found = grazing_between(branching, first, last)
    assert branching._n_found - before <= 12
    (pair,) = (touches(first) - touches(last)) + (touches(last) - touches(first))
    speed, force = found.point.staying_closed[:, pair]
    assert (speed, force)[row] < 1e-8
    beside = 1e-8 * branching.family.span / branching.step
    seen = [touches(branching.correct(found.point, sense * beside * held, held)).total() for sense in (-1, 1)]
    assert sorted(seen) == sorted(touches(one).total() for one in (first, last))
