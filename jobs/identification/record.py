"""Record of a data logger of the paper's rub at r = 0.75, clearance ratio 0.85: two probes and an encoder.

    python jobs/identification/record.py probe

writes probe.csv and probe.toml: 64 revolutions with 5 % of noise, simulated by central differences.
"""

import sys
from pathlib import Path

import numpy as np

import rubhpc

NOISE = 0.05  # standard deviation over that of each signal
UNITS = {"vertical": "m", "horizontal": "m", "torsion": "rad"}

found = rubhpc.simulate(
    "mokhtar2017",
    speed_ratio=0.75,
    clearance_ratio=0.85,
    friction=0.3,
    model="mokhtar2017",
    method="central-difference",
    transient=400,
    revolutions=66,
)
case = found.to_dataset()
sensors = {name: rubhpc.Sensor(white=NOISE * float(case[name].std())) for name in UNITS}
rate = 200.37 * float(case["spin_speed"]) / (2 * np.pi)
name = sys.argv[1]
rubhpc.sense(case, sensors, rate=rate, seed=3).to_dataframe().to_csv(f"{name}.csv")
Path(f"{name}.toml").write_text(
    f'data = "{Path(name).name}.csv"\n[time]\ncolumn = "time"\n'
    '[speed]\ncolumn = "key_phasor"\nlevel = 2.5\nangle = 0\n'
    + "".join(f'[signal.{signal}]\nunit = "{unit}"\n' for signal, unit in UNITS.items())
)
print(f"clearance {1e6 * float(case['clearance']):.4g} um")
