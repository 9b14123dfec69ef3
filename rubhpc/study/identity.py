"""What the results of a study depend on, apart from the values on its axes."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from rubhpc.input.reading import plain
from rubhpc.rig.reading import with_keys
from rubhpc.study import contact_axes, initial
from rubhpc.study.axes import (
    DRIVE_AXES,
    DRIVE_PREFIX,
    FROM_REST,
    RUN_UP_PREFIX,
    RUN_UP_TIME,
    SPEED_AXES,
)

if TYPE_CHECKING:
    from rubhpc.study.study import Study

PHYSICS = 33  # version of the physics: raised whenever a study gives other results than before
# Versions of what only some studies take, raised in place of PHYSICS and added to it for these.
MODAL = 8  # method = "modal": modes kept, resolution of events, and last bits of multipliers and exponents
DIRECT = 10  # transient = "direct"
CHANGING_SPEED = 39  # run-ups and drives
COULOMB = 27  # set-valued friction
PENALTY = 1  # method = "modal" with a penalty, for whose sake modes are kept
SOFT_FRICTION = 1  # a penalty with set-valued friction
CURVED = 11  # method = "modal" with gaps that are curved
RESTITUTION = 2  # method = "modal" with restitution, for whose sake modes are kept
CURVED_RINGS = 1  # the same with several stators
SEVERAL_STATORS = 4  # method = "modal" with more than one
MANY_STATORS = 8  # more than five, whose sets of closed contacts or states may be more than 256
BRANCHES = 10  # [branch]
MANY_EVENTS = 2  # restitution, or method = "modal" where a case may have 200 000 events
ALONG_SPEED = 1  # branches along a speed
PROBED = 1  # method = "modal" with probes, for whose sake modes are kept
WHOLE = "n (this sample is drawn as a whole and cannot grow)"
# Keys of [contact] that are stated even where they are not given, as older stores do.
_ALWAYS = ("stiffness", "damping", "restitution", "static_friction_ratio")
_AXIS = "axis"  # in place of a value that every case sets


def physics_of(study: Study) -> int:
    """Return the version of the physics that a study takes: no other gives the same results."""
    friction_laws = _laws(study, "friction_law")
    is_soft = "penalty" in _laws(study, "law")
    return (
        PHYSICS
        + MODAL * (study.integrator.method == "modal")
        + DIRECT * study.recording.is_transient_direct
        + CHANGING_SPEED * bool(study.run_up or study.drive)
        + COULOMB * (friction_laws != {"sliding"})
        + PENALTY * (study.integrator.method == "modal" and is_soft)
        + SOFT_FRICTION * (is_soft and friction_laws != {"sliding"})
        + RESTITUTION * (study.integrator.method == "modal" and _bounces(study))
        + CURVED * (study.integrator.method == "modal" and _is_curved(study))
        + CURVED_RINGS
        * (study.integrator.method == "modal" and _is_curved(study) and len(study.rig.stator) > 1)
        + SEVERAL_STATORS * (study.integrator.method == "modal" and len(study.rig.stator) > 1)
        + MANY_STATORS * (len(study.rig.stator) > 5)
        + BRANCHES * (study.branch is not None)
        + MANY_EVENTS * _has_many_events(study)
        + ALONG_SPEED * (study.branch is not None and study.branch.along in SPEED_AXES)
        + PROBED * (study.integrator.method == "modal" and bool(study.recording.probe))
    )


def _is_curved(study: Study) -> bool:
    """Whether a stator is bent, or any case has a normal that turns."""
    return study.has_bent_stator or "updated" in _laws(study, "normal")


def _bounces(study: Study) -> bool:
    """Whether impacts of any case have restitution."""
    name = contact_axes.PREFIX + "restitution"
    return bool(study.contact.restitution) or any(axis.name == name for axis in study.axes)


def _has_many_events(study: Study) -> bool:
    """Whether impacts have restitution, or more than 1000 revolutions are followed without a pause."""
    recording = study.recording
    transient = 0 if recording.is_transient_auto else recording.longest_transient
    is_long = max(transient, recording.revolutions) > 1000
    return _bounces(study) or (study.integrator.method == "modal" and is_long)


def _laws(study: Study, key: str) -> set[str]:
    """Return the laws that the cases take, by a key of [contact]."""
    return set(contact_axes.laws_of(study.contact, study.axes, key))


def identity_parts(study: Study) -> dict[str, Any]:
    """Return all that changes the results of a study except the values on its axes, for JSON.

    A key of rig or contact that is an axis is left out, since every case sets it. Of a sample that can grow,
    everything but the number of points is included.
    """
    keys = [axis.name for axis in study.axes if axis.is_rig_key]
    rig = with_keys(
        study.rig, {axis.name: axis.values[0] for axis in study.axes if axis.is_rig_key}
    ).as_dict()
    for key in keys:
        _blank(rig, key.split("."))
    del rig["name"]
    contact = {k: v for k, v in asdict(study.contact).items() if v is not None or k in _ALWAYS}
    contact.pop("model", None)  # its keys are there
    contact |= {
        axis.name.removeprefix(contact_axes.PREFIX): _AXIS for axis in study.axes if axis.is_contact_key
    }
    swept = {axis.name: axis.sweep for axis in study.axes if axis.sweep != FROM_REST}
    parts = {
        "physics": physics_of(study),
        "axes": [axis.name for axis in study.axes],
        **({"sweep": swept} if swept else {}),  # absent in older stores
        "rig": rig,
        "contact": contact,
        "integrator": asdict(study.integrator),
        "record": study.recording.as_dict() | {"keep": sorted(study.recording.keep)},
    }
    starts = {axis.name.removeprefix(initial.PREFIX): _AXIS for axis in study.axes if axis.is_initial_key}
    if starts or study.initial != initial.Initial():  # absent in older stores
        stated = plain(study.initial)
        if study.initial.state is not None:  # wherever it has been read
            stated = {k: v for k, v in stated.items() if k not in ("from", "select")}
            stated["state"] = study.initial.state.digest
        parts["initial"] = stated | starts
    if study.branch is not None:
        span = study.axis(study.branch.along).drawn_from
        parts["branch"] = asdict(study.branch) | (asdict(span) if span else {})
    if study.run_up is not None:
        varied = [axis.name for axis in study.axes if axis.name == RUN_UP_TIME]
        parts["run_up"] = asdict(study.run_up) | {n.removeprefix(RUN_UP_PREFIX): _AXIS for n in varied}
    if study.drive is not None:
        varied = [axis.name for axis in study.axes if axis.name in DRIVE_AXES]
        parts["drive"] = asdict(study.drive) | {n.removeprefix(DRIVE_PREFIX): _AXIS for n in varied}
    if study.sample is not None:
        ranges = {axis.name: asdict(axis.drawn_from) for axis in study.axes if axis.drawn_from}
        parts["sample"] = {
            **{key: value for key, value in study.sample.as_dict().items() if key != "n"},
            "ranges": ranges,
            **({} if study.sample.can_grow else {WHOLE: study.sample.n}),
        }
    return parts


def _blank(table: Any, key: list[str]) -> None:
    """Replace the value of a dotted key, in one item of a list or in all."""
    if isinstance(table, list):
        items, rest = ([table[int(key[0]) - 1]], key[1:]) if key[0].isdigit() else (table, key)
        for item in items:
            _blank(item, rest)
    elif len(key) == 1:
        table[key[0]] = _AXIS
    else:
        _blank(table[key[0]], key[1:])
