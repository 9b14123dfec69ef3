"""An identification as its two files state it: what was measured, and what is known of the machine."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import xarray as xr

from postproc.measured.measured import measured
from rubhpc.errors import InputError
from rubhpc.fem.assemble import assemble
from rubhpc.fem.modes import modes
from rubhpc.identification.candidates import Machine, Misalignment, NoRub, Rub
from rubhpc.identification.channels import channels_of
from rubhpc.identification.comparison import Comparison, period_of_lines
from rubhpc.identification.lines import LineComparison
from rubhpc.identification.powers import PowerComparison
from rubhpc.identification.priors import is_prior, read_prior
from rubhpc.identification.slack import slack_bearings
from rubhpc.input.messages import place
from rubhpc.input.reading import read_toml
from rubhpc.study.axes import SPEED_AXES
from rubhpc.study.axis_reading import flatten
from rubhpc.study.identity import PHYSICS
from rubhpc.study.study import rig_of, study_of, table_of

if TYPE_CHECKING:
    from os import PathLike

    from rubhpc.identification.candidates import Hypothesis
    from rubhpc.identification.channels import Channels
    from rubhpc.identification.priors import Prior
    from rubhpc.rig.rig import Rig
    from rubhpc.study.study import Study

_LONGEST = 60  # revolutions of a simulated record
_REFUSED = {
    "sample": "priors are sampled anyway",
    "refine": "there is no grid to refine",
    "branch": "cases are simulated one by one",
    "run_up": "the speed has to be constant",
    "drive": "the speed has to be constant",
}


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A measurement, and what may be behind it.

    Attributes
    ----------
    machine : Machine
    comparison : Comparison
    rub : Rub
    others : tuple of Rub and NoRub
        What else may be behind it.
    note : str
        What is wrong with the record, a problem a line.
    """

    machine: Machine
    comparison: Comparison
    rub: Rub
    others: tuple[Hypothesis, ...]
    note: str

    @property
    def channels(self) -> Channels:
        """What was measured."""
        return self.machine.channels

    def content(self, rub: Rub) -> str:
        """Return all that the features of a case depend on, except the values of its open keys."""
        study = rub.machine.study
        names = [prior.name for prior in rub.priors]
        table = {
            "physics": PHYSICS,
            "study": {**study.as_dict(), "title": "", "rig": study.rig.as_dict()},
            "open": names,
            "spin": self.channels.spin,
            "channels": self.channels.simulated,
            "samples": self.channels.n,
            "comparison": [type(self.comparison).__name__, self.comparison.orders.tolist()],
            "measured": [values.tobytes().hex()[:64] for values in self.comparison.measured],
        }
        return json.dumps(table, sort_keys=True, default=str)


class Known(NamedTuple):
    """What a study says of a machine before the measurement."""

    name: str  # of the file
    table: dict[str, Any]  # the file
    rig: Rig
    priors: tuple[Prior, ...]
    at_medians: dict[str, Any]  # [grid] with the medians of the open keys

    @property
    def tables(self) -> dict[str, dict[str, Any]]:
        """Tables of the laws, schemes and starts."""
        return {key: table_of(self.table, key, self.name) for key in ("contact", "integrator", "initial")}


def read_known(study: str | PathLike[str], *, trust_rig: bool = False) -> Known:
    """Return what a study file says of a machine before the measurement."""
    source = Path(study)
    table, name = read_toml(source), str(study)
    for key, reason in _REFUSED.items():
        if key in table:
            raise InputError(f"{place(name, key)}: {reason}; remove [{key}]")
    rig = rig_of(table, source, trust_rig=trust_rig)
    grid = dict(flatten(table_of(table, "grid", name)))
    priors = tuple(read_prior(key, value, rig, name) for key, value in grid.items() if is_prior(value))
    if not priors:
        fix = "write a quantity as { start, stop } or { mean, std }"
        raise InputError(f"{place(name, 'grid')}: nothing is open; {fix}")
    at_medians = grid | {prior.name: prior.as_given(prior.at(0.5)) for prior in priors}
    return Known(name, table, rig, priors, at_medians)


