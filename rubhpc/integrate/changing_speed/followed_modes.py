"""Contact modes that follow the speed: polynomials through those of three speeds in a range.

Eigenvectors of the speeds at either side are brought to the length and phase that those in the middle see as
theirs (`near_modes`), so that exponents, shapes, their inverse and what is made of them go smoothly:
parabolas follow them, with errors of the third order in the range. The inverse has to be their inverse, or
each event would lose or gain motion: it is exact at seven places, and goes through these by polynomials of
the sixth order. With the
acceleration, which changes the matrices little, all of it goes evenly: from that in the middle to that of
another acceleration there.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.changing_speed.near_modes import weights
from rubhpc.kernels.varying import Course, Varying

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.kernels.retuning import HeldMode

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Ints = NDArray[np.int64]
A = TypeVar("A", Floats, Complexes)

# Places of the three speeds in the range, and of those where the inverse is exact, the middle first: these
# are zeros of Chebyshev's polynomial.
NODES = 0.0, -0.8, 0.8
EXACT = 0.0, *(sign * math.cos(k * math.pi / 14.0) for k in (5, 3, 1) for sign in (-1.0, 1.0))
POWERS = {len(places): np.linalg.inv(np.vander(places, increasing=True)) for places in (NODES, EXACT)}
JUDGED = -1.0, -0.62, 0.62, 1.0  # places between those, at which the inverse is judged
MOST_LOST = 1e-4  # share of a mode in another, beyond which modes go with the speed too fast
FAR = 0.5  # share of a mode in another of a speed beside it, over its own, from which it is not the same
EQUAL = 1e-9  # relative difference of two exponents that repeat
STILL, LEAST = 1e-13, 1e-16  # change of an entry over it, and over the greatest, below which it stays
NONE = Course(np.zeros(0, dtype=np.int64), np.zeros((1, 0)), np.zeros(0))
NOTHING = Varying(np.zeros(0), *[NONE] * (len(Varying._fields) - 1))
_TABLES = "motion", "switch", "slip"
_HELD = "exponent", "switch", "output", "row"
_OF_RIM = "motion", "switch", "fixed", "rate", "row"
_RIM = "rim "


class Node(NamedTuple):
    """A contact mode of one speed, and what of it and of its tables goes with the speed."""

    mode: ContactMode
    held: HeldMode
    motion: Complexes  # (2 n, width)
    switch: Complexes  # (r, width)
    slip: Complexes  # (q, width)

    @classmethod
    def of(cls, mode: ContactMode, held: HeldMode, slip: Floats) -> Node:
        """That of a mode; `slip` (q, n) are slip speeds with the motion."""
        end, n = mode.exponent.size, slip.shape[1]
        motion, switch, slipping = (
            np.zeros((rows, held.exponent.size), dtype=np.complex128)
            for rows in (2 * n, len(mode.switch), len(slip))
        )
        motion[:, :end], switch[:, :end], slipping[:, :end] = mode.motion, mode.switch, slip @ mode.motion[n:]
        return cls(mode, held, motion, switch, slipping)


def between(values: Sequence[A], place: float) -> A:
    """What goes through values at `NODES` or `EXACT`, the middle first, at a place in the range."""
    middle, *others = values
    shares = shares_of(place, len(values))
    found: A = middle + sum(share * (other - middle) for share, other in zip(shares, others, strict=True))
    return found


def matched(mode: ContactMode, other: ContactMode) -> ContactMode | None:
    """Another speed's mode in the order, lengths and phases of `mode`; None where it is another motion."""
    m = mode.n_eigenmode
    if other.n_eigenmode != m or other.exponent.size != mode.exponent.size:
        return None
    enter, motion = mode.enter[:m], other.motion[:, :m]
    weight = weights(mode)
    seen = enter @ motion / weight[:, np.newaxis]
    if (found := aligned(seen, mode.exponent[:m])) is None:
        return None
    place, turn = found
    if np.any(weights(other)[place] != weight):
        return None
    is_same = (motion[:, place] == mode.motion[:, :m]).all(axis=0)
    turn[:, is_same] = np.eye(m)[:, is_same]
    back = np.linalg.inv(turn)
    shapes, entered, switch = other.motion.copy(), other.enter.copy(), other.switch.copy()
    exponent, take_off = other.exponent.copy(), other.take_off.copy()
    shapes[:, :m] = other.motion[:, place] @ back
    switch[:, :m] = other.switch[:, place] @ back
    entered[:m] = turn @ other.enter[place]
    take_off[:, :m] = other.take_off[:, place] @ turn.T
    exponent[:m] = other.exponent[place]
    return replace(other, exponent=exponent, motion=shapes, enter=entered, take_off=take_off, switch=switch)


