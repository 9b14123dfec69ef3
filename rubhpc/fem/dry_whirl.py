"""Dry whirl that can exist in the bores of a rig, over speed, clearance and friction, in one dataset."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from rubhpc.errors import InputError
from rubhpc.fem.assemble import assemble, model_at
from rubhpc.fem.linear_design import checked_range
from rubhpc.fem.modes import KINDS, undamped_modes
from rubhpc.fem.receptance import turning_receptances, twist_receptance
from rubhpc.fem.whirl_balance import ROLLING, SLIPPING, Balance
from rubhpc.rig.normal_law import NormalLaw
from rubhpc.schema import described
from rubhpc.threads import on_one_thread

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import Any

    from numpy.typing import ArrayLike, NDArray

    from rubhpc.fem.model import Model, StatorModel
    from rubhpc.fem.receptance import Receptance
    from rubhpc.fem.whirl_balance import Whirl
    from rubhpc.rig.rig import Rig

    Floats = NDArray[np.float64]
    Row = dict[str, Any]

N_SPEED = 13  # speeds by default
N_MODE = 6  # pairs of lateral modes up to which whirl frequencies are searched by default
HARD = NormalLaw()
NAMES = {SLIPPING: "whip", ROLLING: "rolling whirl"}
MOST_SPEEDS, MOST_SETTINGS = 13, 3  # of a study with more, those that are shown
_OFFSET = 1e-6  # of the clearance: distance of the shaft from the centre of a bore that counts
_COLUMNS = {  # of a whirl: unit and name
    "speed": ("rad s-1", "Spin speed"),
    "clearance": ("m", "Radial clearance"),
    "friction": ("1", "Coefficient of friction"),
    "frequency": ("rad s-1", "Whirl frequency"),
    "orbit": ("m", "Radius of the orbit of the rim's centre"),
    "hole_orbit": ("m", "Radius of the orbit of the hole's centre"),
    "normal_force": ("N", "Normal force"),
    "friction_force": ("N", "Friction force"),
    "rim_speed": ("m s-1", "Speed of the rim"),
}


@on_one_thread
def dry_whirl(
    rig: Rig,
    speeds: Sequence[float] | Floats | None = None,
    clearances: Sequence[float] | Floats = (),
    frictions: Sequence[float] | Floats = (),
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
    clearances : (n_clearance,)
        Radial clearances of the case, m.
    frictions : (n_friction,), optional
        Coefficients of friction of the case for which whirls are listed.
    law : NormalLaw
        Contact law of the bores that have none of their own.
    most_frequency : float, optional
        Highest whirl frequency searched, rad/s; by default the natural frequency at standstill of the seventh
        pair of lateral modes of the rotor, and no limit where it has fewer. `math.inf` is no limit.

    Returns
    -------
    xarray.Dataset
        Over (stator, speed, clearance), with the coordinate `node`: `least_friction` of the case, below which
        no whirl exists, infinite where none exists at all; and `is_approximate`, where rotor or hole are
        anisotropic or the shaft does not rest in the centre of the bore.

        Over threshold: the whirl of least friction in each range of frequencies in which one can exist. Over
        whirl: all whirls at each of the frictions. Both have columns `threshold_` and `whirl_`: `stator`,
        `speed` (rad/s), `clearance` (m), `friction` (of the case), `frequency` (rad/s, positive forward, in
        the sense of the spin), `kind` ("slipping" or "rolling"), `orbit` and `hole_orbit` (m, radii of the
        orbits of both centres), `normal_force` and `friction_force` (N, positive against the spin),
        `rim_speed` (m/s); and of whirl `whirl_growth_rate` (1/s), negative where it is stable.

        Over point, at the highest speed and the first clearance: `curve_stator`, `curve_frequency` (rad/s)
        and `curve_friction` that a slipping whirl of this frequency needs.

        Attributes: `rig`, its name; `frictions`; `most_frequency` (rad/s).

    Raises
    ------
    InputError
        When the rig has no bore, a clearance is not positive, or a bearing has no coefficients at a speed.
    """
    model = assemble(rig)
    bores = [i for i, stator in enumerate(model.stators) if stator.is_bore]
    if not bores:
        raise InputError(f'rig {rig.name}: has no bore; add a [[stator]] with kind = "bore"')
    spins = np.linspace(*checked_range(model, None), N_SPEED) if speeds is None else np.asarray(speeds, float)
    gaps = np.asarray(clearances, dtype=float)
    if not gaps.size:
        raise InputError("clearance: missing; give at least one")
    top = _highest(model) if most_frequency is None else most_frequency
    shape = (len(bores), spins.size, gaps.size)
    least, is_approximate = np.full(shape, math.inf), np.zeros(shape, dtype=bool)
    thresholds: list[Row] = []
    whirls: list[Row] = []
    curve = []
    for j, spin in enumerate(spins.tolist()):
        turning = model_at(model, spin)
        for i, parts in enumerate(_receptances(turning, bores, spin)):
            stator = model.stators[bores[i]]
            factor = stator.friction_factor or math.nan  # of a bore without friction nothing is left
            for k, gap in enumerate(gaps.tolist()):
                radial = gap + stator.clearance_offset
                if not 0.0 < radial < math.inf:
                    problem = f"stator {bores[i] + 1} has a radial clearance of {radial:g} m"
                    raise InputError(f"clearance: {problem}; give one above 0")
                balance = Balance(
                    *parts,
                    spin=spin,
                    radius=stator.radius,
                    clearance=radial,
                    law=stator.law or law,
                    most_frequency=top,
                )
                is_approximate[i, j, k] = (
                    parts[0].is_mean or parts[1].is_mean or _offset(turning, stator) > _OFFSET * radial
                )
                of = {"stator": bores[i] + 1, "speed": spin, "clearance": gap}
                of["rim_speed"] = abs(spin) * stator.radius
                for whirl in balance.thresholds():
                    thresholds.append(of | _row(whirl, spin) | {"friction": whirl.friction / factor})
                    least[i, j, k] = np.fmin(least[i, j, k], whirl.friction / factor)
                for mu in frictions:
                    whirls += [
                        of | _row(whirl, spin) | {"friction": mu, "growth_rate": balance.growth_rate(whirl)}
                        for whirl in balance.whirls(mu * stator.friction_factor)
                    ]
                if k == 0 and j == int(np.abs(spins).argmax()):
                    w, needed = balance.curve()
                    curve.append([np.full(w.size, bores[i] + 1.0), _sense(spin) * w, needed / factor])
    along = ("stator", "speed", "clearance")
    found = xr.Dataset(
        {
            "least_friction": (along, least, described("1", "Least friction of a dry whirl")),
            "is_approximate": (along, is_approximate),
        },
        coords={
            "stator": np.array(bores) + 1,
            "node": ("stator", [model.stators[i].node for i in bores], {"long_name": "Node"}),
            "speed": ("speed", spins, described("rad s-1", "Spin speed")),
            "clearance": ("clearance", gaps, described("m", "Radial clearance")),
        },
        attrs={"rig": rig.name, "frictions": [float(mu) for mu in frictions], "most_frequency": top},
    )
    _add_columns(found, "threshold", thresholds)
    _add_columns(found, "whirl", whirls)
    rates = [row["growth_rate"] for row in whirls]
    found["whirl_growth_rate"] = "whirl", rates, described("s-1", "Growth rate")
    number, w, needed = np.concatenate(curve, axis=1)
    found["curve_stator"] = "point", number.astype(int)
    found["curve_frequency"] = "point", w, described("rad s-1", "Whirl frequency")
    found["curve_friction"] = "point", needed, described("1", "Friction that a slipping whirl needs")
    return found


