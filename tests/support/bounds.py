"""Runs kernels with bounds checks, negative indices included, over random rigs, laws and motions.

    python tests/support/bounds.py [SECONDS [SEED]]

Kernels are compiled again, into a cache of their own, 5 to 15 min for all. An index beyond an array ends
a case with `IndexError`, and this program with the exit code 1; what the program refuses, or gives up, is no
fault.
"""

from __future__ import annotations

import math
import os
import random
import signal
import sys
import time
import traceback
import warnings
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

ROOT = Path(__file__).parents[2]
CACHE = ROOT / ".pytest_cache" / "bounds"
LONGEST = 15  # s that a case may take, besides compilation

Case = dict[str, Any]


def a_rig(draw: random.Random, *, bent: bool = False) -> Any:
    """The packaged shaft with a beam of any stiffness, or a ring of 1 to 31 beams or masses at any node."""
    from rubhpc import LumpedStator, read_rig
    from rubhpc.rig.reading import with_keys

    rig = read_rig("mokhtar2017")
    count = draw.choice([1, 1, 1, 2, 3, 6, 16, 31])
    node = 8 if draw.random() < 0.5 else draw.randint(3, 14)
    if bent or draw.random() < 0.5:
        kind = replace(rig.stator[0], node=node, radius=0.06, youngs_modulus=10 ** draw.uniform(8.0, 12.0))
    else:
        mass, stiffness = draw.choice([1e-9, 1e-3, 1.0, 100.0]), draw.choice([1.0, 1e5, 1e7, 1e15])
        kind = LumpedStator(node=node, radius=0.06, mass=mass, stiffness=stiffness, damping=2.0)
    angles = [2.0 * math.pi * i / count for i in range(count)]
    rig = replace(rig, stator=tuple(replace(kind, angle=angle) for angle in angles))
    rig = rig.with_geometry("second_order" if bent else "linear")
    return with_keys(rig, {"rotor.damping.alpha": 10 ** draw.uniform(0.0, 2.0)})


def a_law(draw: random.Random, kinds: str) -> Case:
    """Keys of one of the laws, of which each has a letter."""
    stiffness, damping = 10 ** draw.uniform(3.0, 12.0), draw.choice([0.0, 10.0])
    penalty: Case = {"law": "penalty", "stiffness": stiffness, "damping": damping}
    hertz: Case = {"law": "hertz", "stiffness": 1e4 * stiffness, "damping": 0.1 * damping}
    coulomb = {"friction_law": "coulomb", "static_friction_ratio": draw.choice([1.0, 1.0, 1.5])}
    laws: dict[str, Case] = {
        "s": {},
        "c": coulomb,
        "p": penalty,
        "b": penalty | coulomb,
        "r": {"restitution": draw.choice([0.1, 0.5, 1.0])},
        "e": {"restitution": 0.5} | coulomb,
        "h": hertz | coulomb,
        "u": {"normal": "updated"},
        "v": {"normal": "updated"} | coulomb,
        "t": {"friction_law": "stribeck", "static_friction_ratio": 1.2, "stribeck_speed": 0.1},
    }
    return {"normal": "fixed", "friction_law": "sliding"} | laws[draw.choice(kinds)]


def a_case(draw: random.Random, kinds: str) -> Case:
    """Arguments that all functions share."""
    return a_law(draw, kinds) | {
        "clearance": draw.choice([1e-6, 3e-5, 8e-5, 1e-4, 1e-4, 3e-4, 5e-3]),
        "friction": draw.choice([0.0, 0.1, 0.3, 0.3, 1.0]),
        "samples_per_revolution": draw.choice([16, 18, 32, 64, 100, 256, 1024]),
    }


def a_start(draw: random.Random) -> Case:
    """At rest, contact-free, or displaced and moving, as the cases of basins and knocks begin."""
    if draw.random() < 0.4:
        return {}
    return {
        "initial": {
            "from": draw.choice(["rest", "contact_free"]),
            "vertical": draw.uniform(-2e-3, 2e-3),
            "vertical_velocity": draw.uniform(-0.5, 0.5),
        }
    }


def simulated(draw: random.Random, kinds: str = "sscpbrehuvt", **fixed: Any) -> tuple[str, Case]:
    case = a_case(draw, kinds) | a_start(draw)
    case |= {
        "rig": a_rig(draw),
        "speed_ratio": draw.choice([draw.uniform(0.3, 6.0), 10 ** draw.uniform(-2.0, 2.0)]),
        "transient": draw.choice([0, 1, 2, 5]),
        "revolutions": draw.choice([1, 2, 3, 16]),
        "keep": draw.choice([("waveform",), ("section",), ("waveform", "spectrum", "section"), ()]),
        "lyapunov": draw.choice([0, 0, 1, 3]),
    }
    return "simulate", case | fixed


def bent(draw: random.Random) -> tuple[str, Case]:
    """Bent stators under each law."""
    normal = draw.choice(["updated", "fixed"])
    return simulated(draw, "scpbreht", rig=a_rig(draw, bent=True), normal=normal)


