"""Motions that repeat, compared by amplitude and phase of their lines.

A measured line is `d = m exp(i k theta) + noise`, with m that of the model, k its order, and theta by how far
the model's revolution has to be turned. Where the angle of the shaft is known theta is a number of whole
revolutions, which is unknown as long as the motion repeats every few of them, within the error of that angle;
else it is any angle. It is integrated over. The errors of real and imaginary part are Gaussian and
independent of line and channel, with the variance

    |noise|^2 + |scatter|^2 + discrepancy^2 (|m|^2 + (0.03 rms)^2)

with the rms of the signal. The noise is that of the measured lines between those of the orders compared,
within half an order, and the scatter the same of the simulation: it is 0 of a motion that repeats.
"""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import logsumexp

from rubhpc.identification.comparison import (
    DISCREPANCIES,
    LEAST,
    Seen,
    likeliest,
    lines_of,
    wanted_orders,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.identification.channels import Channels
    from rubhpc.identification.comparison import Unknown

    Floats = NDArray[np.float64]
    Lines = NDArray[np.complex128]

_NEIGHBOURS = 0.5  # orders to either side, whose lines give the noise
_FINE = 12  # trial angles a turn of the highest order
_DEEP = 25.0  # by how much less likely an angle is that is left out
_NEWTON = 4
_FLAT = 1e-9  # of the largest bend: a smaller one counts as this


class LineComparison:
    """Lines of a measured motion that repeats.

    Parameters
    ----------
    channels : Channels
    period : int
        Revolutions, in which it repeats a whole number of times.
    natural : sequence of float
        Orders of natural frequencies, around which higher lines are compared too.
    """

    def __init__(self, channels: Channels, period: int, natural: Sequence[float]) -> None:
        self._n, self._period, self._angle_error = channels.n, period, channels.angle_error
        orders = np.arange(1, math.floor(channels.highest_order * period) + 1) / period
        self._kept = np.flatnonzero(wanted_orders(orders, natural, channels.highest_order)) + 1
        self.orders = self._kept / period
        self.measured = self._seen(channels.waves)
        size = np.std(channels.waves, axis=1)
        self._least = (LEAST * size[:, None]) ** 2
        self.about = (
            f"it repeats: {self.orders.size} lines of each signal are compared by amplitude and phase, up to "
            f"{self.orders[-1]:.3g}X in steps of 1/{period}X"
        )
        n_angle = period * (1 if self._is_absolute else math.ceil(_FINE * self.orders[-1]))
        self._angles = 2.0 * math.pi * period / n_angle * np.arange(n_angle)
        self._turned = np.exp(1j * np.outer(self.orders, self._angles))

    @property
    def _is_absolute(self) -> bool:
        return math.isfinite(self._angle_error)

    def _seen(self, waves: Floats) -> Seen:
        """Lines at the orders compared, and the mean power of those between them."""
        n_period = waves.shape[1] // self._n // self._period
        lines = lines_of(waves, self._n, n_period * self._period)
        power = np.abs(lines) ** 2
        between = np.ones(power.shape[1])
        between[::n_period] = 0.0
        reach = max(1, round(_NEIGHBOURS * n_period * self._period))
        at = self._kept * n_period
        low, high = np.maximum(at - reach, 1), np.minimum(at + reach + 1, power.shape[1])
        sums = np.concatenate([np.zeros((power.shape[0], 1)), np.cumsum(power * between, axis=1)], axis=1)
        counts = np.concatenate([[0.0], np.cumsum(between)])
        return Seen(
            lines[:, at], (sums[:, high] - sums[:, low]) / np.maximum(counts[high] - counts[low], 1.0)
        )

    def of(self, waves: Floats) -> Seen:
        """Return the lines of a simulated motion, and the variance by its own scatter."""
        values, variance = self._seen(waves)
        return Seen(values, 2.0 * variance)  # of this record, and of the one that was measured

    def by_discrepancy(self, seen: Seen, unknown: Unknown | None = None) -> Floats:
        """Return the logarithm of the likelihood at each discrepancy, over all angles and unknown forces."""
        variance, apart, product = self._apart(seen, DISCREPANCIES, unknown)
        if unknown is not None and (at := self._at(unknown)) is not None:
            apart = apart + 0.0
            apart[:, 0, at] = -_over_forces(self.measured.values[:, at], variance[0, :, at], unknown)
        gain = 2.0 * np.real(product @ self._turned)
        peaks = itertools.starmap(self._peaks, zip(product, gain, strict=True))
        turned = np.array([logsumexp(top, b=share) for top, share in peaks])
        return np.asarray(turned - apart.sum(axis=(1, 2)))

    def _apart(
        self, seen: Seen, discrepancies: Floats, unknown: Unknown | None
    ) -> tuple[Floats, Floats, Lines]:
        """Variance, the part of minus the logarithm that no angle changes, and the products that it turns.

        The lines of unknown forces have no part in them.
        """
        lines, model = self.measured.values, seen.values
        error = discrepancies[:, None, None] ** 2 * (np.abs(model) ** 2 + self._least)
        variance = self.measured.variance + seen.variance + error
        apart = (np.abs(lines) ** 2 + np.abs(model) ** 2) / variance + np.log(np.pi * variance)
        products = np.conj(lines) * model / variance
        if unknown is not None and (at := self._at(unknown)) is not None:
            apart[:, :, at], products[:, :, at] = 0.0, 0.0
        return variance, apart, products.sum(axis=1)

    def _at(self, unknown: Unknown) -> int | None:
        """Place of the line of unknown forces, where it is compared."""
        found = np.flatnonzero(np.isclose(self.orders, unknown.order))
        return int(found[0]) if found.size else None

    def misfit(self, seen: Seen, unknown: Unknown | None = None) -> float:
        """Return the mean square of the residuals over their standard deviation, at the likeliest angle."""
        size = np.array([likeliest(self, seen, unknown)])
        variance, apart, product = self._apart(seen, size, unknown)
        logs = np.log(np.pi * variance)
        if unknown is not None and (at := self._at(unknown)) is not None:
            logs[:, :, at] = 0.0
        gain = 2.0 * np.real(product @ self._turned)
        best, _ = self._peaks(product[0], gain[0])
        return float(((apart - logs).sum() - best.max()) / apart.size)

    def amplitudes(self, seen: Seen) -> tuple[Floats, Floats]:
        """Return the amplitudes of the lines and of their noise, (n_channel, n_line)."""
        return np.abs(seen.values), np.sqrt(seen.variance)

    def _peaks(self, product: Lines, gain: Floats) -> tuple[Floats, Floats]:
        """Maxima over the angle, and the share of all angles that each stands for (Laplace's method)."""
        steepest = float(self.orders**2 @ np.abs(product))
        flat = -max(_FLAT * steepest, np.finfo(float).tiny)
        if self._is_absolute:
            reach, stiff = self._angle_error, self._angle_error**-2
            whole = math.sqrt(2.0 * math.pi) * self._angle_error * self._period
            first = self._angles
        else:
            reach, stiff, whole = 0.5 * self._angles[1], 0.0, 2.0 * math.pi * self._period
            higher = steepest * reach**2  # at most, between the trial angles
            is_top = (gain >= np.roll(gain, 1)) & (gain > np.roll(gain, -1))
            first = self._angles[is_top & (gain > gain.max() - _DEEP - higher)]
            if not first.size:  # a model that does not move
                return gain[:1], np.ones(1)
        angles = first
        for _ in range(_NEWTON):
            turned = product[:, None] * np.exp(1j * np.outer(self.orders, angles))
            slope = -2.0 * np.imag(self.orders @ turned) - stiff * (angles - first)
            bend = np.minimum(-2.0 * np.real(self.orders**2 @ turned) - stiff, flat)
            angles = angles - np.clip(slope / bend, -reach, reach)
        turned = product[:, None] * np.exp(1j * np.outer(self.orders, angles))
        bend = np.maximum(2.0 * np.real(self.orders**2 @ turned) + stiff, 2.0 * math.pi / whole**2)
        top = 2.0 * np.real(turned.sum(axis=0)) - 0.5 * stiff * (angles - first) ** 2
        return top, np.sqrt(2.0 * math.pi / bend) / whole


def _over_forces(lines: Lines, variance: Floats, unknown: Unknown) -> float:
    """Logarithm of the likelihood of a line (n_channel,) over Gaussian forces, whose phases are uniform."""
    noise, logs = np.diag(variance).astype(np.complex128), []
    for size in unknown.sizes.tolist():
        covariance = noise + size**2 * unknown.shapes @ unknown.shapes.conj().T
        _, log_size = np.linalg.slogdet(np.pi * covariance)
        logs.append(-log_size - np.real(lines.conj() @ np.linalg.solve(covariance, lines)))
    return float(logsumexp(logs) - math.log(len(logs)))
