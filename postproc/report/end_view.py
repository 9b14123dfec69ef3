"""The rubbing disc along the shaft, to scale, with the stators around it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from postproc.report.drawing import BAND, FOOT, LEAST, SPRING, Frame, line, scale_bar, spring, svg, wall
from rubhpc.rig.rotors import Rotor
from rubhpc.rig.stators import LumpedStator, Stator

if TYPE_CHECKING:
    from rubhpc.rig.rig import Rig
    from rubhpc.rig.stators import AnyStator

    Point = tuple[float, float]

_WIDTH, _HEIGHT = 270.0, 250.0  # px
_MARGIN = 34.0
_LUMPED_DEPTH = 0.35  # of the rim's radius: how deep a stator without a shape is drawn


def end_view(rig: Rig) -> str:
    """Return an SVG drawing of the disc whose motion is recorded and of its stators; "" without any."""
    if not rig.stator:
        return ""
    around = [s for s in rig.stator if s.node == rig.stator[0].node]
    rim = max(rig.contact_radius(s) or 0.0 for s in around)
    places = [tip_and_root(s, rig.contact_radius(s) or rim) for s in around]
    corners = [(-rim, -rim), (rim, rim), *(point for place in places for point in place)]
    left, right = min(z for z, _ in corners), max(z for z, _ in corners)
    low, high = min(y for _, y in corners), max(y for _, y in corners)
    scale = min((_WIDTH - 2 * _MARGIN) / (right - left), (_HEIGHT - 30) / (high - low))
    room = BAND + SPRING if rig.carrier else 0.0
    frame = Frame(scale, (_WIDTH - scale * (right + left)) / 2, 23 + room + scale * high)
    bottom = frame.y(low) + 14 + room
    parts = [
        f'<circle class="disc" cx="{frame.x0:.1f}" cy="{frame.y0:.1f}" r="{scale * rim:.1f}"/>',
        line(frame.x(-rim) - 10, frame.y0, frame.x(rim) + 10, frame.y0, "axis"),
        line(frame.x0, frame.y(-rim) + 10, frame.x0, frame.y(rim) - 10, "axis"),
    ]
    if isinstance(rig.rotor, Rotor):
        shaft = max(scale * max(max(s.diameters[0]) for s in rig.rotor.shaft) / 2, 2)
        parts.append(f'<circle class="shaft" cx="{frame.x0:.1f}" cy="{frame.y0:.1f}" r="{shaft:.1f}"/>')
    for carrier in rig.carrier:
        carried = [
            (s.angle, math.hypot(*far))
            for s, (_, far) in zip(around, places, strict=True)
            if s.carrier == carrier.name
        ]
        parts += _carrier(frame, carried)
    parts += [_stator(frame, s, *place) for s, place in zip(around, places, strict=True)]
    parts.append(_spin(frame, 0.55 * scale * rim))
    parts.append(scale_bar(frame, frame.x(left), bottom + 18))
    angles = ", ".join(f"{math.degrees(s.angle):.4g}°" for s in around)
    title = f"Along the shaft, to scale: stators at {angles} from straight up; positive spin is clockwise"
    if rig.carrier:
        title += f"; carriers, not to scale: {', '.join(carrier.name for carrier in rig.carrier)}"
    return svg(_WIDTH, bottom + FOOT, parts, title)


def depth(stator: AnyStator, radius: float) -> float:
    """Return how far a stator reaches from the rim, m; one without a shape is given some."""
    return stator.length if isinstance(stator, Stator) else _LUMPED_DEPTH * radius


def tip_and_root(stator: AnyStator, radius: float) -> tuple[Point, Point]:
    """Return where a stator begins and ends in the plane (z, y), m."""
    sine, cosine = math.sin(stator.angle), math.cos(stator.angle)
    far = radius + depth(stator, radius)
    return (radius * sine, radius * cosine), (far * sine, far * cosine)


def _stator(frame: Frame, stator: AnyStator, tip: Point, root: Point) -> str:
    """Return a beam, or a box for a body without a shape, turned into its place, with the wall behind it."""
    height = stator.sides[1] if isinstance(stator, Stator) else 0.0
    half = max(frame.scale * height / 2, LEAST / 2 if height else 7.0)
    deep = frame.scale * math.hypot(root[0] - tip[0], root[1] - tip[1])
    is_wall = isinstance(stator, LumpedStator) and stator.rigid
    kind = "stator" if height else "stator lumped"
    box = f'<rect class="{kind}" x="{-half:.1f}" y="{-deep:.1f}" width="{2 * half:.1f}" height="{deep:.1f}"/>'
    foot = wall(-12, 12, -deep, -1) if stator.carrier is None else ""
    body = wall(-12, 12, 0.0, -1) if is_wall else box + foot
    place = f"translate({frame.x(tip[0]):.1f} {frame.y(tip[1]):.1f}) rotate({math.degrees(stator.angle):.2f})"
    return f'<g transform="{place}">{body}</g>'


def _carrier(frame: Frame, carried: list[tuple[float, float]]) -> list[str]:
    """Return a band behind stators, of which angle and distance of the root (m) are given, and its spring.

    It runs around the shaft except for the widest gap between two of them, above a third of a turn.
    """
    if not carried:
        return []
    angles = sorted(angle % math.tau for angle, _ in carried)
    radius = frame.scale * max(far for _, far in carried) + BAND / 2
    gaps = [(b - a, b) for a, b in zip(angles, [*angles[1:], angles[0] + math.tau], strict=True)]
    gap, first = max(gaps)
    if gap <= math.tau / 3:
        at = math.pi
        band = f'<circle class="carrier" cx="{frame.x0:.1f}" cy="{frame.y0:.1f}" r="{radius:.1f}"/>'
    else:
        ends = first - 0.15, first + math.tau - gap + 0.15
        at = sum(ends) / 2
        (x1, y1), (x2, y2) = [
            (frame.x0 + radius * math.sin(a), frame.y0 - radius * math.cos(a)) for a in ends
        ]
        is_long = int(ends[1] - ends[0] > math.pi)
        arc = f"M{x1:.1f},{y1:.1f}A{radius:.1f},{radius:.1f} 0 {is_long} 1 {x2:.1f},{y2:.1f}"
        band = f'<path class="carrier" d="{arc}"/>'
    place = f"translate({frame.x0:.1f} {frame.y0:.1f}) rotate({math.degrees(at):.2f})"
    return [band, f'<g class="support" transform="{place}">{spring(0.0, -radius - BAND / 2, -1)}</g>']


def _spin(frame: Frame, radius: float) -> str:
    """Return an arrow in the sense of positive spin, which turns up towards the right."""
    start, stop = math.radians(-60), math.radians(60)
    x1, y1 = frame.x0 + radius * math.sin(start), frame.y0 - radius * math.cos(start)
    x2, y2 = frame.x0 + radius * math.sin(stop), frame.y0 - radius * math.cos(stop)
    turn = math.degrees(stop)
    head = (
        f'<path class="head" d="M0,0l-9,-4v8z" transform="translate({x2:.1f} {y2:.1f}) rotate({turn:.0f})"/>'
    )
    arc = f"M{x1:.1f},{y1:.1f}A{radius:.1f},{radius:.1f} 0 0 1 {x2:.1f},{y2:.1f}"
    return f'<path class="spin" d="{arc}"/>{head}'
