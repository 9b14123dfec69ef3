"""Contact modes that follow the speed: polynomials through those of three speeds in a range.

Eigenvectors of the speeds at either side are brought to the length and phase that those in the middle see as
theirs, so that exponents, shapes and what is made of them go smoothly: parabolas follow them, with errors of
the third order in the range. What enters them, the inverse of the shapes, has to be their inverse exactly, or
each event would lose or gain motion: Newton's method makes it so at five places of the range, and polynomials
of the fourth order go through these.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels.varying import Course, Varying

if TYPE_CHECKING:
    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.kernels.contact_modes import ModeTables
    from rubhpc.kernels.retuning import HeldMode

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
A = TypeVar("A", Floats, Complexes)

NODE = 0.8  # places at either side, over half of the range: the error is greatest at its ends
PLACES = np.array([0.0, -0.5, 0.5, -1.0, 1.0])  # where what enters is made exact
POWERS = np.linalg.inv(np.vander(PLACES, increasing=True))
NEWTON, EXACT = 6, 1e-9  # steps at most, and share of a mode in another that needs no more than one
FAR = 0.5  # share of a mode in another of a speed beside it, over its own, from which it is not the same
EQUAL = 1e-9  # relative difference of two exponents that repeat
STILL, LEAST = 1e-13, 1e-16  # change of an entry over it, and over the greatest, below which it stays
NONE = Course(np.zeros(0, dtype=np.int64), np.zeros((1, 0)))
NOTHING = Varying(np.zeros(0), *[NONE] * (len(Varying._fields) - 1))
_TABLES = "motion_re", "motion_im", "switch_re", "switch_im", "slip_re", "slip_im"
_HELD = "exponent", "motion", "switch", "output", "row"
_RIM = "motion", "switch", "fixed", "rate", "row"


class Tabulated(NamedTuple):
    """A contact mode of one speed, its tables, and what of it is held."""

    mode: ContactMode
    row: ModeTables
    held: HeldMode


def parabola(values: tuple[A, A, A], place: float) -> A:
    """What goes through values in the middle, before and behind it, at a place in the range."""
    middle, before, behind = values
    x = place / NODE
    found: A = middle + 0.5 * x * (behind - before) + x * x * (0.5 * (behind + before) - middle)
    return found


def matched(mode: ContactMode, other: ContactMode) -> ContactMode | None:
    """Another speed's mode in the order, lengths and phases of `mode`; None where it is another motion."""
    m = mode.n_eigenmode
    if other.n_eigenmode != m or other.exponent.size != mode.exponent.size:
        return None
    enter, motion = mode.enter[:m], other.motion[:, :m]
    weight = _weights(mode)
    seen = enter @ motion / weight[:, np.newaxis]
    if (found := aligned(seen, mode.exponent[:m])) is None:
        return None
    place, turn = found
    if np.any(_weights(other)[place] != weight):
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


def followed(nodes: tuple[Tabulated, Tabulated, Tabulated], seen: Complexes) -> HeldMode:
    """What is held of the mode in the middle, with what of it goes with the speed.

    `nodes` are those in the middle of the range, before and behind it; `seen` (n,) is what constraints leave
    of the unbalance.
    """
    middle, mode = nodes[0], nodes[0].mode
    held, m, n = middle.held, mode.n_eigenmode, seen.size
    courses: dict[str, Course] = {}
    for name in _TABLES:
        values = [getattr(node.row, name)[0] for node in nodes]
        courses[name] = _course(_through(values, m))
    enter, take_off = _entries(nodes)
    padded = np.zeros((len(PLACES), *middle.row.enter_re.shape[1:]), dtype=np.complex128)
    padded[:, :, :m] = enter.transpose(0, 2, 1)
    courses["enter_re"] = _course(POWERS @ padded.real.reshape(len(PLACES), -1))
    courses["enter_im"] = _course(POWERS @ padded.imag.reshape(len(PLACES), -1))
    constant = np.zeros((len(PLACES), *middle.row.enter_constant.shape[1:]))
    constant[..., 0, :m], constant[..., 1, :m] = take_off.real, take_off.imag
    courses["enter_constant"] = _course(POWERS @ constant.reshape(len(PLACES), -1))
    shape = {name: [getattr(node.held, name) for node in nodes] for name in _HELD}
    entry = {"drive": enter[:, :, n:] @ seen, "mirrored_drive": enter[:, :, n:].conj() @ seen}
    of_rim: dict[str, list[Any]] = {}
    if held.rim.one >= 0:
        of_rim = {name: [getattr(node.held.rim, name) for node in nodes] for name in _RIM}
        last = constant[:, -1]
        entry["entered"] = last[:, 0] + 1j * last[:, 1]
    kept, views, places = _room({name: values[0] for name, values in (shape | entry).items()}, of_rim)
    shapes, entries = [], []
    for name, values in [*shape.items(), *(("rim " + key, value) for key, value in of_rim.items())]:
        shapes.append(_moved(_course(_through(values, m, name in ("exponent", "row"))), places[name]))
    for name, value in entry.items():
        flat = np.ascontiguousarray(value).view(np.float64).reshape(len(PLACES), -1)
        entries.append(_moved(_course(POWERS @ flat), places[name]))
    rim = {name.removeprefix("rim "): view for name, view in views.items() if name.startswith("rim ")}
    if "entered" in views:
        rim["entered"] = views.pop("entered")
    own = {name: view for name, view in views.items() if not name.startswith("rim ")}
    varying = Varying(kept=kept, kept_shape=_joined(shapes, 3), kept_entry=_joined(entries, 5), **courses)
    return held._replace(**own, rim=held.rim._replace(**rim), varying=varying)


