"""Tables of frequent transitions between contact modes under set-valued friction."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rubhpc.integrate.reduced_model.array_room import aligned, room_for
from rubhpc.integrate.reduced_model.coupling import coupled_rows
from rubhpc.integrate.reduced_model.rub_forms import rub_form
from rubhpc.kernels._jit import plain
from rubhpc.kernels.contact_modes import SAMPLES_AT_ONCE
from rubhpc.kernels.friction_spans import AT_ONCE, whole_rows
from rubhpc.kernels.friction_states import BACKWARD, FORWARD, state_of
from rubhpc.kernels.transitions import DECAYED, LANES, UNKNOWN, WORTH_A_TABLE, Transitions

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.kernels.contact_modes import ModeTables, Reduced
    from rubhpc.kernels.friction_states import FrictionBodies

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]
    Exponents = tuple[Floats, Floats]

MOST_BYTES = 2**26  # of the transitions of a case
MOST_SHARED = 2**27  # of a room of transitions, above which cases begin another one
UNMOVED = 1e-9  # of unit coordinates: smaller changes by a transition count as none


class Part(NamedTuple):
    """Numbers of a contact mode or of a transition for `kernels.transitions`."""

    number: Ints
    value: Floats
    shifted: Ints  # where in `number` places in `value` are


class TransitionRoom:
    """Transitions tabulated by the cases of a library, stacked in two arrays that grow.

    Each part is written once at a fixed place: a case that uses it finds it in later arrays too.
    """

    def __init__(self) -> None:
        self.number, self.value = np.zeros(0, dtype=np.int64), np.zeros(0)
        self._n_number = self._n_value = 0
        self._places: dict[tuple[int, int, str], tuple[int, int, int]] = {}

    def __len__(self) -> int:
        return len(self._places)

    @property
    def is_full(self) -> bool:
        """Whether further cases must begin their own room."""
        return self._n_value * self.value.itemsize > MOST_SHARED

    def take(self, key: tuple[int, int, str], make: Callable[[], Part]) -> tuple[int, int, int]:
        """Places in `number` and `value` of the part of a key, and its bytes; it is made if it is missing."""
        if key not in self._places:
            part = make()
            at_number, at_value = self._n_number, self._n_value
            self.number = _with_room(self.number, at_number, part.number.size)
            self.value = _with_room(self.value, at_value, part.value.size)
            self._n_number, self._n_value = at_number + part.number.size, at_value + part.value.size
            self.number[at_number : self._n_number] = part.number
            self.value[at_value : self._n_value] = part.value
            self.number[at_number + part.shifted] += at_value
            self._places[key] = at_number, at_value, part.value.nbytes
        return self._places[key]


class MetTransitions:
    """Transitions of one case, tabulated where they are frequent.

    The kernel must not depend on other cases: a case begins without tables, and uses one from the shared
    `room` only where it would have made it itself.
    """

    def __init__(self, room: TransitionRoom) -> None:
        """Begin with none."""
        self._room = room
        self._entry: dict[tuple[int, int], int] = {}  # by sets of states
        self._modes: dict[int, int] = {}
        self._outputs: dict[int, int] = {}
        self._energies: dict[int, int] = {}
        self._rubs: dict[tuple[int, int], int] = {}  # by set of states and pair
        self._n_byte = 0
        self._masks: list[int] = []
        self._spare: tuple[Floats, Floats] | None = None  # work space of kernels
        self._placed: Transitions | None = None

    def among(self, tables: ModeTables) -> Transitions:
        """Return them for a kernel, for the modes of these tables."""
        self._note_passages()
        self._masks = tables.mask.tolist()
        place = {mask: k for k, mask in enumerate(self._masks) if mask >= 0}
        p, m = len(self._masks), tables.pace.shape[1]
        places = np.full((p, p + 3 + tables.switch_re.shape[1] // 2), UNKNOWN)
        entry, rub = places[:, :p].copy(), places[:, p + 3 :].copy()
        mode, output, energy = places[:, p : p + 3].T.copy()
        for (before, after), passed in self._entry.items():
            if before in place and after in place:
                entry[place[before], place[after]] = passed
        for known, at in ((self._modes, mode), (self._outputs, output), (self._energies, energy)):
            for mask in known.keys() & place.keys():
                at[place[mask]] = known[mask]
        for (mask, i), at_number in self._rubs.items():
            if mask in place:
                rub[place[mask], i] = at_number
        number, value = self._room.number, self._room.value
        if self._spare is None or self._spare[0].size != 2 * AT_ONCE * m:
            self._spare = aligned((2 * AT_ONCE * m,)), aligned((2 * AT_ONCE * m,))
        self._placed = Transitions(entry, mode, output, energy, rub, number, value, *self._spare)
        return self._placed

    def is_due(self, before: int, after: int, *, is_counted: bool) -> bool:
        """Whether the transition between two sets of states is now frequent enough for a table.

        `is_counted`: the kernel has counted this passage, as it does where its tables contain both modes.
        """
        self._note_passages()
        passed = self._entry.get((before, after), UNKNOWN)
        if not is_counted and passed < 0:
            self._entry[before, after] = passed = passed - 1
        return passed == UNKNOWN - WORTH_A_TABLE and self._n_byte <= MOST_BYTES

    def nearly_due(self) -> list[tuple[int, int]]:
        """Transitions that have come half as often as one with a table, which soon want theirs."""
        if self._n_byte > MOST_BYTES:
            return []
        most, half = UNKNOWN - WORTH_A_TABLE, UNKNOWN - WORTH_A_TABLE // 2
        return sorted(masks for masks, passed in self._entry.items() if most < passed <= half)

    def tabulate(
        self,
        before: ModeTables,
        after: ModeTables,
        exponents: tuple[Exponents, Exponents],
        reduced: Reduced,
        bodies: FrictionBodies,
    ) -> None:
        """Tabulate the transition between two contact modes, by the tables (1, ...) and exponents of each."""
        masks = int(before.mask[0]), int(after.mask[0])
        for mask, tables, growing in zip(masks, (before, after), exponents, strict=True):
            if mask not in self._modes:
                _, self._modes[mask] = self._take(
                    (mask, mask, "mode"), partial(seen_in, tables, reduced, bodies)
                )
            if mask not in self._energies and tables.loss.shape[1]:
                self._tabulate_measures(tables, growing)
        self._entry[masks], _ = self._take((*masks, "transition"), partial(transition, before, after))

    def _tabulate_measures(self, tables: ModeTables, exponents: Exponents) -> None:
        """Tabulate what spans in a contact mode are measured by."""
        mask, q = int(tables.mask[0]), tables.switch_re.shape[1] // 2
        _, self._outputs[mask] = self._take((mask, mask, "outputs"), partial(output_rows, tables))
        key = mask, mask, "energies"
        self._energies[mask], _ = self._take(key, partial(form_blocks, tables.loss[0]))
        for i in range(q):
            if plain(state_of)(mask, i) not in (FORWARD, BACKWARD):
                continue
            place, _ = self._take((mask, i, "rub"), partial(rub_blocks, tables, i, exponents))
            if self._room.number[place] != UNKNOWN:
                self._rubs[mask, i] = place

    def _note_passages(self) -> None:
        """Take over the kernel's counts of passages; they must be passed to it again afterwards."""
        if self._placed is not None:
            entry, self._placed = self._placed.entry, None
            met = np.nonzero(entry != UNKNOWN)
            for before, after, passed in zip(*(part.tolist() for part in (*met, entry[met])), strict=True):
                self._entry[self._masks[before], self._masks[after]] = passed

    def _take(self, key: tuple[int, int, str], make: Callable[[], Part]) -> tuple[int, int]:
        """Places in `number` and `value` of the part of a key."""
        at_number, at_value, n_byte = self._room.take(key, make)
        self._n_byte += n_byte
        return at_number, at_value


