"""The rig from the side, to scale: shaft, discs, bearings, unbalances and stators."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from postproc.report.drawing import BAND, FOOT, LEAST, SPRING, Frame, line, rect, scale_bar, spring, svg, wall
from postproc.report.end_view import depth, tip_and_root
from rubhpc.rig.rotors import Rotor
from rubhpc.rig.stators import Stator

if TYPE_CHECKING:
    from rubhpc.rig.parts import Disc
    from rubhpc.rig.rig import Rig
    from rubhpc.rig.stators import AnyStator

_WIDTH, _HEIGHT = 620.0, 250.0  # px
_MARGIN = 34.0


def side_view(rig: Rig) -> str:
    """Return an SVG drawing, or "" of a rotor that is known by its matrices alone."""
    if not isinstance(rig.rotor, Rotor):
        return ""
    rotor = rig.rotor
    length = sum(s.length for s in rotor.shaft)
    above, below = _reach(rig, rotor)
    scale = min((_WIDTH - 2 * _MARGIN) / length, (_HEIGHT - 30) / (above + below))
    room = BAND + SPRING if rig.carrier else 0.0
    frame = Frame(scale, (_WIDTH - scale * length) / 2, 15 + room + max(scale * above, 22))
    bottom = frame.y0 + max(scale * below, 34) + room
    nodes = _node_positions(rotor)
    parts = [line(frame.x(0) - 16, frame.y0, frame.x(length) + 16, frame.y0, "axis")]
    parts += [_stator(frame, nodes[s.node], s, rig.contact_radius(s) or 0.0) for s in rig.stator]
    parts += _carriers(frame, nodes, rig)
    parts += _sections(frame, rotor)
    parts += [_disc(frame, nodes[d.node], d) for d in rotor.disc]
    parts += [_bearing(frame, nodes[b.node], rotor) for b in rotor.bearing]
    parts += [_unbalance(frame, nodes[u.node], rotor, u.node) for u in rotor.unbalance if u.mass * u.radius]
    parts.append(scale_bar(frame, frame.x(0), bottom + 18))
    return svg(_WIDTH, bottom + FOOT, parts, f"{rig.name} from the side, to scale: {description(rig)}")


def description(rig: Rig) -> str:
    """Return the rig in a sentence, with its main dimensions."""
    stators = _counted(len(rig.stator), "stator")
    if not isinstance(rig.rotor, Rotor):
        return f"rotor of {_counted(len(rig.rotor.degrees), 'degree')} of freedom, by its matrices; {stators}"
    shaft = rig.rotor.shaft
    length = sum(s.length for s in shaft)
    diameters = sorted({s.outer_diameter * 1e3 for s in shaft})
    across = " to ".join(f"{d:.4g}" for d in (diameters[0], diameters[-1])[: len(diameters)])
    counts = [_counted(len(rig.rotor.disc), "disc"), _counted(len(rig.rotor.bearing), "bearing"), stators]
    if rig.carrier:
        counts.append(_counted(len(rig.carrier), "carrier"))
    return f"shaft of {length * 1e3:.4g} mm, {across} mm across, {', '.join(counts)}"


def _counted(n: int, noun: str) -> str:
    return f"{n or 'no'} {noun}{'' if n == 1 else 's'}"


def _node_positions(rotor: Rotor) -> list[float]:
    """Return the place of each node along the shaft, m; the first stands at index 1."""
    places = [math.nan, 0.0]
    for section in rotor.shaft:
        step, start = section.length / section.elements, places[-1]
        places += [start + step * (i + 1) for i in range(section.elements)]
    return places


def _reach(rig: Rig, rotor: Rotor) -> tuple[float, float]:
    """Return how far the rig reaches above and below the shaft's axis, m."""
    ends = [s.outer_diameter / 2 for s in rotor.shaft] + [_rim(d) for d in rotor.disc]
    above, below = max(ends), max(ends)
    for stator in rig.stator:
        for _, y in tip_and_root(stator, rig.contact_radius(stator) or 0.0):
            above, below = max(above, y), max(below, -y)
    return above, below


