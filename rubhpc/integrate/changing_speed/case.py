"""One case whose speed changes: signals, values of every revolution, and measures of the whole."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.errors import InputError
from rubhpc.integrate.changing_speed.driven import DrivenRun, integrate_driven
from rubhpc.integrate.changing_speed.run_up import integrate_run_up
from rubhpc.integrate.changing_speed.turns import measures_of_turns
from rubhpc.integrate.compilation import seconds_compiling
from rubhpc.integrate.measuring.samples import by_name, probe_extents
from rubhpc.integrate.modal_setup import ModalSetup
from rubhpc.schema import AMPLITUDE, DIVERGED, DONE, ORDERS, PHASE, PROBE, TRACKED, case_measures
from rubhpc.spectra import track_orders
from rubhpc.study.drive_law import DriveLaw

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.changing_speed.run_up import RunUp
    from rubhpc.integrate.record import State
    from rubhpc.integrate.setup import Setup
    from rubhpc.study.initial import Initial
    from rubhpc.study.speed_law import SpeedLaw
    from rubhpc.study.tables import Recording

    Floats = NDArray[np.float64]

WINDOW = 6  # revolutions over which orders are taken, whole periods of all of them


@dataclass(frozen=True, kw_only=True, eq=False)
class RunUpRecord:
    """Result of a run-up case of a study.

    Attributes
    ----------
    arrays : dict of (n_revolution, ...) or (..., n_sample)
        By the names of `schema.run_up_variables`, and the signals.
    measures : dict
        Of the whole run-up.
    remark : str
        Reason of an early end, or problem of the result; "" without one.
    """

    arrays: dict[str, Floats]
    measures: dict[str, Any] = field(default_factory=dict)
    remark: str = ""
    status: int = DONE


def record_run_up(
    setup: Setup,
    law: SpeedLaw | DriveLaw,
    *,
    clearance: float,
    friction: float,
    recording: Recording,
    initial: State | Initial,
    check: Callable[[], None] | None = None,
    say: Callable[[str], None] = lambda _: None,
    note: Callable[[float], None] = lambda _: None,
) -> RunUpRecord:
    """Integrate a case whose speed changes; arguments as of `integrate_run_up` or `integrate_driven`.

    A case that ends early counts as diverged, and has its revolutions up to the end.
    """
    if not isinstance(setup, ModalSetup):
        raise InputError(
            '[integrator] method: central-difference keeps the speed constant; set method = "modal"'
        )
    began = time.perf_counter() - seconds_compiling()
    case: dict[str, Any] = {"clearance": clearance, "friction": friction, "initial": initial}
    case |= {"check": check, "say": say, "note": note}
    found = (
        integrate_driven(setup, law, **case)
        if isinstance(law, DriveLaw)
        else integrate_run_up(setup, law, **case)
    )
    signals = by_name(found.whole, setup.model)
    turns = found.speed.size
    none = np.full(len(setup.model.stators), math.nan)
    of_stators = [v.name for v in case_measures() if v.dims == ("stator",)]
    measures: dict[str, Any] = dict.fromkeys(of_stators, none)
    if not found.reason:
        lasts = 2.0 * np.pi / found.speed
        of_contacts = measures_of_turns(
            found.together,
            found.whole,
            turns,
            setup.model,
            duration=float(lasts.sum()),
            is_round=setup.is_updated,
        )
        measures |= of_contacts | {
            "peak_torsion": float(np.abs(signals["torsion"]).max()),
            "peak_to_peak_vertical": float(np.ptp(signals["vertical"])),
            "peak_to_peak_horizontal": float(np.ptp(signals["horizontal"])),
            **probe_extents(signals),
        }
        if isinstance(found, DrivenRun):
            measures |= {
                "energy_residual": found.energy_residual,
                "revolutions_turned": turns,
                "record_end": found.end,
                "last_speed": found.last_speed,
                "drive_work": float(found.drive_work.sum()),
            }
    measures |= {
        "modal_error": setup.modal_error,
        "steps": found.n_step,
        "scheme": setup.scheme.flag,
        "wall_time": time.perf_counter() - seconds_compiling() - began,
    }
    known = by_revolution(found, signals, recording.samples_per_revolution) if turns else {}
    return RunUpRecord(
        arrays=known | (signals if turns else {}),
        measures=measures,
        remark=found.reason or found.advice,
        status=DIVERGED if found.reason else DONE,
    )


def by_revolution(found: RunUp, signals: dict[str, Floats], per_revolution: int) -> dict[str, Floats]:
    """Values of every revolution, by the names of `schema.run_up_variables`.

    Amplitudes (zero to peak) and phases (rad, by which a signal leads the order of the shaft's angle) are
    (n_revolution, n_order), over a window of six revolutions around each.
    """
    known = {
        "revolution_speed": found.speed,
        "revolution_time": found.time,
        "revolution_contact_fraction": found.contact_fraction,
        "revolution_peak_contact_force": found.peak_contact_force,
        "revolution_friction_work": found.friction_work,
    }
    if isinstance(found, DrivenRun):
        known |= {
            "revolution_drive_work": found.drive_work,
            "revolution_braking_torque": found.braking_torque,
        }
    for name in (*TRACKED, *(name for name in signals if name.startswith(PROBE))):
        lines = track_orders(signals[name], per_revolution, ORDERS, WINDOW)
        known[AMPLITUDE + name], known[PHASE + name] = np.abs(lines), np.angle(lines)
    return known
