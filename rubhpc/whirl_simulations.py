"""Predicted dry whirl against simulations: from both sides of each orbit, and by knocks on the machine."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.fem.assemble import assemble
from rubhpc.integrate.case import run_case
from rubhpc.integrate.record import State
from rubhpc.integrate.setup import prepare
from rubhpc.knock_cases import impulse_scale, knocked
from rubhpc.knock_search import Direction, find_least
from rubhpc.rig.normal_law import NormalLaw
from rubhpc.schema import DONE, RUB_KIND, described
from rubhpc.study.contact_keys import Contact
from rubhpc.study.tables import Integrator, Recording
from rubhpc.threads import on_one_thread

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import Any

    import xarray as xr
    from numpy.typing import NDArray

    from rubhpc.fem.model import Body, Model
    from rubhpc.integrate.record import Record
    from rubhpc.integrate.setup import Setup
    from rubhpc.rig.rig import Rig
    from rubhpc.study.initial import Initial

    Floats = NDArray[np.float64]

SIDES = {"slower": 0.98, "faster": 1.02}  # speed of the start over that of the whirl
_LEFT = 1.0  # m, that is added to the clearance of stators which stay open
_HELD = 0.01  # relative difference of frequency and peak force within which a motion is the predicted one
_FEWEST, _MOST = 20.0, 400.0  # periods of the whirl that are passed
_DECAYS = 8.0  # times the reciprocal growth rate that are passed, within these limits
_KNOCKED = 60.0  # periods of the slowest whirl after a knock
_FEWEST_TURNS = 120  # revolutions after a knock
_RECORDED = 4.0  # periods of the whirl that are recorded
_SAMPLES = 128  # per revolution
_LOW, _HIGH = 0.02, 10.0  # first and last impulse, over its scale
_TOLERANCE = 0.02  # relative width of the interval of the least impulse


@on_one_thread
def certify_whirl(
    rig: Rig,
    found: xr.Dataset,
    *,
    law: NormalLaw | None = None,
    angles: int = 4,
    report: Callable[[int, int], None] = lambda done, n_all: None,
) -> xr.Dataset:
    """Return predicted dry whirl with what simulations say of it.

    Parameters
    ----------
    rig : Rig
    found : xarray.Dataset
        From `rubhpc.dry_whirl` of this rig, at one friction at least.
    law : NormalLaw, optional
        As there.
    angles : int
        Directions of the knocks, evenly spread.
    report : callable
        Called with the number of finished simulations and searches, and of all.

    Returns
    -------
    xarray.Dataset
        `found`, and over (whirl, side), side "slower" or "faster": `whirl_reached_kind`, an entry of
        `rubhpc.schema.RUB_KIND` or "failed", and `whirl_reached_frequency` (rad/s, NaN without contact), of
        simulations without unbalance, loads and other contacts that start on the predicted orbit with 0.98
        and 1.02 of its velocity. `whirl_is_confirmed`: both ends are the predicted motion where it is stable,
        and not both where it is unstable.

        Over knock, of each bore, speed, clearance and friction with whirl: `knock_stator`, `knock_speed`,
        `knock_clearance`, `knock_friction`, and `knock_impulse`, N s: the least knock at the bore's node that
        takes the whole machine, with its unbalance and loads, from its contact-free motion to lasting contact
        that whirls in the predicted sense; 0 where it gets there without, NaN where no knock tried does.
        `knock_harmless`, N s: the largest below it that did not.
    """
    contact = _contact(law or NormalLaw())
    whirls = [_row(found, k) for k in range(found.sizes["whirl"])]
    groups: dict[tuple[float, ...], list[dict[str, Any]]] = {}
    for whirl in whirls:
        groups.setdefault(tuple(whirl[of] for of in _OF), []).append(whirl)
    n_all, n_done = len(whirls) + len(groups), 0
    report(0, n_all)
    kinds = np.full((len(whirls), len(SIDES)), "failed", dtype="U17")
    reached, is_held = np.full(kinds.shape, np.nan), np.zeros(kinds.shape, dtype=bool)
    for k, whirl in enumerate(whirls):
        setup = _prepare(_alone(rig, int(whirl["stator"]) - 1), whirl["speed"], contact)
        for j, factor in enumerate(SIDES.values()):
            record = _from_side(setup, whirl, factor)
            kinds[k, j], reached[k, j], is_held[k, j] = _outcome(record, whirl)
        report(n_done := n_done + 1, n_all)
    over, about = ("whirl", "side"), described("rad s-1", "Whirl frequency reached")
    found = found.assign_coords(side=list(SIDES))
    found["whirl_reached_kind"] = over, kinds
    found["whirl_reached_frequency"] = over, reached, about
    is_stable = found["whirl_growth_rate"].values < 0.0
    found["whirl_is_confirmed"] = "whirl", is_held.all(axis=1) == is_stable
    knocks = []
    for at, of in groups.items():
        knocks.append(_least_knock(rig, dict(zip(_OF, at, strict=True)), of, contact, angles))
        report(n_done := n_done + 1, n_all)
    for i, (name, unit) in enumerate(_OF.items()):
        values = np.array([at[i] for at in groups])
        found[f"knock_{name}"] = "knock", values.astype(int) if name == "stator" else values, {"units": unit}
    for i, (name, meaning) in enumerate(_IMPULSES.items()):
        values = np.array([knock[i] for knock in knocks])
        found[f"knock_{name}"] = "knock", values, described("N s", meaning)
    return found


_OF = {"stator": "1", "speed": "rad s-1", "clearance": "m", "friction": "1"}  # what a search of knocks is of
_IMPULSES = {"impulse": "Least impulse that leads to whirl", "harmless": "Largest below it that did not"}


def _row(found: xr.Dataset, k: int) -> dict[str, Any]:
    """One whirl of a dataset."""
    names = (*_OF, "frequency", "kind", "growth_rate", "normal_force", "friction_force")
    return {name: found[f"whirl_{name}"].values[k].item() for name in names}


def _contact(law: NormalLaw) -> Contact:
    return Contact(
        law=law.kind,
        stiffness=law.stiffness,
        damping=law.damping,
        restitution=law.restitution,
        normal="updated",
        friction_law="coulomb",
    )


def _alone(rig: Rig, i: int) -> Rig:
    """Return a rig of which one stator alone can touch, without unbalance and loads."""
    stators = tuple(
        stator if j == i else replace(stator, clearance_offset=stator.clearance_offset + _LEFT)
        for j, stator in enumerate(rig.stator)
    )
    return replace(
        rig, stator=stators, rotor=replace(rig.rotor, unbalance=(), load=(), harmonic=(), gravity=0.0)
    )


def _prepare(rig: Rig, spin: float, contact: Contact) -> Setup:
    return prepare(
        rig,
        spin,
        contact=contact,
        integrator=Integrator(),
        samples_per_revolution=_SAMPLES,
        model=assemble(rig),
    )


def _from_side(setup: Setup, whirl: dict[str, Any], factor: float) -> Record:
    """Simulate a whirl from its orbit with its velocity times a factor."""
    state = start_on(setup.model, whirl)
    state = replace(
        state,
        rotor_velocity=factor * state.rotor_velocity,
        stator_velocity=tuple(factor * velocity for velocity in state.stator_velocity),
    )
    size, growth = abs(whirl["frequency"]), abs(whirl["growth_rate"])
    turns = setup.spin / size  # revolutions in a period
    periods = np.clip(_DECAYS * size / (2.0 * math.pi * max(growth, 1e-9 * size)), _FEWEST, _MOST)
    return _run(setup, whirl, state, math.ceil(periods * abs(turns)), _RECORDED * abs(turns))


def _run(
    setup: Setup, at: dict[str, Any], initial: State | Initial, transient: int, recorded: float
) -> Record:
    recording = Recording(
        transient=transient,
        revolutions=math.ceil(recorded),
        samples_per_revolution=_SAMPLES,
        keep=(),
    )
    return run_case(
        setup, clearance=at["clearance"], friction=at["friction"], recording=recording, initial=initial
    )


def start_on(model: Model, whirl: dict[str, Any]) -> State:
    """Return the state of a steady whirl, by the response of all degrees of freedom to its contact forces.

    Parameters
    ----------
    model : Model
        At the speed of the whirl.
    whirl : dict
        `stator`, from 1; `speed` and `frequency`, rad/s; `normal_force` and `friction_force`, N; `clearance`,
        m.
    """
    i = int(whirl["stator"]) - 1
    stator, spin = model.stators[i], whirl["speed"]
    sense = math.copysign(1.0, spin)
    w, T = sense * whirl["frequency"], sense * whirl["friction_force"]
    push, torque = whirl["normal_force"] + 1j * T, stator.radius * T
    turning = np.zeros(model.body_start[-1], dtype=complex)
    twist = np.zeros(len(turning))
    rim = [model.rotor.index(stator.node, name) for name in ("v", "w", "thx")]
    hole = [stator.axial, stator.lateral, stator.torsion]
    for body, first, rows, sign in (
        (model.rotor, 0, rim, -1.0),
        (stator.body, model.stator_start[i], hole, 1.0),
    ):
        part = slice(first, first + body.n_dof)
        damping = body.damping + spin * body.gyroscopic * (body is model.rotor)
        dynamic = body.stiffness + 1j * w * damping - w**2 * body.mass
        turning[part] = _response(dynamic, body, rows[:2], [sign * push, -1j * sign * push])
        twist[part] = _response(body.stiffness, body, rows[2:], [sign * torque]).real
    at = turning.real + twist
    at[: model.rotor.n_dof] += model.sag

    def place(first: int, rows: Sequence[int]) -> complex:
        """Where a centre is: up + i horizontally."""
        parts = (at[first + row] * unit for row, unit in zip(rows, (1.0, 1j), strict=True) if row >= 0)
        return complex(sum(parts))

    force, overlap = np.zeros((2, len(model.stators)))
    force[i] = whirl["normal_force"]
    apart = place(0, rim[:2]) - place(model.stator_start[i], hole[:2]) - complex(*stator.centre)
    overlap[i] = max(0.0, abs(apart) - whirl["clearance"] - stator.clearance_offset)
    return State.of_bodies(model, at, (1j * w * turning).real, force, overlap)


def _response(
    matrix: NDArray[Any], body: Body, rows: Sequence[int], loads: Sequence[complex]
) -> NDArray[Any]:
    """Response (n_dof,) to loads at rows; nothing of those that are held (-1)."""
    found = np.zeros(body.n_dof, dtype=complex)
    push = np.zeros(body.n_dof, dtype=complex)
    for row, load in zip(rows, loads, strict=True):
        if row >= 0:
            push[row] = load
    part = np.flatnonzero(np.isin(body.part, body.part[np.flatnonzero(push)]))
    found[part] = np.linalg.solve(matrix[np.ix_(part, part)], push[part])
    return found


def _outcome(record: Record, whirl: dict[str, Any]) -> tuple[str, float, bool]:
    """Where a simulation ends: kind of rub and whirl frequency; and whether that is the predicted motion."""
    i = int(whirl["stator"]) - 1
    if record.status != DONE:
        return "failed", math.nan, False
    kind = RUB_KIND[record.measures["rub_kind"][i]]
    frequency, peak = record.measures["whirl_frequency"][i], record.measures["peak_contact_force"][i]
    is_held = (
        (kind == "rolling") == (whirl["kind"] == "rolling")
        and abs(frequency / whirl["frequency"] - 1.0) < _HELD
        and abs(peak / whirl["normal_force"] - 1.0) < _HELD
    )
    return kind, float(frequency), bool(is_held)


def _least_knock(
    rig: Rig, at: dict[str, float], whirls: Sequence[dict[str, Any]], contact: Contact, angles: int
) -> tuple[float, float]:
    """Least impulse at the node of a bore that leads to whirl in it, and the largest below that does not."""
    setup = _prepare(rig, at["speed"], contact)
    i = int(at["stator"]) - 1
    senses = {math.copysign(1.0, whirl["frequency"]) for whirl in whirls}
    turns = abs(setup.spin) / min(abs(whirl["frequency"]) for whirl in whirls)
    transient = max(_FEWEST_TURNS, math.ceil(_KNOCKED * turns))

    def whirls_after(impulse: float, direction: Direction) -> bool:
        """Whether contact lasts and whirls in a predicted sense after a knock."""
        record = _run(setup, at, knocked(impulse, direction), transient, max(8.0, _RECORDED * turns))
        frequency = record.measures["whirl_frequency"][i]
        if record.status != DONE or math.isnan(frequency):
            return False
        return math.copysign(1.0, frequency) in senses

    directions = [Direction(2.0 * math.pi * k / angles, setup.model.stators[i].node) for k in range(angles)]
    if whirls_after(0.0, directions[0]):
        return 0.0, 0.0
    scale = impulse_scale(setup.model, at["clearance"])
    found = find_least(whirls_after, directions, _LOW * scale, _HIGH * scale, _TOLERANCE)
    return found.impulse, found.harmless
