"""The rub behind a measurement: samples all hypotheses, on one process or several."""

from __future__ import annotations

import math
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rubhpc.errors import RubError, writing
from rubhpc.identification.candidates import Rub
from rubhpc.identification.evaluation import (
    Task,
    current_likelihood,
    current_values,
    evaluator,
    sharing,
    take_part,
)
from rubhpc.identification.nested import MOST, Alone, require_sampler, sample
from rubhpc.identification.posterior import Found, tree_of
from rubhpc.identification.priors import at_shares
from rubhpc.identification.problem import read_problem
from rubhpc.identification.words import in_words
from rubhpc.running.pool import Pool
from rubhpc.running.workers import start_workers
from rubhpc.streams import lasting_streams
from rubhpc.threads import on_one_thread

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from os import PathLike

    import numpy as np
    import xarray as xr
    from numpy.typing import NDArray

    from rubhpc.identification.candidates import Hypothesis, NoRub
    from rubhpc.identification.evaluation import Shared
    from rubhpc.identification.nested import Sampled
    from rubhpc.identification.problem import Problem

    Floats = NDArray[np.float64]

LIVE, DRAWS = 100, 1000
# Of a hypothesis of which the evidence is asked: it has a quarter of the live points.
FEWEST = 30  # of these: bounds around fewer hold few points that are accepted
MOST_OF_OTHERS = 80  # evaluations a live point: one that fits badly has no end of small peaks
FIRST_LOOK = 8  # evaluations a live point of each, before those far from the best are left
NEAR = 50.0  # of ln(evidence): about twice what likelier cases add after the first look
POSTERIOR, CASES = "posterior.nc", "cases"


@dataclass(frozen=True, kw_only=True)
class Identification:
    """What is behind a measurement.

    Attributes
    ----------
    tree : xarray.DataTree
        ArviZ' InferenceData: `posterior`, `prior`, `sample_stats`, `posterior_predictive`, `observed_data`,
        and `evidence` over `hypothesis`.
    lines : tuple of str
        What is found, in words.
    """

    tree: xr.DataTree
    lines: tuple[str, ...]


@lasting_streams()
def identify(
    measured: str | PathLike[str] | xr.Dataset,
    study: str | PathLike[str],
    *,
    output: str | PathLike[str] | None = None,
    live: int = LIVE,
    draws: int = DRAWS,
    seed: int = 1,
    slack: bool = False,
    workers: int = 1,
    trust_rig: bool = False,
    report: Callable[[str], None] = lambda text: None,
) -> Identification:
    """Return what is behind a measured vibration: a rub, none, or misalignment, and the rub's parameters.

    Parameters
    ----------
    measured : path or Dataset
        A measured file, or what `rubhpc.measured` returns, at a constant speed.
    study : path
        A study whose entries in [grid] are priors: `{ start, stop }` is uniform, with `scale = "log"`
        log-uniform, `{ mean, std }` normal; values of a list are equally likely. Without a speed it is that
        of the measurement.
    output : path, optional
        Folder for the posterior and for the cases that have been evaluated, from which an interrupted
        identification goes on.
    live : int
        Live points of nested sampling: the error of the posterior falls with its root.
    draws : int
        Draws of the posterior.
    seed : int
    slack : bool
        Whether slack bearings are tried too, which takes several times as long.
    workers : int
        Processes that share the cases; the result is the same for any number.
    trust_rig : bool
        Whether a rig that is Python code may be run.
    report : callable
        Called with a line on the progress now and then.

    Returns
    -------
    Identification

    Raises
    ------
    InputError
        A file cannot be used, dynesty is missing, or no case of the prior can be computed.
    """
    with nullcontext(Pool()) if workers == 1 else start_workers(workers, take_part) as pool:
        return identify_on(
            pool,
            lambda: read_problem(measured, study, slack=slack, trust_rig=trust_rig),
            output=output,
            live=live,
            draws=draws,
            seed=seed,
            report=report,
        )


