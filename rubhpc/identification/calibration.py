"""Simulation-based calibration: whether truths lie in posteriors as often as these say.

S. Talts and others, arXiv:1804.06788, 2018. Truths are drawn from the priors, records simulated from them by
another scheme, sensed with noise, read like any file, and identified. The rank of the truth among the draws
of its posterior is then uniform, and intervals hold it as often as they claim. The posteriors share their
cases where these can be interpolated (`Interpolated`).
"""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from postproc.measured.measured import measured
from postproc.signals.sensors import Sensor, sense
from rubhpc.errors import InputError, writing
from rubhpc.identification.candidates import settings_of, simulated
from rubhpc.identification.comparison import log_likelihood
from rubhpc.identification.evaluation import sharing
from rubhpc.identification.interpolated import Interpolated
from rubhpc.identification.lines import LineComparison
from rubhpc.identification.nested import Alone, require_sampler, sample
from rubhpc.identification.priors import at_shares
from rubhpc.identification.problem import read_known, read_problem
from rubhpc.recent import recent
from rubhpc.schema import DONE
from rubhpc.study.axes import SPEED_AXES
from rubhpc.study.identity import PHYSICS
from rubhpc.study.study import study_of, table_of
from rubhpc.threads import on_one_thread

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    import xarray as xr
    from numpy.typing import NDArray

    from rubhpc.identification.problem import Known, Problem
    from rubhpc.running.pool import Pool

    Floats = NDArray[np.float64]

