"""Probes: what is measured of a rig, where and in which direction."""

from __future__ import annotations

import re
from dataclasses import dataclass

from rubhpc.input.fields import FieldError, check_fields, choice, count, quantity, text
from rubhpc.schema import PROBE_QUANTITIES

TWISTS = ("twist", "twist_rate", "twist_acceleration")
MOTIONS = ("displacement", "velocity", "acceleration")

LONGEST_NAME = 64  # of a probe: its signals are files of the store


@dataclass(frozen=True, kw_only=True)
class Probe:
    """A sensor at a node of the rotor or at a stator; its signals are stored under its name.

    Parameters
    ----------
    name : str
        Letters, digits and _: of which those of the stored variables are made.
    node, stator : int, optional
        One of the two, from 1.
    angle : float, rad
        In which direction it measures, from straight up in the sense of positive spin; motion and force are
        positive that way. A twist has no direction.
    quantity : str
        Of a node its motion, its twist about the steady spin, or the force of the shaft on its bearings. Of a
        stator the motion of its tip, or the force on its foundation: on the ground under its root, or under
        the carrier that it stands on.
    """

    name: str = text(
        doc="Name; the stored variables are named after it: probe_NAME.", example='"bearing_1_left"'
    )
    node: int | None = count(doc="Node of the rotor, from 1.", example="1", default=None)
    stator: int | None = count(doc="Number of the stator, in place of a node.", example="2", default=None)
    angle: float = quantity(
        "rad",
        doc="Direction that is positive, from straight up in the sense of positive spin.",
        example='"-45 deg"',
        default=0.0,
    )
    quantity: str = choice(
        doc="What is measured: `foundation_force` is that of a stator, twists and `bearing_force` of a node.",
        example='"acceleration"',
        of=tuple(PROBE_QUANTITIES),
        default="displacement",
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if not re.fullmatch(rf"[A-Za-z]\w{{,{LONGEST_NAME - 1}}}", self.name, re.ASCII):
            fix = f"write up to {LONGEST_NAME} letters, digits and _, beginning with a letter"
            shown = self.name if len(self.name) <= LONGEST_NAME else f"{self.name[:LONGEST_NAME]}..."
            raise FieldError("name", f'"{shown}" is not a valid name of a variable; {fix}')
        if (self.node is None) == (self.stator is None):
            raise FieldError("node", "give either node = 1 or stator = 1")
        if self.stator is not None and self.quantity not in (*MOTIONS, "foundation_force"):
            fix = f"choose one of {', '.join(MOTIONS)}, foundation_force, or give a node"
            raise FieldError("quantity", f"{self.quantity} is not measured at a stator; {fix}")
        if self.node is not None and self.quantity == "foundation_force":
            fix = "give a stator, or take bearing_force: bearings stand on the ground"
            raise FieldError("quantity", f"foundation_force is not measured at a node; {fix}")
        if self.quantity in TWISTS and self.angle != 0.0:
            raise FieldError("angle", f"{self.quantity} has no direction; leave it out")
