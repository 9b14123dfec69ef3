"""Numbers that the documents state of the accuracy and the energy balance of cases, computed again.

    python tests/bench/documented.py [NAME ...]

with the names of the functions below, or none for all of them: some minutes.
"""

from __future__ import annotations

import math
import sys
from collections import Counter
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

sys.path.append(str(Path(__file__).parents[1] / "support"))
from closed_form import read_rig, simulate
from equal_stators import in_ring
from test_laws import ROWS

from postproc.signals import contacts
from postproc.signals.hilbert_huang import hilbert_huang, median_frequency
from rubhpc import LumpedStator
from rubhpc.integrate.periodic_motions.proof import Solver
from rubhpc.rig.reading import with_keys
from rubhpc.schema import DONE, REGIME

if TYPE_CHECKING:
    from rubhpc import Rig

PACKAGED = read_rig("mokhtar2017")
STIFF = with_keys(PACKAGED, {"stator.youngs_modulus": "30 GPa"})
COULOMB = {"friction_law": "coulomb"}
SLIDING = (*ROWS[0][:4], "steady sliding", {}, 1.0)
BARE: dict[str, Any] = {"samples_per_revolution": 64, "keep": ()}


def ring(stator: Any, count: int) -> Rig:
    """Return the packaged rotor in a ring of equal stators."""
    return in_ring(replace(STIFF, stator=(stator,)), count)


def closed_form() -> None:
    """Largest energy residual of 36 cases from event to event (theory, records: energy balance)."""
    cases = product((1, 3, 8), (None, 0.3, 0.8), (0.75, 1.5, 2.25, 3.0))
    worst = max(
        simulate(
            ring(STIFF.stator[0], n), speed_ratio=r, clearance_ratio=0.7, friction=0.2, transient=10,
            revolutions=6, restitution=e, **BARE,
        ).energy_residual
        for n, e, r in cases
    )  # fmt: skip
    print(f"36 cases: energy residual at most {worst:.1e}")


def bounces() -> None:
    """Energy residuals of stators that bounce (theory, records: energy balance)."""
    light = LumpedStator(node=8, mass=0.01, stiffness=1e6, radius=0.06)
    for restitution in (0.8, None):
        case = {"speed_ratio": 2.0, "clearance": "40 um", "friction": 0.0, "restitution": restitution}
        record = simulate(ring(light, 16), **case, transient=4, revolutions=8, **BARE)
        print(f"16 springs, restitution {restitution}: {record.energy_residual:.1e}")
    heavy = LumpedStator(node=8, mass=0.1, stiffness=1e5, damping=5.0, radius=0.06)
    case = {"speed_ratio": 1.2, "clearance": "10 um", "restitution": 0.8}
    for count, law in ((16, {"friction": 0.0}), (8, COULOMB | {"friction": 0.1})):
        record = simulate(ring(heavy, count), **case, **law, transient=4, revolutions=8, **BARE)
        print(f"ring of {count}, from event to event: {record.energy_residual:.1e}")
    case["friction"] = 0.1
    for micron in (1.0, 0.5, 0.25):
        step = {"step": micron * 1e-6, "transient": 0, "revolutions": 2}
        central = simulate(ring(heavy, 3), **case, method="central-difference", **step, **BARE)
        print(f"three stators, {micron} us: central difference {central.energy_residual:.1e}")
    del case["restitution"]
    central = simulate(ring(heavy, 3), **case, method="central-difference", **step, **BARE)
    print(f"central difference without restitution: {central.energy_residual:.1e}")


