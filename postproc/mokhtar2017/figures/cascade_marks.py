"""The paper's markers on the cascade of Fig. 20."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import TYPE_CHECKING

from postproc.mokhtar2017.claims.quantities import at_speed, crest, strongest

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr
    from matplotlib.axes import Axes

ORDERS = [Fraction(*f) for f in ((1, 3), (1, 2), (2, 3), (1, 1), (4, 3), (3, 2), (2, 1), (3, 1))]
HEIGHT = 0.16  # of the highest line, as a part of the ordinate


def mark_lines(ax: Axes, spectra: xr.DataArray, torsional: float, bending: float) -> None:
    """Mark the lines that the paper names, at the torsional and the pseudo-critical frequency, Hz."""
    highest = float(spectra.where(spectra["order"] > 0).max())
    for letter, speed, frequency, amplitude in _markers(spectra, torsional, bending):
        _mark(ax, letter, frequency, speed, amplitude / highest)


def _markers(
    spectra: xr.DataArray, torsional: float, bending: float
) -> Iterator[tuple[str, float, float, float]]:
    """Yield the paper's markers with speed ratio, frequency (Hz) and amplitude of the lines they stand at.

    a, b, c: 1X, 1/2X and 1/3X crest at the pseudo-critical frequency; d, e, g: 2X, 3X and 1X crest at the
    torsional one; h, i: multiples of 1/3X beside c; j, k: multiples of 1/2X beside b; f: r = 5.7. What does
    not crest is not marked.
    """
    crests = {
        letter: (Fraction(*order), crest(spectra, Fraction(*order), frequency))
        for letter, order, frequency in (
            ("a", (1, 1), bending),
            ("b", (1, 2), bending),
            ("c", (1, 3), bending),
            ("d", (2, 1), torsional),
            ("e", (3, 1), torsional),
            ("g", (1, 1), torsional),
        )
    }
    at = crests | {
        "h": (Fraction(1), crests["c"][1]),
        "i": (Fraction(4, 3), crests["c"][1]),
        "j": (Fraction(3, 2), crests["b"][1]),
        "k": (Fraction(2), crests["b"][1]),
    }
    for letter, (order, speed) in at.items():
        if math.isnan(speed):
            continue
        line = at_speed(spectra, speed).sel(order=float(order), method="nearest")
        yield letter, speed, float(line["frequency"]), float(line)
    (highest,) = strongest(at_speed(spectra, 5.7))
    yield "f", 5.7, highest.hertz, highest.amplitude


def _mark(ax: Axes, letter: str, frequency: float, speed: float, share: float) -> None:
    """Add a marker next to a line whose height is `share` of the highest."""
    low, high = ax.get_ylim()
    span = (high - low) / (1 + HEIGHT + 0.06)  # that of the rows, of which `waterfall` takes heights
    ax.annotate(
        letter,
        (frequency, speed + 0.5 * share * HEIGHT * span),
        xytext=(3, 0),
        textcoords="offset points",
        fontsize=8,
        fontweight="bold",
        color="C1",
        va="center",
        zorder=8,
    )
