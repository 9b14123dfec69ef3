"""Draws signs.png: axes, angles and the sense of positive spin, seen from node 1."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, Rectangle

from postproc.figures.drawing import COLUMN_WIDTH, house_style, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ARROW = {"arrowstyle": "-|>", "mutation_scale": 9, "shrinkA": 0, "shrinkB": 0}


def arrow(ax: Axes, start: tuple[float, float], end: tuple[float, float], **style: object) -> None:
    """Draw an arrow between two points."""
    ax.add_patch(FancyArrowPatch(start, end, **(ARROW | {"color": "0.1", "lw": 0.9} | style)))


def side(ax: Axes) -> None:
    """The shaft from the side: node 1 at the left, x along it, y up."""
    ax.plot([0, 4], [0, 0], color="0.55", lw=3, solid_capstyle="butt")
    ax.add_patch(Rectangle((1.7, -0.7), 0.3, 1.4, color="0.75"))
    ax.plot([0, 1.85, 4], [0, 0, 0], "o", color="0.1", ms=3)
    for x, name in ((0, "node 1"), (1.85, "node 2"), (4, "node 3")):
        ax.text(x, -0.95, name, ha="center", va="top")
    arrow(ax, (4, 0), (5.1, 0))
    ax.text(5.2, 0, "$x$", va="center")
    arrow(ax, (0, 0), (0, 1.3))
    ax.text(0, 1.4, "$y$ (vertical)", ha="center")
    ax.text(-0.75, 0, "eye", ha="right", va="center", style="italic")
    arrow(ax, (-0.7, 0), (-0.2, 0), color="0.5", ls="--")
    ax.set(xlim=(-1.6, 5.6), ylim=(-1.9, 2.0), title="From the side")


def end(ax: Axes) -> None:
    """The disc from node 1 along the shaft: y up, z to the right, positive spin clockwise."""
    ax.add_patch(Circle((0, 0), 0.8, fc="0.88", ec="0.55"))
    arrow(ax, (0, 0), (0, 1.75))
    arrow(ax, (0, 0), (1.75, 0))
    ax.text(0.08, 1.75, "$y$, vertical, 0°", va="top")
    ax.text(1.8, 0, "$z$, horizontal,\n90°", va="center")
    turn = np.radians([160, 65])
    arrow(
        ax,
        (1.05 * np.cos(turn[0]), 1.05 * np.sin(turn[0])),
        (1.05 * np.cos(turn[1]), 1.05 * np.sin(turn[1])),
        connectionstyle="arc3,rad=-0.42",
        color="C3",
        lw=1.4,
    )
    ax.text(-0.95, 1.0, "positive spin,\nforward whirl", color="C3", ha="right", va="center")
    at = np.radians(-45)
    tip, root = (np.array([np.cos(at), np.sin(at)]) * r for r in (0.88, 1.6))
    ax.plot(*zip(tip, root, strict=True), color="C0", lw=3, solid_capstyle="butt")
    ax.text(root[0] + 0.12, root[1], "stator,\nangle = 135°", color="C0", va="center")
    arrow(ax, (0.05, -0.8), (-0.75, -0.8), color="C0")
    ax.text(-0.8, -0.95, "the rim moves\nlike this here", color="C0", ha="right", va="center")
    ax.set(xlim=(-2.4, 3.0), ylim=(-1.9, 2.0), title="From node 1 along the shaft")


with house_style():
    figure = Figure(figsize=(2 * COLUMN_WIDTH, 0.85 * COLUMN_WIDTH), layout="constrained")
    FigureCanvasAgg(figure)
    for axes, draw in zip(figure.subplots(1, 2), (side, end), strict=True):
        draw(axes)
        axes.set_aspect("equal")
        axes.axis("off")
    save(figure, Path(__file__).with_suffix(".png"))
