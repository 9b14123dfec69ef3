"""How a study is computed: its tables [integrator], [record], [sample] and [run]."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from rubhpc.errors import InputError
from rubhpc.input.fields import FieldError, check_fields, choice, choices, count, quantity, table
from rubhpc.input.reading import plain
from rubhpc.rig.probes import Probe  # noqa: TC001 - annotations are read when a table is built
from rubhpc.schema import KEEPABLE, KEPT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubhpc.rig.stators import AnyStator
    from rubhpc.study.contact_keys import Contact

# Transient until the motion has settled, is solved for, or is one of those solved for all starts.
AUTO, DIRECT = "auto", "direct"
LONGEST_TRANSIENT, SETTLED_WITHIN = 240, 1e-4  # then
PAPER_STEP = 0.5e-6  # s
SAFE_SHARE = 0.9  # of the stability limit
SEARCH_STEP = 1e-6  # s, of the modal scheme with the fixed normal
SALTELLI, FEWEST_POINTS = "sobol", 8  # the design that Sobol' indices need
_IN_SEQUENCE = ("sobol-sequence", "random")  # methods that draw one point after the other


@dataclass(frozen=True, kw_only=True)
class Integrator:
    """Scheme, time step and accuracy.

    The step is that of the central difference, by default 0.5 us, or 0.9 of the stability limit where that is
    less. The modal scheme looks for events in steps up to it without a bound, by default 1 us; collocation
    has no use for it. The accuracy is the relative error of each signal and force by modes that the modal
    scheme leaves out, and by the steps of collocation.
    """

    method: str = choice(
        doc="Time integration scheme.",
        example='"central-difference"',
        of=("modal", "central-difference"),
        default="modal",
    )
    step: float | None = quantity(
        "s",
        doc="Time step (central-difference), or the longest step of the search for events without a bound "
        "(modal).",
        default=None,
        at_least=1e-9,  # of a thousandth of it no case would see its end
    )
    accuracy: float = quantity(
        "",
        doc="Relative error of signals and forces (modal): of omitted modes, and of steps of collocation.",
        example="1e-3",
        default=1e-3,
        above=0,
        below=1,
    )

    def __post_init__(self) -> None:
        check_fields(self)

    def step_within(self, limit: float) -> float:
        """Time step, s, of the central difference for matrices that are stable up to `limit`, s."""
        return self.step if self.step is not None else min(PAPER_STEP, SAFE_SHARE * limit)


def check_method(
    contact: Contact, integrator: Integrator, *, is_bent: bool = False, stators: Sequence[AnyStator] = ()
) -> None:
    """Refuse what the central difference does not know, such as second-order stators, bores and Hertz's law.

    A bore is refused with the fixed normal too.
    """
    bore = next((i for i, stator in enumerate(stators, 1) if stator.is_bore), None)
    if bore is not None and contact.normal == "fixed":
        problem = f"stator.{bore} is a bore, whose contact point moves around"
        raise InputError(f'[contact] normal: {problem}; set normal = "updated"')
    if integrator.method == "modal":
        return
    for i, stator in enumerate(stators, 1):
        if stator.has_own_contact:
            problem = f"stator.{i} is a bore, or has a law or friction_factor of its own"
            raise InputError(
                f'[integrator] method: {integrator.method} needs one law: {problem}; use "modal"'
            )
    if is_bent:
        problem = f"{integrator.method} needs stators of linear geometry"
        fix = 'add [contact] model = "mokhtar2017", or [override] "stator.geometry" = "linear"'
        raise InputError(f"[integrator] method: {problem}; {fix}")
    if contact.law == "hertz":
        problem = f'{integrator.method} does not know law = "hertz"'
        raise InputError(f'[integrator] method: {problem}; set law = "penalty", or method = "modal"')


@dataclass(frozen=True, kw_only=True)
class Recording:
    """How long a case runs, in revolutions, and what is kept of it."""

    transient: int | str = count(
        doc='Revolutions discarded; "auto" until the motion has settled, "direct" until it approaches a '
        "periodic motion that is solved for.",
        example='"auto"',
        default=120,
        at_least=0,
        at_most=1_000_000,
        or_words=(AUTO, DIRECT),
        gone={"shared": f'"shared" is gone: write transient = "{DIRECT}"'},
    )
    transient_limit: int | None = count(
        doc='Most revolutions discarded with transient = "auto" or "direct"; by default 240.',
        example="480",
        default=None,
        at_most=1_000_000,
    )
    transient_tolerance: float | None = quantity(
        "",
        doc='Relative difference between settled cycles with transient = "auto"; by default 1e-4.',
        example="1e-5",
        default=None,
        above=0,
        below=1,
    )
    revolutions: int = count(doc="Revolutions recorded.", example="64", default=64, at_most=100_000)
    samples_per_revolution: int = count(
        doc="Samples per revolution, an even number.", example="256", default=256, at_least=16, at_most=65_536
    )
    keep: tuple[str, ...] = choices(
        doc="What is kept of each case besides its measures.",
        example='["spectrum", "section"]',
        of=KEEPABLE,
        default=KEPT,
    )
    lyapunov: int = count(
        doc="Lyapunov exponents measured by the exact tangent map over 256 revolutions after the record.",
        example="3",
        default=0,
        at_least=0,
        at_most=64,
    )
    probe: tuple[Probe, ...] = table(doc="Sensors: what else is measured, and where.", default=(), added=True)

    def __post_init__(self) -> None:
        check_fields(self)
        if self.samples_per_revolution % 2:
            problem = f"{self.samples_per_revolution} is odd; give an even number such as 256"
            raise FieldError("samples_per_revolution", problem)
        for key in ("transient_limit", "transient_tolerance"):
            if isinstance(self.transient, int) and getattr(self, key) is not None:
                raise FieldError(key, f'has no effect without transient = "{AUTO}"; leave it out or set it')
        names = [probe.name for probe in self.probe]
        for i, name in enumerate(names, 1):
            if name in names[: i - 1]:
                raise FieldError(f"probe.{i}.name", f'"{name}" is another probe already; choose another name')

    def as_dict(self) -> dict[str, Any]:
        """Return the keys for JSON; probes and exponents only where there are any: older stores have none."""
        keys = asdict(self)
        del keys["probe"]
        if not self.lyapunov:
            del keys["lyapunov"]
        return keys | ({"probe": [plain(probe) for probe in self.probe]} if self.probe else {})

    @property
    def probed(self) -> tuple[tuple[str, str], ...]:
        """Name and quantity of each probe, of which those of its variables are made."""
        return tuple((probe.name, probe.quantity) for probe in self.probe)

    @property
    def is_transient_auto(self) -> bool:
        """Whether the transient ends where the motion has settled."""
        return isinstance(self.transient, str)  # of the others, where nothing is solved for

    @property
    def is_transient_direct(self) -> bool:
        """Whether the transient ends where the periodic motion that follows is solved for."""
        return self.transient == DIRECT

    @property
    def longest_transient(self) -> int:
        """Most revolutions that are discarded."""
        if isinstance(self.transient, str):
            return LONGEST_TRANSIENT if self.transient_limit is None else self.transient_limit
        return self.transient

    @property
    def settled_within(self) -> float:
        """Share of a signal's largest value by which cycles may differ for the motion to have settled."""
        return SETTLED_WITHIN if self.transient_tolerance is None else self.transient_tolerance


