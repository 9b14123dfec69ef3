"""Parts of a drawing to scale, as SVG: lines, boxes, walls and a bar of a round length."""

from __future__ import annotations

import math
from dataclasses import dataclass
from html import escape

LEAST = 2.5  # px: a thing that is thinner would not be seen
SPRING = 16.0  # px: length of a spring
BAND = 7.0  # px: thickness of a carrier, whose shape nobody knows
FOOT = 40.0  # px below a drawing, for its bar


@dataclass(frozen=True)
class Frame:
    """Pixels of a point: `scale` px a metre, with the origin at `x0`, `y0`."""

    scale: float
    x0: float
    y0: float

    def x(self, along: float) -> float:
        """Return pixels from the left."""
        return self.x0 + self.scale * along

    def y(self, up: float) -> float:
        """Return pixels from the top."""
        return self.y0 - self.scale * up


def wall(left: float, right: float, y: float, side: int) -> str:
    """Return a hatched wall; `side` is -1 where its ground lies above."""
    ticks = "".join(
        f"M{x:.1f},{y:.1f}l5,{side * 6}" for x in (left + i * (right - left - 5) / 4 for i in range(5))
    )
    return f'<path class="wall" d="M{left:.1f},{y:.1f}H{right:.1f}{ticks}"/>'


def spring(x: float, y: float, side: int) -> str:
    """Return a spring to a wall; `side` is -1 where the wall lies above."""
    turns = "".join(f"l{8 * (-1) ** i},{side * 3}" for i in range(3))
    path = f"M{x:.1f},{y:.1f}v{side * 2}l-4,{side * 1.5:.1f}{turns}l-4,{side * 1.5:.1f}v{side * 2}"
    return f'<path class="spring" d="{path}"/>' + wall(x - 12, x + 12, y + side * SPRING, side)


def scale_bar(frame: Frame, left: float, y: float) -> str:
    """Return a bar of a round length, with it."""
    wished = 90 / frame.scale
    power = 10.0 ** math.floor(math.log10(wished))
    length = max(step * power for step in (1, 2, 5) if step * power <= wished)
    width = frame.scale * length
    text = f"{length:g} m" if length >= 1 else f"{length * 1e3:g} mm"
    bar = f'<path class="bar" d="M{left:.1f},{y - 4:.1f}v8m0,-4h{width:.1f}m0,-4v8"/>'
    return f'{bar}<text x="{left + width + 8:.1f}" y="{y + 5:.1f}">{escape(text)}</text>'


def rect(x: float, y: float, width: float, height: float, kind: str) -> str:
    """Return a rectangle."""
    return f'<rect class="{kind}" x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}"/>'


def line(x1: float, y1: float, x2: float, y2: float, kind: str) -> str:
    """Return a line."""
    return f'<path class="{kind}" d="M{x1:.1f},{y1:.1f}L{x2:.1f},{y2:.1f}"/>'


def svg(width: float, height: float, parts: list[str], title: str) -> str:
    """Return the drawing, named for those who cannot see it."""
    body = "".join(parts)
    size = f'viewBox="0 0 {width:.0f} {height:.0f}" style="max-width:{width:.0f}px"'
    return f'<svg class="drawing" role="img" aria-label="{escape(title)}" {size}>{body}</svg>'
