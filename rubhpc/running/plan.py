"""The cost and progress of a study: cases are counted, and a few of them are timed."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.running.case_setup import MOST_BYTES, MOST_SETUPS, count_set_ups
from rubhpc.running.sampled_cases import CaseTimer, Estimate, memory
from rubhpc.schema import DIVERGED, DONE, FAILED, INFERRED, MISSING, STATUS
from rubhpc.storage.duration import duration, span
from rubhpc.storage.growth import origins
from rubhpc.storage.ledger import count
from rubhpc.storage.measures import blank_records, converted
from rubhpc.storage.new_manifest import manifest_of
from rubhpc.storage.parts import Shares
from rubhpc.storage.refined import Refinement, status_of
from rubhpc.storage.resume import cases_without_files, grid_for, is_store, missing_share
from rubhpc.storage.store import Store
from rubhpc.study.axis_ranges import axis_ranges
from rubhpc.study.parts import Part, check_parts, share_out
from rubhpc.study.sampling import CASE
from rubhpc.threads import on_one_thread

if TYPE_CHECKING:
    from collections.abc import Callable

    from rubhpc.running.sampled_cases import Sample
    from rubhpc.storage.manifest import Manifest
    from rubhpc.study.cases import CaseGrid
    from rubhpc.study.study import Study

_LINE = 400  # bytes of a case in a journal, about, for one stator
_OWN_COORDINATES = 9  # of the dimensions after the axes, the stators and the settings
_SECONDS, _LEAST = 12.0, 4.0  # wall time of all, and of timing at least
_OFF = 2.0  # factor by which the number of cases of a refined map is off, at most, as a rule (0.5 to 1.9)
_FOR_HALF, _MANY, _LONG = 3.0, 4, 600.0  # s of it to time half of so many stators, if all takes so many s
_AGREED = 1.06  # most over least time, up to which no range is given
_MAIN = 0.4  # share of the time from which a part of it is named
_FILE, _BYTE = 5e-4, 3e-9  # processor seconds to write a file, and a byte in it, about
_LEDGERS = 2  # copies of the measures of all cases while they are packed, about
_PRIVATE_FILES = 8  # manifests, journals, records of runs


@dataclass(frozen=True, kw_only=True)
class Plan:
    """The cost of a study.

    Attributes
    ----------
    grid : CaseGrid
    manifest : Manifest
        Of the store, as it is or will be.
    counts : tuple of int
        Cases that are missing, done, failed, diverged and inferred, in this order.
    steps : int
        Predicted integration steps of what is missing.
    time, bound : Estimate
        Time for what is missing, s, from the timed cases; NaN where they failed. Its most is infinite where a
        case was cut before its first revolution. `bound` is for a refined map of which all is computed.
    start_up : float
        Approximate processor seconds of the start and end of each process, which are not in `time`; 0 where
        that is unknown.
    spent : float
        Processor seconds of the timing, without loading kernels, which a run needs too.
    memory : float
        Approximate peak memory of a process, bytes; 0 where no case was timed.
    sample : Sample
        The cases that were timed.
    mostly : str
        What takes most of the time, and what would help; "" where nothing does.
    part : str
        The part of the study to which counts, steps and times refer, as "3/64"; "" for all of it.
    n_expected : int or None
        Cases that a refined map computes in all, about; `steps` and `time` are for the rest of them.
    """

    grid: CaseGrid
    manifest: Manifest
    counts: tuple[int, ...]
    steps: int
    time: Estimate
    bound: Estimate
    sample: Sample
    start_up: float = 0.0
    spent: float = 0.0
    memory: float = 0.0
    mostly: str = ""
    part: str = ""
    n_expected: int | None = None

    @property
    def _n_shard(self) -> int:
        """Files of an array of the finished store if blocks are packed; 0 otherwise."""
        manifest = self.manifest
        pairs = zip(manifest.shape, manifest.shard, strict=False)
        return math.prod(-(-n // s) for n, s in pairs) if manifest.shard else 0

    @property
    def n_file(self) -> int:
        """Files of the finished store, about."""
        manifest, n_block = self.manifest, len(self.grid.blocks())
        # Metadata and values of each measure, of the status and of each coordinate; metadata of the arrays.
        n_fixed = 2 * (len(manifest.measures) + 1 + len(manifest.axes) + _OWN_COORDINATES) + _PRIVATE_FILES
        return (1 + (self._n_shard or n_block)) * len(manifest.variables) + n_fixed

    @property
    def n_file_running(self) -> int:
        """Files at most before blocks are packed, about."""
        n_block = len(self.grid.blocks()) if self._n_shard else 0
        return self.n_file + n_block * len(self.manifest.variables)

    @property
    def _timed(self) -> list[str]:
        """Number of timed cases, and how well they represent the others."""
        n, cut = self.sample.n_case, self.sample.cut
        if not n:
            return []
        texts = [f"timed       {n} case{'s' * (n > 1)}" + ", all missing ones" * (n == self.counts[MISSING])]
        if cut:
            shares = [_percent(share) for share in (min(cut), max(cut))]
            memory = " or memory" * self.sample.was_full
            known = f" at {' to '.join(dict.fromkeys(shares))} of it" if max(cut) > 0.0 else ""
            texts.append(f"{len(cut)} cut for time{memory}{known}, the rest extrapolated")
        if self._range and n < self.counts[MISSING]:
            texts.append("they differ: such a range contains the time in eight to nine plans in ten")
        return ["; ".join(texts)]

    @property
    def _range(self) -> str:
        """Range of the time as text; "" where cases agree or nothing is known."""
        _, least, most = self.time
        if not most < math.inf or most <= _AGREED * least:
            return ""
        return span(least + self.start_up, most + self.start_up)

    @property
    def _cost(self) -> str:
        """Core-hours with the start of a process."""
        whole = self.time.seconds + (self.start_up if self.counts[MISSING] else 0.0)
        cost = (
            f"{'at least ' * math.isinf(self.time.most)}{whole / 3600:.3g} core-hours "
            f"({self._range or duration(whole)} on one core)"
            if math.isfinite(whole)
            else "core-hours unknown: "
            + ("the timed cases failed" if self.sample.failures else "no case could begin in time")
        )
        if self.start_up > 0.0 and self.counts[MISSING]:
            cost += f", including {self.start_up:.1f} s to start a process"
        return cost

    @property
    def _sizes(self) -> str:
        """The dimensions, as the study names its axes."""
        study = self.grid.study
        names = {axis.coordinate: axis.name for axis in study.axes}
        if study.sample is not None:
            n_range = sum(axis.drawn_from is not None for axis in study.axes)
            names[CASE] = f"{CASE} ({study.sample.n} points of {n_range} range{'s' * (n_range > 1)})"
        pairs = zip(self.grid.dims, self.grid.shape, strict=True)
        return " x ".join(f"{n} {names.get(dim, dim)}" for dim, n in pairs)

    def text(self) -> str:
        """The plan as a few lines of text."""
        grid, manifest, n_case = self.grid, self.manifest, self.grid.n_case
        n_block, n_sequence = len(grid.blocks()), len(grid.sequences())
        sweeps = (
            f"in {n_sequence} sequential sweep{'s' * (n_sequence > 1)}: more ranks than that would be idle"
        )
        idle = "more ranks would be idle" if n_sequence == n_block else sweeps
        per_case = _bytes_of_case(manifest)
        is_packed = self.n_file_running > self.n_file
        files = f"{self.n_file} files" + f", up to {self.n_file_running} before a run packs them" * is_packed
        compiled = "; includes compilation, less from now on" if self.sample.has_compiled else ""
        refined = (
            f"refined     computes at most all {n_case} cases, about {self.n_expected}"
            f"; at most {self.bound.seconds / 3600:.3g} core-hours"
        )
        so_far = ", ".join(
            f"{self.counts[i]} {STATUS[i]}"
            for i in (DONE, FAILED, DIVERGED, INFERRED, MISSING)
            if i != INFERRED or self.counts[i]
        )
        decay = grid.decay()
        return "\n".join(
            [
                f"{grid.study.title} -> {grid.study.output}",
                f"cases       {n_case} = {self._sizes}",
                *(f"            {text}" for text in axis_ranges(grid)),
                f"contact     {grid.study.model}",
                f"blocks      {n_block}, at most {math.prod(grid.chunk)} cases each; {idle}",
                f"store       {_size(n_case * (per_case + 2 * _LINE))} before compression, {files}",
                *([f"memory      {_size(self.memory)} a process, about{compiled}"] if self.memory else []),
                *([refined] if self.n_expected is not None else []),
                *([f"part        {self.part}: {sum(self.counts)} cases"] if self.part else []),
                f"so far      {so_far}",
                f"to compute  {self.steps:.3g} steps, {self._cost}",
                *self._timed,
                *([f"mostly      {self.mostly}"] if self.mostly else []),
                *(
                    f"failed      a timed case: "
                    f"{manifest.name_case(int(np.ravel_multi_index(index, grid.shape)))}: {text}"
                    for index, text in self.sample.failures
                ),
                *([f"decay       {decay}"] if decay else []),
                *(f"warning     {text}" for text in grid.warnings()),
            ]
        )


@on_one_thread
def make_plan(study: Study, part: str | None = None, say: Callable[[str], None] = lambda _: None) -> Plan:
    """Count, look into the store if there is one, and time some cases for some 15 s; writes nothing.

    With a part, such as "3/64", its missing cases are counted and timed. `say` receives the progress.

    Raises
    ------
    InputError
        The study cannot be run as it stands.
    StoreError
        The store at its output is of another study.
    """
    began = time.monotonic()
    chosen = None if part is None else Part.parse(part)
    if chosen is not None:
        check_parts(chosen, study)
    grid = grid_for(study)
    manifest = manifest_of(grid)
    kind = manifest.header.record_type
    status, shares = np.zeros(grid.n_case, np.int8), None
    records = blank_records(grid.n_case if manifest.refine else 0, kind)
    if is_store(study.output):
        store = Store(study.output)
        manifest = replace(manifest, shard=store.manifest.shard)
        ledger = store.replay(with_measures=manifest.refine is not None)
        ledger.status[cases_without_files(store, ledger)] = MISSING
        origin = origins(store.manifest, manifest)
        status = np.where(origin < 0, MISSING, ledger.status[origin])
        if manifest.refine is not None and ledger.measures is not None:
            records[origin >= 0] = converted(ledger.measures, kind)[origin[origin >= 0]]
        shares = store.parts.read_shares(manifest)
    refinement = Refinement(manifest, status, records) if manifest.refine is not None else None
    known, status = status != MISSING, status_of(manifest, status, records)
    is_in_part = np.ones(grid.n_case, bool)
    if chosen is not None:
        if shares is None or shares.count != chosen.total:
            shares = Shares(chosen.total, share_out(grid, chosen.total))
        is_in_part = shares.cases(chosen.number, manifest)
    missing = (is_in_part & (status == MISSING)).reshape(grid.shape)
    blocks = grid.blocks()
    left = [(block, share) for block in blocks if (share := missing_share(block, missing))]
    steps = sum(block.cost * share for block, share in left)
    steps_of = {block.start: block.cost / math.prod(block.shape) for block in blocks}

    def steps_at(index: tuple[int, ...]) -> float:
        return steps_of[tuple(i - i % n for i, n in zip(index, grid.chunk, strict=True))]

    began_timing = time.process_time()
    end = max(began + _SECONDS, time.monotonic() + _LEAST)
    is_large = len(study.rig.stator) >= _MANY and not study.rig.carrier
    timer = CaseTimer(grid, end - _FOR_HALF * is_large)
    sample = timer.time_cases(missing, steps, steps_at, say) if left else timer.sample
    share, n_expected, off = 1.0, None, 1.0
    if refinement is not None:
        asked = refinement.asked()
        n_expected = asked.n_expected
        n_left = max(n_expected - int((asked.cases.ravel() & known).sum()), 0)
        share = min(n_left / max(int((~known).sum()), 1), 1.0)
        off = _OFF if asked.edges is None else 1.0
    bound, mostly, memory = Estimate(0.0, 0.0, 0.0), "", 0.0
    if left:
        n_missing = int(missing.sum())
        writing = _FILE * len(left) * len(manifest.variables) + _BYTE * n_missing * _bytes_of_case(manifest)
        n_set_up = count_set_ups(grid, missing)
        once = writing + n_set_up * sample.set_up
        bound = Estimate(*(seconds + once for seconds in sample.estimate(n_missing, steps)))
        parts = {
            f"set-ups of {round(n_set_up)} rigs and speeds": n_set_up * sample.set_up,
            "writing blocks; a larger [run] block or fewer [record] keep takes less": writing,
            **_transient(study, bound.seconds - once),
        }
        mostly = _mostly(parts, bound.seconds)
        if is_large and bound.seconds > _LONG and math.isfinite(half := timer.time_half(_FOR_HALF)):
            advice = f"with half of the {len(study.rig.stator)} stators a case took {half:.2g} of the time"
            mostly = "; ".join(filter(None, (mostly, advice)))
        if sample.batches:
            memory = _memory(study, sample, n_missing) + math.prod(grid.chunk) * _bytes_of_case(manifest)
            memory += _LEDGERS * grid.n_case * kind.itemsize
    return Plan(
        grid=grid,
        manifest=manifest,
        counts=count(status[is_in_part]),
        steps=round(share * steps),
        time=Estimate(share * bound.seconds, share * bound.least / off, share * bound.most * off),
        bound=bound,
        sample=sample,
        spent=time.process_time() - began_timing - sample.loading,
        mostly=mostly,
        memory=memory,
        part="" if chosen is None else str(chosen),
        n_expected=n_expected,
    )


def _transient(study: Study, seconds: float) -> dict[str, float]:
    """Time of the transient, by its name, where it is known, of the time of cases."""
    recording, n = study.recording, study.recording.transient
    if not isinstance(n, int) or study.changes_speed or study.branch is not None:
        return {}
    return {f"the transient, {n} revolutions": seconds * n / (n + recording.revolutions)}


def _mostly(parts: dict[str, float], whole: float) -> str:
    """Name the part that takes most of the whole time, and what would help; "" where nothing stands out."""
    text, seconds = max(parts.items(), key=lambda item: item[1])
    name, _, helps = text.partition("; ")
    share = f"{name} ({_percent(seconds / whole)} of the time)"
    return share + f"; {helps}" * bool(helps) if seconds > _MAIN * whole else ""


def _memory(study: Study, sample: Sample, n_missing: int) -> float:
    """Bytes that a process holds at most, but for its block and the measures of all cases.

    In a ring those are contact modes: of the longest case, and of set-ups and frictions that are kept beside
    them, which those of run-ups include.
    """
    modes, beside = [batch.n_byte for batch in sample.batches], 0.0
    if len(study.rig.stator) > 1 and not study.changes_speed:
        n_friction = max(len(axis.values) for axis in study.axes if axis.name == "friction")
        n_kept = min(MOST_SETUPS * n_friction, n_missing) - 1
        beside = min(MOST_BYTES, n_kept * float(np.mean(modes)))
    return max(memory("VmHWM:"), sample.memory + max(modes) + beside)


def _bytes_of_case(manifest: Manifest) -> int:
    """Bytes of the arrays of a case, before compression."""
    return sum(math.prod(manifest.extent(v)) * np.dtype(v.dtype).itemsize for v in manifest.variables)


def _percent(share: float) -> str:
    """A share of a case in percent: 0.3 %, 12 %."""
    return f"{100.0 * share:.2g} %"


def _size(n_byte: float) -> str:
    for unit in ("B", "kB", "MB", "GB"):
        if n_byte < 1000:
            return f"{n_byte:.3g} {unit}"
        n_byte /= 1000
    return f"{n_byte:.3g} TB"
