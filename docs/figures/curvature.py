"""Draws curvature.png and prints its tables: what straight normals and unbent stators cost. Takes minutes.

60 cases of the packaged map (jobs/map.toml) and the same of a softer stator, by three models of the gap; with
`--paper`, the cases that the paper's figures are drawn of, alone.
"""

from __future__ import annotations

import itertools
import sys
import time
from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import rubhpc
from postproc.figures.drawing import COLUMN_WIDTH, house_style, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STIFFNESSES = ("30 GPa", "3 GPa")  # of the packaged map, and of the paper's stator
SPEEDS = (0.6, 0.75, 1.1, 1.5, 2.0, 2.6, 3.2, 3.8, 4.6, 5.6)
CLEARANCES, FRICTIONS = (0.5, 0.9), (0.1, 0.3, 0.5)
MODELS = {
    "linear, fixed normal": ("fixed", "linear"),
    "linear, updated normal": ("updated", "linear"),
    "second order, updated normal": ("updated", "second_order"),
}
BINS = (0.0, 0.1, 0.3, 1.0, 3.0, 10.0, np.inf)  # of `foreshortening_ratio`
LIMIT = 0.1  # of the monitor


# Cases of the paper's figures, as jobs/paper has them: study, speed ratio, clearance, friction and stiffness.
PAPER = (
    ("subcritical", 0.75, "84 um", 0.3, "3 GPa"),
    ("subcritical", 0.75, "84 um", 0.5, "3 GPa"),
    ("subcritical", 0.75, "84 um", 0.3, "15 GPa"),
    ("subcritical", 0.75, "84 um", 0.3, "30 GPa"),
    ("subcritical", 0.75, "100 um", 0.3, "3 GPa"),
    ("resonance", 1.5, "150 um", 0.3, "3 GPa"),
    ("resonance", 1.5, "150 um", 0.3, "30 GPa"),
    ("clearance", 2.0, "70 um", 0.3, "30 GPa"),
    ("clearance", 2.0, "90 um", 0.3, "30 GPa"),
    ("clearance", 2.0, "110 um", 0.3, "30 GPa"),
    ("friction", 3.0, "76 um", 0.1, "30 GPa"),
    ("friction", 3.0, "76 um", 0.3, "30 GPa"),
    ("friction", 3.0, "76 um", 0.5, "30 GPa"),
)


class Case(NamedTuple):
    """A case of one model, next to that of the best one."""

    ratio: float  # `foreshortening_ratio`
    excess: float  # peak force over that with second order and updated normal
    deflection: float  # of the tip over the length, with second order and updated normal
    is_other_period: bool


def simulate(stiffness: str, speed: float, clearance: float, friction: float, model: str) -> rubhpc.Record:
    """Simulate a case of the map with one model of the gap."""
    normal, geometry = MODELS[model]
    return rubhpc.simulate(
        "mokhtar2017",
        speed_ratio=speed,
        clearance_ratio=clearance,
        friction=friction,
        normal=normal,
        friction_law="sliding",
        overrides={"stator.youngs_modulus": stiffness, "stator.geometry": geometry},
        transient=120,
        revolutions=64,
        keep=("section",),
    )


def cases(stiffness: str, spent: dict[str, float]) -> dict[str, list[Case]]:
    """Compare the linear models with the best one, case by case; add the time of each to `spent`, s."""
    *linear, best = MODELS
    found: dict[str, list[Case]] = {model: [] for model in linear}
    for model in MODELS:  # kernels are compiled before times count
        simulate(stiffness, 0.75, 0.5, 0.3, model)
    for place in itertools.product(SPEEDS, CLEARANCES, FRICTIONS):
        records = {}
        for model in MODELS:
            began = time.process_time()
            records[model] = simulate(stiffness, *place, model)
            spent[model] += time.process_time() - began
        known = records[best]
        for model in linear:
            record = records[model]
            case = Case(
                ratio=float(record.foreshortening_ratio[0]),
                excess=float(record.peak_contact_force[0] / known.peak_contact_force[0]),
                deflection=float(known.tip_deflection_ratio[0]),
                is_other_period=record.period != known.period,
            )
            found[model].append(case)
    return found


