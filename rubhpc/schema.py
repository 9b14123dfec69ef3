"""Every array of a store: dimensions after the axes, type, unit and name.

This is the only declaration of a stored variable: storage, docs and tests read it. Those of probes are made
of the names that a study gives them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping


@dataclass(frozen=True, kw_only=True)
class Variable:
    """One stored array; `dims` are those that follow the study's axes."""

    name: str
    role: str  # "waveform", "spectrum", "section", "state", "measure", "setting" or "flag"
    dims: tuple[str, ...] = ()
    dtype: str = "float64"
    unit: str = "1"
    long_name: str
    flags: tuple[str, ...] = field(default=())  # meanings of 0, 1, 2, ...
    worst: Literal["max", "min"] = "max"  # the extreme over stators that is the worst of a case

    def of(self, values: Any) -> tuple[tuple[str, ...], Any, dict[str, str]]:
        """Return a variable of a dataset with these values, along `dims`."""
        return self.dims, values, described(self.unit, self.long_name)

    @property
    def fill_value(self) -> float | int:
        """Value of a case that has none: NaN, -1 in integers, 0 in `status`."""
        if self.name == "status":
            return MISSING
        return math.nan if self.dtype.startswith("float") else -1


STATUS = ("missing", "done", "failed", "diverged", "inferred")
MISSING, DONE, FAILED, DIVERGED, INFERRED = range(5)  # inferred: not computed, readers fill it
HAS_VALUES = (DONE, INFERRED)  # measures and regime, as a reader of the store sees them
REGIME = ("no_contact", "periodic", "quasi_periodic", "chaotic", "undecided")
BRANCH_EVENT = ("none", "fold", "period_doubling", "neimark_sacker", "grazing", "end", "branch_point")
SETTLED = ("not_settled", "settled")
SCHEMES = ("event_driven", "contact_stepping", "central_difference", "curved", "collocation")


def _variable(role: str, name: str, unit: str, long_name: str, *dims: str, **further: Any) -> Variable:
    return Variable(name=name, role=role, dims=dims, unit=unit, long_name=long_name, **further)


# The recorded signals: name, extra dimensions, unit, long name; in single precision, as are their spectra.
_SIGNALS = (
    ("vertical", (), "m", "vertical displacement of the disc"),
    ("horizontal", (), "m", "horizontal displacement of the disc"),
    ("torsion", (), "rad", "torsional displacement of the disc"),
    ("torsion_acceleration", (), "rad s-2", "torsional acceleration of the disc"),
    ("stator_axial", ("stator",), "m", "axial displacement of the stator tip (positive when compressed)"),
    ("stator_lateral", ("stator",), "m", "lateral displacement of the stator tip (positive with the rim)"),
    ("contact_force", ("stator",), "N", "normal contact force (mean over the sample's interval)"),
)
SIGNAL_NAMES = tuple(name for name, *_ in _SIGNALS)
SECTION_NAMES = ("vertical", "horizontal", "torsion")


def _of_signals(
    prefix: str, role: str, dim: str, text: str, dtype: str = "float32", names: tuple[str, ...] = SIGNAL_NAMES
) -> tuple[Variable, ...]:
    return tuple(
        _variable(role, prefix + n, u, text.format(t), *d, dim, dtype=dtype)
        for n, d, u, t in _SIGNALS
        if n in names
    )


_WAVEFORMS = _of_signals("", "waveform", "sample", "{}")
_SPECTRA = _of_signals("spectrum_", "spectrum", "order", "amplitude (zero to peak) of the {}")
_SECTIONS = _of_signals("section_", "section", "section", "{}, once a revolution", "float64", SECTION_NAMES)

CONTACT_ANGLE = "contact_angle"
# Of records with a bore among the stators, besides the signals: means over the sample's interval.
_OF_BORES = (
    (CONTACT_ANGLE, "rad", "angle of the contact point from straight up (NaN: no contact)"),
    ("contact_force_vertical", "N", "vertical contact force on the rotor, with friction"),
    ("contact_force_horizontal", "N", "horizontal contact force on the rotor, with friction"),
)
RUB_KIND = ("none", "partial", "forward", "backward_slipping", "rolling")

