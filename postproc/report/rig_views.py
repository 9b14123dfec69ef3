"""The rig to scale, as SVG: from the side, and its disc along the shaft with the stators around it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.rig.rotors import Rotor
from rubhpc.rig.stators import LumpedStator, Stator

if TYPE_CHECKING:
    from rubhpc.rig.bearing_table import AnyBearing
    from rubhpc.rig.parts import Disc, Tube
    from rubhpc.rig.rig import Rig
    from rubhpc.rig.stators import AnyStator

    Point = tuple[float, float]

_SIDE_WIDTH, _END_WIDTH, _HEIGHT = 620.0, 270.0, 250.0  # px
_MARGIN = 34.0
SIDES = (0.0, math.pi)  # angles at which a bore is cut, from the side
AROUND = (0.0, 0.5 * math.pi, math.pi, 1.5 * math.pi)
_LUMPED_DEPTH = 0.35  # of the rim's radius: how deep a stator without a shape is drawn
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


def end_view(rig: Rig) -> str:
    """Return an SVG drawing of the disc whose motion is recorded and of its stators; "" without any."""
    if not rig.stator:
        return ""
    around = [s for s in rig.stator if s.node == rig.stator[0].node]
    rim = max(rig.contact_radius(s) or 0.0 for s in around)
    places = [tip_and_root(s, rig.contact_radius(s) or rim) for s in around]
    far = max([rim, *(rim + depth(s, rim) for s in around if s.is_bore)])
    corners = [(-far, -far), (far, far), *(point for place in places for point in place)]
    left, right = min(z for z, _ in corners), max(z for z, _ in corners)
    low, high = min(y for _, y in corners), max(y for _, y in corners)
    scale = min((_END_WIDTH - 2 * _MARGIN) / (right - left), (_HEIGHT - 30) / (high - low))
    room = BAND + SPRING if rig.carrier else 0.0
    frame = Frame(scale, (_END_WIDTH - scale * (right + left)) / 2, 23 + room + scale * high)
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
            (angle, math.hypot(*root))
            for s, (_, root) in zip(around, places, strict=True)
            if s.carrier == carrier.name
            for angle in (AROUND if s.is_bore else (s.angle,))
        ]
        parts += _carrier(frame, carried)
    for stator, place in zip(around, places, strict=True):
        parts.append(_hole(frame, stator, rim) if stator.is_bore else _turned_stator(frame, stator, *place))
    parts.append(_spin(frame, 0.55 * scale * rim))
    parts.append(scale_bar(frame, frame.x(left), bottom + 18))
    angles = ", ".join(f"{math.degrees(s.angle):.4g}°" for s in around if not s.is_bore)
    known = [f"stators at {angles} from straight up"] if angles else []
    known += ["a bore"] if any(s.is_bore for s in around) else []
    title = f"Along the shaft, to scale: {' and '.join(known)}; positive spin is clockwise"
    if rig.carrier:
        title += f"; carriers, not to scale: {', '.join(carrier.name for carrier in rig.carrier)}"
    return svg(_END_WIDTH, bottom + FOOT, parts, title)


def depth(stator: AnyStator, radius: float) -> float:
    """Return how far a stator reaches from the rim, m; one without a shape is given some."""
    return stator.length if isinstance(stator, Stator) else _LUMPED_DEPTH * radius


def tip_and_root(stator: AnyStator, radius: float, angle: float | None = None) -> tuple[Point, Point]:
    """Return where a stator, or a bore at an angle, begins and ends in the plane (z, y), m."""
    angle = stator.angle if angle is None else angle
    sine, cosine = math.sin(angle), math.cos(angle)
    far = radius + depth(stator, radius)
    return (radius * sine, radius * cosine), (far * sine, far * cosine)


def _hole(frame: Frame, stator: AnyStator, radius: float) -> str:
    """Return a ring around the disc; its thickness has no meaning."""
    deep = frame.scale * depth(stator, radius)
    middle = frame.scale * radius + deep / 2 + 2
    at = f'cx="{frame.x0:.1f}" cy="{frame.y0:.1f}" r="{middle:.1f}"'
    return (
        f'<circle class="stator lumped" {at} style="fill:none;stroke-width:{deep:.1f};stroke-opacity:.25"/>'
    )


def _turned_stator(frame: Frame, stator: AnyStator, tip: Point, root: Point) -> str:
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


def side_view(rig: Rig) -> str:
    """Return an SVG drawing, or "" of a rotor that is known by its matrices alone."""
    if not isinstance(rig.rotor, Rotor):
        return ""
    rotor = rig.rotor
    length = sum(s.length for s in rotor.shaft)
    above, below = _reach(rig, rotor)
    scale = min((_SIDE_WIDTH - 2 * _MARGIN) / length, (_HEIGHT - 30) / (above + below))
    room = BAND + SPRING if rig.carrier else 0.0
    frame = Frame(scale, (_SIDE_WIDTH - scale * length) / 2, 15 + room + max(scale * above, 22))
    bottom = frame.y0 + max(scale * below, 34) + room
    nodes = [math.nan, *rotor.positions.tolist()]  # the first stands at index 1
    parts = [line(frame.x(0) - 16, frame.y0, frame.x(length) + 16, frame.y0, "axis")]
    parts += [_stator(frame, nodes[s.node], s, rig.contact_radius(s) or 0.0) for s in rig.stator]
    parts += _carriers(frame, nodes, rig)
    parts += _sections(frame, rotor)
    parts += [_disc(frame, nodes[rotor.node_of(d)], d) for d in rotor.disc]
    parts += [_bearing(frame, nodes[rotor.node_of(b)], rotor, b) for b in rotor.bearing]
    unbalanced = [rotor.node_of(u) for u in rotor.unbalance if u.mass * u.radius]
    parts += [_unbalance(frame, nodes[node], rotor, node) for node in unbalanced]
    parts.append(scale_bar(frame, frame.x(0), bottom + 18))
    return svg(_SIDE_WIDTH, bottom + FOOT, parts, f"{rig.name} from the side, to scale: {description(rig)}")


def description(rig: Rig) -> str:
    """Return the rig in a sentence, with its main dimensions."""
    stators = _counted(len(rig.stator), "stator")
    if not isinstance(rig.rotor, Rotor):
        return f"rotor of {_counted(len(rig.rotor.degrees), 'degree')} of freedom, by its matrices; {stators}"
    shaft = rig.rotor.shaft
    length = sum(s.length for s in shaft)
    diameters = sorted({d * 1e3 for s in shaft for d in s.diameters[0]})
    across = " to ".join(f"{d:.4g}" for d in (diameters[0], diameters[-1])[: len(diameters)])
    counts = [_counted(len(rig.rotor.disc), "disc"), _counted(len(rig.rotor.bearing), "bearing"), stators]
    if rig.rotor.sleeve:
        counts.insert(0, _counted(len(rig.rotor.sleeve), "sleeve"))
    if rig.carrier:
        counts.append(_counted(len(rig.carrier), "carrier"))
    return f"shaft of {length * 1e3:.4g} mm, {across} mm across, {', '.join(counts)}"


def _counted(n: int, noun: str) -> str:
    return f"{n or 'no'} {noun}{'' if n == 1 else 's'}"


def _reach(rig: Rig, rotor: Rotor) -> tuple[float, float]:
    """Return how far the rig reaches above and below the shaft's axis, m."""
    ends = [_radius(rotor), *(_rim(d) for d in rotor.disc)]
    above, below = max(ends), max(ends)
    for stator in rig.stator:
        for angle in SIDES if stator.is_bore else (stator.angle,):
            for _, y in tip_and_root(stator, rig.contact_radius(stator) or 0.0, angle):
                above, below = max(above, y), max(below, -y)
    return above, below


