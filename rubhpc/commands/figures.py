"""The figure commands: one figure each from a store, with its data as an option."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from rubhpc.commands.drawing import REVOLUTIONS, finish, number, of_store, open_cases, pairs
from rubhpc.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SIGNAL = click.option("--signal", default="torsion", show_default=True, help="Which recorded signal.")
_ORDERS = click.option("--orders", "is_order", is_flag=True, help="Draw over orders instead of Hz.")
_FULL = click.option(
    "--full", is_flag=True, help="Forward and backward whirl of the orbit instead of a signal."
)
_OVER = click.option("--over", metavar="AXIS", help="Draw the cases along AXIS over one another.")


@click.command()
@of_store
@_SIGNAL
@_FULL
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
    full: bool,
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

    cases = open_cases(store, selection)
    orders = parse_orders(order_lines, "--order-lines")
    spectra = gather(cases, "whirl" if full else signal, along)
    frequencies: dict[str, Any] = dict(natural_frequencies(cases, str(spectra.dims[0])))
    if full:
        frequencies.pop("torsional", None)
    for name, value in pairs(marks, "--mark"):
        frequencies[name] = parse_quantity(number(value), "Hz", f"--mark {name}")
    abscissa = "order" if is_order else "frequency"
    limit = max_order if is_order else default_limit(spectra, frequencies)
    if max_frequency is not None and not is_order:
        limit = parse_quantity(number(max_frequency), "Hz", "--max-frequency")
        if limit <= 0:
            raise InputError(f"--max-frequency: {limit:g} Hz is out of range; give one above 0")

    def draw(axes: list[Axes]) -> None:
        is_waterfall = form == "waterfall"
        (waterfall if is_waterfall else intensity)(spectra, axes[0], limit, abscissa)
        draw_orders(axes[0], spectra, orders, abscissa, "0.35" if is_waterfall else "0.8")
        draw_frequencies(axes[0], spectra, frequencies, abscissa, "C1" if is_waterfall else "#56B4E9")

    shown = below(spectra, limit, abscissa).to_dataset(name=str(spectra.name))
    finish("cascade", store, figure, data, shown, draw, height=80)


@click.command("map")
@of_store
@click.option(
    "--value", default="peak_contact_force", show_default=True, help="A scalar, or regime or status."
)
@click.option("--x", metavar="AXIS", help="Axis across [default: the longest].")
@click.option("--y", metavar="AXIS", help="Axis up [default: the next longest].")
@click.option("--facet", "facets", metavar="AXIS", multiple=True, help="A map for each value; twice: a grid.")
@click.option("--contours", type=click.IntRange(min=1), default=None, metavar="N", help="Lines at N levels.")
@click.option("--log", is_flag=True, help="Colours on a logarithmic scale.")
def map(  # noqa: A001 - the name of the command
    store: str,
    selection: tuple[str, ...],
    figure: str | None,
    data: str | None,
    value: str,
    x: str | None,
    y: str | None,
    facets: tuple[str, ...],
    contours: int | None,
    log: bool,
) -> None:
    """A scalar, the regime or the status over two axes; what is missing or out of range is hatched."""
    from postproc.map_figure import value_maps
    from postproc.maps import default_axes, facet_axes, map_data
    from postproc.selection import first_of_rest

    cases = open_cases(store, selection)
    across, up = default_axes(cases, x, y)
    multiples = facet_axes(cases, facets, [across, up])
    cases, notes = first_of_rest(cases, [across, up, *multiples], value)
    shown = map_data(cases, value, across, up, multiples)
    for note in notes:
        click.echo(note)
    n_column = shown.sizes[multiples[-1]] if multiples else 1
    n_row = shown.sizes[multiples[0]] if len(multiples) == 2 else 1

    def draw(axes: list[Axes]) -> None:
        value_maps(shown, value, axes, log, contours or 0)

    height, width = (75, None) if not multiples else (30 + 45 * n_row, 180)
    finish("map", store, figure, data, shown, draw, n_row, height, width, n_column)


@click.command()
@of_store
@click.option("--revolutions", type=REVOLUTIONS, help="Only the last ones [default: all].")
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

    shown = orbit_data(open_cases(store, selection), revolutions, over)
    finish("orbit", store, figure, data, shown, lambda axes: draw_orbit(shown, axes[0]), height=80)


@click.command()
@of_store
@_SIGNAL
@_FULL
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

    shown = spectrum_data(open_cases(store, selection), "whirl" if full else signal, over).compute()
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

    finish("spectrum", store, figure, data, shown.to_dataset(name=str(shown.name)), draw)


@click.command()
@of_store
@click.option(
    "--signal", "signals", multiple=True, help="May be repeated [default: motion and contact force]."
)
@click.option("--revolutions", type=REVOLUTIONS, default=4, show_default=True, help="The last ones.")
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
    shown = waveform_data(open_cases(store, selection), signals, revolutions, over)
    finish("waveform", store, figure, data, shown, lambda axes: panels(shown, axes), n_panel=len(signals))


@click.command()
@of_store
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
    from postproc.bifurcation import bifurcation, bifurcation_data
    from postproc.load import find_axis
    from postproc.sections import plane, section_data

    cases = open_cases(store, selection)
    shown = bifurcation_data(cases, y, find_axis(cases, over)) if over else section_data(cases, [x, y])

    def draw(axes: list[Axes]) -> None:
        if over:
            bifurcation(shown, y, axes[0], color=None)
        else:
            plane(shown, x, y, axes[0])

    finish("section", store, figure, data, shown, draw)


@click.command("bifurcation")
@of_store
@click.option("--signal", default="vertical", show_default=True, help="vertical, horizontal or torsion.")
@click.option("--along", metavar="AXIS", help="The axis of the diagram [default: the longest].")
@click.option("--color", type=click.Choice(["regime", "period"]), default="regime", show_default=True)
def bifurcation_diagram(
    store: str,
    selection: tuple[str, ...],
    figure: str | None,
    data: str | None,
    signal: str,
    along: str | None,
    color: str,
) -> None:
    """Section points of a signal, one a revolution, over an axis, coloured by regime or period."""
    from postproc.bifurcation import WIDTH, bifurcation, bifurcation_data, default_axis
    from postproc.sections import section_of
    from postproc.selection import first_of_rest

    cases = open_cases(store, selection)
    axis = default_axis(cases, along)
    name = f"section_{signal}"
    cases, notes = first_of_rest(cases.assign({name: section_of(cases, signal)}), [axis], name)
    shown = bifurcation_data(cases, signal, axis)
    for note in notes:
        click.echo(note)

    def draw(axes: list[Axes]) -> None:
        bifurcation(shown, signal, axes[0], color)

    finish("bifurcation", store, figure, data, shown, draw, height=90, width=WIDTH)


COMMANDS = (cascade, map, orbit, spectrum, waveform, section, bifurcation_diagram)
