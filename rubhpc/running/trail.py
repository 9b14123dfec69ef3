"""How far a case has come at what cost, for `rubhpc plan`, and what its rest will cost."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.lyapunov import n_followed
from rubhpc.integrate.measuring.regimes import LEAST_REVOLUTIONS
from rubhpc.integrate.modal_setup import ModalSetup
from rubhpc.running.memory import memory

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.integrate.setup import Setup
    from rubhpc.study.cases import Case
    from rubhpc.study.study import Study

_FOLLOWED, _MOST_FOLLOWED = 80, 320  # revolutions after a record: usual, and most, where no period is found
_OFF, _MOST_OFF = 1.25, 3.0  # factor by which a rest is off per doubling of what was run, and at most
_BRANCHES = 2.0  # that are followed in all, over the first one
_LEAST_BRANCHES, _MOST_BRANCHES = 0.3, 3.0  # of the predicted rest


@dataclass(frozen=True, kw_only=True)
class Timed:
    """Processor times of a case, s.

    Attributes
    ----------
    steps : float
        Predicted.
    spent : float
        As far as it was run, without `speed` and `shared`.
    is_whole : bool
        Whether it was run to its end.
    share : float
        Share of its revolutions that was run; 0 where that is not known.
    rest, least, most : float
        Predicted time of the rest, and a range of it.
    speed : float
        Of its set-up.
    shared : float
        Of contact modes that other cases of its speed and friction need not solve again.
    transient, modes : float
        Share of its time before the record, and for contact modes.
    n_mode : int
        Contact modes that were solved; 0 with one stator.
    n_byte : float
        Predicted memory of all its contact modes.
    """

    steps: float
    spent: float
    is_whole: bool
    share: float = 1.0
    rest: float = 0.0
    least: float = 0.0
    most: float = 0.0
    speed: float = 0.0
    shared: float = 0.0
    transient: float = 0.0
    modes: float = 0.0
    n_mode: int = 0
    n_byte: float = 0.0


class Trail:
    """Time, revolutions and contact modes of a case as it goes on; its set-up begins now."""

    def __init__(self, study: Study, case: Case) -> None:
        self._study, self._case = study, case
        self._setup: Setup | None = None
        self._set_up_from = self._began = time.process_time()
        self._followed, self._memory = n_followed(), memory()
        self._solved = 0
        self._noted: list[float] = []
        self._rows: list[tuple[float, float, float]] = [(0.0, 0.0, 0.0)]
        recording, law = study.recording, case.speed_law
        self._n_transient = recording.longest_transient if law is None else 0  # revolutions
        self._n_whole = float(self._n_transient + recording.revolutions if law is None else law.n_revolution)

    def begin(self, setup: Setup | None) -> None:
        """Begin the case, with a set-up unless it is one of branches."""
        self._setup, self._began = setup, time.process_time()
        self._solved = self._n_solved()

    @property
    def is_known(self) -> bool:
        """Whether something is known of the rest of the case."""
        return max(self._noted, default=0.0) > 0.0 or n_followed() > self._followed

    def note(self, done: float) -> None:
        """Take the share of the case that is done, or the parameter's value that branches have reached."""
        self._noted.append(done)

    def enter(self) -> None:
        """Enter what is reached now."""
        at = max(self._noted, default=0.0) * self._n_whole + n_followed() - self._followed
        self._rows.append((time.process_time() - self._began, at, self._n_solved() - self._solved))

    def timed(self, steps: float, *, is_whole: bool) -> Timed:
        """Time of the case, which has ended or was cut now."""
        self.enter()
        rows = np.array(self._rows)
        spent, done, n_mode = rows[-1].tolist()
        spent = max(spent, 1e-6)
        speed = self._began - self._set_up_from
        found = Timed(steps=steps, spent=spent, is_whole=is_whole, speed=speed)
        if self._study.branch is not None:
            return found if is_whole else self._of_branches(found)
        a_mode = _cost_of_mode(rows)
        found = replace(
            found,
            transient=min(self._n_transient / max(done, self._n_whole), 1.0),
            modes=n_mode * a_mode / spent,
            n_mode=int(n_mode),
            n_byte=self._n_byte,
        )
        if is_whole:
            return found
        if done <= 0.0:
            return replace(found, share=0.0, most=math.inf)
        # The last half of what was run, more or less, stands for the rest.
        late, passed, new = (rows[-1] - rows[rows[:, 1] <= 0.5 * done][-1]).tolist()
        usual, longest = (self._revolutions(n) for n in (_FOLLOWED, _MOST_FOLLOWED))
        doublings = math.log2(usual / done)
        off = min(_OFF ** (1.0 + doublings), _MOST_OFF)
        pace = late / passed
        without = max(pace - new * a_mode / passed, 0.0)  # new contact modes
        more = new * doublings  # each doubling of the revolutions meets as many contact modes, about
        rest = (usual - done) * without + more * a_mode
        return replace(
            found,
            share=done / usual,
            rest=rest,
            least=rest / off,
            most=max(rest * off, (longest - done) * pace),
            modes=(n_mode + more) * a_mode / (spent + rest),
            n_byte=found.n_byte * (1.0 + more / max(n_mode, 1.0)),
        )

    def _revolutions(self, n_behind: int) -> float:
        """Revolutions of a whole case, with so many after its record, or twice as many as there were."""
        if self._case.speed_law is not None or self._study.recording.revolutions < LEAST_REVOLUTIONS:
            return self._n_whole
        return self._n_whole + max(n_behind, 2 * (n_followed() - self._followed))

    def _of_branches(self, found: Timed) -> Timed:
        """Branches that were cut: the first one runs to one end of the range, then to the other."""
        branch = self._study.branch
        assert branch is not None
        span = self._study.axis(branch.along).drawn_from
        assert span is not None
        share = float(np.ptp(self._noted) / abs(span.stop - span.start)) if self._noted else 0.0
        if share <= 0.0:
            return replace(found, share=0.0, most=math.inf)
        rest = found.spent * (_BRANCHES / share - 1.0)
        return replace(
            found, share=share, rest=rest, least=_LEAST_BRANCHES * rest, most=_MOST_BRANCHES * rest
        )

    def _n_solved(self) -> int:
        """Contact modes of a ring that cases of this friction have had solved."""
        setup = self._setup
        if not isinstance(setup, ModalSetup) or len(setup.model.stators) == 1:
            return 0
        return setup.n_solved(self._case.friction)

    @property
    def _n_byte(self) -> float:
        """Memory of contact modes, bytes; that of one pair is negligible."""
        setup = self._setup
        if not isinstance(setup, ModalSetup) or len(setup.model.stators) == 1:
            return 0.0
        if self._case.speed_law is not None:
            return max(memory() - self._memory, 0.0)
        return sum(setup.n_byte.values()) + setup.n_byte_of_parts


def _cost_of_mode(rows: NDArray[np.float64]) -> float:
    """Time of a contact mode, s: least squares of the time by revolutions and modes, neither negative."""
    from scipy.optimize import nnls

    if rows[-1, 2] == 0.0 or len(rows) < 4:
        return 0.0
    scale = np.maximum(rows[-1, 1:], 1.0)
    return float(nnls(rows[:, 1:] / scale, rows[:, 0])[0][1] / scale[1])
