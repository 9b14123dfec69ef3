"""Times a few cases of a study for `rubhpc plan`, each no longer than there is time and memory for."""

from __future__ import annotations

import gc
import math
import signal
import sys
import tempfile
import threading
import time
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.compilation import is_compiling, seconds_compiling
from rubhpc.integrate.lyapunov import n_followed
from rubhpc.integrate.measuring.regimes import LEAST_REVOLUTIONS
from rubhpc.integrate.modal_setup import ModalSetup
from rubhpc.running.case_setup import KeptSetups
from rubhpc.running.plan_estimate import Timed, relative_error
from rubhpc.running.warm_up import WARM, load_kernels, part_of
from rubhpc.running.worker import put_any, record_of
from rubhpc.storage import layout
from rubhpc.storage.block_files import BlockFiles
from rubhpc.storage.disk import flush_to_disk, write_whole
from rubhpc.storage.store import case_checksum
from rubhpc.study.speed_law import SpeedLaw

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from rubhpc.integrate.branches.case import BranchRecord
    from rubhpc.integrate.changing_speed.case import RunUpRecord
    from rubhpc.integrate.record import Record
    from rubhpc.integrate.setup import Setup
    from rubhpc.storage.manifest import Manifest
    from rubhpc.study.cases import Case, CaseGrid
    from rubhpc.study.contact_keys import Contact
    from rubhpc.study.study import Study

    AnyRecord = Record | BranchRecord | RunUpRecord
    Index = tuple[int, ...]

_STATUS = Path("/proc/self/status")
_NOW = "VmRSS:"
_PEAK = "VmHWM:"  # of the program itself: getrusage includes the process that started it


def peak_memory() -> float:
    """Peak memory of this process so far, bytes."""
    try:
        return 1024.0 * float(_STATUS.read_text().split(_PEAK)[1].split()[0])
    except (OSError, IndexError, ValueError):  # no Linux
        from resource import RUSAGE_SELF, getrusage

        return getrusage(RUSAGE_SELF).ru_maxrss * (1.0 if sys.platform == "darwin" else 1024.0)


def memory() -> float:
    """Memory of this process now, bytes; its peak where that is unknown."""
    try:
        return 1024.0 * float(_STATUS.read_text().split(_NOW)[1].split()[0])
    except (OSError, IndexError, ValueError):
        return peak_memory()


_MOST_CASES = 200
_FEW = 6  # cases, which share the time
_ALL = 24  # cases: of a study of up to so many all are begun
_ENOUGH, _AGREED = 3.0, 0.15  # s of cases after which no more are begun if their mean is known so well
_LEAST_EACH = 0.5  # s for a case
_AGAIN = 0.25  # s: a case with one stator that takes less is run twice
_LATE = 0.2  # s after its end at which a case is cut that does not ask
MOST_BYTES = 800e6  # of this process, above which a case is cut
_PARTS, _STRIDE, _OFF_PART = 8, 0.618034, 3.0  # of a run-up; between them; by how much one may be off
_MOST_RUN_UP = 2.7e9  # bytes of contact modes of a run-up, about: those of other speeds are freed
_FOLLOWED, _MOST_FOLLOWED = 80, 320  # revolutions after a record: usual, and most, where no period is found
_OFF, _MOST_OFF = 1.25, 3.0  # factor by which a rest is off per doubling of what was run, and at most
_BLOCKS, _LONGEST = 8, 0.5  # of the first blocks that are written, and s after which no more are
_BRANCHES = 2.0  # that are followed in all, over the first one
_LEAST_BRANCHES, _MOST_BRANCHES = 0.3, 3.0  # of the predicted rest


class Enough(BaseException):  # no error: what cuts a case, whatever it is doing
    """A case takes longer, or more memory, than there is for it."""


@dataclass(kw_only=True)
class Sample:
    """Cases that were timed.

    Attributes
    ----------
    cases : list of Timed
    failures : list of (tuple of int, str)
        Index of each case that failed, and why.
    record : Record, BranchRecord or RunUpRecord, optional
        Of the latest case that ended.
    loading : float
        Processor seconds for kernels, which every process needs.
    has_compiled : bool
        Whether kernels were compiled.
    memory : float
        Peak memory of this process without contact modes, bytes.
    was_full : bool
        Whether a case was cut for its memory.
    """

    cases: list[Timed] = field(default_factory=list)
    failures: list[tuple[Index, str]] = field(default_factory=list)
    record: AnyRecord | None = None
    loading: float = 0.0
    has_compiled: bool = False
    memory: float = 0.0
    was_full: bool = False


