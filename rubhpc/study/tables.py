"""How a study is computed: its tables [contact], [integrator], [record] and [run]."""

from __future__ import annotations

from dataclasses import dataclass

from rubhpc.input.fields import FieldError, check_fields, choice, choices, count, quantity
from rubhpc.schema import KEEPABLE

AUTO = "auto"  # transient until the motion has settled
LONGEST_TRANSIENT, SETTLED_WITHIN = 240, 1e-4  # then
PAPER_STEP = 0.5e-6  # s
SAFE_SHARE = 0.9  # of the stability limit
BLIND_STEP = 1e-6  # s, of the modal scheme with the fixed normal
TURNING_STEP = 0.25e-6  # s, with the updated one, set-valued friction or a penalty


@dataclass(frozen=True, kw_only=True)
class Contact:
    """Laws of contact and friction, and which way the normal points.

    Attributes
    ----------
    law : {"lagrange", "penalty"}
        Gaps closed exactly, by multipliers; or the conventional spring and damper in the closed gap.
    stiffness, damping : float, N/m and N s/m
        Of the penalty.
    restitution : float
        Normal velocity after an impact over that before it, 0 to 1. Default: none, the gap is closed at once.
    friction_law : {"sliding", "coulomb"}
        Steady sliding, in the sense of the spin; or set-valued, with stick and reversal of the slip.
    static_friction_ratio : float
        Coefficient of friction at rest over that in sliding, 1 or more. Default 1.
    normal : {"fixed", "updated"}
        Along the stator's axis, or along the line of centres.
    """

    law: str = choice(of=("lagrange", "penalty"), default="lagrange")
    stiffness: float | None = quantity("N/m", default=None, above=0)
    damping: float | None = quantity("N*s/m", default=None, at_least=0)
    restitution: float | None = quantity("", default=None, at_least=0)
    friction_law: str = choice(of=("sliding", "coulomb"), default="sliding")
    static_friction_ratio: float | None = quantity("", default=None, at_least=1)
    normal: str = choice(of=("fixed", "updated"), default="fixed")

    def __post_init__(self) -> None:
        check_fields(self)
        if self.law == "penalty":
            if self.stiffness is None:
                raise FieldError("stiffness", "missing; a penalty needs one, such as stiffness = 1e8")
            if self.restitution is not None:
                problem = "a penalty's rebound comes from its spring and damper; leave it out"
                raise FieldError("restitution", problem)
        for key in ("stiffness", "damping"):
            if self.law == "lagrange" and getattr(self, key) is not None:
                raise FieldError(key, 'a multiplier has none; take law = "penalty", or leave it out')
        if self.restitution is not None and self.restitution > 1:
            raise FieldError("restitution", f"{self.restitution:g} is out of range; it must be at most 1")
        if self.static_friction_ratio is not None and self.friction_law != "coulomb":
            problem = 'steady sliding never sticks; take friction_law = "coulomb", or leave it out'
            raise FieldError("static_friction_ratio", problem)

    @property
    def is_stepped(self) -> bool:
        """Whether closed contacts may have no closed form, so that the modal scheme takes short steps."""
        return self.normal == "updated" or self.law == "penalty" or self.friction_law == "coulomb"


@dataclass(frozen=True, kw_only=True)
class Integrator:
    """Scheme, time step and accuracy.

    Without a step the modal scheme takes 1 us in contact (0.25 us with the updated normal, set-valued
    friction or a penalty), the central difference 0.5 us, or 0.9 of the stability limit where that is less.
    The accuracy (relative) sets how many modes the modal scheme keeps.
    """

    method: str = choice(of=("modal", "central-difference"), default="modal")
    step: float | None = quantity("s", default=None, above=0)
    accuracy: float = quantity("", default=1e-3, above=0, below=1)

    def __post_init__(self) -> None:
        check_fields(self)

    def contact_step(self, contact: Contact) -> float:
        """Step in contact, s, of the modal scheme."""
        if self.step is not None:
            return self.step
        return TURNING_STEP if contact.is_stepped else BLIND_STEP

    def step_within(self, limit: float) -> float:
        """Time step, s, of the central difference for matrices that are stable up to `limit`, s."""
        return self.step if self.step is not None else min(PAPER_STEP, SAFE_SHARE * limit)


@dataclass(frozen=True, kw_only=True)
class Recording:
    """How long a case runs, in revolutions, and what is kept of it."""

    transient: int | str = count(default=120, at_least=0, at_most=1_000_000, or_word=AUTO)
    transient_limit: int | None = count(default=None, at_most=1_000_000)  # with "auto": 240
    transient_tolerance: float | None = quantity("", default=None, above=0, below=1)  # with "auto": 1e-4
    revolutions: int = count(default=64, at_most=100_000)
    samples_per_revolution: int = count(default=256, at_least=16, at_most=65_536)
    keep: tuple[str, ...] = choices(of=KEEPABLE, default=KEEPABLE)

    def __post_init__(self) -> None:
        check_fields(self)
        if self.samples_per_revolution % 2:
            problem = f"{self.samples_per_revolution} is odd; give an even number such as 256"
            raise FieldError("samples_per_revolution", problem)
        for key in ("transient_limit", "transient_tolerance"):
            if self.transient != AUTO and getattr(self, key) is not None:
                raise FieldError(key, f'it goes with transient = "{AUTO}"; leave it out, or set that')

    @property
    def is_transient_auto(self) -> bool:
        """Whether the transient ends where the motion has settled."""
        return self.transient == AUTO

    @property
    def longest_transient(self) -> int:
        """Revolutions thrown away at most."""
        if isinstance(self.transient, str):
            return LONGEST_TRANSIENT if self.transient_limit is None else self.transient_limit
        return self.transient

    @property
    def settled_within(self) -> float:
        """Share of a signal's largest value by which cycles may differ for the motion to have settled."""
        return SETTLED_WITHIN if self.transient_tolerance is None else self.transient_tolerance


@dataclass(frozen=True, kw_only=True)
class Sample:
    """How the cases of a sampled study are drawn from the ranges of its grid.

    Attributes
    ----------
    method : {"sobol"}
        Saltelli's design of Sobol' points, for Sobol indices of the first and total order.
    n : int
        Base points, a power of two; with d ranges they make n (d + 2) cases.
    seed : int
        Of the scrambling; with the same seed a larger n goes on where a smaller one ended.
    """

    method: str = choice(of=("sobol",), default="sobol")
    n: int = count(at_least=8, at_most=2**20)
    seed: int = count(default=1, at_least=0)

    def __post_init__(self) -> None:
        check_fields(self)
        if self.n & (self.n - 1):
            near = 2 ** self.n.bit_length()
            problem = f"{self.n} is no power of two, without which Sobol' points lose their balance"
            raise FieldError("n", f"{problem}; write {near // 2} or {near}")


@dataclass(frozen=True, kw_only=True)
class Run:
    """How the study is run; nothing here changes results."""

    block: int | None = count(default=None, at_most=1_000_000)  # cases per work unit and stored chunk
    time_limit: float | None = quantity("s", default=None, above=0)
    case_time_limit: float | None = quantity("s", default=None, above=0)
    max_failures: int | None = count(default=None, at_least=0)

    def __post_init__(self) -> None:
        check_fields(self)
