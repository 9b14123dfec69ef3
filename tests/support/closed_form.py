"""The library as tests of the closed form call it: fixed normal, sliding and linear stators unless given.

Their subject is motion in closed form between events, or what was measured on it, whatever the defaults are.
"""

from functools import partial

import rubhpc
from rubhpc.models import LINEAR
from rubhpc.rig import reading
from rubhpc.rig.rig import Rig
from rubhpc.study import contact_keys

LAWS = {"normal": "fixed", "friction_law": "sliding"}

Contact = partial(contact_keys.Contact, **LAWS)


def read_rig(*given, **options):
    """`rubhpc.read_rig`, with linear stators where the rig says nothing."""
    return reading.read_rig(*given, **options).with_geometry(LINEAR)


def _linear(rig):
    return rig.with_geometry(LINEAR) if isinstance(rig, Rig) else read_rig(rig)


def simulate(rig, **given):
    """`rubhpc.simulate`."""
    return rubhpc.simulate(_linear(rig), **(LAWS | given))


def periodic(rig, **given):
    """`rubhpc.periodic`."""
    return rubhpc.periodic(_linear(rig), **(LAWS | given))


def branch(rig, **given):
    """`rubhpc.branch`."""
    return rubhpc.branch(_linear(rig), **(LAWS | given))


def run_up(rig, **given):
    """`rubhpc.run_up`."""
    return rubhpc.run_up(_linear(rig), **(LAWS | given))
