"""Draws periodic.png: the jump of a rotor in a ring of springs, with the unstable motion between."""

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
    from collections.abc import Iterable

    from matplotlib.axes import Axes

SPRINGS = rubhpc.LumpedStator(node=8, radius=0.06, count=8, mass=1e-3, damping=2.0, stiffness=1e5)
RIG = replace(rubhpc.read_rig("mokhtar2017"), stator=(SPRINGS,))
CASE = {"clearance": "300 um", "friction": 0.0, "keep": (), "model": "mokhtar2017"}
NEAR, PAST = 1.335, 1.345  # speed ratios before and after the fold
Branch = list[tuple[float, rubhpc.PeriodicMotion]]


def follow(motion: rubhpc.PeriodicMotion | None, ratios: Iterable[float]) -> Branch:
    """Motions from one speed to the next, each begun at the one before."""
    branch: Branch = []
    for ratio in ratios:
        initial = None if motion is None else motion.state
        try:
            motion = rubhpc.periodic(RIG, speed_ratio=ratio, initial=initial, **CASE)
        except rubhpc.NoPeriodicMotion as problem:
            print(f"{ratio:.5f}: {problem}")
            break
        if branch and bool(motion.events) != bool(branch[-1][1].events):
            break  # another branch
        if branch and motion.is_stable != branch[-1][1].is_stable:
            break
        branch.append((ratio, motion))
    return branch


def branches() -> dict[str, Branch]:
    """The rub, the unstable motion and that without contact, over the speed."""
    rub = follow(None, np.arange(1.10, NEAR + 1e-9, 0.005))
    rub += follow(rub[-1][1], np.arange(NEAR, PAST, 1e-4)[1:])
    free = follow(None, np.arange(1.195, 1.4001, 0.005)[::-1])[::-1]
    pair = [next(motion for ratio, motion in branch if abs(ratio - 1.33) < 1e-6) for branch in (rub, free)]
    packed = 0.5 * (pair[0].state.packed() + pair[1].state.packed())
    halfway = replace(rubhpc.State.unpacked(packed, rubhpc.assemble(RIG)), contact_force=np.zeros(8))
    first = rubhpc.periodic(RIG, speed_ratio=1.33, initial=halfway, **CASE)
    up, down = follow(first, np.arange(1.33, PAST, 2e-4)), follow(first, np.arange(1.195, 1.33, 0.005)[::-1])
    return {"rub": rub, "unstable rub": [*down[::-1], *up], "no contact": free}


def amplitudes(ax: Axes, found: dict[str, Branch]) -> Axes:
    """Half the vertical peak-to-peak motion of each branch."""
    for (name, branch), style in zip(found.items(), ({}, {"ls": "--"}, {}), strict=True):
        radius = [5e5 * motion.record.peak_to_peak_vertical for _, motion in branch]
        ax.plot([ratio for ratio, _ in branch], radius, label=name, **style)
    ax.axhline(300, color="0.6", lw=0.8, ls=":")
    ax.text(1.105, 312, "clearance", color="0.4", fontsize="small")
    ax.set(xlabel="speed ratio", ylabel="amplitude of the disc, µm", xlim=(1.1, 1.4), ylim=(0, 900))
    ax.legend(loc="lower left")
    return ax


def multipliers(ax: Axes, found: dict[str, Branch]) -> Axes:
    """Modulus of the largest multiplier of each branch; 1 at the fold."""
    for (name, branch), style in zip(found.items(), ({}, {"ls": "--"}, {}), strict=True):
        ax.plot([r for r, _ in branch], [abs(m.multipliers[0]) for _, m in branch], label=name, **style)
    ax.axhline(1.0, color="0.6", lw=0.8, ls=":")
    ax.set(xlabel="speed ratio", ylabel="largest multiplier, modulus", xlim=(1.1, 1.4))
    return ax


def main() -> None:
    """Draw both panels."""
    found = branches()
    with house_style():
        figure = Figure(figsize=(2 * COLUMN_WIDTH, 0.75 * COLUMN_WIDTH), layout="constrained")
        FigureCanvasAgg(figure)
        left, right = figure.subplots(1, 2)
        amplitudes(left, found).set_title("(a)", loc="left")
        multipliers(right, found).set_title("(b)", loc="left")
        save(figure, Path(__file__).with_name("periodic.png"))


if __name__ == "__main__":
    main()
