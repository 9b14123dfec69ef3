"""Motions of x'' + 2 z x' + x = cos w t with one impact on a wall at s in n periods, in closed form.

After S. W. Shaw and P. Holmes, J. Sound Vib. 90 (1983) 129-155, with damping: between impacts the motion is
p(t) + (x0 - p0) C + (v0 - p0') S with the fundamental solutions C and S and p = Re(G e^(i w t)). That it
returns to the wall with the speed V after n periods gives p and p' at the impact as linear functions of V,
and p^2 + (p'/w)^2 = |G|^2 is a quadratic equation for it.
"""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple

import numpy as np


class OneImpact(NamedTuple):
    """A motion that hits the wall once in n periods."""

    speed: float  # of approach
    time: float  # of the impact, in the period of the force
    multipliers: np.ndarray  # (2,), larger first
    start: tuple[float, float]  # x and x' at time 0
    reach: float  # largest x in between, the impact left out


def fundamental(damping, time):
    """Both fundamental solutions and their rates."""
    natural = math.sqrt(1.0 - damping**2)
    decay, angle = np.exp(-damping * time), natural * time
    cosine, sine = (
        decay * (np.cos(angle) + damping / natural * np.sin(angle)),
        decay * np.sin(angle) / natural,
    )
    return cosine, sine, -sine, cosine - 2 * damping * sine


def quadratic(frequency, damping, wall, restitution, n):
    """Coefficients of the equation for the speed, highest first, and p and p' at the impact as (2, 2)."""
    cosine, sine, cosine_rate, sine_rate = fundamental(damping, 2 * math.pi * n / frequency)
    matrix = np.array([[1 - cosine, -sine], [-cosine_rate, 1 - sine_rate]])
    known = np.array([wall * (1 - cosine), -wall * cosine_rate])
    by_speed = np.array([restitution * sine, 1 + restitution * sine_rate])
    parts = np.linalg.solve(matrix, np.stack([known, by_speed], axis=1))
    (a, b), (c, d) = parts[0], parts[1] / frequency
    return np.array(
        [b * b + d * d, 2 * (a * b + c * d), a * a + c * c - amplitude(frequency, damping) ** 2]
    ), parts


def amplitude(frequency, damping):
    """Of the motion without impacts."""
    return 1.0 / abs(complex(1 - frequency**2, 2 * damping * frequency))


def motions(frequency, damping, wall, restitution, n):
    """Those with a speed above 0, the faster first; some may pass through the wall in between (`reach`)."""
    coefficients, parts = quadratic(frequency, damping, wall, restitution, n)
    found = []
    for root in np.roots(coefficients):
        if abs(root.imag) > 1e-12 or root.real <= 0.0:
            continue
        speed = float(root.real)
        place, rate = parts @ [1.0, speed]
        response = 1.0 / complex(1 - frequency**2, 2 * damping * frequency)
        time = (
            cmath.phase(complex(place, -rate / frequency) / response) / frequency % (2 * math.pi / frequency)
        )
        period = 2 * math.pi * n / frequency

        def at(since, time=time, speed=speed, response=response, place=place, rate=rate):
            cosine, sine, cosine_rate, sine_rate = fundamental(damping, since)
            turned = response * np.exp(1j * frequency * (time + since))
            x = turned.real + (wall - place) * cosine - (restitution * speed + rate) * sine
            v = (1j * frequency * turned).real + (wall - place) * cosine_rate
            return x, v - (restitution * speed + rate) * sine_rate

        cosine, sine, cosine_rate, sine_rate = fundamental(damping, period)
        force = math.cos(frequency * time) - wall
        before, behind = force - 2 * damping * speed, force + 2 * damping * restitution * speed
        # Changes of the time of an impact and of the speed behind it, and what they are at the next one.
        left = -restitution * speed
        place_change = np.array([-left * cosine - behind * sine, sine])
        rate_change = np.array([-left * cosine_rate - behind * sine_rate, sine_rate])
        delay = -place_change / speed
        matrix = np.stack([delay, -restitution * (rate_change + before * delay)])
        values = np.linalg.eigvals(matrix)
        start = at((-time) % period)
        inner = at(np.linspace(0.02, 0.98, 4001) * period)[0]
        found.append(
            OneImpact(
                speed,
                time,
                values[np.argsort(-np.abs(values))],
                (float(start[0]), float(start[1])),
                float(inner.max()),
            )
        )
    return sorted(found, key=lambda one: -one.speed)
