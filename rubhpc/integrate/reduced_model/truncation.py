"""Choice of the modes that a reduced model keeps, and an estimate of the error by those left out."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.integrate.packing import degrees_of, output_degrees, whole_system
from rubhpc.integrate.reduced_model.coupling import Grouped
from rubhpc.integrate.reduced_model.standstill import (
    CUTOFF_RATIO,
    at_standstill,
    completed,
    cutoff_frequency,
    modes_below,
)
from rubhpc.kernels._jit import plain
from rubhpc.kernels.accumulators import TWIST
from rubhpc.kernels.laws import is_set_valued

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.kernels.laws import Law

    Floats = NDArray[np.float64]
    Bools = NDArray[np.bool_]

MARGIN = 5.0  # estimates without it were up to 5.5 times too small: a case has many contacts, not one
REBOUNDS = 3.0  # where modes are added, how much closer: a body that rebounds many times multiplies an error
FINER = 0.5  # share of the accuracy under all laws but steady sliding along a fixed normal
TURNED = 0.3  # share of motion along the rim that opens a curved gap: its normal turned, its stator bent
COMPACT = 1e-6  # by how much more a body's static inertia is than its tip's mass, up to which it is a mass
MOST_MODES = 400  # kept for the sake of the estimate; `cutoff_frequency` may ask for more


class Touch(NamedTuple):
    """What contacts feel; rigid ones that slide steadily along a fixed normal, no motion along the rim."""

    may_stick: bool = False  # friction is set-valued
    is_curved: bool = False  # gaps are: an updated normal, or a bent stator
    spring: float = 0.0  # of a penalty, N/m; 0 where contacts are rigid
    damper: float = 0.0  # beside it, N s/m
    bounces: bool = False  # impacts have restitution

    @property
    def share(self) -> float:
        """Of the accuracy asked for, which decides on modes; a penalty's contacts excite less of them."""
        has_jumps = self.spring == 0.0 and (self.may_stick or self.bounces)
        return FINER if self.is_curved or has_jumps else 1.0


SMOOTH = Touch()


def touch_of(model: Model, law: Law, *, is_updated: bool) -> Touch:
    """What contacts feel under a law, with the updated normal or the fixed one."""
    is_bent = any(stator.squared_slope is not None for stator in model.stators)
    curved, bounces = is_updated or is_bent, law.restitution > 0.0
    return Touch(plain(is_set_valued)(law), curved, law.stiffness, law.damping, bounces)


class Ringing(NamedTuple):
    """How strongly the n modes ring after a contact, in r signals and gaps."""

    share: Floats  # (r, n), square of each mode's ring, less what its decay takes, over the sum for all modes
    impact: float  # share of the closing momentum that the heaviest tip's own mass takes up at once


def kept_modes(model: Model, spin: float, accuracy: float, touch: Touch = SMOOTH) -> list[Bools]:
    """Which modes of each part are kept: those up to `cutoff_frequency`, and those that ring too much.

    Where the estimated error (`modal_error`) without the modes above is beyond the accuracy, those with the
    largest share in any signal or force are kept too, until it is within a third of the accuracy. All modes
    are kept where a tip's own mass takes up more than the accuracy of the closing momentum (`struck_share`):
    its impacts excite modes of any frequency. At most MOST_MODES are kept for these reasons.
    """
    parts, accuracy = at_standstill(model).parts, touch.share * accuracy
    cutoff = cutoff_frequency(model, spin, accuracy)
    are_kept = [modes_below(part, cutoff) for part in parts]
    is_kept = np.concatenate(are_kept)
    if is_kept.all():
        return are_kept
    ringing = ringing_of(model, spin, touch)
    is_struck = ringing.impact > accuracy
    if not is_struck and modal_error(model, spin, are_kept, touch) <= accuracy:
        return are_kept
    above = np.flatnonzero(~is_kept)
    above = above[np.argsort(ringing.share[:, above].max(axis=0), kind="stable")]  # the least share first
    lost = np.cumsum(ringing.share[:, above], axis=1).max(axis=0)
    n_out = 0 if is_struck else np.count_nonzero(lost <= (accuracy / (REBOUNDS * MARGIN)) ** 2)
    is_kept[above[max(n_out, is_kept.size - MOST_MODES) :]] = True
    ends = np.cumsum([part.frequency.size for part in parts])[:-1]
    return [completed(part, these) for part, these in zip(parts, np.split(is_kept, ends), strict=True)]


