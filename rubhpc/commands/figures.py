"""The figure commands: one figure each from a store, with its data as an option.

What they draw, and what their words mean, is in `postproc.figures`; a word is called there as it is here.
"""

from __future__ import annotations

from typing import Any

import click

from rubhpc.commands.drawing import REVOLUTIONS, draw, of_store, pairs

_SIGNAL = click.option("--signal", default="torsion", show_default=True, help="Which recorded signal.")
_ORDERS = click.option("--orders", is_flag=True, help="Draw over orders instead of Hz.")
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
@click.option("--mark", multiple=True, metavar="NAME=HZ", help="Mark one more frequency.")
def cascade(**words: Any) -> None:
    """Spectra of a signal along the speed, with order lines and the rotor's natural frequencies."""
    from postproc.figures import catalogue as figures

    draw("cascade", figures.cascade, words | {"mark": dict(pairs(words["mark"], "--mark"))})


@click.command("map")
@of_store
@click.option(
    "--value", default="peak_contact_force", show_default=True, help="A scalar, or regime or status."
)
@click.option("--x", metavar="AXIS", help="Axis across [default: the longest].")
@click.option("--y", metavar="AXIS", help="Axis up [default: the next longest].")
@click.option("--facet", metavar="AXIS", multiple=True, help="A map for each value; twice: a grid.")
@click.option("--contours", type=click.IntRange(min=1), metavar="N", help="Lines at N levels.")
@click.option("--log", is_flag=True, help="Colours on a logarithmic scale.")
def map(**words: Any) -> None:  # noqa: A001 - the name of the command
    """A scalar, the regime or the status over two axes; what is missing or out of range is hatched."""
    from postproc.figures import catalogue as figures

    draw("map", figures.map_of, words)


@click.command()
@of_store
@click.option("--revolutions", type=REVOLUTIONS, help="Only the last ones [default: all].")
@_OVER
def orbit(**words: Any) -> None:
    """Orbit of the disc with the clearance, the stators, and a point a revolution."""
    from postproc.figures import catalogue as figures

    draw("orbit", figures.orbit, words)


@click.command()
@of_store
@_SIGNAL
@_FULL
@_ORDERS
@click.option("--max", type=click.FloatRange(min=0, min_open=True), help="End of the abscissa.")
@click.option("--lines", type=click.IntRange(min=0), default=6, show_default=True, help="To be named.")
@click.option("--log", is_flag=True, help="Amplitudes on a logarithmic scale.")
@_OVER
def spectrum(**words: Any) -> None:
    """Spectrum of a signal, or of the whirl, its strongest lines named as fractions of the spin speed."""
    from postproc.figures import catalogue as figures

    draw("spectrum", figures.spectrum, words)


@click.command()
@of_store
@click.option("--signal", multiple=True, help="May be repeated [default: motion and contact force].")
@click.option("--revolutions", type=REVOLUTIONS, default=4, show_default=True, help="The last ones.")
@_OVER
def waveform(**words: Any) -> None:
    """Waveforms of some signals in panels above one another; contact is shaded."""
    from postproc.figures import catalogue as figures

    draw("waveform", figures.waveform, words)


@click.command()
@of_store
@click.option("--x", default="horizontal", show_default=True, help="Signal across.")
@click.option("--y", default="vertical", show_default=True, help="Signal up.")
@click.option("--over", metavar="AXIS", help="Draw signal Y of the cases along AXIS: a bifurcation diagram.")
def section(**words: Any) -> None:
    """Poincaré section: a point a revolution, in the plane of two signals or along an axis."""
    from postproc.figures import catalogue as figures

    draw("section", figures.section, words)


@click.command("bifurcation")
@of_store
@click.option("--signal", default="vertical", show_default=True, help="vertical, horizontal or torsion.")
@click.option("--along", metavar="AXIS", help="The axis of the diagram [default: the longest].")
@click.option(
    "--color",
    type=click.Choice(["regime", "period", "direction"]),
    help="[default: direction, where an axis was swept both ways; else regime]",
)
def bifurcation_diagram(**words: Any) -> None:
    """Section points of a signal, one a revolution, over an axis, coloured by regime, period or direction."""
    from postproc.figures import catalogue as figures

    draw("bifurcation", figures.bifurcation, words)


COMMANDS = (cascade, map, orbit, spectrum, waveform, section, bifurcation_diagram)
