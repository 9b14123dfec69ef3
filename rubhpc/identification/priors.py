"""What is known of a machine before a measurement: the entries of [grid] as prior distributions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.errors import InputError
from rubhpc.input.messages import place
from rubhpc.input.quantity import parse_quantity
from rubhpc.study.axes import stated
from rubhpc.study.axis_reading import NORMAL_KEYS, declared_axis, make_axis, make_range

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.input.quantity import Range
    from rubhpc.rig.rig import Rig
    from rubhpc.study.axes import Axis

    Floats = NDArray[np.float64]

_GRID = 1001  # points of the unit interval by which the standard deviation of a prior is taken


@dataclass(frozen=True, kw_only=True)
class Prior:
    """Distribution of one quantity.

    Attributes
    ----------
    axis : Axis
        Its name, SI unit and long name; of a list the values that are equally likely.
    between : Range or None
        Where it is uniform, or log-uniform.
    normal : (mean, standard deviation) or None
        Of a normal distribution.
    low, high : float
        Where a normal distribution is cut off: no value beyond is valid.
    """

    axis: Axis
    between: Range | None = None
    normal: tuple[float, float] | None = None
    low: float = -math.inf
    high: float = math.inf

    @property
    def name(self) -> str:
        """Key in [grid]."""
        return self.axis.name

    def at(self, share: float) -> float:
        """Return the value below which a share of the distribution lies, in SI units."""
        if self.between is not None:
            return self.between.at(share)
        if self.normal is not None:
            from scipy.special import ndtr, ndtri

            mean, std = self.normal
            below, above = ndtr((self.low - mean) / std), ndtr((self.high - mean) / std)
            return float(mean + std * ndtri(below + share * (above - below)))
        values = self.axis.values
        return values[min(int(share * len(values)), len(values) - 1)]

    @property
    def spread(self) -> float:
        """Standard deviation."""
        shares = np.linspace(0.0, 1.0, _GRID)[1:-1]
        return float(np.std([self.at(share) for share in shares.tolist()]))

    def as_given(self, value: float) -> float | str:
        """Return a value as an argument of a case takes it: of a choice its word."""
        return stated(self.name, value)


def at_shares(priors: Sequence[Prior], shares: Floats) -> Floats:
    """Return the values at a point of the unit cube, in SI units."""
    return np.array([prior.at(share) for prior, share in zip(priors, shares.tolist(), strict=True)])


def is_prior(value: object) -> bool:
    """Whether an entry of [grid] leaves the quantity open: a table, or several values."""
    return isinstance(value, dict) or (isinstance(value, list) and len(value) > 1)


def read_prior(name: str, value: Any, rig: Rig, file: str) -> Prior:
    """Return the prior of an entry of [grid].

    Parameters
    ----------
    value : dict or list
        `{start, stop}` is uniform, with `scale = "log"` log-uniform; `{mean, std}` is normal; values of a
        list are equally likely, and so are the whole numbers from `start` to `stop` of a node.
    """
    where = place(file, "grid", name)
    declared = declared_axis(name, rig, where)
    if not isinstance(value, dict):
        return Prior(axis=make_axis(name, value, rig, file))
    if not set(value) & set(NORMAL_KEYS):
        if declared.metadata["kind"] == "count" and set(value) == {"start", "stop"}:
            return Prior(axis=make_axis(name, value | {"step": 1}, rig, file))
        axis = make_range(name, value, rig, file)
        return Prior(axis=axis, between=axis.drawn_from)
    if set(value) != set(NORMAL_KEYS):
        raise InputError(f"{where}: a normal prior has mean and std alone; write {{ mean, std }}")
    axis = make_axis(name, value["mean"], rig, file)
    if declared.metadata["kind"] != "quantity" or len(axis.values) != 1:
        raise InputError(f"{where}: mean is not a quantity; write a list of values that are equally likely")
    std = parse_quantity(value["std"], declared.metadata["unit"], f"{where}: std")
    if std <= 0.0:
        raise InputError(f"{where}: std: {std:g} is out of range; it must be above 0")
    limits = declared.metadata
    low = max(
        (limits[key] for key in ("above", "at_least") if limits.get(key) is not None), default=-math.inf
    )
    high = math.inf if limits.get("below") is None else limits["below"]
    return Prior(axis=axis, normal=(axis.values[0], std), low=low, high=high)
