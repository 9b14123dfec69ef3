"""Rotors of the ROSS that is installed, against its own answers; run where ROSS 3 is (Python 3.12).

Printed: the largest relative difference of lateral eigenvalues, and of the unbalance response at all nodes,
at speeds between those of the tables. What ROSS 3.1.0 answered once is held by test_ross_tables.py.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import ross

sys.path.append(str(Path(__file__).parents[1] / "support"))
from ross_answers import differences


def three_discs() -> ross.Rotor:
    """Two unlike bearings with tables, and a seal; the last disc is overhung."""
    steel = ross.Material("steel_1", rho=7800.0, E=210e9, G_s=79.6e9)
    shaft = [ross.ShaftElement(0.1, 0.0, 0.05, material=steel) for _ in range(12)]
    discs = [
        ross.DiskElement(n=n, m=m, Id=d, Ip=p)
        for n, m, d, p in ((4, 20.0, 0.15, 0.28), (7, 25.0, 0.20, 0.37), (12, 9.0, 0.05, 0.09))
    ]
    supports = [bearing(0, 1.0), bearing(10, 1.4)]
    speed, cross = np.array([0.0, 500.0, 1000.0]), np.array([1e5, 4e5, 9e5])
    seal = {"kxx": [-2e5, -3e5, -5e5], "cxx": [300.0, 280.0, 250.0], "kxy": list(cross), "kyx": list(-cross)}
    return ross.Rotor(shaft, discs, [*supports, ross.SealElement(n=6, speed=speed, **seal)])


def overhung() -> ross.Rotor:
    """Three unlike bearings with tables, and a hollow end with a disc."""
    steel = ross.Material("steel_2", rho=7850.0, E=205e9, G_s=79e9)
    shaft = [ross.ShaftElement(0.08, 0.0, 0.04, material=steel) for _ in range(6)]
    shaft += [ross.ShaftElement(0.05, 0.01, 0.06, material=steel) for _ in range(6)]
    discs = [
        ross.DiskElement(n=12, m=11.0, Id=0.06, Ip=0.11),
        ross.DiskElement(n=3, m=4.0, Id=0.01, Ip=0.018),
    ]
    return ross.Rotor(shaft, discs, [bearing(0, 1.0), bearing(6, 0.7), bearing(10, 1.3)])


def bearing(node: int, factor: float) -> ross.BearingElement:
    """Coefficients that rise or fall with the speed, at nine speeds."""
    speed = np.linspace(30.0, 900.0, 9)
    rising = speed / 900.0
    table = {
        "kxx": 2e7 - 6e6 * rising**2,
        "kyy": 3e7 - 9e6 * rising,
        "kxy": 4e6 * rising,
        "kyx": -7e6 * rising**2,
        "cxx": 5e4 - 3e4 * rising,
        "cyy": 7e4 - 5e4 * rising,
    }
    given = {name: list(factor * values) for name, values in table.items()}
    return ross.BearingElement(n=node, speed=speed, **given)


if __name__ == "__main__":
    print(f"ROSS {ross.__version__}, Python {sys.version.split()[0]}")
    between = np.array([45.0, 97.3, 150.0, 201.7, 333.3, 420.0, 555.5, 700.0, 880.0])
    for build in (three_discs, overhung):
        values, response = differences(build(), between, [3, 12])
        print(f"{build.__name__}: eigenvalues {values:.1e}, response {response:.1e}")
