"""The face of a run-up or coast-down: arguments with units in, a labelled dataset out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.case_arguments import CaseArguments, case_of, read_probes, recording_of
from rubhpc.errors import InputError, located
from rubhpc.fem.assemble import assemble
from rubhpc.fem.free_spin import release
from rubhpc.input.quantity import parse_quantity
from rubhpc.input.reading import build, plain
from rubhpc.integrate.changing_speed.case import by_revolution
from rubhpc.integrate.changing_speed.driven import DrivenRun, integrate_driven
from rubhpc.integrate.changing_speed.run_up import integrate_run_up
from rubhpc.integrate.measuring.samples import by_name
from rubhpc.integrate.modal_setup import ModalSetup
from rubhpc.rig.reading import read_rig, with_keys
from rubhpc.rig.rig import Rig
from rubhpc.schema import (
    AMPLITUDE,
    ORDERS,
    PHASE,
    RECORD_END,
    TURNED,
    VARIABLES,
    bore_variables,
    described,
    drive_variables,
    probe_variables,
    run_up_variables,
)
from rubhpc.study.drive_keys import DriveKeys
from rubhpc.study.drive_law import DriveLaw
from rubhpc.study.initial import CONTACT_FREE
from rubhpc.study.run_up_keys import check_forces
from rubhpc.study.speed_law import SpeedLaw
from rubhpc.threads import on_one_thread

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from os import PathLike
    from typing import Any, Unpack

    import xarray as xr

    from rubhpc.integrate.record import State
    from rubhpc.rig.probes import Probe


@on_one_thread
def run_up(
    rig: Rig | str | PathLike[str],
    *,
    start: float | str | None = None,
    stop: float | str | None = None,
    time: float | str | None = None,
    speed_law: Sequence[tuple[float | str, float | str]] | None = None,
    drive: Mapping[str, object] | None = None,
    pieces_per_revolution: int | None = None,
    initial: State | Mapping[str, float | str] | None = None,
    samples_per_revolution: int = 256,
    probes: Sequence[Probe | Mapping[str, object]] = (),
    **case: Unpack[CaseArguments],
) -> xr.Dataset:
    """Simulate a rotor that runs up or coasts down, and record every revolution.

    Parameters
    ----------
    rig : Rig, str or path
        A rig, the name of a packaged one ("mokhtar2017"), or the path of a rig file.
    start, stop : float (rad/s) or str with a unit
        Spin speeds; stop below start is a coast-down.
    time : float (s) or str with a unit
        From start to stop, at constant angular acceleration.
    speed_law : sequence of (time, speed), optional
        In place of these three: speeds at some times, linear between them.
    drive : dict, optional
        In place of all of them, the keys of the table [drive] of a study: what turns a rotor whose speed is
        free, as `{"torque": "2 N m", "start": "1200 rpm", "revolutions": 200}`. The result then has
        `drive_work` (J) and `braking_torque` (N m) of each revolution, and the attributes `record_end` (why
        it ends; "ended_early" where it cannot go on, for the `reason`), `last_speed` (rad/s) and
        `energy_residual`.
    pieces_per_revolution : int, optional
        Pieces of constant speed into which every revolution is cut; the error of the changing speed falls
        with the square of their number. By default as few as the acceleration allows: the shaft departs from
        its angle by 0.003 rad, and a piece may hold several revolutions.
    initial : State or dict, optional
        Where to start; by default in the contact-free motion at the first speed.
    samples_per_revolution : int
        Samples in each, locked to the shaft.
    probes : sequence of Probe or dict
        Additional sensors, as in `simulate`.
    **case
        Clearance, friction, laws and accuracy as of `simulate`; `clearance` is needed.

    Returns
    -------
    xarray.Dataset
        Signals as of `simulate` over `sample`; over `revolution` `speed` (rad/s), `time` (s),
        `contact_fraction`, `peak_contact_force` and `friction_work`; over `stator` the `minimum_slip_speed`
        (m/s), below 0 where steady sliding does not hold; and over `revolution` and `order` the amplitude
        (zero to peak) and phase of the displacements of the disc, its torsion and the probes, over six
        revolutions: `amplitude_vertical`, `phase_vertical` (rad, by which the signal leads the order of the
        shaft's angle), and so on. `clearance` and `friction` are coordinates. A case that ends early says why
        in the attribute `reason`; what is wrong with its result is in `note`.

    Raises
    ------
    InputError
        If an argument cannot be used; its text says which one and how to fix it.

    Examples
    --------
    >>> passage = run_up("mokhtar2017", start="1200 rpm", stop="2400 rpm", time="1 s", clearance="5 mm")
    >>> round(float(passage.speed[passage.amplitude_vertical.sel(order=1).argmax()]) * 9.5493)
    2037
    """
    import xarray as xr

    given = start, stop, time, speed_law
    if drive is not None and any(value is not None for value in given):
        raise InputError("run_up: drive: takes the place of start, stop, time and speed_law; leave them out")
    law: SpeedLaw | DriveLaw
    if drive is None:
        law = _read_law(*given)
    else:
        keys = build(DriveKeys, drive, "run_up", "drive")
        with located("run_up: drive: "):
            law = keys.law_at({})
    for name in ("speed", "speed_ratio", "clearance_ratio"):
        if case.get(name) is not None:
            fix = "give clearance" if name == "clearance_ratio" else "give start, stop and time"
            raise InputError(f"run_up: {name}: the speed changes; {fix}")
    measured = read_probes("run_up", probes)
    recording_of("run_up", samples_per_revolution=samples_per_revolution)  # refused as in a study
    case["speed"] = _highest(law, rig, case.get("overrides"))
    one = case_of(
        "run_up",
        rig,
        case,
        samples_per_revolution=samples_per_revolution,
        initial={"from": CONTACT_FREE} if initial is None else initial,
        probes=measured,
        drive=law if isinstance(law, DriveLaw) else None,
    )
    check_forces(one.rig)
    if not isinstance(one.setup, ModalSetup):
        raise InputError(f'run_up: method: {case["method"]} keeps the speed constant; set method = "modal"')
    given_case: dict[str, Any] = {
        "clearance": one.clearance,
        "friction": one.friction,
        "initial": one.initial,
        "pieces_per_revolution": pieces_per_revolution,
    }
    found = (
        integrate_driven(one.setup, law, **given_case)
        if isinstance(law, DriveLaw)
        else integrate_run_up(one.setup, law, **given_case)
    )
    signals = by_name(found.whole, one.setup.model)
    known = VARIABLES | bore_variables() | probe_variables((probe.name, probe.quantity) for probe in measured)
    variables: dict[str, Any] = {name: known[name].of(values) for name, values in signals.items()}
    slip = np.where(np.isfinite(slip := found.together.least_slip), slip, np.nan)
    variables["minimum_slip_speed"] = VARIABLES["minimum_slip_speed"].of(slip)
    own = drive_variables() | run_up_variables((probe.name, probe.quantity) for probe in measured)
    for name, values in by_revolution(found, signals, samples_per_revolution).items():
        short = name if name.startswith((AMPLITUDE, PHASE)) else name.removeprefix("revolution_")
        variables[short] = own[name].of(values)
    attributes: dict[str, Any] = {
        "reason": found.reason,
        "note": "; ".join(text for text in (one.note, found.advice) if text),
        "rig": one.rig.as_dict(),
        "study": {"record": {"probe": [plain(probe) for probe in measured]}},
    }
    if isinstance(found, DrivenRun):
        attributes |= {
            "record_end": "ended_early" if found.reason else RECORD_END[found.end],
            "last_speed": found.last_speed,
            "energy_residual": found.energy_residual,
        }
    settings = {
        "clearance": VARIABLES["clearance"].of(one.clearance),
        "friction": ((), one.friction, described("1", "friction coefficient")),
    }
    turns = np.arange(n_turn := len(found.speed))
    samples = np.arange(n_turn * samples_per_revolution) / samples_per_revolution
    stators = np.arange(1, len(one.rig.stator) + 1)
    coords = {
        TURNED: ("sample", samples, described("1", "revolutions turned")),
        "revolution": ("revolution", turns, described("1", "number of the revolution, from 0")),
        "order": ("order", np.array(ORDERS), described("1", "order of the spin frequency")),
        "stator": ("stator", stators, described("1", "number of the stator")),
    }
    return xr.Dataset(variables, coords | settings, attributes)


def _highest(law: SpeedLaw | DriveLaw, rig: Rig | str | PathLike[str], overrides: Any) -> float:
    """Highest speed of a law, rad/s; that which a driven rotor cannot pass."""
    if isinstance(law, SpeedLaw):
        return max(law.speed)
    model = assemble(with_keys(rig if isinstance(rig, Rig) else read_rig(rig), overrides or {}))
    highest = law.fastest(release(model, law.inertia)[1].inertia)
    return min([highest, *model.rotor.tabulated_speeds[-1:]])


def _read_law(
    start: float | str | None,
    stop: float | str | None,
    time: float | str | None,
    law: Sequence[tuple[float | str, float | str]] | None,
) -> SpeedLaw:
    """The speed over the time, from either way to state it."""
    if (law is None) == (start is None and stop is None and time is None):
        raise InputError("run_up: give either start, stop and time, or a speed_law")
    if law is None:
        for name, value in (("start", start), ("stop", stop), ("time", time)):
            if value is None:
                raise InputError(f"run_up: {name}: missing; give start, stop and time")
        law = [(0.0, start or 0.0), (time or 0.0, stop or 0.0)]
    try:
        times = tuple(parse_quantity(t, "s", "time") for t, _ in law)
        speeds = tuple(parse_quantity(speed, "rad/s", "speed") for _, speed in law)
        return SpeedLaw(time=times, speed=speeds)
    except (TypeError, ValueError):
        raise InputError("run_up: speed_law: is not a list of pairs; write [(0, 30), (10, 300)]") from None
    except InputError as error:
        raise InputError(f"run_up: {error}") from None
