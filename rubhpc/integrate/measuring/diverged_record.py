"""Record of a diverged case."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.integrate.record import Record, State
from rubhpc.schema import DIVERGED, VARIABLES, lyapunov_variables, probe_variables

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.schema import Variable
    from rubhpc.study.study import Recording

    Floats = NDArray[np.float64]


def diverged_record(
    reason: str,
    n_stator: int,
    recording: Recording,
    settings: dict[str, float],
    final: State,
    reached: dict[str, Floats] | None = None,
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
    groups: dict[str, dict[str, Any]] = {"waveform": {}, "spectrum": {}, "section": {}, "measure": {}}
    for name, variable in _variables_of(recording).items():
        if variable.role == "measure" and not variable.dims:
            groups["measure"][name] = -1 if variable.dtype.startswith("int") else np.nan
        elif variable.role == "measure" or variable.role in recording.keep:
            groups[variable.role][name] = np.full([length[dim] for dim in variable.dims], np.nan)
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


def _variables_of(recording: Recording) -> dict[str, Variable]:
    """Variables of such a record."""
    return VARIABLES | probe_variables(recording.probed) | lyapunov_variables(recording.lyapunov)