@dataclass(frozen=True, kw_only=True)
class Sample:
    """How the cases of a sampled study are drawn from the ranges of its grid."""

    method: str = choice(
        doc="Saltelli's design of Sobol' points, a Sobol' sequence, a Latin hypercube, or random points.",
        example='"sobol"',
        of=(SALTELLI, "sobol-sequence", "lhs", "random"),
        default=SALTELLI,
    )
    n: int = count(
        doc="Number of cases; with sobol of base points, a power of two: d ranges make n (d + 2) cases.",
        example="1024",
        at_least=1,
        at_most=2**20,
    )
    seed: int = count(
        doc="Seed; a larger n with the same seed continues the sample, except with a Latin hypercube.",
        example="1",
        default=1,
        at_least=0,
    )
    rub_share: float | None = quantity(
        "",
        doc="Share of cases whose contact-free motion would reach a stator; for sobol-sequence and random.",
        example="0.5",
        default=None,
        above=0,
        below=1,
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if self.is_saltelli and self.n < FEWEST_POINTS:
            problem = f"{self.n} is out of range; it must be at least {FEWEST_POINTS}"
            raise FieldError("n", f'{problem}, or set method = "sobol-sequence"')
        if self.is_saltelli and self.n & (self.n - 1):
            near = 2 ** self.n.bit_length()
            problem = f"{self.n} is not a power of two, without which Sobol' points lose their balance"
            fix = f'write {near // 2} or {near}, or set method = "sobol-sequence"'
            raise FieldError("n", f"{problem}; {fix}")

        if self.rub_share is not None and self.method not in _IN_SEQUENCE:
            fix = 'set method = "sobol-sequence" or "random"'
            raise FieldError("rub_share", f"has no effect on the points of {self.method}; {fix}")

    def as_dict(self) -> dict[str, Any]:
        """Return the keys for JSON; `rub_share` only where it is given: older stores have none."""
        return {key: value for key, value in asdict(self).items() if value is not None}

    @property
    def is_saltelli(self) -> bool:
        """Whether the cases are those that Sobol' indices need."""
        return self.method == SALTELLI

    @property
    def can_grow(self) -> bool:
        """Whether a larger n keeps the cases of a smaller one."""
        return self.method != "lhs"


@dataclass(frozen=True, kw_only=True)
class Run:
    """How the study is run; nothing here changes results."""

    block: int | None = count(
        doc="Cases per work unit and per stored chunk; by default chosen from the number of cases.",
        example="16",
        default=None,
        at_most=1_000_000,
    )
    time_limit: float | None = quantity(
        "s", doc="Time after which the run stops and can be resumed.", example='"2 h"', default=None, above=0
    )
    case_time_limit: float | None = quantity(
        "s", doc="Time after which a case fails.", example='"10 min"', default=None, above=0
    )
    max_failures: int | None = count(
        doc="Failed cases after which the run stops.", example="100", default=None, at_least=0
    )

    def __post_init__(self) -> None:
        check_fields(self)
