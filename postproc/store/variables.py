"""The variables of an opened store: which are large arrays, which are measures, which are there."""

from __future__ import annotations

import difflib
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.store.attributes import MEASURED, table_of
from postproc.store.axes import refusal
from rubhpc.schema import PROBE, VARIABLES, is_signal, role_of

if TYPE_CHECKING:
    from collections.abc import Iterable

    import xarray as xr
    from numpy.typing import ArrayLike

SIGNAL_ROLES = ("waveform", "spectrum")  # whose chunks are large
LONG_ROLES = (*SIGNAL_ROLES, "section")
# One number a case, or one a stator of it.
MEASURES = tuple(n for n, v in VARIABLES.items() if v.role in ("measure", "setting"))


def require_variables(store: xr.Dataset, names: Iterable[str]) -> None:
    """Check that the store has the variables.

    InputError where one is missing; the message names the `[record] keep` that stores it, or the nearest
    name.
    """
    for name in names:
        if name in store:
            continue
        if MEASURED in store.attrs and is_signal(name):
            known = [str(n) for n in store.data_vars if is_signal(str(n))]
            raise refusal(store, f"{name}: was not measured; there are {', '.join(known)}")
        is_recorded = name in VARIABLES or name.removeprefix(PROBE) in probes_of(store)
        role = role_of(name) if is_recorded else ""
        if role in LONG_ROLES:
            fix = f'run the study with "{role}" in [record] keep'
            raise refusal(store, f"does not contain {name}; {fix}")
        known = [str(n) for n in store.data_vars]
        near = difflib.get_close_matches(name, known, n=1)
        hint = f"did you mean {near[0]}?" if near else f"the variables are {', '.join(known)}"
        raise refusal(store, f"no variable {name}; {hint}")


def require_measure(store: xr.Dataset, name: str) -> None:
    """Check that a name is that of a measure, and that the store has it; InputError where not."""
    if role_of(name) not in ("measure", "setting"):
        require_variables(store, [name])
        raise refusal(store, f"{name}: is not a measure; choose one of {', '.join(MEASURES)}")
    require_variables(store, [name])


def require_results(values: ArrayLike, store: xr.Dataset) -> None:
    """Check that at least one value is finite; InputError where no selected case is done."""
    if not np.isfinite(np.asarray(values, dtype=float)).any():
        fix = "run the study to its end, or select cases that did not fail or diverge (`rubhpc status`)"
        raise refusal(store, f"no selected case is done; {fix}")


def probes_of(store: xr.Dataset) -> dict[str, dict[str, Any]]:
    """Return the probes of a store by name, each with the keys of its table of the study, in SI."""
    record = table_of(store, "study").get("record", {})
    return {probe["name"]: probe for probe in record.get("probe", [])}


def probe_of(store: xr.Dataset, name: str) -> dict[str, Any]:
    """Return one probe of a store; InputError where it has no such."""
    known = probes_of(store)
    name = name.removeprefix(PROBE)
    if name not in known:
        fix = (
            "run the study with a [[record.probe]]" if MEASURED not in store.attrs else f"add [signal.{name}]"
        )
        fix = f"choose one of {', '.join(known)}" if known else fix
        raise refusal(store, f"no probe {name}; {fix}")
    return known[name]
