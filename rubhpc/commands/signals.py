"""The signal commands: what a case's vibration tells of its rub, from a store."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import click

from rubhpc.commands.drawing import REVOLUTIONS, draw, of_store

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr


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
def hht(**words: Any) -> None:
    """Hilbert-Huang analysis of a signal: its energy over time and frequency, contact shaded.

    Prints the amplitude-weighted median frequency between contacts, of all spans and of each.
    """
    from postproc.figures import catalogue as figures

    draw("hht", figures.hht, words, lambda drawing: _frequencies(drawing.shown, words["mode"]))


@click.command()
@of_store
@click.option("--noise", multiple=True, type=float, help="Level of noise; may be repeated.")
@click.option("--draws", type=click.IntRange(min=1), default=3, show_default=True, help="Of noise, a case.")
@click.option(
    "--false-alarms", type=float, default=0.05, show_default=True, help="Share that sets the thresholds."
)
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True, help="Of noise and halves.")
@click.option("--scores", metavar="FILE", help="Write every case's scores and verdict: .zarr or .nc.")
def indicators(scores: str | None, **words: Any) -> None:
    """How often torsion, whirl and stator vibration tell rub from no rub, under measurement noise.

    Noise of level 1 is as strong as the median vibration of the cases that touch. Thresholds for one half of
    the cases come from those of the other half that do not touch.
    """
    from postproc.figures import catalogue as figures
    from postproc.store.export import check_data_path, write_data

    scores_path = check_data_path(scores) if scores else None
    judged = draw("indicators", figures.indicators, words, lambda drawing: _table(drawing.found)).found
    if scores_path:
        click.echo(str(write_data(judged, scores_path)))


def _frequencies(shown: xr.Dataset, mode: int) -> Iterator[str]:
    from postproc.signals.hilbert_huang import contact_bandwidth, median_frequency, span_frequencies

    middle = float(median_frequency(shown, mode))
    each = ", ".join(f"{f:.1f}" for f in span_frequencies(shown, mode).dropna("span").values)
    yield f"median frequency out of contact {middle:.2f} Hz (span by span: {each})"
    spread = {str(name): float(width) for name, width in contact_bandwidth(shown, mode).items()}
    if math.isfinite(spread["contact"]):
        yield f"interquartile spread {spread['contact']:.0f} Hz in contact, {spread['free']:.0f} Hz free"


def _table(judged: xr.Dataset) -> Iterator[str]:
    done = judged["verdict"].notnull().all(("indicator", "level"))
    n_rub, n_free = int((done & judged["rub"]).sum()), int((done & ~judged["rub"]).sum())
    yield f"Detection rate and area under the ROC curve, of {n_rub} cases with rub and {n_free} without"
    names = [str(name) for name in judged["indicator"].values]
    yield f"{'noise':>6}" + "".join(f"{name:>22}" for name in names)
    for level in judged["level"].values:
        row = judged.sel(level=level)
        cells = zip(row["detection_rate"].values, row["area_under_curve"].values, strict=True)
        yield f"{level:6g}" + "".join(f"{f'{rate:.3f}  {area:.3f}':>22}" for rate, area in cells)


COMMANDS = (hht, indicators)
