"""From the kernels' sums and samples to the measures of the schema."""

from __future__ import annotations

import cmath
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.integrate.measuring.orbit_measures import whirl_ratio
from rubhpc.integrate.measuring.settling import NEGLIGIBLE, heard, settled
from rubhpc.kernels.accumulators import (
    DAMPING_LOSS,
    HORIZONTAL,
    IMPACT_LOSS,
    RUB_WORK,
    TWIST,
    UNBALANCE_WORK,
    VERTICAL,
    Accumulator,
)
from rubhpc.rig.probes import MOTIONS, TWISTS
from rubhpc.schema import PROBE

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.measuring.regimes import Verdict

    Floats = NDArray[np.float64]
    Judge = Callable[[Floats, Floats, int, bool], Verdict]


LEAST_EXCHANGE = 1e-6  # of the mechanical energy: least reference of the energy residual


def measures_of(
    accumulator: Accumulator,
    signals: dict[str, Floats],
    *,
    energy: tuple[float, float],
    model: Model,
    spin: float,
    samples_per_revolution: int,
    judge: Judge,
) -> dict[str, Any]:
    """Measures of a finished case; those of a contact that never happened are zero, or NaN where undefined.

    Parameters
    ----------
    energy : (float, float), J
        Mechanical energy at the beginning and at the end of the record.
    spin : float, rad/s
    judge : callable
        Judges the orbit: `regimes.regime`, or `regimes.known_regime` of a motion that was solved for.
    """
    n_sample = signals["vertical"].size
    n_revolution = n_sample // samples_per_revolution
    duration = 2.0 * np.pi * n_revolution / abs(spin)
    is_contact = bool((accumulator.impulse > 0.0).any())
    orbit = signals["vertical"], signals["horizontal"], samples_per_revolution
    verdict = judge(*orbit, is_contact)
    multiplier = verdict.multiplier
    # Drive and friction exchange a hundred times the energy that reaches the vibration, and for a rotor that
    # stands nothing else: only their difference counts.
    flows = [
        accumulator.energy[UNBALANCE_WORK],
        accumulator.energy[RUB_WORK],
        -accumulator.energy[DAMPING_LOSS],
        -accumulator.energy[IMPACT_LOSS],
    ]
    distance, moved = accumulator.residual.T
    exchanged = max(0.5 * np.abs(flows).sum(), LEAST_EXCHANGE * max(energy), np.finfo(float).tiny)
    return {
        "period": verdict.period,
        "regime": verdict.flag,
        "lyapunov_exponent": verdict.exponent,
        # Python's abs() of a complex NaN may raise a pending floating-point error.
        "largest_multiplier": math.nan if cmath.isnan(multiplier) else abs(multiplier),
        "multiplier_angle": cmath.phase(multiplier),
        "whirl_ratio": whirl_ratio(*orbit, spin),
        **contact_measures(accumulator, n_revolution, duration),
        "peak_torsion": float(max(accumulator.highest[TWIST], -accumulator.lowest[TWIST])),
        "peak_to_peak_vertical": float(accumulator.highest[VERTICAL] - accumulator.lowest[VERTICAL]),
        "peak_to_peak_horizontal": float(accumulator.highest[HORIZONTAL] - accumulator.lowest[HORIZONTAL]),
        "energy_residual": float(abs(sum(flows) - (energy[1] - energy[0])) / exchanged),
        "settled": _settled(verdict, signals, model, spin, samples_per_revolution, is_contact),
        "contact_iterations": int(accumulator.pivots[0]),
        "contact_residual": float(np.divide(distance, moved, out=np.zeros(3), where=moved > 0.0).max()),
    }


def contact_measures(accumulator: Accumulator, n_revolution: int, duration: float) -> dict[str, Floats]:
    """Measures (q,) of the contacts of a record of so many revolutions and its duration, s."""
    n_contact = np.maximum(accumulator.n_contact, 1)  # a permanent contact does not begin in the record
    has_touched, time = accumulator.impulse > 0.0, accumulator.contact_time
    return {
        "contact_fraction": time / duration,
        "stick_fraction": np.divide(accumulator.stick_time, time, out=np.zeros(time.size), where=time > 0.0),
        "reversals_per_revolution": accumulator.reversals / n_revolution,
        "contacts_per_revolution": accumulator.n_contact / n_revolution,
        "contact_duration": np.where(has_touched, time / n_contact, 0.0),
        "peak_contact_force": accumulator.peak_force,
        "contact_impulse": accumulator.impulse / n_revolution,
        "friction_work": accumulator.friction_work / n_revolution,
        "minimum_slip_speed": np.where(np.isfinite(accumulator.least_slip), accumulator.least_slip, np.nan),
    }


def _settled(
    verdict: Verdict,
    signals: dict[str, Floats],
    model: Model,
    spin: float,
    samples_per_revolution: int,
    is_contact: bool,
) -> int:
    """Flag of `schema.SETTLED`."""
    if verdict.repeats or not verdict.is_reached:
        return int(verdict.repeats)
    rim = model.stators[0].radius * signals["torsion"]  # m, as the orbit
    force = signals["contact_force"].reshape(len(signals["contact_force"]), -1, samples_per_revolution)
    return settled(
        np.stack([signals["vertical"], signals["horizontal"], rim]),
        force.mean(axis=2),
        samples_per_revolution,
        period=verdict.period,
        is_contact=is_contact,
        others=_others(signals, model, abs(spin), samples_per_revolution),
    )


def _others(
    signals: dict[str, Floats], model: Model, spin: float, samples_per_revolution: int
) -> list[Floats]:
    """What is to settle besides the motion of the rim: twist, stators and probes."""
    radius = model.stators[0].radius
    orbit = math.sqrt(float(signals["vertical"].var() + signals["horizontal"].var()))
    of_motion = dict(zip(MOTIONS, orbit * spin ** np.arange(3), strict=True))
    of_twist = dict(
        zip(TWISTS, orbit / radius * spin ** np.arange(3) if radius > 0.0 else np.zeros(3), strict=True)
    )
    scale = of_motion | of_twist
    turns = signals["torsion"].reshape(-1, samples_per_revolution)  # differences within each of them
    rate = np.diff(turns, axis=1, append=turns[:, -1:]).ravel() * (
        spin * samples_per_revolution / (2.0 * np.pi)
    )
    heard_of = [
        ("displacement", signals["stator_axial"]),
        ("displacement", signals["stator_lateral"]),
        ("twist", signals["torsion"][np.newaxis]),
        ("twist_rate", rate[np.newaxis]),
        ("twist_acceleration", signals["torsion_acceleration"][np.newaxis]),
    ]
    probes = () if model.probe is None else model.probe.probes
    heard_of += [(probe.quantity, signals[f"{PROBE}{probe.name}"][np.newaxis]) for probe in probes]
    return [
        heard(
            signal,
            samples_per_revolution,
            NEGLIGIBLE * float(scale.get(quantity, 0.0)),
            jumps=quantity not in (*MOTIONS[:2], *TWISTS[:2]),
        )
        for quantity, signal in heard_of
    ]
