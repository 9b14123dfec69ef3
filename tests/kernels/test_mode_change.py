"""Events: every set of pairs is tried, and energies are added up."""

from itertools import product

import numpy as np
import pytest

from rubhpc.integrate.measuring.samples import new_accumulator
from rubhpc.kernels.accumulators import DRIVE_WORK, FRICTION_LOSS, IMPACT, IMPACT_LOSS, PRESSING
from rubhpc.kernels.closed_form.mode_change import change_contacts, event_work
from rubhpc.kernels.contact_modes import Reduced

N, SPIN, MOMENT = 7, 150.0, 1e-7
ANGLE = 0.8


def bodies(rng, q, friction=0.0, restitution=0.0):
    """Bodies of unit mass with random matrices; friction pushes across the gap's direction."""
    root = rng.normal(size=(N, N))
    gap_jacobian = rng.normal(size=(q, N))
    force_direction = gap_jacobian + friction * rng.normal(size=(q, N))
    return Reduced(
        stiffness=1e4 * root @ root.T,
        damping=rng.normal(size=(N, N)),
        force_cosine=rng.normal(size=N),
        force_sine=rng.normal(size=N),
        gap_jacobian=gap_jacobian,
        force_direction=force_direction,
        delassus=gap_jacobian @ force_direction.T,
        friction=np.full(q, friction),
        radius=np.full(q, 0.06),
        rim_speed=np.full(q, 0.06 * abs(SPIN)),
        restitution=restitution,
        clearance=np.full(q, 1e-4),
        slip=np.zeros((q, N)),
        translations=np.eye(N),
        displacement_limit=np.inf,
        overlap=0.0,
    )


def change(reduced, closed, crossing, motion, *, is_recorded=False):
    """Set that goes on, the motion after, and the accumulator."""
    q = len(reduced.gap_jacobian)
    accumulator, after = new_accumulator(q), motion.copy()
    found = change_contacts(
        reduced,
        closed,
        crossing,
        SPIN,
        MOMENT,
        np.cos(ANGLE),
        np.sin(ANGLE),
        after,
        is_recorded,
        event_work(q),
        accumulator,
    )
    return found, after, accumulator


def solve(matrix, free):
    """The x >= 0 with y = free + matrix x >= 0 and x y = 0, from every choice of which are zero."""
    found = []
    for chosen in product((False, True), repeat=len(free)):
        active, x = np.array(chosen), np.zeros(len(free))
        if active.any():
            x[active] = np.linalg.solve(matrix[np.ix_(active, active)], -free[active])
        if (x >= 0).all() and (free + matrix @ x >= -1e-12 * abs(free).max()).all():
            found.append(x)
    for x in found:  # choices that differ in pairs with neither force nor motion give the same
        assert x == pytest.approx(found[0], abs=1e-12 * abs(free).max())
    return found[0]


def enumerated(reduced, candidates, motion):
    """Velocity after the impact and the set that goes on, by enumeration."""
    x, v = motion[:N], motion[N:].copy()
    pairs = [i for i in range(len(reduced.gap_jacobian)) if candidates >> i & 1]
    if pairs:
        arriving = reduced.gap_jacobian[pairs] @ v
        arriving *= np.where(arriving < 0.0, 1.0 + reduced.restitution, 1.0)
        impulse = solve(reduced.delassus[np.ix_(pairs, pairs)], arriving)
        v += impulse @ reduced.force_direction[pairs]
    force = np.cos(ANGLE) * reduced.force_cosine + np.sin(ANGLE) * reduced.force_sine
    acceleration = force - reduced.stiffness @ x - reduced.damping @ v
    pairs = [i for i in pairs if abs(reduced.gap_jacobian[i] @ v) < 1e-6]  # parting ones have gone
    if not pairs:
        return v, 0
    pressing = solve(reduced.delassus[np.ix_(pairs, pairs)], reduced.gap_jacobian[pairs] @ acceleration)
    return v, sum(1 << i for i, n in zip(pairs, pressing, strict=True) if n > 0)


