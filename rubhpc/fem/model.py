"""What the finite element model hands on: linear bodies and the places where they touch."""

from __future__ import annotations

import math
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate, pairwise, product
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from rubhpc.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import Any

    from numpy.typing import NDArray

    from rubhpc.rig.bearing_table import BearingTable
    from rubhpc.rig.normal_law import NormalLaw
    from rubhpc.rig.probes import Probe


NOTHING = 1e-14  # of a matrix's greatest entry: a coupling that is rounding


@dataclass(frozen=True, kw_only=True, eq=False)
class Support:
    """A bearing or seal with coefficients that depend on the spin."""

    table: BearingTable
    node: int
    rows: tuple[int, int]  # of "v" and "w" of its node; -1 where there is none
    far: tuple[int, int]  # of what it stands on; -1 on the ground
    name: str  # for messages


@dataclass(frozen=True, kw_only=True, eq=False)
class SpeedDependence:
    """What a body is made of at any spin: constant matrices, and supports.

    Attributes
    ----------
    stiffness, damping : (n_dof, n_dof)
        Without the supports.
    proportional : float
        Rayleigh's beta, s: damping that the stiffness of a support brings with it.
    """

    stiffness: NDArray[np.float64]
    damping: NDArray[np.float64]
    proportional: float = 0.0
    supports: tuple[Support, ...]

    def matrices_at(self, spin: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return stiffness and damping matrix at a spin (rad/s), (n_dof, n_dof) each."""
        stiffness, damping = self.stiffness.copy(), self.damping.copy()
        for support in self.supports:
            k, c = support.table.at(spin, support.name)
            couple(stiffness, k, support.rows, support.far)
            couple(damping, c + self.proportional * k, support.rows, support.far)
        return stiffness, damping

    def journals_at(self, spin: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the motion of journals that are placed at a spin, rad/s, (n, n_dof), and where, (n,), m.

        A journal is placed relative to what its bearing stands on.
        """
        found: dict[int, float] = {}
        motions = []
        for support in self.supports:
            eccentricity = support.table.eccentricity(spin, support.name)
            for i, (row, far) in enumerate(zip(support.rows, support.far, strict=True)):
                if eccentricity is None or row < 0:
                    continue
                if row in found:
                    problem = f"another table at node {support.node} gives the position of the journal"
                    raise InputError(f"{support.name}: eccentricity_y: {problem}; remove one of them")
                found[row] = eccentricity[i]
                motion = np.zeros(len(self.stiffness))
                motion[row] = 1.0
                if far >= 0:
                    motion[far] = -1.0
                motions.append(motion)
        return np.reshape(motions, (-1, len(self.stiffness))), np.array(list(found.values()))


def couple(
    matrix: NDArray[np.float64], block: NDArray[np.float64], rows: Sequence[int], far: Sequence[int]
) -> None:
    """Add a block (2, 2) that acts on the motion of two rows relative to two others; -1: of the ground."""
    for here, its_sign in ((rows, 1.0), (far, -1.0)):
        for there, sign in ((rows, 1.0), (far, -1.0)):
            for (i, row), (j, column) in product(enumerate(here), enumerate(there)):
                if row >= 0 and column >= 0:
                    matrix[row, column] += its_sign * sign * block[i, j]


@dataclass(frozen=True, kw_only=True, eq=False)
class Body:
    """A linear body, `M u'' + (D + spin G) u' + K u = f`, reduced to its free degrees of freedom.

    Attributes
    ----------
    mass, damping, gyroscopic, stiffness : (n_dof, n_dof)
        M, D (bearings included), G (to be multiplied by the spin, rad/s) and K in SI units. Where bearings
        depend on the speed, D and K hold at one spin; `at` gives them at another.
    degrees : tuple of (node, name)
        Which degree each row is. Rotor: "u", "v", "w", "thx", "thy", "thz"; stator: "axial"
        (positive outward, compressed), "lateral" (positive with the rim under positive spin), "rotation".
        User-supplied matrices may have others.
    softness : float, 1/s2
        Of a rotor that nothing holds laterally but bores: K has that much of M, in place of zero.
    """

    mass: NDArray[np.float64]
    damping: NDArray[np.float64]
    gyroscopic: NDArray[np.float64]
    stiffness: NDArray[np.float64]
    degrees: tuple[tuple[int, str], ...]
    by_speed: SpeedDependence | None = None
    softness: float = 0.0

    def at(self, spin: float) -> Body:
        """Return the body at a spin, rad/s: itself, where nothing depends on the speed.

        Raises
        ------
        InputError
            When the spin is outside the table of a bearing.
        """
        if self.by_speed is None:
            return self
        stiffness, damping = self.by_speed.matrices_at(spin)
        return replace(self, stiffness=stiffness, damping=damping)

    @property
    def tabulated_speeds(self) -> list[float]:
        """Speeds of its bearings' tables within the range that they share, rad/s; none without tables."""
        supports = self.by_speed.supports if self.by_speed else ()
        if not supports:
            return []
        low, high = max(s.table.speed[0] for s in supports), min(s.table.speed[-1] for s in supports)
        if low > high:
            rpm = 30 / math.pi
            names = ", ".join(support.name for support in supports)
            problem = f"one table begins at {low * rpm:.6g} rpm, another ends at {high * rpm:.6g} rpm"
            raise InputError(f"{names}: no speed is common to them: {problem}; extend them")
        return sorted({speed for s in supports for speed in s.table.speed if low <= speed <= high})

    @property
    def n_dof(self) -> int:
        """Number of free degrees of freedom."""
        return len(self.degrees)

    @property
    def total_mass(self) -> float:
        """Of a rotor, kg: what moves with it when it is lifted."""
        upright = [row for row, (_, name) in enumerate(self.degrees) if name == "v"]
        return float(self.mass[np.ix_(upright, upright)].sum())

    @cached_property
    def part(self) -> NDArray[np.int64]:
        """Number of the part that each row belongs to, (n_dof,); no matrix couples one part to another."""
        couples = np.zeros((self.n_dof, self.n_dof), dtype=bool)
        for matrix in (self.mass, self.damping, self.gyroscopic, self.stiffness):
            size = np.abs(matrix)
            couples |= size > NOTHING * size.max(initial=0.0)
        part: NDArray[np.int64] = connected_components(csr_array(couples), directed=False)[1]
        return part

    def rows(self, names: Sequence[str]) -> list[int]:
        """Rows of the degrees with these names, and of all that is coupled to them."""
        part = self.part.tolist()
        wanted = {part[row] for row, (_, name) in enumerate(self.degrees) if name in names}
        return [row for row, number in enumerate(part) if number in wanted]

    def dynamic_stiffness(self, rate: float, spin: float = 0.0) -> NDArray[np.complex128]:
        """Forces over displacements that oscillate at a rate, rad/s: `K - rate^2 M + i rate (D + spin G)`."""
        damping = self.damping + spin * self.gyroscopic
        found: NDArray[np.complex128] = self.stiffness - rate**2 * self.mass + 1j * rate * damping
        return found

    def at_node(self, node: int, values: NDArray[Any], names: Sequence[str] = ("v", "w")) -> tuple[Any, ...]:
        """Values (n_dof,) at degrees of a node, by default up and horizontally; 0 where there is none."""
        rows = (self.index(node, name) for name in names)
        return tuple(values[row] if row >= 0 else 0.0 for row in rows)

    def index(self, node: int, name: str) -> int:
        """Row of a degree of freedom; -1 where it is constrained or absent."""
        try:
            return self.degrees.index((node, name))
        except ValueError:
            return -1


@dataclass(frozen=True, kw_only=True, eq=False)
class StatorModel:
    """A stator and where it faces the rotor."""

    body: Body
    node: int  # of the rotor
    angle: float  # rad, from +y towards +z
    radius: float  # of contact, m
    clearance_offset: float  # m
    length: float  # m
    euler_load: float  # N
    axial: int  # row of the tip's axial displacement in the body
    lateral: int  # row of the tip's lateral displacement; -1 without lateral freedom
    # (n_dof, n_dof), 1/m: the tip draws back by half the form of the displacements; None: not counted
    squared_slope: NDArray[np.float64] | None = None
    centre: tuple[float, float] = (0.0, 0.0)  # m, about which it is set, up and horizontally
    strength: float = math.inf  # N, contact force that it bears
    is_bore: bool = False  # a hole around the rotor, which moves up ("axial") and horizontally ("lateral")
    friction_factor: float = 1.0  # friction over that of the case
    law: NormalLaw | None = None  # in place of that of the case
    torsion: int = -1  # row of its rotation about the shaft's axis, of a bore on a carrier that turns
    alone: StatorModel | None = None  # on a carrier: while that is held; `body` is all that stands on it

    @cached_property
    def axial_compliance(self) -> float:
        """Static axial displacement of the tip under a unit force, with what it stands on held, m/N.

        0 of a wall, and of a body that nothing holds, which no static force compresses.
        """
        body, tip = self.held.body, self.held.axial
        return float(np.linalg.pinv(body.stiffness)[tip, tip]) if tip >= 0 else 0.0

    @property
    def held(self) -> StatorModel:
        """The stator by itself, with what it stands on held."""
        return self if self.alone is None else self.alone


@dataclass(frozen=True, kw_only=True, eq=False)
class CarrierModel:
    """A carrier with the stators on it, as one body."""

    name: str
    body: Body
    stators: tuple[int, ...]  # numbers, from 1


@dataclass(frozen=True, kw_only=True, eq=False)
class ProbeRows:
    """What each probe sees of a model at one speed, and the monitors at places where no signal is recorded.

    Attributes
    ----------
    probes : tuple of Probe
    rows : (3, n_probe + 2 n_watched, n_all)
        Factors of displacements, velocities and accelerations of all bodies (`Model.bodies`), measured from
        the sagged shaft: of the probes, then of vertical and horizontal displacement at each watched place.
    constant : (n_probe + 2 n_watched,)
        What is seen of the sag.
    nodes : tuple of int
        The first watched places: nodes that stators face.
    clearances : tuple of float
        The other ones: bearings, whose clearance this is, m; the displacement is relative to what they stand
        on.
    """

    probes: tuple[Probe, ...]
    rows: NDArray[np.float64]
    constant: NDArray[np.float64]
    nodes: tuple[int, ...] = ()
    clearances: tuple[float, ...] = ()

    @property
    def of_probes(self) -> NDArray[np.float64]:
        """The rows of the probes, (3, n_probe, n_all), for whose accuracy modes and steps are chosen."""
        return self.rows[:, : len(self.probes)]

    @property
    def patterns(self) -> NDArray[np.float64]:
        """Degrees that probes see together, (n_all, n_pattern), each of length 1."""
        seen = self.of_probes.reshape(-1, self.rows.shape[2])
        seen = seen[np.any(seen != 0.0, axis=1)]
        return np.unique(seen / np.linalg.norm(seen, axis=1, keepdims=True), axis=0).T


@dataclass(frozen=True, kw_only=True, eq=False)
class Model:
    """Rotor and stators, assembled.

    The unbalance force on the rotor is `spin^2 (unbalance_cosine cos(spin t) + unbalance_sine sin(spin t))`,
    that of each (order, phasor) among the harmonics `Re(phasor exp(i order spin t))`.
    """

    rotor: Body
    unbalance_cosine: NDArray[np.float64]  # (n_dof,), kg m
    unbalance_sine: NDArray[np.float64]  # (n_dof,), kg m
    stators: tuple[StatorModel, ...]
    output_node: int  # whose motion is recorded: the first stator's, or else the first disc's
    sag: NDArray[np.float64]  # (n_dof,), of the rotor under its constant loads, no stator touching, m or rad
    load: NDArray[np.float64]  # (n_dof,), constant loads on the rotor, N or N m
    carriers: tuple[CarrierModel, ...] = ()
    probe: ProbeRows | None = None
    harmonics: tuple[tuple[int, NDArray[np.complex128]], ...] = ()  # phasors (n_dof,), N
    film: NDArray[np.float64] | None = None  # (n_dof,), N, where tables place journals: K sag = load + film

    @cached_property
    def bodies(self) -> tuple[Body, ...]:
        """Rotor, then stators: the order of every vector over all bodies.

        Stators on a carrier are one body with it, in the place of the first of them.
        """
        return (self.rotor, *(self.stators[i].body for i in self._first_on_body))

    @cached_property
    def stator_start(self) -> tuple[int, ...]:
        """First row of the body of each stator among all degrees of freedom, (n_stator,)."""
        starts = dict(zip(self._first_on_body, self.body_start[1:-1], strict=True))
        leader = {
            number - 1: carrier.stators[0] - 1 for carrier in self.carriers for number in carrier.stators
        }
        return tuple(starts[leader.get(i, i)] for i in range(len(self.stators)))

    @property
    def _first_on_body(self) -> list[int]:
        """Positions of the stators but those that share a body with an earlier one."""
        later = {number - 1 for carrier in self.carriers for number in carrier.stators[1:]}
        return [i for i in range(len(self.stators)) if i not in later]

    @cached_property
    def body_start(self) -> tuple[int, ...]:
        """First row of each body among all degrees of freedom, and the number of all: (n_body + 1,)."""
        return tuple(accumulate((body.n_dof for body in self.bodies), initial=0))

    @cached_property
    def output_sag(self) -> NDArray[np.float64]:
        """Sag of the output node: vertical, horizontal and torsional, (3,), m, m and rad."""
        return np.array(self.rotor.at_node(self.output_node, self.sag, ("v", "w", "thx")))

    @cached_property
    def n_place(self) -> int:
        """Places whose motion is recorded besides the output node's.

        Tips of stators, then carriers, then the rotations of those that turn, as lateral motion.
        """
        return len(self.stators) + len(self.carriers) + len(self.turning_carriers)

    @cached_property
    def turning_carriers(self) -> tuple[CarrierModel, ...]:
        """Carriers that are not held in rotation about the shaft's axis."""
        return tuple(carrier for carrier in self.carriers if carrier.body.index(1, "thx") >= 0)

    @property
    def highest_order(self) -> int:
        """Highest order of a force on the rotor."""
        return max((order for order, _ in self.harmonics), default=1)

    @property
    def n_probe(self) -> int:
        """Number of probes and of what the monitors see beside them."""
        return 0 if self.probe is None else self.probe.constant.size

    @property
    def n_push(self) -> int:
        """Number of stators whose contact forces are recorded as vectors: all, where one is a bore."""
        return len(self.stators) * any(stator.is_bore for stator in self.stators)

    @property
    def probe_rows(self) -> NDArray[np.float64]:
        """What is seen of displacements, velocities and accelerations, (3, n_probe, n_all)."""
        return np.zeros((3, 0, self.body_start[-1])) if self.probe is None else self.probe.rows

    @property
    def sensor_rows(self) -> NDArray[np.float64]:
        """The same by probes alone (`ProbeRows.of_probes`)."""
        return self.probe_rows if self.probe is None else self.probe.of_probes

    @property
    def probe_patterns(self) -> NDArray[np.float64]:
        """Degrees that probes see together, (n_all, n_pattern), each of length 1."""
        return np.zeros((self.body_start[-1], 0)) if self.probe is None else self.probe.patterns

    def split(self, values: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Views of a vector over all bodies, (n_all,), one for each body."""
        return [values[first:end] for first, end in pairwise(self.body_start)]


def state_size(model: Model) -> int:
    """Numbers in a state of motion: displacement and velocity of each degree; two of each contact."""
    return 2 * model.body_start[-1] + 2 * len(model.stators)


FAR_APART = "lengths, stiffnesses or densities are too far apart to compute with; correct them"
ROUNDING = 1e-13  # least eigenvalue, with a unit diagonal, at which a mass matrix counts as definite
MOST_DEGREES = 3000  # of freedom of a rig: its matrices are dense, 72 MB each


@contextmanager
def computable(part: str) -> Iterator[None]:
    """Report a number that overflows while a part of a rig is assembled."""
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is found in the matrices
            yield
    except ArithmeticError:  # an overflow, or a division by what has become zero
        raise InputError(_problem(part)) from None


def check_computable(part: str, body: Body) -> None:
    """Refuse a body with entries that are not finite, or a mass matrix that rounding has made indefinite."""
    matrices = (body.mass, body.damping, body.gyroscopic, body.stiffness)
    if not all(np.isfinite(matrix).all() for matrix in matrices):
        raise InputError(_problem(part))
    diagonal = np.diag(body.mass)
    try:
        if not (diagonal > 0.0).all():
            raise np.linalg.LinAlgError
        size = np.sqrt(diagonal)
        np.linalg.cholesky(body.mass / size / size[:, np.newaxis] - ROUNDING * np.eye(body.n_dof))
    except np.linalg.LinAlgError:
        raise InputError(_problem(part)) from None


def _problem(part: str) -> str:
    return f"{part}: {FAR_APART}"