def _with_room(array: NDArray[Any], n_filled: int, n_more: int) -> NDArray[Any]:
    """The array, or a longer one with the same content."""
    if n_filled + n_more <= array.size:
        return array
    longer = room_for((2 * (n_filled + n_more),), array.dtype)
    longer[:n_filled] = array[:n_filled]
    return longer


def seen_in(tables: ModeTables, reduced: Reduced, bodies: FrictionBodies) -> Part:
    """Readings of the q pairs in a mode for events, effects of impulses on its coordinates, and its reach.

    They are (4 q, 2, m), (2 q, 2, m) and (m,), one after the other; the reach is the largest motion along
    `reduced.translations` with each coordinate.
    """
    q, n = reduced.gap_jacobian.shape
    rows = np.zeros((q, 4, 2 * n))
    rows[:, 0, n:], rows[:, 1, n:] = reduced.gap_jacobian, reduced.slip
    rows[:, 2], rows[:, 3] = bodies.pull[:q], bodies.pull[q:]
    motion_re, motion_im = tables.motion_re[0], tables.motion_im[0]
    rows = rows.reshape(4 * q, 2 * n)
    seen = np.stack([rows @ motion_re, rows @ motion_im], axis=1)
    struck = np.stack([reduced.gap_jacobian, -reduced.slip], axis=1).reshape(2 * q, n)
    given = np.stack([struck @ tables.enter_re[0, n:], struck @ tables.enter_im[0, n:]], axis=1)
    moved = reduced.translations @ (motion_re[:n] + 1j * motion_im[:n])
    value = np.concatenate([seen.ravel(), given.ravel(), np.abs(moved).max(axis=0)])
    return Part(np.zeros(0, dtype=np.int64), value, np.zeros(0, dtype=np.int64))


