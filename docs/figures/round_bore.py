"""Draws the figures of docs/validation/round_bore.md, and prints its table. Takes half a minute."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from scipy.linalg import expm
from scipy.optimize import brentq, minimize_scalar

import rubhpc
from postproc.figures.drawing import COLUMN_WIDTH, house_style, save
from rubhpc.fem.whirl_balance import SLIPPING
from rubhpc.integrate.record import State
from rubhpc.rig.normal_law import NormalLaw

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.axes import Axes

# In units of the rotor's mass, the stiffness of the ring and the eccentricity; frequencies in PACE.
SHAFT, DAMPING, GAP = 0.04, 0.1, 1.05
MASS, STIFFNESS, LENGTH = 1.0, 1e6, 1e-4  # kg, N/m, m
PACE = math.sqrt(STIFFNESS / MASS)  # rad/s
HOLE = 1e-3  # mass of the hole on springs, in these units
FRICTIONS = (0.0, 0.05, 0.1, 0.2)
RING = {"law": "penalty", "stiffness": STIFFNESS}
SHORT = {"keep": (), "samples_per_revolution": 64}
GRAVITY = 9.81
FINE = 8192  # samples of a hundredth of a second


def jeffcott(*bores: rubhpc.Bore, eccentricity: float = 1.0) -> rubhpc.Rig:
    """Return the disc on a spring and damper, by default in a rigid bore."""
    return rubhpc.Rig.from_matrices(
        MASS * np.eye(2),
        DAMPING * math.sqrt(STIFFNESS * MASS) * np.eye(2),
        SHAFT * STIFFNESS * np.eye(2),
        degrees=[(1, "v"), (1, "w")],
        stators=bores or [rubhpc.Bore(node=1, rigid=True, radius=0.05)],
        unbalance=[rubhpc.Unbalance(node=1, mass=MASS, radius=LENGTH * eccentricity)],
    )


def on_springs() -> rubhpc.Rig:
    """Return the disc in a light hole on springs, which friction pushes sideways as well."""
    return jeffcott(rubhpc.Bore(node=1, mass=HOLE * MASS, stiffness=STIFFNESS, damping=0.0, radius=0.05))


def rim(w: float) -> complex:
    """Receptance of the disc at a signed frequency."""
    return 1.0 / (SHAFT - w * w + 1j * DAMPING * w)


def circling(w: float, radius: complex, hole: complex | None = None, overlap: float = 0.0) -> State:
    """Return the state of circles of disc and hole with the frequency w, at angle 0."""

    def at(centre: complex | None, pace: complex) -> np.ndarray:
        return (
            np.array([])
            if centre is None
            else LENGTH * np.array([(pace * centre).real, (pace * centre).imag])
        )

    return State(
        rotor_displacement=at(radius, 1.0),
        rotor_velocity=at(radius, 1j * w * PACE),
        stator_displacement=(at(hole, 1.0),),
        stator_velocity=(at(hole, 1j * w * PACE),),
        contact_force=STIFFNESS * LENGTH * np.array([overlap]),
        overlap=LENGTH * np.array([overlap]),
    )


# Closed forms ------------------------------------------------------------------------------------------


def imbalance(radius: float, w: float, friction: float) -> float:
    """Zero at a synchronous rub of this radius in the ring that gives way along its normal."""
    pressed = 1.0 - GAP / radius
    turned = (SHAFT + pressed - w * w) ** 2 + (DAMPING * w + friction * pressed) ** 2
    return turned - w**4 / radius**2


def fold_along_the_normal(friction: float) -> float:
    """Return the highest speed of a synchronous rub of that ring."""

    def least(w: float) -> float:
        found = minimize_scalar(
            imbalance, args=(w, friction), bounds=(1.5, 6.0), method="bounded", options={"xatol": 1e-10}
        )
        return float(found.fun)

    return float(brentq(least, 0.9, 1.1, xtol=1e-12))


def fold_on_springs(friction: float) -> float:
    """Return the same of the hole on springs, where both roots of the contact force meet."""

    def turned(w: float) -> complex:
        return (rim(w) + 1.0 / (1.0 - HOLE * w * w)) * (1 + 1j * friction)

    def discriminant(w: float) -> float:
        return (GAP * turned(w).real) ** 2 - abs(turned(w)) ** 2 * (GAP**2 - (abs(rim(w)) * w * w) ** 2)

    pulls = brentq(lambda w: turned(w).real, 0.9, 1.2)
    return float(brentq(discriminant, pulls - 0.03, pulls, xtol=1e-12))


def largest_exponent(w: float, friction: float) -> complex:
    """Return the exponent of a small change of the rub with the largest radius, in the turning frame."""
    at = np.linspace(GAP, 6.0, 4001)
    signs = np.flatnonzero(np.diff(np.sign(imbalance(at, w, friction))))[-1]
    pressed = 1.0 - GAP / brentq(imbalance, at[signs], at[signs + 1], (w, friction))
    along, across = [1.0, DAMPING, SHAFT - w * w + 1.0], [1.0, DAMPING, SHAFT - w * w + pressed]
    first = [2 * w, DAMPING * w + friction * pressed]
    second = [2 * w, DAMPING * w + friction]
    roots = np.roots(np.polyadd(np.polymul(along, across), np.polymul(first, second)))
    return complex(roots[roots.real.argmax()])


def hopf(friction: float) -> float:
    """Return the speed at which the synchronous rub becomes unstable to backward whirl."""
    return float(brentq(lambda w: largest_exponent(w, friction).real, 0.2, 0.4))


def friction_needed(w: np.ndarray, springs: float) -> np.ndarray:
    """Return |Im / Re| of the receptance of backward whirl, NaN where it cannot press.

    `springs` is the compliance of the hole in the direction of the friction, 0 or 1.
    """
    if springs:
        both = rim(w) + 1.0
        return np.where(both.real < 0, abs(both.imag / both.real), np.nan)
    # a ring that gives way along the normal: N / rho = m w^2 - k, up to its stiffness
    pressed = w * w - SHAFT
    return np.where((pressed > 0) & (pressed < 1), DAMPING * w / pressed, np.nan)


# Figures -----------------------------------------------------------------------------------------------


class Table:
    """Rows of known and computed values."""

    def __init__(self) -> None:
        print("| | known | computed | relative error |\n|---|---|---|---|")

    def row(self, name: str, known: float, computed: float) -> None:
        """Print a row."""
        print(f"| {name} | {known:.6g} | {computed:.6g} | {abs(computed / known - 1):.1e} |", flush=True)


def follow(rig: rubhpc.Rig, friction: float, start: float, stop: float, step: float, **options: object):
    """Return the branch of synchronous rubs from a speed on."""
    options = {"clearance": GAP * LENGTH, "friction": friction, "doublings": 0, **SHORT, **options}
    return rubhpc.branch(
        rig, along="speed", start=start * PACE, stop=stop * PACE, largest_step=step * PACE, **options
    )[0]


def event(found: object, name: str) -> float:
    """Return the speed of the first event of this name."""
    return next(at for event, at in found.events() if event == name) / PACE


def rub(table: Table) -> Figure:
    """Synchronous rub: amplitude, upper fold and loss of stability."""
    figure, (left, middle, right) = new_figure(3)
    speed = np.linspace(0.15, 1.03, 441)
    radius = np.linspace(GAP, 6.2, 516)
    folds = []
    for i, friction in enumerate(FRICTIONS):
        colour = f"C{i}"
        value = imbalance(radius[:, None], speed[None, :], friction)
        left.contour(speed, radius, value, levels=[0.0], colors=colour, linewidths=0.7)
        found = follow(jeffcott(), friction, 0.2, 1.03, 0.03, **RING)
        size = np.array([np.hypot(*p.state.rotor_displacement) for p in found.points]) / LENGTH
        at, is_rub = found.values / PACE, size > GAP * 1.001
        for is_kind, face in ((found.is_stable, colour), (~found.is_stable, "white")):
            left.plot(
                at[is_rub & is_kind], size[is_rub & is_kind], "o", color=colour, mfc=face, ms=2.5, mew=0.5
            )
        left.plot([], [], "o-", color=colour, ms=2.5, label=f"{friction:g}")
        folds.append(event(found, "fold"))
        table.row(f"upper fold, friction {friction:g}", fold_along_the_normal(friction), folds[-1])
    left.set(xlabel="Speed", ylabel="Radius of the orbit", xlim=(0.15, 1.03), ylim=(0.8, 6.2))
    left.legend(title="friction", loc="upper left")

    friction = np.linspace(0, 0.25, 26)
    middle.plot(friction, [fold_along_the_normal(f) for f in friction], label="yields along the normal")
    middle.plot(FRICTIONS, folds, "o", color="C0")
    middle.plot(friction, [fold_on_springs(f) for f in friction], "C1", label="on springs")
    others = []
    for f in FRICTIONS:
        start = fold_on_springs(f) - 0.03
        turned = (rim(start) + 1.0 / (1.0 - HOLE * start**2)) * (1 + 1j * f)
        free = start * start * rim(start)
        force = max(np.roots([abs(turned) ** 2, 2 * GAP * turned.real, GAP**2 - abs(free) ** 2]).real)
        direction = free / (GAP + turned * force)
        push = (1 + 1j * f) * force * direction
        begun = circling(start, free - rim(start) * push, push / (1.0 - HOLE * start**2))
        found = follow(on_springs(), f, start, 1.03, 0.01, initial=begun)
        others.append(event(found, "fold"))
        table.row(f"upper fold, on springs, friction {f:g}", fold_on_springs(f), others[-1])
    middle.plot(FRICTIONS, others, "s", color="C1")
    middle.set(xlabel="Friction", ylabel="Speed of the upper fold", ylim=(0.972, 1.015))
    middle.legend(title="ring", loc="upper right")

    found = follow(jeffcott(), 0.2, 0.24, 0.34, 0.005, **RING)
    speed = np.linspace(0.24, 0.34, 101)
    known = [math.exp(2 * math.pi * largest_exponent(w, 0.2).real / w) for w in speed]
    largest = [abs(p.multipliers).max() for p in found.points]
    right.plot(speed, known, "C3")
    right.plot(found.values / PACE, largest, "o", color="C3")
    right.axhline(1.0, color="0.6", lw=0.6, ls=":")
    right.axvline(hopf(0.2), color="0.6", lw=0.6, ls=":")
    right.set(xlabel="Speed", ylabel="Largest multiplier, modulus", xlim=(0.24, 0.34))
    table.row("Hopf bifurcation, friction 0.2", hopf(0.2), event(found, "neimark_sacker"))
    return figure


def whirl(table: Table) -> Figure:
    """Dry whirl: frequency over the friction, growth from its orbit, and rolling."""
    figure, (left, middle, right) = new_figure(3)
    w = np.linspace(0.2, 1.1, 2000)
    names = ("yields along the normal", "on springs")
    light = rubhpc.Bore(node=1, mass=1e-7 * MASS, stiffness=STIFFNESS, damping=0.0, radius=1e3)
    rings = (
        rubhpc.Bore(node=1, rigid=True, radius=1e3, law=NormalLaw(kind="penalty", stiffness=STIFFNESS)),
        light,
    )
    at = [0.11, 0.13, 0.16, 0.2, 0.25, 0.28, 0.3, 0.35, 0.4]
    for i, (name, bore) in enumerate(zip(names, rings, strict=True)):
        left.plot(friction_needed(w, i), w, color=f"C{i}", label=name)
        found = rubhpc.dry_whirl(jeffcott(bore), [PACE], [GAP * LENGTH], at, most_frequency=1.1 * PACE)
        found = found.isel(whirl=np.flatnonzero(found.whirl_kind == SLIPPING))
        whirls = (found.whirl_friction.values, -found.whirl_frequency.values / PACE)
        left.plot(*whirls, "os"[i], color=f"C{i}", ms=2.5)
        least = float(np.nanmin(friction_needed(np.linspace(0.2, 1.1, 200001), i)))
        known = least if i else DAMPING * math.sqrt(1 + SHAFT)
        table.row(f"least friction of whip, {name}", known, found.least_friction.item())
        for f in (0.2, 0.3) if not i else (0.3,):
            for computed in np.sort(whirls[1][np.isclose(whirls[0], f)]):
                exact = brentq(lambda w: friction_needed(w, i) - f, computed - 0.01, computed + 0.01)  # noqa: B023
                table.row(f"frequency of whip, {name}, friction {f:g}", exact, computed)
    left.axvline(DAMPING * math.sqrt(1 + SHAFT), color="C0", ls=":", lw=0.6)
    left.axvline(0.27929, color="C1", ls=":", lw=0.6)
    left.set(xlabel="Friction", ylabel="Backward whirl frequency", xlim=(0.05, 0.42), ylim=(0.3, 1.1))
    left.legend(title="ring", loc="upper right")

    for i, (friction, label) in enumerate(((0.2, "0.2"), (0.3, "0.3"))):
        frequency = brentq(lambda w: friction * (w * w - SHAFT) - DAMPING * w, 0.3, 1.0)  # noqa: B023
        radius = GAP / (1.0 + SHAFT - frequency**2)
        for share in (0.995, 1.0, 1.005):
            record = rubhpc.simulate(
                jeffcott(eccentricity=0.0),
                speed=frequency * PACE,
                friction=friction,
                clearance=GAP * LENGTH,
                transient=0,
                revolutions=4,
                initial=circling(-frequency, share * radius + 0j, overlap=share * radius - GAP),
                samples_per_revolution=64,
                **RING,
            )
            orbit = np.hypot(record.vertical, record.horizontal) / LENGTH / radius
            turns = np.arange(orbit.size) / 64
            linear = near_whip(frequency, radius, friction, share - 1.0, turns)
            middle.plot(turns, linear, color=f"C{i}", label=label if share == 1 else None)
            middle.plot(turns[::16], orbit[::16], "o", color=f"C{i}", ms=2.5)
            if share == 1.0:
                table.row(f"radius of whip kept for four turns, friction {friction:g}", 1.0, orbit[-1])
    middle.set(xlabel="Turns of the whirl", ylabel="Radius over that of whip", xlim=(0, 4), ylim=(0.93, 1.07))
    middle.legend(title="friction", loc="upper left")
    rolling(right, table)
    return figure


def near_whip(w: float, radius: float, friction: float, away: float, turns: np.ndarray) -> np.ndarray:
    """Return the radius over that of whip, by the linear equations in the frame that turns with it."""
    spin, pressed = -w, 1.0 - GAP / radius
    along, across = SHAFT + 1.0 - w * w, SHAFT + pressed - w * w
    turned, pushed = DAMPING * spin + friction * pressed, DAMPING * spin + friction
    matrix = np.array(
        [
            [0, 0, 1, 0],
            [0, 0, 0, 1],
            [-along, turned, -DAMPING, 2 * spin],
            [-pushed, -across, -2 * spin, -DAMPING],
        ]
    )
    return 1.0 + away * np.array([expm(matrix * 2 * math.pi * t / w)[0, 0] for t in turns])


def rolling(ax: Axes, table: Table) -> None:
    """Friction force over normal force of rolling around a hard rigid bore, over the speed."""
    radius = 1.6 * GAP  # of the rim
    spin = np.linspace(0.25, 0.8, 200)
    needed = abs(rim(-1.6 * spin).imag / rim(-1.6 * spin).real)
    ax.plot(spin, needed, "C2")
    ax.axhline(0.2, color="0.6", lw=0.6, ls=":")
    for at in (0.4, 0.5, 0.6, 0.7):
        frequency = -1.6 * at
        record = rubhpc.simulate(
            jeffcott(rubhpc.Bore(node=1, rigid=True, radius=radius * LENGTH), eccentricity=0.0),
            speed=at * PACE,
            friction=0.2,
            clearance=GAP * LENGTH,
            transient=0,
            revolutions=1,
            initial=circling(frequency, GAP + 0j),
            samples_per_revolution=64,
        )
        push = record.contact_force_vertical[0] + 1j * record.contact_force_horizontal[0]
        known = float(np.interp(at, spin, needed))
        middle = (np.arange(push.size) + 0.5) / 64 * 2 * math.pi * frequency / at  # forces are means
        along = -push * np.exp(-1j * middle)
        ratio = abs(np.mean(along.imag / along.real))
        ax.plot(at, ratio, "o", color="C2")
        table.row(
            f"whirl of rolling over the speed, speed {at:g}", 1.6, -record.whirl_frequency[0] / PACE / at
        )
        table.row(f"friction of rolling over normal force, speed {at:g}", known, ratio)
    ax.set(xlabel="Speed", ylabel="Friction over normal force", xlim=(0.25, 0.8), ylim=(0, 0.4))
    ax.text(0.79, 0.21, "coefficient of friction", ha="right", color="0.4", fontsize="small")


def falling(clearance: float, restitution: float, until: float, samples: int) -> rubhpc.Record:
    """Return the record of a disc that falls from the centre of a rigid bore; 100 turns a second."""
    rig = rubhpc.Rig.from_matrices(
        MASS * np.eye(2),
        np.zeros((2, 2)),
        np.zeros((2, 2)),
        degrees=[(1, "v"), (1, "w")],
        stators=[rubhpc.Bore(node=1, rigid=True, radius=0.1)],
        gravity=GRAVITY,
    )
    return rubhpc.simulate(
        rig,
        speed=2 * math.pi * 100,
        clearance=clearance,
        friction=0.0,
        restitution=restitution,
        transient=0,
        revolutions=math.ceil(until * 100),
        samples_per_revolution=samples,
        initial={"vertical": clearance},  # above where it rests
    )


def height(time: np.ndarray, clearance: float, restitution: float) -> np.ndarray:
    """Return the height of a point that falls and bounces, m."""
    first = math.sqrt(2 * clearance / GRAVITY)
    result = clearance - GRAVITY * time**2 / 2
    begin, rate = first, restitution * GRAVITY * first
    while rate > 1e-4 * GRAVITY * first:
        since = time - begin
        result = np.where(since > 0, rate * since - GRAVITY * since**2 / 2, result)
        begin, rate = begin + 2 * rate / GRAVITY, restitution * rate
    return np.where(time > begin, 0.0, result)


def drop(table: Table) -> Figure:
    """A disc that falls into a rigid bore: height over time, and when and how fast it touches."""
    figure, (left, right) = new_figure(2)
    for i, restitution in enumerate((0.5, 0.8)):
        record = falling(2.5e-4, restitution, 0.08, samples=FINE)
        time = np.arange(record.vertical.size) / FINE / 100
        fallen = 2.5e-4 + record.vertical
        known = height(time, 2.5e-4, restitution)
        left.plot(1e3 * time, 1e6 * known, color=f"C{i}", label=f"{restitution:g}")
        left.plot(1e3 * time[::768], 1e6 * fallen[::768], "o", color=f"C{i}", ms=2.5)
        first = 1e3 * math.sqrt(2 * 2.5e-4 / GRAVITY)
        again = (record.contact_force[0] > 0) & (1e3 * time > 1.1 * first)
        known_second = first * (1 + 2 * restitution)
        table.row(
            f"second touch, restitution {restitution:g}, ms", known_second, 1e3 * time[np.argmax(again)]
        )
    left.set(xlabel="Time (ms)", ylabel="Height over the bore (µm)", xlim=(0, 80), ylim=(0, 260))
    left.legend(title="restitution", loc="upper right")
    clearance = np.linspace(1e-5, 1.05e-3, 200)
    right.plot(1e3 * clearance, 1e3 * np.sqrt(2 * clearance / GRAVITY), "C2")
    for gap in (1e-4, 2.5e-4, 5e-4, 1e-3):
        record = falling(gap, 0.0, 0.02, samples=FINE)
        touch = float(np.argmax(record.contact_force[0] > 0)) / FINE / 100
        right.plot(1e3 * gap, 1e3 * touch, "o", color="C2")
        table.row(
            f"first touch, clearance {1e3 * gap:g} mm, ms", 1e3 * math.sqrt(2 * gap / GRAVITY), 1e3 * touch
        )
    right.set(xlabel="Clearance (mm)", ylabel="First touch (ms)", xlim=(0, 1.05), ylim=(0, 15))
    return figure


def new_figure(n: int) -> tuple[Figure, list[Axes]]:
    """Return a figure of two columns' width with `n` panels side by side."""
    figure = Figure(figsize=(2 * COLUMN_WIDTH, 0.72 * COLUMN_WIDTH), layout="constrained")
    FigureCanvasAgg(figure)
    axes = list(figure.subplots(1, n))
    for ax, letter in zip(axes, "abc", strict=False):
        ax.set_title(f"({letter})", loc="left")
    return figure, axes


def main() -> None:
    """Draw the figures and print the table."""
    table = Table()
    drawings: dict[str, Callable[[Table], Figure]] = {"rub": rub, "whirl": whirl, "drop": drop}
    with house_style():
        for name, draw in drawings.items():
            save(draw(table), Path(__file__).with_name(f"round_bore_{name}.png"))


if __name__ == "__main__":
    main()
