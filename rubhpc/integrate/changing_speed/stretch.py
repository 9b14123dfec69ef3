"""Several pieces of a run-up in one kernel call: those with the same matrices and number of samples."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.changing_speed.range_library import RangeLibrary
from rubhpc.integrate.marches.modal import Place
from rubhpc.integrate.measuring.samples import stacked_accumulators
from rubhpc.kernels.accumulators import Accumulator, Samples
from rubhpc.kernels.case_progress import FINISHED, MODE_WANTED, PAUSED
from rubhpc.kernels.pieces import PIECE, STANDING, TO_BEGIN, Pieces

if TYPE_CHECKING:
    from collections.abc import Callable

    from rubhpc.integrate.changing_speed.block import Block
    from rubhpc.integrate.changing_speed.piece_setup import PieceSetup
    from rubhpc.integrate.marches.event_driven import EventDrivenMarch

Floats = NDArray[np.float64]


class Stretch(NamedTuple):
    """Results of consecutive pieces."""

    n_piece: int
    whole: Floats  # (n_row, n_sample), about the sag
    sums: Accumulator  # (n_part, ...), of each revolution, or of each piece where that is less
    last: Accumulator  # of the last part
    n_step: int
    end: Place
    left: tuple[int, Floats]  # end of the last piece, as in `EventDrivenMarch.reached_in`


def begin_stretch(
    march: EventDrivenMarch,
    setup: PieceSetup,
    begun: Place,
    since: float,
    left: tuple[int, Floats] | None = None,
) -> RangeLibrary | None:
    """Begin a piece, to be continued in the same kernel call; None where it must be integrated alone.

    It has begun either way, but where the march is none that takes several (`has_piece_loop`). `left` is
    where the piece before has ended (`EventDrivenMarch.reached_in`), of modes that follow the speed, `since`
    the time from its middle to that of this one, s.
    """
    library = march.begin_tuned(setup, begun)
    if not isinstance(library, RangeLibrary):
        return None
    if left is not None and library.follows(march.mask):
        march.keep_fast(left, setup.spin, since)
    return None if library.n_room == 1 or library.has_strange(march.met) else library


def take_stretch(
    march: EventDrivenMarch,
    library: RangeLibrary,
    block: Block,
    first: int,
    samples: Samples,
    begun: Place,
    earlier: tuple[Accumulator, float],
    look: Callable[[int], None],
) -> Stretch | None:
    """Integrate the pieces from `first` on, as far as possible; None where that is not possible.

    Parameters
    ----------
    march : EventDrivenMarch
        Whose case it is, at the beginning of the first of them (`begin_stretch`, whose library this is); it
        stands nowhere afterwards, until it begins again.
    block : Block
        Pieces of the same matrices.
    samples : Samples
        Room for those of one piece.
    begun, earlier
        As in `Passing.take`.
    """
    speeds, n_piece, model = block.speeds, min(len(block), library.window_end), block.model
    n_row, n_sample = samples.whole.shape
    part = min(n_sample, block.held.template.samples_per_revolution)
    n_part = n_sample // part
    q, n = march.bodies.gap_jacobian.shape
    lasts = n_sample * speeds.interval
    pieces = Pieces(
        spin=speeds.spin[:n_piece],
        growth=speeds.growth[:n_piece],
        tick=speeds.tick[:n_piece],
        search_level=block.search_level[:n_piece],
        force=block.force[:n_piece],
        since=np.array([earlier[1] if i == first else lasts[i - 1] for i in range(n_piece)]),
        table=library.filled(march.met),
        n_room=library.n_room,
        n_sample=n_sample,
        n_part_sample=part,
        energy_limit=block.held.template.energy_limit,
        at=np.array([first, 0, TO_BEGIN, march.mask]),
        moved_by=march.moved_by(-1) if library.follows(march.mask) else 0,
        left=march.reached_in()[1],
        motion=np.zeros((n_piece + 1, 2 * n)),
        pressing=np.zeros((n_piece + 1, q)),
        seen=np.empty((2, 3 + model.n_place)),
        n_step=np.zeros(n_piece, dtype=np.int64),
        whole=np.empty((n_row, n_piece * n_sample)),
    )
    pieces.motion[first], pieces.pressing[first] = march.begun_motion, begun.contact_force
    sums = stacked_accumulators(1 + n_piece * n_part, earlier[0])
    for field, value in zip(sums, earlier[0], strict=True):
        field[first * n_part] = value
    seen = march.seen()
    while True:
        outcome = march.advance_through(pieces, samples, sums)
        if outcome not in (MODE_WANTED, PAUSED):
            break
        look(int(pieces.at[PIECE]))
        if outcome == MODE_WANTED:
            library.reach(int(pieces.at[PIECE]))
            march.find_wanted()
            if library.has_strange(march.met):  # from here on piece by piece
                march.step_back(pieces)
                break
            pieces = pieces._replace(table=library.filled(march.met))
    end = int(pieces.at[PIECE])
    assert end == n_piece or outcome != FINISHED
    has_lost = any(
        march.has_lost_events(
            int(pieces.n_step[i]), float(lasts[i]), pieces.motion[i + 1], pieces.pressing[i + 1] > 0.0
        )
        for i in range(first, end)
    )
    if has_lost:  # each is integrated alone
        pieces.seen[:] = seen
        march.step_back(pieces)
    if end == first or has_lost:
        return None
    parts = slice(1 + first * n_part, 1 + end * n_part)
    return Stretch(
        n_piece=end - first,
        whole=pieces.whole[:, first * n_sample : end * n_sample],
        sums=Accumulator._make(field[parts] for field in sums),
        last=Accumulator._make(field[end * n_part] for field in sums),
        n_step=int(pieces.n_step.sum()),
        end=Place(pieces.motion[end].copy(), model.sag, pieces.pressing[end].copy()),
        left=(march.moved_by(int(pieces.at[STANDING])), pieces.left),
    )
