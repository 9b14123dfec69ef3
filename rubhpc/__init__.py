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
    from postproc.accessor import open as open  # noqa: A004 - the public name
    from postproc.measured.measured import measured as measured
    from postproc.signals.sensors import Sensor as Sensor
    from postproc.signals.sensors import sense as sense
    from rubhpc.branch import branch as branch
    from rubhpc.errors import InputError as InputError
    from rubhpc.errors import NoPeriodicMotion as NoPeriodicMotion
    from rubhpc.errors import RubError as RubError
    from rubhpc.errors import StoppedEarly as StoppedEarly
    from rubhpc.errors import StoreError as StoreError
    from rubhpc.fem.assemble import assemble as assemble
    from rubhpc.fem.dry_whirl import dry_whirl as dry_whirl
    from rubhpc.fem.linear_design import linear_design as linear_design
    from rubhpc.identification.identify import Identification as Identification
    from rubhpc.identification.identify import identify as identify
    from rubhpc.integrate.branches.branch import Branch as Branch
    from rubhpc.integrate.periodic_motion import PeriodicMotion as PeriodicMotion
    from rubhpc.integrate.record import Record as Record
    from rubhpc.integrate.record import State as State
    from rubhpc.knocks import least_knock as least_knock
    from rubhpc.periodic import periodic as periodic
    from rubhpc.rig.carriers import Carrier as Carrier
    from rubhpc.rig.carriers import MatrixCarrier as MatrixCarrier
    from rubhpc.rig.probes import Probe as Probe
    from rubhpc.rig.reading import read_rig as read_rig
    from rubhpc.rig.rig import Rig as Rig
    from rubhpc.rig.rotors import Harmonic as Harmonic
    from rubhpc.rig.rotors import Load as Load
    from rubhpc.rig.rotors import Unbalance as Unbalance
    from rubhpc.rig.stators import Bore as Bore
    from rubhpc.rig.stators import LumpedStator as LumpedStator
    from rubhpc.rig.stators import MatrixStator as MatrixStator
    from rubhpc.rig.stators import Stator as Stator
    from rubhpc.run_up import run_up as run_up
    from rubhpc.running.driver import run as run
    from rubhpc.simulate import simulate as simulate
    from rubhpc.storage.summary import Summary as Summary
    from rubhpc.study.study import Study as Study
    from rubhpc.study.study import read_study as read_study
    from rubhpc.whirl_simulations import certify_whirl as certify_whirl

# Names by their module; imported at first use, so that `import rubhpc` is fast.
_BY_MODULE = {
    "postproc.accessor": ("open",),
    "postproc.measured.measured": ("measured",),
    "postproc.signals.sensors": ("Sensor", "sense"),
    "rubhpc.branch": ("branch",),
    "rubhpc.errors": ("InputError", "NoPeriodicMotion", "RubError", "StoppedEarly", "StoreError"),
    "rubhpc.fem.assemble": ("assemble",),
    "rubhpc.fem.dry_whirl": ("dry_whirl",),
    "rubhpc.fem.linear_design": ("linear_design",),
    "rubhpc.identification.identify": ("Identification", "identify"),
    "rubhpc.integrate.branches.branch": ("Branch",),
    "rubhpc.integrate.periodic_motion": ("PeriodicMotion",),
    "rubhpc.integrate.record": ("Record", "State"),
    "rubhpc.knocks": ("least_knock",),
    "rubhpc.periodic": ("periodic",),
    "rubhpc.rig.carriers": ("Carrier", "MatrixCarrier"),
    "rubhpc.rig.probes": ("Probe",),
    "rubhpc.rig.reading": ("read_rig",),
    "rubhpc.rig.rig": ("Rig",),
    "rubhpc.rig.rotors": ("Harmonic", "Load", "Unbalance"),
    "rubhpc.rig.stators": ("Bore", "LumpedStator", "MatrixStator", "Stator"),
    "rubhpc.run_up": ("run_up",),
    "rubhpc.running.driver": ("run",),
    "rubhpc.simulate": ("simulate",),
    "rubhpc.storage.summary": ("Summary",),
    "rubhpc.study.study": ("Study", "read_study"),
    "rubhpc.whirl_simulations": ("certify_whirl",),
}
_HOMES = {name: module for module, names in _BY_MODULE.items() for name in names}
__all__ = sorted(_HOMES)

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
    value = getattr(import_module(_HOMES[name]), name)
    setattr(sys.modules[__name__], name, value)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
