"""The rig: a rotor and the stators that it may touch.

Nodes count from 1. Angles count from straight up (+y) towards +z, the sense of positive spin about +x.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any

from rubhpc.input.fields import FieldError, check_fields, parse_field, table, text
from rubhpc.input.messages import nearest
from rubhpc.input.quantity import parse_quantity
from rubhpc.input.reading import plain
from rubhpc.models import default_of
from rubhpc.rig.carriers import AnyCarrier
from rubhpc.rig.parts import FIXED_AT_NODE_1, Torsion
from rubhpc.rig.ross import rotor_from_ross
from rubhpc.rig.rotors import UNLOADED, AnyRotor, MatrixRotor
from rubhpc.rig.stators import AnyStator, Stator, single_stators
from rubhpc.rig.supports import is_time

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubhpc.rig.carriers import AnyCarrier
    from rubhpc.rig.rotors import Harmonic, Load, Unbalance
    from rubhpc.rig.stators import AnyStator


def check_carriers(carriers: Sequence[AnyCarrier], stators: Sequence[AnyStator]) -> None:
    """Refuse carriers without stators, and stators on none that is there, or that cannot follow."""
    names = [carrier.name for carrier in carriers]
    for i, name in enumerate(names, 1):
        if names.count(name) > 1:
            raise FieldError(f"carrier.{i}.name", f"{name} is duplicated; give every carrier its own name")
    for i, stator in enumerate(stators, 1):
        if stator.carrier is None:
            continue
        if stator.carrier not in names:
            fix = nearest(stator.carrier, names) if names else "add [[carrier]] with this name"
            raise FieldError(f"stator.{i}.carrier", f"no carrier is named {stator.carrier}; {fix}")
        if stator.carrier_problem:
            raise FieldError(f"stator.{i}.carrier", stator.carrier_problem)
    for i, name in enumerate(names, 1):
        if all(stator.carrier != name for stator in stators):
            problem = "no stator stands on it"
            raise FieldError(f"carrier.{i}.name", f'{problem}; give one carrier = "{name}", or remove it')


@dataclass(frozen=True, kw_only=True)
class Rig:
    """A rotor and its stators; a ring of stators is stored as single stators."""

    name: str = text(doc="Name of the rig.", example='"mokhtar2017"')
    rotor: AnyRotor = table(doc="The rotor: a shaft with discs and bearings, or matrices.")
    stator: tuple[AnyStator, ...] = table(doc="Stators around the rotor.", default=())
    carrier: tuple[AnyCarrier, ...] = table(
        doc="Bodies on springs on which stators stand.", default=(), added=True
    )

    def __post_init__(self) -> None:
        check_fields(self)
        object.__setattr__(self, "stator", single_stators(tuple(self.stator)))
        for i, stator in enumerate(self.stator, 1):
            self.rotor.check_node(f"stator.{i}.node", stator.node)
            if not self.rotor.can_move(stator.node, stator.angle):
                problem = f"node {stator.node} cannot move at {stator.angle:g} rad"
                raise FieldError(f"stator.{i}.angle", f"{problem}; 0 is along its v, pi / 2 along its w")
            if self.contact_radius(stator) is None:
                fix = f"add it, or add the diameter of a disc at node {stator.node}"
                raise FieldError(f"stator.{i}.radius", f"missing, and no disc there has a diameter; {fix}")
        check_carriers(self.carrier, self.stator)
        bearings = enumerate(getattr(self.rotor, "bearing", ()), 1)
        releases = [(i, bearing.until) for i, bearing in bearings if bearing.until is not None]
        for i, until in releases:
            if not any(stator.is_bore for stator in self.stator):
                problem = "no bore would catch the rotor"
                raise FieldError(f"rotor.bearing.{i}.until", f'{problem}; add [[stator]] kind = "bore"')
            if is_time(until) != is_time(releases[0][1]):
                how = "a time" if is_time(until) else "a number of revolutions"
                problem = f"is {how}, that of bearing {releases[0][0]} is not"
                raise FieldError(f"rotor.bearing.{i}.until", f"{problem}; give both in the same way")

    @classmethod
    def from_matrices(
        cls,
        M: object,
        C: object = None,
        K: object = None,
        G: object = None,
        *,
        degrees: Sequence[tuple[int, str]],
        stators: Sequence[AnyStator] = (),
        carriers: Sequence[AnyCarrier] = (),
        unbalance: Sequence[Unbalance] = (),
        load: Sequence[Load] = (),
        harmonic: Sequence[Harmonic] = (),
        gravity: float | str = 0.0,
        clearance_from: float | str = UNLOADED,
        output_node: int | None = None,
        displacement_limit: float = 100.0,
        name: str = "matrices",
    ) -> Rig:
        """Return a rig whose rotor is given by the matrices of `M u'' + (C + spin G) u' + K u = f`.

        Parameters
        ----------
        M, C, K, G : (n_dof, n_dof) array_like, SI units
            Mass (symmetric, positive definite), damping, stiffness (none negative) and gyroscopic matrix
            (skew-symmetric, for a spin of 1 rad/s), without constrained degrees. C and G are zero by default.
        degrees : sequence of (node, name)
            Degree of freedom of each row: "u", "v", "w" (m), "thx", "thy", "thz" (rad) of a node, from 1;
            x along the shaft, "v" up, positive spin from v to w. Contact acts on v and w of the node of a
            stator, friction also on its thx. Coordinates of other kinds have names that begin with "q".
        stators : sequence of Stator, LumpedStator or MatrixStator, or one
            Each with its node and, since matrices have no disc, its contact radius, m.
        carriers : sequence of Carrier or MatrixCarrier, or one
            On which stators stand.
        unbalance : sequence of Unbalance
        load : sequence of Load
            Constant forces.
        harmonic : sequence of Harmonic
            Forces at multiples of the spin speed.
        gravity : float (m/s2) or str with a unit
            Acts along -v on every mass of `M`; 0 by default.
        clearance_from : float (rad/s) or str
            About which position of the shaft stators are set: "unloaded", "standstill" or a speed.
        output_node : int, optional
            Node whose v, w and thx are recorded; default the first stator's.
        displacement_limit : float
            Displacement beyond which a case has diverged, m.
        name : str

        Raises
        ------
        InputError
            When the matrices are not those of a body, or a name or node does not exist.

        Examples
        --------
        >>> stop = LumpedStator(node=1, mass=1e-4, stiffness=1e6, radius=1.0)
        >>> rig = Rig.from_matrices([[100.0]], None, [[1e4]], degrees=[(1, "v")], stators=[stop])
        """
        if K is None:
            raise FieldError("K", "missing; give the stiffness matrix")
        table = {"mass": M, "damping": C, "stiffness": K, "gyroscopic": G}
        given = _parsed(
            "",
            degrees=degrees,
            unbalance=unbalance,
            load=load,
            harmonic=harmonic,
            gravity=gravity,
            clearance_from=clearance_from,
        )
        given |= {key: value for key, value in table.items() if value is not None}
        rotor = MatrixRotor(**given, output_node=output_node, displacement_limit=displacement_limit)
        return cls(name=name, rotor=rotor, stator=_tuple(stators), carrier=_tuple(carriers))

    @classmethod
    def from_ross(
        cls,
        rotor: Any,
        *,
        stators: Sequence[AnyStator] = (),
        carriers: Sequence[AnyCarrier] = (),
        unbalance: Sequence[Unbalance] = (),
        load: Sequence[Load] = (),
        harmonic: Sequence[Harmonic] = (),
        gravity: float | str = 0.0,
        clearance_from: float | str = UNLOADED,
        speed: float | str | None = None,
        torsion: Torsion = FIXED_AT_NODE_1,
        output_node: int | None = None,
        name: str = "ross",
    ) -> Rig:
        """Return a rig whose rotor is a `ross.Rotor` (https://ross.readthedocs.io).

        Node n of ROSS, which counts from 0, is node n + 1 here, on the shaft or on a pedestal. Up is ROSS's
        y; angles count from there in the sense of positive spin, towards -x of ROSS. Axial motion is
        constrained at node 1 if ROSS leaves it unconstrained; another shaft of a `CoAxialRotor` is held at
        its first node.

        Parameters
        ----------
        rotor : ross.Rotor
            With six degrees of freedom per node. Its matrices are copied.
        stators : sequence of Stator, LumpedStator or MatrixStator, or one
            Each with its node (from 1) and its contact radius.
        carriers : sequence of Carrier or MatrixCarrier, or one
            On which stators stand.
        unbalance : sequence of Unbalance
            At nodes from 1; a ROSS rotor has none.
        load : sequence of Load
            Constant forces at nodes from 1.
        harmonic : sequence of Harmonic
            Forces at multiples of the spin speed, at nodes from 1.
        gravity : float (m/s2) or str with a unit
            0 by default.
        clearance_from : float (rad/s) or str
            About which position of the shaft stators are set: "unloaded", "standstill" or a speed.
        speed : float (rad/s) or str with a unit, optional
            Speed at which speed-dependent bearings are evaluated once and for all. By default they keep
            their tables, and every case uses the coefficients at its own speed.
        torsion : Torsion
            Torsional boundary condition, which a ROSS rotor lacks; by default node 1 is fixed.
        output_node : int, optional
            Node whose motion is recorded; default the first stator's.
        name : str

        Raises
        ------
        InputError
            When it is not such a rotor, its shafts turn at different speeds, or something that the rig
            needs is missing.
        """
        at = None if speed is None else parse_quantity(speed, "rad/s", "from_ross: speed")
        found = rotor_from_ross(rotor, speed=at, torsion=torsion, unbalance=_tuple(unbalance))
        given = _parsed(
            "from_ross: ", load=load, harmonic=harmonic, gravity=gravity, clearance_from=clearance_from
        )
        found = replace(found, **given, output_node=output_node)
        return cls(name=name, rotor=found, stator=_tuple(stators), carrier=_tuple(carriers))

    def contact_radius(self, stator: AnyStator) -> float | None:
        """Contact radius of a stator, m: its own, or that of the largest disc at its node."""
        return stator.radius if stator.radius is not None else self.rotor.rim_radius(stator.node)

    def with_geometry(self, geometry: str) -> Rig:
        """Return the rig with a geometry of the beam stators that give none."""
        stators = tuple(
            one.with_geometry(geometry) if isinstance(one, Stator) else one for one in self.stator
        )
        return self if stators == self.stator else replace(self, stator=stators)

    def as_dict(self) -> dict[str, Any]:
        """Return the rig as plain dicts, lists, numbers and text, for JSON."""
        result: dict[str, Any] = plain(self.with_geometry(default_of("geometry")))
        return result


def _parsed(where: str, **given: Any) -> dict[str, Any]:
    """Fields of a rotor of matrices, its tables as tuples."""
    declared = {f.name: f for f in fields(MatrixRotor)}
    return {
        key: parse_field(declared[key], value, f"{where}{key}")
        if "kind" in declared[key].metadata
        else _tuple(value)
        for key, value in given.items()
    }


def _tuple(parts: Any) -> tuple[Any, ...]:
    """One part or several as a tuple."""
    return (parts,) if is_dataclass(parts) else tuple(parts)
