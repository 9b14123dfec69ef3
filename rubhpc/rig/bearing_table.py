"""Bearings and seals whose coefficients depend on the speed, as tables over it."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from rubhpc.errors import InputError
from rubhpc.input.fields import FieldError, choice, count, series
from rubhpc.rig.parts import Bearing
from rubhpc.rig.supports import COEFFICIENTS, Support

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

PAIRS = ("yy", "yz", "zy", "zz")
_EXAMPLES = {"N/m": "[2e7, 1.5e7, 1.2e7]", "N s/m": "[8e4, 3e4, 1e4]"}


def _column(unit: str, doc: str) -> Any:
    return series(unit, doc=doc, example=_EXAMPLES[unit], default=None)


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
    eccentricity_y, eccentricity_z : tuple of float, optional
        Where the journal rests in the film under its static load, m; the coefficients hold about there.
    interpolation : {"cubic", "linear"}
        Monotone cubic (F. N. Fritsch, J. Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300-304), which passes
        through every value and overshoots none; or straight lines.
    """

    BOTH = Support.BOTH | COEFFICIENTS

    link: int | None = count(
        doc="Other node of a bearing between two nodes; only in rotors given by matrices.",
        example="12",
        default=None,
        is_key=False,
    )
    speed: tuple[float, ...] = series(
        "rad/s", doc="Speeds of the table, rising.", example='["500 rpm", "2000 rpm", "6000 rpm"]', at_least=0
    )
    stiffness: tuple[float, ...] | None = _column(
        "N/m", "Stiffness in both lateral directions, in place of kyy, kzz, kyz and kzy."
    )
    kyy: tuple[float, ...] | None = _column("N/m", "Vertical stiffness.")
    kzz: tuple[float, ...] | None = _column("N/m", "Horizontal stiffness.")
    kyz: tuple[float, ...] | None = _column("N/m", "Vertical force per horizontal displacement.")
    kzy: tuple[float, ...] | None = _column("N/m", "Horizontal force per vertical displacement.")
    damping: tuple[float, ...] | None = _column(
        "N s/m", "Damping in both lateral directions, in place of cyy, czz, cyz and czy."
    )
    cyy: tuple[float, ...] | None = _column("N s/m", "Vertical damping.")
    czz: tuple[float, ...] | None = _column("N s/m", "Horizontal damping.")
    cyz: tuple[float, ...] | None = _column("N s/m", "Vertical force per horizontal velocity.")
    czy: tuple[float, ...] | None = _column("N s/m", "Horizontal force per vertical velocity.")
    eccentricity_y: tuple[float, ...] | None = series(
        "m",
        doc="Vertical static position of the journal in the film, under the loads; up is positive.",
        example="[-30e-6, -20e-6, -12e-6]",
        default=None,
    )
    eccentricity_z: tuple[float, ...] | None = series(
        "m",
        doc="Horizontal static position, along +z; 0 where only the vertical one is given.",
        example="[-15e-6, -18e-6, -16e-6]",
        default=None,
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
        for declared in fields(self):
            values = getattr(self, declared.name)
            if isinstance(values, tuple) and len(values) not in (1, len(self.speed)):
                problem = f"{len(values)} values for {len(self.speed)} speeds"
                raise FieldError(declared.name, f"{problem}; give one for each speed, or a single number")
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
        values = self._values(spin, name)
        return values[:4].reshape(2, 2), values[4:8].reshape(2, 2)

    def eccentricity(self, spin: float, name: str = "bearing") -> NDArray[np.float64] | None:
        """Return the static position of the journal at a spin, (2,), up and along +z, m; None if not given.

        Parameters and errors are those of `at`.
        """
        if self.eccentricity_y is None and self.eccentricity_z is None:
            return None
        return self._values(spin, name)[8:]

    def _values(self, spin: float, name: str) -> NDArray[np.float64]:
        """What `_curves` returns at a spin within the table."""
        low, high = self.speed[0], self.speed[-1]
        if spin == 0.0:
            spin = low
        # a speed that a user gives in another unit may differ from the table's in the last digits
        nearest = min(max(spin, low), high)
        if not math.isclose(spin, nearest, rel_tol=1e-12):
            rpm = 30 / math.pi
            problem = f"{spin * rpm:.6g} rpm is outside its table, {low * rpm:.6g} to {high * rpm:.6g} rpm"
            raise InputError(f"{name}: {problem}; extend the table, or stay within it")
        return self._curves(nearest)

    @cached_property
    def _curves(self) -> Callable[[float], NDArray[np.float64]]:
        """Coefficients kyy, kyz, kzy, kzz, cyy, ... and both eccentricities over the spin, (10,)."""
        from scipy.interpolate import PchipInterpolator, make_interp_spline  # few rigs need them

        columns = []
        for common, letter in ((self.stiffness, "k"), (self.damping, "c")):
            for pair in PAIRS:
                values = getattr(self, f"{letter}{pair}")
                if values is None:
                    values = common if common is not None and pair in ("yy", "zz") else (0.0,)
                columns.append(np.broadcast_to(values, len(self.speed)))
        for values in (self.eccentricity_y, self.eccentricity_z):
            columns.append(np.broadcast_to(values or (0.0,), len(self.speed)))
        table = np.stack(columns, axis=1)
        if self.interpolation == "linear":
            curves: Callable[[float], NDArray[np.float64]] = make_interp_spline(self.speed, table, k=1)
        else:
            curves = PchipInterpolator(self.speed, table)
        return curves


AnyBearing: TypeAlias = Bearing | BearingTable
