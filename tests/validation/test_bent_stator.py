"""The bent stator against geometrically exact beams: the elastica at rest, and Reissner's beam in motion."""

import numpy as np
import pytest
from closed_form import simulate
from exact_beam import Beam, Rim, exact, second_order
from scipy.integrate import solve_bvp
from trial_rig import trial_rig

from rubhpc.fem.assemble import assemble

LENGTH, WIDTH, HEIGHT, YOUNGS = 0.04, 0.005, 0.001, 3e9  # slender: shear adds 1e-3 of the deflection


def elastica(axial, lateral):
    """How far the tip of a cantilever draws back along its axis, and moves sideways, m, under forces, N.

    `axial` presses towards the root. With the angle t, E I t'' = -(x' lateral + y' axial).
    """
    stretch, bend = YOUNGS * WIDTH * HEIGHT, YOUNGS * WIDTH * HEIGHT**3 / 12

    def slopes(_, state):
        angle, turn = state[:2]
        strain = 1.0 + (lateral * np.sin(angle) - axial * np.cos(angle)) / stretch
        x, y = strain * np.cos(angle), strain * np.sin(angle)
        return np.array([turn, -(x * lateral + y * axial) / bend, x, y])

    def ends(root, tip):
        return np.array([root[0], tip[1], root[2], root[3]])

    arc = np.linspace(0.0, LENGTH, 41)
    start = np.vstack([np.zeros((2, arc.size)), arc, np.zeros_like(arc)])
    found = solve_bvp(slopes, ends, arc, start, tol=1e-10, max_nodes=20_000)
    assert found.success
    return LENGTH - found.y[2, -1], found.y[3, -1]


@pytest.mark.parametrize("ratio", [0.02, 0.05, 0.1])
@pytest.mark.parametrize("friction", [0.2, 0.6])
def test_tip_is_where_the_elastica_has_it(ratio, friction):
    """To the square of the slope, which is what the second order leaves out."""
    rig = trial_rig(1, length=LENGTH, width=WIDTH, height=HEIGHT, elements=6, geometry="second_order")
    (stator,) = assemble(rig).stators
    # (K - N S) u = T: the lateral force for which the tip moves by `ratio` of the length.
    bending = np.array([i for i, (_, name) in enumerate(stator.body.degrees) if name != "axial"])
    inside = np.ix_(bending, bending)
    force = 1e-3
    for _ in range(50):
        load = np.where(bending == stator.lateral, friction * force, 0.0)
        stiffness = stator.body.stiffness[inside] - force * stator.squared_slope[inside]
        bent = np.linalg.solve(stiffness, load)
        lateral = bent[bending == stator.lateral][0]
        force *= 0.5 + 0.5 * ratio * LENGTH / lateral
    assert lateral == pytest.approx(ratio * LENGTH, rel=1e-6)
    shortened = 0.5 * bent @ stator.squared_slope[inside] @ bent
    compressed = force * LENGTH / (YOUNGS * WIDTH * HEIGHT)
    back, aside = elastica(force, friction * force)
    assert lateral == pytest.approx(aside, rel=2e-3 + 2 * ratio**2)
    assert compressed + shortened == pytest.approx(back, rel=4e-3 + 4 * ratio**2)
    assert back > 5 * compressed  # which is all that a linear beam has
    assert shortened == pytest.approx(0.6 * lateral**2 / LENGTH, rel=0.05)


def touch(depth, elements):
    """Peak force of the exact beam, and what the others miss of it, until the rim would have to pull.

    Largest deflection over length; peak force, largest error of the force and of the deflection, by second
    order; peak force of the linear beam. All but the first are shares of the exact ones.
    """
    beam, rim = Beam(), Rim(depth=depth, time=4e-3, friction=0.3)
    size = {"length": beam.length, "width": beam.width, "height": beam.height}
    (stator,) = assemble(trial_rig(1, **size, elements=6, geometry="second_order")).stators
    known = exact(beam, rim, elements=elements)
    found = second_order(stator, beam, rim)
    linear = second_order(stator, beam, rim, is_bent=False)
    held = slice(0, 1 + int(np.argmax(known.force[1:] < 0.0)) or None)
    peak, most = known.force[held].max(), abs(known.lateral[held]).max()
    return (
        most / beam.length,
        found.force[held].max() / peak,
        abs(found.force - known.force)[held].max() / peak,
        abs(found.lateral - known.lateral)[held].max() / most,
        linear.force[held].max() / peak,
    )


def test_force_of_a_touch_is_that_of_an_exact_beam():
    deflection, peak, force, lateral, linear = touch(10e-6, elements=2)
    assert 0.01 < deflection < 0.03
    assert peak == pytest.approx(1.0, abs=0.02)
    assert force < 0.03
    assert lateral < 0.01
    assert linear > 1.5


@pytest.mark.long
@pytest.mark.parametrize("depth", [2e-6, 10e-6, 50e-6, 200e-6, 800e-6])
def test_force_of_any_touch_is_that_of_an_exact_beam(depth):
    deflection, peak, force, lateral, linear = touch(depth, elements=6)
    print(f"{1e6 * depth:g} um: {deflection:.3f} {peak:.4f} {force:.4f} {lateral:.4f} {linear:.2f}")
    assert peak == pytest.approx(1.0, abs=0.01)
    assert force < 0.02
    assert lateral < 0.005
    assert linear > 1.3


@pytest.mark.parametrize(
    ("keys", "given", "force"),
    [
        ({}, {"speed_ratio": 0.75, "clearance": "84 um"}, (22.1, 17.3, 13.5)),
        (
            {"stator.youngs_modulus": "30 GPa"},
            {"speed_ratio": 3.5, "clearance": "74 um"},
            (2663.0, 598.0, 291.0),
        ),
    ],
)
def test_peak_forces_of_the_packaged_rig_are_those_of_all_degrees(keys, given, force):
    """N, of another code with all degrees of freedom, geometric stiffness and foreshortening."""
    models = (("fixed", "linear"), ("updated", "linear"), ("updated", "second_order"))
    for (normal, geometry), known in zip(models, force, strict=True):
        record = simulate(
            "mokhtar2017",
            **given,
            friction=0.3,
            normal=normal,
            overrides=keys | {"stator.geometry": geometry},
            revolutions=16,
            keep=("section",),
        )
        assert record.peak_contact_force[0] == pytest.approx(known, rel=0.015)
        assert (record.foreshortening_ratio[0] > 0.1) == (geometry == "linear")
