"""What the results of a study depend on, apart from the values on its axes."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from rubhpc.input.reading import plain
from rubhpc.rig.reading import with_keys
from rubhpc.study.axes import FROM_REST, TABLES
from rubhpc.study.initial import Initial

if TYPE_CHECKING:
    from rubhpc.study.study import Study

PHYSICS = 201  # version of the physics: raised whenever a study gives other results than before
WHOLE = "n (this sample is drawn as a whole and cannot grow)"
# Keys of [contact] that are stated even where they are not given, as older stores do.
_ALWAYS = ("stiffness", "damping", "restitution", "static_friction_ratio")
_AXIS = "axis"  # in place of a value that every case sets


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
    varied = {table: {axis.key: _AXIS for axis in study.axes if axis.table == table} for table in TABLES}
    swept = {axis.name: axis.sweep for axis in study.axes if axis.sweep != FROM_REST}
    parts = {
        "physics": PHYSICS,
        "axes": [axis.name for axis in study.axes],
        **({"sweep": swept} if swept else {}),  # absent in older stores
        "rig": rig,
        "contact": contact | varied["contact"],
        "integrator": asdict(study.integrator),
        "record": study.recording.as_dict() | {"keep": sorted(study.recording.keep)},
    }
    if varied["initial"] or study.initial != Initial():  # absent in older stores
        stated = plain(study.initial)
        if study.initial.state is not None:  # wherever it has been read
            stated = {k: v for k, v in stated.items() if k not in ("from", "select")}
            stated["state"] = study.initial.state.digest
        parts["initial"] = stated | varied["initial"]
    if study.branch is not None:
        span = study.axis(study.branch.along).drawn_from
        parts["branch"] = asdict(study.branch) | (asdict(span) if span else {})
    if study.run_up is not None:
        parts["run_up"] = asdict(study.run_up) | varied["run_up"]
    if study.drive is not None:
        parts["drive"] = asdict(study.drive) | varied["drive"]
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
