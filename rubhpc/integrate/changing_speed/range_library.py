"""Contact modes over a range of speeds, filled for the speeds of a run-up's pieces, several of them at once.

They are solved when first met, at three speeds of the range (`mode_courses`). The unbalance response and the
exponentials are made anew for each piece (`kernels.closed_form.filling`).
"""

from __future__ import annotations

import math
from copy import copy
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.changing_speed.mode_courses import (
    MOST_LOST,
    Eigenmodes,
    Node,
    constant_course,
    entries,
    interpolated,
    matched,
)
from rubhpc.integrate.reduced_model.mode_library import ModeLibrary
from rubhpc.integrate.reduced_model.table_stack import TableStack
from rubhpc.integrate.reduced_model.touching import OpenBodies, open_bodies
from rubhpc.kernels.closed_form.filling import Speeds, fill
from rubhpc.kernels.contact_modes import LANES, SAMPLES_AT_ONCE
from rubhpc.kernels.contact_pairs import AXIAL, LATERAL

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import ArrayLike

    from rubhpc.fem.model import Model
    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.integrate.reduced_model.reduction import ReducedModel
    from rubhpc.kernels.closed_form.filling import ModeCourse
    from rubhpc.kernels.contact_modes import ModeTables

    Ints = NDArray[np.int64]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

NOT_FILLED = -2  # in place of a set of closed pairs: a contact mode that this piece has not met
STRUCK = 1e9  # rad/s, speed of the unbalance for which modes are solved


def output_operators(reduced: ReducedModel) -> tuple[Floats, Floats, Floats]:
    """Rows of tables (`kernels.contact_modes`): of displacements, rates and accelerations, (o, n) each."""
    none = np.zeros_like(reduced.output)
    position, rate = [reduced.output, none, none[2:]], [none, reduced.output, none[2:]]
    acceleration = [none, none, reduced.output[2:]]
    for place in (*(degree[[AXIAL, LATERAL]] for degree in reduced.degree), *reduced.carrier):
        position += [place, 0.0 * place[1:]]
        rate += [0.0 * place, place[1:]]
        acceleration += [0.0 * place, 0.0 * place[1:]]
    of_probes = reduced.probe
    position.append(of_probes[0])
    rate.append(of_probes[1])
    acceleration.append(of_probes[2])
    return np.concatenate(position), np.concatenate(rate), np.concatenate(acceleration)


def with_slip(row: ModeTables, slip: Complexes, exponent: Complexes) -> ModeTables:
    """Tables of a mode, (1, ...), with complete slip speeds (q, coordinates) and their rates."""
    end, width = exponent.size, row.slip_re.shape[-1]
    speed = np.zeros((1, len(slip), width), dtype=np.complex128)
    speed[0, :, :end] = slip
    rate = speed.copy()
    rate[0, :, :end] *= exponent
    return row._replace(
        slip_re=speed.real.copy(),
        slip_im=speed.imag.copy(),
        slip_rate_re=rate.real.copy(),
        slip_rate_im=rate.imag.copy(),
    )