def modal_error(model: Model, spin: float, are_kept: list[Bools], touch: Touch = SMOOTH) -> float:
    """Estimate the largest error of a signal or a force, as a share of it, by the modes left out.

    A contact force is taken for a pulse at the contact frequency `w_c` (`standstill.Standstill`), with the
    spectrum `G(w) = min(1, (w_c / w)^2 + b w_c / w + s)`. At touch the tip's own mass gives up the share s
    of the closing momentum at once, and the force rises to that of a wave in the stator, b of its later peak.
    Under a penalty that mass bounces: where s rings more, as `bounce_spectrum` has it, modes left out do too.
    A mode of frequency w whose place of contact moves by b, and whose place of a signal by a, rings with the
    displacement `a b G(w) / w` there, and opens and closes the gap with the velocity `b^2 G(w)`; friction, as
    large as the normal force, is a second force of that kind. Set-valued friction jumps where slip ends or
    turns, with the spectrum of a step, `w_c / w` besides; it then holds the rim, and a mode that moves the
    rim along by b starts slip with the velocity `b^2 G(w)`. Where gaps are curved, motion along the rim opens
    and closes them too, by a share of it (TURNED).

    A ring counts as long as it lasts, over half a period of `w_c` at most: what is damped at once is followed
    by the static shapes that stand for it. What it drives through dampers and gyroscopic terms rings with it
    (`coupled_ringing`). The error is the root of the sum of squares over the modes left out, over that of all
    modes, times a margin.

    Parameters
    ----------
    spin : float, rad/s
    are_kept : list of (n,) bool
        Of each part, the modes kept.
    touch : Touch
        What contacts feel of motion along the rim.

    Returns
    -------
    float
        0 where all modes are kept.
    """
    is_out = ~np.concatenate(are_kept)
    if not is_out.any():
        return 0.0
    return MARGIN * float(np.sqrt((ringing_of(model, spin, touch).share @ is_out).max()))


def sufficient_accuracy(model: Model, spin: float) -> float:
    """Accuracy, a power of ten, that puts `cutoff_frequency` above all modes, whatever their number."""
    highest = max(float(part.frequency[-1]) for part in at_standstill(model).parts)
    accuracy = 1e-3
    while cutoff_frequency(model, spin, accuracy) < highest:
        accuracy *= 0.1
    return accuracy


@lru_cache(maxsize=4)
def ringing_of(model: Model, spin: float, touch: Touch) -> Ringing:
    """How strongly the modes of a model ring after contacts of any stator."""
    standstill = at_standstill(model)
    frequency = np.concatenate([part.frequency for part in standstill.parts])
    mode = np.hstack([part.mode for part in standstill.parts])
    damping = Grouped(standstill.groups, mode).form(whole_system(model, spin)[1])
    decay = np.maximum(0.5 * np.diag(damping), 0.0)  # 1/s, of each mode
    lasting = 1.0 / (1.0 + np.pi * decay / standstill.contact_frequency)
    signals = [mode[row] for row in output_degrees(model) if row >= 0]
    twist_row = output_degrees(model)[TWIST]
    turned = mode[twist_row] if twist_row >= 0 else np.zeros(frequency.size)
    displaced, moving, accelerated = model.probe_rows @ mode
    lively = np.vstack(  # the torsional acceleration, and probes: what each sees of a unit of the mode
        [turned * frequency**2, np.hypot(displaced - accelerated * frequency**2, moving * frequency)]
    )
    rungs: list[Floats] = []
    probed: list[Floats] = []
    impact, raised = 0.0, np.ones(frequency.size)
    for stator, degree in zip(model.stators, degrees_of(model), strict=True):
        v, w, twist, axial, lateral = (mode[row] if row >= 0 else np.zeros(frequency.size) for row in degree)
        ey, ez = np.cos(stator.angle), np.sin(stator.angle)
        across = ey * v + ez * w
        impact = max(impact, struck_share(across, axial, frequency))
        pulse = pulse_spectrum(across, axial, frequency, standstill.contact_frequency)
        if touch.spring > 0.0:
            bounce = bounce_spectrum(across, axial, frequency, decay, standstill.contact_frequency, touch)
            bounced = pulse_spectrum(across, axial, frequency, standstill.contact_frequency, bounce)
            raised = np.maximum(raised, bounced / pulse)
        rung, seen = (of * pulse / frequency for of in (np.array([*signals, axial, lateral]), lively))
        along = lateral + ez * v - ey * w - stator.radius * twist
        still = np.zeros(frequency.size)
        moved = across**2 + axial**2
        by_normal, by_friction = [moved * pulse], [still]  # how far gaps and slip ring
        if touch.is_curved:
            by_normal.append((moved + (TURNED * along) ** 2) * pulse)
            by_friction.append(still)
        if touch.may_stick:
            jump = np.minimum(1.0, pulse + standstill.contact_frequency / frequency)
            by_normal.append(still)
            by_friction.append(along**2 * jump)
            along = along * jump / pulse
        rungs.extend([*by_normal, rung * (axial - across), *by_friction, rung * along])
        probed.extend([seen * (axial - across), seen * along])
    coupled = coupled_ringing(damping, frequency) ** 2
    share, lively_share = (
        shares(np.vstack(those), len(model.stators), coupled, lasting * raised) for those in (rungs, probed)
    )
    # An event that is late by a share of the contact's time shifts what rings faster by more of its own.
    ratio = frequency / standstill.contact_frequency
    is_fast = ratio > CUTOFF_RATIO
    late = float((lively_share[:, is_fast] @ ratio[is_fast] ** 2).max(initial=1.0))
    return Ringing(np.vstack([share * late, lively_share]), impact)


