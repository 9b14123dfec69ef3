"""What a measured file states: where its columns are, in which units, and how the shaft turned."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from rubhpc.errors import InputError
from rubhpc.input.fields import FieldError, check_fields, choice, count, quantity, table, text, words
from rubhpc.input.messages import brief, place
from rubhpc.input.quantity import parse_quantity
from rubhpc.input.reading import build, read_toml
from rubhpc.rig.probes import Probe
from rubhpc.schema import PROBE, PROBE_QUANTITIES, SIGNAL_NAMES, VARIABLES

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

_PLAIN = {"m s-1": "m/s", "m s-2": "m/s^2", "rad s-1": "rad/s", "rad s-2": "rad/s^2"}  # as pint reads them
_ANGLES = {"vertical": 0.0, "horizontal": 0.5}  # of pi rad
_MIL, _GRAVITY = re.compile(r"\bmil\b"), re.compile(r"\bg\b")


@dataclass(frozen=True, kw_only=True)
class TimeKeys:
    """Times of the samples: a column, or a sampling rate; WAV and UFF files state their own."""

    column: str | None = text(doc="Column with the time.", example='"t"', default=None)
    unit: str = text(doc="Its unit; a column of dates and times needs none.", example='"ms"', default="s")
    rate: float | None = quantity(
        "Hz", doc="Sampling rate, in place of a column.", example='"25.6 kHz"', default=None, above=0.0
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if self.column is not None and self.rate is not None:
            raise FieldError("rate", "conflicts with column; leave out one of them")


@dataclass(frozen=True, kw_only=True)
class SpeedKeys:
    """How the shaft turned: the `value` of a constant speed, or a column with pulses or with the speed."""

    value: float | None = quantity(
        "rad/s", doc="Constant spin speed.", example='"1800 rpm"', default=None, above=0.0
    )
    column: str | None = text(
        doc="Column with the key-phasor's pulses, or with the speed.", example='"kp"', default=None
    )
    unit: str | None = text(doc="Unit of a column with the speed.", example='"rpm"', default=None)
    level: float | None = quantity(
        "",
        doc="Value of the column at which a pulse counts: the column is a key-phasor.",
        example="2.5",
        default=None,
    )
    edge: str = choice(
        of=("rising", "falling"), doc="Edge of the pulse that counts.", example='"falling"', default="rising"
    )
    per_revolution: int = count(doc="Pulses per revolution.", example="60", default=1)
    angle: float | None = quantity(
        "rad",
        doc="Direction in which the key-phasor looks, from straight up in the sense of spin [default: "
        "unknown; phases are as at 0, and not compared with those of a simulation].",
        example='"45 deg"',
        default=None,
    )
    zero: str = choice(
        of=("straight_up", "pulse"),
        doc="Where the shaft's angle, and with it every phase, is 0: with the mark straight up, as in a "
        "simulation, or at the pulse, as in API 670.",
        example='"pulse"',
        default="straight_up",
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if (self.value is None) == (self.column is None):
            raise FieldError("value", 'give either value = "1800 rpm" or the column of a key-phasor or speed')
        if self.column is not None and (self.level is None) == (self.unit is None):
            fix = 'give level = 2.5 of a key-phasor, or unit = "rpm" of a speed'
            raise FieldError("column", f"is neither pulses nor a speed; {fix}")

    @property
    def is_key_phasor(self) -> bool:
        """Whether pulses give the angle of the shaft."""
        return self.level is not None


@dataclass(frozen=True, kw_only=True)
class SlowRoll:
    """Run-out to be subtracted: the mean revolution at a low speed, without its mean."""

    below: float | None = quantity(
        "rad/s",
        doc="Of the revolutions of this record below a speed.",
        example='"300 rpm"',
        default=None,
        above=0.0,
    )
    data: str | None = text(
        doc="Of another file with the same columns, in place of `below`.", example='"slow.csv"', default=None
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if (self.below is None) == (self.data is None):
            raise FieldError("below", 'give either below = "300 rpm" or data = "slow.csv"')


@dataclass(frozen=True, kw_only=True)
class SignalKeys:
    """One signal: `[signal.vertical]`, or any other name; the dataset calls it `probe_NAME` then."""

    column: str | None = text(
        doc="Its column [default: the name of the signal].", example='"y"', default=None
    )
    unit: str | None = text(
        doc="Unit of the column; of its voltage [default: V] where there is a sensitivity.",
        example='"um"',
        default=None,
    )
    sensitivity: str | None = text(
        doc="Voltage a unit of what is measured.", example='"7.87 V/mm"', default=None
    )
    gap: float | None = quantity(
        "V",
        doc="Voltage at the position 0 [default: the mean of the record, of a run-up that of its start].",
        example='"-9.8 V"',
        default=None,
    )
    node: int | None = count(doc="Node of the rotor, from 1.", example="8", default=None)
    stator: int | None = count(doc="Number of the stator, in place of a node.", example="1", default=None)
    angle: float | None = quantity(
        "rad",
        doc="Direction in which the probe stands, from straight up in the sense of spin; its signal is "
        "positive that way.",
        example='"-45 deg"',
        default=None,
    )
    quantity: str | None = text(
        doc=f"What is measured: {', '.join(PROBE_QUANTITIES)} [default: displacement].",
        example='"acceleration"',
        default=None,
    )

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True, kw_only=True, eq=False)
class Signal:
    """A signal as it is read: `value = (column - offset) * factor` in SI."""

    name: str  # of the variable
    column: str
    factor: float
    offset: float | None  # None: unknown, the mean
    about: Mapping[str, str]  # units and long_name
    probe: Mapping[str, Any] | None  # as `[[record.probe]]` of a study; None of `vertical`, ...
    node: int | None


@dataclass(frozen=True, kw_only=True)
class MeasuredKeys:
    """A measured file; the paths in it are relative to it."""

    data: tuple[str, ...] = words(
        doc="The file with the data: .csv, .txt, .parquet, .h5, .hdf5, .nc, .mat, .uff, .unv or .wav. Of "
        "several, each at its own constant speed, the speed becomes an axis.",
        example='["probe.csv"]',
        default=(),
    )
    rig: str | None = text(
        doc="A rig, whose natural frequencies and critical speeds are marked.",
        example='"mokhtar2017"',
        default=None,
    )
    samples_per_revolution: int = count(
        doc="Samples to which each revolution is resampled; even.", example="512", default=256, at_least=8
    )
    full_scale: float = quantity(
        "V",
        doc="Voltage of the largest sample of a WAV file.",
        example='"10 V"',
        default=1.0,
        above=0.0,
    )
    time: TimeKeys = table(doc="Times of the samples.", default=TimeKeys())
    speed: SpeedKeys | None = table(doc="How the shaft turned.", default=None)
    slow_roll: SlowRoll | None = table(doc="Run-out to be subtracted.", default=None)
    signals: tuple[Signal, ...] = field(default=(), metadata={"derived": True})
    file: str = field(default="", metadata={"derived": True})

    def __post_init__(self) -> None:
        check_fields(self)
        if self.samples_per_revolution % 2:
            raise FieldError("samples_per_revolution", f"{self.samples_per_revolution} is odd; add 1")
        if (
            self.slow_roll
            and self.speed
            and not (self.speed.is_key_phasor and self.speed.per_revolution == 1)
        ):
            fix = "give a key-phasor with one pulse per revolution, or leave out [slow_roll]"
            raise FieldError("slow_roll", f"needs the angle of the shaft; {fix}")


def read_keys(path: Path) -> dict[str, Any]:
    """Return the tables of a measured file; InputError where it is something else."""
    tables = read_toml(path)
    other = next((name for name in ("grid", "rotor", "stator") if name in tables), None)
    if other:
        what = "a study; give the store that it was run into" if other == "grid" else "a rig"
        raise InputError(f"{path}: [{other}]: no table of a measured file; this is {what}")
    return tables


def build_keys(tables: Mapping[str, Any], file: str) -> MeasuredKeys:
    """Return the tables of a measured file; InputError of an unknown or missing key, or a bad value."""
    rest = {key: value for key, value in tables.items() if key != "signal"}
    if isinstance(rest.get("data"), str):
        rest["data"] = [rest["data"]]
    keys = build(MeasuredKeys, rest, file)
    if keys.speed is None:
        example = '[speed] with value = "1800 rpm", or column = "kp" and level = 2.5'
        raise InputError(f"{file}: [speed]: missing; add {example}")
    given = tables.get("signal")
    if not isinstance(given, dict) or not given:
        raise InputError(f'{file}: [signal.vertical]: missing; add it with column = "y" and unit = "um"')
    signals = tuple(_signal(name, about, file) for name, about in given.items())
    return replace(keys, signals=signals, file=file)


def _signal(name: str, given: Any, file: str) -> Signal:
    """A signal from its table."""
    where = f"signal.{name}"
    keys = build(SignalKeys, given, file, where)
    is_named = name in SIGNAL_NAMES
    kind = keys.quantity or "displacement"
    if kind not in PROBE_QUANTITIES:
        fix = f"choose one of {', '.join(PROBE_QUANTITIES)}"
        raise FieldError("quantity", f'"{kind}" is not available; {fix}').within(file, where)
    unit = VARIABLES[name].unit if is_named else PROBE_QUANTITIES[kind][0]
    if is_named and keys.quantity is not None and PROBE_QUANTITIES[kind][0] != unit:
        fix = "leave the key out, or give the signal another name"
        raise FieldError("quantity", f"{name} is in {unit}, not of a {kind}; {fix}").within(file, where)
    probe = None
    if is_named:
        fixed = _ANGLES.get(name, 0.0) * math.pi
        if keys.angle is not None and abs(keys.angle - fixed) > 1e-6:
            fix = "leave the key out, or give the signal another name, such as left"
            raise FieldError(
                "angle", f"that of {name} is {180 * _ANGLES.get(name, 0.0):g} deg; {fix}"
            ).within(file, where)
        about = {"units": unit, "long_name": VARIABLES[name].long_name.replace("of the disc", "measured")}
    else:
        at = {key: value for key in ("node", "stator") if (value := getattr(keys, key)) is not None}
        try:  # without a place a probe is of the rotor
            checked = Probe(name=name, quantity=kind, angle=keys.angle or 0.0, **(at or {"node": 1}))
        except FieldError as error:
            raise error.within(file, where) from None
        probe = {"name": checked.name, "quantity": kind, "angle": checked.angle, **at}
        about = {"units": unit, "long_name": f"{PROBE_QUANTITIES[kind][1]} at the probe {name}"}
    factor, offset = _scale(keys, unit, file, where)
    return Signal(
        name=name if is_named else f"{PROBE}{name}",
        column=keys.column or name,
        factor=factor,
        offset=offset,
        about=about,
        probe=probe,
        node=keys.node,
    )


def _scale(keys: SignalKeys, unit: str, file: str, where: str) -> tuple[float, float | None]:
    """Factor from the column to SI, and the value of the column at 0; None where that is not known."""
    plain = _PLAIN.get(unit, unit)
    if keys.sensitivity is None:
        if keys.unit is None:
            fix = f'add unit = "{"um" if unit == "m" else plain}" or sensitivity = "7.87 V/mm"'
            raise InputError(f"{place(file, where)}: its unit is missing; {fix}")
        if keys.gap is not None:
            raise FieldError("gap", "is a voltage, without a sensitivity; give it").within(file, where)
        return unit_factor(keys.unit, plain, place(file, where, "unit")), 0.0
    volts = unit_factor(keys.unit or "V", "V", place(file, where, "unit"))
    at = place(file, where, "sensitivity")
    wanted = f"V/({plain})" if "/" in plain else f"V/{plain}"
    per_unit = parse_quantity(_spelled(keys.sensitivity, plain), wanted, at)
    if per_unit == 0.0:
        raise InputError(f'{at}: is 0; give one such as "7.87 V/mm"')
    absolute = unit not in ("m", "rad")
    offset = keys.gap / volts if keys.gap is not None else (0.0 if absolute else None)
    return volts / per_unit, offset


def unit_factor(unit: str, si: str, where: str) -> float:
    """Return the factor from a unit to SI; InputError where it is not one of that quantity."""
    try:
        return parse_quantity(_spelled(f"1 {unit}", si), si, where)
    except InputError:
        raise InputError(f'{where}: {brief(unit)} is not a unit of {si}; write one, as in "{si}"') from None


def _spelled(given: str, si: str) -> str:
    """A text with the units of vibration as pint spells them: a mil is a thou, g is standard gravity."""
    spelled = _MIL.sub("thou", given)
    return _GRAVITY.sub("g_0", spelled) if si == "m/s^2" else spelled
