"""Records of the packaged machine as a data logger has them: healthy, misaligned, rubbing."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import rubhpc
from rubhpc.fem.assemble import assemble
from rubhpc.fem.response import harmonic_response, steady_response
from rubhpc.rig.reading import read_rig

if TYPE_CHECKING:
    from pathlib import Path

RATIO, FRICTION, CLEARANCE = 1.5, 0.3, 0.8
SPIN = 297.4417636260211  # rad/s
SIGNALS = {"vertical": ("v", "m"), "horizontal": ("w", "m"), "torsion": ("thx", "rad")}
STUDY = """rig = "mokhtar2017"
[grid]
clearance = { start = "120 um", stop = "150 um" }
friction = { start = 0.2, stop = 0.4 }
[contact]
model = "mokhtar2017"
[record]
revolutions = 12
"""


def linear(misaligned: bool, turns: int, noise: float, node: int = 1) -> dict[str, np.ndarray]:
    """Signals without contact, by the machine's matrices; with forces at a node and a torque at 2X."""
    model = assemble(read_rig("mokhtar2017"))
    lines = {1: steady_response(model, SPIN)}
    if misaligned:
        force = np.zeros(model.rotor.n_dof, complex)
        force[model.rotor.index(node, "v")], force[model.rotor.index(node, "w")] = 20.0, -12.0j
        force[next(i for i, (_, name) in enumerate(model.rotor.degrees) if name == "thx")] = 0.3
        lines[2] = harmonic_response(model, SPIN, 2, force)
    time = np.arange(int(turns * 2 * np.pi / SPIN * 10e3)) / 10e3
    rng = np.random.default_rng(5)
    columns = {"time": time}
    for name, (degree, _) in SIGNALS.items():
        row = model.rotor.index(8, degree)
        values = sum(np.real(c[row] * np.exp(1j * k * SPIN * time)) for k, c in lines.items())
        columns[name] = values + (noise * values.std() or 1e-6) * rng.standard_normal(time.size)
    return columns | {"key_phasor": np.where((SPIN * time) % (2 * np.pi) < 0.2, 5.0, 0.0)}


def rubbing(turns: int, noise: float) -> dict[str, np.ndarray]:
    """Signals of a rub by another scheme than the one that fits: central differences."""
    found = rubhpc.simulate(
        "mokhtar2017",
        speed_ratio=RATIO,
        clearance_ratio=CLEARANCE,
        friction=FRICTION,
        model="mokhtar2017",
        method="central-difference",
        transient=100,
        revolutions=turns,
    )
    signals = found.to_dataset()
    sensors = {name: rubhpc.Sensor(white=noise * float(signals[name].std())) for name in SIGNALS}
    seen = rubhpc.sense(signals, sensors, rate=200.37 * SPIN / (2 * np.pi), seed=3)
    return {"time": seen["time"].values, **{name: seen[name].values for name in (*SIGNALS, "key_phasor")}}


def write(folder: Path, columns: dict[str, np.ndarray], study: str = STUDY) -> tuple[Path, Path]:
    """Write the record with its TOML, and the study; returns the paths of the two TOML files."""
    table = np.column_stack(list(columns.values()))
    np.savetxt(folder / "probe.csv", table, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
    speed = 'column = "key_phasor"\nlevel = 2.5' if "key_phasor" in columns else f'value = "{SPIN} rad/s"'
    text = f'data = "probe.csv"\n[time]\ncolumn = "time"\n[speed]\n{speed}\n'
    text += "".join(f'[signal.{name}]\nunit = "{SIGNALS[name][1]}"\n' for name in SIGNALS if name in columns)
    measured, asked = folder / "probe.toml", folder / "study.toml"
    measured.write_text(text)
    asked.write_text(study)
    return measured, asked