def peaks() -> None:
    """Largest mean of the contact force over windows, by elements (theory, records: peak of the force)."""
    shaft = replace(STIFF.stator[0], node=5, radius=0.01)
    rows = [("on the shaft", shaft, 1.1, 100), ("packaged", STIFF.stator[0], 3.5, 74)]
    rows += [
        (f"on the shaft, beta {beta}", replace(shaft, damping=replace(shaft.damping, beta=beta)), 1.1, 100)
        for beta in (2e-4, 0.0)
    ]
    first = 2.0 * math.pi * 31.5596
    for name, stator, ratio, micron in rows:
        samples = 2 * round(math.pi / (ratio * first * 1e-6))  # some 1 us apart
        for n in (3, 6, 12, 24, 48):
            record = simulate(
                replace(STIFF, stator=(replace(stator, elements=n),)),
                speed_ratio=ratio, clearance=micron * 1e-6, transient=2, revolutions=4, accuracy=1e-9,
                samples_per_revolution=samples, keep=("waveform",),
            )  # fmt: skip
            impulse = np.concatenate([[0.0], np.cumsum(np.asarray(record.contact_force[0], float))])
            means = [f"{(impulse[w:] - impulse[:-w]).max() / w:.2f}" for w in (1, 10, 20, 50)]
            print(
                f"{name}, {n} elements: {', '.join(means)} N over 1, 10, 20, 50 us; "
                f"measure {record.peak_contact_force[0]:.2f} N"
            )


def rigid() -> None:
    """Peaks of a rigid mass and of the same with a penalty (theory, records: rigid masses and walls)."""
    mass = LumpedStator(node=8, mass=0.92, stiffness=3.9e5, radius=0.06)
    rig = replace(STIFF, stator=(mass,))
    case: dict[str, Any] = {"speed_ratio": 1.9, "clearance": "70 um", "friction": 0.3}
    case |= {"transient": 0, "revolutions": 4} | BARE
    found = simulate(rig, **case)
    print(f"rigid: {found.peak_contact_force[0]:.0f} N, {found.contact_impulse[0]:.3f} N s a revolution")
    for stiffness in (1e6, 1e7, 1e8, 1e9, 1e10):
        text = []
        for damping in (0.0, 2.0 * math.sqrt(0.05 * stiffness)):
            soft = {"law": "penalty", "stiffness": stiffness, "damping": damping}
            record = simulate(rig, **case, **soft)
            text.append(
                f"{record.peak_contact_force[0]:.0f} N, {1e6 * record.contact_duration[0]:.0f} us, "
                f"{record.contact_impulse[0]:.3f} N s"
            )
        print(f"k = {stiffness:.0e}: without damper {text[0]}; with {text[1]}")


def rounding() -> None:
    """Where twenty simulations end whose friction differs by 1e-9 (theory, records: direct)."""
    rig = with_keys(PACKAGED, {"stator.youngs_modulus": "28 GPa", "rotor.damping.alpha": 2.0})
    ends: Counter[str] = Counter()
    for i in range(20):
        record = simulate(
            rig, speed_ratio=0.624, clearance_ratio=0.545, friction=0.3 + i * 1e-9, transient=10_000, **BARE
        )
        ends[f"P{record.period} with the multiplier {record.largest_multiplier:.3f}"] += 1
    print("after 10 000 revolutions:", "; ".join(f"{n} at {end}" for end, n in ends.items()))


def short_records() -> None:
    """Regimes by the last 24 and 16 revolutions of 64 (guide, regimes: short records)."""
    same, without = Counter[int](), 0
    for ratio, clearance in product(np.linspace(0.85, 6.0, 104), (0.6, 0.7, 0.8, 0.9)):
        case = {"speed_ratio": ratio, "clearance_ratio": clearance, "friction": 0.3}
        whole = simulate(STIFF, **case, transient=120, revolutions=64, **BARE)
        if whole.regime == 1 and whole.period:
            continue
        without += whole.regime > 0
        for n in (24, 16):
            part = simulate(STIFF, **case, transient=184 - n, revolutions=n, **BARE)
            same[n] += whole.regime > 0 and part.regime == whole.regime
    print(f"{without} of 416 without a period; alike with 24 revolutions {same[24]}, with 16 {same[16]}")