FINAL_STATE = "final_state"
_STATE = _variable(
    "state",
    FINAL_STATE,
    "1",
    "where the case ended: displacements of rotor and stators, their velocities, contact forces, "
    "overlaps (SI)",
    "degree",
)
_SETTINGS = (
    _variable("setting", "spin_speed", "rad s-1", "spin speed"),
    _variable("setting", "clearance", "m", "radial clearance at rest"),
    _variable("setting", "contact_free_amplitude", "m", "steady amplitude without contact"),
)
_FLAGS = (
    _variable("flag", "status", "1", "state of the case", dtype="int8", flags=STATUS),
    _variable("flag", "regime", "1", "regime of the motion", dtype="int8", flags=REGIME),
)
_measure = partial(_variable, "measure")
_RUBS = (
    _measure("rub_kind", "1", "kind of rub in a bore", "stator", dtype="int8", flags=RUB_KIND),
    _measure("whirl_frequency", "rad s-1", "whirl of the contact in a bore, positive forward", "stator"),
    _measure("contact_angle_mean", "rad", "mean angle of the contact force in a bore, from up", "stator"),
    _measure("contact_angle_spread", "rad", "angular deviation of that angle, to the root of two", "stator"),
    _measure("contact_arc", "rad", "arc of a bore that is touched, to two pi", "stator"),
)
BORE_MEASURES = tuple(measure.name for measure in _RUBS)
_MEASURES = (
    _measure("period", "1", "period in revolutions (0: none found)", dtype="int16"),
    _measure("lyapunov_exponent", "1", "largest Lyapunov exponent per revolution (NaN: not measured)"),
    _measure("largest_multiplier", "1", "modulus of the largest Floquet multiplier (NaN: not solved for)"),
    _measure("multiplier_angle", "rad", "angle of the largest Floquet multiplier, 0 to pi"),
    _measure("whirl_ratio", "1", "whirl at the spin frequency (1: forward circle, -1: backward circle)"),
    _measure("contact_fraction", "1", "fraction of the time in contact", "stator"),
    _measure("stick_fraction", "1", "fraction of the time in contact without slip", "stator"),
    _measure("reversals_per_revolution", "1", "reversals of the slip per revolution", "stator"),
    _measure("contacts_per_revolution", "1", "contacts per revolution", "stator"),
    _measure("contact_duration", "s", "mean duration of a contact", "stator"),
    _measure("peak_contact_force", "N", "peak contact force", "stator"),
    _measure("contact_impulse", "N s", "contact impulse per revolution", "stator"),
    _measure("friction_work", "J", "work of friction per revolution", "stator"),
    _measure("minimum_slip_speed", "m s-1", "lowest slip speed in contact", "stator", worst="min"),
    *_RUBS,
    _measure("force_over_euler_load", "1", "peak contact force over the stator's Euler load", "stator"),
    _measure("tip_deflection_ratio", "1", "peak lateral tip deflection over the stator's length", "stator"),
    _measure(
        "foreshortening_ratio",
        "1",
        "change of the gap by bending that the model leaves out, over the compression of the tip",
        "stator",
    ),
    _measure(
        "normal_angle",
        "rad",
        "largest angle in contact from the fixed normal to the line of centres (0: updated normal)",
        "stator",
    ),
    _measure(
        "force_over_strength", "1", "peak contact force over the stator's strength (0: none given)", "stator"
    ),
    _measure(
        "carrier_displacement",
        "m",
        "peak displacement of what the stator stands on (0: the ground)",
        "stator",
    ),
    _measure(
        "bearing_clearance_ratio",
        "1",
        "largest displacement in a bearing over its clearance (0: none given)",
    ),
    _measure("peak_torsion", "rad", "peak torsional displacement"),
    _measure("peak_to_peak_vertical", "m", "peak-to-peak vertical displacement"),
    _measure("peak_to_peak_horizontal", "m", "peak-to-peak horizontal displacement"),
    _measure("energy_residual", "1", "residual of the energy balance over the recorded revolutions"),
    _measure("modal_error", "1", "estimated error by the modes left out, relative (NaN: unknown)"),
    _measure("settled", "1", "whether the motion had settled before the record", dtype="int8", flags=SETTLED),
    _measure("contact_iterations", "1", "most iterations that a contact problem took", dtype="int64"),
    _measure("contact_residual", "1", "largest residual of the contact problems, relative"),
    _measure("transient_revolutions", "1", "revolutions discarded before the record", dtype="int64"),
    _measure("steps", "1", "integration steps", dtype="int64"),
    _measure("scheme", "1", "time integration scheme of the case", dtype="int8", flags=SCHEMES),
    _measure("left_closed_form", "1", "times that collocation took over from closed form", dtype="int64"),
    _measure("wall_time", "s", "wall time of the case"),
)