def aligned(seen: Complexes, exponent: Complexes) -> tuple[NDArray[np.int64], Complexes] | None:
    """Which modes (m,) of another speed are those seen here, and what they are of these, (m, m).

    None where they are others.

    Parameters
    ----------
    seen : (m, m)
        Modes of the other speed in coordinates of those here, by columns.
    exponent : (m,), 1/s
        Of those here; modes whose exponents repeat are taken together.
    """
    groups, m = _groups(exponent), exponent.size
    first = np.array([group[0] for group in groups])
    squares = np.abs(seen) ** 2
    repeated = [group for group in groups if group.size > 1]
    for group in repeated:
        squares[group[0]] = squares[group].sum(axis=0)
    of_group = squares[first].argmax(axis=0)
    if np.any(np.bincount(of_group, minlength=len(groups)) != [group.size for group in groups]):
        return None
    place = np.empty(m, dtype=np.int64)
    place[np.concatenate(groups)] = np.argsort(of_group, kind="stable")
    seen = seen[:, place]
    turn = np.diag(np.diag(seen))
    for group in repeated:
        turn[np.ix_(group, group)] = seen[np.ix_(group, group)]
    own = np.linalg.norm(turn, axis=0)
    if np.any(np.abs(seen - turn).max(axis=0, initial=0.0) > FAR * own):
        return None
    return place, turn


def followed(nodes: Sequence[Node], risen: Node | None, entered: Entries, seen: Complexes) -> HeldMode:
    """What is held of the mode in the middle, with what of it goes with the speed and its acceleration.

    `nodes` are those at `NODES`, the middle first; `risen` is that in the middle at another
    acceleration, if any; `entered` is what enters them (`entries`), `seen` (n,) what constraints leave of
    the unbalance.
    """
    middle, mode = nodes[0], nodes[0].mode
    held, m, n = middle.held, mode.n_eigenmode, seen.size
    of_all, n_node = [*nodes, *([risen] if risen else [])], len(nodes)
    courses = {}
    for name in _TABLES:
        values = np.array([getattr(node, name) for node in of_all])
        courses[name + "_re"] = _through(values.real, m, n_node)
        courses[name + "_im"] = _through(values.imag, m, n_node)
    enter, take_off = entered.enter, entered.take_off
    padded = np.zeros((len(enter), *middle.motion.shape), dtype=np.complex128)
    padded[:, :, :m] = enter.transpose(0, 2, 1)
    constant = np.zeros((len(enter), take_off.shape[1], 2, middle.motion.shape[1]))
    constant[..., 0, :m], constant[..., 1, :m] = take_off.real, take_off.imag
    for name, values in (("enter_re", padded.real), ("enter_im", padded.imag), ("enter_constant", constant)):
        courses[name] = _through(values, m, len(EXACT), skips_response=False)
    shape: dict[str, Any] = {name: [getattr(node.held, name) for node in of_all] for name in _HELD}
    entry: dict[str, Any] = {
        "drive": enter[:, :, n:] @ seen,
        "mirrored_drive": enter[:, :, n:].conj() @ seen,
    }
    if held.rim.one >= 0:
        shape |= {_RIM + name: [getattr(node.held.rim, name) for node in of_all] for name in _OF_RIM}
        entry[_RIM + "entered"] = constant[:, -1, 0] + 1j * constant[:, -1, 1]
    kept, views, places = _room({name: values[0] for name, values in (shape | entry).items()})

    def moved(arrays: dict[str, Any], count: int) -> Course:
        found = []
        for name, values in arrays.items():
            course = _through(values, m, count, skips_response=name in ("exponent", "row"))
            found.append(course._replace(at=course.at + places[name]))
        return _joined(found)

    shapes, entries = moved(shape, n_node), moved(entry, len(EXACT))
    varying = Varying(kept=kept, kept_shape=shapes, kept_entry=entries, **courses)
    rim = {name.removeprefix(_RIM): view for name, view in views.items() if name.startswith(_RIM)}
    own = {name: view for name, view in views.items() if not name.startswith(_RIM)}
    return held._replace(**own, rim=held.rim._replace(**rim), varying=varying)