def settling() -> None:
    """Cases of the packaged map beside the same after 3000 revolutions (theory, records: regime, 5)."""
    axes = np.linspace(0.6, 6.0, 55), np.linspace(0.40, 0.95, 12), (0.1, 0.3, 0.5)
    cases = list(product(*axes))
    drawn = [cases[i] for i in np.sort(np.random.default_rng(15).permutation(len(cases))[:500])]

    def judged(transient: int) -> list[tuple[int, int, int, float]]:
        found = []
        for ratio, clearance, friction in drawn:
            case = {"speed_ratio": ratio, "clearance_ratio": clearance, "friction": friction}
            record = simulate(STIFF, **case, transient=transient, revolutions=64, keep=())
            found.append((record.regime, record.period, record.settled, float(record.peak_contact_force[0])))
        return found

    follow, truth = Solver.later, judged(3000)
    for name, later in (("not followed", lambda *_: iter(())), ("followed", follow)):
        Solver.later = later  # type: ignore[method-assign]
        pairs = list(zip(judged(120), truth, strict=True))
        regimes = Counter((REGIME[a[0]], REGIME[b[0]]) for a, b in pairs if a[0] != b[0])
        periods = sum(a[0] == b[0] and a[1] != b[1] for a, b in pairs)
        both_chaotic = REGIME.index("chaotic")
        off = [
            a for a, b in pairs
            if a[2] == 1 and abs(a[3] - b[3]) > 0.05 * b[3] and not a[0] == b[0] == both_chaotic
        ]  # fmt: skip
        unsettled = sum(a[2] == 0 for a, _ in pairs)
        print(f"{name}: other regime {sum(regimes.values())} {dict(regimes)}, other period {periods}")
        print(f"    settled and another peak {len(off)}, not settled {unsettled}")
    Solver.later = follow  # type: ignore[method-assign]


def lasting() -> None:
    """Chaos that has settled beside the same after 20 000 revolutions (theory, records: lasting chaos)."""
    chaotic = REGIME.index("chaotic")
    overhung = replace(
        PACKAGED.rotor,
        bearing=(PACKAGED.rotor.bearing[0], replace(PACKAGED.rotor.bearing[1], node=9)),
        disc=(replace(PACKAGED.rotor.disc[0], node=13),),
        unbalance=(replace(PACKAGED.rotor.unbalance[0], node=13),),
    )
    for name, count, n_case in (("one", 1, 360), ("two", 2, 120)):
        said = wrong = lasts = found = 0
        for seed in range(n_case):
            random = np.random.default_rng([count, seed])
            is_overhung = bool(seed % 2)
            rotor, node = (overhung, 13) if is_overhung else (PACKAGED.rotor, 8)
            rotor = replace(rotor, gravity=9.81 * (random.random() < 0.3))
            stator = replace(PACKAGED.stator[0], node=node, youngs_modulus=10 ** random.uniform(9.3, 11))
            damping = 10 ** random.uniform(0.3, 1.1) if is_overhung else 31.7
            case: dict[str, Any] = {
                "rig": with_keys(
                    in_ring(replace(PACKAGED, rotor=rotor, stator=(stator,)), count),
                    {"rotor.damping.alpha": damping},
                ),
                "speed_ratio": random.uniform(0.6, 4.0 if is_overhung else 6.0),
                "clearance_ratio": random.uniform(0.4, 0.97),
                "friction": random.uniform(0.05, 0.5),
            } | (COULOMB if random.random() < 0.5 else {})
            record = simulate(**case, keep=())
            if record.status != DONE or not record.lyapunov_exponent > 0.0:
                continue
            later = simulate(**case, keep=(), transient=20_000, initial=record.final)
            is_said = record.regime == chaotic and record.settled == 1
            is_lasting = later.status == DONE and later.regime == chaotic
            said, wrong = said + is_said, wrong + (is_said and not is_lasting)
            lasts, found = lasts + is_lasting, found + (is_said and is_lasting)
        print(
            f"{name}, {n_case} cases: lasting chaos {lasts}, said {found}; said in all {said}, wrong {wrong}"
        )


def distance(record: Any, known: Any) -> float:
    """Largest rms difference of a displacement or force over its rms about the mean."""
    seen = ("vertical", "horizontal", "torsion", "stator_axial", "stator_lateral", "contact_force")
    pairs = [(np.asarray(getattr(one, name)) for one in (record, known)) for name in seen]
    return max(np.sqrt(np.mean((a - b) ** 2)) / b.std() for a, b in pairs if b.any())


