"""How far the motions of two records are from each other."""

import numpy as np

MOTIONS = ("vertical", "horizontal", "torsion", "stator_axial", "stator_lateral")


def largest_difference(one, other):
    """Largest difference of two records, as a share of each signal's size."""
    return max(
        float(np.abs(getattr(one, name) - getattr(other, name)).max() / np.abs(getattr(other, name)).max())
        for name in MOTIONS
    )