def read_problem(
    file: str | PathLike[str] | xr.Dataset,
    study: str | PathLike[str],
    *,
    slack: bool = False,
    trust_rig: bool = False,
) -> Problem:
    """Return the problem of a measured file and a study file.

    Parameters
    ----------
    file : path or Dataset
        A measured file, or what `rubhpc.measured` returns.
    study : path
        A study whose entries in [grid] are priors. Without a speed it is that of the measurement. The record
        is by default as long as that of the measurement, up to 60 revolutions, after a direct transient.
    slack : bool
        Whether slack bearings are tried too.
    trust_rig : bool
        Whether a rig that is Python code may be run.
    """
    known = read_known(study, trust_rig=trust_rig)
    data = file if isinstance(file, xr.Dataset) else measured(file)
    channels = channels_of(data)
    table, rig = known.table, known.rig
    at_medians = known.at_medians
    if not set(SPEED_AXES) & set(at_medians):
        at_medians = {"speed": channels.spin} | at_medians
    period = period_of_lines(channels)
    comparison = _comparison(channels, period, _natural_orders(rig, channels))
    length = {"transient": "direct", "revolutions": min(channels.revolutions, _LONGEST)}
    record = length | table_of(table, "record", known.name)
    record |= {
        "samples_per_revolution": channels.n,
        "keep": ["waveform"],
        "probe": [dict(probe) for probe in channels.probes],
    }
    machine = Machine(
        study=_of_whole_periods(
            study_of(table | {"grid": at_medians, "record": record}, Path(study), trust_rig=trust_rig),
            period or 1,
        ),
        tables=known.tables,
        channels=channels,
        priors=known.priors,
    )
    slacks = tuple(slack_bearings(machine, comparison)) if slack else ()
    if slack and not slacks:
        raise InputError(
            f"{known.name}: slack: no bearing of the rig has springs to the ground; leave it out"
        )
    return Problem(
        machine=machine,
        comparison=comparison,
        rub=Rub(machine=machine, comparison=comparison),
        others=(
            NoRub(machine=machine, comparison=comparison),
            Misalignment(machine=machine, comparison=comparison),
            *slacks,
        ),
        note="\n".join(filter(None, [data.attrs.get("note", ""), channels.note])),
    )


def _of_whole_periods(study: Study, period: int) -> Study:
    """The study with a record of whole periods, two at least."""
    revolutions = max(study.recording.revolutions // period, 2) * period
    return replace(study, recording=replace(study.recording, revolutions=revolutions))


def _comparison(channels: Channels, period: int, natural: list[float]) -> Comparison:
    if period:
        return LineComparison(channels, period, natural)
    return PowerComparison(channels, natural)


def _natural_orders(rig: Rig, channels: Channels) -> list[float]:
    """Orders of the first natural frequencies of what the channels look at, at the measured speed."""
    model = assemble(rig)
    found = modes(model.rotor, channels.spin)
    wanted = [
        next((m for m in found if m.kind == kind and m.frequency > 0), None) for kind in _kinds(channels)
    ]
    if any(name.startswith("stator") for name in channels.simulated) or any(
        "stator" in probe for probe in channels.probes
    ):
        bodies = {id(stator.body): stator.held.body for stator in model.stators}
        wanted += [next((m for m in modes(body) if m.frequency > 0), None) for body in bodies.values()]
    rate = channels.spin / (2.0 * math.pi)
    return sorted({mode.frequency / rate for mode in wanted if mode is not None})


def _kinds(channels: Channels) -> list[str]:
    """Kinds of modes of the rotor that channels see."""
    twists = any(unit.startswith("rad") for unit in channels.units)
    return ["lateral", "torsional"] if twists else ["lateral"]