def accuracy_of_laws() -> None:
    """Regular motions of the cases of `test_laws.py` beside all modes (guide, performance: accuracy)."""
    for name, count, friction, cases, law_name, given, _ in [SLIDING, *ROWS]:
        law = dict(given)
        rig = ring(STIFF.stator[0], count)
        if "geometry" in law:
            rig = with_keys(rig, {"stator.geometry": law.pop("geometry")})
        text = []
        for accuracy in (1e-3, 5e-4, 2e-4):
            errors, peaks = [], []
            for ratio, clearance in cases[:: max(1, len(cases) // 13)]:
                case = {"speed_ratio": ratio, "clearance": clearance, "friction": friction, **law}
                case |= {"transient": 120, "revolutions": 10, "keep": ("waveform",)}
                found = simulate(rig, **case, accuracy=accuracy)
                if found.period == 0 or not found.contact_impulse.any():
                    continue
                exact = simulate(rig, **case, accuracy=1e-9)
                errors.append(distance(found, exact))
                peaks.append(abs(found.peak_contact_force.max() / exact.peak_contact_force.max() - 1.0))
            if errors:
                text.append(f"{np.median(errors):.0e}, {max(errors):.1e}, {max(peaks):.0e} ({len(errors)})")
        print(f"| {name}: {law_name} | {' | '.join(text)} |", flush=True)


def growth() -> None:
    """Errors beside `modal_error` times how neighbouring motions part (theory, modal: reduction)."""
    random, cases = np.random.default_rng(1), []
    for _ in range(60):
        case = {"speed_ratio": random.uniform(0.6, 6.0), "clearance": random.uniform(40e-6, 100e-6)}
        case |= {"friction": 0.3, "transient": 0, "revolutions": 20, "keep": ("waveform",)}
        found, exact = (simulate(STIFF, **case, accuracy=accuracy) for accuracy in (1e-3, 1e-9))
        beside = simulate(STIFF, **case | {"clearance": case["clearance"] * (1.0 + 1e-9)})
        if exact.contact_impulse.any():
            parted = max(1.0, distance(beside, found) / 1e-9)
            cases.append((parted, distance(found, exact) / found.modal_error))
    for least, most in ((1.0, 10.0), (10.0, 100.0), (100.0, 1e3), (1e3, np.inf)):
        errors = [(error, error / parted) for parted, error in cases if least <= parted < most]
        first, second = np.max(errors, axis=0)
        print(f"| {least:g} to {most:g} | {len(errors)} | {first:.2g} | {second:.2g} |")


def signals() -> None:
    """Contacts, jumps, decays and frequencies of signals (guide, signal analysis)."""
    for ratio, modulus, micron in ((0.75, 3, 100), (0.75, 3, 84), (0.75, 30, 84), (2, 30, 70), (3, 3, 76)):
        case = simulate(
            with_keys(PACKAGED, {"stator.youngs_modulus": modulus * 1e9}),
            speed_ratio=ratio, clearance=micron * 1e-6, friction=0.3, transient=240, revolutions=64,
            samples_per_revolution=2048, keep=("waveform",),
        ).to_dataset()  # fmt: skip
        spans = contacts.contact_spans(case).to_dataframe()
        lasting = ", ".join(f"{1e3 * x:.2f}" for x in spans["duration"][:2])
        apart = ", ".join(f"{1e3 * x:.1f}" for x in np.diff(spans["start"][:3]))
        jumps = contacts.event_jumps(case)
        found = contacts.events_in_signal(case).sizes["event"]
        print(f"r {ratio}, {modulus} GPa, {micron} um: contacts of {lasting} ms, begun {apart} ms apart")
        print(f"  {jumps.sizes['event']} touches and releases, {found} found without the force")
        for kind in ("touch", "release"):
            jump = jumps["ratio"].values[jumps["kind"].values == kind]
            print(f"  departure at {kind}: {jump.min():.0f} to {jump.max():.0f}")
        for signal in ("stator_lateral", "torsion"):
            decay = contacts.free_decay(case, signal).median("span")
            first = float(median_frequency(hilbert_huang(case, signal)))
            print(
                f"  {signal}: decays at {float(decay['frequency']):.6g} Hz, "
                f"{100 * float(decay['damping_ratio']):.4g} %; first mode at {first:.2f} Hz"
            )


if __name__ == "__main__":
    known = [
        closed_form,
        bounces,
        peaks,
        rigid,
        rounding,
        short_records,
        settling,
        lasting,
        accuracy_of_laws,
        growth,
        signals,
    ]
    for function in known:
        if len(sys.argv) == 1 or function.__name__ in sys.argv[1:]:
            function()
