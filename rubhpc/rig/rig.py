"""The rig: a rotor of shaft, discs, bearings and unbalance, and the stators that it may touch.

Nodes count from 1. Angles count from straight up (+y) towards +z, the sense of positive spin about +x.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rubhpc.errors import InputError
from rubhpc.input.dotted import replace_keys
from rubhpc.input.fields import FieldError, check_fields, nearest, parse_field, place, quantity, table, text
from rubhpc.input.quantity import parse_quantity
from rubhpc.input.reading import build, plain, read_toml
from rubhpc.rig.matrices import MatrixRotor
from rubhpc.rig.parts import (
    HELD_BY_DRIVE,
    UNDAMPED,
    Bearing,
    Damping,
    Disc,
    Load,
    ShaftSection,
    Torsion,
    Unbalance,
)
from rubhpc.rig.python_rig import call_rig_function, python_function
from rubhpc.rig.stators import AnyStator, LumpedStator, MatrixStator, Seat, Stator, one_by_one

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from os import PathLike

__all__ = [
    "Bearing",
    "Damping",
    "Disc",
    "Load",
    "LumpedStator",
    "MatrixRotor",
    "MatrixStator",
    "Rig",
    "Rotor",
    "ShaftSection",
    "Stator",
    "Torsion",
    "Unbalance",
    "packaged_rigs",
    "read_rig",
    "rig_from_dict",
    "with_key",
    "with_keys",
]

PACKAGED = Path(__file__).parents[1] / "rigs"
DIVERGED_SHARE = 0.1  # of the shaft's length: lateral motion that no rotor survives


@dataclass(frozen=True, kw_only=True)
class Rotor:
    """Shaft sections from node 1 on, with what sits on them."""

    shaft: tuple[ShaftSection, ...] = table(doc="Shaft sections, from node 1.")
    disc: tuple[Disc, ...] = table(doc="Rigid discs.", default=())
    bearing: tuple[Bearing, ...] = table(doc="Linear bearings.", default=())
    unbalance: tuple[Unbalance, ...] = table(doc="Unbalance masses.", default=())
    load: tuple[Load, ...] = table(doc="Constant forces.", default=())
    gravity: float = quantity(
        "m/s^2",
        doc="Gravitational acceleration, towards -y.",
        example='"9.81 m/s^2"',
        default=0.0,
        at_least=0,
    )
    torsion: Torsion = table(doc="Torsional boundary condition at the drive.", default=HELD_BY_DRIVE)
    damping: Damping = table(doc="Rayleigh damping.", default=UNDAMPED)

    def __post_init__(self) -> None:
        check_fields(self)
        for key in ("shaft", "bearing"):
            if not getattr(self, key):
                raise FieldError(key, f"missing; a rotor has at least one [[rotor.{key}]]")
        for key in ("disc", "bearing", "unbalance", "load"):
            for i, item in enumerate(getattr(self, key), 1):
                self.check_node(f"{key}.{i}.node", item.node)
        for key in ("fixed_node", "node"):
            self.check_node(f"torsion.{key}", getattr(self.torsion, key) or 1)

    @property
    def n_node(self) -> int:
        """Number of nodes along the shaft."""
        return 1 + sum(s.elements for s in self.shaft)

    @property
    def displacement_limit(self) -> float:
        """Beyond which a case has diverged, m."""
        return DIVERGED_SHARE * sum(section.length for section in self.shaft)

    def check_node(self, key: str, node: int) -> None:
        """Refuse a node that the shaft does not have."""
        if node > self.n_node:
            raise FieldError(key, f"{node} is not on the shaft; its nodes run from 1 to {self.n_node}")


@dataclass(frozen=True, kw_only=True)
class Rig:
    """Everything that stands on the bench; rings of stators are held one by one."""

    name: str = text(doc="Name of the rig.", example='"mokhtar2017"')
    rotor: Rotor | MatrixRotor = table(doc="The rotor: a shaft with discs and bearings, or matrices.")
    stator: tuple[AnyStator, ...] = table(doc="Stators around the rotor.", default=())

    def __post_init__(self) -> None:
        check_fields(self)
        object.__setattr__(self, "stator", one_by_one(tuple(self.stator)))
        for i, stator in enumerate(self.stator, 1):
            self.rotor.check_node(f"stator.{i}.node", stator.node)
            if isinstance(self.rotor, MatrixRotor) and not self.rotor.moves_along(stator.node, stator.angle):
                problem = f"node {stator.node} cannot move at {stator.angle:g} rad"
                raise FieldError(f"stator.{i}.angle", f"{problem}; 0 is along its v, pi / 2 along its w")
            if self.contact_radius(stator) is None:
                mend = f"give it, or give a disc at node {stator.node} a diameter"
                raise FieldError(f"stator.{i}.radius", f"missing, and no disc there has a diameter; {mend}")

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
        unbalance: Sequence[Unbalance] = (),
        load: Sequence[Load] = (),
        gravity: float | str = 0.0,
        output_node: int | None = None,
        displacement_limit: float = 100.0,
        name: str = "matrices",
    ) -> Rig:
        """Return a rig whose rotor is any linear body, `M u'' + (C + spin G) u' + K u = f`.

        Parameters
        ----------
        M, C, K, G : (n_dof, n_dof) array_like, SI units
            Mass (symmetric, positive definite), damping, stiffness (no negative one) and gyroscopic matrix
            (skew, for a spin of 1 rad/s), what is held left out. C and G may be None: zeros.
        degrees : sequence of (node, name)
            Which degree each row is: "u", "v", "w" (m), "thx", "thy", "thz" (rad) of a node counted from 1;
            x along the shaft, "v" up, positive spin from v to w. A stator presses on v and w of its node, and
            friction on thx where there is one. Coordinates of another kind have names that begin with "q".
        stators : sequence of Stator, LumpedStator or MatrixStator, or one
            Each with its node and, as matrices know no disc, its radius of contact, m.
        unbalance : sequence of Unbalance
        load : sequence of Load
            Constant forces.
        gravity : float (m/s2) or str with a unit
            Pulls against "v" at every mass of `M`; nothing unless told.
        output_node : int, optional
            Whose v, w and thx are recorded; default the first stator's.
        displacement_limit : float
            Beyond which a case has diverged, m.
        name : str

        Raises
        ------
        InputError
            When the matrices cannot be those of a body, or a name or node is not there; what and where.

        Examples
        --------
        >>> stop = LumpedStator(node=1, mass=1e-4, stiffness=1e6, radius=1.0)
        >>> rig = Rig.from_matrices([[100.0]], None, [[1e4]], degrees=[(1, "v")], stators=[stop])
        """
        if K is None:
            raise FieldError("K", "missing; give the stiffness matrix")
        table = {"mass": M, "damping": C, "stiffness": K, "gyroscopic": G}
        declared = {f.name: f for f in fields(MatrixRotor)}
        given: Any = {key: value for key, value in table.items() if value is not None}
        rotor = MatrixRotor(
            **given,
            degrees=parse_field(declared["degrees"], degrees, "degrees"),
            unbalance=_several(unbalance),
            load=_several(load),
            gravity=parse_quantity(gravity, "m/s^2", "gravity"),
            output_node=output_node,
            displacement_limit=displacement_limit,
        )
        return cls(name=name, rotor=rotor, stator=_several(stators))

    @classmethod
    def from_ross(
        cls,
        rotor: Any,
        *,
        stators: Sequence[AnyStator] = (),
        unbalance: Sequence[Unbalance] = (),
        load: Sequence[Load] = (),
        gravity: float | str = 0.0,
        speed: float | str | None = None,
        torsion: Torsion = HELD_BY_DRIVE,
        output_node: int | None = None,
        name: str = "ross",
    ) -> Rig:
        """Return a rig whose rotor is a `ross.Rotor` (https://ross.readthedocs.io), with stators around it.

        Node n of ROSS, which counts from 0, is node n + 1 here. Up is ROSS's y; angles count from there in
        the sense of positive spin, towards -x of ROSS. Axial motion is held at the first node where ROSS
        leaves it free.

        Parameters
        ----------
        rotor : ross.Rotor
            With six degrees of freedom a node. The matrices are taken as they are at this moment.
        stators : sequence of Stator, LumpedStator or MatrixStator, or one
            Each with its node (from 1) and its radius of contact.
        unbalance : sequence of Unbalance
            At nodes from 1; ROSS keeps none in its rotor.
        load : sequence of Load, gravity : float (m/s2) or str with a unit
            Constant forces at nodes from 1, and weight; none unless told.
        speed : float (rad/s) or str with a unit, optional
            At which bearings are taken whose coefficients depend on it.
        torsion : Torsion
            Where the drive holds torsion, which ROSS leaves free; node 1 unless told.
        output_node : int, optional
            Whose motion is recorded; default the first stator's.
        name : str

        Raises
        ------
        InputError
            When it is no such rotor, or something is missing that the rig needs.
        """
        from rubhpc.rig.ross import rotor_from_ross

        at = None if speed is None else parse_quantity(speed, "rad/s", "from_ross: speed")
        found = rotor_from_ross(rotor, speed=at, torsion=torsion, unbalance=_several(unbalance))
        found = replace(
            found,
            load=_several(load),
            gravity=parse_quantity(gravity, "m/s^2", "from_ross: gravity"),
            output_node=output_node,
        )
        return cls(name=name, rotor=found, stator=_several(stators))

    def contact_radius(self, stator: AnyStator) -> float | None:
        """Radius at which a stator touches, m: its own, or that of the largest disc at its node."""
        discs = self.rotor.disc if isinstance(self.rotor, Rotor) else ()
        rims = [d.diameter / 2 for d in discs if d.node == stator.node and d.diameter is not None]
        return stator.radius if stator.radius is not None else max(rims, default=None)

    def as_dict(self) -> dict[str, Any]:
        """Return the rig as plain dicts, lists, numbers and text, for JSON."""
        result: dict[str, Any] = plain(self)
        return result


def _several(parts: Any) -> tuple[Any, ...]:
    """Parts in a row; one by itself is a row of one."""
    return (parts,) if isinstance(parts, Seat | Unbalance | Load) else tuple(parts)


def rig_from_dict(table: Mapping[str, Any], where: str = "rig") -> Rig:
    """Return the rig that `Rig.as_dict` described; `where` is what an error names."""
    return build(Rig, table, where)


def packaged_rigs() -> list[str]:
    """Return the names of the rigs that come with the package."""
    return sorted(p.stem for p in PACKAGED.glob("*.toml"))


def read_rig(
    name_or_path: str | PathLike[str],
    relative_to: Path | None = None,
    where: str = "rig",
    *,
    trust_rig: bool = False,
) -> Rig:
    """Return a packaged rig by its name, the rig of a TOML file, or the one that a Python function returns.

    Parameters
    ----------
    name_or_path : str or Path
        "mokhtar2017", the path of a rig file, or "my_rig.py:build", a function called without arguments.
    relative_to : Path, optional
        Folder from which a relative path counts; the working directory by default.
    where : str
        What asks for the rig, for the error when there is none.
    trust_rig : bool
        Whether Python code may be run for the rig.

    Raises
    ------
    InputError
        When there is no such rig, its file cannot be used as it stands, or it is code that is not trusted.
    """
    name = str(name_or_path)
    if code := python_function(name):
        if not trust_rig:
            problem = f"{place(name)} is Python code, which is run only when you trust it"
            raise InputError(f"{where}: {problem}; add --trust-rig (in Python, give the Rig itself)")
        rig = call_rig_function((relative_to or Path()) / code[0], code[1], where)
        if not isinstance(rig, Rig):
            raise InputError(f"{where}: {place(name)} returned a {type(rig).__name__}; return a rubhpc.Rig")
        return rig
    if name in packaged_rigs():
        path = PACKAGED / f"{name}.toml"
        return build(Rig, read_toml(path), f"{name}.toml")
    path = (relative_to or Path()) / name
    if not name.endswith(".toml") and "/" not in name and not os.path.exists(path):
        mend = nearest(name, packaged_rigs())
        raise InputError(f"{where}: neither a packaged rig nor a file {place(str(path))}; {mend}")
    return build(Rig, read_toml(path, where), str(path))


def with_key(rig: Rig, dotted: str, value: object) -> Rig:
    """Return the rig with one key set, in SI units or as text with a unit.

    "stator.youngs_modulus" sets it in all stators, "stator.1.angle" in the first. Where the rig says the
    same in another way, that way makes room: `kyy` splits a bearing's common `stiffness`, and `stiffness`
    replaces `kyy` and `kzz`.

    Raises
    ------
    InputError
        When there is no such key, or the rig cannot be with that value.
    """
    return with_keys(rig, {dotted: value})


def with_keys(rig: Rig, values: Mapping[str, object]) -> Rig:
    """Return the rig with several dotted keys set at once, so that only the result has to make sense."""
    return replace_keys(rig, values)
