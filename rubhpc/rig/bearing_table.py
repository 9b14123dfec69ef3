"""Bearings and seals whose coefficients depend on the speed, as tables over it."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from rubhpc.errors import InputError
from rubhpc.input.fields import FieldError, choice, count, series
from rubhpc.rig.parts import Bearing
from rubhpc.rig.supports import Support

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

PAIRS = ("yy", "yz", "zy", "zz")


@dataclass(frozen=True, kw_only=True)
class BearingTable(Support):
    """A linear support with coefficients tabulated over the speed: a fluid-film bearing, or a seal.

    Every coefficient is a list with one value for each speed, or one value that holds at all of them.

    Attributes
    ----------
    node, position, mass, myy, mzz, pedestal
        As those of a `Bearing`; constant.
    link : int, optional
        Other node, of a rotor given by its matrices; by default the ground.
    speed : tuple of float, rad/s
        Rising; none negative.
    stiffness, damping : tuple of float, optional
        In both directions, N/m and N s/m; or full 2x2 matrices:
    kyy, kyz, kzy, kzz, cyy, cyz, czy, czz : tuple of float, optional
        The first letter of the pair is the direction of the force, the second that of the motion. A seal may
        have a negative direct stiffness.
    interpolation : {"cubic", "linear"}
        Monotone cubic (F. N. Fritsch, J. Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300-304), which passes
        through every value and overshoots none; or straight lines.
    """

    link: int | None = count(
        doc="Other node of a bearing between two nodes; only in rotors given by matrices.",
        example="12",
        default=None,
        is_key=False,
    )
    speed: tuple[float, ...] = series(
        "rad/s", doc="Speeds of the table, rising.", example='["500 rpm", "2000 rpm", "6000 rpm"]', at_least=0
    )
    stiffness: tuple[float, ...] | None = series(
        "N/m",
        doc="Stiffness in both lateral directions, in place of kyy, kzz, kyz and kzy.",
        example="[2e7, 1.5e7, 1.2e7]",
        default=None,
    )
    kyy: tuple[float, ...] | None = series(
        "N/m", doc="Vertical stiffness.", example="[2e7, 1.5e7, 1.2e7]", default=None
    )
    kzz: tuple[float, ...] | None = series(
        "N/m", doc="Horizontal stiffness.", example="[2e7, 1.5e7, 1.2e7]", default=None
    )
    kyz: tuple[float, ...] | None = series(
        "N/m", doc="Vertical force per horizontal displacement.", example="[2e7, 1.5e7, 1.2e7]", default=None
    )
    kzy: tuple[float, ...] | None = series(
        "N/m", doc="Horizontal force per vertical displacement.", example="[2e7, 1.5e7, 1.2e7]", default=None
    )
    damping: tuple[float, ...] | None = series(
        "N s/m",
        doc="Damping in both lateral directions, in place of cyy, czz, cyz and czy.",
        example="[8e4, 3e4, 1e4]",
        default=None,
    )
    cyy: tuple[float, ...] | None = series(
        "N s/m", doc="Vertical damping.", example="[8e4, 3e4, 1e4]", default=None
    )
    czz: tuple[float, ...] | None = series(
        "N s/m", doc="Horizontal damping.", example="[8e4, 3e4, 1e4]", default=None
    )
    cyz: tuple[float, ...] | None = series(
        "N s/m", doc="Vertical force per horizontal velocity.", example="[8e4, 3e4, 1e4]", default=None
    )
    czy: tuple[float, ...] | None = series(
        "N s/m", doc="Horizontal force per vertical velocity.", example="[8e4, 3e4, 1e4]", default=None
    )
    interpolation: str = choice(
        of=("cubic", "linear"),
        doc="Between the speeds: monotone cubic, or straight lines.",
        example='"linear"',
        default="cubic",
    )

    def __post_init__(self) -> None:
        for declared in fields(self):
            value = getattr(self, declared.name)
            if declared.metadata.get("kind") == "series" and isinstance(
                value, list | float | int | np.ndarray
            ):
                object.__setattr__(self, declared.name, tuple(np.atleast_1d(value).tolist()))
        super().__post_init__()
        if len(self.speed) < 2:
            raise FieldError(
                "speed", "a table has at least two speeds; add one, or give a bearing without speed"
            )
        if any(after <= before for before, after in zip(self.speed, self.speed[1:], strict=False)):
            raise FieldError("speed", "the speeds do not rise; sort the table, each speed once")
        for one, letter in (("stiffness", "k"), ("damping", "c")):
            pairs = [f"{letter}{pair}" for pair in PAIRS]
            for key in (one, *pairs):
                values = getattr(self, key)
                if values is not None and len(values) not in (1, len(self.speed)):
                    problem = f"{len(values)} values for {len(self.speed)} speeds"
                    raise FieldError(key, f"{problem}; give one for each speed, or a single number")
                if key != one and values is not None and getattr(self, one) is not None:
                    raise FieldError(key, f"conflicts with {one}; give either {one} or {', '.join(pairs)}")
        if self.stiffness is None and (self.kyy is None or self.kzz is None):
            key = "kyy" if self.kyy is None else "kzz"
            raise FieldError(key, "missing; a table has either stiffness, or kyy and kzz")

    def at(self, spin: float, name: str = "bearing") -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return stiffness and damping matrix at a spin, (2, 2) each, N/m and N s/m.

        At standstill, where the table does not begin with 0, they are those of its lowest speed.

        Parameters
        ----------
        spin : float
            rad/s.
        name : str
            What an error calls the table.

        Raises
        ------
        InputError
            Outside the table: nothing is extrapolated.
        """
        low, high = self.speed[0], self.speed[-1]
        if spin == 0.0:
            spin = low
        # a speed that a user gives in another unit may differ from the table's in the last digits
        nearest = min(max(spin, low), high)
        if not math.isclose(spin, nearest, rel_tol=1e-12):
            rpm = 30 / math.pi
            problem = f"{spin * rpm:.6g} rpm is outside its table, {low * rpm:.6g} to {high * rpm:.6g} rpm"
            raise InputError(f"{name}: {problem}; extend the table, or stay within it")
        values = self._curves(nearest)
        return values[:4].reshape(2, 2), values[4:].reshape(2, 2)

    @cached_property
    def _curves(self) -> Callable[[float], NDArray[np.float64]]:
        """Coefficients kyy, kyz, kzy, kzz, cyy, ... over the spin, (8,)."""
        from scipy.interpolate import PchipInterpolator, make_interp_spline  # few rigs need them

        columns = []
        for common, letter in ((self.stiffness, "k"), (self.damping, "c")):
            for pair in PAIRS:
                values = getattr(self, f"{letter}{pair}")
                if values is None:
                    values = common if common is not None and pair in ("yy", "zz") else (0.0,)
                columns.append(np.broadcast_to(values, len(self.speed)))
        table = np.stack(columns, axis=1)
        if self.interpolation == "linear":
            curves: Callable[[float], NDArray[np.float64]] = make_interp_spline(self.speed, table, k=1)
        else:
            curves = PchipInterpolator(self.speed, table)
        return curves


AnyBearing: TypeAlias = Bearing | BearingTable
