"""Where the model leaves its range: every monitor, with the name that all outputs give it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

STEADY_SLIP = "minimum_slip_speed"  # its monitor holds for steady sliding: under other laws slip may reverse


@dataclass(frozen=True)
class Monitor:
    """What a measure may not pass.

    Attributes
    ----------
    name : str
        What figures, the report, messages and the documentation call it.
    limit : float
        In the unit of the measure.
    meaning : str
        What is wrong beyond the limit.
    is_least : bool
        Whether values below the limit are out of range, not those above it.
    """

    name: str
    limit: float
    meaning: str
    is_least: bool = False

    def is_out(self, values: Any) -> Any:
        """Whether values, an array, are out of range; NaN is not."""
        return values < self.limit if self.is_least else values > self.limit

    @property
    def text(self) -> str:
        """The limit and what is wrong beyond it."""
        return f"{'below' if self.is_least else 'above'} {self.limit:g}: {self.meaning}"


# By measure. Bit i of `validity` is that of monitor i; a store does not contain it.
MONITORS = {
    STEADY_SLIP: Monitor(
        "slip", 0.0, "the rim slips backwards, which contradicts steady sliding", is_least=True
    ),
    "force_over_euler_load": Monitor("Euler load", 1.0, "the stator would buckle"),
    "foreshortening_ratio": Monitor(
        "foreshortening", 0.1, 'forces are too large by 10 % or more; use geometry = "second_order"'
    ),
    "tip_deflection_ratio": Monitor("tip deflection", 0.1, "the stator is no longer a linear beam"),
    "normal_angle": Monitor(
        "normal angle", 0.02, 'the rub turns the normal, which is kept; use normal = "updated"'
    ),
    "bearing_clearance_ratio": Monitor(
        "bearing clearance", 1.0, "the shaft would touch its bearing, which a linear bearing does not know"
    ),
    "force_over_strength": Monitor("stator strength", 1.0, "the stator would break or yield"),
}


def words(code: int) -> str:
    """Names of the monitors in a sum of bits; "" for 0."""
    return ", ".join(monitor.name for i, monitor in enumerate(MONITORS.values()) if code >> i & 1)


def counted(codes: NDArray[np.integer[Any]]) -> str:
    """Names of the monitors in any of these sums of bits, each with the number of sums that have it."""
    counts = ((monitor.name, int(((codes >> i) & 1).sum())) for i, monitor in enumerate(MONITORS.values()))
    return ", ".join(f"{name} ({n})" for name, n in counts if n)
