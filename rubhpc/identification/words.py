"""What an identification has found, in words: what, where, how sure, and what the data leave open."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.units import typed_quantity

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr
    from numpy.typing import NDArray

    from rubhpc.identification.posterior import Found
    from rubhpc.identification.priors import Prior

    Floats = NDArray[np.float64]

_SURE, _LIKELY = math.log(100.0), math.log(3.0)  # odds, after Jeffreys
_BEYOND = math.log(1e6)
_NEVER = 1e-6
_OPEN = 0.8  # of the spread of a prior, from which on a posterior says nothing
_TIED = 0.9  # rank correlation of two quantities that are known together only
_BAD = 4.0  # mean square of residuals over their standard deviation that no model should have
_INTERVAL = (0.025, 0.5, 0.975)
_NONE = "no rub"  # name of the hypothesis
_FAULTS = {_NONE: "no other fault", "misalignment": "misalignment"}  # else a slack bearing
_DRAWS = 1000  # of a hypothesis that is not the rub
_BEFORE = ", if both were equally likely before"


def in_words(found: Found, tree: xr.DataTree) -> Iterator[str]:
    """Yield what is found, line by line."""
    problem = found.problem
    channels = problem.channels
    signals = ", ".join(channels.names)
    yield (
        f"measured: {signals}; {channels.revolutions} revolutions at "
        f"{typed_quantity(channels.spin, 'rad s-1')}; {problem.comparison.about}"
    )
    yield from problem.note.splitlines()
    evidence = found.evidence
    yield "ln(evidence): " + ", ".join(
        f"{name} {value:.1f} +- {error:.1f}" for name, (value, error) in evidence.items()
    )
    best = max(evidence, key=lambda name: evidence[name][0])
    for one, sampled in ((problem.rub, found.rub), *found.others.items()):
        if not sampled.is_whole and sampled.log_likelihoods.max() > evidence[best][0] - _SURE:
            fix = "it may explain more than was found; narrow the priors or raise --live"
            yield f"{one.name}: the sampling was ended after {sampled.n_call} cases; {fix}"
    if problem.rub.name not in evidence:
        yield "no case of [grid] touches, so that a rub has not been tried; lower the clearance"
    yield from _verdict(evidence, problem.rub.name)
    misfit = problem.comparison.misfit(*found.nearest(best))
    if misfit > _BAD:
        yield (
            f"but it does not explain the record: residuals are {math.sqrt(misfit):.2g} times what noise and "
            "discrepancy allow; something else is behind it, or the rig is not this one"
        )
    if best != problem.rub.name:
        before, after = found.touching
        if 0.0 < before < 1.0:
            share = f"{after:.2g}" if after > _NEVER else "almost none"
            yield f"of the cases of [grid] a share of {before:.2g} touches, of those that fit {share}"
        one, sampled = next(item for item in found.others.items() if item[0].name == best)
        values = sampled.values[sampled.draws(_DRAWS, 1)]
        yield from itertools.starmap(_known, zip(one.priors, values.T, strict=True))
        return
    yield from _contacts(found, tree)
    yield from _values(found, tree)


def _verdict(evidence: dict[str, tuple[float, float]], rub: str) -> Iterator[str]:
    """Whether it is a rub, if that has been tried, which of the others it is if not, and how sure that is."""
    others = sorted((name for name in evidence if name != rub), key=lambda name: -evidence[name][0])
    if rub in evidence:
        lead, odds, sure = _odds(evidence, rub, others[0])
        if not odds:
            yield f"the data do not distinguish a rub from {others[0]}"
            return
        if lead > 0.0:
            yield f"it is {sure}a rub: {odds} against {others[0]}{_BEFORE}"
            return
        yield f"it is {sure}not a rub: {odds} against one{_BEFORE}"
    first, *rest = others
    tied = [name for name in rest if not _odds(evidence, first, name)[1]]
    if tied:
        yield f"the data do not distinguish {first} from {' and '.join(tied)}"
    for other in rest[len(tied) : len(tied) + 1]:
        _, odds, sure = _odds(evidence, first, other)
        what = "one of these" if tied else _FAULTS.get(first, f"a {first}")
        yield f"it is {sure}{what}: {odds} against {other}"


def _odds(evidence: dict[str, tuple[float, float]], one: str, other: str) -> tuple[float, str, str]:
    """Lead of one over the other, odds of the better one ("": they say nothing), how sure it is."""
    lead = evidence[one][0] - evidence[other][0]
    size, doubt = abs(lead), math.hypot(evidence[one][1], evidence[other][1])
    if size < max(_LIKELY, doubt):
        return lead, "", ""
    odds = f"odds of {math.exp(size):.2g} to 1" if size < _BEYOND else "odds of more than a million to 1"
    return lead, odds, "" if size > max(_SURE, doubt) else "probably "


def _contacts(found: Found, tree: xr.DataTree) -> Iterator[str]:
    """Where it touches, and how hard."""
    posterior = tree["posterior"].to_dataset()
    for i, stator in enumerate(found.problem.machine.study.rig.stator):
        one = posterior.isel(stator=i, chain=0)
        share = one["contact_fraction"].values
        touches = share > 0.0
        if not touches.any():
            yield f"stator {i + 1}: no contact"
            continue
        force, power = (one[name].values[touches] for name in ("peak_contact_force", "friction_power"))
        yield (
            f"stator {i + 1} at node {stator.node}: touches with a probability of {touches.mean():.2g}, for "
            f"{100 * float(np.median(share[touches])):.2g} % of the time, with a peak force of "
            f"{_interval(force, 'N')} and a friction power of {_interval(np.abs(power), 'W')}"
        )


def _interval(values: Floats, unit: str) -> str:
    low, middle, high = np.quantile(values, _INTERVAL).tolist()
    ends = f"{_short(low, unit)} to {_short(high, unit)}"
    return f"{_short(middle, unit)} (95 %: {ends})"


def _short(value: float, unit: str) -> str:
    """A quantity to four digits."""
    return typed_quantity(float(f"{value:.4g}"), unit)


def _values(found: Found, tree: xr.DataTree) -> Iterator[str]:
    """What is known of each quantity, and which are known together only."""
    posterior = tree["posterior"].to_dataset().isel(chain=0)
    priors = found.problem.rub.priors
    draws = {prior.name: posterior[prior.axis.coordinate].values for prior in priors}
    for prior in priors:
        yield _known(prior, draws[prior.name])
    discrepancy = float(np.median(posterior["discrepancy"].values))
    yield f"relative error of the model's lines, as the data show it: {100 * discrepancy:.2g} %"
    unknown = [prior.name for prior in priors if np.std(draws[prior.name]) > _OPEN * prior.spread]
    if unknown:
        yield f"the data say next to nothing of {', '.join(unknown)}"
    from scipy.stats import spearmanr

    for first, second in itertools.combinations([p.name for p in priors if p.name not in unknown], 2):
        if np.ptp(draws[first]) == 0.0 or np.ptp(draws[second]) == 0.0:
            continue
        tied = float(spearmanr(draws[first], draws[second]).statistic)
        if abs(tied) > _TIED:
            yield f"the data cannot distinguish {first} from {second} (rank correlation {tied:.2f})"


def _known(prior: Prior, draws: Floats) -> str:
    low, high = (_short(prior.at(share), prior.axis.unit) for share in (0.025, 0.975))
    return f"{prior.name} = {_interval(draws, prior.axis.unit)}; {low} to {high} before"