VARIABLES: dict[str, Variable] = {
    v.name: v for v in (*_WAVEFORMS, *_SPECTRA, *_SECTIONS, _STATE, *_SETTINGS, *_FLAGS, *_MEASURES)
}


def bore_variables() -> dict[str, Variable]:
    """Return the waveforms of records with a bore: mean over the sample's interval, by the contact force."""
    return {row[0]: _variable("waveform", *row, "stator", "sample", dtype="float32") for row in _OF_BORES}


# What a probe measures: unit, long name.
PROBE_QUANTITIES = {
    "displacement": ("m", "displacement"),
    "velocity": ("m s-1", "velocity"),
    "acceleration": ("m s-2", "acceleration"),
    "twist": ("rad", "torsional displacement"),
    "twist_rate": ("rad s-1", "torsional velocity"),
    "twist_acceleration": ("rad s-2", "torsional acceleration"),
    "bearing_force": ("N", "force on the bearings"),
    "foundation_force": ("N", "force on the foundation"),
}
PROBE = "probe_"
_OF_PROBES: dict[str, tuple[str, tuple[str, ...], str, str]] = {  # prefix: role, dimensions, type, long name
    PROBE: ("waveform", ("sample",), "float32", "{quantity} at the probe {name}"),
    f"spectrum_{PROBE}": (
        "spectrum",
        ("order",),
        "float32",
        "amplitude (zero to peak) of the {quantity} at the probe {name}",
    ),
    f"peak_to_peak_{PROBE}": ("measure", (), "float64", "peak-to-peak {quantity} at the probe {name}"),
}


def probe_variables(probes: Iterable[tuple[str, str]]) -> dict[str, Variable]:
    """Return the variables of probes, each a name and a quantity: waveforms, spectra, then measures."""
    known = [(name, PROBE_QUANTITIES[quantity]) for name, quantity in probes]
    return {
        f"{prefix}{name}": _variable(
            role, f"{prefix}{name}", unit, text.format(quantity=what, name=name), *dims, dtype=dtype
        )
        for prefix, (role, dims, dtype, text) in _OF_PROBES.items()
        for name, (unit, what) in known
    }


def lyapunov_variables(n_exponent: int) -> dict[str, Variable]:
    """Return the measures of the Lyapunov spectrum, of as many exponents; none of none."""
    found = [
        _measure(f"lyapunov_{k}", "1", f"Lyapunov exponent {k} per revolution, of the exact tangent map")
        for k in range(1, n_exponent + 1)
    ]
    if found:
        text = "dimension of the attractor in a section (Kaplan and Yorke; NaN: more exponents are needed)"
        found.append(_measure("kaplan_yorke_dimension", "1", text))
    return {variable.name: variable for variable in found}


POINT, BRANCH = "point_", "branch"  # prefix of the variables of a branch study, and their role
MULTIPLIERS = 8  # stored of every point
# Name, long name, dimensions after the point.
_OF_POINTS: tuple[tuple[str, ...], ...] = (
    ("value", "value on the axis that is followed (its unit)"),
    ("branch", "number of the branch, from 1"),
    ("stability", "0: unstable, 1: stable"),
    ("event", f"what happens there: 0, 1, ... of {', '.join(BRANCH_EVENT)}"),
    ("multiplier_real", "real part of a Floquet multiplier, largest first", "multiplier"),
    ("multiplier_imag", "imaginary part of a Floquet multiplier", "multiplier"),
)
# Measures of a simulation that a solved motion does not have.
_OF_RUNS = {
    "settled", "contact_iterations", "contact_residual", "transient_revolutions", "steps", "scheme",
    "left_closed_form", "wall_time",
}  # fmt: skip


def branch_variables() -> dict[str, Variable]:
    """Return the variables of the points of a branch study; all are floats, NaN beyond the last point."""
    own = (_variable(BRANCH, POINT + name, "1", text, "point", *dims) for name, text, *dims in _OF_POINTS)
    measures = (
        replace(v, name=POINT + v.name, role=BRANCH, dims=("point", *v.dims), dtype="float64", flags=())
        for v in case_measures()
        if v.name not in _OF_RUNS
    )
    sections = (
        replace(v, name=POINT + v.name, role=BRANCH, dims=("point", "point_section")) for v in _SECTIONS
    )
    return {v.name: v for v in (*own, *measures, *sections)}


