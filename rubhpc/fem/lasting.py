"""Modes that nothing damps, whose motion lasts, and the mode whose motion decays slowest."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.fem.modes import modes
from rubhpc.fem.stability import is_rounding

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from rubhpc.fem.model import Body, Model
    from rubhpc.fem.modes import Mode

LEFT = math.log(100.0)  # logarithm of the share that a transient is to take off a free motion


def undamped(body: Body, spin: float = 0.0) -> list[Mode]:
    """Return the modes of a body that neither decay nor grow at a spin (rad/s), by rising frequency.

    Rigid-body modes are not among them: nothing makes them oscillate.
    """
    body = body.at(spin)
    if _takes_energy_from_all(body):
        return []
    found = modes(body, spin)
    greatest = max((abs(mode.eigenvalue) for mode in found), default=0.0)
    return [mode for mode in found if mode.frequency > 0.0 and is_rounding(mode, greatest)]


def undamped_message(model: Model, spin: float) -> str:
    """Return one line that names the undamped modes at a spin (rad/s); "" where there are none.

    Of the rotor axial modes do not count: neither unbalance nor contact excites them. A stator on a carrier
    counts with it.
    """
    found = [("the rotor", [mode for mode in undamped(model.rotor, spin) if mode.kind != "axial"])]
    found += [
        (f"carrier {carrier.name} with {stator_names(carrier.stators)}", undamped(carrier.body))
        for carrier in model.carriers
    ]
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
    bodies |= {
        id(carrier.body): (f"carrier {carrier.name} with {stator_names(carrier.stators)}", carrier.body)
        for carrier in model.carriers
    }
    rotor = [mode for mode in modes(model.rotor, spin) if mode.kind != "axial"]
    found = [("the rotor", rotor), *((name, modes(body)) for name, body in bodies.values())]
    for name, those in found:
        greatest = max((abs(mode.eigenvalue) for mode in those), default=0.0)
        for mode in those:
            if mode.frequency > 0.0 and mode.eigenvalue.real < 0.0 and not is_rounding(mode, greatest):
                yield name, mode


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
