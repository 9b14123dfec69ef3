"""`rubhpc sensitivity`: which axes of a study a measure depends on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from rubhpc.commands.drawing import draw, of_store

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr


@click.command()
@of_store
@click.option(
    "--scalar", default="peak_contact_force", show_default=True, help="A measure or setting of a case."
)
@click.option(
    "--confidence",
    type=click.FloatRange(0, 1, min_open=True, max_open=True),
    default=0.95,
    show_default=True,
    help="Of the intervals.",
)
@click.option(
    "--draws", type=click.IntRange(min=2), default=500, show_default=True, help="Of levels, or points."
)
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True, help="Of the draws.")
def sensitivity(**words: Any) -> None:
    """First-order and total Sobol indices of a measure over the axes of the study, with intervals.

    They are exact on the levels of a grid, each of which weighs the same; an interval tells what as many
    other levels of the same range could have given. Those of a sampled study are estimates, with SALib.
    Cases without a value are counted, and told.
    """
    from postproc.figures import catalogue as figures

    draw("sensitivity", figures.sensitivity, words, lambda drawing: _table(drawing.shown))


def _table(found: xr.Dataset) -> Iterator[str]:
    about = found.attrs
    unit = "" if about["units"] == "1" else f" {about['units']}"
    yield (
        f"{about['measure']}: mean {about['mean']:.6g}{unit}, standard deviation "
        f"{about['standard_deviation']:.6g}{unit}, {about['cases']} cases"
    )
    yield from about["notes"].splitlines()
    name = "levels" if "levels" in found else "drawn_from"
    over = [str(told) for told in found[name].values]
    width = max(map(len, [name, *over]))
    yield f"{'axis':<28} {name.replace('_', ' '):>{width}}  {'first order':<22}  total"
    for i, axis in enumerate(found["axis"].values):
        cells = []
        for name in ("first_order", "total"):
            share, low, high = (float(found[n][i]) for n in (name, f"{name}_low", f"{name}_high"))
            cells.append(f"{share:.3f} [{low:.3f}, {high:.3f}]")
        yield f"{axis:<28} {over[i]:>{width}}  {cells[0]:<22}  {cells[1]}"
    yield f"interactions: {about['interactions']:.3f}"