@on_one_thread
def identify_on(
    pool: Pool,
    read: Callable[[], Problem],
    *,
    output: str | PathLike[str] | None,
    live: int,
    draws: int,
    seed: int,
    report: Callable[[str], None],
) -> Identification:
    """Return on the first rank what `identify` returns; the others take part (`evaluation.take_part`)."""
    with sharing(pool) as shared:
        problem = read()
        require_sampler()
        return _identify(shared, problem, None if output is None else Path(output), live, draws, seed, report)


def _identify(
    shared: Shared,
    problem: Problem,
    folder: Path | None,
    live: int,
    draws: int,
    seed: int,
    report: Callable[[str], None],
) -> Identification:
    if folder is not None:
        with writing(folder, "--output"):
            (folder / CASES).mkdir(parents=True, exist_ok=True)

    def simulate(rub: Rub, live: int, most: int) -> Sampled:
        def say(n_call: int, log_evidence: float, left: float) -> None:
            report(f"{rub.name}: {n_call} cases, ln(evidence) {log_evidence:.1f}, {left:.3g} to come")

        # Kernels are compiled once, and what is wrong with the study is reported, before all processes begin.
        rub.machine.simulate([prior.at(0.5) for prior in rub.priors])
        shared.use(Task(rub=rub, folder=folder and folder / CASES, content=problem.content(rub)))
        return sample(
            current_likelihood,
            current_values,
            len(rub.priors),
            mapper=shared,
            live=live,
            seed=seed,
            most=most,
            say=say,
        )

    sampled = simulate(problem.rub, live, MOST)
    evaluator().evaluated.read()  # those of other ranks
    outcomes = [evaluator().outcome(values) for values in sampled.values]
    others: dict[Hypothesis, Sampled] = {
        one: _sample_alone(one, live, seed) for one in problem.others if not isinstance(one, Rub)
    }
    few = max(live // 4, FEWEST)
    others |= of_contenders(
        lambda rub, most: simulate(rub, few, most),
        [one for one in problem.others if isinstance(one, Rub)],
        max(one.log_evidence for one in (sampled, *others.values())),
    )
    found = Found(problem=problem, rub=sampled, others=others, outcomes=outcomes)
    tree = tree_of(found, draws, seed)
    if folder is not None:
        path = folder / POSTERIOR
        with writing(path, "--output"):
            path.unlink(missing_ok=True)
            tree.to_netcdf(path, engine="h5netcdf")
    return Identification(tree=tree, lines=tuple(in_words(found, tree)))


def of_contenders(
    look: Callable[[Rub, int], Sampled], hypotheses: Sequence[Rub], best: float
) -> dict[Hypothesis, Sampled]:
    """Sample hypotheses, those that fit far worse than the best for a first look only.

    The likeliest case of a hypothesis bounds its evidence.

    Parameters
    ----------
    look : callable
        Samples a hypothesis with so many evaluations a live point; cases that are known are not repeated.
    hypotheses : sequence of Rub
    best : float
        Logarithm of the best evidence of what has been sampled before.
    """
    found: dict[Hypothesis, Sampled] = {one: look(one, FIRST_LOOK) for one in hypotheses}

    def likeliest(one: Rub) -> float:
        return float(found[one].log_likelihoods.max())

    for one in sorted(hypotheses, key=likeliest, reverse=True):
        best = max(best, *(sampled.log_evidence for sampled in found.values()))
        if likeliest(one) > best - NEAR and not found[one].is_whole:
            found[one] = look(one, MOST_OF_OTHERS)
    return found


def _sample_alone(other: NoRub, live: int, seed: int) -> Sampled:
    """Sample a hypothesis that costs next to nothing."""

    def likelihood(values: Floats) -> float:
        try:
            return other.log_likelihood(values.tolist())
        except RubError:  # this machine cannot be
            return -math.inf

    def values_at(shares: Floats) -> Floats:
        return at_shares(other.priors, shares)

    return sample(likelihood, values_at, len(other.priors), mapper=Alone(), live=live, seed=seed)
