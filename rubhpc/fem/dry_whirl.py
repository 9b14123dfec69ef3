"""Dry whirl that can exist in the bores of a rig, over speed, clearance and friction, in one dataset."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from rubhpc.errors import InputError
from rubhpc.fem.assemble import assemble, model_at
from rubhpc.fem.linear_design import checked_range
from rubhpc.fem.receptance import turning_receptances, twist_receptance
from rubhpc.fem.statics import sag_at
from rubhpc.fem.whirl_balance import ROLLING, SLIPPING, Balance, Whirl
from rubhpc.rig.normal_law import NormalLaw
from rubhpc.threads import on_one_thread

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from rubhpc.fem.model import Model, StatorModel
    from rubhpc.fem.receptance import Receptance
    from rubhpc.rig.rig import Rig

    Floats = NDArray[np.float64]

N_SPEED = 13  # speeds by default
HARD = NormalLaw()
_OFFSET = 1e-6  # of the clearance: distance of the shaft from the centre of a bore that counts
_COLUMNS = {  # of a whirl: unit and name
    "speed": ("rad s-1", "Spin speed"),
    "clearance": ("m", "Radial clearance"),
    "friction": ("1", "Friction of the case"),
    "frequency": ("rad s-1", "Whirl frequency"),
    "needed_friction": ("1", "Friction of the case that the whirl needs"),
    "orbit": ("m", "Radius of the orbit of the rim's centre"),
    "hole_orbit": ("m", "Radius of the orbit of the hole's centre"),
    "normal_force": ("N", "Normal force"),
    "growth_rate": ("s-1", "Largest growth rate of small changes"),
}


@on_one_thread
def dry_whirl(
    rig: Rig,
    speeds: Sequence[float] | Floats | None = None,
    clearances: ArrayLike = (),
    frictions: Sequence[float] = (),
    *,
    law: NormalLaw = HARD,
    most_frequency: float | None = None,
) -> xr.Dataset:
    """Return the dry whirl that can exist in each bore of a rig without unbalance, the other bores open.

    Parameters
    ----------
    rig : Rig
    speeds : (n_speed,), optional
        Spin, rad/s; by default 13 from 0 to six times the first lateral frequency, or over the tables of
        bearings.
    clearances : (n_clearance,) or (n_speed, n_clearance)
        Radial clearance of the case, m.
    frictions : sequence of float
        Coefficients of friction of the case, for which whirls are listed; may be empty.
    law : NormalLaw
        Contact law of the bores that have none of their own.
    most_frequency : float, optional
        Highest whirl frequency of interest, rad/s; by default there is no limit.

    Returns
    -------
    xarray.Dataset
        Over (stator, speed, setting), with the coordinates `node` of a stator, from which the numbers of bores
        are taken, and `clearance` (m) of a setting: `least_friction`, the coefficient below which no whirl
        exists, inf where none exists at all; `least_frequency` (rad/s) and `least_kind` ("slipping",
        "rolling" or "") of the whirl just above it; `is_approximate`, where the rotor or the hole is
        anisotropic, or the shaft does not rest in the centre of the bore.

        Over whirl, each at one of the frictions: `whirl_stator`, `whirl_speed` (rad/s), `whirl_clearance` (m),
        `whirl_friction`, `whirl_frequency` (rad/s, positive in the sense of positive spin), `whirl_kind`,
        `whirl_needed_friction`, `whirl_orbit`, `whirl_hole_orbit` (m), `whirl_normal_force` (N),
        `whirl_growth_rate` (1/s) and `is_stable`.

        Over point, at the first speed and clearance: `curve_stator`, `curve_frequency` (rad/s) and
        `curve_friction`, which a slipping whirl of that frequency needs.

    Raises
    ------
    InputError
        When the rig has no bore, a clearance is not positive, or a bearing has no coefficients at a speed.
    """
    model = assemble(rig)
    bores = [i for i, stator in enumerate(model.stators) if stator.is_bore]
    if not bores:
        raise InputError(f'rig {rig.name}: has no bore; add a [[stator]] with kind = "bore"')
    spins = np.asarray(speeds if speeds is not None else np.linspace(*checked_range(model, None), N_SPEED))
    gaps = np.asarray(clearances, dtype=float)
    gaps = np.broadcast_to(np.atleast_1d(gaps), (spins.size, np.atleast_1d(gaps).shape[-1]))
    if not gaps.size:
        raise InputError("clearance: missing; give at least one")
    shape = (len(bores), *gaps.shape)
    friction, frequency, kind = np.full(shape, math.inf), np.full(shape, math.nan), np.full(shape, "", "U8")
    is_approximate = np.zeros(shape, dtype=bool)
    rows: list[tuple[int, float, float, float, Whirl, float]] = []
    curve: list[Floats] = []
    for j, spin in enumerate(spins.tolist()):
        turning = model_at(model, spin)
        for i, (number, parts) in enumerate(zip(bores, _receptances(turning, bores, spin), strict=True)):
            stator = model.stators[number]
            factor = stator.friction_factor
            for k, gap in enumerate(gaps[j].tolist()):
                radial = gap + stator.clearance_offset
                if not 0.0 < radial < math.inf:
                    problem = f"stator {number + 1} has a radial clearance of {radial:g} m"
                    raise InputError(f"clearance: {problem}; give one above 0")
                balance = Balance(
                    *parts,
                    spin=spin,
                    radius=stator.radius,
                    clearance=radial,
                    law=stator.law or law,
                    most_frequency=most_frequency,
                )
                offset = _offset(turning, stator)
                is_approximate[i, j, k] = parts[0].is_mean or parts[1].is_mean or offset > _OFFSET * radial
                least = balance.least()
                if least is not None:
                    friction[i, j, k] = least.friction / factor if factor else math.inf
                    frequency[i, j, k], kind[i, j, k] = least.frequency, least.kind
                for mu in frictions:
                    for whirl in balance.whirls(mu * factor):
                        rows.append((number + 1, spin, gap, mu, whirl, balance.growth_rate(whirl)))
                if j == k == 0:
                    w, needed = balance.curve()
                    curve.append(np.stack([np.full(w.size, number + 1.0), w, needed / (factor or math.nan)]))
    along = ("stator", "speed", "setting")
    found = xr.Dataset(
        {
            "least_friction": (along, friction, _unit("1", "Least friction of a dry whirl")),
            "least_frequency": (along, frequency, _unit("rad s-1", "Frequency of the whirl of least friction")),
            "least_kind": (along, kind),
            "is_approximate": (along, is_approximate),
        },
        coords={
            "stator": ("stator", np.array(bores) + 1),
            "node": ("stator", [model.stators[i].node for i in bores], {"long_name": "Node"}),
            "speed": ("speed", spins.astype(float), _unit("rad s-1", "Spin speed")),
            "clearance": (("speed", "setting"), gaps, _unit("m", "Radial clearance")),
        },
        attrs={"rig": rig.name, "frictions": list(frictions)},
    )
    if most_frequency is not None:
        found.attrs["most_frequency"] = most_frequency
    return found.merge(_listed(rows)).merge(_drawn(np.hstack(curve)))


def _receptances(
    model: Model, bores: Sequence[int], spin: float
) -> list[tuple[Receptance, Receptance, Receptance]]:
    """Of each bore at a spin (rad/s): receptances of rim and hole, and path of the rim along the wall by twist."""
    rotor = replace(model.rotor, damping=model.rotor.damping + spin * model.rotor.gyroscopic)
    stators = [model.stators[i] for i in bores]
    rims = turning_receptances(rotor, [tuple(rotor.index(s.node, d) for d in ("v", "w")) for s in stators])
    found = []
    for stator, rim in zip(stators, rims, strict=True):
        (hole,) = turning_receptances(stator.body, [(stator.axial, stator.lateral)])
        twist = twist_receptance(rotor, rotor.index(stator.node, "thx")).scaled(stator.radius**2)
        wall = twist_receptance(stator.body, stator.torsion).scaled(stator.radius**2)
        found.append((rim, hole, twist + wall))
    return found


def _offset(model: Model, stator: StatorModel) -> float:
    """Distance of the shaft at rest from the centre of a bore, m."""
    at = sag_at(model.rotor, model.sag, stator.node)
    return math.hypot(at[0] - stator.centre[0], at[1] - stator.centre[1])


def _listed(rows: Sequence[tuple[int, float, float, float, Whirl, float]]) -> xr.Dataset:
    """Whirls as columns over `whirl`."""
    values = {
        "speed": [row[1] for row in rows],
        "clearance": [row[2] for row in rows],
        "friction": [row[3] for row in rows],
        "frequency": [row[4].frequency for row in rows],
        "orbit": [row[4].orbit for row in rows],
        "hole_orbit": [row[4].hole_orbit for row in rows],
        "normal_force": [row[4].normal_force for row in rows],
        "growth_rate": [row[5] for row in rows],
    }
    columns = {
        f"whirl_{name}": ("whirl", np.array(values[name], dtype=float), _unit(*_COLUMNS[name])) for name in values
    }
    return xr.Dataset(
        columns
        | {
            "whirl_stator": ("whirl", np.array([row[0] for row in rows], dtype=int)),
            "whirl_kind": ("whirl", np.array([row[4].kind for row in rows], dtype="U8")),
            "is_stable": ("whirl", np.array([row[5] < 0.0 for row in rows], dtype=bool)),
        }
    )


def _drawn(curve: Floats) -> xr.Dataset:
    return xr.Dataset(
        {
            "curve_stator": ("point", curve[0].astype(int)),
            "curve_frequency": ("point", curve[1], _unit("rad s-1", "Whirl frequency")),
            "curve_friction": ("point", curve[2], _unit("1", "Friction that a slipping whirl needs")),
        }
    )


def _unit(units: str, name: str) -> dict[str, str]:
    return {"units": units, "long_name": name}