def _rim(disc: Disc) -> float:
    """Return the radius of a disc, m; of one known by its inertia alone, that of gyration."""
    if disc.diameter is not None:
        return disc.diameter / 2
    mass, _, polar = disc.inertia
    return math.sqrt(2 * polar / mass) if mass else 0.0


def _radius(rotor: Rotor) -> float:
    """Return the greatest outer radius of the shaft and its sleeves, m."""
    return max(max(tube.diameters[0]) for tube in (*rotor.shaft, *rotor.sleeve)) / 2


def _sections(frame: Frame, rotor: Rotor) -> list[str]:
    starts = np.cumsum([0.0, *(section.length for section in rotor.shaft)]).tolist()
    tubes: list[tuple[float, Tube]] = [*zip(starts, rotor.shaft, strict=False)]
    tubes += [(rotor.positions[rotor.node_of(sleeve) - 1], sleeve) for sleeve in rotor.sleeve]
    parts = []
    for start, tube in tubes:
        left, right = frame.x(start), frame.x(start + tube.length)
        (a, b), bores = ([frame.scale * d / 2 for d in ends] for ends in tube.diameters)
        a, b = max(a, LEAST / 2), max(b, LEAST / 2)
        edge = [(left, -a), (right, -b), (right, b), (left, a)]
        points = " ".join(f"{x:.1f},{frame.y0 + y:.1f}" for x, y in edge)
        parts.append(f'<polygon class="shaft" points="{points}"/>')
        if any(bores):
            first, last = bores
            parts += [
                line(left, frame.y0 + side * first, right, frame.y0 + side * last, "bore") for side in (-1, 1)
            ]
    return parts


