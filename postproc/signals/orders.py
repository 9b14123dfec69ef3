"""Amplitude and phase of an order of the spin over the speed: of a run-up, or of the cases of a study."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from postproc.signals.spectra import check_signal, samples_per_revolution
from postproc.store.axes import axes_of, find_axis, refusal
from postproc.store.run_ups import is_run_up
from postproc.store.select import narrow
from rubhpc.errors import InputError
from rubhpc.study.axes import SPEED_AXES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

WHOLE = 0.02  # of a revolution: by how much an order may miss a whole number of periods of a record
NEAR = 1e-3  # of an order, within which a run-up follows it
JUMP = 0.25 * np.pi  # rad a revolution, faster than the phase of an order of a window of six goes
WINDOW = 6  # revolutions over which orders of a run-up are taken (`spectra.track_orders`)
SILENT = 1e-9  # of the largest amplitude of a signal, below which it is rounding and has no phase
NOTHING = 1e-15  # the same where the largest is no more, in the SI unit of the signal
AROUND = 4  # revolutions on either side of a jump in which there is no phase
_FIRST_LAG = 120.0  # degrees


def order_over_speed(
    store: xr.Dataset, signals: Sequence[str], order: float = 1.0, over: str | None = None
) -> xr.Dataset:
    """Return the amplitude (zero to peak) and phase of an order over the spin speed, loaded.

    Parameters
    ----------
    store : Dataset
        Of `rubhpc.run_up`, a store of run-ups, or one with an axis of speeds and waveforms, in which axes but
        this and `over` have been selected.
    order : float
        Multiple of the spin frequency.
    over : str, optional
        An axis along which the cases are to be kept.

    Returns
    -------
    Dataset
        `amplitude_NAME` in the unit of the signal and `phase_NAME`, rad, by which it leads the order of the
        shaft's angle, unwrapped, over `speed` (rad/s), rising, and `over`; of run-ups over `revolution`, with
        `speed` as a variable. Where the phase of a run-up jumps, the order is lost in other motion, and the
        phase is NaN; so are both at its ends, in revolutions that have the window of a later or earlier one.
        Where there is no more of the order than rounding, it has no phase either. `contact_fraction`, where
        it is known, is the largest of the stators.

    Raises
    ------
    InputError
        There is no axis of speeds, no such signal, or the record does not hold whole periods of the order.
    """
    for signal in signals:
        check_signal(signal, store)
    if is_run_up(store):
        along, found = "revolution", _of_run_up(store, signals, order, over)
    else:
        along, found = "speed", _of_cases(store, signals, order, over).sortby("speed")
    for signal in signals:
        phase, size = found[f"phase_{signal}"], found[f"amplitude_{signal}"].values
        silent = max(SILENT * float(np.nanmax(size, initial=0.0)), NOTHING)
        values = np.where(size > silent, phase.values, np.nan)
        if along == "revolution":
            values = np.apply_along_axis(_without_jumps, phase.get_axis_num(along), values)
        unwrapped = np.apply_along_axis(_unwrap, phase.get_axis_num(along), values)
        known = unwrapped[np.isfinite(unwrapped)]
        turns = round(float(known.mean()) / (2 * np.pi)) if known.size else 0
        found[f"phase_{signal}"] = phase.copy(data=unwrapped - 2 * np.pi * turns)
    found["speed"].attrs |= {"units": "rad s-1", "long_name": "spin speed"}
    return found


def written_lag(lead: Floats, speed: Floats, before: tuple[Floats, Floats] | None = None) -> Floats:
    """Return the lag, degrees, of a phase that leads (n,), rad, less whole turns.

    From one stretch of known phase to the next these are unknown: each stretch is drawn near the curve drawn
    `before`, of which speed and lag are given. Without one the lag at the lowest speed is from -60 to 300.
    """
    lag = -np.degrees(lead)
    known = np.flatnonzero(np.isfinite(lag) & np.isfinite(speed))
    if not known.size:
        return lag
    if before is None or not np.isfinite(before[1]).any():
        slowest = lag[known[speed[known].argmin()]]
        found: Floats = lag - 360.0 * np.round((slowest - _FIRST_LAG) / 360.0)
        return found
    at, other = (values[np.isfinite(before[1])] for values in before)
    rising = np.argsort(at)
    for stretch in np.split(known, np.flatnonzero(np.diff(known) > 1) + 1):
        apart = lag[stretch] - np.interp(speed[stretch], at[rising], other[rising])
        lag[stretch] -= 360.0 * np.round(np.median(apart) / 360.0)
    return lag


def _unwrap(phase: Floats) -> Floats:
    """Unwrap a phase (rad) over the values that there are: a diverged case has none."""
    found = phase.copy()
    finite = np.isfinite(phase)
    found[finite] = np.unwrap(phase[finite])
    return found


def _without_jumps(phase: Floats) -> Floats:
    """A phase (n_revolution,), rad, with NaN around its jumps."""
    step = np.angle(np.exp(1j * np.diff(phase)))
    jumps = (np.abs(step) > JUMP).astype(float)
    near = np.convolve(jumps, np.ones(2 * AROUND), mode="full")[AROUND - 1 : AROUND + phase.size - 1]
    return np.where(near > 0.5, np.nan, phase)


def _of_run_up(store: xr.Dataset, signals: Sequence[str], order: float, over: str | None) -> xr.Dataset:
    near = np.flatnonzero(np.abs(store["order"].values - order) < NEAR)
    if not near.size:
        followed = ", ".join(f"{value:.4g}" for value in store["order"].values)
        raise InputError(f"order: {order:g} is not followed in this run-up; choose one of {followed}")
    names = [f"{what}_{signal}" for signal in signals for what in ("amplitude", "phase")]
    for name in names:
        if name not in store:
            known = ", ".join(
                str(n).removeprefix("phase_") for n in store.data_vars if str(n).startswith("phase_")
            )
            raise InputError(f"{name.split('_', 1)[1]}: no order of it is followed; choose one of {known}")
    store, others = _with_contact(store, ["revolution_contact_fraction", "contact_fraction"])
    store = narrow(store, [*names, "speed", *others], [find_axis(store, over)] if over else [])
    rows = store.isel(order=int(near[0]))
    rows = rows.drop_vars(["order", "stator"], errors="ignore").load()
    turn, last = np.arange(rows.sizes["revolution"]), rows["speed"].notnull().sum("revolution")
    within = xr.DataArray(turn, dims="revolution")
    is_own = (within >= WINDOW // 2) & (within <= last - (WINDOW - WINDOW // 2))
    return rows.assign({name: rows[name].where(is_own | (last <= WINDOW)) for name in names})


def _with_contact(store: xr.Dataset, names: Sequence[str]) -> tuple[xr.Dataset, list[str]]:
    """Return the store with the largest `contact_fraction` of its stators, and that name; [] if unknown."""
    shares = [store[name] for name in names if name in store]
    if not shares:
        return store, []
    largest = shares[0].max([dim for dim in ("stator",) if dim in shares[0].dims])
    return store.assign(contact_fraction=largest), ["contact_fraction"]


def _of_cases(store: xr.Dataset, signals: Sequence[str], order: float, over: str | None) -> xr.Dataset:
    along = next((axis for axis in axes_of(store) if axis in SPEED_AXES), None)
    if along is None or store.sizes[along] < 2:
        raise refusal(store, "bode needs an axis of several speeds; give another store")
    spread = [along, *([find_axis(store, over)] if over else [])]
    store, touched = _with_contact(store, ["contact_fraction"])
    data = narrow(store, [*signals, *touched, "spin_speed"], spread).load()
    variables: dict[str, Any] = {name: data[name] for name in touched}
    for signal in signals:
        n = samples_per_revolution(data[signal])
        turns = data.sizes["sample"] // n
        if abs(turns * order - round(turns * order)) > WHOLE:
            problem = f"{turns} revolutions hold no whole number of periods of order {order:g}"
            raise refusal(store, f"{problem}; record a multiple of its period")
        dims = [dim for dim in data[signal].dims if dim != "sample"]
        rows = data[signal].transpose(*dims, "sample").values.astype(float)
        turning = np.exp(-2j * np.pi * order / n * np.arange(rows.shape[-1]))
        lines = rows @ turning * (2.0 / rows.shape[-1])
        about = data[signal].attrs
        variables[f"amplitude_{signal}"] = (dims, np.abs(lines), {**about})
        variables[f"phase_{signal}"] = (dims, np.angle(lines), {"units": "rad", "long_name": "phase"})
    speed = data["spin_speed"]
    if speed.dims != (along,):
        problem = f"the speeds depend on {', '.join(str(d) for d in speed.dims if d != along)} too"
        raise refusal(store, f"{problem}; select one value of it")
    coords = {name: at for name, at in data.coords.items() if "sample" not in at.dims and name != "speed"}
    found = xr.Dataset(variables, coords=coords)
    found = found.assign_coords(speed=(along, speed.values))
    return found if along == "speed" else found.swap_dims({along: "speed"})
