"""The figure commands: one figure each from a store, with its data as an option."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rubhpc.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from matplotlib.axes import Axes

    Draw = Callable[[list[Axes]], Any]

_SIGNAL = click.option("--signal", default="torsion", show_default=True, help="Which recorded signal.")
_ORDERS = click.option("--orders", "is_order", is_flag=True, help="Draw over orders instead of Hz.")
_OVER = click.option("--over", metavar="AXIS", help="Draw the cases along AXIS over one another.")
_REVOLUTIONS = click.IntRange(min=1)


def _of_store(function: Callable[..., None]) -> Callable[..., None]:
    """Add what every figure command takes: the store, a selection, and where figure and data go."""
    for decorate in (
        click.option("--data", metavar="FILE", help="Write the data too: .csv, .json, .zarr or .nc."),
        click.option("--figure", metavar="FILE", help=".png, .pdf or .svg [default: STORE_COMMAND.png here]"),
        click.option(
            "--select",
            "selection",
            multiple=True,
            metavar="AXIS=VALUE",
            help='Such as speed_ratio=1.7, clearance="84 um", friction=0.1,0.3 or speed_ratio=1..2.',
        ),
        click.argument("store"),
    ):
        function = decorate(function)
    return function


@click.command()
@_of_store
@_SIGNAL
@click.option("--along", metavar="AXIS", help="The axis of the cascade [default: the speed].")
@click.option("--form", type=click.Choice(["waterfall", "intensity"]), default="waterfall", show_default=True)
@click.option("--max-frequency", metavar="HZ", help="End of the abscissa [default: beyond modes and 1X].")
@click.option("--max-order", type=click.FloatRange(min=0, min_open=True), default=5.0, show_default=True)
@_ORDERS
@click.option("--order-lines", default="1/3,1/2,2/3,1,3/2,2,3", show_default=True, metavar="LIST")
@click.option("--mark", "marks", multiple=True, metavar="NAME=HZ", help="Mark one more frequency.")
def cascade(
    store: str,
    selection: tuple[str, ...],
    figure: str | None,
    data: str | None,
    signal: str,
    along: str | None,
    form: str,
    max_frequency: str | None,
    max_order: float,
    is_order: bool,
    order_lines: str,
    marks: tuple[str, ...],
) -> None:
    """Spectra of a signal along the speed, with order lines and the rotor's natural frequencies."""
    from postproc.bench import natural_frequencies
    from postproc.cascade import below
    from postproc.cascade import cascade as gather
    from postproc.cascade_figure import default_limit, draw_frequencies, draw_orders, intensity, waterfall
    from postproc.lines import parse_orders
    from rubhpc.input.reading import parse_quantity

    cases = _open(store, selection)
    orders = parse_orders(order_lines, "--order-lines")
    spectra = gather(cases, signal, along)
    frequencies: dict[str, Any] = dict(natural_frequencies(cases, str(spectra.dims[0])))
    for name, value in _pairs(marks, "--mark"):
        frequencies[name] = parse_quantity(_number(value), "Hz", f"--mark {name}")
    abscissa = "order" if is_order else "frequency"
    limit = max_order if is_order else default_limit(spectra, frequencies)
    if max_frequency is not None and not is_order:
        limit = parse_quantity(_number(max_frequency), "Hz", "--max-frequency")
        if limit <= 0:
            raise InputError(f"--max-frequency: {limit:g} Hz is out of range; give one above 0")

    def draw(axes: list[Axes]) -> None:
        is_waterfall = form == "waterfall"
        (waterfall if is_waterfall else intensity)(spectra, axes[0], limit, abscissa)
        draw_orders(axes[0], spectra, orders, abscissa, "0.35" if is_waterfall else "0.8")
        draw_frequencies(axes[0], spectra, frequencies, abscissa, "C1" if is_waterfall else "#56B4E9")

    shown = below(spectra, limit, abscissa).to_dataset(name=str(spectra.name))
    _finish("cascade", store, figure, data, shown, draw, height=80)


@click.command("map")
@_of_store
@click.option(
    "--value", default="peak_contact_force", show_default=True, help="A scalar, or regime or status."
)
@click.option("--x", metavar="AXIS", help="Axis across [default: the longest].")
@click.option("--y", metavar="AXIS", help="Axis up [default: the next longest].")
@click.option("--log", is_flag=True, help="Colours on a logarithmic scale.")
def map(  # noqa: A001 - the name of the command
    store: str,
    selection: tuple[str, ...],
    figure: str | None,
    data: str | None,
    value: str,
    x: str | None,
    y: str | None,
    log: bool,
) -> None:
    """A scalar, the regime or the status over two axes; what is missing or out of range is hatched."""
    from postproc.map_figure import value_map
    from postproc.maps import default_axes, map_data
    from postproc.selection import first_of_rest

    cases = _open(store, selection)
    across, up = default_axes(cases, x, y)
    cases, notes = first_of_rest(cases, [across, up], value)
    shown = map_data(cases, value, across, up)
    for note in notes:
        click.echo(note)
    _finish("map", store, figure, data, shown, lambda axes: value_map(shown, value, axes[0], log), height=75)


@click.command()
@_of_store
@click.option("--revolutions", type=_REVOLUTIONS, help="Only the last ones [default: all].")
@_OVER
def orbit(
    store: str,
    selection: tuple[str, ...],
    figure: str | None,
    data: str | None,
    revolutions: int | None,
    over: str | None,
) -> None:
    """Orbit of the disc with the clearance, the stators, and a point a revolution."""
    from postproc.orbits import orbit as draw_orbit
    from postproc.orbits import orbit_data

    shown = orbit_data(_open(store, selection), revolutions, over)
    _finish("orbit", store, figure, data, shown, lambda axes: draw_orbit(shown, axes[0]), height=80)


