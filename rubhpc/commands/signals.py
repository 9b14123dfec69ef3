"""The signal commands: what a case's vibration tells of its rub, from a store."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from rubhpc.commands.drawing import REVOLUTIONS, finish, number, of_store, open_cases
from rubhpc.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@click.command()
@of_store
@click.option("--signal", default="torsion", show_default=True, help="Which recorded signal.")
@click.option(
    "--contact",
    type=click.Choice(["masked", "kept"]),
    help="Leave spans in contact out, under windows, or keep them [default: kept for a stator's signals].",
)
@click.option("--revolutions", type=REVOLUTIONS, default=4, show_default=True, help="The last ones.")
@click.option(
    "--mode",
    type=click.IntRange(1, 8),
    default=1,
    show_default=True,
    help="Intrinsic mode, the fastest first.",
)
@click.option(
    "--max-frequency", metavar="HZ", help="End of the ordinate [default: twice the natural frequency]."
)
def hht(
    store: str,
    selection: tuple[str, ...],
    figure: str | None,
    data: str | None,
    signal: str,
    contact: str | None,
    revolutions: int,
    mode: int,
    max_frequency: str | None,
) -> None:
    """Hilbert-Huang analysis of a signal: its energy over time and frequency, contact shaded.

    Prints the amplitude-weighted median frequency between contacts, of all spans and of each.
    """
    from postproc.bench import natural_frequencies, stator_frequencies
    from postproc.hilbert_huang import contact_bandwidth, hilbert_huang, median_frequency, span_frequencies
    from postproc.hilbert_huang_figure import panels
    from rubhpc.input.reading import parse_quantity

    limit = None
    if max_frequency is not None:
        limit = parse_quantity(number(max_frequency), "Hz", "--max-frequency")
        if limit <= 0:
            raise InputError(f"--max-frequency: {limit:g} Hz is out of range; give one above 0")
    case = open_cases(store, selection)
    shown = hilbert_huang(case, signal, contact=contact, revolutions=revolutions, n_mode=mode)
    if signal.startswith("stator"):
        natural = {"stator": stator_frequencies(case)["lateral"]} if signal == "stator_lateral" else {}
    else:
        kind = "torsional" if signal.startswith("torsion") else "lateral"
        natural = {name: f for name, f in natural_frequencies(case).items() if name == kind}

    def draw(axes: list[Axes]) -> None:
        panels(shown, axes, limit, {name: float(f) for name, f in natural.items()}, mode)

    middle = float(median_frequency(shown, mode))
    each = ", ".join(f"{f:.1f}" for f in span_frequencies(shown, mode).dropna("span").values)
    finish("hht", store, figure, data, shown, draw, n_panel=2, height=85)
    click.echo(f"median frequency out of contact {middle:.2f} Hz (span by span: {each})")
    if shown.attrs["contact"] == "kept" and bool(shown["contact"].any()):
        spread = {name: float(width) for name, width in contact_bandwidth(shown, mode).items()}
        click.echo(
            f"interquartile spread {spread['contact']:.0f} Hz in contact, {spread['free']:.0f} Hz free"
        )


COMMANDS = (hht,)