def _disc(frame: Frame, at: float, disc: Disc) -> str:
    half = max(frame.scale * _rim(disc), 3.0)
    width = max(frame.scale * (disc.thickness or 0.0), LEAST)
    kind = "disc" if disc.diameter is not None else "disc lumped"
    return rect(frame.x(at) - width / 2, frame.y0 - half, width, 2 * half, kind)


def _stator(frame: Frame, at: float, stator: AnyStator, radius: float) -> str:
    if stator.is_bore:
        return "".join(_section(frame, at, stator, radius, angle) for angle in SIDES)
    return _section(frame, at, stator, radius, stator.angle)


def _section(frame: Frame, at: float, stator: AnyStator, radius: float, angle: float) -> str:
    (_, tip), (_, root) = tip_and_root(stator, radius, angle)
    is_beam = isinstance(stator, Stator)
    along, across = stator.sides if isinstance(stator, Stator) else (0.0, 0.0)
    width = max(frame.scale * along, LEAST if is_beam else 14.0)
    high = max(frame.scale * across, LEAST)
    top, bottom = sorted((frame.y(tip), frame.y(root)))
    kind = "stator" if is_beam else "stator lumped"
    if bottom - top < high:  # it points at the reader, or away
        return rect(frame.x(at) - width / 2, (top + bottom - high) / 2, width, high, f"{kind} hidden")
    part = rect(frame.x(at) - width / 2, top, width, bottom - top, kind)
    side = -1 if depth(stator, radius) * math.cos(angle) > 0 else 1
    if stator.carrier is not None:
        return part
    return part + wall(frame.x(at) - 12, frame.x(at) + 12, frame.y(root), side)


def _carriers(frame: Frame, nodes: list[float], rig: Rig) -> list[str]:
    """Return pieces of the carriers on springs, above and below the shaft, where stators reach farthest."""
    farthest: dict[tuple[str, int, int], float] = {}  # carrier, node and side -> height, m
    for stator in rig.stator:
        _, (_, root) = tip_and_root(stator, rig.contact_radius(stator) or 0.0)
        if stator.is_bore and stator.carrier is not None:
            farthest[stator.carrier, stator.node, -1] = root
            farthest[stator.carrier, stator.node, 1] = -root
        elif stator.carrier is not None and abs(root) > 1e-3 * (depth(stator, 1.0) or 1.0):
            place = stator.carrier, stator.node, -1 if root > 0 else 1
            farthest[place] = max(farthest.get(place, root), root, key=abs)
    parts = []
    for (_, node, side), root in farthest.items():
        x, y = frame.x(nodes[node]), frame.y(root)
        parts.append(rect(x - 16, y if side > 0 else y - BAND, 32, BAND, "carrier"))
        parts.append(spring(x, y + side * BAND, side))
    return parts


def _bearing(frame: Frame, at: float, rotor: Rotor, bearing: AnyBearing) -> str:
    ends, end = [], 0.0
    for section in rotor.shaft:
        end += section.length
        ends.append((end, max(section.diameters[0]) / 2))
    radius = next((r for e, r in ends if at <= e * (1 + 1e-9)), ends[-1][1])
    top = frame.y0 + max(frame.scale * radius, LEAST / 2)
    x = frame.x(at)
    support = f'<path class="bearing" d="M{x:.1f},{top:.1f}l-8,13h16z"/>'
    if bearing.pedestal is None:
        return support + wall(x - 11, x + 11, top + 14, 1)
    return support + rect(x - 8, top + 13, 16, 6, "carrier") + wall(x - 11, x + 11, top + 20, 1)


def _unbalance(frame: Frame, at: float, rotor: Rotor, node: int) -> str:
    rims = [_rim(d) for d in rotor.disc if rotor.node_of(d) == node]
    y = frame.y(0.72 * max([*rims, _radius(rotor)]))
    return f'<circle class="unbalance" cx="{frame.x(at):.1f}" cy="{y:.1f}" r="3.2"/>'