def transition(before: ModeTables, after: ModeTables) -> Part:
    """What becomes of the coordinates of a mode in another one: `x = Re(motion @ z)`, and entered again."""
    m, first, q = before.pace.shape[1], int(before.n_eigenmode[0]), before.enter_constant.shape[1]
    both = before, after
    enter = [np.hstack([tables.enter_re[0], tables.enter_im[0]]) for tables in both]
    moves, moved = (np.hstack([tables.motion_re[0], -tables.motion_im[0]]) for tables in both)
    is_source = np.asarray(enter[0].any(axis=0) & moves.any(axis=0))  # imaginary parts of decays move nothing
    is_source[first : first + 1 + q], is_source[m + first] = True, True
    decay = np.tile(np.hypot(before.power_re[0, -1], before.power_im[0, -1]), 2)
    of_source = np.flatnonzero(is_source)
    of_target = np.flatnonzero(enter[1].any(axis=0) & moved.any(axis=0))
    # Those that decay fast stand together: the kernel leaves out rows of nothing, eight at a time.
    of_source = of_source[np.argsort(np.where(decay < DECAYED, decay, 1.0)[of_source], kind="stable")]
    matrix = enter[1][:, of_target].T @ moves[:, of_source]
    place = np.argsort(of_source)[
        np.searchsorted(np.sort(of_source), [first, m + first, *range(first + 1, first + 1 + q)])
    ]
    taken_off = [after.enter_cosine[0], after.enter_sine[0], *after.enter_constant[0]]
    matrix[:, place] -= np.reshape(taken_off, (2 + q, 2 * m))[:, of_target].T
    kept_to: list[int] = []
    kept_from: list[int] = []
    index: list[int] = []
    value: list[Floats] = []
    shifted: list[int] = []
    n_block = n_value = 0
    for rows, columns in _blocks(matrix):
        targets, sources, block = of_target[rows], of_source[columns], matrix[rows[:, None], columns]
        place = np.abs(block).argmax(axis=1)
        is_kept = len(targets) == len(sources) and len(set(place.tolist())) == len(targets)
        if is_kept and np.abs(block - np.eye(len(sources))[place]).max() < UNMOVED:
            kept_to += targets.tolist()
            kept_from += sources[place].tolist()
            continue
        filled = np.zeros((len(sources), _whole(len(targets))))
        filled[:, : len(targets)] = block.T
        shifted.append(len(index) + 2)
        index += [len(sources), len(targets), n_value, *sources.tolist(), *targets.tolist()]
        value.append(filled.ravel())
        n_value += filled.size
        n_block += 1
    head = [len(kept_to), n_block, *kept_to, *kept_from]
    return Part(
        np.array(head + index),
        np.concatenate([*value, np.zeros(0)]),
        np.array(shifted, dtype=np.int64) + len(head),
    )


def _blocks(matrix: Floats) -> list[tuple[Ints, Ints]]:
    """Rows and columns of each block of a matrix that has only zeros beside them."""
    n_row, n_column = matrix.shape
    linked = np.zeros((n_row + n_column, n_row + n_column), dtype=np.bool_)
    linked[:n_row, n_row:] = matrix != 0.0
    parts = ((both[both < n_row], both[both >= n_row] - n_row) for both in coupled_rows(linked))
    return [(rows, columns) for rows, columns in parts if rows.size and columns.size]


def output_rows(tables: ModeTables) -> Part:
    """The output rows at a time, (o, 2, m), with rows of zeros up to a multiple of four."""
    n_row = tables.output.shape[2] // SAMPLES_AT_ONCE
    rows = np.zeros((whole_rows(n_row), tables.output.shape[1]))
    rows[:n_row] = tables.output[0, :, :n_row].T
    return Part(np.zeros(0, dtype=np.int64), rows.ravel(), np.zeros(0, dtype=np.int64))


def form_blocks(form: Floats) -> Part:
    """A symmetric form (2 m, 2 m) of coordinates by its blocks."""
    live = np.flatnonzero(form.any(axis=1))
    blocks = [live[rows] for rows in coupled_rows(form[live[:, None], live] != 0.0)]
    index, shifted, n_value = [len(blocks)], list[int](), 0
    value: list[Floats] = []
    for rows in blocks:
        size = _whole(len(rows))
        block = np.zeros((size, size))
        block[: len(rows), : len(rows)] = form[rows[:, None], rows]
        shifted.append(len(index) + 1)
        index += [size, n_value, *rows.tolist(), *[0] * (size - len(rows))]
        value.append(block.ravel())
        n_value += block.size
    return Part(np.array(index), np.concatenate([*value, np.zeros(0)]), np.array(shifted, dtype=np.int64))


def rub_blocks(tables: ModeTables, i: int, exponents: Exponents) -> Part:
    """The form of force times slip of sliding pair i by its blocks; UNKNOWN where there is none."""
    form = rub_form(tables, i, exponents)
    if form is None:
        return Part(np.array([UNKNOWN]), np.zeros(0), np.zeros(0, dtype=np.int64))
    return form_blocks(form)


def _whole(count: int) -> int:
    """The least number of whole vectors that hold a count."""
    return -(-count // LANES) * LANES
