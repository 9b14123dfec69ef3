"""Samples and accumulators of a record: their arrays, origin, and names in the schema."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.integrate.measuring.rub_in_bores import bore_signals
from rubhpc.kernels.accumulators import (
    HORIZONTAL,
    TWIST,
    TWIST_ACCELERATION,
    VERTICAL,
    Accumulator,
    Samples,
)
from rubhpc.kernels.force_average import LOUD, MOST_PIECES
from rubhpc.schema import PROBE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model

    Floats = NDArray[np.float64]

_WIDEST = np.array([[-np.inf] * 3, [np.inf] * 3])  # extrema before the first sample


def empty_samples(n_place: int, n_sample: int, n_probe: int = 0, n_push: int = 0) -> Samples:
    """Array for the samples of a record: one array, so that their spectra are computed together.

    Places (`Model.n_place`) are the stators, then the carriers, with vertical motion as axial and horizontal
    motion as lateral, then their rotations as lateral motion. `n_push` stators have their forces as vectors.
    """
    first_probe = 4 + 3 * n_place
    whole = np.zeros((first_probe + n_probe + 4 * n_push, n_sample))
    axial, lateral, force = whole[4:first_probe].reshape(3, n_place, n_sample)
    return Samples(
        rotor=whole[:4],
        axial=axial,
        lateral=lateral,
        force=force,
        probe=whole[first_probe : first_probe + n_probe],
        push=whole[first_probe + n_probe :].reshape(n_push, 4, n_sample),
        whole=whole,
    )


def new_accumulator(n_stator: int, n_place: int | None = None) -> Accumulator:
    """Zero accumulator with neutral extrema; places as in `empty_samples`, by default the stators."""
    return _accumulator(
        n_stator,
        n_stator if n_place is None else n_place,
        force_piece=np.zeros((n_stator, LOUD + 1, MOST_PIECES)),
        force_held=np.zeros((n_stator, 2), dtype=np.int64),
        sense=np.zeros(n_stator, dtype=np.int64),
        origin=np.zeros(1),
    )


@cache
def no_record(n_place: int, n_stator: int) -> tuple[Samples, Accumulator]:
    """Empty samples and an accumulator for what is not recorded: kernels do not change them."""
    return empty_samples(n_place, 0), new_accumulator(n_stator)


def following_accumulator(before: Accumulator, passed: float) -> Accumulator:
    """Accumulator of a march that restarts its time, after `passed` (s) of the march before.

    Means of the contact force, and reversals of the slip, include times before the restart.
    """
    pieces = before.force_piece.copy()
    pieces[:, LOUD, 0] = np.inf  # relative to a peak that is reset
    return _accumulator(
        before.impulse.size,
        before.peak_lateral.size,
        force_piece=pieces,
        force_held=before.force_held.copy(),
        sense=before.sense.copy(),
        origin=before.origin + passed,
    )


def _accumulator(n_stator: int, n_place: int, **window: Any) -> Accumulator:
    """Zero accumulator but for the window of the mean force and the sense of slip; run-ups make many."""
    contact_time, impulse, stick_time, friction_work, peak_force, least_slip, turned = np.zeros((7, n_stator))
    n_contact, reversals = np.zeros((2, n_stator), dtype=np.int64)
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
        reversals=reversals,
        friction_work=friction_work,
        least_slip=least_slip,
        turned=turned,
        peak_force=peak_force,
        peak_lateral=np.zeros(n_place),
        energy=np.zeros(6),
        pivots=np.zeros(1, dtype=np.int64),
        residual=np.zeros((3, 2)),
        **window,
    )


def add_sag(samples: Samples, accumulator: Accumulator, model: Model) -> None:
    """Refer output node and probes to the shaft without loads, not to the sagged shaft."""
    if not model.sag.any():
        return
    lift_samples(samples.whole, model)
    sag = model.output_sag
    accumulator.highest[:] += sag
    accumulator.lowest[:] += sag


def lift_samples(whole: Floats, model: Model) -> None:
    """Refer samples (`Samples.whole`) to the shaft without loads."""
    if not model.sag.any():
        return
    if model.probe is not None:
        whole[probe_part(model)] += model.probe.constant[:, np.newaxis]
    whole[:3] += model.output_sag[:, np.newaxis]


def probe_part(model: Model) -> slice:
    """Rows of `Samples.whole` that probes and monitors see."""
    first = 4 + 3 * model.n_place
    return slice(first, first + model.n_probe)


def samples_within(samples: Samples, n_taken: int, limit: float) -> int:
    """Number of samples up to the first whose lateral displacement passes a limit, m."""
    lateral = samples.rotor[[VERTICAL, HORIZONTAL], : max(n_taken, 0)]
    beyond = np.flatnonzero(~np.all(np.abs(lateral) <= limit, axis=0))
    return int(beyond[0]) if beyond.size else lateral.shape[1]


def by_name(whole: Floats, model: Model) -> dict[str, Floats]:
    """Rows of `Samples.whole`, or their spectra, by their names in the schema: (n,) or (n_stator, n)."""
    first_probe, n = 4 + 3 * model.n_place, whole.shape[1]
    axial, lateral, force = whole[4:first_probe].reshape(3, model.n_place, n)[:, : len(model.stators)]
    probes = () if model.probe is None else model.probe.probes
    push = whole[probe_part(model).stop :].reshape(model.n_push, 4, n)
    return (
        {
            "vertical": whole[VERTICAL],
            "horizontal": whole[HORIZONTAL],
            "torsion": whole[TWIST],
            "torsion_acceleration": whole[TWIST_ACCELERATION],
            "stator_axial": axial,
            "stator_lateral": lateral,
            "contact_force": force,
        }
        | {f"{PROBE}{probe.name}": whole[first_probe + i] for i, probe in enumerate(probes)}
        | bore_signals(push)
    )


def probe_extents(signals: dict[str, Floats]) -> dict[str, float]:
    """Peak to peak of each probe's samples."""
    return {
        f"peak_to_peak_{name}": float(np.ptp(signal))
        for name, signal in signals.items()
        if name.startswith(PROBE)
    }
