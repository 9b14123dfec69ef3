"""The posterior as ArviZ' InferenceData: a tree of datasets, which netCDF and zarr hold."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from rubhpc.identification.comparison import discrepancy_of
from rubhpc.identification.powers import PowerComparison
from rubhpc.version import __version__

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from rubhpc.identification.candidates import Hypothesis, Outcome
    from rubhpc.identification.comparison import Seen, Unknown
    from rubhpc.identification.nested import Sampled
    from rubhpc.identification.priors import Prior
    from rubhpc.identification.problem import Problem

    Floats = NDArray[np.float64]

_PREDICTED = 25  # draws that are simulated again for spectra and orbits
_SHOWN = 6  # revolutions of a predicted orbit
_CONTACT = {
    "contact_fraction": ("1", "share of the time in contact"),
    "peak_contact_force": ("N", "peak contact force"),
    "friction_power": ("W", "power of friction"),
}


@dataclass(frozen=True, kw_only=True)
class Found:
    """What the sampling has found.

    Attributes
    ----------
    problem : Problem
    rub : Sampled
    others : mapping of hypothesis to Sampled
    outcomes : sequence of Outcome
        Of all points of the rub.
    """

    problem: Problem
    rub: Sampled
    others: Mapping[Hypothesis, Sampled]
    outcomes: Sequence[Outcome]

    @cached_property
    def touching(self) -> tuple[float, float]:
        """Shares of prior and posterior of the study in which there is contact."""
        touches = np.array([outcome.touches for outcome in self.outcomes])
        shares = (np.exp(logs)[touches].sum() for logs in (self.rub.log_volumes, self.rub.log_weights))
        before, after = (float(share) for share in shares)
        return before, after

    @property
    def evidence(self) -> dict[str, tuple[float, float]]:
        """Logarithm of the evidence and its standard error by hypothesis.

        A rub is one that touches; where no case of the study does, it has not been tried and is left out.
        """
        before, after = self.touching
        found = {one.name: (sampled.log_evidence, sampled.error) for one, sampled in self.others.items()}
        if not before:
            return found
        ratio = math.log(max(after, np.finfo(float).tiny)) - math.log(before)
        return {self.problem.rub.name: (self.rub.log_evidence + ratio, self.rub.error), **found}

    def nearest(self, name: str) -> tuple[Seen, Unknown | None]:
        """Return the features of the likeliest case of a hypothesis, and the unknown forces on it."""
        if name == self.problem.rub.name:
            touching = [i for i, outcome in enumerate(self.outcomes) if outcome.touches]
            i = max(touching, key=lambda k: float(self.rub.log_likelihoods[k]))
            seen = self.outcomes[i].seen
            assert seen is not None
            return seen, None
        one, sampled = next(item for item in self.others.items() if item[0].name == name)
        values = sampled.values[int(sampled.log_likelihoods.argmax())].tolist()
        return self.problem.comparison.of(one.waves(values)), one.unknown(values)


def tree_of(found: Found, draws: int, seed: int) -> xr.DataTree:
    """Return the posterior, what it predicts, and the evidence, as InferenceData."""
    problem, rub = found.problem, found.problem.rub
    at = found.rub.draws(draws, seed)
    comparison = problem.comparison
    posterior = _named(rub.priors, found.rub.values[at])
    outcomes = [found.outcomes[i] for i in at.tolist()]
    for i, (name, (unit, text)) in enumerate(_CONTACT.items(), 2):
        values = np.stack([outcome[i] for outcome in outcomes])[None]
        posterior[name] = ("chain", "draw", "stator"), values, {"units": unit, "long_name": text}
    by_point = {i: discrepancy_of(comparison, found.outcomes[i].seen) for i in set(at.tolist())}
    about = {"units": "1", "long_name": "relative error of the model's lines"}
    posterior["discrepancy"] = ("chain", "draw"), np.array([[by_point[i] for i in at.tolist()]]), about
    posterior = posterior.assign_coords(stator=np.arange(1, rub.n_stator + 1))
    random = np.random.default_rng([seed, 1])
    shares = random.random((draws, len(rub.priors)))
    prior = _named(
        rub.priors,
        np.array([[p.at(s) for p, s in zip(rub.priors, row, strict=True)] for row in shares.tolist()]),
    )
    stats = xr.Dataset({"lp": (("chain", "draw"), found.rub.log_likelihoods[at][None])}, _counted(draws))
    names = list(found.evidence)
    evidence = xr.Dataset(
        {
            "log_evidence": ("hypothesis", [found.evidence[name][0] for name in names]),
            "error": ("hypothesis", [found.evidence[name][1] for name in names]),
        },
        coords={"hypothesis": names},
    )
    groups = {
        "posterior": posterior,
        "prior": prior,
        "sample_stats": stats,
        "observed_data": _observed(problem),
        "posterior_predictive": _predicted(found, at),
        "evidence": evidence,
    }
    about = {
        "inference_library": "dynesty",
        "creation_library": "rubhpc",
        "creation_library_version": __version__,
    }
    for group in groups.values():
        group.attrs |= about
    tree = xr.DataTree.from_dict(groups)
    tree.attrs |= {**about, "compared": comparison.about, "spin_speed": problem.channels.spin}
    return tree


def _counted(draws: int) -> dict[str, Any]:
    return {"chain": [0], "draw": np.arange(draws)}


def _named(priors: Sequence[Prior], values: Floats) -> xr.Dataset:
    """Draws (n_draw, n_value) by the names of their axes."""
    about = [{"units": prior.axis.unit, "long_name": prior.axis.long_name} for prior in priors]
    columns = {
        prior.axis.coordinate: (("chain", "draw"), values[None, :, i], about[i])
        for i, prior in enumerate(priors)
    }
    return xr.Dataset(columns, _counted(values.shape[0]))


def _observed(problem: Problem) -> xr.Dataset:
    """The measured spectra at the orders compared with their noise, and some revolutions.

    Of a motion that repeats these are the mean over the record.
    """
    comparison, channels = problem.comparison, problem.channels
    amplitude, noise = comparison.amplitudes(comparison.measured)
    found: dict[str, Any] = {}
    whole = channels.revolutions // _SHOWN
    waves = channels.waves[:, : whole * _SHOWN * channels.n]
    parts = waves.reshape(len(channels.names), whole, -1)
    shown = parts[:, -1] if isinstance(comparison, PowerComparison) else parts.mean(axis=1)
    shown = shown - shown.mean(axis=1, keepdims=True)
    for i, name in enumerate(channels.names):
        about = {"units": channels.units[i], "long_name": channels.long_names[i]}
        found[f"spectrum_{name}"] = "order", amplitude[i], about
        found[f"noise_{name}"] = "order", noise[i], about
        found[name] = "sample", shown[i], about
    if channels.orbit is not None:
        found["orbit"] = ("direction", "sample"), channels.orbit @ shown, {"units": "m"}
    return xr.Dataset(found, {"order": comparison.orders})


def _predicted(found: Found, at: NDArray[np.intp]) -> xr.Dataset:
    """Spectra and revolutions of some draws of the posterior."""
    problem = found.problem
    channels, picked = problem.channels, at[:: max(1, at.size // _PREDICTED)]
    waves, spectra = [], []
    for i in picked.tolist():
        waves.append(problem.rub.waves(found.rub.values[i].tolist()))
        spectra.append(problem.comparison.amplitudes(problem.comparison.of(waves[-1]))[0])
    data: dict[str, Any] = {}
    for i, name in enumerate(channels.names):
        about = {"units": channels.units[i], "long_name": channels.long_names[i]}
        dims = ("chain", "draw")
        data[f"spectrum_{name}"] = (*dims, "order"), np.stack(spectra)[None, :, i], about
        kept = np.stack([wave[i, : _SHOWN * channels.n] for wave in waves])
        data[name] = (*dims, "sample"), kept[None] - kept.mean(axis=1)[None, :, None], about
    if channels.orbit is not None:
        moved = np.stack([channels.orbit @ wave[:, : _SHOWN * channels.n] for wave in waves])
        moved -= moved.mean(axis=2, keepdims=True)
        data["orbit"] = ("chain", "draw", "direction", "sample"), moved[None], {"units": "m"}
    return xr.Dataset(data, _counted(picked.size) | {"order": problem.comparison.orders})
