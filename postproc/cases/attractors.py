"""Which motion each start reaches: cases sorted by the solution that was found, or by period and section.

Cases that differ in nothing but their start (axes `initial_*`) share a setting. In each setting the settled
motions are distinguished, and a motion keeps its number from one setting to the next.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import xarray as xr

from postproc.store.axes import axes_of, drawn_axes, refusal
from postproc.store.variables import require_variables
from rubhpc.schema import DONE, INFERRED, REGIME, SECTION_NAMES
from rubhpc.study.axes import coordinate_of
from rubhpc.study.sampling import CASE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]

TOLERANCE = 0.01  # of the section's size: periodic motions that differ by less are one
SAME_MULTIPLIER = 1e-6  # cases whose largest multipliers differ by less may have one solution
OF_ONE_SOLUTION = 3.0  # tolerances: records that agree with one solution to 1 % differ by twice that at most
SPREAD_TOLERANCE = 0.25  # of the same: mean and spread of a section without a period, of a record's length
LONG_PERIOD = 5  # revolutions: a torus passes slowly by a motion of such a period, or a longer one
CLOSED = 1e-4  # of the same: a record that closes less well after its period may be of a torus
SAME_MOTION = 1.0  # of the same: largest change of a motion from one setting to the next
NO_CONTACT = REGIME.index("no_contact")
NO_MOTION = 0  # of a case that is not done, or had not settled
_SECTIONS = tuple(f"section_{name}" for name in SECTION_NAMES)
_TORSION = SECTION_NAMES.index("torsion")  # the displacements come before it
_IF_THERE = ("settled", "largest_multiplier", "multiplier_angle")  # older stores lack some
_START = coordinate_of("initial.")


class _Motions(NamedTuple):
    """The motions of one setting."""

    label: Ints  # (n_case,): 1, 2, ... in the order of `key`; `NO_MOTION` where there is none
    key: list[tuple[bool, int]]  # of each motion: whether it touches, and its period, 0 of none up to 16
    feature: list[Floats]  # (n_section, n_feature) of each: what distinguishes motions of one key, SI units
    size: Floats  # (n_section,): largest coordinate in the setting, of displacements and of torsion, SI units


def start_axes(store: xr.Dataset) -> list[str]:
    """Return the dimensions along which starts differ: axes `initial_*`, or `case` where starts were drawn.

    InputError where none has several values, or what was drawn is not a start alone.
    """
    starts = [axis for axis in axes_of(store) if axis.startswith(_START) and store.sizes[axis] > 1]
    if drawn := drawn_axes(store):
        others = [name for name in drawn if not name.startswith(_START)]
        if others:
            problem = f"{others[0]} was drawn along with the starts, so that no two cases share a setting"
            raise refusal(store, f"basins: {problem}; make it an axis of the grid")
        starts.append(CASE)
    if not starts:
        raise refusal(
            store,
            "basins need starts that differ: an axis of [grid] such as "
            '"initial.vertical" = { start = "-1 mm", stop = "1 mm", num = 21 }',
        )
    return starts


def attractors(store: xr.Dataset, tolerance: float = TOLERANCE) -> xr.DataArray:
    """Return the number of the motion that each case has reached, over the axes of the store.

    Parameters
    ----------
    store : Dataset
        With the sections kept.
    tolerance : float
        Relative to the largest coordinate of the section in the setting: periodic motions of one period are
        one where their last points, in any order, differ by less.

    Returns
    -------
    DataArray of int
        1, 2, ...; `NO_MOTION` (0) where the case is not done, or had not settled. A motion has the number of
        the motion most like it in the setting before, on the last axis that has one, if both have the same
        period and are near (`SAME_MOTION`), or the only ones of that period. Numbers do not depend on the
        order of the cases. Cases that a refined map has inferred take the motion of the nearest computed case
        with their regime and period.

    Notes
    -----
    Where the periodic solution was found by shooting, it distinguishes motions: cases are of one if their
    largest Floquet multipliers agree to `SAME_MULTIPLIER` and their sections, a shift by revolutions aside,
    to `OF_ONE_SOLUTION` tolerances (mirrored solutions have the same multipliers). A periodic case without a
    solution is of the nearest of these motions whose section is within the tolerance, if any. Motions without
    a period up to 16, on a torus or chaotic, are compared by mean and standard deviation of their section, to
    `SPREAD_TOLERANCE`: two tori of about one place and size count as one. So are those that may pass for a
    long period, where a torus repeats to within the tolerance of regimes: from `LONG_PERIOD` on, of no
    solution and with a record that closes no better than `CLOSED`. Cases are joined by single linkage. The
    torsion of motions without contact decays and is not compared.
    """
    require_variables(store, ["regime", "period", *_SECTIONS])
    starts = start_axes(store)
    dims = [str(d) for d in store["status"].dims]
    settings = [d for d in dims if d not in starts]
    ordered = store.sortby([d for d in settings if store[d].dtype.kind in "fiu"]) if settings else store
    names = ["status", "regime", "period", *_SECTIONS, *(n for n in _IF_THERE if n in store)]
    cases = ordered[names].load().transpose(*settings, *starts, ...)
    shape = tuple(cases.sizes[d] for d in settings)
    number = np.zeros((*shape, int(np.prod([cases.sizes[d] for d in starts]))), dtype=np.int64)
    known: dict[tuple[int, ...], tuple[_Motions, list[int]]] = {}
    n_known = 0
    for place in np.ndindex(*shape):
        motions = _motions_of(cases.isel(dict(zip(settings, place, strict=True))), tolerance)
        before = _before(place)
        given = _carried_on(motions, *known[before]) if before is not None else [0] * len(motions.key)
        for i, n in enumerate(given):
            if n == 0:
                n_known += 1
                given[i] = n_known
        known[place] = motions, given
        number[place] = np.array([NO_MOTION, *given])[motions.label]
    number = number.reshape(cases["status"].shape)
    _take_from_surroundings(number, cases)
    found = xr.DataArray(
        number.astype(np.int16),
        dims=cases["status"].dims,
        coords=cases["status"].coords,
        name="attractor",
        attrs={"units": "1", "long_name": "Motion reached"},
    )
    indexes = {d: store.indexes[d] for d in dims if d in store.indexes}
    return found.reindex(indexes).transpose(*dims)


def _motions_of(setting: xr.Dataset, tolerance: float = TOLERANCE) -> _Motions:
    """Distinguish the motions of one setting: loaded cases that differ in their starts alone."""
    status, regime, period = (setting[n].values.ravel() for n in ("status", "regime", "period"))
    sections = np.stack([setting[n].values.reshape(status.size, -1) for n in _SECTIONS], axis=1)
    has_motion = status == DONE
    if "settled" in setting:
        has_motion &= setting["settled"].values.ravel() != 0
    size = np.zeros(sections.shape[1])
    if has_motion.any():
        size = np.abs(sections[has_motion]).max(axis=(0, 2))
        size[:_TORSION] = size[:_TORSION].max()  # displacements, of which one may be nothing
    size = np.where(size > 0.0, size, 1.0)
    label = np.zeros(status.size, dtype=np.int64)
    keys: list[tuple[bool, int]] = []
    features: list[Floats] = []
    is_contact = regime != NO_CONTACT
    multiplier = _multipliers(setting)
    scaled = sections / size[:, np.newaxis]
    period = _without_tori(period, scaled, is_contact & has_motion, multiplier, tolerance)
    for key in sorted({*zip(is_contact[has_motion].tolist(), period[has_motion].tolist(), strict=True)}):
        members = np.flatnonzero(has_motion & (is_contact == key[0]) & (period == key[1]))
        scaled = sections[members] / size[:, np.newaxis]
        if not key[0]:
            scaled[:, _TORSION] = 0.0
        feature, within = _features(scaled, key[1], tolerance)
        group = _grouped(feature, within, multiplier[members]) if key[1] > 0 else _joined(feature, within)
        middles = [np.median(feature[group == g], axis=0) for g in range(group.max() + 1)]
        order = sorted(range(len(middles)), key=lambda g: tuple(np.round(middles[g] / within)))
        for g in order:
            keys.append(key)
            features.append(middles[g].reshape(size.size, -1) * size[:, np.newaxis])
            label[members[group == g]] = len(keys)
    return _Motions(label, keys, features, size)


def _features(sections: Floats, period: int, tolerance: float) -> tuple[Floats, float]:
    """What distinguishes motions of one period (n_case, n_feature), and how near counts as one.

    Points are sorted, coordinate by coordinate: a shift by revolutions, which a start may cause, changes
    nothing.
    """
    if 0 < period <= sections.shape[2]:
        return np.sort(sections[:, :, -period:], axis=2).reshape(len(sections), -1), tolerance
    both = np.stack([sections.mean(axis=2), sections.std(axis=2)], axis=2)
    return both.reshape(len(sections), -1), SPREAD_TOLERANCE


def _without_tori(
    period: Ints,
    sections: Floats,
    is_contact: NDArray[np.bool_],
    multiplier: NDArray[np.complex128],
    tolerance: float,
) -> Ints:
    """Return the periods, (n_case,), 0 where a motion in contact may be on a torus that passes for a period.

    `sections` are (n_case, n_section, n_point), in units of the sizes of the setting.
    """
    found = period.copy()
    is_solved = np.isfinite(multiplier)
    n_point = sections.shape[2]
    for long in np.unique(period[is_contact & (period >= LONG_PERIOD)]).tolist():
        cases = np.flatnonzero(is_contact & (period == long) & ~is_solved)
        if not len(cases) or n_point <= long:
            continue
        drift = np.abs(sections[cases, :, long:] - sections[cases, :, :-long]).max(axis=(1, 2))
        cases = cases[drift > CLOSED]
        solved = np.flatnonzero(is_contact & (period == long) & is_solved)
        if len(solved) and len(cases):
            feature, within = _features(sections, long, tolerance)
            near = [np.abs(feature[i] - feature[solved]).max(axis=1).min() <= within for i in cases]
            cases = cases[~np.array(near)]
        found[cases] = 0
    return found


def _multipliers(setting: xr.Dataset) -> NDArray[np.complex128]:
    """Largest Floquet multiplier of each case, (n_case,); NaN where no solution was found."""
    if "largest_multiplier" not in setting or "multiplier_angle" not in setting:
        return np.full(setting["status"].size, np.nan + 0j)
    size, angle = (setting[n].values.ravel() for n in ("largest_multiplier", "multiplier_angle"))
    return np.asarray(size * np.exp(1j * angle))


def _grouped(feature: Floats, within: float, multiplier: NDArray[np.complex128]) -> Ints:
    """Groups of periodic motions of one period, numbered from 0, (n_case,): by solution where found."""
    is_solved = np.isfinite(multiplier)
    group = np.full(len(feature), -1)
    n_group = 0
    if is_solved.any():
        solved, found = feature[is_solved], multiplier[is_solved]
        scale = within / SAME_MULTIPLIER  # a difference of that counts as one of the tolerance
        columns = [solved / OF_ONE_SOLUTION, scale * found.real[:, None], scale * found.imag[:, None]]
        group[is_solved] = _joined(np.concatenate(columns, axis=1), within)
        n_group = int(group.max()) + 1
        middles = np.stack([np.median(feature[group == g], axis=0) for g in range(n_group)])
        for i in np.flatnonzero(~is_solved):
            apart = np.abs(feature[i] - middles).max(axis=1)
            if apart.min() <= within:
                group[i] = int(apart.argmin())
    rest = group < 0
    if rest.any():
        group[rest] = n_group + _joined(feature[rest], within)
    return group


def _take_from_surroundings(number: Ints, cases: xr.Dataset) -> None:
    """Give inferred cases, in place, the motion of the nearest computed case of their regime and period."""
    from scipy.ndimage import distance_transform_edt

    status, period = cases["status"].values, cases["period"].values
    is_contact = cases["regime"].values != NO_CONTACT
    is_inferred = status == INFERRED
    for key in {*zip(is_contact[is_inferred].tolist(), period[is_inferred].tolist(), strict=True)}:
        is_like = (is_contact == key[0]) & (period == key[1])
        known = is_like & (number != NO_MOTION)
        if known.any():
            nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
            here = is_inferred & is_like
            number[here] = number[tuple(nearest)][here]


def _joined(feature: Floats, within: float) -> Ints:
    """Groups of single linkage in the largest coordinate difference, numbered from 0, (n_case,)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    # Of the many starts that reach the same motion one stands for all: pairs would be counted by its square.
    cells, at = np.unique(np.round(feature / (0.125 * within)), axis=0, return_inverse=True)
    pairs = cKDTree(cells).query_pairs(8.0, p=np.inf, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(cells),) * 2)
    group: Ints = connected_components(graph, directed=False)[1][at.ravel()].astype(np.int64)
    return group


def _before(place: tuple[int, ...]) -> tuple[int, ...] | None:
    """Place of the setting before: one step back on the last axis that has one; None of the first."""
    for i in reversed(range(len(place))):
        if place[i]:
            return (*place[:i], place[i] - 1, *place[i + 1 :])
    return None


def _carried_on(motions: _Motions, before: _Motions, numbers: Sequence[int]) -> list[int]:
    """Number of each motion: that of the motion most like it in the setting before; 0 where it is new."""
    from scipy.optimize import linear_sum_assignment

    cost = np.full((len(motions.key), len(before.key)), 2.0 * SAME_MOTION)
    size = np.maximum(motions.size, before.size)[:, np.newaxis]
    for i, key in enumerate(motions.key):
        for j, other in enumerate(before.key):
            if key == other:
                change = np.abs((motions.feature[i] - before.feature[j]) / size).max()
                is_only = motions.key.count(key) == before.key.count(key) == 1
                cost[i, j] = 0.0 if is_only else change
    given = [0] * len(motions.key)
    for i, j in zip(*linear_sum_assignment(cost), strict=True):
        if cost[i, j] < SAME_MOTION:
            given[i] = numbers[j]
    return given