def in_words(found: xr.Dataset) -> list[str]:
    """Return sentences for each bore: where dry whirl begins, and which exists at the frictions given."""
    speeds, limit = found["speed"].values, found.attrs["most_frequency"]
    if speeds.size == 1:
        span = f"at {_rpm(speeds[0])}" + (f" up to {_hertz(limit)}" if math.isfinite(limit) else "")
    else:
        span = f"up to {_rpm(speeds[np.abs(speeds).argmax()])}"
        span += f" and {_hertz(limit)}" if math.isfinite(limit) else ""
    return [_sentences(found, i, span) for i in range(found.sizes["stator"])]


def _sentences(found: xr.Dataset, i: int, span: str) -> str:
    bore = int(found["stator"][i])
    at = found.isel(threshold=found["threshold_stator"].values == bore)
    text = f"Stator {bore}, node {int(found['node'][i])}: no dry whirl"
    needed = at["threshold_friction"].values
    if not np.isfinite(needed).any():
        text += f" {span}, whatever the friction"
    else:
        k = int(np.nanargmin(needed))
        text += f" below a friction of {needed[k]:.3g} {span}; above it {_named(at, k)}"
        size = np.abs(at["threshold_frequency"].values)
        slow = np.flatnonzero(size < 1.1 * size.min())  # the range of the lowest frequency, at all speeds
        first = int(slow[np.nanargmin(needed[slow])])
        if size[first] < 0.9 * size[k]:
            text += f", and above {needed[first]:.3g} {_named(at, first)}"
        for mu in found.attrs["frictions"]:
            is_at = (found["whirl_stator"] == bore) & (found["whirl_friction"] == mu)
            some = found.isel(whirl=np.flatnonzero(is_at))
            text += f". At {mu:g}: {_listed(some)}"
            if "knock" in found.dims and some.sizes["whirl"]:
                text += f"; {_certified(some, bore, mu)}"
    return text + (" (approximate)." if bool(found["is_approximate"][i].any()) else ".")


def _named(found: xr.Dataset, k: int) -> str:
    """The whirl at a threshold."""
    frequency = float(found["threshold_frequency"][k])
    word = NAMES[found["threshold_kind"].values[k]]
    last = ", the highest searched" * math.isclose(abs(frequency), found.attrs["most_frequency"])
    return f"{'forward ' * (frequency > 0.0)}{word} at {_hertz(abs(frequency))}{last}"


