"""Draws annular.png: rings of stators against the closed form, and backward whirl. Takes some minutes."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

import rubhpc
from postproc.figures.drawing import COLUMN_WIDTH, house_style, save
from rubhpc.fem.annular import annular_rub

PACKAGED = rubhpc.read_rig("mokhtar2017")
RUB = {"speed_ratio": 1.5, "clearance_ratio": 0.8, "revolutions": 4, "model": "mokhtar2017"}
COUNTS = {12e9: (3, 4, 6, 8, 12, 16, 24, 32), 1e9: (3, 4, 6, 8, 12, 16)}


def ring(count: int, modulus: float) -> rubhpc.Rig:
    """Return the packaged rotor in a ring; all rings of one modulus are as stiff and as heavy together."""
    one = PACKAGED.stator[0]
    shared = {"youngs_modulus": modulus / count, "density": 4600.0 / count}
    return replace(PACKAGED, stator=(replace(one, count=count, **shared),))


def circle(ax, radius: float, **style: object) -> None:
    """Add a circle in um."""
    angle = np.linspace(0, 2 * math.pi, 400)
    ax.plot(1e6 * radius * np.sin(angle), 1e6 * radius * np.cos(angle), **style)


def draw() -> None:
    """Draw and save the figure."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with house_style():
        figure = Figure(figsize=(2 * COLUMN_WIDTH, 0.72 * COLUMN_WIDTH), layout="constrained")
        FigureCanvasAgg(figure)
        errors, forward, backward = figure.subplots(1, 3, width_ratios=(1.15, 1, 1))
        for modulus, marker, name in ((12e9, "o", "12 GPa"), (1e9, "s", "1 GPa")):
            error = []
            for count in COUNTS[modulus]:
                record = rubhpc.simulate(ring(count, modulus), friction=0.05, transient=60, **RUB)
                model = rubhpc.assemble(ring(count, modulus))
                known = annular_rub(model, record.spin_speed, record.clearance, 0.05)
                radius = np.hypot(record.vertical, record.horizontal)
                error.append(abs(radius.mean() / known.radius - 1))
                if modulus == 12e9 and count in (3, 4, 24):
                    forward.plot(1e6 * record.horizontal, 1e6 * record.vertical, label=f"{count} stators")
                print(count, name, f"{known.radius:.6g} m, off by {error[-1]:.2g}")
            errors.loglog(COUNTS[modulus], error, marker=marker, label=f"{name} in all")
        errors.set(xlabel="Stators in the ring", ylabel="Relative error of the orbit's radius")
        errors.set_xticks(COUNTS[12e9], [str(count) for count in COUNTS[12e9]])
        errors.minorticks_off()
        errors.legend()
        circle(forward, known_radius(), color="k", ls=":", lw=0.8, label="closed form")
        circle(forward, record.clearance, color="0.6", lw=0.8)
        forward.legend(loc="upper center", bbox_to_anchor=(0.5, -0.22), ncols=2)

        dry = rubhpc.simulate(ring(8, 12e9), friction=0.3, transient=0, **RUB)
        orbit = 1e6 * (dry.vertical + 1j * dry.horizontal)
        for turn, shade in enumerate(("0.75", "0.5", "C0", "C1")):
            part = orbit[256 * turn : 256 * (turn + 1) + 1]
            backward.plot(part.imag, part.real, color=shade, label=f"revolution {turn + 1}")
            for at in (part.size // 3,):
                step = part[at + 3] - part[at]
                arrow = {"arrowstyle": "->", "color": shade, "lw": 1.2}
                tip = part[at] + 30 * step / abs(step)
                backward.annotate("", (tip.imag, tip.real), (part[at].imag, part[at].real), arrowprops=arrow)
        circle(backward, dry.clearance, color="0.6", lw=0.8)
        backward.legend(loc="upper center", bbox_to_anchor=(0.5, -0.22), ncols=2)
        for ax, title in (
            (errors, "(a)"),
            (forward, "(b) friction 0.05"),
            (backward, "(c) friction 0.3, 8 stators"),
        ):
            ax.set_title(title, loc="left")
            if ax is not errors:
                ax.set(xlabel="Horizontal (µm)", ylabel="Vertical (µm)", aspect="equal")
        save(figure, Path(__file__).with_name("annular.png"))


def known_radius() -> float:
    """Return the orbit radius of the stiffer ring in closed form, m."""
    record = rubhpc.simulate(ring(3, 12e9), friction=0.05, transient=1, **RUB)
    model = rubhpc.assemble(ring(24, 12e9))
    return annular_rub(model, record.spin_speed, record.clearance, 0.05).radius


if __name__ == "__main__":
    draw()
