"""The rig from the side, to scale: shaft, discs, bearings, unbalances and stators."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from postproc.report.drawing import BAND, FOOT, LEAST, SPRING, Frame, line, rect, scale_bar, spring, svg, wall
from postproc.report.end_view import depth, tip_and_root
from rubhpc.rig.rotors import Rotor
from rubhpc.rig.stators import Stator

if TYPE_CHECKING:
    from rubhpc.rig.bearing_table import AnyBearing
    from rubhpc.rig.parts import Disc
    from rubhpc.rig.rig import Rig
    from rubhpc.rig.stators import AnyStator
    from rubhpc.rig.tubes import Tube

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
    return svg(_WIDTH, bottom + FOOT, parts, f"{rig.name} from the side, to scale: {description(rig)}")


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
        for _, y in tip_and_root(stator, rig.contact_radius(stator) or 0.0):
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
