"""Decaying sines in a sampled signal: frequency and damping by the matrix pencil."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

_PER_CYCLE = 16  # samples of a cycle that the pencil needs
_CYCLES = 10  # from the start of the signal; a damped sine has said all by then
_ORDER = 6  # poles: three decaying sines at most
_FLOOR = 1e-3  # of the greatest singular value; below it is noise


def decaying_sine(values: Floats, dt: float) -> dict[str, float]:
    r"""Return the strongest decaying sine of a signal (n_sample,), from its start, `dt` seconds apart.

    The signal is modelled as $\sum_k c_k e^{s_k t}$. Its means over blocks of samples have the same poles
    with less noise; from them the matrix pencil (Y. Hua, T. K. Sarkar, IEEE Trans. ASSP 38 (1990) 814-824)
    finds $s_k$ as eigenvalues of one shifted Hankel matrix against another, both cut to the singular values
    above the noise. Amplitudes follow by least squares.

    Returns
    -------
    dict
        `frequency` (damped, Hz), `damping_ratio`, `decay_rate` (1/s), `amplitude` (at the first sample, in
        the unit of the signal) and `residual` (rms misfit of the whole model over the rms of the signal, over
        the first ten cycles); empty where nothing oscillates.
    """
    if not np.any(values):
        return {}
    frequency = _guess(values, dt)
    block = max(1, int(1 / (frequency * dt * _PER_CYCLE)))
    kept = min(values.size, max(8 * block, math.ceil(_CYCLES / (frequency * dt))))
    poles = _poles(values[:kept], block, dt)
    if poles.size == 0:
        return {}
    modes = np.exp(np.outer(np.arange(kept) * dt, poles))
    weights = np.linalg.lstsq(modes, values[:kept].astype(complex), rcond=None)[0]
    misfit = float(np.sqrt(np.mean(np.abs(values[:kept] - modes @ weights) ** 2)))
    oscillates = np.flatnonzero(poles.imag > 1e-3 / (kept * dt))
    if oscillates.size == 0:
        return {}
    energy = np.abs(weights) ** 2 * np.sum(np.abs(modes) ** 2, axis=0)
    strongest = oscillates[np.argmax(energy[oscillates])]
    pole = complex(poles[strongest])
    return {
        "frequency": pole.imag / (2 * math.pi),
        "damping_ratio": -pole.real / abs(pole),
        "decay_rate": -pole.real,
        "amplitude": 2 * float(abs(weights[strongest])),
        "residual": misfit / float(np.sqrt(np.mean(values[:kept] ** 2))),
    }


def _guess(values: Floats, dt: float) -> float:
    """Return the frequency of the highest line of a signal, Hz, at least one cycle over all of it."""
    n = 4 * values.size  # padded: lines closer than a cycle over the signal
    lines = np.abs(np.fft.rfft(values, n))
    lines[:4] = 0.0
    return max(int(np.argmax(lines)), 4) / (n * dt)


def _poles(values: Floats, block: int, dt: float) -> NDArray[np.complex128]:
    """Return the poles $s_k$ of a signal, 1/s, from the means over blocks of its samples."""
    import scipy.linalg

    n_block = values.size // block
    means = values[: n_block * block].reshape(n_block, block).mean(axis=1)
    half = n_block // 2
    hankel = scipy.linalg.hankel(means[: n_block - half], means[n_block - half - 1 :])
    _, sizes, right = np.linalg.svd(hankel, full_matrices=False)
    order = min(_ORDER, half, int(np.sum(sizes > _FLOOR * sizes[0])))
    basis = right[:order].conj().T
    shift, *_ = np.linalg.lstsq(basis[:-1], basis[1:], rcond=None)
    z = np.linalg.eigvals(shift).astype(complex)
    z = z[np.abs(z) > 1e-12]
    poles: NDArray[np.complex128] = np.log(z) / (block * dt)
    return poles
