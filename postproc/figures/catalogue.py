"""The figures of a store, one function each: what the figure commands and `store.rub` share.

Each takes cases (`postproc.store.select`) and the words of its command, and returns a `Drawing`: what is
shown, and how it is drawn.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import xarray as xr

from postproc.store.axes import drawn_axes, find_axis, source
from rubhpc.errors import InputError
from rubhpc.study.axes import DIRECTION
from rubhpc.study.sampling import CASE

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from matplotlib.axes import Axes

FORMS = ("waterfall", "intensity")
CONTACT = ("masked", "kept")


@dataclass(frozen=True, kw_only=True)
class Drawing:
    """A figure that is still to be drawn.

    Attributes
    ----------
    shown : Dataset
        What `--data` writes; what holds for all of it is the figure's caption.
    draw : callable
        Draws on `n_row * n_column` axes, row by row.
    height, width : float, optional
        mm; by default as `postproc.figures.style.new_figure` has them.
    notes : tuple of str
        What a user should know of what is shown.
    found : Dataset
        What `shown` is a part of.
    """

    shown: xr.Dataset
    draw: Callable[[list[Axes]], Any]
    n_row: int = 1
    n_column: int = 1
    height: float | None = None
    width: float | None = None
    notes: tuple[str, ...] = ()
    found: xr.Dataset = field(default_factory=xr.Dataset)


def cascade(
    cases: xr.Dataset,
    signal: str = "torsion",
    *,
    full: bool = False,
    along: str | None = None,
    form: str = "waterfall",
    max_frequency: float | str | None = None,
    max_order: float = 5.0,
    orders: bool = False,
    order_lines: str = "1/3,1/2,2/3,1,3/2,2,3",
    mark: Mapping[str, float | str] | None = None,
) -> Drawing:
    """Spectra along an axis, with order lines and natural frequencies."""
    from postproc.figures import cascade_figure
    from postproc.signals.cascade import below
    from postproc.signals.cascade import cascade as gather
    from postproc.signals.lines import parse_orders
    from postproc.store.rig_of_case import natural_frequencies

    _choose(form, FORMS, "form")
    lines = parse_orders(order_lines, "--order-lines")
    spectra = gather(cases, "whirl" if full else signal, along)
    frequencies: dict[str, Any] = dict(natural_frequencies(cases, str(spectra.dims[0])))
    if spectra.name == "spectrum_whirl":  # lateral motion alone
        frequencies.pop("torsional", None)
    for name, value in (mark or {}).items():
        frequencies[name] = _hertz(value, f"--mark {name}")
    abscissa = "order" if orders else "frequency"
    limit = max_order if orders else cascade_figure.default_limit(spectra, frequencies)
    if max_frequency is not None and not orders:
        limit = _hertz(max_frequency, "--max-frequency")

    def draw(axes: list[Axes]) -> None:
        is_waterfall = form == "waterfall"
        picture = cascade_figure.waterfall if is_waterfall else cascade_figure.intensity
        picture(spectra, axes[0], limit, abscissa)
        cascade_figure.draw_orders(axes[0], spectra, lines, abscissa, "0.35" if is_waterfall else "0.8")
        colour = "C1" if is_waterfall else "#56B4E9"
        cascade_figure.draw_frequencies(axes[0], spectra, frequencies, abscissa, colour)

    shown = below(spectra, limit, abscissa).to_dataset(name=str(spectra.name))
    return Drawing(shown=shown, draw=draw, height=80)


def map_of(
    cases: xr.Dataset,
    value: str = "peak_contact_force",
    *,
    x: str | None = None,
    y: str | None = None,
    facet: str | Sequence[str] = (),
    contours: int | None = None,
    log: bool = False,
) -> Drawing:
    """A measure, the regime or the status over two axes, or points over two quantities that were drawn.

    In small multiples over up to two more axes.
    """
    from postproc.cases.maps import default_axes, facet_axes, map_data
    from postproc.figures.map_figure import value_maps
    from postproc.figures.scatter import scatter_axes, scatter_maps
    from postproc.store.select import first_of_rest

    is_sample = bool(drawn_axes(cases))
    if is_sample and contours:
        raise InputError(f"{source(cases)}: map: points of a sample have no contours; leave --contours out")
    across, up = scatter_axes(cases, x, y) if is_sample else default_axes(cases, x, y, _several(facet))
    spread = [CASE] if is_sample else [across, up]
    facets = facet_axes(cases, _several(facet), spread)
    cases, notes = first_of_rest(cases, [*spread, *facets], value)
    shown = map_data(cases, value, spread, facets)

    def draw(axes: list[Axes]) -> None:
        if is_sample:
            scatter_maps(shown, value, across, up, axes, log)
        else:
            value_maps(shown, value, axes, log, contours or 0)

    n_row, n_column = ([1, 1] + [shown.sizes[axis] for axis in facets])[-2:]
    height, width = (30.0 + 45.0 * n_row, 180.0) if facets else (75.0, None)
    return Drawing(
        shown=shown,
        draw=draw,
        n_row=n_row,
        n_column=n_column,
        height=height,
        width=width,
        notes=tuple(notes),
    )


def orbit(cases: xr.Dataset, *, revolutions: int | None = None, over: str | None = None) -> Drawing:
    """Orbit of the disc with the clearance and the stators, or those along the axis `over`."""
    from postproc.figures.orbit import orbit as picture
    from postproc.figures.orbit import orbit_data

    shown = orbit_data(cases, revolutions, over)
    return Drawing(shown=shown, draw=lambda axes: picture(shown, axes[0]), height=80)


def spectrum(
    cases: xr.Dataset,
    signal: str = "torsion",
    *,
    full: bool = False,
    orders: bool = False,
    max: float | None = None,  # noqa: A002 - the word of the command
    lines: int = 6,
    log: bool = False,
    over: str | None = None,
) -> Drawing:
    """Spectrum of a signal or of the whirl, its strongest lines named."""
    from postproc.figures.spectrum_figure import default_limit
    from postproc.figures.spectrum_figure import spectrum as picture
    from postproc.signals.lines import strongest_lines
    from postproc.signals.spectra import spectrum_data

    shown = spectrum_data(cases, "whirl" if full else signal, over).compute()
    abscissa = "order" if orders else "frequency"
    limit = max or default_limit(shown, abscissa)
    found = strongest_lines(shown, lines) if over is None and lines else None
    notes = []
    if found is not None:
        columns = (found[n].values for n in ("name", "frequency", "amplitude"))
        unit = shown.attrs["units"]
        notes = [f"{name:>8} {f:10.3f} Hz  {a:.4e} {unit}" for name, f, a in zip(*columns, strict=True)]
    return Drawing(
        shown=shown.to_dataset(name=str(shown.name)),
        draw=lambda axes: picture(shown, axes[0], found, abscissa, limit, log),
        notes=tuple(notes),
    )


def waveform(
    cases: xr.Dataset, signal: str | Sequence[str] = (), *, revolutions: int = 4, over: str | None = None
) -> Drawing:
    """Signals over the last revolutions in panels above one another, contact shaded."""
    from postproc.figures.waveform import DEFAULT_SIGNALS, panels, waveform_data

    signals = tuple(dict.fromkeys(_several(signal))) or DEFAULT_SIGNALS
    shown = waveform_data(cases, signals, revolutions, over)
    return Drawing(shown=shown, draw=lambda axes: panels(shown, axes), n_row=len(signals))


def section(
    cases: xr.Dataset, x: str = "horizontal", y: str = "vertical", *, over: str | None = None
) -> Drawing:
    """Poincaré section in the plane of two signals, or of signal `y` along the axis `over`."""
    from postproc.figures.bifurcation import bifurcation as along_axis
    from postproc.figures.bifurcation import bifurcation_data
    from postproc.figures.section import plane, section_data

    shown = bifurcation_data(cases, y, find_axis(cases, over)) if over else section_data(cases, [x, y])
    return Drawing(
        shown=shown,
        draw=lambda axes: along_axis(shown, y, axes[0], None) if over else plane(shown, x, y, axes[0]),
    )


def bifurcation(
    cases: xr.Dataset, signal: str = "vertical", *, along: str | None = None, color: str | None = None
) -> Drawing:
    """Section points of a signal over an axis, coloured by regime, period or direction of the sweep."""
    from postproc.figures.bifurcation import (
        COLORINGS,
        WIDTH,
        bifurcation_data,
        default_axis,
        default_coloring,
    )
    from postproc.figures.bifurcation import bifurcation as picture
    from postproc.figures.section import section_of
    from postproc.store.select import first_of_rest

    if color is not None:
        _choose(color, COLORINGS, "color")
    coloring = default_coloring(cases, color)
    axis = default_axis(cases, along)
    over = coloring if coloring == DIRECTION else None
    name = f"section_{signal}"
    kept = [axis] if over is None else [axis, over]
    cases, notes = first_of_rest(cases.assign({name: section_of(cases, signal)}), kept, name)
    shown = bifurcation_data(cases, signal, axis, over)
    return Drawing(
        shown=shown,
        draw=lambda axes: picture(shown, signal, axes[0], coloring),
        height=90,
        width=WIDTH,
        notes=tuple(notes),
    )


def hht(
    cases: xr.Dataset,
    signal: str = "torsion",
    *,
    contact: str | None = None,
    revolutions: int = 4,
    mode: int = 1,
    max_frequency: float | str | None = None,
) -> Drawing:
    """Hilbert-Huang analysis of a signal: its energy over time and frequency, contact shaded."""
    from postproc.figures.hilbert_huang_figure import panels
    from postproc.signals.hilbert_huang import hilbert_huang
    from postproc.store.rig_of_case import natural_frequencies, stator_frequencies

    if contact is not None:
        _choose(contact, CONTACT, "contact")
    limit = None if max_frequency is None else _hertz(max_frequency, "--max-frequency")
    shown = hilbert_huang(cases, signal, contact=contact, revolutions=revolutions, n_mode=mode)
    natural: dict[str, Any] = {}
    if signal == "stator_lateral":
        natural = {"stator": stator_frequencies(cases)["lateral"]}
    elif not signal.startswith(("stator", "contact")):
        kind = "torsional" if signal.startswith("torsion") else "lateral"
        natural = {name: f for name, f in natural_frequencies(cases).items() if name == kind}
    known = {name: float(f) for name, f in natural.items()}
    return Drawing(shown=shown, draw=lambda axes: panels(shown, axes, limit, known, mode), n_row=2, height=85)


def indicators(
    cases: xr.Dataset,
    *,
    noise: Sequence[float] = (),
    draws: int = 3,
    false_alarms: float = 0.05,
    seed: int = 1,
) -> Drawing:
    """How often the vibration tells rub from no rub, under measurement noise."""
    from postproc.cases.detection import judge
    from postproc.figures.detection_figure import panels
    from postproc.signals.indicators import LEVELS, indicator_scores

    levels = tuple(sorted(set(noise))) or LEVELS
    judged = judge(indicator_scores(cases, levels, draws, seed), false_alarms, seed)
    return Drawing(
        shown=judged[["detection_rate", "false_alarm_rate", "area_under_curve"]],
        draw=lambda axes: panels(judged, axes),
        n_row=2,
        height=110,
        found=judged,
    )


def sensitivity(
    cases: xr.Dataset,
    scalar: str = "peak_contact_force",
    *,
    confidence: float = 0.95,
    draws: int = 500,
    seed: int = 1,
) -> Drawing:
    """Sobol indices of a measure over the axes of the study, with intervals."""
    from postproc.cases.sensitivity import sensitivity as indices_of
    from postproc.figures.sensitivity_figure import bars, height

    found = indices_of(cases, scalar, n_draw=draws, confidence=confidence, seed=seed)
    return Drawing(shown=found, draw=lambda axes: bars(found, axes[0]), height=height(found))


def _choose(word: str, offered: Sequence[str], option: str) -> None:
    if word not in offered:
        raise InputError(f'{option}: "{word}" is none of {", ".join(offered)}')


def _several(names: str | Sequence[str]) -> tuple[str, ...]:
    return (names,) if isinstance(names, str) else tuple(names)


def _hertz(value: float | str, option: str) -> float:
    """Return a frequency above 0, Hz, of a number or a text with or without a unit."""
    from rubhpc.input.quantity import parse_quantity

    with suppress(ValueError):  # text with a unit
        value = float(value)
    hertz = parse_quantity(value, "Hz", option)
    if hertz <= 0:
        raise InputError(f"{option}: {hertz:g} Hz is out of range; give one above 0")
    return hertz
