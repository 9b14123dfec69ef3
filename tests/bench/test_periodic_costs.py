"""What periodic motions, points of branches and the direct way cost: packaged rig, processor time."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import pytest

from rubhpc import branch, periodic, simulate

if TYPE_CHECKING:
    from collections.abc import Callable

pytestmark = pytest.mark.bench

CASE = {"speed_ratio": 0.75, "clearance": "84 um", "keep": ()}
SOLUTION = 0.005  # s, with multipliers and record, from a state near by; tables shared
POINT = 0.010, 0.020  # s, of a branch, its multipliers and events; along a speed
LIGHT = ((0.9, 0.523, 0.3), (1.3, 0.968, 0.269), (1.6, 0.74, 0.33))  # speed, clearance ratio, friction
FASTER = 5.0  # at 0.1 % of damping, than "auto" to 1e-9


def least(run: Callable[[], Any], rounds: int) -> tuple[float, Any]:
    """Least processor time, s, of some rounds after the first, and what it yields."""
    found, spent = run(), []
    for _ in range(rounds):
        began = time.process_time()
        found = run()
        spent.append(time.process_time() - began)
    return min(spent), found


def test_solution(capsys):
    """From rest after 60 revolutions, and from a state near by."""
    rest, solution = least(lambda: periodic("mokhtar2017", **CASE), 60)
    near, _ = least(lambda: periodic("mokhtar2017", initial=solution.state, **CASE), 60)
    with capsys.disabled():
        print(f"\nperiodic: {1e3 * near:.2f} ms from a state, {1e3 * rest:.2f} ms from rest")
    assert near < SOLUTION


@pytest.mark.parametrize(
    ("along", "start", "stop", "step", "rest"),
    [
        ("clearance", "80 um", "130 um", "1 um", {"speed_ratio": 0.75}),
        ("friction", 0.1, 0.5, 0.01, {"speed_ratio": 0.75, "clearance": "84 um"}),
        ("speed_ratio", 0.72, 0.8, 0.002, {"clearance": "100 um"}),
    ],
)
def test_point_of_a_branch(capsys, along, start, stop, step, rest):
    def run() -> tuple[Any, ...]:
        return branch(
            "mokhtar2017",
            along=along,
            start=start,
            stop=stop,
            largest_step=step,
            doublings=0,
            keep=(),
            **rest,
        )

    spent, found = least(run, 2)
    n = sum(len(one.points) for one in found)
    with capsys.disabled():
        print(f"\nbranch along {along}: {n} points, {1e3 * spent / n:.2f} ms each")
    assert spent / n < POINT[along == "speed_ratio"]


@pytest.mark.parametrize("alpha", [0.4, 4.0])
def test_direct_way_beside_auto(capsys, alpha):
    """Rotors damped by 0.1 and 1 %."""
    ratios = []
    for speed_ratio, clearance_ratio, friction in LIGHT:
        case = {
            "speed_ratio": speed_ratio, "clearance_ratio": clearance_ratio, "friction": friction, "keep": (),
            "overrides": {"rotor.damping.alpha": alpha}, "samples_per_revolution": 64, "revolutions": 4,
            "transient_limit": 8000,
        }  # fmt: skip
        direct, found = least(lambda case=case: simulate("mokhtar2017", transient="direct", **case), 3)
        auto, settled = least(
            lambda case=case: simulate("mokhtar2017", transient="auto", transient_tolerance=1e-9, **case), 3
        )
        ratios.append(auto / direct)
        with capsys.disabled():
            print(
                f"\nalpha {alpha}, r {speed_ratio}: {1e3 * direct:.1f} and {1e3 * auto:.1f} ms, "
                f"{found.transient_revolutions} and {settled.transient_revolutions} revolutions"
            )
    assert min(ratios) > (FASTER if alpha < 1.0 else 1.0)
