"""Matrices of a ROSS rotor (ross-rotordynamics) in the axes of this package.

In ROSS z runs along the shaft, y is up, and a node n, counted from 0, has the degrees x, y, z, alpha, beta,
theta: displacements, and rotations about x, y, z. Here x runs along the shaft, so that ROSS's (z, y, -x) are
(x, y, z), still right-handed: up stays up, and positive spin turns up towards -x of ROSS.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.errors import InputError
from rubhpc.rig.bearing_table import BearingTable
from rubhpc.rig.parts import FIXED_AT_NODE_1, Torsion
from rubhpc.rig.rotors import DIVERGED_SHARE, MatrixRotor

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.rig.forces import Unbalance

# For each degree of a node here: its name, the one of ROSS, and its sign.
_DEGREES = (("u", 2, 1), ("v", 1, 1), ("w", 0, -1), ("thx", 5, 1), ("thy", 4, 1), ("thz", 3, -1))
_COEFFICIENTS = [f"{letter}{pair}" for letter in "kcm" for pair in ("xx", "xy", "yx", "yy", "zz")]
_NO_FORCE = 1e-9  # of the greatest stiffness: axial force of an unconstrained shaft moved by 1 m


def rotor_from_ross(
    rotor: Any,
    *,
    speed: float | None = None,
    torsion: Torsion = FIXED_AT_NODE_1,
    unbalance: Sequence[Unbalance] = (),
) -> MatrixRotor:
    """Return the matrices of a `ross.Rotor`, node n of ROSS being node n + 1.

    Parameters
    ----------
    rotor : ross.Rotor
        With six degrees of freedom per node (ROSS 1.5 and later).
    speed : float, optional
        Speed at which speed-dependent bearings are evaluated, rad/s; by default they keep their tables.
    torsion : Torsion
        Torsional boundary condition, which a ROSS rotor lacks.
    unbalance : sequence of Unbalance

    Raises
    ------
    InputError
        When it is not such a rotor, or a bearing depends on something that its table cannot hold.
    """
    if not all(callable(getattr(rotor, name, None)) for name in "MCKG"):
        raise InputError(f"from_ross: {type(rotor).__name__} is not a ross.Rotor; pass one")
    if getattr(rotor, "number_dof", None) != len(_DEGREES):
        n_degree = getattr(rotor, "number_dof", "an unknown number of")
        raise InputError(
            f"from_ross: the rotor has {n_degree} degrees per node, not 6; use ROSS 1.5 or later"
        )
    varying = [b for b in getattr(rotor, "bearing_elements", ()) if speed is None and _varying(b)]
    tables = tuple(_table(bearing) for bearing in varying)
    at = speed if speed is not None else max((table.speed[0] for table in tables), default=0.0)
    given = {"mass": rotor.M(at), "damping": np.array(rotor.C(at)), "stiffness": np.array(rotor.K(at))}
    for bearing in varying:
        rows = slice(6 * bearing.n, 6 * bearing.n + 2)
        given["stiffness"][rows, rows] -= np.asarray(bearing.K(at))[:2, :2]
        given["damping"][rows, rows] -= np.asarray(bearing.C(at))[:2, :2]
    given["gyroscopic"] = rotor.G()
    n_node = len(given["mass"]) // len(_DEGREES)
    order = [6 * node + theirs for node in range(n_node) for _, theirs, _ in _DEGREES]
    sign = np.array([s for _ in range(n_node) for *_, s in _DEGREES], dtype=np.float64)
    degrees = [(node, name) for node in range(1, n_node + 1) for name, *_ in _DEGREES]
    matrices = {
        key: np.asarray(value, dtype=np.float64)[np.ix_(order, order)] * np.outer(sign, sign)
        for key, value in given.items()
    }
    constrained = set()
    if _is_axially_unconstrained(matrices["stiffness"], degrees):
        constrained.add((1, "u"))
    if torsion.fixed_node is not None:
        constrained.add((torsion.fixed_node, "thx"))
    elif (torsion.node, "thx") in degrees:
        row = degrees.index((torsion.node, "thx"))
        matrices["stiffness"][row, row] += torsion.stiffness or 0.0
        matrices["damping"][row, row] += torsion.damping
    if (torsion.fixed_node or torsion.node) > n_node:
        raise InputError(f"from_ross: torsion: the nodes run from 1 to {n_node}; choose one of them")
    kept_rows = [row for row, degree in enumerate(degrees) if degree not in constrained]
    reduced: Any = {key: value[np.ix_(kept_rows, kept_rows)] for key, value in matrices.items()}
    return MatrixRotor(
        **reduced,
        degrees=tuple(degrees[row] for row in kept_rows),
        bearing=tables,
        unbalance=tuple(unbalance),
        displacement_limit=DIVERGED_SHARE * float(rotor.L),
    )


def _is_axially_unconstrained(stiffness: NDArray[np.float64], degrees: list[tuple[int, str]]) -> bool:
    """Whether the shaft can move freely along its axis."""
    along = np.array([name == "u" for _, name in degrees], dtype=np.float64)
    return bool(np.abs(stiffness @ along).max() < _NO_FORCE * np.abs(stiffness).max())


def _varying(bearing: Any) -> list[str]:
    """Names of the coefficients of a bearing that are not constant."""
    tables = {name: np.asarray(getattr(bearing, name, 0.0), dtype=np.float64) for name in _COEFFICIENTS}
    return [name for name, values in tables.items() if np.ptp(values) > 0.0]


def _table(bearing: Any) -> BearingTable:
    """Table over the speed of a ROSS bearing, whose (y, -x) are (v, w).

    ROSS 3 distinguishes rotor speed and whirl frequency. ROSS 2 has one axis, `frequency`, for both.
    """
    has_speed = hasattr(bearing, "speed")
    axis = bearing.speed if has_speed else getattr(bearing, "frequency", None)
    named = f"from_ross: the bearing at ROSS node {bearing.n}"
    fix = "pass the speed (rad/s) at which to evaluate all bearings"
    if axis is None or (has_speed and getattr(bearing, "frequency", None) is not None):
        raise InputError(f"{named} depends on the whirl frequency; {fix}")
    if getattr(bearing, "n_link", None) is not None:
        raise InputError(f"{named} connects two nodes and depends on the speed; {fix}")
    for name in _varying(bearing):
        if name.startswith("m") or name.endswith("zz"):
            raise InputError(f"{named}: {name} depends on the speed; {fix}, or make it constant")
    columns = {}
    for letter in "kc":
        for pair, theirs, sign in (("yy", "yy", 1), ("yz", "yx", -1), ("zy", "xy", -1), ("zz", "xx", 1)):
            values = np.atleast_1d(np.asarray(getattr(bearing, f"{letter}{theirs}", 0.0), dtype=np.float64))
            columns[f"{letter}{pair}"] = tuple((sign * values + 0.0).tolist())
    is_linear = getattr(bearing, "interpolation", "pchip") == "linear"
    return BearingTable(
        node=int(bearing.n) + 1,
        speed=tuple(np.asarray(axis, dtype=np.float64).tolist()),
        interpolation="linear" if is_linear else "cubic",
        **columns,
    )
