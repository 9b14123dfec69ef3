"""Parallel parameter studies of rotor-stator rub.

`rubhpc.simulate` computes one case, `rubhpc.periodic` solves for a periodic motion, `rubhpc.branch` follows
it along a parameter, `rubhpc.run` computes a study, `rubhpc.open` opens a store as a lazy dataset.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

from rubhpc.version import __version__ as __version__

if TYPE_CHECKING:
    from postproc.accessor import open  # noqa: A004 - the public name
    from postproc.measured.measured import measured
    from postproc.signals.sensors import Sensor, sense
    from rubhpc.branch import branch
    from rubhpc.errors import InputError, NoPeriodicMotion, RubError, StoppedEarly, StoreError
    from rubhpc.fem.assemble import assemble
    from rubhpc.fem.dry_whirl import dry_whirl
    from rubhpc.fem.linear_design import linear_design
    from rubhpc.identification.identify import Identification, identify
    from rubhpc.integrate.branches.branch import Branch
    from rubhpc.integrate.periodic_motion import PeriodicMotion
    from rubhpc.integrate.record import Record, State
    from rubhpc.knocks import least_knock
    from rubhpc.periodic import periodic
    from rubhpc.rig.carriers import Carrier, MatrixCarrier
    from rubhpc.rig.probes import Probe
    from rubhpc.rig.reading import read_rig
    from rubhpc.rig.rig import Rig
    from rubhpc.rig.rotors import Harmonic, Load, Unbalance
    from rubhpc.rig.stators import Bore, LumpedStator, MatrixStator, Stator
    from rubhpc.run_up import run_up
    from rubhpc.running.driver import run
    from rubhpc.simulate import simulate
    from rubhpc.storage.summary import Summary
    from rubhpc.study.study import Study, read_study
    from rubhpc.whirl_simulations import certify_whirl

__all__ = [
    "Bore",
    "Branch",
    "Carrier",
    "Harmonic",
    "Identification",
    "InputError",
    "Load",
    "LumpedStator",
    "MatrixCarrier",
    "MatrixStator",
    "NoPeriodicMotion",
    "PeriodicMotion",
    "Probe",
    "Record",
    "Rig",
    "RubError",
    "Sensor",
    "State",
    "Stator",
    "StoppedEarly",
    "StoreError",
    "Study",
    "Summary",
    "Unbalance",
    "assemble",
    "branch",
    "certify_whirl",
    "dry_whirl",
    "identify",
    "least_knock",
    "linear_design",
    "measured",
    "open",
    "periodic",
    "read_rig",
    "read_study",
    "run",
    "run_up",
    "sense",
    "simulate",
]

# Module of each name; imported at first use, so that `import rubhpc` is fast.
_HOMES = {
    "Bore": "rubhpc.rig.stators:Bore",
    "Branch": "rubhpc.integrate.branches.branch:Branch",
    "Carrier": "rubhpc.rig.carriers:Carrier",
    "Harmonic": "rubhpc.rig.rotors:Harmonic",
    "Identification": "rubhpc.identification.identify:Identification",
    "InputError": "rubhpc.errors:InputError",
    "Load": "rubhpc.rig.rotors:Load",
    "LumpedStator": "rubhpc.rig.stators:LumpedStator",
    "MatrixCarrier": "rubhpc.rig.carriers:MatrixCarrier",
    "MatrixStator": "rubhpc.rig.stators:MatrixStator",
    "NoPeriodicMotion": "rubhpc.errors:NoPeriodicMotion",
    "PeriodicMotion": "rubhpc.integrate.periodic_motion:PeriodicMotion",
    "Probe": "rubhpc.rig.probes:Probe",
    "Record": "rubhpc.integrate.record:Record",
    "Rig": "rubhpc.rig.rig:Rig",
    "RubError": "rubhpc.errors:RubError",
    "Sensor": "postproc.signals.sensors:Sensor",
    "State": "rubhpc.integrate.record:State",
    "Stator": "rubhpc.rig.stators:Stator",
    "StoppedEarly": "rubhpc.errors:StoppedEarly",
    "StoreError": "rubhpc.errors:StoreError",
    "Study": "rubhpc.study.study:Study",
    "Summary": "rubhpc.storage.summary:Summary",
    "Unbalance": "rubhpc.rig.rotors:Unbalance",
    "assemble": "rubhpc.fem.assemble:assemble",
    "branch": "rubhpc.branch:branch",
    "certify_whirl": "rubhpc.whirl_simulations:certify_whirl",
    "dry_whirl": "rubhpc.fem.dry_whirl:dry_whirl",
    "identify": "rubhpc.identification.identify:identify",
    "least_knock": "rubhpc.knocks:least_knock",
    "linear_design": "rubhpc.fem.linear_design:linear_design",
    "measured": "postproc.measured.measured:measured",
    "open": "postproc.accessor:open",
    "periodic": "rubhpc.periodic:periodic",
    "read_rig": "rubhpc.rig.reading:read_rig",
    "read_study": "rubhpc.study.study:read_study",
    "run": "rubhpc.running.driver:run",
    "run_up": "rubhpc.run_up:run_up",
    "sense": "postproc.signals.sensors:sense",
    "simulate": "rubhpc.simulate:simulate",
}


# Modules that register what datasets of a function have: the figures of `rub`.
_BESIDES = {"measured": "postproc.accessor", "run_up": "postproc.accessor"}


class _Package(ModuleType):
    """The package; a module, once imported, does not hide the function of its name."""

    def __setattr__(self, name: str, value: Any) -> None:
        is_hiding = isinstance(value, ModuleType) and name in ("branch", "periodic", "run_up", "simulate")
        super().__setattr__(name, getattr(value, name) if is_hiding else value)


sys.modules[__name__].__class__ = _Package


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if name in _BESIDES:
        import_module(_BESIDES[name])
    module, _, attribute = _HOMES[name].partition(":")
    value = getattr(import_module(module), attribute)
    setattr(sys.modules[__name__], name, value)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
