"""From the kernels' sums and samples to named signals and measures of the schema."""

from __future__ import annotations

import cmath
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.integrate.measuring.orbit_measures import period, whirl_ratio
from rubhpc.integrate.measuring.regimes import regime
from rubhpc.integrate.measuring.settling import settled
from rubhpc.integrate.record import Record, State
from rubhpc.kernels.accumulators import (
    DAMPING_LOSS,
    DRIVE_WORK,
    FRICTION_LOSS,
    HORIZONTAL,
    IMPACT_LOSS,
    TWIST,
    TWIST_ACCELERATION,
    UNBALANCE_WORK,
    VERTICAL,
    Accumulator,
    Samples,
)
from rubhpc.kernels.force_average import LAST, MOST_PIECES
from rubhpc.schema import DIVERGED, PROBE, VARIABLES, lyapunov_variables, probe_variables

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from numpy.typing import NDArray

    from rubhpc.fem.model import Model, StatorModel
    from rubhpc.integrate.measuring.regimes import Solution
    from rubhpc.schema import Variable
    from rubhpc.study.study import Recording

    Floats = NDArray[np.float64]


_WIDEST = np.array([[-np.inf] * 3, [np.inf] * 3])  # extrema before anything is seen
LEAST_EXCHANGE = 1e-6  # of the mechanical energy: a motion that exchanges less is balanced against that


def empty_samples(n_place: int, n_sample: int, n_probe: int = 0) -> Samples:
    """Room for the samples of a record: one array, so that their spectra are taken together.

    Places (`Model.n_place`) are the stators, then the carriers, whose vertical motion stands for the axial
    one, and whose horizontal motion for the lateral one, then their rotations, as lateral motion.
    """
    first_probe = 4 + 3 * n_place
    whole = np.zeros((first_probe + n_probe, n_sample))
    axial, lateral, force = whole[4:first_probe].reshape(3, n_place, n_sample)
    return Samples(
        rotor=whole[:4],
        axial=axial,
        lateral=lateral,
        force=force,
        probe=whole[first_probe:],
        whole=whole,
    )


def new_accumulator(n_stator: int, n_place: int | None = None) -> Accumulator:
    """Sums at zero, extrema at their neutral ends; places as in `empty_samples`, by default the stators."""
    return _accumulator(
        n_stator,
        n_stator if n_place is None else n_place,
        force_piece=np.zeros((n_stator, LAST + 1, MOST_PIECES)),
        force_held=np.zeros((n_stator, 2), dtype=np.int64),
        origin=np.zeros(1),
    )


def following_accumulator(before: Accumulator, passed: float) -> Accumulator:
    """Sums of what follows in a march that counts its time anew, after `passed` (s) of the march before.

    Means of the contact force reach back beyond it.
    """
    return _accumulator(
        before.impulse.size,
        before.peak_lateral.size,
        force_piece=before.force_piece.copy(),
        force_held=before.force_held.copy(),
        origin=before.origin + passed,
    )


def _accumulator(n_stator: int, n_place: int, **window: Any) -> Accumulator:
    """Sums at zero, but for the window of the mean force; a run-up takes one a revolution."""
    contact_time, impulse, stick_time, friction_work, peak_force, least_slip = np.zeros((6, n_stator))
    n_contact, sense, reversals = np.zeros((3, n_stator), dtype=np.int64)
    highest, lowest = _WIDEST.copy()
    least_slip[:] = np.inf
    return Accumulator(
        highest=highest,
        lowest=lowest,
        is_touching=np.zeros(n_stator, dtype=np.bool_),
        n_contact=n_contact,
        contact_time=contact_time,
        impulse=impulse,
        stick_time=stick_time,
        sense=sense,
        reversals=reversals,
        friction_work=friction_work,
        least_slip=least_slip,
        peak_force=peak_force,
        peak_lateral=np.zeros(n_place),
        energy=np.zeros(5),
        pivots=np.zeros(1, dtype=np.int64),
        residual=np.zeros((3, 2)),
        **window,
    )


def add_sag(samples: Samples, accumulator: Accumulator, model: Model) -> None:
    """Count what output node and probes see from the shaft without loads, not from where it sags to."""
    if not model.sag.any():
        return
    lift_samples(samples.whole, model)
    sag = model.output_sag
    accumulator.highest[:] += sag
    accumulator.lowest[:] += sag


def lift_samples(whole: Floats, model: Model) -> None:
    """Count samples (`Samples.whole`) from the shaft without loads."""
    if not model.sag.any():
        return
    if model.probe is not None:
        whole[4 + 3 * model.n_place :] += model.probe.constant[:, np.newaxis]
    whole[:3] += model.output_sag[:, np.newaxis]