@click.command()
@_of_store
@_SIGNAL
@click.option("--full", is_flag=True, help="Forward and backward whirl of the orbit instead of a signal.")
@_ORDERS
@click.option("--max", "end", type=click.FloatRange(min=0, min_open=True), help="End of the abscissa.")
@click.option(
    "--lines", "n_line", type=click.IntRange(min=0), default=6, show_default=True, help="To be named."
)
@click.option("--log", is_flag=True, help="Amplitudes on a logarithmic scale.")
@_OVER
def spectrum(
    store: str,
    selection: tuple[str, ...],
    figure: str | None,
    data: str | None,
    signal: str,
    full: bool,
    is_order: bool,
    end: float | None,
    n_line: int,
    log: bool,
    over: str | None,
) -> None:
    """Spectrum of a signal, or of the whirl, its strongest lines named as fractions of the spin speed."""
    from postproc.lines import strongest_lines
    from postproc.spectra import spectrum_data
    from postproc.spectrum_figure import default_limit
    from postproc.spectrum_figure import spectrum as draw_spectrum

    shown = spectrum_data(_open(store, selection), "whirl" if full else signal, over).compute()
    abscissa = "order" if is_order else "frequency"
    limit = end or default_limit(shown, abscissa)
    lines = strongest_lines(shown, n_line) if over is None and n_line else None
    for name, frequency, amplitude in (
        []
        if lines is None
        else zip(lines["name"].values, lines["frequency"].values, lines["amplitude"].values, strict=True)
    ):
        click.echo(f"{name:>8} {frequency:10.3f} Hz  {amplitude:.4e} {shown.attrs['units']}")

    def draw(axes: list[Axes]) -> None:
        draw_spectrum(shown, axes[0], lines, abscissa, limit, log)

    _finish("spectrum", store, figure, data, shown.to_dataset(name=str(shown.name)), draw)


@click.command()
@_of_store
@click.option(
    "--signal", "signals", multiple=True, help="May be repeated [default: motion and contact force]."
)
@click.option("--revolutions", type=_REVOLUTIONS, default=4, show_default=True, help="The last ones.")
@_OVER
def waveform(
    store: str,
    selection: tuple[str, ...],
    figure: str | None,
    data: str | None,
    signals: tuple[str, ...],
    revolutions: int,
    over: str | None,
) -> None:
    """Waveforms of some signals in panels above one another; contact is shaded."""
    from postproc.waveforms import DEFAULT_SIGNALS, panels, waveform_data

    signals = tuple(dict.fromkeys(signals)) or DEFAULT_SIGNALS
    shown = waveform_data(_open(store, selection), signals, revolutions, over)
    _finish("waveform", store, figure, data, shown, lambda axes: panels(shown, axes), n_panel=len(signals))


@click.command()
@_of_store
@click.option("--x", default="horizontal", show_default=True, help="Signal across.")
@click.option("--y", default="vertical", show_default=True, help="Signal up.")
@click.option("--over", metavar="AXIS", help="Draw signal Y of the cases along AXIS: a bifurcation diagram.")
def section(
    store: str,
    selection: tuple[str, ...],
    figure: str | None,
    data: str | None,
    x: str,
    y: str,
    over: str | None,
) -> None:
    """Poincaré section: a point a revolution, in the plane of two signals or along an axis."""
    from postproc.sections import bifurcation, plane, section_data

    shown = section_data(_open(store, selection), [y] if over else [x, y], over)

    def draw(axes: list[Axes]) -> None:
        if over:
            bifurcation(shown[f"section_{y}"], axes[0])
        else:
            plane(shown, x, y, axes[0])

    _finish("section", store, figure, data, shown, draw)


COMMANDS = (cascade, map, orbit, spectrum, waveform, section)


def _open(store: str, selection: tuple[str, ...]) -> xr.Dataset:
    from postproc.load import open_store
    from postproc.selection import select

    return select(open_store(store), dict(_pairs(selection, "--select")))


def _finish(
    command: str,
    store: str,
    figure: str | None,
    data: str | None,
    shown: xr.Dataset,
    draw: Draw,
    n_panel: int = 1,
    height: float | None = None,
) -> None:
    """Draw and save the figure, write the data where asked, and tell where they are."""
    from postproc.export import check_data_path, write_data
    from postproc.style import check_figure_path, house_style, new_figure, save
    from postproc.units import caption

    path = check_figure_path(figure or f"{Path(store).resolve().stem}_{command}.png")
    data_path = check_data_path(data) if data else None
    with house_style():
        page, axes = new_figure(n_panel, height)
        draw(axes)
        page.suptitle(caption(shown), fontsize=7, x=0.02, ha="left")
        save(page, path)
    click.echo(str(path))
    if data_path:
        click.echo(str(write_data(shown, data_path)))


def _pairs(texts: tuple[str, ...], option: str) -> list[tuple[str, str]]:
    for text in texts:
        if not all(part.strip() for part in text.partition("=")):
            raise InputError(f'{option}: "{text}" is no pair; write NAME=VALUE')
    return [(name.strip(), value.strip()) for name, _, value in (text.partition("=") for text in texts)]


def _number(text: str) -> float | str:
    """Return a plain number of the command line as one; other text as it stands, for its unit to be read."""
    try:
        return float(text)
    except ValueError:
        return text
