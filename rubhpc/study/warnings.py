"""What is stated of a study before it runs: unstable rotors, sag beyond the clearance, decay of modes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.fem.assemble import assemble
from rubhpc.fem.stability import decay_message, undamped_message
from rubhpc.fem.statics import sag_remark
from rubhpc.units import typed_quantity

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from rubhpc.study.operating_points import OperatingPoints

_RPM = 30 / math.pi
_MOST_SAGS = 4096  # pairs of rotor and speed whose sag is compared with the clearance, evenly spread
_MOST_RIGS = 8  # whose modes are looked at; of more, an even spread


def warnings_of(points: OperatingPoints) -> tuple[str, ...]:
    """Return a line for each thing that is likely to be a mistake; none as a rule."""
    remark = sag_remark(points.model((0,) * len(points.points.dims)))
    found = (_instability(points), _sag(points), remark, _undamped(points))
    return tuple(line for line in found if line)


def decay_of(points: OperatingPoints) -> str:
    """Which free motion decays slowest, in a line: of a few rigs, each at its highest speed.

    "" of studies without a transient.
    """
    study = points.study
    if study.run_up is not None or study.drive is not None or study.branch is not None:
        return ""
    along, speeds = points.arrays()["spin_speed"]
    of_rig, found = points.dims(*points.rig_axes), []
    for at in _some_rigs(points):
        here = speeds[tuple(at[dim] if dim in of_rig else slice(None) for dim in along)]
        found.append((assemble(points.rig(at)), float(np.abs(here).max())))
    text, recording = decay_message(found), study.recording
    if not text or recording.is_transient_direct:
        return text
    return (
        f"{text}; the study discards {'at most ' * recording.is_transient_auto}{recording.longest_transient}"
    )


def _instability(points: OperatingPoints) -> str:
    """Which speeds have an unstable rotor, and how the first one is unstable."""
    arrays = points.arrays()
    dims, amplitude = arrays["contact_free_amplitude"]
    unstable = np.argwhere(np.isnan(amplitude))
    if not unstable.size:
        return ""
    cases = [_index(points, dims, place) for place in unstable]
    speeds = np.array([points.response(at)[0] * _RPM for at in cases])
    n = f"{len(unstable)} of {amplitude.size} operating points, {_span(speeds)}"
    return f"at {n}: {points.instability(cases[0])}"


def _sag(points: OperatingPoints) -> str:
    """Where a clearance from a ratio is less than the shaft's sag towards a stator."""
    if not points.is_clearance_ratio:
        return ""
    dims, clearance = points.arrays()["clearance"]
    every = np.argwhere(np.ones_like(clearance, dtype=bool))
    spread = every[np.unique(np.linspace(0, len(every) - 1, min(len(every), _MOST_SAGS)).round().astype(int))]
    worst, n_bad, text = 0.0, 0, ""
    for place in spread:
        gap = clearance[tuple(place)]
        overlap = points.sag_beyond(_index(points, dims, place), float(gap))
        n_bad += overlap > 0.0
        if overlap > worst:
            worst = overlap
            text = f"by up to {_length(overlap)} at a clearance of {_length(float(gap))}"
    if not n_bad:
        return ""
    share = f"{n_bad} of {len(spread)}"
    return (
        f"[grid] clearance_ratio: the sag of the shaft exceeds {share} clearances, {text}: it rests on a "
        "stator, and the ratio has little meaning; give clearance instead"
    )


def _undamped(points: OperatingPoints) -> str:
    """Modes that nothing damps, of the first rig that has such, and how many rigs do."""
    found = [undamped_message(assemble(points.rig(at)), points.response(at)[0]) for at in _some_rigs(points)]
    named = [text for text in found if text]
    if not named:
        return ""
    share = "" if len(named) == len(found) else f"at {len(named)} of {len(found)} rigs: "
    return share + named[0]


def _some_rigs(points: OperatingPoints) -> Iterator[tuple[int, ...]]:
    """The index of each of a few rigs, spread evenly over all."""
    dims = points.dims(*points.rig_axes)
    sizes = [points.points.shape[dim] for dim in dims]
    n_rig = math.prod(sizes)
    for number in np.unique(np.linspace(0, n_rig - 1, min(n_rig, _MOST_RIGS)).round().astype(int)):
        yield _index(points, dims, np.unravel_index(number, sizes))


def _index(points: OperatingPoints, dims: Sequence[int], place: Iterable[int]) -> tuple[int, ...]:
    """The index of a case from its place along some dimensions, 0 along the others."""
    along = dict(zip(dims, map(int, place), strict=True))
    return tuple(along.get(dim, 0) for dim in range(len(points.points.dims)))


def _length(size: float) -> str:
    return typed_quantity(float(f"{size:.3g}"), "m")


def _span(speeds: NDArray[np.float64]) -> str:
    low, high = speeds.min(), speeds.max()
    return f"{low:.6g} rpm" if low == high else f"{low:.6g} to {high:.6g} rpm"
