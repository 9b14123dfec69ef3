"""What the measures of a store say of its cases in a line: regimes, not settled, out of range."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.schema import REGIME, SETTLED
from rubhpc.study.contact_axes import PREFIX, choices_of
from rubhpc.validity import MONITORS, STEADY_SLIP, counted

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.storage.manifest import Manifest

_LAW = f"{PREFIX}friction_law"


def verdicts(manifest: Manifest, is_done: NDArray[np.bool_], measures: NDArray[np.void]) -> str:
    """Return the line; "" where nothing is known.

    Parameters
    ----------
    is_done : (n_case,)
        The cases that count.
    measures : (n_case,) record
        Those of the store.
    """
    known = measures.dtype.names or ()
    parts = []
    if "regime" in known:
        counts = [int((measures["regime"][is_done] == flag).sum()) for flag in range(len(REGIME))]
        named = [f"{n} {name.replace('_', ' ')}" for name, n in zip(REGIME, counts, strict=True) if n]
        parts += [", ".join(named)] if named else []
    if "settled" in known:
        n_moving = int((measures["settled"][is_done] == SETTLED.index("not_settled")).sum())
        parts += [f"{n_moving} not settled"] if n_moving or parts else []
    codes = np.zeros(manifest.n_case, np.int16)
    is_watched = False
    for i, (name, monitor) in enumerate(MONITORS.items()):
        if name in known:
            values = measures[name]
            is_out = monitor.is_out(values)
            is_out = is_done & (is_out.any(axis=1) if is_out.ndim > 1 else is_out)
            if name == STEADY_SLIP:
                is_out &= ~_may_reverse(manifest)
            codes |= np.int16(1 << i) * is_out
            is_watched |= bool(np.isfinite(values[is_done]).any())
    n_out = int(np.count_nonzero(codes))
    if is_watched:
        parts.append(f"{n_out} out of the model's range" + (f": {counted(codes)}" if n_out else ""))
    return "; ".join(parts)


def _may_reverse(manifest: Manifest) -> NDArray[np.bool_]:
    """Whether slip may reverse in a case, (n_case,): under Coulomb's law."""
    for axis in manifest.axes:
        if axis.name == _LAW:
            is_coulomb = np.array(axis.values) == choices_of(_LAW).index("coulomb")
            lengths = [
                n if dim == axis.dimension else 1
                for dim, n in zip(manifest.dims, manifest.shape, strict=True)
            ]
            return np.broadcast_to(is_coulomb.reshape(lengths), manifest.shape).ravel()
    law = manifest.parts.get("contact", {}).get("friction_law")
    return np.full(manifest.n_case, law == "coulomb")
