"""Set-ups of cases as tests of the closed form have them: fixed normal and sliding unless given."""

from closed_form import Contact

from rubhpc.integrate.setup import prepare
from rubhpc.study.study import Integrator


def prepared(rig, speed, *, samples=64, contact=None, method="modal", step=None, accuracy=1e-3, **given):
    """The set-up of a rig at a speed (rad/s), with `samples` a revolution.

    `given` are keys of `Contact` where it is None, and `probes` and `model` of `prepare`.
    """
    others = {name: given.pop(name) for name in ("probes", "model") if name in given}
    return prepare(
        rig,
        speed,
        contact=contact or Contact(**given),
        integrator=Integrator(method=method, step=step, accuracy=accuracy),
        samples_per_revolution=samples,
        **others,
    )
