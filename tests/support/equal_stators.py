"""Rigs in a ring of equal stators."""

import math
from dataclasses import replace


def in_ring(rig, count, *, first=0.0, **changed):
    """The rig with so many stators as its first, the first of them at an angle (rad), with keys changed."""
    angles = (first + 2.0 * math.pi * i / count for i in range(count))
    return replace(rig, stator=tuple(replace(rig.stator[0], angle=angle, **changed) for angle in angles))
