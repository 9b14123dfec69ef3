"""The oscillator x'' + x = cos(spin t) with a wall at 0: its map from impact to impact, in closed form."""

import math

import numpy as np
from scipy.optimize import brentq

RESTITUTION = 0.8


def next_impact(time, speed, spin):
    """Closed form of the flight from an impact at x = 0: when the next one is, and the speed after it."""
    share = 1 / (1 - spin**2)
    a, b = -share * math.cos(spin * time), speed + share * spin * math.sin(spin * time)

    def place(t):
        return a * np.cos(t - time) + b * np.sin(t - time) + share * np.cos(spin * t)

    ahead = time + np.arange(0.01, 30.0, 0.01)
    i = int(np.argmax(place(ahead) >= 0.0))
    end = brentq(place, ahead[i - 1], ahead[i], xtol=1e-14)
    rate = -a * math.sin(end - time) + b * math.cos(end - time) - share * spin * math.sin(spin * end)
    return np.array([end, -RESTITUTION * rate])
