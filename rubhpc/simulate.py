"""The face of one case: arguments with units in, a record out."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from rubhpc.case_arguments import FRICTION, case_of, pick, read_probes, recording_of
from rubhpc.integrate.case import run_case
from rubhpc.threads import on_one_thread

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from os import PathLike

    from rubhpc.integrate.record import Record, State
    from rubhpc.rig.probes import Probe
    from rubhpc.rig.rig import Rig


@on_one_thread
def simulate(
    rig: Rig | str | PathLike[str],
    *,
    speed: float | str | None = None,
    speed_ratio: float | None = None,
    clearance: float | str | None = None,
    clearance_ratio: float | None = None,
    friction: float = FRICTION,
    overrides: dict[str, float | str] | None = None,
    law: str = "lagrange",
    stiffness: float | str | None = None,
    damping: float | str | None = None,
    restitution: float | None = None,
    friction_law: str | None = None,
    static_friction_ratio: float | None = None,
    stribeck_speed: float | str | None = None,
    slip_speed: Sequence[float | str] | None = None,
    friction_ratio: Sequence[float] | None = None,
    normal: str | None = None,
    model: str | None = None,
    method: str = "modal",
    step: float | str | None = None,
    accuracy: float = 1e-3,
    transient: int | str = 120,
    transient_limit: int | None = None,
    transient_tolerance: float | None = None,
    revolutions: int = 64,
    samples_per_revolution: int = 256,
    keep: str | tuple[str, ...] = ("waveform", "spectrum", "section"),
    lyapunov: int = 0,
    probes: Sequence[Probe | Mapping[str, object]] = (),
    initial: State | Mapping[str, float | str] | None = None,
) -> Record:
    """Simulate one case.

    Parameters
    ----------
    rig : Rig, str or path
        A rig, the name of a packaged one ("mokhtar2017"), or the path of a rig file.
    speed : float (rad/s) or str with a unit, optional
        Rotation speed; either this or `speed_ratio`.
    speed_ratio : float, optional
        Rotation speed over the rotor's first lateral frequency at standstill.
    clearance : float (m) or str with a unit, optional
        Radial clearance, or below 0 an interference with stators that give; either this or
        `clearance_ratio`.
    clearance_ratio : float, optional
        Radial clearance over the contact-free amplitude at that speed.
    friction : float
        Coefficient of friction.
    overrides : dict, optional
        Single keys of the rig: `{"stator.youngs_modulus": "30 GPa"}`.
    law : {"lagrange", "penalty", "hertz"}
        Contact law: multipliers that close gaps exactly (by default), a spring and a damper, or Hertz's law
        with Hunt and Crossley's damping.
    stiffness : float (N/m; N/m^1.5) or str with a unit, optional
        Stiffness of the penalty's spring, or in N/m^1.5 of Hertz's law, each of which needs it.
    damping : float (N s/m; s/m) or str with a unit, optional
        Damping of the penalty, or in s/m of Hertz's law; none by default.
    restitution : float, optional
        Normal velocity after an impact over that before it, 0 to 1, with `law="lagrange"`; default none.
    friction_law : {"sliding", "coulomb", "stribeck", "table"}
        Friction law: steady sliding in the sense of the spin; or, with stick, Coulomb's law (by default),
        Stribeck's, or a table over the slip speed.
    static_friction_ratio : float, optional
        Coefficient of friction at rest over that in sliding, 1 or more; of Coulomb's law by default 1.
    stribeck_speed : float (m/s) or str with a unit, optional
        Slip speed at which the excess of friction at rest has decayed to 1/e, of Stribeck's law.
    slip_speed : sequence of float (m/s) or str with a unit, optional
        Slip speeds of a friction table, rising from 0.
    friction_ratio : sequence of float, optional
        Coefficient at these slip speeds over `friction`; linear between them, constant beyond.
    normal : {"fixed", "updated"}
        Contact normal along the stator's axis, or along the line of centres (by default).
    model : {"mokhtar2017"}, optional
        A published model: the fixed normal, sliding friction, and linear geometry of the stators that give
        none. Without a model these have second-order geometry.
    method : {"modal", "central-difference"}
        Integrator: the exact modal one, or the paper's.
    step : float (s) or str, optional
        Time step of the central difference (default 0.5 us, or 0.9 of the stability limit where that is
        less); longest step of the search for events without a bound (modal; default 1 us).
    accuracy : float
        Relative error of each signal and force, of the modal integrator: by the modes that it leaves out, and
        by the steps of collocation.
    transient : int, "auto" or "direct"
        Revolutions discarded; "auto" until displacements repeat themselves after 8 or 12 revolutions;
        "direct" until the motion draws near to a stable periodic one that is solved for, on which the record
        begins.
    transient_limit : int, optional
        Most revolutions discarded with `transient="auto"` or `"direct"`; default 240.
    transient_tolerance : float, optional
        Largest difference of displacements that count as settled with `transient="auto"`, relative to their
        largest value; default 1e-4.
    revolutions : int
        Revolutions recorded.
    samples_per_revolution : int
        Samples in each, an even number.
    keep : tuple of {"waveform", "spectrum", "section"}
        What the record contains in addition to its measures and its final state.
    lyapunov : int
        Lyapunov exponents measured by the exact tangent map over 256 revolutions after the record:
        `lyapunov_1` and on, and `kaplan_yorke_dimension`; NaN by the central difference.
    probes : sequence of Probe or dict
        Additional sensors, by the keys of [[record.probe]], such as `{"name": "left", "node": 1, "angle":
        "-45 deg"}`: the record holds `probe_left` and `spectrum_probe_left`.
    initial : State or dict, optional
        Where to start, by default at rest: a record's `final`, or keys of [initial] such as
        `{"from": "contact_free", "impulse": "0.1 N*s"}` or `{"from": "sweep.zarr", "select": {"speed_ratio":
        1.5}}`.

    Returns
    -------
    Record

    Raises
    ------
    InputError
        If an argument cannot be used; its text says which one and how to fix it.

    Examples
    --------
    >>> record = simulate("mokhtar2017", speed_ratio=0.75, clearance="100 um", transient=60, revolutions=16)
    >>> record.period
    2
    """
    given = pick(locals())
    measured = read_probes("simulate", probes)
    case = case_of(
        "simulate",
        rig,
        given,
        samples_per_revolution=samples_per_revolution,
        initial=initial,
        probes=measured,
    )
    recording = recording_of(
        "simulate",
        transient=transient,
        transient_limit=transient_limit,
        transient_tolerance=transient_tolerance,
        revolutions=revolutions,
        samples_per_revolution=samples_per_revolution,
        keep=keep,
        lyapunov=lyapunov,
        probe=measured,
    )
    record = run_case(
        case.setup,
        clearance=case.clearance,
        friction=case.friction,
        recording=recording,
        initial=case.initial,
    )
    record.settings["contact_free_amplitude"] = case.contact_free_amplitude
    return replace(record, note=case.note)
