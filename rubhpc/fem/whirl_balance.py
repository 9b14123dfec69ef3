"""Steady dry whirl of a rotor in a round bore: where forces balance without unbalance, and its stability.

H. F. Black, J. Mech. Eng. Sci. 10 (1968) 1-12, with the sign of the slip; docs/theory/dry_whirl.md. The
centres of rim and hole keep the distance rho and turn with the whirl frequency w. The contact force on the
rotor is `-(N + i T) n`, so that with the receptance gamma of rim and hole together

    rho = -gamma(w) (N + i T),   N = -rho Re(1 / gamma),   T = -rho Im(1 / gamma).

Either the rim slips, with `T = mu N sgn(s)` and `s = r_d spin + rho w`, or it rolls: `s = 0`, `|T| <= mu N`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import brentq

from rubhpc.fem.receptance import RIGID

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.fem.receptance import Receptance
    from rubhpc.rig.normal_law import NormalLaw

    Floats = NDArray[np.float64]
    Complex = NDArray[np.complex128]

SLIPPING, ROLLING = "slipping", "rolling"
_BEYOND = 1.5  # of the fastest mode: above it no receptance changes its sign
_NEWTON = 12  # iterations, of which some eight are needed
_FAST = 20.0  # frequency of modes that stability leaves out, over the highest whirl frequency


@dataclass(frozen=True, kw_only=True)
class Whirl:
    """A steady dry whirl.

    Attributes
    ----------
    frequency : float
        rad/s, positive in the sense of positive spin.
    kind : {"slipping", "rolling"}
    friction : float
        The coefficient that it needs: exactly, while it slips; at least, while it rolls.
    radius : float
        Distance of the centres of rim and hole, m; infinite at the limit of what a penalty's spring holds.
    normal_force, friction_force : float
        N; the latter on the rotor against the sense of positive spin.
    orbit, hole_orbit : float
        Radius of the orbit of the rim's centre, and of the hole's, m.
    """

    frequency: float
    kind: str
    friction: float
    radius: float
    normal_force: float
    friction_force: float
    orbit: float
    hole_orbit: float


class Balance:
    """The balance of forces in one bore at one speed.

    Parameters
    ----------
    rotor, hole : Receptance
        Of the centres of rim and hole.
    twist : Receptance
        Path of the rim along the wall over the friction, by rotation of rim and hole, m/N.
    spin : float
        rad/s.
    radius, clearance : float
        Of the rim, and radial, m.
    law : NormalLaw
        Of the contact.
    most_frequency : float
        Highest whirl frequency searched, rad/s.
    """

    def __init__(
        self,
        rotor: Receptance,
        hole: Receptance,
        twist: Receptance,
        *,
        spin: float,
        radius: float,
        clearance: float,
        law: NormalLaw,
        most_frequency: float = math.inf,
    ) -> None:
        self._rotor, self._hole, self._law = rotor, hole, law
        self._receptance = rotor + hole
        self._clearance, self._rim_speed = clearance, radius * spin
        fastest = float(np.abs(self._receptance.pole).max(initial=0.0))
        top = min(most_frequency, max(_BEYOND * fastest, 1.01 * abs(self._rim_speed) / clearance))
        self._slow, self._slow_twist = (part.reduced(_FAST * top) for part in (self._receptance, twist))
        self._set_cells(*self._receptance.cells(-top, top))
        self._rolling = [w for w in self._zeros(self._slip) if self._presses(w)]
        # The least friction is where it is stationary or zero, where slip or the range ends, or at the limit.
        points = [*self._turns, *self._zeros(lambda _, value: value.imag), -top, top]
        self._lowest = [w for w in points if self._presses(w) and self._balances(w, self._slip_at(w))]
        if law.kind == "penalty":
            limits = self._zeros(lambda _, value: self._inverse_radius(value))
            self._lowest += [w for w in limits if self._balances(w, w)]

    def whirls(self, friction: float) -> list[Whirl]:
        """Return all steady whirls at a coefficient of friction, by rising frequency."""
        found = [self._whirl(w, ROLLING) for w in self._rolling if abs(self._ratio(w)) <= friction]
        for sign in (1.0, -1.0):
            slope = sign * friction

            def excess(_: Any, value: Any, slope: float = slope) -> Any:
                return value.imag + slope * value.real

            for w in self._zeros(excess):
                if self._presses(w) and np.sign(self._slip_at(w)) == sign:
                    found.append(self._whirl(w, SLIPPING))
        return sorted(found, key=lambda whirl: whirl.frequency)

    def thresholds(self) -> list[Whirl]:
        """Return the whirl that needs the least friction in each range of frequencies, by rising frequency.

        In each range the hole presses on the rim, and no whirl is possible with less friction. The radius is
        infinite at the limit of what a penalty's spring holds.
        """
        found = [self._whirl(w, ROLLING) for w in self._rolling]
        found += [self._whirl(w, SLIPPING) for w in self._lowest]
        bounds = np.sort(self._zeros(lambda _, value: value.real))
        least: dict[int, Whirl] = {}
        for whirl in sorted(found, key=lambda whirl: -whirl.friction):
            least[int(np.searchsorted(bounds, whirl.frequency))] = whirl
        return sorted(least.values(), key=lambda whirl: whirl.frequency)

    def curve(self) -> tuple[Floats, Floats]:
        """Return frequencies, rad/s, and the friction that slipping whirl needs, NaN without, (n,) each."""
        w = np.unique(np.concatenate([self._lower, self._upper]))
        value = self._receptance.at(w)
        ratio = -value.imag / value.real
        exists = (
            (value.real < 0.0) & (self._inverse_radius(value) > 0.0) & (ratio * self._slip(w, value) >= 0.0)
        )
        return w, np.where(exists, np.abs(ratio), np.nan)

    def growth_rate(self, whirl: Whirl) -> float:
        """Return the largest growth rate of small changes of a whirl, 1/s: negative where it is stable.

        A whirl is a relative equilibrium in the frame that turns with it. The change of its phase, which does
        not decay, is left out. Rates below -10 times the whirl frequency are not resolved, and modes above 20
        times the highest whirl frequency searched are left out.
        """
        w, rho, N, T = whirl.frequency, whirl.radius, whirl.normal_force, whirl.friction_force
        is_rolling = whirl.kind == ROLLING
        lateral, twist = self._slow, self._slow_twist if is_rolling else RIGID
        pole = np.concatenate([lateral.pole - 1j * w, twist.pole])
        n = len(lateral.pole)
        is_lateral = np.arange(len(pole)) < n

        def acts(force: complex, drag: float = 0.0) -> Floats:
            """Effect of a change of N + i T on the modes, and of `drag` on those of the twist."""
            effect = np.concatenate([force * lateral.residue, drag * twist.residue])
            return np.concatenate([effect.real, effect.imag])

        # States: real and imaginary parts of the modes, of the displacement x + i y and of the twist.
        state = np.block(
            [[np.diag(pole.real), -np.diag(pole.imag)], [np.diag(pole.imag), np.diag(pole.real)]]
        )
        x, y, turn = np.zeros((3, 2 * len(pole)))
        x[: len(pole)], y[len(pole) :], turn[: len(pole)] = -1.0 * is_lateral, -1.0 * is_lateral, ~is_lateral
        state += np.outer(acts(1j * (N + 1j * T) / rho), y)  # the normal turns by y / rho
        press = acts(1.0 if is_rolling else 1.0 + 1j * T / N)
        fade = 10.0 * abs(w)  # rate at which a constraint that is not met is approached
        inputs, seen, asked = [], [], []  # multipliers; rows that they change; what these have to be
        if self._law.kind == "lagrange":
            inputs, seen = [press], [x @ state]
            asked = [-fade * (2.0 * (x @ state) + fade * x)]
        else:
            stiffness, damping = self._tangent(whirl)
            state += np.outer(press, stiffness * x + damping * (x @ state))
        if is_rolling:
            slip = (y - turn) @ state + w * x
            inputs, seen, asked = [*inputs, acts(1j, 1.0)], [*seen, slip], [*asked, -fade * slip]
        if inputs:
            B, C = np.stack(inputs, axis=1), np.stack(seen)
            state += B @ np.linalg.solve(C @ B, np.stack(asked) - C @ state)
        values = np.linalg.eigvals(state)
        return float(np.delete(values, np.abs(values).argmin()).real.max())

    def _set_cells(self, lower: Floats, upper: Floats) -> None:
        """Intervals of frequency in each of which the friction that is needed is monotonic."""

        def turn(w: float | Floats) -> Any:
            """Zero where the angle of the receptance is stationary, and with it the friction."""
            value, slope = self._receptance.derivatives(w, 1)
            return (slope * value.conj()).imag

        at = np.flatnonzero(turn(lower) * turn(upper) < 0.0)
        self._turns = [_root(turn, lower[i], upper[i]) for i in at]
        self._lower, self._upper = np.append(lower, self._turns), np.append(upper, upper[at])
        self._upper[at] = self._turns
        self._lower_values, self._upper_values = (
            self._receptance.at(ends) for ends in (self._lower, self._upper)
        )

    def _zeros(self, function: Callable[[Any, Any], Any]) -> list[float]:
        """Frequencies at which a function of frequency and receptance changes its sign."""
        before, after = function(self._lower, self._lower_values), function(self._upper, self._upper_values)
        at = np.flatnonzero((before * after < 0.0) | (after == 0.0))
        return [
            _root(lambda w: function(w, self._receptance.at(w)), self._lower[i], self._upper[i]) for i in at
        ]

    def _whirl(self, w: float, kind: str) -> Whirl:
        value = self._receptance.at(w)
        inverse = float(self._inverse_radius(value))
        radius = 1.0 / inverse if inverse > 0.0 else math.inf
        push = -radius / complex(value)
        return Whirl(
            frequency=w,
            kind=kind,
            friction=abs(self._ratio(w)),
            radius=radius,
            normal_force=push.real,
            friction_force=push.imag,
            orbit=radius * float(abs(self._rotor.at(w) / value)),
            hole_orbit=radius * float(abs(self._hole.at(w) / value)),
        )

    def _ratio(self, w: float) -> float:
        """T / N of a whirl."""
        value = complex(self._receptance.at(w))
        return -value.imag / value.real

    def _presses(self, w: float) -> bool:
        """Whether the hole presses on the rim, as far as its spring holds."""
        value = self._receptance.at(w)
        return bool(value.real < 0.0 and self._inverse_radius(value) > 0.0)

    def _balances(self, w: float, slip: float) -> bool:
        """Whether the friction of a whirl acts against a slip, given in any scale."""
        return bool(self._receptance.at(w).real < 0.0) and self._ratio(w) * slip >= 0.0

    def _slip_at(self, w: float) -> float:
        return float(self._slip(w, self._receptance.at(w)))

    def _slip(self, w: Any, value: Any) -> Any:
        """Slip over the radius of the orbit, 1/s."""
        return self._rim_speed * self._inverse_radius(value) + w

    def _inverse_radius(self, value: Any) -> Any:
        """Return 1 / rho by the contact law, 1/m; negative where the spring of a penalty gives way."""
        if self._law.kind == "lagrange":
            return np.full(np.shape(value), 1.0 / self._clearance)
        assert self._law.stiffness is not None
        ratio = (
            np.maximum(-(1.0 / np.asarray(value)).real, 0.0) / self._law.stiffness
        )  # N / rho over stiffness
        if self._law.kind == "penalty":
            return (1.0 - ratio) / self._clearance
        assert self._law.kind == "hertz"
        # y^3 = ratio (c + y^2) of the root y of the approach, by Newton's method from above.
        y = ratio + np.cbrt(ratio * self._clearance)
        for _ in range(_NEWTON):
            excess = y**3 - ratio * (self._clearance + y**2)
            slope = y * (3.0 * y - 2.0 * ratio)
            y = y - np.divide(excess, slope, out=np.zeros_like(y), where=slope > 0.0)
        return 1.0 / (self._clearance + y**2)

    def _tangent(self, whirl: Whirl) -> tuple[float, float]:
        """Slopes of the normal force in approach and its rate, N/m and N s/m."""
        stiffness, damping = self._law.stiffness or 0.0, self._law.damping or 0.0
        if self._law.kind == "penalty":
            return stiffness, damping
        return 1.5 * stiffness * math.sqrt(whirl.radius - self._clearance), damping * whirl.normal_force


def _root(function: Callable[[Any], Any], low: float, high: float) -> float:
    """Zero of a function that changes its sign between two frequencies, as exactly as they have digits."""
    before, after = abs(function(low)), abs(function(high))
    if function(low) * function(high) >= 0.0:  # the sum over modes was rounded otherwise
        return low if before < after else high
    return float(brentq(lambda w: float(function(w)), low, high, xtol=1e-14 * max(abs(low), abs(high))))
