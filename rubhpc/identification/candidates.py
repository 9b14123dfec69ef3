"""What may be behind a measurement: machines with rub, without it, and with misalignment.

Without contact a machine is linear, and its steady motion is that of unbalance and harmonics. Misalignment
adds what couplings at the ends of the shaft do at twice the speed: at each a force that rotates forward, one
that rotates backward and, where torsion is measured, a torque, of any size and phase. Since the machine is
linear these are integrated over in closed form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rubhpc.case_arguments import case_of
from rubhpc.fem.assemble import assemble, model_at
from rubhpc.fem.probes import with_probes
from rubhpc.fem.response import first_lateral_frequency, harmonic_response, response_nodes, steady_lines
from rubhpc.identification.comparison import Unknown, log_likelihood
from rubhpc.integrate.case import run_case
from rubhpc.recent import recent
from rubhpc.rig.reading import with_keys
from rubhpc.schema import DONE, FAILED, PROBE
from rubhpc.study.axes import OWN, SPEED_AXES, axis_table

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.identification.channels import Channels
    from rubhpc.identification.comparison import Comparison, Seen
    from rubhpc.identification.priors import Prior
    from rubhpc.integrate.record import Record
    from rubhpc.study.study import Study

    Floats = NDArray[np.float64]
    Lines = NDArray[np.complex128]

_FORCES = np.geomspace(1e-4, 10.0, 11)  # of misalignment, over the weight of the rotor: equally likely
_GRAVITY = 9.81
_TWICE = 2.0
_TURNS = 60  # revolutions of a linear motion: whole periods of all that is compared


class Outcome(NamedTuple):
    """What one case gives."""

    status: int
    seen: Seen | None
    contact_fraction: Floats  # (n_stator,), 1
    peak_contact_force: Floats  # (n_stator,), N
    friction_power: Floats  # (n_stator,), W

    @property
    def touches(self) -> bool:
        """Whether there is contact."""
        return bool((self.contact_fraction > 0.0).any())


def settings_of(study: Study, priors: Sequence[Prior], values: Sequence[float]) -> dict[str, float | str]:
    """Return all keys of [grid] of a study of one case, by name, with these values of the open ones."""
    known = {axis.name: (axis.words or axis.values)[0] for axis in study.axes}
    pairs = zip(priors, values, strict=True)
    return known | {prior.name: prior.as_given(float(value)) for prior, value in pairs}


def simulated(
    study: Study,
    tables: Mapping[str, Mapping[str, Any]],
    settings: Mapping[str, float | str],
    samples_per_revolution: int,
) -> Record:
    """Return the record of a case of a study.

    Parameters
    ----------
    study : Study
        Its rig and record.
    tables : mapping
        [contact], [integrator] and [initial] as in the file.
    settings : mapping
        All keys of [grid].
    samples_per_revolution : int
    """
    given: dict[str, Any] = {**tables["contact"], **tables["integrator"]}
    overrides, start = {}, dict(tables["initial"])
    for name, value in settings.items():
        if name in OWN:
            given[name] = value
        elif table := axis_table(name):
            (given if table == "contact" else start)[name.removeprefix(f"{table}.")] = value
        else:
            overrides[name] = value
    case = case_of(
        "identify",
        study.rig,
        {**given, "overrides": overrides},  # type: ignore[typeddict-item]
        samples_per_revolution=samples_per_revolution,
        initial=start or None,
        probes=study.recording.probe,
    )
    return run_case(
        case.setup,
        clearance=case.clearance,
        friction=case.friction,
        recording=study.recording,
        initial=case.initial,
        is_judged=False,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Machine:
    """The machine of a study, with keys that are yet to be set.

    Attributes
    ----------
    study : Study
        Its rig, laws and record; its axes have one value each.
    tables : mapping
        [contact], [integrator] and [initial] as in the file.
    channels : Channels
    priors : tuple of Prior
        Of the keys that are open.
    """

    study: Study
    tables: Mapping[str, Mapping[str, Any]]
    channels: Channels
    priors: tuple[Prior, ...]

    def settings(self, values: Sequence[float]) -> dict[str, float | str]:
        """Return all keys of [grid], by name."""
        return settings_of(self.study, self.priors, values)

    def simulate(self, values: Sequence[float]) -> Record:
        """Return the record of a case with these values of the open keys."""
        return simulated(self.study, self.tables, self.settings(values), self.channels.n)

    def model(self, values: Sequence[float]) -> tuple[Model, float]:
        """Return the model of a case at its spin, with probes, and the spin, rad/s."""
        settings = self.settings(values)
        keys = {name: value for name, value in settings.items() if name.startswith(("rotor.", "stator."))}
        rig = with_keys(self.study.rig, keys)
        model = recent(lambda: assemble(rig), "model", rig)
        speed = next(name for name in settings if name in SPEED_AXES)
        spin = float(settings[speed])
        if speed == "speed_ratio":
            spin *= recent(lambda: first_lateral_frequency(model), "first frequency", rig)
        return with_probes(model_at(model, spin), rig, self.study.recording.probe, spin), spin

    def lines(self, model: Model, spin: float, order: float, amplitude: Lines) -> Lines:
        """Return what the channels see of a motion of the rotor alone at an order, (n_channel,) complex.

        Parameters
        ----------
        amplitude : (n_dof,) complex
            Of the rotor.
        """
        rates = (1j * order * spin) ** np.arange(3)  # of displacement, velocity and acceleration
        rows = {"vertical": "v", "horizontal": "w", "torsion": "thx", "torsion_acceleration": "thx"}
        probes = [] if model.probe is None else [PROBE + probe.name for probe in model.probe.probes]
        found = np.zeros(len(self.channels.names), dtype=np.complex128)
        for i, name in enumerate(self.channels.simulated):
            if name in probes:
                assert model.probe is not None
                found[i] = rates @ model.probe.rows[:, probes.index(name), : amplitude.size] @ amplitude
            elif name in rows and (row := model.rotor.index(model.output_node, rows[name])) >= 0:
                found[i] = amplitude[row] * (rates[2] if name == "torsion_acceleration" else 1.0)
        return found  # stators, which nothing moves, have 0

    def waves(self, model: Model, spin: float, lines: Mapping[int, Lines]) -> Floats:
        """Return what the channels see of lines (n_dof,) of the rotor by order, (n_channel, n_sample)."""
        angle = 2.0 * math.pi * np.arange(_TURNS * self.channels.n) / self.channels.n
        seen = [
            np.real(np.outer(self.lines(model, spin, order, one), np.exp(1j * order * angle)))
            for order, one in lines.items()
        ]
        return np.asarray(np.sum(seen, axis=0))


@dataclass(frozen=True, kw_only=True, eq=False)
class Rub:
    """A case of the study; it need not touch."""

    machine: Machine
    comparison: Comparison
    name: str = "rub"

    @property
    def priors(self) -> tuple[Prior, ...]:
        """Of all open keys."""
        return self.machine.priors

    @cached_property
    def n_stator(self) -> int:
        """How many stators there are."""
        return len(self.machine.study.rig.stator)

    def outcome(self, values: Sequence[float]) -> Outcome:
        """Return what a case with these values gives; an error marks it as failed, as in a study."""
        nothing = [np.full(self.n_stator, math.nan)] * 3
        try:
            record = self.machine.simulate(values)
            return Outcome(record.status, None, *nothing) if record.status != DONE else self._of(record)
        except Exception:
            return Outcome(FAILED, None, *nothing)

    def _of(self, record: Record) -> Outcome:
        measures = record.measures
        fraction, force, work = (
            np.asarray(measures[name], dtype=float)
            for name in ("contact_fraction", "peak_contact_force", "friction_work")
        )
        power = work * record.settings["spin_speed"] / (2.0 * math.pi)
        return Outcome(record.status, self.seen(record), fraction, force, power)

    def seen(self, record: Record) -> Seen:
        """Return the features of a record."""
        return self.comparison.of(self.machine.channels.of_record(record.signals)).in_order()

    def log_likelihood(self, outcome: Outcome) -> float:
        """Return the logarithm of the likelihood; a case that fails is impossible."""
        return -math.inf if outcome.seen is None else log_likelihood(self.comparison, outcome.seen)

    def waves(self, values: Sequence[float]) -> Floats:
        """Return what the channels see, (n_channel, n_sample)."""
        return self.machine.channels.of_record(self.machine.simulate(values).signals)

    def unknown(self, values: Sequence[float]) -> Unknown | None:
        """Return the forces of unknown size that act: none."""
        return None


@dataclass(frozen=True, kw_only=True, eq=False)
class NoRub:
    """The machine without contact, with the open keys of its rotor."""

    machine: Machine
    comparison: Comparison
    name: str = "no rub"

    @cached_property
    def priors(self) -> tuple[Prior, ...]:
        """Of the open keys that matter without contact."""
        return tuple(prior for prior in self.machine.priors if _is_of_rotor(prior.name))

    def log_likelihood(self, values: Sequence[float]) -> float:
        """Return the logarithm of the likelihood."""
        return log_likelihood(self.comparison, self.comparison.of(self.waves(values)), self.unknown(values))

    def unknown(self, values: Sequence[float]) -> Unknown | None:
        """Return the forces of unknown size that act, if any."""
        return None

    def model(self, values: Sequence[float]) -> tuple[Model, float]:
        """Return the model and the spin, rad/s; open keys without effect are at their medians."""
        own = dict(zip([prior.name for prior in self.priors], values, strict=True))
        return self.machine.model([own.get(prior.name, prior.at(0.5)) for prior in self.machine.priors])

    def waves(self, values: Sequence[float]) -> Floats:
        """Return what the channels see, (n_channel, n_sample)."""
        model, spin = self.model(values)
        return self.machine.waves(model, spin, steady_lines(model, spin))


@dataclass(frozen=True, kw_only=True, eq=False)
class Misalignment(NoRub):
    """The same with misaligned couplings at the ends of the shaft, whose forces are unknown."""

    name: str = "misalignment"

    def unknown(self, values: Sequence[float]) -> Unknown | None:
        """Return the forces and the torque, as lines in the channels of one weight of the rotor."""
        model, spin = self.model(values)
        weight = _GRAVITY * model.rotor.total_mass
        turning = {"v": (1.0, 1.0), "w": (-1j, 1j)}  # forward and backward
        bending = sorted({node for node, name in model.rotor.degrees if name == "thy"})  # no pedestals
        nodes = bending or response_nodes(model)
        forces = []
        for node in dict.fromkeys((nodes[0], nodes[-1])):
            of_node = np.zeros((2, model.rotor.n_dof), dtype=np.complex128)
            for name, factors in turning.items():
                if (row := model.rotor.index(node, name)) >= 0:
                    of_node[:, row] = weight * np.array(factors)
            forces += list(of_node)
        twisting = [i for i, (_, name) in enumerate(model.rotor.degrees) if name == "thx"]
        if twisting and any(unit.startswith("rad") for unit in self.machine.channels.units):
            torque = np.zeros(model.rotor.n_dof, dtype=np.complex128)
            torque[twisting[0]] = weight * max(stator.radius for stator in model.stators)
            forces.append(torque)
        moved = [harmonic_response(model, spin, _TWICE, force) for force in forces]
        shapes = np.stack([self.machine.lines(model, spin, _TWICE, one) for one in moved], axis=1)
        return Unknown(_TWICE, shapes, _FORCES)


Hypothesis = Rub | NoRub


def _is_of_rotor(name: str) -> bool:
    return name.startswith("rotor.") or name in SPEED_AXES