def _rim(disc: Disc) -> float:
    """Return the radius of a disc, m; of one known by its inertia alone, that of gyration."""
    if disc.diameter is not None:
        return disc.diameter / 2
    mass, _, polar = disc.inertia
    return math.sqrt(2 * polar / mass) if mass else 0.0


def _sections(frame: Frame, rotor: Rotor) -> list[str]:
    parts, at = [], 0.0
    for section in rotor.shaft:
        half = max(frame.scale * section.outer_diameter / 2, LEAST / 2)
        width = frame.scale * section.length
        parts.append(rect(frame.x(at), frame.y0 - half, width, 2 * half, "shaft"))
        if section.inner_diameter:
            bore = frame.scale * section.inner_diameter / 2
            parts += [
                line(frame.x(at), frame.y0 + side * bore, frame.x(at) + width, frame.y0 + side * bore, "bore")
                for side in (-1, 1)
            ]
        at += section.length
    return parts


def _disc(frame: Frame, at: float, disc: Disc) -> str:
    half = max(frame.scale * _rim(disc), 3.0)
    width = max(frame.scale * (disc.thickness or 0.0), LEAST)
    kind = "disc" if disc.diameter is not None else "disc lumped"
    return rect(frame.x(at) - width / 2, frame.y0 - half, width, 2 * half, kind)


def _stator(frame: Frame, at: float, stator: AnyStator, radius: float) -> str:
    (_, tip), (_, root) = tip_and_root(stator, radius)
    is_beam = isinstance(stator, Stator)
    along, across = stator.sides if isinstance(stator, Stator) else (0.0, 0.0)
    width = max(frame.scale * along, LEAST if is_beam else 14.0)
    high = max(frame.scale * across, LEAST)
    top, bottom = sorted((frame.y(tip), frame.y(root)))
    kind = "stator" if is_beam else "stator lumped"
    if bottom - top < high:  # it points at the reader, or away
        return rect(frame.x(at) - width / 2, (top + bottom - high) / 2, width, high, f"{kind} hidden")
    part = rect(frame.x(at) - width / 2, top, width, bottom - top, kind)
    side = -1 if depth(stator, radius) * math.cos(stator.angle) > 0 else 1
    if stator.carrier is not None:
        return part
    return part + wall(frame.x(at) - 12, frame.x(at) + 12, frame.y(root), side)


def _carriers(frame: Frame, nodes: list[float], rig: Rig) -> list[str]:
    """Return pieces of the carriers on springs, above and below the shaft, where stators reach farthest."""
    farthest: dict[tuple[str, int, int], float] = {}  # carrier, node and side -> height, m
    for stator in rig.stator:
        _, (_, root) = tip_and_root(stator, rig.contact_radius(stator) or 0.0)
        if stator.carrier is not None and abs(root) > 1e-3 * (depth(stator, 1.0) or 1.0):
            place = stator.carrier, stator.node, -1 if root > 0 else 1
            farthest[place] = max(farthest.get(place, root), root, key=abs)
    parts = []
    for (_, node, side), root in farthest.items():
        x, y = frame.x(nodes[node]), frame.y(root)
        parts.append(rect(x - 16, y if side > 0 else y - BAND, 32, BAND, "carrier"))
        parts.append(spring(x, y + side * BAND, side))
    return parts


def _bearing(frame: Frame, at: float, rotor: Rotor) -> str:
    ends, end = [], 0.0
    for section in rotor.shaft:
        end += section.length
        ends.append((end, section.outer_diameter / 2))
    radius = next((r for e, r in ends if at <= e * (1 + 1e-9)), ends[-1][1])
    top = frame.y0 + max(frame.scale * radius, LEAST / 2)
    x = frame.x(at)
    support = f'<path class="bearing" d="M{x:.1f},{top:.1f}l-8,13h16z"/>'
    return support + wall(x - 11, x + 11, top + 14, 1)


def _unbalance(frame: Frame, at: float, rotor: Rotor, node: int) -> str:
    rims = [_rim(d) for d in rotor.disc if d.node == node]
    shaft = max(s.outer_diameter for s in rotor.shaft) / 2
    y = frame.y(0.72 * max([*rims, shaft]))
    return f'<circle class="unbalance" cx="{frame.x(at):.1f}" cy="{y:.1f}" r="3.2"/>'
