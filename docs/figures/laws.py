"""Draws laws.png: the conventional law against the multiplier, dry whip under Coulomb's. Takes minutes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import rubhpc
from postproc.figures.drawing import COLUMN_WIDTH, house_style, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PACKAGED = rubhpc.read_rig("mokhtar2017").with_geometry("linear")
RUB = {"speed_ratio": 0.75, "clearance": "84 um", "friction": 0.3, "transient": 40, "revolutions": 2}
LAWS = {"normal": "fixed", "friction_law": "sliding"}
STIFFNESS = (1e6, 3e6, 1e7, 3e7, 1e8, 3e8, 1e9, 3e9)  # N/m; the stator's own is 1.875e6
SHOWN = (1e6, 1e7, 1e8)
SIGNALS = {"vertical": "vertical", "torsion": "torsion", "contact_force": "contact force"}


def distances(ax: Axes, known: rubhpc.Record, found: dict[float, rubhpc.Record]) -> Axes:
    """Rms distance of the conventional law's signals from the multiplier's, over the contact stiffness."""
    for name, label in SIGNALS.items():
        exact = getattr(known, name)
        apart = [
            np.sqrt(np.mean((getattr(r, name) - exact) ** 2) / np.mean(exact**2)) for r in found.values()
        ]
        ax.loglog(STIFFNESS, apart, marker="o", ms=3, label=label)
        print(name, dict(zip(STIFFNESS, np.round(apart, 6), strict=True)))
    ax.loglog(STIFFNESS, 2e6 / np.array(STIFFNESS), color="0.6", ls=":", label="$1/k$")
    ax.set(xlabel="Contact stiffness $k$ (N/m)", ylabel="Distance from the multiplier's")
    ax.legend()
    return ax


def forces(ax: Axes, known: rubhpc.Record, found: dict[float, rubhpc.Record]) -> Axes:
    """Contact forces of the revolution's only rub."""
    per_revolution = known.samples_per_revolution
    middle = per_revolution + int(np.argmax(known.contact_force[0, :per_revolution]))
    window = slice(middle - per_revolution // 8, middle + per_revolution // 8)
    turn = 360 * (np.arange(2 * per_revolution) / per_revolution - 1)
    for stiffness in SHOWN:
        label = f"$k$ = $10^{{{np.log10(stiffness):.0f}}}$ N/m"
        ax.plot(turn[window], found[stiffness].contact_force[0, window], label=label)
    ax.plot(turn[window], known.contact_force[0, window], color="k", ls="--", lw=0.8, label="multiplier")
    ax.set(xlabel="Angle of the shaft (°)", ylabel="Contact force (N)", xlim=(-40, 115))
    ax.legend()
    return ax


def whip(ax: Axes) -> Axes:
    """Largest deflection of each revolution, three stators 120 degrees apart, under both laws of friction."""
    ring = replace(PACKAGED, stator=(replace(PACKAGED.stator[0], count=3),))
    given = RUB | LAWS | {"clearance": "60 um", "transient": 0, "keep": "waveform"}
    coulomb = rubhpc.simulate(
        ring,
        **(given | {"revolutions": 24, "friction_law": "coulomb"}),
        method="central-difference",
        step="2 us",
    )
    sliding, state = [], None
    for _ in range(24):
        turn = rubhpc.simulate(ring, **(given | {"revolutions": 1}), initial=state)
        if turn.reason:
            print("steady sliding:", turn.reason)
            break
        sliding.append(np.hypot(turn.vertical, turn.horizontal).max())
        state = turn.final
    radius = np.hypot(coulomb.vertical, coulomb.horizontal).reshape(24, -1).max(axis=1)
    print("whirl under Coulomb's law:", radius[-4:], "slip down to", coulomb.minimum_slip_speed)
    revolution, deflection = np.arange(1, len(sliding) + 1), 1e3 * np.array(sliding)
    ax.semilogy(revolution, deflection, marker="s", ms=3, label="steady sliding")
    last = int(np.flatnonzero(deflection < 2.0)[-1])  # of those shown
    arrow = {"arrowstyle": "->", "lw": 0.6}
    ax.annotate("diverges", (revolution[last], deflection[last]), (1.5, 1.2), arrowprops=arrow)
    ax.set_ylim(0.07, 2.5)
    ax.semilogy(np.arange(1, 25), 1e3 * radius, marker="o", ms=3, label="Coulomb")
    ax.set(xlabel="Revolution", ylabel="Largest deflection (mm)")
    ax.legend()
    return ax


def draw() -> None:
    """Draw and save the figure."""
    known = rubhpc.simulate(PACKAGED, **RUB, **LAWS, samples_per_revolution=1024)
    found = {
        k: rubhpc.simulate(PACKAGED, **RUB, **LAWS, samples_per_revolution=1024, law="penalty", stiffness=k)
        for k in STIFFNESS
    }
    with house_style():
        figure = Figure(figsize=(2 * COLUMN_WIDTH, 0.72 * COLUMN_WIDTH), layout="constrained")
        FigureCanvasAgg(figure)
        left, middle, right = figure.subplots(1, 3)
        distances(left, known, found)
        forces(middle, known, found)
        whip(right)
        for ax, letter in zip((left, middle, right), "abc", strict=True):
            ax.set_title(f"({letter})", loc="left")
        save(figure, Path(__file__).with_suffix(".png"))


if __name__ == "__main__":
    draw()