def taken(course: Course, values: Floats, place: float, rise: float) -> Floats:
    """A copy of an array with what goes with the speed at a place in the range, and of the acceleration."""
    found = values.copy()
    found.reshape(-1)[course.at] = np.polynomial.polynomial.polyval(place, course.value) + rise * course.rise
    return found


def _groups(exponent: Complexes) -> list[NDArray[np.int64]]:
    """Places of the exponents, those that repeat together."""
    near = np.abs(exponent[:, np.newaxis] - exponent) <= EQUAL * np.abs(exponent)
    if near.sum() == exponent.size:
        return list(np.arange(exponent.size)[:, np.newaxis])
    return [np.array(group) for group in sorted({tuple(np.flatnonzero(row)) for row in near})]


class Entries(NamedTuple):
    """What enters a mode of m eigenmodes that follows the speed, at `EXACT`, and at another acceleration."""

    enter: Complexes  # (7, m, 2 n), or (8, m, 2 n) with that at another acceleration
    take_off: Complexes  # (7, c, m), of constants
    lost: float  # share of a mode in another, at most, by which it is no inverse between these places


def shares_of(place: float, count: int) -> Floats:
    """What goes through values at `count` places has of each but the first, less that, at a place."""
    powers: Floats = place ** np.arange(count, dtype=np.float64)
    shares: Floats = (powers @ POWERS[count])[1:]
    return shares


def _through(values: Any, m: int, n_node: int, *, skips_response: bool = True) -> Course:
    """What goes through the first `n_node` arrays, and to that at another acceleration if there is one more.

    The response to unbalance, m, is left out.
    """
    values = np.array(values)  # a copy
    values[1:] -= values[0]
    if skips_response and values.ndim > 1 and values.shape[-1] > m:
        values[1:, ..., m] = 0.0
    flat = values.view(np.float64).reshape(len(values), -1)
    size = np.abs(flat[1:]).max(axis=0, initial=0.0)
    at = np.flatnonzero(size > np.maximum(STILL * np.abs(flat[0]), LEAST * size.max(initial=0.0)))
    moved = np.ascontiguousarray(flat[:, at])
    factors = POWERS[n_node][:, 1:] @ moved[1:n_node]
    factors[0] += moved[0]
    return Course(at, factors, moved[n_node] if len(moved) > n_node else np.zeros(at.size))


def _joined(courses: list[Course]) -> Course:
    at = np.concatenate([course.at for course in courses])
    value = np.concatenate([course.value for course in courses], axis=1)
    return Course(at, value, np.concatenate([course.rise for course in courses]))


def _room(arrays: dict[str, Any]) -> tuple[Floats, dict[str, Any], dict[str, int]]:
    """One memory for arrays, with their values: it, the arrays in it, and where each begins."""
    ends = np.cumsum([0, *(value.size * (2 if np.iscomplexobj(value) else 1) for value in arrays.values())])
    memory, views, places = np.zeros(int(ends[-1])), {}, {}
    for (name, value), first, end in zip(arrays.items(), ends[:-1], ends[1:], strict=True):
        view = memory[first:end].view(value.dtype).reshape(value.shape)
        view[:] = value
        views[name], places[name] = view, int(first)
    return memory, views, places
