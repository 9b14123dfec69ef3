"""Contact modes over a range of speeds: polynomials through those of three speeds.

Eigenvectors of the speeds at either side are brought to the length and phase that those in the middle see as
theirs, so that exponents, shapes, their inverse and what is made of them go smoothly: parabolas follow them,
with errors of the third order in the range. The inverse has to be their inverse, or each event would lose or
gain motion: it is exact at seven places, and goes through these by polynomials of the sixth order.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels.closed_form.courses import Course, Courses, take_course
from rubhpc.kernels.closed_form.filling import ModeCourse
from rubhpc.kernels.closed_form.filling_energies import Losses

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.kernels.contact_modes import ModeTables


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
_BY_COORDINATES = "exponent", "row", "resisting_re", "resisting_im"  # that have a response
FAR = 0.5  # share of a mode in another of a speed beside it, over its own, from which it is not the same
EQUAL = 1e-9  # relative difference of two exponents that repeat
STILL, LEAST = 1e-13, 1e-16  # change of an entry over it, and over the greatest, below which it stays
NONE = Course(np.zeros(0, dtype=np.int64), np.zeros((1, 0)))
NOTHING = Courses(np.zeros(0), *[NONE] * (len(Courses._fields) - 1))


class Node(NamedTuple):
    """A contact mode of one speed with its tables; coordinates are padded to their width."""

    mode: ContactMode
    row: ModeTables  # (1, ...) each
    exponent: Complexes  # (width,), 1/s
    output: Floats  # (o, 3 n), what output rows see of displacements, rates and accelerations
    seen: Complexes  # (o, width), what they see of coordinates
    resisting: Complexes  # (n, width), resisting forces; (0, width) where no energies are asked for

    @classmethod
    def of(cls, mode: ContactMode, row: ModeTables, output: Floats, resisting: Complexes) -> Node:
        """That of a mode and its tables; `resisting` may have fewer coordinates."""
        motion = row.motion_re[0] + 1j * row.motion_im[0]
        n, end, width = len(motion) // 2, mode.exponent.size, motion.shape[1]
        exponent = np.pad(mode.exponent, (0, width - end))
        position, velocity, acceleration = np.hsplit(output, 3)
        seen = position @ motion[:n] + velocity @ motion[n:] + (acceleration @ motion[n:]) * exponent
        return cls(mode, row, exponent, output, seen, np.pad(resisting, ((0, 0), (0, width - end))))


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


def weights(mode: ContactMode) -> Floats:
    """2 for modes that stand for a conjugate pair, 1 for others."""
    m = mode.n_eigenmode
    own = np.einsum("ka,ak->k", mode.enter[:m], mode.motion[:, :m]).real
    return np.where(own > 1.5, 2.0, 1.0)


def constant_course(node: Node, phasor: Complexes, *, n_ahead: int) -> ModeCourse:
    """A mode whose eigenmodes stay what they are.

    What drives them follows from the response to the unbalance at the speed for which the mode is solved.

    Parameters
    ----------
    phasor : (n,), kg m
        Unbalance at unit speed.
    n_ahead : int
        Samples that are read from one set of coordinates.
    """
    mode, m = node.mode, node.mode.n_eigenmode
    exponent, turning, is_pair = mode.exponent[:m], mode.exponent[m], weights(mode) > 1.5
    direct, other = mode.take_off[0, :m] - 1j * mode.take_off[1, :m], mode.take_off[0] + 1j * mode.take_off[1]
    mirrored, force = other[:m].conj(), abs(turning) ** 2
    switch = mode.switch
    rubbed = node.resisting[:, m] - _response(node.resisting[:, :m], direct, mirrored, is_pair)
    return ModeCourse(
        n_coordinate=mode.exponent.size,
        n_ahead=n_ahead,
        exponent=node.exponent.copy(),
        is_pair=is_pair,
        drive=direct * (turning - exponent) / force,
        mirrored_drive=mirrored * (turning - exponent.conj()) / force,
        reaction=(_response(switch[:, :m], direct, mirrored, is_pair) - switch[:, m]) / force,
        phasor=phasor,
        output=node.output,
        row=node.seen,
        losses=Losses(
            resisting_re=node.resisting.real.copy(),
            resisting_im=node.resisting.imag.copy(),
            rubbed=rubbed / force,
        ),
        courses=NOTHING,
    )


def interpolated(course: ModeCourse, nodes: Sequence[Node], entered: Entries) -> ModeCourse:
    """The same mode with what of it goes with the speed.

    `nodes` are those at `NODES`, the middle first; `entered` is what enters them (`entries`).
    """
    middle, mode = nodes[0], nodes[0].mode
    m, n, width = mode.n_eigenmode, len(mode.motion) // 2, middle.exponent.size
    courses = {}
    for name, n_kept in (("motion", 1), ("switch", 1), ("slip", 1), ("rate", m + 1)):
        for part in ("_re", "_im"):
            values: Any = np.array([getattr(node.row, name + part)[0] for node in nodes])
            courses[name + part] = _through(values, range(m + 1 - n_kept, m + 1))
    enter, take_off = entered.enter, entered.take_off
    padded: Complexes = np.zeros((len(enter), *middle.row.motion_re[0].shape), dtype=np.complex128)
    padded[:, :, :m] = enter.transpose(0, 2, 1)
    constant = np.zeros((len(enter), take_off.shape[1], 2, width))
    constant[..., 0, :m], constant[..., 1, :m] = take_off.real, take_off.imag
    of_entry = {"enter_re": padded.real, "enter_im": padded.imag, "enter_constant": constant}
    courses |= {name: _through(values) for name, values in of_entry.items()}
    loss = np.array([node.row.loss[0] for node in nodes])
    both = [m, width + m][: len(loss[0])]
    loss[1:, both] = loss[0][both]
    courses["loss"] = _through(loss, both)
    impulse = _response(mode.motion[n:, :m], course.drive, course.mirrored_drive, course.is_pair)
    shape: dict[str, Any] = {
        "exponent": [node.exponent for node in nodes],
        "output": [node.output for node in nodes],
        "row": [node.seen for node in nodes],
    }
    if middle.resisting.size:
        shape["resisting_re"] = [node.resisting.real for node in nodes]
        shape["resisting_im"] = [node.resisting.imag for node in nodes]
    entry = {"drive": enter[:, :, n:] @ impulse, "mirrored_drive": enter[:, :, n:].conj() @ impulse}
    kept, views, places = _room({name: values[0] for name, values in (shape | entry).items()})

    def moved(arrays: dict[str, Any]) -> Course:
        found = []
        for name, values in arrays.items():
            of_course = _through(values, [m] if name in _BY_COORDINATES else [])
            found.append(of_course._replace(at=of_course.at + places[name]))
        return _joined(found)

    of_losses = {name: views.pop(name) for name in Losses._fields if name in views}

    return course._replace(
        **views,
        losses=course.losses._replace(**of_losses),
        courses=Courses(kept=kept, kept_shape=moved(shape), kept_entry=moved(entry), **courses),
    )


def _response(
    rows: Complexes, direct: Complexes, mirrored: Complexes, is_pair: NDArray[np.bool_]
) -> Complexes:
    """What rows (r, m) see of a response with these shares (m,) of eigenmodes and of their conjugates."""
    of_real = np.where(is_pair, 0.5 * (direct + mirrored), direct)
    of_imaginary = np.where(is_pair, 0.5j * (direct - mirrored), 1j * direct)
    found: Complexes = (rows.real @ of_real + rows.imag @ of_imaginary).astype(np.complex128)
    return found


def taken(course: Course, values: Floats, place: float) -> Floats:
    """A copy of an array with what goes with the speed at a place in the range."""
    found = values.copy()
    found.reshape(-1)[course.at] = np.polynomial.polynomial.polyval(place, course.value)
    return found


def _groups(exponent: Complexes) -> list[NDArray[np.int64]]:
    """Places of the exponents, those that repeat together."""
    near = np.abs(exponent[:, np.newaxis] - exponent) <= EQUAL * np.abs(exponent)
    if near.sum() == exponent.size:
        return list(np.arange(exponent.size)[:, np.newaxis])
    return [np.array(group) for group in sorted({tuple(np.flatnonzero(row)) for row in near})]


class Entries(NamedTuple):
    """What enters a mode of m eigenmodes that follows the speed, at `EXACT`."""

    enter: Complexes  # (7, m, 2 n)
    take_off: Complexes  # (7, c, m), of constants
    lost: float  # share of a mode in another, at most, by which it is no inverse between these places


def shares_of(place: float, count: int) -> Floats:
    """What goes through values at `count` places has of each but the first, less that, at a place."""
    powers: Floats = place ** np.arange(count, dtype=np.float64)
    shares: Floats = (powers @ POWERS[count])[1:]
    return shares


def _through(values: Any, kept: Sequence[int] = ()) -> Course:
    """What goes through arrays at `NODES` or `EXACT`.

    Coordinates `kept`, of the last axis, stay as in the first array.
    """
    values = np.array(values)  # a copy
    values[1:] -= values[0]
    values[1:, ..., list(kept)] = 0.0
    flat = values.view(np.float64).reshape(len(values), -1)
    size = np.abs(flat[1:]).max(axis=0, initial=0.0)
    at = np.flatnonzero(size > np.maximum(STILL * np.abs(flat[0]), LEAST * size.max(initial=0.0)))
    moved = np.ascontiguousarray(flat[:, at])
    factors = POWERS[len(values)][:, 1:] @ moved[1:]
    factors[0] += moved[0]
    return Course(at, factors)


def _joined(courses: list[Course]) -> Course:
    at = np.concatenate([course.at for course in courses])
    return Course(at, np.concatenate([course.value for course in courses], axis=1))


def _room(arrays: dict[str, Any]) -> tuple[Floats, dict[str, Any], dict[str, int]]:
    """One memory for arrays, with their values: it, the arrays in it, and where each begins."""
    ends = np.cumsum([0, *(value.size * (2 if np.iscomplexobj(value) else 1) for value in arrays.values())])
    memory, views, places = np.zeros(int(ends[-1])), {}, {}
    for (name, value), first, end in zip(arrays.items(), ends[:-1], ends[1:], strict=True):
        view = memory[first:end].view(value.dtype).reshape(value.shape)
        view[:] = value
        views[name], places[name] = view, int(first)
    return memory, views, places


def most_of(values: Floats | Complexes) -> float:
    """The largest real or imaginary part, without a root for each value."""
    parts = values.view(np.float64)
    return float(max(parts.max(initial=0.0), -parts.min(initial=0.0)))


def entries(nodes: Sequence[Node]) -> Entries:
    """What enters a mode between `NODES`: inverses of its shapes, in the coordinates of those in the middle.

    A mode that stands for a pair has two coordinates here, real and imaginary part, so that all is real but
    where two real exponents come as a pair.
    """
    mode, n_node = nodes[0].mode, len(nodes)
    m, is_pair = mode.n_eigenmode, weights(mode) > 1.5
    paired = np.flatnonzero(is_pair)
    change = np.array([node.mode.motion for node in nodes[1:]]) - mode.motion
    shares = np.array([shares_of(place, n_node) for place in EXACT])
    is_moved = (change[..., :m] != 0.0).any(axis=(0, 1))
    columns = np.flatnonzero(np.append(is_moved, is_moved[paired]))
    every = _in_parts(mode.enter[:m].T, is_pair, 1.0).T
    seen = every @ _in_parts(change[..., :m], is_pair, -1.0)[..., columns]
    # Modes that change, or that others change into: their coordinates, imaginary parts last.
    is_pushed = np.abs(seen).max(axis=(0, 2), initial=0.0) > LEAST
    is_moved |= is_pushed[:m]
    is_moved[paired] |= is_pushed[m:]
    rows, both = np.flatnonzero(is_moved), np.flatnonzero(np.append(is_moved, is_moved[paired]))
    mixed = np.zeros((len(change), both.size, both.size), dtype=seen.dtype)
    mixed[..., np.searchsorted(both, columns)] = seen[:, both]
    unit = np.eye(both.size)

    def turned(shares: Floats) -> Floats:
        return np.tensordot(shares, mixed, axes=1) + unit

    back = np.linalg.inv(turned(shares[1:]))
    through = [unit, *back]
    judged = np.array([shares_of(place, n_node) for place in JUDGED])
    lost = max(
        most_of(between(through, place) @ kept - unit)
        for place, kept in zip(JUDGED, turned(judged), strict=True)
    )
    entered = back @ every[both]
    found = np.tile(mode.enter[:m], (len(shares), 1, 1))
    found[1:, rows] = entered[:, : rows.size]
    found[1:, rows[is_pair[rows]]] += 1j * entered[:, rows.size :]
    beyond = mode.motion[:, m:] + np.tensordot(shares, change[..., m:], axes=1)
    for k in range(m, len(mode.enter)):  # coordinates beside the eigenmodes that motion enters
        if mode.enter[k].any():
            found[1:] -= (found[1:] @ beyond[1:, :, k - m, np.newaxis]) * mode.enter[k]
    constants = beyond[..., 1 : 1 + len(mode.take_off) - 2]
    return Entries(found, (found @ constants).transpose(0, 2, 1), lost)


def _in_parts(values: Complexes, is_pair: NDArray[np.bool_], sign: float) -> Floats:
    """Real parts of values (..., m), and behind them imaginary parts of those of pairs, by a sign.

    Others stay as they are; all is complex where one of them is.
    """
    parts = np.concatenate([values.real, sign * values[..., is_pair].imag], axis=-1)
    single = np.flatnonzero(~is_pair)
    if values[..., single].imag.any():
        parts = parts.astype(np.complex128)
        parts[..., single] = values[..., single]
    return parts


class Eigenmodes(NamedTuple):
    """The m eigenmodes of a set of closed pairs, which do not depend on the speed."""

    exponent: Complexes  # (m,), 1/s
    is_pair: NDArray[np.bool_]  # (m,)
    motion: Complexes  # (2 n, m)
    enter: Complexes  # (m, 2 n)
    constant: Complexes  # (c, m), for a unit of each coordinate that does not move
    drive: Complexes  # (m,), by the unbalance at unit speed
    mirrored_drive: Complexes  # (m,)

    @classmethod
    def of(cls, row: ModeTables, course: ModeCourse, within: float) -> Eigenmodes:
        """Eigenmodes of tables that follow the speed, at a place in the range."""
        courses, m = course.courses, course.is_pair.size
        for part in (courses.kept_shape, courses.kept_entry):
            take_course(part, within, courses.kept)
        constant = taken(courses.enter_constant, row.enter_constant[0], within)[:, :, :m]
        motion, enter = (
            taken(re, re_of[0], within)[:, :m] + 1j * taken(im, im_of[0], within)[:, :m]
            for re, im, re_of, im_of in (
                (courses.motion_re, courses.motion_im, row.motion_re, row.motion_im),
                (courses.enter_re, courses.enter_im, row.enter_re, row.enter_im),
            )
        )
        return cls(
            exponent=course.exponent[:m].copy(),
            is_pair=course.is_pair,
            motion=motion,
            enter=enter.T,
            constant=constant[:, 0] + 1j * constant[:, 1],
            drive=course.drive.copy(),
            mirrored_drive=course.mirrored_drive.copy(),
        )

    def entered(
        self, motion: Floats, constants: Floats, turning: complex, factor: complex, time: float
    ) -> Complexes:
        """Coordinates (m,) of a motion (2 n,) at a time, s.

        `turning` (1/s) is the exponent of the unbalance force, `factor` (1/s^2) that of the unbalance at unit
        speed at time 0.
        """
        direct, other = self.forced(turning, factor)
        turned = np.exp(turning * time)
        response = direct * turned + other * turned.conj()
        coordinates: Complexes = self.enter @ motion - constants @ self.constant - response
        return coordinates

    def forced(self, turning: complex, factor: complex) -> tuple[Complexes, Complexes]:
        """Response to the unbalance at time 0: parts with `exp(turning t)` and with its conjugate."""
        direct = self.drive * factor / (turning - self.exponent)
        mirrored = self.mirrored_drive * factor / (turning - self.exponent.conj())
        other: Complexes = np.where(self.is_pair, mirrored, direct).conj()
        return 0.5 * direct, 0.5 * other

    def response(self, turning: complex, factor: complex) -> Complexes:
        """The same as a motion (2 n,), which turns as `exp(turning t)`: its real part."""
        direct, other = self.forced(turning, factor)
        twice = np.where(self.is_pair, 1.0, 2.0) * direct
        back = np.where(self.is_pair, other.conj(), 0.0)
        motion: Complexes = self.motion @ twice + self.motion.conj() @ back
        return motion
