"""The set-ups of a run-up's pieces, in matrices of ranges of speed and acceleration."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from rubhpc.integrate.changing_speed.piece_setup import with_values
from rubhpc.integrate.changing_speed.range_library import speeds_of
from rubhpc.integrate.changing_speed.ripples import Ripples
from rubhpc.integrate.changing_speed.speed_ranges import SpeedRanges

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.changing_speed.piece_setup import PieceSetup, RangeMatrices
    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.kernels.closed_form.filling import Speeds

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]


AT_ONCE, SAGGING_AT_ONCE = 16, 8  # pieces set up together; where their sag, one for all, follows the speed
LEAST_GROWTH = 1e-5  # of the unbalance force in a piece
MOST_AT_HAND = 4  # matrices at hand, of a spin that swings between them
MOST_BYTES = 3 * 2**29  # of contact modes that are kept, with their matrices, for other cases
MOST_DRIVEN_BYTES = 2**27  # the same of a free spin, whose cases have few speeds in common

# Of each set-up, the matrices by speed, acceleration, slope of the torque and the range before, the latest
# last, for other cases too.
_KNOWN: WeakKeyDictionary[ModalSetup, dict[tuple[object, ...], RangeMatrices]] = WeakKeyDictionary()

_RIPPLES: WeakKeyDictionary[ModalSetup, Ripples] = WeakKeyDictionary()


class Block:
    """The set-ups of pieces that share matrices and sag; each is made when first needed.

    Parameters
    ----------
    matrices : RangeMatrices
    model : Model
        About the sag that they share.
    speeds : Speeds
        Of the pieces, k of them.
    force : (k, 2, n), N
        Unbalance: times cosine and sine of the shaft's angle.
    search_level : (k,)
        As in `Clock`.
    interval : (k,), s
        Of samples.
    """

    def __init__(
        self,
        matrices: RangeMatrices,
        model: Model,
        speeds: Speeds,
        force: Floats,
        search_level: Ints,
        interval: Floats,
    ) -> None:
        self.matrices, self.model, self.speeds = matrices, model, speeds
        self.force, self.search_level, self.interval = force, search_level, interval
        self._made: dict[int, PieceSetup] = {}

    def __len__(self) -> int:
        return self.speeds.spin.size

    def __getitem__(self, place: int) -> PieceSetup:
        found = self._made.get(place)
        if found is None:
            found = self._made[place] = self._make(place)
        return found

    @property
    def last(self) -> PieceSetup:
        """The set-up of the last piece."""
        return self[len(self) - 1]

    def _make(self, place: int) -> PieceSetup:
        matrices, speeds, template = self.matrices, self.speeds, self.matrices.template
        spin, tick = float(speeds.spin[place]), float(speeds.tick[place])
        search, growth = int(self.search_level[place]), float(speeds.growth[place])
        at_place = matrices.at_place(float(speeds.within[place]))
        return with_values(
            template,
            model=self.model,
            reduced=with_values(at_place, spin=spin, force=self.force[place]),
            spin=spin,
            interval=float(self.interval[place]),
            tick=tick,
            clock=template.clock._replace(spin=spin, tick=tick, search_level=search, growth=growth),
            speeds=speeds,
            place=place,
        )


class Pieces:
    """The set-ups of the pieces of a run-up, from that at its highest speed, which keeps the most modes."""

    def __init__(self, fastest: ModalSetup) -> None:
        self._fastest = fastest
        self._ranges = SpeedRanges(fastest)
        self._at_hand: list[RangeMatrices] = []  # the latest first
        self._used: set[tuple[object, ...]] = set()  # those of `_KNOWN` that this case has used

    @property
    def ripples(self) -> Ripples:
        """How long pieces may be; also for other cases of the same set-up."""
        fastest = self._fastest
        if fastest not in _RIPPLES:
            _RIPPLES[fastest] = Ripples(self._ranges.linear, fastest.accuracy)
        return _RIPPLES[fastest]

    def setup(
        self,
        speed: float,
        acceleration: float,
        angle: float,
        duration: float,
        torque: float = 0.0,
        slope: float = 0.0,
    ) -> PieceSetup:
        """The set-up of a piece: mean speed (rad/s), acceleration (rad/s^2), first angle, duration (s).

        `torque` (N m) is that of the drive of a free spin, `slope` (N m s) its change with the speed.
        """
        matrices = self._find(speed, acceleration, slope)
        columns = np.array([[speed], [acceleration], [angle], [duration]])
        return self._in_range(matrices, columns, torque)[0]

    def blocks(
        self, speed: Floats, acceleration: Floats, angle: Floats, duration: Floats, n_sample: Ints
    ) -> Iterator[Block]:
        """The set-ups of the pieces of a prescribed run-up, together where they share matrices and sag.

        As `setup`, (n_piece,) each; `n_sample` are the samples in each piece, the same in those together.
        """
        first = 0
        while first < speed.size:
            matrices, last = self._find(float(speed[first]), float(acceleration[first])), first + 1
            at_once = SAGGING_AT_ONCE if matrices.sagging_models else AT_ONCE
            while (
                last < min(speed.size, first + at_once)
                and n_sample[last] == n_sample[first]
                and acceleration[last] == acceleration[first]
                and matrices.serve(speed[last], acceleration[last])
            ):
                last += 1
            columns = np.stack([speed, acceleration, angle, duration])[:, first:last]
            yield self._in_range(matrices, columns)
            first = last

    def _in_range(self, matrices: RangeMatrices, columns: Floats, torque: float = 0.0) -> Block:
        """The set-ups of pieces that all have the same matrices; columns as the arguments of `setup`.

        Their sag is that of the first acceleration and of the mean speed.
        """
        speed, acceleration, angle, duration = columns
        asked = (torque, *columns.ravel().tolist())
        if angle[0] == 0.0 and matrices.first is not None and matrices.first[0] == asked:
            assert isinstance(matrices.first[1], Block)
            return matrices.first[1]
        model = matrices.sagging(torque, float(acceleration[0]), float(speed.mean()))
        lag = acceleration * duration**2 / 12.0
        growth = growth_of(speed, acceleration, duration)
        begins = np.exp(1j * (angle - lag) - 0.5 * growth * duration)
        factor = (speed**2 - 1j * acceleration) * begins
        phasor = factor[:, np.newaxis] * self._ranges.phasor
        force = np.stack([phasor.real, -phasor.imag], axis=1)
        interval = 2.0 * math.pi / (np.abs(speed) * self._fastest.samples_per_revolution)
        tick = interval / (1 << matrices.sample_level)
        at_middle = matrices.reduced.spin, matrices.sample_level, matrices.reach
        speeds = speeds_of(speed, factor, growth, tick, *at_middle)
        longest = np.floor(np.log2(matrices.template.step / tick)).astype(int)
        search_level = np.clip(longest, 0, matrices.sample_level)
        found = Block(matrices, model, speeds, force, search_level, interval)
        if angle[0] == 0.0:
            matrices.first = asked, found
        return found

    def _find(self, speed: float, acceleration: float, slope: float = 0.0) -> RangeMatrices:
        """Matrices that may be held at a speed and an acceleration."""
        for i, matrices in enumerate(self._at_hand):
            if matrices.serve(speed, acceleration, slope):
                if i:
                    self._at_hand.insert(0, self._at_hand.pop(i))
                return matrices
        known = _KNOWN.setdefault(self._fastest, {})
        guess = self._at_hand[0].reach if self._at_hand else None
        asked = speed, acceleration, slope, guess
        found = known.pop(asked, None) or self._ranges.hold(speed, acceleration, slope, guess)
        if self._make_room(known):
            known[asked] = found
            self._used.add(asked)
        self._at_hand.insert(0, found)
        for left in self._at_hand[MOST_AT_HAND:]:
            if left not in known.values():
                left.forget()
        del self._at_hand[MOST_AT_HAND:]
        return found

    def _make_room(self, known: dict[tuple[object, ...], RangeMatrices]) -> bool:
        """Forget matrices that this case has not used, the earliest first; whether more may be kept.

        The next case begins with those that this one has used first.
        """
        most = MOST_BYTES if self._fastest.free_spin is None else MOST_DRIVEN_BYTES
        n_byte = sum(matrices.n_byte for matrices in known.values())
        for key in [key for key in known if key not in self._used]:
            if n_byte <= most:
                break
            n_byte -= (left := known.pop(key)).n_byte
            left.forget()
        return n_byte <= most


def growth_of(speed: Floats, acceleration: Floats, duration: Floats) -> Floats:
    """Growth of the unbalance force over pieces, 1/s: from the square of the first speed to that of the last.

    Speeds (rad/s) are means. What changes by less than `LEAST_GROWTH` is held: its energies are steady.
    """
    half = 0.5 * acceleration * duration / speed
    growth = 2.0 * np.log((1.0 + half) / (1.0 - half)) / duration
    return np.where(np.abs(growth * duration) > LEAST_GROWTH, growth, 0.0)
