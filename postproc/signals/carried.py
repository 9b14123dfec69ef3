"""Where stators on a carrier are on average: their carrier may move by more than the clearance."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from postproc.store.rig_of_case import rig_of

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

NEEDED = ("stator_axial", "stator_lateral", "contact_force")


def mean_shift(tips: xr.Dataset) -> NDArray[np.float64]:
    """Return how far the carrier of each stator has moved up and to +z on average, (n_stator, 2), m.

    It is read from the tips that touch nothing, which move with it: `v cos a + w sin a` outwards and
    `w cos a - v sin a + s` along the rim, where s is a turn. Stators on the ground have not moved.

    Parameters
    ----------
    tips : Dataset
        `stator_axial`, `stator_lateral` (m) and `contact_force` (N) of one case over stator and sample.
    """
    stators = rig_of(tips).stator
    axial, lateral, force = (tips[name].transpose("stator", "sample").values.mean(axis=1) for name in NEEDED)
    shift = np.zeros((len(stators), 2))
    for name in {stator.carrier for stator in stators} - {None}:
        carried = np.array([i for i, stator in enumerate(stators) if stator.carrier == name])
        free = carried[force[carried] == 0.0]
        seen = free if free.size > 1 else carried
        c, s = (f(np.array([stators[i].angle for i in seen])) for f in (np.cos, np.sin))
        rows = np.concatenate([np.stack([c, s, 0.0 * c], 1), np.stack([-s, c, np.ones_like(c)], 1)])
        found, *_ = np.linalg.lstsq(rows, np.concatenate([axial[seen], lateral[seen]]))
        shift[carried] = found[:2]
    return shift
