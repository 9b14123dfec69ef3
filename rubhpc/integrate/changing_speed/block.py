"""A block of a run-up's pieces: those that share matrices and sag."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rubhpc.integrate.changing_speed.piece_setup import with_values

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.changing_speed.piece_setup import HeldMatrices, PieceSetup
    from rubhpc.kernels.filling import Speeds

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]


class Block:
    """The set-ups of pieces that share matrices and sag; each is made when first needed.

    Parameters
    ----------
    held : HeldMatrices
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
        held: HeldMatrices,
        model: Model,
        speeds: Speeds,
        force: Floats,
        search_level: Ints,
        interval: Floats,
    ) -> None:
        self.held, self.model, self.speeds = held, model, speeds
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
        held, speeds, template = self.held, self.speeds, self.held.template
        spin, tick = float(speeds.spin[place]), float(speeds.tick[place])
        search, growth = int(self.search_level[place]), float(speeds.growth[place])
        at_place = held.at_place(float(speeds.within[place]))
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
            _open_tables={},  # which are of this speed alone
        )