def shares(rung: Floats, n_stator: int, coupled: Floats, lasting: Floats) -> Floats:
    """Square of each mode's ring over the sum for all modes, of each signal and stator, (r, n).

    Parameters
    ----------
    rung : (n_stator * 2 * r, n)
        By the normal force of each stator, then by its friction.
    coupled : (n, n)
        Square of how far the ring of a mode moves others.
    lasting : (n,)
        What decay leaves of each ring, and how much stronger it may be than thought of in the sum.
    """
    n = lasting.size
    square = rung**2
    square += square @ coupled
    square = square.reshape(n_stator, 2, -1, n).sum(axis=1).reshape(-1, n)
    whole = square.sum(axis=1)
    seen = whole > 0.0
    share: Floats = (square * lasting**2)[seen] / whole[seen, np.newaxis]
    return share


def coupled_ringing(damping: Floats, frequency: Floats) -> Floats:
    """How far a ring of each mode (row) moves the other modes (column), (n, n), relative to itself.

    A mode of frequency w that moves at v forces another, of frequency w', by `-c v`, where c is their entry
    of `damping` (n, n), 1/s. The other moves by `c w / |w'^2 - w^2|` of it, and in resonance as far. Above
    all these are modes of the two planes, which gyroscopic terms couple.
    """
    driven = np.abs(damping.T) * frequency[:, np.newaxis]
    apart = np.abs(frequency[:, np.newaxis] ** 2 - frequency**2)
    np.fill_diagonal(driven, 0.0)
    return np.divide(driven, apart + driven, out=np.zeros_like(driven), where=driven > 0.0)


def bounce_spectrum(
    across: Floats, axial: Floats, frequency: Floats, decay: Floats, contact_frequency: float, touch: Touch
) -> Floats:
    """Spectrum (n,) of what the tip's own mass gives up, relative to an impact; 1 where contacts are rigid.

    On a spring k and damper c of a penalty, with 1/m the motion of rotor and tip for a unit of momentum, it
    rings as `(k + i c w) / (k - m w^2 + i c w)`, as long as a contact and the `decay` (n,), 1/s, of the modes
    let it. Modes below take the peak: the static shapes that stand for those left out ring at any frequency
    above.
    """
    if touch.spring == 0.0:
        return np.ones(frequency.size)
    moved = across**2 + axial**2
    lightness = moved.sum()
    own, damped = touch.spring * lightness, touch.damper * lightness
    lost = damped + 2.0 * (moved @ decay / lightness + contact_frequency / np.pi)
    above = np.maximum(frequency, np.sqrt(own))
    found: Floats = np.hypot(own, damped * above) / np.hypot(own - above**2, lost * above)
    return found


def pulse_spectrum(
    across: Floats, axial: Floats, frequency: Floats, contact_frequency: float, bounce: Floats | float = 1.0
) -> Floats:
    """Spectrum (n,) of a contact force at the frequencies of the modes, relative to a slow one.

    Parameters
    ----------
    across, axial : (n,)
        What each mode moves the rotor at the place of contact, and the stator's tip, along the gap.
    frequency : (n,), rad/s
    contact_frequency : float, rad/s
    bounce : (n,)
        Of what the tip's own mass gives up at touch.
    """
    ratio = contact_frequency / frequency
    # A bar of mass m and stiffness k, hit at v, resists by v sqrt(k m) at first, later by v sqrt(k m_rotor);
    # the inertia of its static shape is m / 3.
    waves = max(static_inertia(axial, frequency) - 1.0 / float(axial @ axial), 0.0)
    step = np.sqrt(3.0 * waves / static_inertia(across, frequency))
    share = impact_share(across, axial, frequency)
    return np.asarray(np.minimum(1.0, ratio**2 + step * ratio + share * bounce))


def impact_share(across: Floats, axial: Floats, frequency: Floats) -> float:
    """Share of the closing momentum that the tip's own mass takes up at once, by its modes (n,)."""
    return float(1.0 / (1.0 + static_inertia(across, frequency) * (axial @ axial)))


def struck_share(across: Floats, axial: Floats, frequency: Floats) -> float:
    """The same where modes are kept by it: a mass meets the rotor's place of contact alone at first.

    A beam's wave takes part of the momentum before that: `pulse_spectrum` has it.
    """
    lightness = float(axial @ axial)  # 1/kg
    if not np.any(across) or static_inertia(axial, frequency) * lightness > 1.0 + COMPACT:
        return impact_share(across, axial, frequency)
    return 1.0 / (1.0 + lightness / float(across @ across))


def static_inertia(moved: Floats, frequency: Floats) -> float:
    """Inertia, kg, of the static shape under a force at the place that the modes move by `moved` (n,)."""
    response = moved / frequency**2
    return float((response @ response) / (moved @ response) ** 2) if np.any(response) else np.inf
