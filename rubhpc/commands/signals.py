"""The signal commands: what a case's vibration tells of its rub, from a store."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import click

from rubhpc.commands.drawing import REVOLUTIONS, finish, number, of_store, open_cases
from rubhpc.errors import InputError

if TYPE_CHECKING:
    import xarray as xr
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
    spread = {str(name): float(width) for name, width in contact_bandwidth(shown, mode).items()}
    if math.isfinite(spread["contact"]):
        click.echo(
            f"interquartile spread {spread['contact']:.0f} Hz in contact, {spread['free']:.0f} Hz free"
        )


@click.command()
@of_store
@click.option("--noise", "levels", multiple=True, type=float, help="Level of noise; may be repeated.")
@click.option("--draws", type=click.IntRange(min=1), default=3, show_default=True, help="Of noise, a case.")
@click.option(
    "--false-alarms", type=float, default=0.05, show_default=True, help="Share that sets the thresholds."
)
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True, help="Of noise and halves.")
@click.option("--scores", metavar="FILE", help="Write every case's scores and verdict: .zarr or .nc.")
def indicators(
    store: str,
    selection: tuple[str, ...],
    figure: str | None,
    data: str | None,
    levels: tuple[float, ...],
    draws: int,
    false_alarms: float,
    seed: int,
    scores: str | None,
) -> None:
    """How often torsion, whirl and stator vibration tell rub from no rub, under measurement noise.

    Noise of level 1 is as strong as the median vibration of the cases that touch. Thresholds for one half of
    the cases come from those of the other half that do not touch.
    """
    from postproc.detection import judge
    from postproc.detection_figure import panels
    from postproc.export import check_data_path, write_data
    from postproc.indicators import LEVELS, indicator_scores

    scores_path = check_data_path(scores) if scores else None
    noise = tuple(sorted(set(levels))) or LEVELS
    judged = judge(indicator_scores(open_cases(store, selection), noise, draws, seed), false_alarms, seed)
    shown = judged[["detection_rate", "false_alarm_rate", "area_under_curve"]]
    _print_table(judged)
    finish("indicators", store, figure, data, shown, lambda axes: panels(judged, axes), n_panel=2, height=110)
    if scores_path:
        click.echo(str(write_data(judged, scores_path)))


def _print_table(judged: xr.Dataset) -> None:
    done = judged["verdict"].notnull().all(("indicator", "level"))
    n_rub, n_free = int((done & judged["rub"]).sum()), int((done & ~judged["rub"]).sum())
    click.echo(f"Detection rate and area under the ROC curve, of {n_rub} cases with rub and {n_free} without")
    names = [str(name) for name in judged["indicator"].values]
    click.echo(f"{'noise':>6}" + "".join(f"{name:>22}" for name in names))
    for level in judged["level"].values:
        row = judged.sel(level=level)
        cells = zip(row["detection_rate"].values, row["area_under_curve"].values, strict=True)
        click.echo(f"{level:6g}" + "".join(f"{f'{rate:.3f}  {area:.3f}':>22}" for rate, area in cells))


COMMANDS = (hht, indicators)
