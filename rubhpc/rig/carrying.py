"""Which stators stand on which carrier, and whether they can."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rubhpc.input.fields import FieldError
from rubhpc.input.messages import nearest

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubhpc.rig.carriers import AnyCarrier
    from rubhpc.rig.stators import AnyStator


def check_carriers(carriers: Sequence[AnyCarrier], stators: Sequence[AnyStator]) -> None:
    """Refuse carriers without stators, stators on carriers that are not there, and those that cannot follow.

    Raises
    ------
    FieldError
        Names the carrier or stator.
    """
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
