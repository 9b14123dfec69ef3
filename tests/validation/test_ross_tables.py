"""A rotor on bearings and a seal that depend on the speed, against ROSS 3.1.0.

`tests/data/ross_3.1.0_tables.py` wrote the answers of ROSS into the file of the same name beside it.
"""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from closed_form import run_up
from scipy.interpolate import CubicSpline

from rubhpc import LumpedStator, Rig, Unbalance, assemble
from rubhpc.fem.modes import modes
from rubhpc.fem.response import steady_response
from rubhpc.rig.bearing_table import BearingTable
from rubhpc.rig.parts import Disc, ShaftSection
from rubhpc.rig.rotors import Rotor
from rubhpc.study.speed_law import SpeedLaw

PAIRS = ("xx", "xy", "yx", "yy")
RIGHT = math.pi / 2  # ROSS counts phases from x, a quarter turn before y
UNBALANCE = (
    Unbalance(node=5, mass=0.002, radius=1.0, phase=0.3 - RIGHT),
    Unbalance(node=13, mass=0.0005, radius=1.0, phase=1.9 - RIGHT),
)


@pytest.fixture(scope="module")
def known(request):
    return np.load(request.path.parents[1] / "data" / "ross_3.1.0_tables.npz")


def ross_rotor(known):
    """What `Rig.from_ross` reads of the rotor; matrices at the one speed at which they were stored."""

    def matrix(name):
        entries = np.zeros((known["n_dof"], known["n_dof"]))
        entries[tuple(known[f"{name}_at"])] = known[name]
        return entries

    def at(speed, value):
        assert speed == known["at"]
        return value

    def bearing(i):
        coefficients = {f"{k}{pair}": known[f"bearing{i}_{k}{pair}"].tolist() for k in "kc" for pair in PAIRS}
        return SimpleNamespace(
            n=int(known[f"bearing{i}_n"]),
            n_link=None,
            speed=known[f"bearing{i}_speed"],
            frequency=None,
            interpolation="pchip",
            K=lambda speed: at(speed, known[f"bearing{i}_K"]),
            C=lambda speed: at(speed, known[f"bearing{i}_C"]),
            **coefficients,
        )

    return SimpleNamespace(
        number_dof=6,
        nodes=range(int(known["n_dof"]) // 6),
        L=float(known["length"]),
        bearing_elements=[bearing(i) for i in range(3)],
        M=lambda speed: at(speed, matrix("M")),
        C=lambda speed: at(speed, matrix("C")),
        K=lambda speed: at(speed, matrix("K")),
        G=lambda: matrix("G"),
    )


@pytest.fixture(scope="module")
def from_ross(known):
    return Rig.from_ross(ross_rotor(known), unbalance=UNBALANCE)


@pytest.fixture(scope="module")
def ours(known):
    """The same rotor, built here, its bearings turned from (x, y) of ROSS to (-w, v)."""
    steel = {"youngs_modulus": 210e9, "shear_modulus": 79.6e9, "density": 7800.0}
    tables = [
        BearingTable(
            node=int(known[f"bearing{i}_n"]) + 1,
            speed=known[f"bearing{i}_speed"],
            **{
                f"{k}{here}": sign * known[f"bearing{i}_{k}{theirs}"]
                for k in "kc"
                for here, theirs, sign in (
                    ("yy", "yy", 1),
                    ("yz", "yx", -1),
                    ("zy", "xy", -1),
                    ("zz", "xx", 1),
                )
            },
        )
        for i in range(3)
    ]
    discs = ((5, 20.0, 0.15, 0.28), (8, 25.0, 0.20, 0.37), (13, 9.0, 0.05, 0.09))
    rotor = Rotor(
        shaft=(ShaftSection(length=1.2, outer_diameter=0.05, elements=12, **steel),),
        disc=tuple(Disc(node=n, mass=m, diametral_inertia=d, polar_inertia=p) for n, m, d, p in discs),
        bearing=tuple(tables),
        unbalance=UNBALANCE,
    )
    return Rig(name="ours", rotor=rotor)


@pytest.mark.parametrize("which", ["from_ross", "ours"])
def test_campbell_diagram_of_ross(request, known, which):
    model = assemble(request.getfixturevalue(which))
    for speed, theirs in zip(known["speeds"], known["eigenvalues"], strict=True):
        lateral = [
            m.eigenvalue for m in modes(model.rotor, speed) if m.kind == "lateral" and m.frequency > 1.0
        ]
        oscillating = [value for value in lateral if value.imag > 0.0][:8]
        assert len(oscillating) == 8
        for value in oscillating:
            assert np.abs(theirs - value).min() < 1e-6 * abs(value), (speed, value)


@pytest.mark.parametrize("which", ["from_ross", "ours"])
def test_unbalance_response_of_ross(request, known, which):
    model = assemble(request.getfixturevalue(which))
    for i_speed, speed in enumerate(known["speeds"]):
        found, theirs = steady_response(model, speed), known["response"][:, i_speed]
        for node in range(13):
            v, w = found[model.rotor.index(node + 1, "v")], found[model.rotor.index(node + 1, "w")]
            pair = np.array([v, w])
            expected = np.array([theirs[6 * node + 1], -theirs[6 * node]])
            assert np.abs(pair - expected).max() < 1e-6 * np.abs(expected).max(), (speed, node)


@pytest.mark.long
def test_run_up_of_ross(request, known, ours):
    """In ROSS by Newmark's method, from two steps to their limit, here in pieces: nearer in order 2.

    The speed rises by 450 rad/s each second, 1 to 8 % a piece; bearings follow their tables.
    """
    answers = np.load(request.path.parents[1] / "data" / "ross_3.1.0_run_up.npz")
    fine, coarse = answers["response_10"], answers["response_5"]
    limit = (4.0 * fine - coarse) / 3.0
    times = np.arange(limit.shape[1]) / answers["rate"]
    law = {name: float(answers[name]) for name in ("start", "stop", "time")}
    rig = replace(ours, stator=(LumpedStator(node=5, mass=1.0, stiffness=1e6, damping=10.0, radius=0.1),))
    probes = [
        {"name": f"{name}_{node + 1}", "node": int(node) + 1, "angle": angle}
        for node in answers["nodes"]
        for name, angle in (("aside", -math.pi / 2), ("up", 0.0))
    ]
    errors = []
    for pieces in (2, 4):
        found = run_up(
            rig,
            **law,
            clearance=1.0,
            accuracy=1e-4,
            initial={"from": "rest"},
            samples_per_revolution=32,
            pieces_per_revolution=pieces,
            probes=probes,
        )
        turned = 2.0 * math.pi * np.arange(found.sizes["sample"]) / 32
        at = SpeedLaw(time=(0.0, law["time"]), speed=(law["start"], law["stop"])).at_angle(turned)[0]
        expected = CubicSpline(times, limit, axis=1)(at)
        signals = np.array([found[f"probe_{probe['name']}"].values for probe in probes])
        errors.append(np.linalg.norm(signals - expected) / np.linalg.norm(expected))
    assert np.linalg.norm(fine - limit) < 3e-4 * np.linalg.norm(limit)
    assert errors[1] < 3e-4
    assert errors[1] < errors[0] / 3.0