def without_filled(row: ModeTables, n_row: int) -> ModeTables:
    """Tables of a mode, (1, ...), without the parts filled in for each speed; they have `n_row` outputs."""
    width = row.motion_re.shape[-1]
    n_output = -(-SAMPLES_AT_ONCE * n_row // LANES) * LANES
    shapes = {"output": (1, 2 * width, n_output)} | {
        name: getattr(row, name).shape for name in ("power_re", "power_im", "bound")
    }
    return row._replace(**{name: np.broadcast_to(0.0, shape) for name, shape in shapes.items()})


def speeds_of(
    spin: ArrayLike,
    factor: ArrayLike,
    growth: ArrayLike,
    tick: ArrayLike,
    middle_spin: float,
    sample_level: int,
    reach: float = math.inf,
) -> Speeds:
    """Speeds (rad/s) to which tables are filled whose matrices are those at `middle_spin`, or within `reach`.

    `factor` (1/s^2) is what the unbalance at unit speed acts by, which grows by `growth` (1/s), `tick` (s)
    the resolution of events.
    """
    spins, ticks = np.asarray(spin, dtype=np.float64), np.asarray(tick, dtype=np.float64)
    factors = np.asarray(factor, dtype=np.complex128)
    grown = np.asarray(growth, dtype=np.float64)
    return Speeds(
        spin=spins,
        within=(spins - middle_spin) / reach,
        factor=factors,
        growth=grown,
        tick=ticks,
        interval=ticks * 2.0**sample_level,
    )


class TableBuffer:
    """Tables that are filled for pieces under way, of one library after the other."""

    def __init__(self, tables: TableStack) -> None:
        self.tables = tables
        self.user: RangeLibrary | None = None


class RangeLibrary(ModeLibrary):
    """Contact modes of one range of speeds and one friction, filled for one spin speed after the other.

    Parameters
    ----------
    reduced : ReducedModel
        Matrices in the middle of the range; its spin and force are those of some speed.
    phasor : (n,), complex
        Unbalance at unit speed, kg m: at the speed W its force is `Re[W^2 phasor exp(i W t)]`, N.
    tick : float, s
    sample_level, n_level : int
        As in `ModeLibrary`; levels stay, the tick changes with the speed.
    reach : float, rad/s
        Half of the range.
    beside : sequence of ReducedModel
        The same at other speeds of the range (`mode_courses.NODES`), through which modes follow the speed;
        none where matrices stay what they are.
    at_place : callable, optional
        The same at a place in the range, from -1 to 1: for modes that cannot be
        interpolated, which are solved at each piece.
    is_balanced : bool
        Whether energies are asked for.
    buffers : dict, optional
        Tables of the libraries that take turns, by what they have in common.
    """

    _n_ahead = 0  # outputs are filled in for each speed

    def __init__(
        self,
        reduced: ReducedModel,
        model: Model,
        friction: float,
        *,
        phasor: Complexes,
        tick: float,
        sample_level: int,
        n_level: int,
        reach: float = 0.0,
        beside: Sequence[ReducedModel] = (),
        at_place: Callable[[float], ReducedModel] | None = None,
        is_balanced: bool = True,
        buffers: dict[tuple[object, ...], TableBuffer] | None = None,
    ) -> None:
        """Start with every pair open."""
        self.reduced, self._reach = _struck(reduced, phasor), reach
        self._spin = reduced.spin
        self._is_measured, self._at_place = is_balanced, at_place
        self._take_pairs(model, friction)
        self._tick, self._sample_level, self._n_level = tick, sample_level, n_level
        self._phasor, self._output = phasor, np.hstack(output_operators(reduced))
        self._among: OpenBodies | None = None
        self._opened, self._is_open = self._solve(0), True
        self._among = open_bodies(reduced, model, self._opened)
        self._first_modes()
        self.first_masks = [0]  # a piece begins with no other mode
        self._is_interpolated = bool(beside)
        self._beside = [self._with(other) for other in beside]
        self._exponents = {}
        self._solved_modes: dict[int, tuple[ModeTables, ModeCourse]] = {}  # by the set of closed pairs
        self._not_interpolable: set[int] = set()  # modes that change too much between speeds
        self._counted: tuple[tuple[int, ...], int] = (), 0  # modes, and their memory, bytes
        kind: tuple[object, ...] = type(self), self.width, n_level, is_balanced
        buffer = TableBuffer(TableStack(1 + len(self.gap_jacobian)))
        self._buffer = buffer if buffers is None else buffers.setdefault(kind, buffer)
        self._tables = self._buffer.tables
        self._place: dict[int, int] = {}  # of the tables of each mode in the buffer
        at_middle = [self._spin], [complex(self._spin**2)], [0.0], [tick]
        self._speeds = speeds_of(*at_middle, self._spin, sample_level)
        self._at = 0  # piece among those at hand
        self.masks: list[int] = []
        self._take_buffer()
        self.add(0)

    @property
    def n_byte(self) -> int:
        """Memory that its contact modes hold."""
        if self._counted[0] != (masks := tuple(self._solved_modes)):
            fields = (field for kept in self._solved_modes.values() for part in kept for field in part)
            sizes = {
                id(field): field.nbytes
                for field in fields
                if isinstance(field, np.ndarray) and any(field.strides)
            }
            self._counted = masks, sum(sizes.values())
        return self._counted[1]

    @property
    def n_most(self) -> int:
        """Contact modes that there is room for."""
        return self._tables.n_most

    @property
    def is_full(self) -> bool:
        """Whether there is no room for another contact mode."""
        return len(self._solved_modes) >= self.n_most

    def interpolates(self, mask: int) -> bool:
        """Whether a mode follows the speed, in coordinates that go on from piece to piece."""
        return self._is_interpolated and mask not in self._not_interpolable

    def unmet(self, met: set[int]) -> list[int]:
        """None: each piece begins with no mode."""
        return []

    def tune(self, speeds: Speeds, piece: int) -> None:
        """Begin a piece, given by its place among the speeds: with no mode."""
        self._take_buffer()
        self._speeds, self._at = speeds, piece
        self.masks = [NOT_FILLED] * len(self.masks)
        self.tables().mask[:] = NOT_FILLED

    def add(self, mask: int) -> bool:
        """Fill the tables of the mode with these pairs closed; returns whether they are wide enough."""
        if not self._has(mask):
            return False
        if mask not in self._place:
            self._place[mask] = len(self.masks)
            self._tables.add(self._solved_modes[mask][0])
            self.masks.append(NOT_FILLED)
        place, at = self._place[mask], self._at
        if self.masks[place] != mask:
            if mask in self._not_interpolable:
                self._solve_at(mask, place, float(self._speeds.within[at]))
            fill(self.tables(), place, self._solved_modes[mask][1], self._speeds, at)
        self.masks[place] = self.tables().mask[place] = mask
        return True

    def eigenmodes(self, mask: int, within: float) -> Eigenmodes | None:
        """Those of a set of closed pairs at a place in the range, from -1 to 1; None where it has no room."""
        if mask not in self._solved_modes and self.is_full:
            self.forget()
        if not self._has(mask) or mask in self._not_interpolable:
            return None
        return Eigenmodes.of(*self._solved_modes[mask], within)

    def forget(self) -> None:
        """Make room: keep no mode but that with every pair open."""
        self._exponents.clear()
        self._solved_modes.clear()
        if self._buffer.user is self:
            self._buffer.user = None
            self._take_buffer()
            self.add(0)

    def _take_buffer(self) -> None:
        """Clear the buffer of what another library has left in it."""
        if self._buffer.user is not self:
            self._buffer.user = self
            self._tables.clear()
            self._place.clear()
            self.masks = []

    def _has(self, mask: int) -> bool:
        """Whether it has the mode with these pairs closed; one met for the first time is solved."""
        if mask not in self._solved_modes:
            mode = self._solved(mask)
            if mode.exponent.size > self.width:
                return False
            self._tabulate(mode)
        return True

    def _tabulate(self, mode: ContactMode, row: ModeTables | None = None) -> None:
        self._note_exponents(mode)
        middle = self._node(mode)
        course = self._constant(middle)
        if self._beside:
            found = [matched(mode, library._solved(mode.mask)) for library in self._beside]
            nodes = [middle, *(lib._node(one) for lib, one in zip(self._beside, found, strict=True) if one)]
            if len(nodes) > len(found) and (entered := entries(nodes)).lost <= MOST_LOST:
                course = interpolated(course, nodes, entered)
            if not course.courses.kept.size:
                self._not_interpolable.add(mode.mask)
        self._solved_modes[mode.mask] = without_filled(middle.row, len(self._output)), course

    def _solve_at(self, mask: int, place: int, within: float) -> None:
        """Solve a mode that cannot be interpolated at a place in the range, and put it into the buffer."""
        assert self._at_place is not None
        library = self._with(self._at_place(within))
        node = library._node(library._solved(mask))
        row = without_filled(node.row, len(self._output))
        self._solved_modes[mask] = row, library._constant(node)
        for field, new in zip(self.tables(), row, strict=True):
            field[place] = new[0]

    def _node(self, mode: ContactMode) -> Node:
        """A mode of these matrices, with its tables."""
        row = self._tables_of(mode, self.reduced)
        n = self.gap_jacobian.shape[1]
        shape, rate = mode.motion[:n], mode.motion[n:]
        resisting = np.zeros((0, mode.exponent.size), dtype=np.complex128)
        if self._is_measured:
            reduced = self.reduced
            skew = 0.5 * (reduced.stiffness - reduced.stiffness.T)
            resisting = reduced.damping @ rate + skew @ shape - self._friction_of(mode)
        else:
            row = with_slip(row, self.slip @ rate, mode.exponent)
        return Node.of(mode, row, self._output, resisting)

    def _constant(self, node: Node) -> ModeCourse:
        """A mode that stays what it is."""
        return constant_course(node, self._phasor, n_ahead=1 if node.mode.mask else SAMPLES_AT_ONCE)

    def _with(self, reduced: ReducedModel) -> Self:
        """A library with other matrices that solves in the same way."""
        other = copy(self)
        other.reduced, other._output = _struck(reduced, self._phasor), np.hstack(output_operators(reduced))
        other._beside, other._is_open = [], False
        return other

    def _solved(self, mask: int) -> ContactMode:
        if not self._is_open:  # one beside another
            self._is_open, self._opened = True, self._solve(0)
            self._among = self._among.at(self.reduced, self._opened) if self._among else None
        return super()._solved(mask)


def _struck(reduced: ReducedModel, phasor: Complexes) -> ReducedModel:
    """The same under an unbalance so fast that no stiffness answers: what it drives is read off exactly."""
    found = copy(reduced)  # including its cached projections
    vars(found).update(spin=STRUCK, force=STRUCK**2 * np.stack([phasor.real, -phasor.imag]))
    return found