RUN_UP = "run_up"  # role of what a run-up stores of every revolution
TURNED = "turned"  # revolutions at a sample of a run-up, whose revolutions are a dimension
ORDERS = (1 / 3, 1 / 2, 1.0, 2.0)  # of the spin, whose amplitudes and phases are followed
TRACKED = ("vertical", "horizontal", "torsion")  # signals of which they are, besides the probes
_OF_REVOLUTIONS: tuple[tuple[str, ...], ...] = (  # name, unit, long name, dimensions after the revolution
    ("revolution_speed", "rad s-1", "mean spin speed of the revolution"),
    ("revolution_time", "s", "beginning of the revolution"),
    ("revolution_contact_fraction", "1", "fraction of the revolution in contact", "stator"),
    ("revolution_peak_contact_force", "N", "peak contact force in the revolution", "stator"),
    ("revolution_friction_work", "J", "work of friction in the revolution", "stator"),
)
AMPLITUDE, PHASE = "amplitude_", "phase_"
_OF_DRIVES = (
    ("revolution_drive_work", "J", "work of the drive in the revolution"),
    ("revolution_braking_torque", "N m", "mean torque by which rub and whirl brake the spin"),
)
RECORD_END = ("all_revolutions", "lowest_speed", "highest_speed")  # why the record of a driven rotor ends


def run_up_variables(probes: Iterable[tuple[str, str]] = ()) -> dict[str, Variable]:
    """Return the variables of the revolutions of a run-up, NaN beyond the last one of a case."""
    own = _of_revolutions(_OF_REVOLUTIONS)
    known = VARIABLES | probe_variables(probes)
    for name in (*TRACKED, *(name for name in known if name.startswith(PROBE))):
        for prefix, unit, what in ((AMPLITUDE, known[name].unit, "amplitude"), (PHASE, "rad", "phase")):
            text = f"{what} of the {known[name].long_name}"
            own[prefix + name] = _variable(RUN_UP, prefix + name, unit, text, "revolution", "order")
    return own


def _of_revolutions(rows: tuple[tuple[str, ...], ...]) -> dict[str, Variable]:
    return {
        name: _variable(RUN_UP, name, unit, text, "revolution", *dims) for name, unit, text, *dims in rows
    }


def drive_variables() -> dict[str, Variable]:
    """Return what a driven rotor stores of every revolution besides `run_up_variables`."""
    return _of_revolutions(_OF_DRIVES)


def drive_measures() -> tuple[Variable, ...]:
    """Return the measures of a driven rotor besides those of any case."""
    return (
        _measure("revolutions_turned", "1", "whole revolutions in the record", dtype="int64"),
        _measure("record_end", "1", "why the record ends", dtype="int8", flags=RECORD_END),
        _measure("last_speed", "rad s-1", "spin speed at the end of the record"),
        _measure("drive_work", "J", "work of the drive"),
    )


def role_of(name: str) -> str:
    """Return the role of a variable, also of a probe; "" where it is none of a store."""
    if (known := VARIABLES | bore_variables()).get(name):
        return known[name].role
    if name.startswith(POINT):
        return BRANCH
    if name in (measure.name for measure in drive_measures()):
        return "measure"
    if name.startswith(("revolution_", AMPLITUDE, PHASE)):
        return RUN_UP
    return next((role for prefix, (role, *_) in _OF_PROBES.items() if name.startswith(prefix)), "")


def described(unit: str, long_name: str = "") -> dict[str, str]:
    """Return what a dataset says of a variable."""
    return {"units": unit} | ({"long_name": long_name} if long_name else {})


def columns(dims: str | tuple[str, ...], about: Mapping[str, tuple[Any, ...]]) -> dict[str, Any]:
    """Return variables of a dataset along the same dimensions, from values, unit and long name of each."""
    return {name: (dims, values, described(*words)) for name, (values, *words) in about.items()}


def is_signal(name: str) -> bool:
    """Whether a name is that of a recorded signal, also of a probe."""
    return name in SIGNAL_NAMES or name in bore_variables() or name.startswith(PROBE)


def case_measures() -> tuple[Variable, ...]:
    """The measures of a case: one value each, or one a stator. The regime is one too."""
    return tuple(v for v in VARIABLES.values() if v.role == "measure" or v.name == "regime")


STATE = "state"  # the final state; always kept in a sweep, where it starts the next case
WAVEFORM = "waveform"
KEPT = (WAVEFORM, "spectrum", "section")  # what [record] keep names by default
KEEPABLE = (*KEPT, STATE)  # what it may name; measures are always stored