@pytest.mark.parametrize("q", [1, 2, 3])
@pytest.mark.parametrize(("friction", "restitution"), [(0.0, 0.0), (0.1, 0.0), (0.1, 0.6)])
def test_set_that_goes_on_is_that_of_enumeration(q, friction, restitution):
    """From any closed set, any crossings: gaps that close are met, forces that vanish let go."""
    rng = np.random.default_rng(q)
    met = set()
    for _ in range(150):
        reduced = bodies(rng, q, friction, restitution)
        closed, crossing = int(rng.integers(0, 1 << q)), int(rng.integers(1, 1 << q))
        motion = np.concatenate([1e-4 * rng.normal(size=N), rng.normal(size=N)])
        candidates = closed & ~crossing | crossing & ~closed
        kept = [i for i in range(q) if closed >> i & 1]
        if kept:  # closed gaps do not move before the event
            motion[N:] -= np.linalg.pinv(reduced.gap_jacobian[kept]) @ (
                reduced.gap_jacobian[kept] @ motion[N:]
            )
        found, after, _ = change(reduced, closed, crossing, motion)
        velocity, expected = enumerated(reduced, candidates, motion)
        assert found == expected
        assert after[N:] == pytest.approx(velocity, abs=1e-9)
        assert np.array_equal(after[:N], motion[:N])
        met.add(found)
    if restitution == 0.0:  # what bounces does not stay
        assert met == set(range(1 << q))


@pytest.mark.parametrize("q", [1, 2, 3])
def test_impact_leaves_no_pair_closing_and_its_energies_balance(q):
    """What the drive gives less what friction and impact take is what the bodies gain."""
    rng = np.random.default_rng(q)
    lost = []
    for _ in range(100):
        reduced = bodies(rng, q, friction=0.3)
        motion = np.concatenate([1e-4 * rng.normal(size=N), rng.normal(size=N)])
        _, after, accumulator = change(reduced, 0, (1 << q) - 1, motion, is_recorded=True)
        speed = reduced.gap_jacobian @ after[N:]
        assert speed.min() > -1e-9
        assert (np.minimum(accumulator.impulse, speed) < 1e-9).all()  # pressed pairs move together
        gain = 0.5 * (after[N:] @ after[N:] - motion[N:] @ motion[N:])
        given, rubbed, struck = accumulator.energy[[DRIVE_WORK, FRICTION_LOSS, IMPACT_LOSS]]
        assert given - rubbed - struck == pytest.approx(gain, abs=1e-10)
        assert struck >= 0.0
        assert given == pytest.approx((0.3 * accumulator.impulse * reduced.radius).sum() * SPIN)
        assert accumulator.friction_work.sum() == pytest.approx(rubbed)
        assert 1 <= accumulator.pivots[0] <= 20 * q
        assert accumulator.residual[IMPACT, 1] == pytest.approx(
            (reduced.delassus.diagonal() * accumulator.impulse).max()
        )
        for problem in (IMPACT, PRESSING):
            assert accumulator.residual[problem, 0] <= 1e-12 * accumulator.residual[problem, 1]
        lost.append(struck)
    assert max(lost) > 0.1


def test_impact_off_the_record_is_not_added_up():
    rng = np.random.default_rng(0)
    reduced = bodies(rng, 1)
    motion = np.concatenate([np.zeros(N), -reduced.gap_jacobian[0]])
    _, after, accumulator = change(reduced, 0, 1, motion)
    assert reduced.gap_jacobian[0] @ after[N:] == pytest.approx(0.0, abs=1e-12)
    assert accumulator.impulse[0] == 0.0
    assert not accumulator.energy.any()
    assert not accumulator.pivots.any()
    assert not accumulator.residual.any()


def at_a_stop():
    """Undamped bodies of which one coordinate is a gap to a fixed stop, at rest."""
    reduced = bodies(np.random.default_rng(0), 1)._replace(
        gap_jacobian=np.eye(1, N), force_direction=np.eye(1, N), delassus=np.ones((1, 1))
    )
    reduced.force_cosine[:] = reduced.force_sine[:] = reduced.damping[:] = 0.0
    return reduced, np.zeros(2 * N)


def test_pair_that_would_be_pressed_together_at_once_has_not_parted():
    """Opening at 5 um/s under an acceleration that shuts it again within the moment given to an event."""
    reduced, motion = at_a_stop()
    motion[:N] = np.linalg.solve(reduced.stiffness, 100.0 * np.eye(1, N)[0])  # -100 m/s2
    for speed, expected in ((5e-6, 1), (20e-6, 0)):
        motion[N] = speed
        assert change(reduced, 0, 1, motion)[0] == expected