def taken(course: Course, values: Floats, place: float) -> Floats:
    """A copy of an array with the entries that go with the speed at a place in the range."""
    found = values.copy()
    found.reshape(-1)[course.at] = np.polynomial.polynomial.polyval(place, course.value)
    return found


def _weights(mode: ContactMode) -> Floats:
    """2 for modes that stand for a conjugate pair, 1 for others."""
    m = mode.n_eigenmode
    own = np.einsum("ka,ak->k", mode.enter[:m], mode.motion[:, :m]).real
    return np.where(own > 1.5, 2.0, 1.0)


def _groups(exponent: Complexes) -> list[NDArray[np.int64]]:
    """Places of the exponents, those that repeat together."""
    near = np.abs(exponent[:, np.newaxis] - exponent) <= EQUAL * np.abs(exponent)
    if near.sum() == exponent.size:
        return list(np.arange(exponent.size)[:, np.newaxis])
    return [np.array(group) for group in sorted({tuple(np.flatnonzero(row)) for row in near})]


def _entries(nodes: tuple[Tabulated, Tabulated, Tabulated]) -> tuple[Complexes, Complexes]:
    """What enters a mode (5, m, 2 n), and what constants take off it (5, c, m), at `PLACES`."""
    mode, before, behind = (node.mode for node in nodes)
    m = mode.n_eigenmode
    weight = _weights(mode)
    n_constant = len(mode.take_off) - 2
    gripped = range(len(mode.enter) - m)  # coordinates beside the eigenmodes that motion enters
    grips = [m + k for k in gripped if mode.enter[m + k].any()]
    enters, take_off = [], []
    for place in PLACES.tolist():
        motion = parabola((mode.motion, before.motion, behind.motion), place)
        enter = parabola((mode.enter[:m], before.enter[:m], behind.enter[:m]), place)
        for _ in range(NEWTON if place else 0):
            shape = motion[:, :m] / weight
            off = enter @ shape - np.eye(m)
            off_conjugate = np.where(weight > 1.5, enter @ shape.conj(), 0.0)
            enter = enter - off @ enter - off_conjugate @ enter.conj()
            if max(np.abs(off).max(initial=0.0), np.abs(off_conjugate).max(initial=0.0)) < EXACT:
                break
        for row in grips if place else ():
            enter = enter - np.outer(enter @ motion[:, row], mode.enter[row])
        enters.append(enter)
        take_off.append((enter @ motion[:, m + 1 : m + 1 + n_constant]).T)
    return np.array(enters), np.array(take_off)


def _through(values: list[Any], m: int, skips_response: bool = True) -> Floats:
    """Factors (3, s) of the parabolas through arrays, flat; the response to unbalance, m, is left out."""
    middle, before, behind = values
    slope, bend = (behind - before) / (2.0 * NODE), (0.5 * (behind + before) - middle) / NODE**2
    factors = np.array([middle, slope, bend])
    if skips_response and middle.ndim and middle.shape[-1] > m:
        factors[1:, ..., m] = 0.0
    return np.ascontiguousarray(factors).view(np.float64).reshape(3, -1)


def _course(factors: Floats) -> Course:
    """The entries that go with the speed, of factors (p, s)."""
    change = np.abs(factors[1:]).sum(axis=0)
    at = np.flatnonzero(change > np.maximum(STILL * np.abs(factors[0]), LEAST * change.max(initial=0.0)))
    return Course(at, np.ascontiguousarray(factors[:, at]))


def _moved(course: Course, first: int) -> Course:
    return course._replace(at=course.at + first)


def _joined(courses: list[Course], n_power: int) -> Course:
    at = np.concatenate([course.at for course in courses])
    value = np.concatenate([course.value for course in courses], axis=1).reshape(n_power, -1)
    return Course(at, value)


def _room(
    arrays: dict[str, Any], of_rim: dict[str, list[Any]]
) -> tuple[Floats, dict[str, Any], dict[str, int]]:
    """One memory for arrays, with their values: it, the arrays in it, and where each begins."""
    named = arrays | {"rim " + name: values[0] for name, values in of_rim.items()}
    ends = np.cumsum([0, *(value.size * (2 if np.iscomplexobj(value) else 1) for value in named.values())])
    memory, views, places = np.zeros(int(ends[-1])), {}, {}
    for (name, value), first, end in zip(named.items(), ends[:-1], ends[1:], strict=True):
        view = memory[first:end].view(value.dtype).reshape(value.shape)
        view[:] = value
        views[name], places[name] = view, int(first)
    return memory, views, places