def stepped(draw: random.Random) -> tuple[str, Case]:
    """Central differences."""
    case = simulated(draw, "ssrput", method="central-difference", lyapunov=0, revolutions=1, transient=1)[1]
    return "simulate", case | {"step": draw.choice([5e-7, 2e-6]), "speed_ratio": draw.uniform(2.0, 20.0)}


def settled_directly(draw: random.Random) -> tuple[str, Case]:
    return simulated(draw, "scpbrehuv", transient="direct", revolutions=2)


def run_up(draw: random.Random) -> tuple[str, Case]:
    """Run-ups at given speeds, and drives."""
    case = a_case(draw, "sscpbrehuv") | {"rig": a_rig(draw, bent=draw.random() < 0.2)}
    revolutions, speed = draw.choice([1.01, 3.03, 10.1]), draw.uniform(50.0, 900.0)
    time_taken = 2.0 * math.pi * revolutions / speed
    if draw.random() < 0.5:
        stop = speed * draw.choice([1.001, 2.0, 0.5])
        pieces = draw.choice([{}, {}, {"pieces_per_revolution": draw.choice([1, 2, 16])}])
        return "run_up", case | pieces | {"start": speed, "stop": stop, "time": time_taken}
    drive = {"torque": draw.choice([0.0, 1.0, -5.0, 100.0]), "start": speed}
    return "run_up", case | {"drive": drive | {"revolutions": math.ceil(revolutions)}}


def periodic(draw: random.Random) -> tuple[str, Case]:
    case = a_case(draw, "sscpbrehuv") | {"rig": a_rig(draw), "speed_ratio": draw.uniform(0.5, 4.0)}
    return "periodic", case | {"transient": draw.choice([0, 5]), "period": draw.choice([1, 2, 3])}


def branch(draw: random.Random) -> tuple[str, Case]:
    case = periodic(draw)[1] | {"most_points": 4, "sweeps": draw.choice([0, 1])}
    del case["clearance"]
    return "branch", case | {"along": "clearance", "start": 1e-4, "stop": draw.choice([1.1e-4, 6e-5])}


KINDS: dict[Callable[[random.Random], tuple[str, Case]], int] = {  # with how often each is drawn
    simulated: 5,
    bent: 3,
    stepped: 2,
    settled_directly: 2,
    run_up: 5,
    periodic: 2,
    branch: 2,
}


class _TooLong(BaseException):
    """A case that takes too long here."""


def _interrupt(*_: object) -> None:
    from rubhpc.integrate.compilation import is_compiling

    if is_compiling():
        signal.alarm(LONGEST)
    else:
        raise _TooLong


def check(seconds: float, seed: int) -> int:
    """Compute cases for some time; returns how many went beyond an array, or failed otherwise."""
    import rubhpc
    from rubhpc.errors import RubError

    warnings.simplefilter("ignore")
    signal.signal(signal.SIGALRM, _interrupt)
    ended, bad, began = Counter[str](), 0, time.monotonic()
    while time.monotonic() - began < seconds:
        draw = random.Random(seed)
        kind = draw.choices(list(KINDS), list(KINDS.values()))[0]
        function, case = kind(draw)
        name = ", ".join(str(case.get(key, "")) for key in ("friction_law", "law", "normal", "restitution"))
        signal.alarm(LONGEST)
        try:
            getattr(rubhpc, function)(case.pop("rig"), **case)
            outcome = "computed"
        except RubError as error:
            outcome = f"refused: {str(error)[:60]}"
        except _TooLong:
            outcome = "too long"
        except Exception:
            outcome, bad = "FAILED", bad + 1
            print(f"seed {seed}: {function} {case}\n{traceback.format_exc()}", flush=True)
        signal.alarm(0)
        ended[f"{kind.__name__} {outcome.split(':')[0]}"] += 1
        if "-v" in sys.argv:
            print(seed, kind.__name__, name, outcome, round(time.monotonic() - began), flush=True)
        seed += 1
    print(*(f"{count:5d} {what}" for what, count in sorted(ended.items())), sep="\n")
    return bad


def see_that_indices_are_checked() -> None:
    """Read beyond an array in a kernel: above its end, and below its beginning."""
    import numpy as np

    from rubhpc.kernels._jit import jit_sum

    @jit_sum
    def read(values, index):  # type: ignore[no-untyped-def]
        return values[index]

    assert read(np.ones(2), 1) == 1.0
    for index in (2, -1):
        try:
            read(np.ones(2), index)
        except IndexError:
            continue
        raise SystemExit(f"index {index} of an array of two passes unseen")


if __name__ == "__main__":
    if os.environ.get("NUMBA_BOUNDSCHECK") != "1":
        checking = {"NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(CACHE), "PYTHONPATH": str(ROOT)}
        os.execve(sys.executable, [sys.executable, *sys.argv], {**os.environ, **checking})
    import numba.np.arrayobj

    # An index below zero counts from the end in Python; no kernel means that.
    numba.np.arrayobj.fix_integer_index = lambda context, builder, kind, index, size: index
    os.sched_setaffinity(
        0, {min(os.sched_getaffinity(0))}
    )  # else a second process would compile without this
    see_that_indices_are_checked()
    given = [float(word) for word in sys.argv[1:] if word != "-v"]
    sys.exit(1 if check(given[0] if given else 900.0, int(given[1]) if len(given) > 1 else 0) else 0)
