"""Periodic motions, stable or not: arguments with units in, a solution with its multipliers out."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rubhpc.case_arguments import CaseArguments, case_of, check_count, read_probes, recording_of
from rubhpc.integrate.periodic_motion import find_periodic_motion
from rubhpc.threads import on_one_thread

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from os import PathLike
    from typing import Unpack

    from rubhpc.integrate.periodic_motion import PeriodicMotion
    from rubhpc.integrate.record import State
    from rubhpc.rig.probes import Probe
    from rubhpc.rig.rig import Rig

LONGEST = 64  # revolutions


@on_one_thread
def periodic(
    rig: Rig | str | PathLike[str],
    *,
    period: int = 1,
    initial: State | Mapping[str, float | str] | None = None,
    transient: int = 60,
    repeat: int = 1,
    samples_per_revolution: int = 256,
    keep: str | tuple[str, ...] = ("waveform", "spectrum", "section"),
    probes: Sequence[Probe | Mapping[str, object]] = (),
    **case: Unpack[CaseArguments],
) -> PeriodicMotion:
    """Solve for a periodic motion by shooting, and find its stability.

    Newton's method on the motion after `period` revolutions, with its exact derivative, which is a product of
    matrix exponentials and saltation matrices. It finds unstable motions as well as stable ones, at the same
    cost whatever the damping.

    Parameters
    ----------
    rig : Rig, str or path
        A rig, the name of a packaged one ("mokhtar2017"), or the path of a rig file.
    period : int
        Revolutions after which the motion is to repeat itself, up to 64; a motion that does so after a
        divisor of them is returned with that period.
    initial : State or dict, optional
        A state near the solution, where the search begins, such as the `state` of one at a neighbouring speed
        or a record's `final`; or the start of a simulation that leads there, by keys of [initial], by default
        at rest.
    transient : int
        Revolutions of that simulation.
    repeat : int
        Periods in the record.
    samples_per_revolution : int
        Samples in each revolution of the record, an even number.
    keep : tuple of {"waveform", "spectrum", "section"}
        What the record contains in addition to its measures.
    probes : sequence of Probe or dict
        Additional sensors, by the keys of [[record.probe]], such as `{"name": "left", "node": 1, "angle":
        "-45 deg"}`: the record holds `probe_left` and `spectrum_probe_left`.
    **case
        Speed, clearance, friction, laws and accuracy as of `simulate`: one of `speed` and `speed_ratio` and
        one of `clearance` and `clearance_ratio` are needed.

    Returns
    -------
    PeriodicMotion

    Raises
    ------
    InputError
        If an argument cannot be used; the central difference cannot.
    NoPeriodicMotion
        If none was found; the text says why.

    Examples
    --------
    >>> motion = periodic("mokhtar2017", speed_ratio=0.75, clearance="100 um", period=2)
    >>> motion.period, motion.is_stable
    (2, True)
    """
    check_count("periodic", "period", period, 1, LONGEST)
    check_count("periodic", "repeat", repeat, 1)
    measured = read_probes("periodic", probes)
    one = case_of(
        "periodic", rig, case, samples_per_revolution=samples_per_revolution, initial=initial, probes=measured
    )
    motion = find_periodic_motion(
        one.setup,
        clearance=one.clearance,
        friction=one.friction,
        period=period,
        repeat=repeat,
        recording=recording_of(
            "periodic",
            transient=transient,
            samples_per_revolution=samples_per_revolution,
            keep=keep,
            probe=measured,
        ),
        initial=one.initial,
    )
    motion.record.settings["contact_free_amplitude"] = one.contact_free_amplitude
    return motion