def samples_within(samples: Samples, n_taken: int, limit: float) -> int:
    """Count the samples up to the first whose lateral displacement passes a limit, m, of those taken."""
    lateral = samples.rotor[[VERTICAL, HORIZONTAL], : max(n_taken, 0)]
    beyond = np.flatnonzero(~np.all(np.abs(lateral) <= limit, axis=0))
    return int(beyond[0]) if beyond.size else lateral.shape[1]


def by_name(whole: Floats, model: Model) -> dict[str, Floats]:
    """Rows of `Samples.whole`, or their spectra, by their names in the schema: (n,) or (n_stator, n)."""
    first_probe, n = 4 + 3 * model.n_place, whole.shape[1]
    axial, lateral, force = whole[4:first_probe].reshape(3, model.n_place, n)[:, : len(model.stators)]
    probes = () if model.probe is None else model.probe.probes
    return {
        "vertical": whole[VERTICAL],
        "horizontal": whole[HORIZONTAL],
        "torsion": whole[TWIST],
        "torsion_acceleration": whole[TWIST_ACCELERATION],
        "stator_axial": axial,
        "stator_lateral": lateral,
        "contact_force": force,
    } | {f"{PROBE}{probe.name}": whole[first_probe + i] for i, probe in enumerate(probes)}


def probe_extents(signals: dict[str, Floats]) -> dict[str, float]:
    """Peak to peak of what each probe has sampled."""
    return {
        f"peak_to_peak_{name}": float(np.ptp(signal))
        for name, signal in signals.items()
        if name.startswith(PROBE)
    }


def measures_of(
    accumulator: Accumulator,
    signals: dict[str, Floats],
    *,
    deflection: Floats,
    energy: tuple[float, float],
    stators: tuple[StatorModel, ...],
    spin: float,
    is_round: bool,
    samples_per_revolution: int,
    growth: Iterable[float],
    solve: Callable[[int], Solution | None] | None,
) -> dict[str, Any]:
    """Measures of a finished case; those of a contact that never happened are zero, or NaN where undefined.

    Parameters
    ----------
    deflection : (n_stator,), m
        Largest lateral deflection of each tip (`carried.tip_deflection`).
    energy : (float, float), J
        Mechanical energy at the beginning and at the end of the record.
    spin : float, rad/s
    is_round : bool
        Whether the gap knows that the rim is round (updated normal).
    growth : iterable of float
        How a small displacement grows after the record (`lyapunov.growth`); read where it decides the regime.
    solve : callable, optional
        Finds periodic motions (`proof.Solver`).
    """
    n_sample = signals["vertical"].size
    n_revolution = n_sample // samples_per_revolution
    duration = 2.0 * np.pi * n_revolution / abs(spin)
    has_touched = accumulator.impulse > 0
    is_contact = bool(has_touched.any())
    n_contact = np.maximum(accumulator.n_contact, 1)  # one that lasts throughout never begins in the record
    orbit = signals["vertical"], signals["horizontal"], samples_per_revolution
    verdict = regime(*orbit, period=period(*orbit), is_contact=is_contact, growth=growth, solve=solve)
    rim = stators[0].radius * signals["torsion"]  # m, as the orbit
    force = signals["contact_force"].reshape(len(stators), n_revolution, samples_per_revolution)
    # Drive and friction exchange a hundred times what the vibration feels of them: only their difference
    # counts.
    flows = [
        accumulator.energy[UNBALANCE_WORK],
        accumulator.energy[DRIVE_WORK] - accumulator.energy[FRICTION_LOSS],
        -accumulator.energy[DAMPING_LOSS],
        -accumulator.energy[IMPACT_LOSS],
    ]
    distance, moved = accumulator.residual.T
    exchanged = max(0.5 * np.abs(flows).sum(), LEAST_EXCHANGE * max(energy), np.finfo(float).tiny)
    return {
        "period": verdict.period,
        "regime": verdict.flag,
        "lyapunov_exponent": verdict.exponent,
        "largest_multiplier": abs(verdict.multiplier),
        "multiplier_angle": cmath.phase(verdict.multiplier),
        "whirl_ratio": whirl_ratio(*orbit, spin),
        "contact_fraction": accumulator.contact_time / duration,
        "stick_fraction": np.divide(
            accumulator.stick_time,
            accumulator.contact_time,
            out=np.zeros(len(stators)),
            where=accumulator.contact_time > 0.0,
        ),
        "reversals_per_revolution": accumulator.reversals / n_revolution,
        "contacts_per_revolution": accumulator.n_contact / n_revolution,
        "contact_duration": np.where(has_touched, accumulator.contact_time / n_contact, 0.0),
        "peak_contact_force": accumulator.peak_force,
        "contact_impulse": accumulator.impulse / n_revolution,
        "friction_work": accumulator.friction_work / n_revolution,
        "minimum_slip_speed": np.where(np.isfinite(accumulator.least_slip), accumulator.least_slip, np.nan),
        "force_over_euler_load": accumulator.peak_force / [stator.euler_load for stator in stators],
        "tip_deflection_ratio": deflection / [stator.length for stator in stators],
        "foreshortening_ratio": foreshortening_ratio(
            stators, deflection, accumulator.peak_force, is_round=is_round
        ),
        "peak_torsion": float(max(accumulator.highest[TWIST], -accumulator.lowest[TWIST])),
        "peak_to_peak_vertical": float(accumulator.highest[VERTICAL] - accumulator.lowest[VERTICAL]),
        "peak_to_peak_horizontal": float(accumulator.highest[HORIZONTAL] - accumulator.lowest[HORIZONTAL]),
        "energy_residual": float(abs(sum(flows) - (energy[1] - energy[0])) / exchanged),
        "settled": settled(
            np.stack([*orbit[:2], rim]),
            force.mean(axis=2),
            samples_per_revolution,
            period=verdict.period,
            is_contact=is_contact,
        )
        if verdict.is_reached
        else 0,
        "contact_iterations": int(accumulator.pivots[0]),
        "contact_residual": float(np.divide(distance, moved, out=np.zeros(3), where=moved > 0.0).max()),
    }


