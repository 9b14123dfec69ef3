"""Divergence of a motion: limits of displacement and energy, and the record of a diverged case."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.integrate.packing import output_degrees
from rubhpc.integrate.record import Record, State
from rubhpc.schema import DIVERGED, VARIABLES, bore_variables, lyapunov_variables, probe_variables

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.study.tables import Recording

    Floats = NDArray[np.float64]


def energy_limit(model: Model, spin: float, displacement_limit: float) -> float:
    """Mechanical energy, J, beyond which a motion has diverged; inf for an unconstrained rotor.

    It is that of a rotor that whirls with its output node at the displacement limit d (m), in the shape x of
    its static response to a force there, with every stator pressed: `(d^2 k + s^2 m) / 2`. Here m is
    `x' M x`, k is `x' K x` and the stators' static stiffness, and s the speed of the output node in the
    fastest whirl that friction can keep up: with the spin (rad/s), rolling without slip, or at the frequency
    `sqrt(k / m)` of rotor and stators together. A stator whose tip bends far stays below it; a body whose
    motion grows without bound does not, even where the rotor hardly moves.
    """
    stiffness, mass = model.rotor.stiffness, model.rotor.mass
    rows = [row for row in output_degrees(model)[:2] if row >= 0]
    try:
        shape = np.linalg.solve(stiffness, np.eye(len(stiffness))[:, rows])
    except np.linalg.LinAlgError:
        return np.inf
    rolling = abs(spin) * max((stator.radius for stator in model.stators), default=0.0)
    largest = 0.0
    for k, row in enumerate(rows):
        along = shape[:, k] / shape[row, k]
        inertia = float(along @ mass @ along)
        held = float(along @ stiffness @ along) + _stiffness_of_stators(model, along)
        elastic = displacement_limit**2 * held
        kinetic = max(elastic, max(displacement_limit * abs(spin), rolling) ** 2 * inertia)
        largest = max(largest, 0.5 * (elastic + kinetic))
    return largest if largest > 0.0 else np.inf


def _stiffness_of_stators(model: Model, along: Floats) -> float:
    """Static stiffness, N/m, that the stators add to a rotor's shape, each where it rubs; none of walls."""
    total = 0.0
    for stator in model.stators:
        rows = [row for name in ("v", "w") if (row := model.rotor.index(stator.node, name)) >= 0]
        if stator.axial_compliance > 0.0:
            total += float(np.sum(along[rows] ** 2)) / stator.axial_compliance
    return total


def judged_nodes(model: Model) -> tuple[int, ...]:
    """Nodes whose lateral displacement is compared with the limit: the output node, then that of each rim."""
    return (model.output_node, *(stator.node for stator in model.stators))


def displacement_reason(model: Model, displacement: Floats, limit: float) -> str:
    """Reason with the node whose displacement, of (2 n_node,), v and w of each, has passed the limit (m)."""
    size = np.abs(displacement).reshape(-1, 2).max(axis=1)
    worst = int(np.argmax(np.where(np.isnan(size), np.inf, size)))
    return f"the displacement of the rotor at node {judged_nodes(model)[worst]} passed {limit:.3g} m"


def energy_reason(limit: float) -> str:
    """Reason of a case whose energy has passed its limit, J."""
    return f"the mechanical energy passed {limit:.3g} J, that of rotor and stators at the displacement limit"


def diverged_record(
    reason: str,
    n_stator: int,
    recording: Recording,
    settings: dict[str, float],
    final: State,
    reached: dict[str, Floats] | None = None,
    *,
    has_bore: bool = False,
) -> Record:
    """Record of a diverged case: its signals up to the divergence, and NaN elsewhere.

    `reached` holds the samples (..., n) until then; sections are read from them. Spectra and measures are
    those of whole records: a diverged case has none.
    """
    per_revolution = recording.samples_per_revolution
    n_sample = recording.revolutions * per_revolution
    length = {
        "stator": n_stator,
        "sample": n_sample,
        "order": n_sample // 2 + 1,
        "section": recording.revolutions,
    }
    variables = VARIABLES | probe_variables(recording.probed) | lyapunov_variables(recording.lyapunov)
    if has_bore:
        variables |= bore_variables()
    groups: dict[str, dict[str, Any]] = {"waveform": {}, "spectrum": {}, "section": {}, "measure": {}}
    for name, variable in variables.items():
        if variable.role == "measure" and not variable.dims:
            groups["measure"][name] = -1 if variable.dtype.startswith("int") else np.nan
        elif variable.role == "measure" or variable.role in recording.keep:
            groups[variable.role][name] = np.full([length[dim] for dim in variable.dims], variable.fill_value)
    groups["measure"]["regime"] = -1
    for name, values in (reached or {}).items():
        if name in groups["waveform"]:
            groups["waveform"][name][..., : values.shape[-1]] = values
        if f"section_{name}" in groups["section"]:
            once = values[..., ::per_revolution]
            groups["section"][f"section_{name}"][: once.size] = once
    return Record(
        status=DIVERGED,
        reason=reason,
        samples_per_revolution=per_revolution,
        signals=groups["waveform"],
        spectra=groups["spectrum"],
        sections=groups["section"],
        measures=groups["measure"],
        settings=settings,
        final=final,
        probed=recording.probed,
        n_exponent=recording.lyapunov,
    )