def _listed(found: xr.Dataset) -> str:
    """Whirls at one bore and friction: frequencies and speeds of each kind, the stable ones first."""
    parts = []
    is_stable = found["whirl_growth_rate"].values < 0.0
    for state, is_so in (("stable", is_stable), ("unstable", ~is_stable)):
        for kind, word in NAMES.items():
            some = found.isel(whirl=np.flatnonzero(is_so & (found["whirl_kind"].values == kind)))
            if some.sizes["whirl"]:
                hertz, rpm = (_span(some[f"whirl_{of}"].values, write) for of, write in _SPANS.items())
                parts.append(f"{state} {word} at {hertz}" + f", {rpm}" * (found.sizes["speed"] > 1))
    return "; ".join(parts) or "none"


def _certified(found: xr.Dataset, bore: int, friction: float) -> str:
    """What simulations say of the whirls of one bore and friction."""
    n_sure, n_all = int(found["whirl_is_confirmed"].sum()), found.sizes["whirl"]
    at = (found["knock_stator"].values == bore) & (found["knock_friction"].values == friction)
    impulse = np.where(at, found["knock_impulse"].values, np.nan)
    text = f"simulations confirm {n_sure} of {n_all}"
    if np.isnan(impulse).all():
        return f"{text}, and no knock up to {found['knock_harmless'].values[at].max():.3g} N s reaches whirl"
    k = int(np.nanargmin(impulse))
    knock = f"a knock of {impulse[k]:.3g} N s" if impulse[k] else "without a knock the machine"
    return f"{text}, and {knock} reaches whirl at {_rpm(found['knock_speed'].values[k])}"


def _span(values: Floats, write: Callable[[float], str]) -> str:
    """From the smallest to the largest of some values."""
    size = np.abs(values)
    (low, unit), (high, _) = (write(end).split() for end in (size.min(), size.max()))
    return f"{high} {unit}" if low == high else f"{low} to {high} {unit}"


def _rpm(speed: float) -> str:
    return f"{float(f'{speed * 30.0 / math.pi:.4g}'):g} rpm"


def _hertz(frequency: float) -> str:
    return f"{float(f'{frequency / (2.0 * math.pi):.3g}'):g} Hz"


_SPANS = {"frequency": _hertz, "speed": _rpm}  # how each is written


def thinned(values: ArrayLike, most: int) -> Floats:
    """Return the different numbers among values, at most some evenly spread ones, rising."""
    single = np.unique(np.asarray(values, dtype=float))
    single = single[np.isfinite(single)]
    at = np.unique(np.linspace(0, single.size - 1, min(most, single.size)).round())
    return np.array(single[at.astype(int)])


def _highest(model: Model) -> float:
    """Natural frequency of the first lateral mode beyond those that count by default, rad/s; or inf."""
    rotor = replace(model.rotor.at(0.0), by_speed=None)
    rows = rotor.rows(KINDS["lateral"])
    block = np.ix_(rows, rows)
    square = undamped_modes(rotor.mass[block], (rotor.stiffness + rotor.stiffness.T)[block] / 2)[0]
    return math.sqrt(abs(square[2 * N_MODE])) if len(square) > 2 * N_MODE else math.inf


def _receptances(
    model: Model, bores: Sequence[int], spin: float
) -> list[tuple[Receptance, Receptance, Receptance]]:
    """Of each bore at a spin (rad/s): receptances of rim, hole, and path along the wall by twist."""
    rotor = replace(model.rotor, damping=model.rotor.damping + spin * model.rotor.gyroscopic)
    stators = [model.stators[i] for i in bores]
    rims = turning_receptances(rotor, [(rotor.index(s.node, "v"), rotor.index(s.node, "w")) for s in stators])
    found = []
    for stator, rim in zip(stators, rims, strict=True):
        (hole,) = turning_receptances(stator.body, [(stator.axial, stator.lateral)])
        # The wall is at the radius of the rim and the clearance, which is left out here.
        twist = twist_receptance(rotor, rotor.index(stator.node, "thx"))
        wall = twist_receptance(stator.body, stator.torsion)
        found.append((rim, hole, (twist + wall).scaled(stator.radius**2)))
    return found


def _offset(model: Model, stator: StatorModel) -> float:
    """Distance of the shaft at rest from the centre of a bore, m."""
    at = model.rotor.at_node(stator.node, model.sag)
    return math.hypot(at[0] - stator.centre[0], at[1] - stator.centre[1])


def _row(whirl: Whirl, spin: float) -> Row:
    """A whirl in the sense of the spin."""
    turned = {name: _sense(spin) * getattr(whirl, name) for name in ("frequency", "friction_force")}
    return asdict(whirl) | turned


def _sense(spin: float) -> float:
    return -1.0 if spin < 0.0 else 1.0


def _add_columns(found: xr.Dataset, dim: str, rows: Sequence[Row]) -> None:
    """Add whirls to a dataset, as columns along a dimension."""
    found[f"{dim}_stator"] = dim, np.array([row["stator"] for row in rows], dtype=int)
    found[f"{dim}_kind"] = dim, np.array([row["kind"] for row in rows], dtype="U8")
    for name, units in _COLUMNS.items():
        found[f"{dim}_{name}"] = dim, np.array([row[name] for row in rows], dtype=float), described(*units)
