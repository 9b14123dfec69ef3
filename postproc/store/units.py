"""Display of SI quantities: the prefix that suits the size, and axis labels with their unit."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from rubhpc.schema import PROBE
from rubhpc.units import RPM, scale_for

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from rubhpc.units import Scale

# Names for axes, where a long name does not fit, and symbols of the paper.
_SHORT = {
    "vertical": "Vertical displacement",
    "horizontal": "Horizontal displacement",
    "torsion_acceleration": "Torsional acceleration",
    "stator_axial": "Stator axial displacement",
    "stator_lateral": "Stator lateral displacement",
    "torsion_velocity": "Torsional velocity",
    "speed_ratio": "Speed ratio $r$",
    "speed": "Spin speed",
    "last_speed": "Last spin speed",
    "clearance_ratio": "Clearance ratio $c_g$",
    "friction": "Friction coefficient",
    "stator_youngs_modulus": "Stator modulus $E_s$",
    "initial_vertical": "Initial vertical displacement",
    "initial_horizontal": "Initial horizontal displacement",
    "initial_impulse": "Impulse",
    "initial_impulse_angle": "Angle of the impulse",
    "initial_impulse_node": "Node of the impulse",
    "order": "Order (multiples of spin speed)",
    "tip_deflection_ratio": "Tip deflection over length",
    "foreshortening_ratio": "Foreshortening over compression",
    "force_over_euler_load": "Contact force over Euler load",
    "force_over_strength": "Contact force over stator strength",
    "bearing_clearance_ratio": "Displacement over bearing clearance",
    "largest_multiplier": "Modulus of the largest multiplier",
    "multiplier_angle": "Angle of the largest multiplier",
    "stick_fraction": "Fraction of contact without slip",
    "settled": "Settled before the record",
    "left_closed_form": "Changes to collocation",
    "carrier_displacement": "Peak carrier displacement",
    "modal_error": "Error by modes left out",
    "peak_to_peak_vertical": "Vertical peak to peak",
    "peak_to_peak_horizontal": "Horizontal peak to peak",
    "contact_impulse": "Impulse per revolution",
    "friction_work": "Friction work per revolution",
    "minimum_slip_speed": "Lowest slip speed",
    "period": "Period (revolutions)",
    "energy_residual": "Energy balance residual",
}
# Names that say as much as their long names.
_PLAIN = (
    *("case", "clearance", "contact_duration", "contact_force", "contact_iterations", "contact_residual"),
    *("direction", "frequency", "horizontal_velocity", "initial_horizontal_velocity"),
    *("initial_vertical_velocity", "lyapunov_exponent", "normal_angle", "peak_torsion", "regime"),
    *("revolution", "spin_speed", "status", "time", "torsion", "validity", "vertical_velocity", "wall_time"),
    *("whirl", "whirl_ratio"),
)
_OF_SPECTRA = "amplitude (zero to peak) of the "
_SYMBOLS = {
    "speed_ratio": "r",
    "speed": r"\omega",
    "spin_speed": r"\omega",
    "clearance_ratio": "c_g",
    "clearance": "g",
    "friction": r"\mu",
    "stator_youngs_modulus": "E_s",
}


_RATIOS = {
    "speed_ratio": "$r$: spin speed over first lateral frequency",
    "clearance_ratio": "$c_g$: clearance over contact-free amplitude",
}
_SPEEDS = ("speed", "spin_speed", "last_speed", "drive_start")
_CAPTION_WIDTH = 56  # characters that a column takes
_MARKUP = re.compile(r"[$\\_]")  # of symbols, which takes no room


def scale_of(data: xr.DataArray) -> Scale:
    """Return the scale that suits the largest finite magnitude in `data`; speeds are read in rpm."""
    if data.name in _SPEEDS:
        return RPM
    values = np.abs(np.asarray(data.values, dtype=float))
    finite = values[np.isfinite(values)]
    size = float(finite.max()) if finite.size else 0.0
    return scale_for(str(data.attrs.get("units", "1")), size)


def displayed(data: xr.DataArray) -> tuple[NDArray[np.float64], str]:
    """Return the values in their display unit and the label of their axis."""
    scale = scale_of(data)
    return np.asarray(data.values, dtype=float) * scale.factor, scale.label(short_name(data))


def meanings(axis: xr.DataArray) -> list[str]:
    """Return what the values 0, 1, ... of an axis mean, as up and down; none where they are quantities."""
    return str(axis.attrs.get("flag_meanings", "")).split()


def in_words(flag: str) -> str:
    """Return a value of a flag as a text has it: "quasi-periodic", "no contact"."""
    return flag.replace("quasi_", "quasi-").replace("_", " ")


def short_name(data: xr.DataArray) -> str:
    """Return a name of the quantity that fits an axis at column width."""
    name = str(data.name).removeprefix("spectrum_").removeprefix("section_")
    text = _SHORT.get(name, name.replace("_", " ") if name in _PLAIN else "")
    if name.startswith(PROBE):
        text = str(data.attrs.get("long_name", name)).removeprefix(_OF_SPECTRA)
        text = text.replace(" the probe ", " ").replace("_", " ")
    if text and (of_stators := data.attrs.get("of_stators")):
        text = f"{text}, {of_stators}"
    text = text or str(data.attrs.get("long_name", name.replace("_", " ")))
    return text[:1].upper() + text[1:]


def written_value(coordinate: xr.DataArray) -> str:
    """Write one setting as a caption does: `$r$ = 1.7`, `$g$ = 84 µm`."""
    name, value = str(coordinate.name), float(coordinate.values)
    if names := meanings(coordinate):
        return f"{name.replace('_', ' ')} {names[int(value)]}"
    unit = str(coordinate.attrs.get("units", "1"))
    if name.endswith("angle") and unit == "rad":
        return f"{name.replace('_', ' ')} = {math.degrees(value):.4g}°"
    scale = RPM if name in _SPEEDS else scale_for(unit, abs(value))
    symbol = f"${_SYMBOLS[name]}$" if name in _SYMBOLS else name.replace("run_up", "run-up").replace("_", " ")
    text = f"{symbol} = {plain_number(value * scale.factor)} {scale.unit}".rstrip()
    return f"{text} ({of_stators})" if (of_stators := coordinate.attrs.get("of_stators")) else text


def plain_number(value: float, digits: int = 4) -> str:
    """Write a number to so many digits, up to a million without an exponent: 10000, 12.35."""
    is_long = 10**digits - 0.5 <= abs(value) < 1e6
    return f"{value:.0f}" if is_long else f"{value:.{digits}g}"


def caption(data: xr.DataArray | xr.Dataset, further: Iterable[str] = ()) -> str:
    """Return what holds for all of `data`, in lines that fit a column.

    That is its scalar coordinates, the places of its signals (their attribute `place`), `further` texts, and
    what the ratios among its coordinates are.
    """
    scalars = [c for c in data.coords.values() if c.ndim == 0 and c.dtype.kind in "fiu"]
    known = list(_SYMBOLS)
    scalars.sort(key=lambda c: (known.index(c.name) if c.name in known else len(known), str(c.name)))
    signals = [data] if isinstance(data, xr.DataArray) else data.data_vars.values()
    places = dict.fromkeys(str(signal.attrs["place"]) for signal in signals if "place" in signal.attrs)
    ratios = (text for name, text in _RATIOS.items() if name in data.coords)
    lines: list[str] = []
    for part in (*map(written_value, scalars), *places, *further, *ratios):
        if lines and len(_MARKUP.sub("", f"{lines[-1]}, {part}")) <= _CAPTION_WIDTH:
            lines[-1] = f"{lines[-1]}, {part}"
        else:
            lines.append(part)
    return ",\n".join(lines)
