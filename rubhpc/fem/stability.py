"""Linear stability of a spinning body: growth rates, logarithmic decrement, threshold speed."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import eigvalsh

from rubhpc.fem.modes import modes

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from rubhpc.fem.model import Body, CarrierModel, Model
    from rubhpc.fem.modes import Mode


_ROUNDING = 1e-8  # growth, as a share of the mode's own eigenvalue, that is rounding
_ROUNDING_OF_GREATEST = 1e-12  # size of an eigenvalue, as a share of the greatest, that is a rigid body's 0
_RESOLUTION = 1e-6  # of a threshold speed
_SYMMETRY = 1e-12  # of a matrix, that is rounding


def logarithmic_decrement(mode: Mode) -> float:
    """Logarithm of the ratio of two successive amplitudes of a free oscillation, negative where it grows.

    Infinite for a mode that does not oscillate; NaN for a rigid-body mode, which does neither.
    """
    if mode.frequency == 0.0:
        return math.nan
    decay, oscillation = -mode.eigenvalue.real, mode.eigenvalue.imag
    if oscillation == 0.0:
        return math.copysign(math.inf, mode.damping_ratio)
    return 2 * math.pi * decay / oscillation


def unstable_modes(body: Body, spin: float = 0.0) -> list[Mode]:
    """Return the modes of a body that grow at a spin (rad/s), the fastest to grow first.

    Growth is `mode.eigenvalue.real`, 1/s.
    """
    return growing_modes(modes(body, spin))


def is_passive(body: Body) -> bool:
    """Whether nothing in a body can feed a motion, so that it is stable at every spin.

    The stiffness is symmetric (no circulation) and nowhere negative, and the damping takes energy from
    every velocity; gyroscopic forces do no work.
    """
    stiffness, damping = body.stiffness, (body.damping + body.damping.T) / 2
    greatest = np.abs(stiffness).max(initial=0.0)
    if np.abs(stiffness - stiffness.T).max(initial=0.0) > _SYMMETRY * greatest:
        return False
    spectra = [eigvalsh(matrix) for matrix in (stiffness, damping) if matrix.size]
    return all(values[0] >= -_SYMMETRY * np.abs(values).max() for values in spectra)


def _rates(found: Sequence[Mode]) -> list[tuple[Mode, float]]:
    """Return all modes of a body, each with its rate of growth, 1/s, which is 0 where it is rounding."""
    least = _ROUNDING_OF_GREATEST * max((abs(mode.eigenvalue) for mode in found), default=0.0)

    def rate(mode: Mode) -> float:
        size, growth = abs(mode.eigenvalue), mode.eigenvalue.real
        return growth if abs(growth) > _ROUNDING * size and size > least else 0.0

    return [(mode, rate(mode)) for mode in found]


def growing_modes(found: Sequence[Mode]) -> list[Mode]:
    """Return those of all modes of a body that grow, the fastest to grow first."""
    growing = [mode for mode, rate in _rates(found) if rate > 0.0]
    return sorted(growing, key=lambda mode: -mode.eigenvalue.real)


def threshold_speed(
    body: Body,
    speeds: Sequence[float] | NDArray[np.float64],
    tracks: Sequence[tuple[Mode, ...]] | None = None,
) -> float:
    """Lowest spin of a range at which the body begins to be unstable, rad/s; NaN where it is stable.

    Parameters
    ----------
    body : Body
    speeds : (n_speed,)
        Rising, rad/s: where growth is looked for. The threshold between two of them is found by bisection.
    tracks : sequence of tuple of Mode, optional
        What `follow_modes` returned for these speeds, if it is known.
    """
    before = None
    for i, speed in enumerate(map(float, speeds)):
        if growing_modes([track[i] for track in tracks]) if tracks else unstable_modes(body, speed):
            if before is None:
                return speed
            while speed - before > _RESOLUTION * abs(speed):
                middle = (before + speed) / 2
                before, speed = (before, middle) if unstable_modes(body, middle) else (middle, speed)
            return speed
        before = speed
    return math.nan


def instability_message(model: Model, spin: float) -> str:
    """Return one line that says how the rotor is unstable at a spin (rad/s); "" where it is stable."""
    rotor = model.rotor.at(spin)
    grows = [] if is_passive(rotor) else unstable_modes(rotor, spin)
    if not grows:
        return ""
    mode = grows[0]
    rate = mode.eigenvalue.real
    kind = mode.whirl if mode.kind == "lateral" and mode.whirl != "none" else mode.kind
    decrement = logarithmic_decrement(mode)
    shrinks = f", logarithmic decrement {decrement:.3g}" if math.isfinite(decrement) else ""
    return (
        f"the rotor is unstable at {spin * 30 / math.pi:.6g} rpm: its {kind} mode of "
        f"{mode.damped_frequency:.4g} Hz grows by {rate:.3g} 1/s{shrinks}; no steady motion is reached"
    )


LEFT = math.log(100.0)  # logarithm of the share that a transient is to take off a free motion


def undamped(body: Body, spin: float = 0.0) -> list[Mode]:
    """Return the modes of a body that neither decay nor grow at a spin (rad/s), by rising frequency.

    Rigid-body modes are not among them: nothing makes them oscillate.
    """
    body = body.at(spin)
    if _takes_energy_from_all(body):
        return []
    return [mode for mode, rate in _rates(modes(body, spin)) if mode.frequency > 0.0 and not rate]


def undamped_message(model: Model, spin: float) -> str:
    """Return one line that names the undamped modes at a spin (rad/s); "" where there are none.

    Of the rotor axial modes do not count: neither unbalance nor contact excites them. A stator on a carrier
    counts with it.
    """
    found = [("the rotor", [mode for mode in undamped(model.rotor, spin) if mode.kind != "axial"])]
    found += [(_carrier_name(carrier), undamped(carrier.body)) for carrier in model.carriers]
    carried = {number for carrier in model.carriers for number in carrier.stators}
    alike: dict[tuple[tuple[str, str], ...], tuple[list[int], list[Mode]]] = {}  # a ring is named once
    for number, stator in enumerate(model.stators, start=1):
        if number not in carried and (lasting := undamped(stator.body)):
            key = tuple((f"{mode.frequency:.4g}", mode.kind) for mode in lasting)
            alike.setdefault(key, ([], lasting))[0].append(number)
    found += [(stator_names(numbers), lasting) for numbers, lasting in alike.values()]
    named = [f"{_named(lasting)} of {name}" for name, lasting in found if lasting]
    if not named:
        return ""
    return (
        f"no damping acts on {', and '.join(named)}: once excited, it does not decay, and a motion that is "
        "otherwise settled looks quasi-periodic; add damping"
    )


def decay_message(cases: Iterable[tuple[Model, float]]) -> str:
    """Return one line on the mode that takes the most revolutions to decay; "" where none decays.

    Modes that nothing damps, unstable ones and axial ones of the rotor do not count.

    Parameters
    ----------
    cases : iterable of (Model, float)
        Models, each at a spin, rad/s.
    """
    slowest, text = 0.0, ""
    for model, spin in cases:
        for name, mode in _decaying(model, spin):
            lasts = LEFT / -mode.eigenvalue.real * abs(spin) / (2.0 * math.pi)
            if lasts > slowest:
                slowest, n = lasts, math.ceil(lasts)
                text = (
                    f"at {abs(spin) * 30.0 / math.pi:.6g} rpm the {mode.kind} mode of {mode.frequency:.4g} "
                    f"Hz of {name}, damping {mode.damping_ratio:.2g}, decays slowest: by half in "
                    f"{lasts * math.log(2.0) / LEFT:.3g} revolutions, to 1 % in {n}, "
                    f"which needs transient = {n}"
                )
    return text


def _decaying(model: Model, spin: float) -> Iterator[tuple[str, Mode]]:
    """The modes at a spin that decay, each with the name of its body; of equal stators those of the first."""
    bodies = {id(stator.body): (f"stator {k}", stator.body) for k, stator in enumerate(model.stators, 1)}
    bodies |= {id(carrier.body): (_carrier_name(carrier), carrier.body) for carrier in model.carriers}
    rotor = [mode for mode in modes(model.rotor, spin) if mode.kind != "axial"]
    found = [("the rotor", rotor), *((name, modes(body)) for name, body in bodies.values())]
    for name, those in found:
        yield from ((name, mode) for mode, rate in _rates(those) if mode.frequency > 0.0 and rate < 0.0)


def _carrier_name(carrier: CarrierModel) -> str:
    return f"carrier {carrier.name} with {stator_names(carrier.stators)}"


def stator_names(stators: Sequence[int]) -> str:
    """Stators by their numbers, runs of them by their ends: "stators 1 to 8 and 11"."""
    runs: list[list[int]] = []
    for number in stators:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    listed = [
        part
        for run in runs
        for part in ([f"{run[0]} to {run[-1]}"] if len(run) > 2 else [str(number) for number in run])
    ]
    names = " and ".join([", ".join(listed[:-1]), listed[-1]] if len(listed) > 1 else listed)
    return f"stator{'s' * (len(stators) > 1)} {names}"


def _named(lasting: list[Mode]) -> str:
    first = f"{lasting[0].kind} mode of {lasting[0].frequency:.4g} Hz"
    return f"the {first}" if len(lasting) == 1 else f"{len(lasting)} modes, first the {first},"


def _takes_energy_from_all(body: Body) -> bool:
    """Whether damping takes energy from every velocity, so that no mode lasts."""
    try:
        np.linalg.cholesky((body.damping + body.damping.T) / 2)
    except np.linalg.LinAlgError:
        return False
    return True
