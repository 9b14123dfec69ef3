"""The Bode plot: amplitude and phase of an order over the speed, of a run-up or of the cases of a study."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.figures.cells import degree_steps
from postproc.figures.drawing import Drawing
from postproc.figures.run_up_marks import RPM, critical_speeds, falling, written_speeds
from postproc.figures.small_multiples import overlaid
from postproc.signals.orders import order_over_speed, written_lag
from postproc.signals.spectra import default_signal
from postproc.store.run_ups import is_run_up
from postproc.store.units import short_name
from postproc.store.variables import require_results
from rubhpc.errors import InputError
from rubhpc.fem.separation_margin import response_peaks
from rubhpc.units import scale_for

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D
    from numpy.typing import NDArray

    from postproc.figures.options import Axis, Positive
    from rubhpc.fem.separation_margin import ResponsePeak

    Floats = NDArray[np.float64]

LEAST_LAG = 45.0  # degrees by which the lag grows between the half-power points of a resonance, half of 90
# Width of a peak at half power, of the root of the acceleration (Hz, from Hz/s): that of a resonance is some
# 0.9 at least, however small the damping, that of a beat 0.4 at most (half a turn of Fresnel's integral).
LEAST_WIDTH = 0.6
ROOM = 0.28  # of the width of a plot, between two peaks that are named in the same row
ROWS, LESSER = 3, 0.3  # of names above one another; height of a peak over that of one so near, at least
_FAINT = 0.45  # of a curve where the speed falls, if it rises elsewhere
_DASHES = ("-", (0, (4, 1.5)), (0, (1, 1)), (0, (4, 1, 1, 1)))  # of signals, where colours are those of cases


def bode(
    cases: xr.Dataset, signal: str | Sequence[str] = (), *, order: Positive = 1.0, over: Axis | None = None
) -> Drawing:
    """Bode plot: amplitude and phase lag of an order over the speed.

    Of a run-up by revolution, or of the cases of a study along its speeds, whose waveforms it needs. Critical
    speeds are marked; of peaks of 1X, the speed and the amplification factor (API 684), or "rub" where the
    rotor rubs within the half-power speeds: such a response is not linear and has no factor.

    Parameters
    ----------
    cases
        All axes but the speed and `over` are of one value, or selected.
    signal
        May be repeated [default: vertical].
    order
        Multiple of the spin speed; 1 is 1X.
    """
    named = (signal,) if isinstance(signal, str) else signal
    signals = tuple(dict.fromkeys(named)) or (default_signal(cases, "vertical"),)
    shown = order_over_speed(cases, signals, order, over)
    for name in signals:
        require_results(shown[f"amplitude_{name}"], cases)
    _require_one_unit(shown, signals)

    critical = critical_speeds(cases, shown["speed"])

    def draw(axes: list[Axes]) -> None:
        draw_bode(shown, signals, axes, order, critical)

    return Drawing(shown=shown, draw=draw, panels=(2, 1), height=90)


def _require_one_unit(shown: xr.Dataset, signals: Sequence[str]) -> None:
    """Check that signals share an ordinate; InputError where not."""
    units = {name: str(shown[f"amplitude_{name}"].attrs.get("units", "1")) for name in signals}
    if len(set(units.values())) > 1:
        written = ", ".join(f"{name} ({unit})" for name, unit in units.items())
        raise InputError(f"{written}: have different units; draw those of each unit in a figure of their own")


def draw_bode(
    data: xr.Dataset,
    signals: Sequence[str],
    axes: list[Axes],
    order: float = 1.0,
    critical: Sequence[float] = (),
) -> None:
    """Draw amplitude (zero to peak) and phase lag, which grows downwards; critical speeds in rad/s."""
    top, bottom = axes
    along = "revolution" if is_run_up(data) else "speed"
    speeds = data["speed"]
    ends = float(speeds.min()) * RPM, float(speeds.max()) * RPM
    unit = str(data[f"amplitude_{signals[0]}"].attrs.get("units", "1"))
    sizes = [float(np.nanmax(data[f"amplitude_{name}"].values)) for name in signals]
    scale = scale_for(unit, max(sizes))
    is_sparse = data.sizes[along] < 40
    over = next((dim for dim in data[f"amplitude_{signals[0]}"].dims if dim != along), None)
    style: dict[str, Any] = {"marker": "." if is_sparse else "", "markersize": 4, "linewidth": 0.8}
    n_case = data.sizes[over] if over else 1
    if n_case > 1 and len(signals) > len(_DASHES):
        raise InputError(f"{len(signals)} signals of several cases cannot be distinguished; select one case")
    is_swept, has_fallen = along == "revolution", False
    peaks: list[tuple[ResponsePeak, Line2D, bool]] = []
    for i_signal, name in enumerate(signals):
        amplitude, phase = data[f"amplitude_{name}"], data[f"phase_{name}"]
        touch = data.get("contact_fraction", 0.0 * speeds)
        before: tuple[Floats, Floats] | None = None
        curves = overlaid(along, amplitude, phase, speeds, touch.fillna(0.0))
        for i_case, (case, height, lead, own_speeds, touches) in enumerate(curves):
            rpm = own_speeds.values * RPM
            own = name.removeprefix("probe_").replace("_", " ") if len(signals) > 1 else None
            label = ", ".join(text for text in (own, case) if text) or None
            if n_case > 1:
                style |= {"color": f"C{i_case}", "linestyle": _DASHES[i_signal]}
            size, lag = height.values * scale.factor, written_lag(lead.values, rpm, before)
            before = rpm, lag
            back = falling(rpm) if is_swept else np.zeros(rpm.size, dtype=bool)
            (curve,) = top.plot(rpm, np.where(back, np.nan, size), label=label, **style)
            bottom.plot(rpm, np.where(back, np.nan, lag), **style)
            if back.any():
                faint: dict[str, Any] = style | {"color": curve.get_color(), "alpha": _FAINT}
                top.plot(rpm, np.where(back, size, np.nan), **faint)
                bottom.plot(rpm, np.where(back, lag, np.nan), **faint)
                has_fallen = True
            for way in (~back, back) if order == 1.0 else ():
                at = own_speeds.values[way]
                for peak in peaks_of(at, size[way], lag[way], is_swept):
                    low, high = peak.half_power_speeds
                    rubs = touches.values[way][(at >= low) & (at <= high)] > 0.0
                    peaks.append((peak, curve, bool(rubs.any())))
    shown = [signal_name(data[f"amplitude_{signals[0]}"])] if len(signals) == 1 else []
    top.set_title(", ".join([*shown, written_order(order)]), fontsize=8)
    top.set(ylabel=scale.label("Amplitude, 0\N{EN DASH}peak"), xlim=ends)
    top.set_ylim(bottom=0.0)
    _name_peaks(top, peaks)
    is_lost = not any(np.isfinite(line.get_ydata()).any() for line in bottom.lines)
    if has_fallen:
        top.plot([], [], color="k", alpha=_FAINT, linewidth=0.8, label="speed falls")
    for i, speed in enumerate(critical):
        line: dict[str, Any] = {"color": "0.6", "linewidth": 0.6, "linestyle": (0, (4, 3)), "zorder": 0.5}
        top.axvline(speed * RPM, label=None if i else written_speeds(critical), **line)
        bottom.axvline(speed * RPM, **line)
    if len(signals) * n_case > 1 or critical or has_fallen:
        place: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.2), "ncols": 2}
        bottom.legend(*top.get_legend_handles_labels(), fontsize=6, frameon=False, **place)
    bottom.set(xlabel="Spin speed (rpm)", ylabel="Phase lag (\N{DEGREE SIGN})")
    if is_lost:
        _name_lost_phase(bottom, written_order(order))
    else:
        bottom.invert_yaxis()
        bottom.yaxis.set_major_locator(degree_steps(bottom))
    bottom.ticklabel_format(axis="x", style="plain", useOffset=False)
    top.figure.align_ylabels(axes)


def _name_lost_phase(ax: Axes, order: str) -> None:
    """Say in the panel of the phase why it is empty."""
    ax.set_yticks([])
    words = f"{order} is none, or lost in other motion: no phase"
    ax.text(0.5, 0.5, words, transform=ax.transAxes, ha="center", va="center", fontsize=6, color="0.35")


def peaks_of(speed: Floats, height: Floats, lag: Floats, is_swept: bool = False) -> list[ResponsePeak]:
    """Resonances of an amplitude (n,) with a lag (n,), degrees, over rising or falling speeds (n,), rad/s.

    The amplitude falls to 0.707 of a peak on both sides, and the lag grows by `LEAST_LAG` between these.
    Where the speed `is_swept`, one value a revolution, beats with what rings behind a resonance are left out.
    """
    rate = abs(np.gradient(speed)) if speed.size > 1 else np.zeros(speed.size)
    least = LEAST_WIDTH * np.sqrt(rate * speed) if is_swept else np.zeros(speed.size)
    known = np.isfinite(speed) & np.isfinite(height) & (rate > 1e-9 * speed)  # not where the speed is held
    speed, height, lag, least = speed[known], height[known], lag[known], least[known]
    steps = np.diff(speed)
    if speed.size < 3 or not (np.all(steps > 0.0) or np.all(steps < 0.0)):
        return []
    rising = np.argsort(speed)
    speed, height, lag, least = speed[rising], height[rising], lag[rising], least[rising]
    found = []
    for peak in response_peaks(lambda at: float(np.interp(at, speed, height)), speed):
        below, above = np.interp(peak.half_power_speeds, speed, lag)
        is_wide = np.ptp(peak.half_power_speeds) >= np.interp(peak.speed, speed, least)
        if is_wide and above - below >= LEAST_LAG:  # not so where one of them is unknown
            found.append(peak)
    return found


def _name_peaks(ax: Axes, peaks: Sequence[tuple[ResponsePeak, Line2D, bool]]) -> None:
    """Write speed (rpm) and amplification factor, or "rub", at peaks, from the highest, where there is room.

    The words are above all curves, in the colour of their own; those of near peaks are above one another.
    """
    taken: list[tuple[float, float, int]] = []  # speed, height and row of each
    room, curves = ROOM * np.ptp(ax.get_xlim()), [np.asarray(line.get_data()) for line in ax.lines]
    for peak, line, rubs in sorted(peaks, key=lambda named: -named[0].amplitude):
        rpm = RPM * peak.speed
        near = [(height, row) for other, height, row in taken if abs(rpm - other) < room]
        row = 1 + max((row for _, row in near), default=-1)
        if row == ROWS or any(peak.amplitude < LESSER * height for height, _ in near):
            continue
        words = f"{rpm:.0f} rpm, " + ("rub" if rubs else f"AF {peak.amplification_factor:.3g}")
        if any(words == text.get_text() for text in ax.texts):  # on the way down as on the way up
            continue
        top = max(float(np.nanmax(y[abs(x - rpm) < 0.6 * room], initial=peak.amplitude)) for x, y in curves)
        top = max([top, *(height for height, _ in near)])
        taken.append((rpm, top, row))
        share = (rpm - ax.get_xlim()[0]) / np.ptp(ax.get_xlim())
        side = "left" if share < 0.5 * ROOM else "right" if share > 1.0 - 0.5 * ROOM else "center"
        place: dict[str, Any] = {"xytext": (0, 2 + 8 * row), "textcoords": "offset points", "ha": side}
        behind = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}
        ax.annotate(words, (rpm, top), va="bottom", fontsize=6, color=line.get_color(), bbox=behind, **place)
        ax.set_ylim(top=max(ax.get_ylim()[1], (1.2 + 0.1 * row) * top))


def signal_name(amplitude: xr.DataArray) -> str:
    """Name of the signal whose amplitude this is."""
    text = str(amplitude.attrs.get("long_name", "")).removeprefix("amplitude of the ")
    signal = str(amplitude.name).removeprefix("amplitude_")
    return short_name(amplitude.rename(signal).assign_attrs(long_name=text or signal))


def written_order(order: float) -> str:
    """An order as engineers write it: 1X, 1/2X, 2X."""
    near = Fraction(order).limit_denominator(8)
    return f"{near}X" if abs(order - near) * near.denominator < 1e-3 else f"{order:.3g}X"
