"""Choice of the modes that a reduced model keeps, and estimate of the error by the omitted ones."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from rubhpc.errors import InputError
from rubhpc.fem.statics import find_rigid_body_mode, unheld_message
from rubhpc.integrate.packing import (
    carrier_degrees,
    degrees_of,
    normal_laws,
    output_degrees,
    whole_system,
)
from rubhpc.integrate.reduced_model.coupling import Grouped, coupled_parts
from rubhpc.kernels._jit import plain
from rubhpc.kernels.accumulators import TWIST
from rubhpc.kernels.laws import may_stick

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubhpc.fem.model import Body, Model
    from rubhpc.kernels.laws import Law


Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# Modes up to this multiple of the contact frequency (or the spin, where that is higher), times (1e-3 /
# accuracy)^(1/4): modes above are represented by static shapes, with an error of the fourth power of the
# frequency ratio.
CUTOFF_RATIO = 10.0
FEWEST_MODES = 2  # kept of every part, whatever their frequency
SMALL = 256  # degrees of a body whose modes are cached for other rigs: 1.5 MB
FEW_PAIRS = 5  # where separating parts saves little
FREE = 1e-12  # square of a frequency over the greatest; less is rigid-body motion

MARGIN = 5.0  # estimates without it were up to 5.5 times too small: a case has many contacts
REBOUNDS = 3.0  # stricter limit where modes are added: repeated rebounds multiply an error
FINER = 0.5  # share of the accuracy under all laws but steady sliding along a fixed normal
TURNED = 0.3  # share of motion along the rim that opens a curved gap, by a turned normal or a bent stator
COMPACT = 1e-6  # relative excess of a body's static inertia over its tip's mass; less: a rigid mass
MOST_MODES = 400  # kept because of the estimate; `cutoff_frequency` may require more


def cutoff_frequency(model: Model, spin: float, accuracy: float) -> float:
    """Frequency, rad/s, up to which all modes are kept and probes agree with the full model.

    Ten times the contact frequency (the rotor's inertia on the stator's static stiffness), or the spin times
    the highest order of a force where that is higher, times `(1e-3 / accuracy)^(1/4)`; infinite for rigid
    walls.
    """
    fastest = max(at_standstill(model).contact_frequency, model.highest_order * abs(spin))
    return float(CUTOFF_RATIO * (1e-3 / accuracy) ** 0.25 * fastest)


class Part(NamedTuple):
    """Undamped modes of a part that mass and stiffness couple, orthonormal in the mass."""

    n_seen: int  # number of degrees and combinations that contact, outputs or probes see
    rows: Ints  # its degrees
    mode: Floats  # (n_all, n)
    frequency: Floats  # (n,), rad/s


class Standstill(NamedTuple):
    """Properties of a model that do not depend on the speed."""

    stiffness: Floats  # (n_all, n_all), its symmetric part
    parts: list[Part]  # those seen by contact or outputs
    contact_frequency: float  # rad/s
    groups: list[Ints]  # degrees that are uncoupled at every speed; one group for few pairs


@lru_cache(maxsize=4)
def at_standstill(model: Model) -> Standstill:
    """Find the modes of a model, once for all speeds."""
    mass, _, stiffness, _ = whole_system(model, 1.0)
    symmetric, seen = 0.5 * (stiffness + stiffness.T), seen_degrees(model)
    number, whole = _coupled_degrees(model.bodies)
    is_seen, is_felt = np.zeros((2, len(mass)), dtype=bool)
    looked_at = model.probe_patterns != 0.0
    is_seen[seen], is_felt[whole[seen]] = True, True
    is_felt[whole[looked_at.any(axis=1)]] = True
    parts = []
    for i_part in range(number.max() + 1):
        rows = np.flatnonzero(number == i_part)
        if not is_felt[whole[rows[0]]]:
            continue
        pick = np.ix_(rows, rows)
        if rows.size <= SMALL:
            square, shape = _eigenmodes(symmetric[pick].tobytes(), mass[pick].tobytes())
        else:
            square, shape = eigh(symmetric[pick], mass[pick])
        if square[0] <= FREE * square[-1]:
            free = find_rigid_body_mode(model)
            if free or not model.rotor.softness:
                raise InputError(unheld_message(free or "here one is free to move or to turn"))
            square = np.maximum(square, model.rotor.softness)  # which rounding hides
        mode = np.zeros((mass.shape[0], rows.size))
        mode[rows] = shape
        n_seen = is_seen[rows].sum() + looked_at[rows].any(axis=0).sum()
        parts.append(Part(int(n_seen), rows, mode, np.sqrt(square)))
    if len(model.stators) <= FEW_PAIRS:
        whole[:] = 0
    groups = [np.flatnonzero(whole == i) for i in range(whole.max() + 1)]
    return Standstill(symmetric, parts, _contact_frequency(parts, degrees_of(model), model), groups)


def _coupled_degrees(bodies: Sequence[Body]) -> tuple[Ints, Ints]:
    """Number of the part of each degree (n_all,): coupled by mass and stiffness; by all matrices at speed.

    Equal bodies, as in a ring, are analysed once.
    """
    found: dict[int, list[Ints]] = {}
    numbers: list[list[Ints]] = [[], []]
    n_part = [0, 0]
    for body in bodies:
        if id(body) not in found:
            coupled = (body.mass != 0) | (body.stiffness != 0)
            moving = coupled | (body.damping + body.gyroscopic != 0)
            found[id(body)] = [coupled_parts(of) for of in (coupled, moving)]
        for i, own in enumerate(found[id(body)]):
            numbers[i].append(own + n_part[i])
            n_part[i] += own.max(initial=-1) + 1
    parts, whole = (np.concatenate(of) for of in numbers)
    return parts, whole


@lru_cache(maxsize=16)
def _eigenmodes(stiffness: bytes, mass: bytes) -> tuple[Floats, Floats]:
    """Squares of frequencies and modes of matrices (n, n), cached for bodies that rigs share."""
    n = math.isqrt(len(mass) // 8)
    square, shape = eigh(*(np.frombuffer(matrix).reshape(n, n) for matrix in (stiffness, mass)))
    return square, shape


def seen_degrees(model: Model) -> Ints:
    """Degrees that contact or outputs see."""
    places = (degrees_of(model), output_degrees(model), carrier_degrees(model))
    return np.unique(np.concatenate([degree[degree >= 0] for degree in places]))


def _contact_frequency(parts: list[Part], degree: Ints, model: Model) -> float:
    """Highest frequency, rad/s, of a contact: the rotor's inertia on the stator's static stiffness."""
    mode = np.hstack([part.mode for part in parts])
    square = np.concatenate([part.frequency for part in parts]) ** 2
    highest = 0.0
    for stator, (v, w, _, axial, _) in zip(model.stators, degree, strict=True):
        if axial < 0:
            return np.inf  # a rigid wall: no mode is too high
        along = sum(
            share * mode[row]
            for row, share in ((v, np.cos(stator.angle)), (w, np.sin(stator.angle)))
            if row >= 0
        )
        response = along / square  # to a unit force, mode by mode
        inertia = (response @ response) / (along @ response) ** 2  # of that shape, as that of the first mode
        compliance = mode[axial] @ (mode[axial] / square)
        if stator.held.axial >= 0 and stator.alone is not None:  # it acts before the carrier moves
            tip = stator.alone.axial
            compliance = np.linalg.inv(stator.alone.body.stiffness)[tip, tip]
        highest = max(highest, 1.0 / np.sqrt(inertia * compliance))
    return float(highest)


class Modes(NamedTuple):
    """Undamped modes of a part, orthonormal in the mass."""

    rows: Ints  # its degrees
    kept: Floats  # (n_all, n_kept)
    kept_frequency: Floats  # (n_kept,), rad/s
    rest: Floats  # (n_all, n_rest), represented only by static shapes
    rest_frequency: Floats  # (n_rest,), rad/s


def parted(part: Part, is_kept: Bools) -> Modes:
    """Modes kept (n,), and the others."""
    order, n_kept = np.argsort(~is_kept, kind="stable"), np.count_nonzero(is_kept)
    mode, frequency = part.mode.take(order, axis=1), part.frequency[order]
    return Modes(part.rows, mode[:, :n_kept], frequency[:n_kept], mode[:, n_kept:], frequency[n_kept:])


def modes_below(part: Part, cutoff: float) -> Bools:
    """Which modes (n,) are kept for a cutoff, rad/s."""
    return completed(part, part.frequency <= cutoff)


def completed(part: Part, is_kept: Bools) -> Bools:
    """Kept modes (n,): at least two, and all where modes and shapes would be as many."""
    is_kept = is_kept | (np.arange(is_kept.size) < FEWEST_MODES)
    return is_kept | (np.count_nonzero(is_kept) + part.n_seen >= is_kept.size)


class Touch(NamedTuple):
    """Sensitivity of contacts to motion. Rigid contacts in steady sliding ignore motion along the rim."""

    may_stick: bool = False  # friction is set-valued
    is_curved: bool = False  # curved gaps: updated normal or bent stator
    spring: float = 0.0  # of a penalty, N/m; 0 where contacts are rigid
    damper: float = 0.0  # of a penalty, N s/m
    bounces: bool = False  # impacts have restitution

    @property
    def share(self) -> float:
        """Share of the requested accuracy for the choice of modes; contacts with a penalty excite fewer."""
        has_jumps = self.spring == 0.0 and (self.may_stick or self.bounces)
        return FINER if self.is_curved or has_jumps else 1.0


SMOOTH = Touch()


def touch_of(model: Model, law: Law, *, is_updated: bool) -> Touch:
    """Sensitivity of contacts under a law, with the updated or the fixed normal."""
    is_bent = any(stator.squared_slope is not None for stator in model.stators)
    laws = normal_laws(model, law)
    bounces, is_soft = bool(laws["restitution"].any()), bool(np.all(laws["stiffness"] > 0.0))
    spring, damper = 0.0, 0.0
    if is_soft:
        stiffest = laws["stiffness"].argmax()
        spring, damper = float(laws["stiffness"][stiffest]), float(laws["damping"][stiffest])
    return Touch(plain(may_stick)(law), is_updated or is_bent, spring, damper, bounces)


class Ringing(NamedTuple):
    """Amplitudes of the n modes after a contact, in r signals and gaps."""

    share: Floats  # (r, n), square of each mode's amplitude, reduced by its decay, over the sum of all modes
    impact: float  # largest share of the closing momentum that a tip's own mass absorbs immediately


def kept_modes(model: Model, spin: float, accuracy: float, touch: Touch = SMOOTH) -> list[Bools]:
    """Kept modes of each part: those up to `cutoff_frequency`, and those with too large amplitudes.

    Where the estimated error (`modal_error`) without the modes above exceeds the accuracy, those with the
    largest share in any signal or force are kept too, until it is within a third of the accuracy. All modes
    are kept where a tip's own mass absorbs a share of the closing momentum above the accuracy
    (`struck_share`): its impacts excite modes of any frequency. At most MOST_MODES are kept for these
    reasons.
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
    """Estimate the largest relative error of a signal or a force by the omitted modes.

    A contact force is modelled as a pulse at the contact frequency `w_c` (`Standstill`), with the
    spectrum `G(w) = min(1, (w_c / w)^2 + b w_c / w + s)`. At touch the tip's own mass transfers the share s
    of the closing momentum immediately, and the force rises to that of a wave in the stator, b of its later
    peak. Under a penalty that mass bounces: where this amplifies s (`bounce_spectrum`), it amplifies omitted
    modes too. A mode of frequency w with the amplitude b at the contact and a at a signal rings there with
    the displacement `a b G(w) / w`, and moves the gap with the velocity `b^2 G(w)`. Friction, assumed as
    large as the normal force, is a second force of that kind. Set-valued friction jumps where slip ends or
    reverses, which adds the spectrum of a step, `w_c / w`. It then constrains the rim, and a mode with the
    amplitude b along the rim starts slip with the velocity `b^2 G(w)`. Where gaps are curved, a share
    (TURNED) of the motion along the rim moves them too.

    The ringing of a mode counts for its duration, at most half a period of `w_c`: strongly damped modes are
    represented by static shapes. Modes that it drives through dampers and gyroscopic terms are included
    (`coupled_ringing`). The error is the root of the sum of squares over the omitted modes, relative to that
    of all modes, times a margin.

    Parameters
    ----------
    spin : float, rad/s
    are_kept : list of (n,) bool
        Kept modes of each part.
    touch : Touch
        Sensitivity of contacts to motion along the rim.

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
    """Accuracy, a power of ten, with a `cutoff_frequency` above all modes."""
    highest = max(float(part.frequency[-1]) for part in at_standstill(model).parts)
    accuracy = 1e-3
    while cutoff_frequency(model, spin, accuracy) < highest:
        accuracy *= 0.1
    return accuracy


@lru_cache(maxsize=4)
def ringing_of(model: Model, spin: float, touch: Touch) -> Ringing:
    """Amplitudes of the modes of a model after contacts of any stator."""
    standstill = at_standstill(model)
    frequency = np.concatenate([part.frequency for part in standstill.parts])
    mode = np.hstack([part.mode for part in standstill.parts])
    damping = Grouped(standstill.groups, mode).form(whole_system(model, spin)[1])
    decay = np.maximum(0.5 * np.diag(damping), 0.0)  # 1/s, of each mode
    lasting = 1.0 / (1.0 + np.pi * decay / standstill.contact_frequency)
    signals = [mode[row] for row in output_degrees(model) if row >= 0]
    twist_row = output_degrees(model)[TWIST]
    turned = mode[twist_row] if twist_row >= 0 else np.zeros(frequency.size)
    displaced, moving, accelerated = model.sensor_rows @ mode
    lively = np.vstack(  # torsional acceleration and probes: reading of each for a unit of the mode
        [turned * frequency**2, np.hypot(displaced - accelerated * frequency**2, moving * frequency)]
    )
    rungs: list[Floats] = []
    probed: list[Floats] = []
    impact, raised = 0.0, np.ones(frequency.size)
    contacts = contact_motions(model, mode)
    for angle, radius, (v, w, twist, axial, lateral) in contacts:
        ey, ez = np.cos(angle), np.sin(angle)
        across = ey * v + ez * w
        impact = max(impact, struck_share(across, axial, frequency))
        pulse = pulse_spectrum(across, axial, frequency, standstill.contact_frequency)
        if touch.spring > 0.0:
            bounce = bounce_spectrum(across, axial, frequency, decay, standstill.contact_frequency, touch)
            bounced = pulse_spectrum(across, axial, frequency, standstill.contact_frequency, bounce)
            raised = np.maximum(raised, bounced / pulse)
        rung, seen = (of * pulse / frequency for of in (np.array([*signals, axial, lateral]), lively))
        along = lateral + ez * v - ey * w - radius * twist
        still = np.zeros(frequency.size)
        moved = across**2 + axial**2
        by_normal, by_friction = [moved * pulse], [still]  # amplitudes in gaps and slip
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
        shares(np.vstack(those), len(contacts), coupled, lasting * raised) for those in (rungs, probed)
    )
    # An event that is late by a share of the contact's duration shifts the phase of fast modes more.
    ratio = frequency / standstill.contact_frequency
    is_fast = ratio > CUTOFF_RATIO
    late = float((lively_share[:, is_fast] @ ratio[is_fast] ** 2).max(initial=1.0))
    return Ringing(np.vstack([share * late, lively_share]), impact)


def contact_motions(model: Model, mode: Floats) -> list[tuple[float, float, Floats]]:
    """Angle and radius (m) of each contact, and what the modes (n_all, n) move there (5, n), as `degrees_of`.

    A bore is met above and beside the rotor.
    """
    found = []
    for stator, rows in zip(model.stators, degrees_of(model), strict=True):
        moved = np.where((rows >= 0)[:, None], mode[rows], 0.0)
        found.append((stator.angle, stator.radius, moved))
        if stator.is_bore:
            v, w, twist, up, aside = moved
            found.append((math.pi / 2, stator.radius, np.array([v, w, twist, aside, -up])))
    return found


def shares(rung: Floats, n_stator: int, coupled: Floats, lasting: Floats) -> Floats:
    """Square of each mode's amplitude over the sum of all modes, of each signal and stator, (r, n).

    Parameters
    ----------
    rung : (n_stator * 2 * r, n)
        By the normal force of each stator, then by its friction.
    coupled : (n, n)
        Squared amplitudes of other modes driven by a mode.
    lasting : (n,)
        Factor of each mode by its decay, and by a possible amplification that the sum omits.
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
    """Amplitudes of the other modes (column) driven by each mode (row), (n, n), relative to it.

    A mode of frequency w with the velocity v acts on another one, of frequency w', with the force `-c v`,
    where c is their entry of `damping` (n, n), 1/s. The relative amplitude of the other is
    `c w / |w'^2 - w^2|`, and 1 in resonance. This concerns mainly modes of the two planes, which gyroscopic
    terms couple.
    """
    driven = np.abs(damping.T) * frequency[:, np.newaxis]
    apart = np.abs(frequency[:, np.newaxis] ** 2 - frequency**2)
    np.fill_diagonal(driven, 0.0)
    return np.divide(driven, apart + driven, out=np.zeros_like(driven), where=driven > 0.0)


def bounce_spectrum(
    across: Floats, axial: Floats, frequency: Floats, decay: Floats, contact_frequency: float, touch: Touch
) -> Floats:
    """Spectrum (n,) of the momentum of the tip's own mass, relative to an impact; 1 for rigid contacts.

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