def foreshortening_ratio(
    stators: tuple[StatorModel, ...], deflection: Floats, force: Floats, *, is_round: bool
) -> Floats:
    """Return by how much a bent tip changes its gap without the model's knowing, over its compression, (q,).

    A tip at a lateral `deflection` l (q,), m, draws back by 0.6 l^2 / L, and the rim, r away from its centre,
    by l^2 / (2 r); a body without a length or a rim has neither. The compression is the static one under the
    `force` (q,), N; without it the ratio is 0.
    """
    ratio = np.zeros(len(stators))
    for i, stator in enumerate(stators):
        drawn = 0.6 / stator.length if stator.squared_slope is None else 0.0
        away = 0.0 if is_round or stator.radius == 0.0 else 0.5 / stator.radius
        compression = force[i] * stator.axial_compliance
        if compression > 0.0:
            ratio[i] = (drawn + away) * deflection[i] ** 2 / compression
    return ratio


def diverged_record(
    reason: str,
    n_stator: int,
    recording: Recording,
    settings: dict[str, float],
    final: State,
    reached: dict[str, Floats] | None = None,
) -> Record:
    """Record of a case that ran away: its signals as far as it got, and not-a-number elsewhere.

    `reached` holds the samples (..., n) until then; sections are read from them. Spectra and measures are
    those of whole records: a diverged case has none.
    """
    per_revolution = recording.samples_per_revolution
    n_sample = recording.revolutions * per_revolution
    length = {
        "stator": n_stator,
        "sample": n_sample,
        "order": n_sample // 2 + 1,
        "section": recording.revolutions,
    }
    groups: dict[str, dict[str, Any]] = {"waveform": {}, "spectrum": {}, "section": {}, "measure": {}}
    for name, variable in _variables_of(recording).items():
        if variable.role == "measure" and not variable.dims:
            groups["measure"][name] = -1 if variable.dtype.startswith("int") else np.nan
        elif variable.role == "measure" or variable.role in recording.keep:
            groups[variable.role][name] = np.full([length[dim] for dim in variable.dims], np.nan)
    groups["measure"]["regime"] = -1
    for name, values in (reached or {}).items():
        if name in groups["waveform"]:
            groups["waveform"][name][..., : values.shape[-1]] = values
        if f"section_{name}" in groups["section"]:
            once = values[..., ::per_revolution]
            groups["section"][f"section_{name}"][: once.size] = once
    return Record(
        status=DIVERGED,
        reason=reason,
        samples_per_revolution=per_revolution,
        signals=groups["waveform"],
        spectra=groups["spectrum"],
        sections=groups["section"],
        measures=groups["measure"],
        settings=settings,
        final=final,
        probed=recording.probed,
        n_exponent=recording.lyapunov,
    )


def _variables_of(recording: Recording) -> dict[str, Variable]:
    """Variables of a case that is recorded so."""
    return VARIABLES | probe_variables(recording.probed) | lyapunov_variables(recording.lyapunov)