class CaseTimer:
    """Times cases of a grid until a moment of `time.monotonic`, that compilations put off."""

    def __init__(self, grid: CaseGrid, end: float) -> None:
        self._grid, self._study = grid, grid.study
        self._end = end - seconds_compiling()
        self._ready: set[Contact] = set()
        self._setups = KeptSetups(grid.study)
        self._n_part = 0  # parts of run-ups so far
        self._latest: tuple[Case, Timed] | None = None
        self.sample = Sample()

    @property
    def left(self) -> float:
        """Seconds that are left."""
        return self._end + seconds_compiling() - time.monotonic()

    @contextmanager
    def _alarm(self) -> Iterator[None]:
        """Cut what takes long without a check, such as a set-up, once no time is left."""

        def ring(*_: object) -> None:
            signal.setitimer(signal.ITIMER_REAL, max(self.left, _LATE))  # again: Python drops what is raised
            if self.left <= 0.0 and not is_compiling():  # within a callback of its garbage collector
                raise Enough

        if threading.current_thread() is not threading.main_thread():
            yield
            return
        before = signal.signal(signal.SIGALRM, ring)
        signal.setitimer(signal.ITIMER_REAL, max(self.left, 0.0) + _LATE)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, before)

    def time_cases(
        self, missing: NDArray[np.bool_], steps: Callable[[Index], float], say: Callable[[str], None]
    ) -> Sample:
        """Time some of the missing cases, spread over all axes; `say` receives their number."""
        sample = self.sample
        n_case = int(missing.sum())
        few = min(n_case, _ALL if n_case <= _ALL else _FEW)
        for k, index in enumerate(spread(missing, _MOST_CASES)):
            spent = sum(case.spent for case in sample.cases)
            is_known = k >= few and spent > _ENOUGH and relative_error(sample.cases, n_case) < _AGREED
            if is_known or (k and self.left <= 0.0):
                break
            say(f"timing cases: {len(sample.cases)} so far")
            limit = max(self.left / max(few - k, 2), _LEAST_EACH)
            try:
                with self._alarm():
                    self._add(index, steps(index), limit, missing)
            except Enough:  # before the case began
                break
            except Exception as error:  # the others are timed in spite of an error
                sample.failures.append((index, f"{type(error).__name__}: {' '.join(str(error).split())}"))
        return sample

    def time_half(self, seconds: float) -> float:
        """Time of the latest case that was cut, with every second stator over that with all; NaN if unknown.

        It takes so many seconds more, at most.
        """
        if self._latest is None or any(probe.stator for probe in self._study.recording.probe):
            return math.nan
        (case, whole), self._setups = self._latest, KeptSetups(self._study)
        gc.collect()
        self._end = time.monotonic() + seconds - seconds_compiling()
        fewer = replace(case, rig=replace(case.rig, stator=case.rig.stator[::2]))
        with suppress(Enough, Exception), self._alarm():
            half = self._time(fewer, whole.steps, math.inf)
            if half.most < math.inf:
                return half.whole / whole.whole
        return math.nan

    def _add(self, index: Index, steps: float, limit: float, missing: NDArray[np.bool_]) -> None:
        if memory() > 0.5 * MOST_BYTES:
            self._setups = KeptSetups(self._study)
            gc.collect()
            if memory() > 0.9 * MOST_BYTES and self.sample.cases:
                raise Enough
        began = time.process_time()
        case = self._grid.case(index)
        began_at = time.process_time() - began
        self._load_kernels(case)
        self.sample.memory = self.sample.memory or peak_memory()
        law = case.speed_law
        if isinstance(law, SpeedLaw) and law.n_revolution >= _PARTS * WARM:
            timed = self._time_run_up(case, law, steps, limit)
        else:
            timed = self._time(case, steps, limit)
        timed = replace(timed, speed=timed.speed + began_at)
        if not timed.is_whole and timed.most < math.inf:
            self._latest = case, timed
        other = self._alike(case) if timed.n_mode else case if timed.spent < _AGAIN else None
        if timed.is_whole and other is not None and self.left > timed.spent:
            again = self._time(other, steps, limit)
            if again.is_whole:
                shared = max(timed.spent - again.spent, 0.0)
                timed = replace(timed, spent=timed.spent - shared, shared=shared)
                if other is not case and missing[other.index]:
                    self.sample.cases.append(again)
        self.sample.cases.append(timed)

    def _alike(self, case: Case) -> Case | None:
        """Another case, far along one axis, that shares the contact modes of this one."""
        for axis, n in enumerate(self._grid.shape):
            index = list(case.index)
            index[axis] = (index[axis] + max(n // 2, 1)) % n
            other = self._grid.case(index) if n > 1 else case
            shared = other.rig is case.rig and other.contact == case.contact
            if other is not case and shared and (other.speed, other.friction) == (case.speed, case.friction):
                return other
        return None

    def _load_kernels(self, case: Case) -> None:
        """Compile or load the kernels of a law of contact, on the beginning of a case."""
        if case.contact in self._ready:
            return
        compiled, began = seconds_compiling(), time.process_time()
        load_kernels(self._grid, case, self._limit(math.inf))
        self._ready.add(case.contact)
        if seconds_compiling() > compiled:
            self.sample.has_compiled = True
        else:
            self.sample.loading += time.process_time() - began

    def _limit(self, seconds: float) -> Callable[[], None]:
        """Check that ends a case after so many seconds, or for its memory."""
        end = time.monotonic() + seconds - seconds_compiling()

        def check() -> None:
            if memory() > MOST_BYTES:
                self.sample.was_full = True
                raise Enough
            if self.left <= 0.0 or time.monotonic() > end + seconds_compiling():
                raise Enough

        return check

    def _time(self, case: Case, steps: float, limit: float) -> Timed:
        """Run a case once, or again if kernels were compiled."""
        while True:
            compiled = seconds_compiling()
            found = self._run(case, steps, limit)
            if seconds_compiling() == compiled:
                return found
            self.sample.has_compiled = True

    def _time_run_up(self, case: Case, law: SpeedLaw, steps: float, limit: float) -> Timed:
        """Run a part of a run-up somewhere, then all of it if there is time: rub begins late and costs most.

        Contact modes of a part are met again in others: memory is taken to grow with the square root.
        """
        n = law.n_revolution
        n_part = n // _PARTS
        first = int((0.5 + self._n_part * _STRIDE) % 1.0 * (n - n_part))
        self._n_part += 1
        found = self._time(replace(case, speed_law=part_of(law, first, first + n_part)), steps, limit)
        whole = found.whole * n / n_part
        if found.is_whole and whole <= 0.5 * self.left:
            return self._time(case, steps, 0.5 * self.left)
        rest = whole - found.spent
        return replace(
            found,
            is_whole=False,
            share=found.share * n_part / n,
            rest=rest,
            least=rest / _OFF_PART,
            most=rest * _OFF_PART if found.most < math.inf else math.inf,
            n_byte=min(found.n_byte * math.sqrt(n / n_part), _MOST_RUN_UP),
        )

    def _run(self, case: Case, steps: float, limit: float) -> Timed:
        cut, cut_unknown, record = self._limit(limit), self._limit(math.inf), None
        trail = Trail(self._study, case)

        def check() -> None:
            trail.enter()
            (cut if trail.is_known else cut_unknown)()

        with suppress(Enough):
            trail.begin(None if self._study.branch is not None else self._setups.of(case))
            record = record_of(self._grid, case, self._setups, None, check, note=trail.noted.append)
        self.sample.record = record or self.sample.record
        return trail.timed(steps, is_whole=record is not None)


class Trail:
    """Time, revolutions and contact modes of a case as it goes on; its set-up begins now.

    Attributes
    ----------
    noted : list of float
        Shares of the case that were done, or values of the parameter that branches have reached.
    rows : list of (float, float, float)
        Seconds, revolutions and solved contact modes, each time that they were entered.
    """

    def __init__(self, study: Study, case: Case) -> None:
        self._study, self._case = study, case
        self._setup: ModalSetup | None = None  # of a ring: others have no contact modes to count
        self._set_up_from = self._began = time.process_time()
        self._followed, self._memory = n_followed(), memory()
        self._solved = 0
        self.noted: list[float] = []
        self.rows: list[tuple[float, float, float]] = [(0.0, 0.0, 0.0)]
        recording, law = study.recording, case.speed_law
        self._n_transient = recording.longest_transient if law is None else 0  # revolutions
        self._n_whole = float(self._n_transient + recording.revolutions if law is None else law.n_revolution)

    def begin(self, setup: Setup | None) -> None:
        """Begin the case, with a set-up unless it is one of branches."""
        self._setup = setup if isinstance(setup, ModalSetup) and len(setup.model.stators) > 1 else None
        self._began, self._solved = time.process_time(), self._n_solved()

    def _n_solved(self) -> int:
        return 0 if self._setup is None else self._setup.n_solved(self._case.friction)

    @property
    def is_known(self) -> bool:
        """Whether something is known of the rest of the case."""
        return max(self.noted, default=0.0) > 0.0 or n_followed() > self._followed

    def enter(self) -> None:
        """Enter what is reached now."""
        at = max(self.noted, default=0.0) * self._n_whole + n_followed() - self._followed
        self.rows.append((time.process_time() - self._began, at, self._n_solved() - self._solved))

    def timed(self, steps: float, *, is_whole: bool) -> Timed:
        """Time of the case, which has ended or was cut now."""
        self.enter()
        rows = np.array(self.rows)
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
            n_byte=self._n_byte(),
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
        share = float(np.ptp(self.noted) / abs(span.stop - span.start)) if self.noted else 0.0
        if share <= 0.0:
            return replace(found, share=0.0, most=math.inf)
        rest = found.spent * (_BRANCHES / share - 1.0)
        return replace(
            found, share=share, rest=rest, least=_LEAST_BRANCHES * rest, most=_MOST_BRANCHES * rest
        )

    def _n_byte(self) -> float:
        """Memory of contact modes, bytes; that of one pair is negligible."""
        if self._setup is None:
            return 0.0
        if self._case.speed_law is not None:
            return max(memory() - self._memory, 0.0)
        return sum(self._setup.n_byte.values()) + self._setup.n_byte_of_parts


def _cost_of_mode(rows: NDArray[np.float64]) -> float:
    """Time of a contact mode, s: least squares of the time by revolutions and modes, neither negative."""
    from scipy.optimize import nnls

    if rows[-1, 2] == 0.0 or len(rows) < 4:
        return 0.0
    scale = np.maximum(rows[-1, 1:], 1.0)
    return float(nnls(rows[:, 1:] / scale, rows[:, 0])[0][1] / scale[1])


def time_block(manifest: Manifest, record: AnyRecord) -> float:
    """Processor seconds of a block full of one case, written to a temporary folder; 0 without one.

    It has the files and folders of a store: a block of one short case takes longer to write than to compute.
    """
    n_case = math.prod(manifest.chunk)
    data = {v.name: np.zeros((n_case, *manifest.extent(v)), v.dtype) for v in manifest.variables}
    put_any(record, data, 0)
    taken, end = [], time.monotonic() + _LONGEST
    try:
        with tempfile.TemporaryDirectory() as folder:
            files = BlockFiles(Path(folder), manifest)
            n_block = [-(-n // k) for n, k in zip(manifest.shape, manifest.chunk, strict=True)]
            for place in islice(np.ndindex(*n_block), _BLOCKS):  # they share folders as in a run
                began = time.process_time()
                for i in range(n_case):
                    case_checksum(data, i)
                for variable in manifest.variables:
                    values = data[variable.name]
                    values[:] = values[0]
                    path = files.own_file(variable, place)
                    shaped = values.reshape(*manifest.chunk, *values.shape[1:])
                    write_whole(path, layout.encode(shaped), is_synced=False)
                    flush_to_disk(path)
                taken.append(time.process_time() - began)
                if time.monotonic() > end:
                    break
    except OSError:  # the disk is full, or there is no folder
        return 0.0
    return float(np.mean(taken))


def spread(missing: NDArray[np.bool_], most: int) -> Iterator[Index]:
    """Indices of up to so many missing cases, none twice, spread evenly over all axes.

    The points of M. Roberts' sequence fill the axes evenly, however many there are. Where few cases are
    missing, the sequence runs over those alone.
    """
    flat = np.flatnonzero(missing)
    shape = missing.shape if flat.size > max(most, 0.2 * missing.size) else flat.shape
    root = 2.0
    for _ in range(64):  # root of x^(n + 1) = x + 1
        root = (1.0 + root) ** (1.0 / (len(shape) + 1))
    pace = root ** -np.arange(1.0, len(shape) + 1)
    seen: dict[int, None] = {}
    for k in range(20 * most):
        place = ((0.5 + k * pace) % 1.0 * shape).astype(int)
        at = flat[place[0]] if shape == flat.shape else np.ravel_multi_index(tuple(place), shape)
        if len(seen) < min(most, flat.size) and missing.flat[at]:
            seen.setdefault(int(at))
    seen |= dict.fromkeys(flat[: most if flat.size <= most else 0].tolist())  # it leaves out some of a few
    for at in seen:
        yield tuple(int(i) for i in np.unravel_index(at, missing.shape))
