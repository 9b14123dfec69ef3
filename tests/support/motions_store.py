"""Synthetic stores of starts: sections of known motions, as `postproc.cases.attractors` sorts them."""

from __future__ import annotations

import numpy as np
import xarray as xr

from rubhpc.schema import DONE, REGIME

N = 12  # revolutions of the sections
NO_CONTACT, PERIODIC, TORUS, CHAOS = (
    REGIME.index(name) for name in ("no_contact", "periodic", "quasi_periodic", "chaotic")
)


def section(points, shift=0, noise=0.0, seed=0):
    """Vertical, horizontal and torsion (3, N) of a periodic motion, m and rad."""
    points = np.array(points, dtype=float)
    whole = np.resize(np.roll(points, shift, axis=0), (N, 3)).T
    return whole + noise * np.random.default_rng(seed).standard_normal(whole.shape)


P1 = [(1e-4, 0.0, 1e-3)]
OTHER_P1 = [(1.2e-4, 0.0, 1e-3)]
P2 = [(2e-4, -1e-4, 2e-3), (-1e-4, 0.0, 1e-3)]
FREE = [(5e-5, 5e-5, 0.0)]


def torus(phase):
    angle = phase + 2.4 * np.arange(N)
    return np.stack([1e-4 * np.cos(angle), 1e-4 * np.sin(angle), np.full(N, 5e-4)])


KINDS = {
    "free": (NO_CONTACT, 1, lambda i: section(FREE, noise=1e-9, seed=i)),
    "P1": (PERIODIC, 1, lambda i: section(P1, noise=1e-8, seed=i)),
    "other P1": (PERIODIC, 1, lambda i: section(OTHER_P1, noise=1e-8, seed=i)),
    "P2": (PERIODIC, 2, lambda i: section(P2, shift=i, noise=1e-8, seed=i)),
    "torus": (TORUS, 0, torus),
    "long period": (PERIODIC, 0, torus),  # the same torus, which passed for a long period
}


def store_of(kinds, settled=None, **coords):
    """A store of these kinds of motion, over the axes given."""
    kinds = np.array(kinds)
    sections = np.array([KINDS[k][2](i) for i, k in enumerate(kinds.ravel())]).reshape(*kinds.shape, 3, N)
    dims = tuple(coords) or ("initial_vertical",)
    coords = coords or {"initial_vertical": np.arange(kinds.size) * 1e-5}
    return xr.Dataset(
        {
            "status": (dims, np.full(kinds.shape, DONE)),
            "regime": (dims, np.vectorize(lambda k: KINDS[k][0])(kinds)),
            "period": (dims, np.vectorize(lambda k: KINDS[k][1])(kinds)),
            "settled": (dims, np.ones(kinds.shape, int) if settled is None else np.array(settled)),
            **{
                f"section_{name}": ((*dims, "section"), sections[..., i, :])
                for i, name in enumerate(("vertical", "horizontal", "torsion"))
            },
        },
        coords=coords,
    )
