"""Linear response without contact: to unbalance; reference frequency; stability limit of the step."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import eigvals, eigvalsh

from rubhpc.errors import InputError
from rubhpc.fem.modes import KINDS, modes, undamped_modes
from rubhpc.fem.statics import sag_at_stators

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import NDArray

    from rubhpc.fem.model import Body, Model

PHASES = 3600  # of a revolution, at which an orbit in a bore is looked at: 4e-7 of its amplitude
_STIFFER = 1.001  # of the frequency of rigid-body modes on a softness, above which a mode is another one


def steady_response(model: Model, spin: float) -> NDArray[np.complex128]:
    """Return the steady response of the rotor to its unbalance, without contact.

    Parameters
    ----------
    model : Model
    spin : float
        rad/s.

    Returns
    -------
    (n_dof,) complex
        c of `u(t) = Re(c exp(i spin t))`, m and rad.

    Raises
    ------
    InputError
        If the spin is a natural frequency of an undamped rotor, whose response is unbounded, or if it is
        outside the table of a bearing.
    """
    rotor = model.rotor.at(spin)
    lateral = rotor.rows(KINDS["lateral"])
    block = np.ix_(lateral, lateral)
    response = np.zeros(rotor.n_dof, dtype=np.complex128)
    if spin == 0.0:
        return response
    force = spin**2 * (model.unbalance_cosine - 1j * model.unbalance_sine)[lateral]
    response[lateral] = _solved(rotor.dynamic_stiffness(spin, spin)[block], force, f"speed {spin:.6g} rad/s")
    return response


def harmonic_response(
    model: Model, spin: float, order: float, force: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """Return the steady response of the rotor to a force at a multiple of the spin, without contact.

    Parameters
    ----------
    model : Model
    spin : float
        rad/s.
    order : float
        The force is `Re(force exp(i order spin t))`.
    force : (n_dof,) complex
        N and N m.

    Returns
    -------
    (n_dof,) complex
        c of `u(t) = Re(c exp(i order spin t))`, m and rad.

    Raises
    ------
    InputError
        If that is a natural frequency of an undamped rotor.
    """
    dynamic = model.rotor.at(spin).dynamic_stiffness(order * spin, spin)
    return _solved(dynamic, force, f"order {order:g} of speed {spin:.6g} rad/s")


def _solved(dynamic: NDArray[np.complex128], force: NDArray[Any], where: str) -> NDArray[np.complex128]:
    try:
        return np.asarray(np.linalg.solve(dynamic, force))
    except np.linalg.LinAlgError:
        raise InputError(f"{where}: the undamped rotor resonates without bound; give it damping") from None


def steady_lines(model: Model, spin: float) -> dict[int, NDArray[np.complex128]]:
    """Return the steady responses of the rotor (n_dof,) by order: to the unbalance, 1, and to harmonics."""
    lines = {1: steady_response(model, spin)}
    for order, force in model.harmonics:
        lines[order] = lines.get(order, 0.0) + harmonic_response(model, spin, order, force)
    return lines


def _orbit(model: Model, spin: float, node: int) -> NDArray[np.float64]:
    """Steady v and w of a node over a turn of the shaft, (2, n_phase), m."""
    turn, found = np.exp(2j * np.pi * np.arange(PHASES) / PHASES), np.zeros((2, PHASES))
    for order, line in steady_lines(model, spin).items():
        for moved, amplitude in zip(found, model.rotor.at_node(node, line), strict=True):
            moved += (amplitude * turn**order).real
    return found


def contact_free_amplitude(model: Model, spin: float, node: int | None = None) -> float:
    """Return the largest deflection `sqrt(v^2 + w^2)` of the steady contact-free orbit, m.

    The orbit is the sum of a forward circle of radius |F| and a backward circle of radius |B|: an ellipse
    with the major semi-axis |F| + |B|. Of harmonics the orbit is followed over a turn.

    Parameters
    ----------
    model : Model
    spin : float
        rad/s.
    node : int, optional
        Default: the model's output node.
    """
    node = model.output_node if node is None else node
    if model.harmonics:
        return float(np.hypot(*_orbit(model, spin, node)).max())
    response = steady_response(model, spin)
    v, w = model.rotor.at_node(node, response)
    return float(abs(v + 1j * w) + abs(v - 1j * w)) / 2


def contact_free_reach(model: Model, spin: float) -> float:
    """Return the clearance, m, below which the steady contact-free motion reaches a stator; -inf without any.

    A stator is reached by the amplitude towards it, `|v cos(angle) + w sin(angle)|`, and by the sag of the
    shaft; its `clearance_offset` is gap.

    Parameters
    ----------
    model : Model
        At the spin (`rubhpc.fem.assemble.model_at`), where bearings depend on the speed.
    spin : float
        rad/s.
    """
    response = steady_response(model, spin)
    nearer, aside = sag_at_stators(model)
    reach = -math.inf
    for stator, sag, off in zip(model.stators, nearer, aside, strict=True):
        if stator.is_bore or model.harmonics:
            v, w = _orbit(model, spin, stator.node)
            along = v * math.cos(stator.angle) + w * math.sin(stator.angle)
            away = np.abs(v + sag + 1j * (w - off)).max() if stator.is_bore else along.max() + sag
        else:
            v, w = model.rotor.at_node(stator.node, response)
            away = abs(v * math.cos(stator.angle) + w * math.sin(stator.angle)) + sag
        reach = max(reach, float(away) - stator.clearance_offset)
    return reach


def first_lateral_frequency(model: Model) -> float:
    """Return the lowest undamped lateral natural frequency of the rotor at standstill, rad/s.

    It is the speed at which `speed_ratio` is 1. Rigid-body modes do not count: their frequency is 0, or that
    of the softness of a rotor that nothing but bores holds (`statics.caught`).
    Speed-dependent bearings have their coefficients at standstill, or at the lowest speed of their table.
    """
    undamped = replace(model.rotor.at(0.0), damping=np.zeros_like(model.rotor.damping), by_speed=None)
    rows = undamped.rows(KINDS["lateral"])
    stiffness = undamped.stiffness[np.ix_(rows, rows)]
    is_alone = all(undamped.degrees[row][1] in KINDS["lateral"] for row in rows)
    if is_alone and np.array_equal(stiffness, stiffness.T):
        found = np.sqrt(undamped_modes(undamped.mass[np.ix_(rows, rows)], stiffness)[0])
    else:
        found = 2 * math.pi * np.array([m.frequency for m in modes(undamped) if m.kind == "lateral"])
    found = found[found > _STIFFER * math.sqrt(model.rotor.softness)]
    if not found.size:
        raise InputError("speed_ratio: the rotor has no lateral natural frequency; give the speed instead")
    return float(found.min())


def step_limit(model: Model) -> float:
    """Return the stability limit of the step of the central difference, 2 / omega_max over all bodies, s.

    omega_max^2 is the spectral radius of `M^-1 K`. Neither damping nor spin lowers the limit, because the
    scheme applies `D + spin G` to the central velocity `(u_{n+1} - u_{n-1}) / 2h`. The scalar product of a
    step with that velocity shows that the discrete energy `d^T (M - h^2/4 K) d / 2h^2 + m^T K m / 2`, with d
    the difference and m the mean of two successive displacements, decreases by the dissipation of D; G does
    no work. While `h < 2 / omega_max` the energy is a norm, and thus bounds the motion. (Damping evaluated
    half a step earlier would lower the limit.)

    For speed-dependent bearings it is the minimum over the speeds of their tables.
    """
    rotors = [model.rotor, *(model.rotor.at(speed) for speed in model.rotor.tabulated_speeds)]
    bodies = [*rotors, *(body for body in model.bodies[1:] if body.n_dof)]
    fastest = math.sqrt(max(_spectral_radius(body) for body in bodies))
    return 2.0 / fastest if fastest else math.inf


def _spectral_radius(body: Body) -> float:
    """Largest eigenvalue of `M^-1 K` in size, rad^2/s^2."""
    is_symmetric = np.array_equal(body.stiffness, body.stiffness.T)
    squares = (eigvalsh if is_symmetric else eigvals)(body.stiffness, body.mass)
    return float(np.abs(squares).max())


def response_nodes(model: Model) -> list[int]:
    """Nodes of the rotor that move sideways, rising."""
    return sorted({node for node, name in model.rotor.degrees if name in ("v", "w")})


def lateral_at_nodes(model: Model, values: NDArray[Any]) -> NDArray[Any]:
    """Return v and w of all `response_nodes`, (..., 2, n_node), from values (..., n_dof) of the rotor."""
    nodes = response_nodes(model)
    rows = np.array([[model.rotor.index(node, name) for node in nodes] for name in ("v", "w")])
    return np.where(rows >= 0, values[..., rows], 0.0)


def check_response_node(model: Model, node: int, where: str = "node") -> None:
    """Refuse a node of the rotor that does not move sideways."""
    nodes = response_nodes(model)
    if node not in nodes:
        problem = f"{node} does not move sideways; nodes {nodes[0]} to {nodes[-1]} do"
        raise InputError(f"{where}: {problem if len(nodes) > 1 else f'{node} is not there; give {nodes[0]}'}")