_RANKS = 99  # draws of a posterior, among which the truth has a rank
COVERED = (0.5, 0.9, 0.95)
_RATE = 200.37  # samples a revolution of the data logger
_SAMPLES = 1024  # a revolution, of the simulated truth
_TRIES = 100  # draws of a truth that can be computed


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One posterior of a truth that is known.

    Attributes
    ----------
    study : str
        Path of the study.
    noise : float
        Standard deviation of white noise over that of each signal.
    draw : int
    signals : tuple of str
        What is measured.
    method : str
        [integrator] method of the truth.
    transient, revolutions : int
        Of the truth.
    live, seed : int
    output : str or None
        Folder of results that are kept.
    trust_rig : bool
    """

    study: str
    noise: float
    draw: int
    signals: tuple[str, ...]
    method: str
    transient: int
    revolutions: int
    live: int
    seed: int
    output: str | None
    trust_rig: bool


class Ranked(NamedTuple):
    """Where the truth lies in its posterior."""

    truth: list[float]  # (n_value,)
    ranks: list[int]  # (n_value,), how many of 99 draws are below it
    errors: list[float]  # (n_value,), of the posterior's mean, over the width of the prior
    n_look: int  # likelihoods that were evaluated


@on_one_thread
def calibrate_on(
    pool: Pool,
    trials: Sequence[Trial],
    *,
    report: Callable[[str], None],
) -> list[Ranked]:
    """Return where the truths of trials lie; the other processes of the pool take part."""
    with sharing(pool) as shared:
        require_sampler()
        found: list[Ranked] = []
        by_draw = [list(some) for _, some in groupby(trials, lambda trial: trial.draw)]
        for at in range(0, len(by_draw), pool.size):
            report(f"{len(found)} of {len(trials)} posteriors")
            for some in shared.map(ranks_of, by_draw[at : at + pool.size]):
                found += some
        return found


def ranks_of(trials: Sequence[Trial]) -> list[Ranked]:
    """Return where the truths of some trials lie."""
    return [rank_of(trial) for trial in trials]


def rank_of(trial: Trial) -> Ranked:
    """Return where the truth of a trial lies in its posterior, known or computed."""
    known = read_known(trial.study, trust_rig=trial.trust_rig)
    path = None if trial.output is None else Path(trial.output) / f"{_name(trial, known)}.json"
    if path is not None and path.is_file():
        return Ranked(**json.loads(path.read_text()))
    found = _ranked(trial, known)
    if path is not None:
        with writing(path, "--output"):
            path.parent.mkdir(parents=True, exist_ok=True)
            part = path.with_suffix(".part")
            part.write_text(json.dumps(found._asdict()))
            part.replace(path)
    return found


def _name(trial: Trial, known: Known) -> str:
    """Name of the file of a trial, by all that its result depends on."""
    content = [
        asdict(trial) | {"study": "", "output": ""},
        known.table,
        known.rig.as_dict(),
        PHYSICS,
    ]
    key = hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()[:16]
    return f"noise-{trial.noise:g}-{trial.draw}-{key}"


def _ranked(trial: Trial, known: Known) -> Ranked:
    """Draw a truth, measure it, and identify it."""
    truth, seen = _measured(trial, known)
    problem = read_problem(seen, trial.study, trust_rig=trial.trust_rig)
    sampled = sample(
        _likelihood(problem, known),
        lambda shares: shares,
        len(known.priors),
        mapper=Alone(),
        live=trial.live,
        seed=trial.draw,
    )
    values = np.array([at_shares(known.priors, shares) for shares in sampled.values])
    draws = values[sampled.draws(_RANKS, trial.draw)]
    widths = np.array([prior.spread for prior in known.priors])
    errors = (np.exp(sampled.log_weights) @ values - truth) / widths
    return Ranked(truth.tolist(), (draws < truth).sum(axis=0).tolist(), errors.tolist(), sampled.n_call)


def _likelihood(problem: Problem, known: Known) -> Callable[[Floats], float]:
    """Logarithm of the likelihood over the unit cube; cases are interpolated where that is as good."""
    comparison = problem.comparison
    if isinstance(comparison, LineComparison):
        of = known.table, problem.channels.n, comparison.orders, problem.machine.study.recording
        features = recent(lambda: Interpolated(problem.rub), "features", known.rig, *of)
        if features.serves(comparison.measured):
            return lambda shares: log_likelihood(comparison, features(shares))

    rub = problem.rub
    return lambda shares: rub.log_likelihood(rub.outcome(at_shares(known.priors, shares).tolist()))


@lru_cache(maxsize=1)
def _truth(trial: Trial) -> tuple[Floats, xr.Dataset]:
    """A truth that can be computed, and its signals; the noise of the trial does not matter."""
    known = read_known(trial.study, trust_rig=trial.trust_rig)
    if not set(SPEED_AXES) & set(known.at_medians):
        raise InputError(f"{trial.study}: [grid]: a calibration needs a speed; add speed or speed_ratio")
    record = {
        **table_of(known.table, "record", known.name),
        "transient": trial.transient,
        "revolutions": trial.revolutions,
        "keep": ["waveform"],
    }
    table = known.table | {"grid": known.at_medians, "record": record}
    study = study_of(table, Path(trial.study), trust_rig=trial.trust_rig)
    integrator = known.tables["integrator"] | {"method": trial.method}
    rng = np.random.default_rng([trial.seed, trial.draw])
    for _ in range(_TRIES):
        truth = at_shares(known.priors, rng.random(len(known.priors)))
        settings = settings_of(study, known.priors, truth.tolist())
        found = simulated(study, known.tables | {"integrator": integrator}, settings, _SAMPLES)
        if found.status == DONE:
            return truth, found.to_dataset()
    raise InputError(f"{trial.study}: no case of the prior can be computed; narrow the priors")


def _measured(trial: Trial, known: Known) -> tuple[Floats, xr.Dataset]:
    """A truth, and its record as a file of a data logger gives it."""
    truth, signals = _truth(replace(trial, noise=0.0))
    sensors = {name: Sensor(white=trial.noise * float(signals[name].std() or 1.0)) for name in trial.signals}
    rate = _RATE * float(signals["spin_speed"]) / (2.0 * math.pi)
    seed = int(np.random.default_rng([trial.seed, trial.draw, 1]).integers(2**31))
    sensed = sense(signals, sensors, rate=rate, seed=seed)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "record.csv"
        names = ["time", *trial.signals, "key_phasor"]
        columns = np.column_stack([sensed[name].values for name in names])
        np.savetxt(path, columns, delimiter=",", header=",".join(names), comments="")
        return truth, measured(
            path,
            time={"column": "time"},
            speed={"column": "key_phasor", "level": 2.5, "angle": 0.0},
            signals={name: {"unit": str(signals[name].attrs["units"])} for name in trial.signals},
        )


def in_table(trials: Sequence[Trial], found: Sequence[Ranked]) -> Iterator[str]:
    """Yield a Markdown table: coverage of intervals, and whether ranks are uniform, by noise and quantity."""
    from scipy.stats import kstest

    priors = read_known(trials[0].study, trust_rig=trials[0].trust_rig).priors
    heads = ["noise", "posteriors", "quantity", *(f"in {100 * share:g} %" for share in COVERED)]
    heads += ["uniform ranks, p", "error", "likelihoods each"]
    yield f"| {' | '.join(heads)} |"
    yield "|" + " --- |" * len(heads)
    for noise in dict.fromkeys(trial.noise for trial in trials):
        some = [one for trial, one in zip(trials, found, strict=True) if trial.noise == noise]
        n_look = float(np.mean([one.n_look for one in some]))
        for i, prior in enumerate(priors):
            shares = np.array([(one.ranks[i] + 0.5) / (_RANKS + 1) for one in some])
            inside = [float(np.mean(np.abs(shares - 0.5) <= 0.5 * share)) for share in COVERED]
            error = float(np.sqrt(np.mean([one.errors[i] ** 2 for one in some])))
            cells = [f"{noise:g}", str(len(some)), prior.name, *(f"{100 * one:.0f} %" for one in inside)]
            cells += [f"{kstest(shares, 'uniform').pvalue:.2g}", f"{error:.2g}", f"{n_look:.0f}"]
            yield f"| {' | '.join(cells)} |"
