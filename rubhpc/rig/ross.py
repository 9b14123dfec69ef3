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

    from rubhpc.rig.rotors import Unbalance

# For each degree of a node here: its name, the one of ROSS, and its sign.
_DEGREES = (("u", 2, 1), ("v", 1, 1), ("w", 0, -1), ("thx", 5, 1), ("thy", 4, 1), ("thz", 3, -1))
_COEFFICIENTS = [f"{letter}{pair}" for letter in "kcm" for pair in ("xx", "xy", "yx", "yy", "zz")]
_OF_WHIRL = ("MagneticBearingElement", "SqueezeFilmDamper")  # whose axis ROSS 2 calls as that of the speed
_NO_FORCE = 1e-9  # of the greatest stiffness: force of what is free and moves by 1 m or 1 rad


def rotor_from_ross(
    rotor: Any,
    *,
    speed: float | None = None,
    torsion: Torsion = FIXED_AT_NODE_1,
    unbalance: Sequence[Unbalance] = (),
) -> MatrixRotor:
    """Return the matrices of a `ross.Rotor`, node n of ROSS being node n + 1, of the shaft or a pedestal.

    Parameters
    ----------
    rotor : ross.Rotor
        With six degrees of freedom per node (ROSS 1.5 and later).
    speed : float, optional
        Speed at which speed-dependent bearings are evaluated, rad/s; by default they keep their tables.
    torsion : Torsion
        Torsional boundary condition, which a ROSS rotor lacks.
    unbalance : sequence of Unbalance
    """
    if not all(callable(getattr(rotor, name, None)) for name in "MCKG"):
        raise InputError(f"from_ross: {type(rotor).__name__} is not a ross.Rotor; pass one")
    if getattr(rotor, "number_dof", None) != len(_DEGREES):
        n_degree = getattr(rotor, "number_dof", "an unknown number of")
        raise InputError(
            f"from_ross: the rotor has {n_degree} degrees per node, not 6; use ROSS 1.5 or later"
        )
    if any(kind.__name__ == "MultiRotor" for kind in type(rotor).__mro__):
        problem = "the shafts of a MultiRotor turn at different speeds, and a rig has one speed"
        raise InputError(f'from_ross: {problem}; pass one of its rotors, such as .rotors["driving"]')
    varying = [b for b in rotor.bearing_elements if speed is None and _varying(b)]
    tables = tuple(_table(bearing) for bearing in varying)
    at = speed if speed is not None else max((table.speed[0] for table in tables), default=0.0)
    n_shaft = len(rotor.nodes)
    given = {"mass": rotor.M(at), "damping": np.array(rotor.C(at)), "stiffness": np.array(rotor.K(at))}
    for bearing in varying:
        nodes = [bearing.n] if bearing.n_link is None else [bearing.n, bearing.n_link]
        rows = [_first_row(node, n_shaft) + i for node in nodes for i in (0, 1)]
        own = [3 * i_node + i for i_node in range(len(nodes)) for i in (0, 1)]
        given["stiffness"][np.ix_(rows, rows)] -= np.asarray(bearing.K(at))[np.ix_(own, own)]
        given["damping"][np.ix_(rows, rows)] -= np.asarray(bearing.C(at))[np.ix_(own, own)]
    given["gyroscopic"] = rotor.G()
    kept = [
        (_first_row(node, n_shaft) + theirs, (node + 1, name), sign)
        for node in range(n_shaft + (len(given["mass"]) - 6 * n_shaft) // 3)
        for name, theirs, sign in _DEGREES
        if node < n_shaft or theirs < 3  # a pedestal does not turn
    ]
    # ROSS counts rows of a pedestal for each point mass, also for one on the shaft: they are empty.
    kept = [one for one in kept if any(np.any(given[key][one[0]]) for key in ("mass", "stiffness"))]
    order, degrees, signs = zip(*kept, strict=True)
    matrices = {
        key: np.asarray(value, dtype=np.float64)[np.ix_(order, order)] * np.outer(signs, signs)
        for key, value in given.items()
    }
    drive = torsion.fixed_node or torsion.node
    if drive > n_shaft:
        raise InputError(f"from_ross: torsion: the nodes run from 1 to {n_shaft}; choose one of them")
    if torsion.fixed_node is None:
        row = degrees.index((drive, "thx"))
        matrices["stiffness"][row, row] += torsion.stiffness or 0.0
        matrices["damping"][row, row] += torsion.damping
    constrained = _free_parts(matrices["stiffness"], degrees, "u")
    if not torsion.free:
        constrained |= _free_parts(matrices["stiffness"], degrees, "thx", torsion.fixed_node)
    kept_rows = [row for row, degree in enumerate(degrees) if degree not in constrained]
    reduced: Any = {key: value[np.ix_(kept_rows, kept_rows)] for key, value in matrices.items()}
    return MatrixRotor(
        **reduced,
        degrees=tuple(degrees[row] for row in kept_rows),
        bearing=tables,
        unbalance=tuple(unbalance),
        displacement_limit=DIVERGED_SHARE * float(rotor.L),
    )


def _first_row(node: int, n_shaft: int) -> int:
    """First row of a node of ROSS: those of the shaft have six, those of pedestals, which follow, three."""
    return 6 * node if node < n_shaft else 6 * n_shaft + 3 * (node - n_shaft)


def _free_parts(
    stiffness: NDArray[np.float64], degrees: Sequence[tuple[int, str]], name: str, fixed: int | None = None
) -> set[tuple[int, str]]:
    """Degrees to be held so that no shaft or pedestal moves freely along ("u") or about ("thx") its axis.

    The first one of each part that moves freely as a whole, and `fixed`, if given, in its part.
    """
    from scipy.sparse.csgraph import connected_components

    rows = [row for row, degree in enumerate(degrees) if degree[1] == name]
    n_part, part = connected_components(stiffness[np.ix_(rows, rows)] != 0.0, directed=False)
    held = {(fixed, name)} if fixed is not None else set()
    for number in range(n_part):
        of_part = [row for row, its_part in zip(rows, part, strict=True) if its_part == number]
        is_free = np.abs(stiffness[:, of_part].sum(axis=1)).max() < _NO_FORCE * np.abs(stiffness).max()
        if is_free and not held & {degrees[row] for row in of_part}:
            held.add(degrees[of_part[0]])
    return held


def _varying(bearing: Any) -> list[str]:
    """Names of the coefficients of a bearing that are not constant."""
    tables = {name: np.asarray(getattr(bearing, name, 0.0), dtype=np.float64) for name in _COEFFICIENTS}
    return [name for name, values in tables.items() if np.ptp(values) > 0.0]


def _table(bearing: Any) -> BearingTable:
    """Table over the speed of a ROSS bearing, whose (y, -x) are (v, w).

    ROSS 3 distinguishes rotor speed and whirl frequency. ROSS 2 has one axis, `frequency`, for both.
    """
    is_ross_3 = hasattr(bearing, "interpolation")  # bearings of ROSS 2 may have a `speed` for other ends
    axis = bearing.speed if is_ross_3 else bearing.frequency
    named = f"from_ross: the bearing at ROSS node {bearing.n}"
    fix = "pass the speed (rad/s) at which to evaluate all bearings"
    of_whirl = is_ross_3 and bearing.frequency is not None
    if axis is None or of_whirl or type(bearing).__name__ in _OF_WHIRL:
        raise InputError(f"{named} depends on the whirl frequency; {fix}")
    for name in _varying(bearing):
        if name.startswith("m") or name.endswith("zz"):
            raise InputError(f"{named}: {name} depends on the speed; {fix}, or make it constant")
    columns: Any = {}
    for letter in "kc":
        for pair, theirs, sign in (("yy", "yy", 1), ("yz", "yx", -1), ("zy", "xy", -1), ("zz", "xx", 1)):
            values = np.atleast_1d(np.asarray(getattr(bearing, f"{letter}{theirs}", 0.0), dtype=np.float64))
            columns[f"{letter}{pair}"] = tuple((sign * values + 0.0).tolist())
    is_linear = getattr(bearing, "interpolation", "pchip") == "linear"
    return BearingTable(
        node=int(bearing.n) + 1,
        link=None if bearing.n_link is None else int(bearing.n_link) + 1,
        speed=tuple(np.asarray(axis, dtype=np.float64).tolist()),
        interpolation="linear" if is_linear else "cubic",
        **columns,
    )