def table(found: dict[str, list[Case]]) -> str:
    """Rows of cases, median, range and other periods by `foreshortening_ratio`, of each linear model."""
    rows = []
    for low, high in itertools.pairwise(BINS):
        inside = [[case for case in those if low <= case.ratio < high] for those in found.values()]
        excess = [[case.excess for case in those] for those in inside]
        counts = " / ".join(str(len(those)) for those in inside)
        medians = " / ".join(f"{np.median(those):.2f}" for those in excess)
        spread = f"{min(map(min, excess)):.2f} to {max(map(max, excess)):.3g}"
        other = " / ".join(str(sum(case.is_other_period for case in those)) for those in inside)
        rows.append(f"| {low:g} to {high:g} | {counts} | {medians} | {spread} | {other} |")
    return "\n".join(rows)


def draw_excess(ax: Axes, found: dict[str, list[Case]]) -> Axes:
    """Peak force over that of the best model, over `foreshortening_ratio`; crosses have another period."""
    for (model, those), colour in zip(found.items(), ("C0", "C1"), strict=True):
        for is_other, marker in ((False, "o"), (True, "x")):
            shown = [case for case in those if case.is_other_period == is_other]
            ax.loglog(
                [case.ratio for case in shown],
                [case.excess for case in shown],
                marker,
                ms=3.5,
                mew=0.9,
                color=colour,
                mfc="none",
                label=model if marker == "o" else f"{model}: another period",
            )
    ax.axvline(LIMIT, color="0.4", ls="--", lw=0.8)
    ax.axhline(1.0, color="0.7", lw=0.6, zorder=0)
    ticks = (0.5, 1, 2, 5, 10, 20)
    ax.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.minorticks_off()
    ax.set(xlabel="neglected curvature over compression", xlim=(0.01, 200.0), ylim=(0.4, 40.0))
    return ax


def draw() -> None:
    """Compute, print, draw and save."""
    with house_style():
        figure = Figure(figsize=(2 * COLUMN_WIDTH, 0.85 * COLUMN_WIDTH), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(1, 2, sharey=True)
        together: dict[str, list[Case]] = defaultdict(list)
        for ax, stiffness, letter in zip(axes, STIFFNESSES, "ab", strict=True):
            spent = dict.fromkeys(MODELS, 0.0)
            found = cases(stiffness, spent)
            draw_excess(ax, found).set_title(f"({letter}) {stiffness}", loc="left")
            times = ", ".join(f"{model} {taken:.1f} s" for model, taken in spent.items())
            print(f"{stiffness}, processor time: {times}")
            for model, those in found.items():
                together[model] += those
        print(table(together))
        bent = [case.deflection for case in together["linear, fixed normal"]]
        print(f"second order: deflection over length {min(bent):.2g} to {max(bent):.2g}")
        axes[0].set_ylabel("peak force over that with\nsecond order and updated normal")
        axes[0].legend(loc="upper left")
        save(figure, Path(__file__).with_suffix(".png"))


def print_paper() -> None:
    """Print peak forces, heights of the orbit and periods of the paper's cases by every model."""
    for study, speed, clearance, friction, stiffness in PAPER:
        row = [study, f"{speed:g}", clearance, f"{friction:g}", stiffness]
        records = [
            rubhpc.simulate(
                "mokhtar2017",
                speed_ratio=speed,
                clearance=clearance,
                friction=friction,
                normal=normal,
                friction_law="sliding",
                overrides={"stator.youngs_modulus": stiffness, "stator.geometry": geometry},
                transient=240,
                revolutions=120,
                keep=("section",),
            )
            for normal, geometry in MODELS.values()
        ]
        row.append(" / ".join(f"{record.peak_contact_force[0]:.4g}" for record in records))
        row.append(" / ".join(f"{1e6 * record.peak_to_peak_vertical:.0f}" for record in records))
        row.append(" / ".join(str(record.period or "none") for record in records))
        row.append(f"{records[0].foreshortening_ratio[0]:.2g}")
        print("| " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    if "--paper" in sys.argv[1:]:
        print_paper()
    else:
        draw()
