"""What ROSS 3 computes for a rotor on bearings that depend on the speed; run where ROSS 3 is installed.

A steel shaft of 1.2 m with three unlike discs, one of them overhung, on two bearings like fluid films and a
seal with negative direct stiffness. Written: matrices at one speed, tables, eigenvalues, unbalance response.
"""

import sys
import warnings

import numpy as np

warnings.filterwarnings("ignore")
import ross as rs  # noqa: E402

steel = rs.Material("steel210", rho=7800.0, E=210e9, G_s=79.6e9)
shaft = [rs.ShaftElement(0.1, 0.0, 0.05, material=steel) for _ in range(12)]
discs = [
    rs.DiskElement(n=4, m=20.0, Id=0.15, Ip=0.28),
    rs.DiskElement(n=7, m=25.0, Id=0.20, Ip=0.37),
    rs.DiskElement(n=12, m=9.0, Id=0.05, Ip=0.09),
]
speed = np.array([50.0, 120.0, 250.0, 420.0, 640.0, 900.0])
first = {
    "kxx": [9e6, 7e6, 6e6, 5.5e6, 5.3e6, 5.2e6],
    "kyy": [2.2e7, 1.8e7, 1.5e7, 1.3e7, 1.2e7, 1.15e7],
    "kxy": [1e6, 1.5e6, 2e6, 2.2e6, 2.6e6, 3e6],
    "kyx": [-4e6, -3e6, -2.7e6, -2.5e6, -2.6e6, -2.9e6],
    "cxx": [9e4, 4e4, 2.1e4, 1.3e4, 9e3, 7e3],
    "cyy": [1.6e5, 8e4, 4e4, 2.5e4, 1.8e4, 1.4e4],
    "cxy": [-2e4, -1e4, -6e3, -4e3, -3e3, -2.5e3],
    "cyx": [-2e4, -1e4, -6e3, -4e3, -3e3, -2.5e3],
}
second = {name: [1.4 * v for v in values] for name, values in first.items()}
second_speed = np.array([40.0, 130.0, 260.0, 400.0, 600.0, 950.0])
seal = {
    "kxx": [-2e5, -3e5, -5e5],
    "cxx": [300.0, 280.0, 250.0],
    "kxy": [1e5, 4e5, 9e5],
    "kyx": [-1e5, -4e5, -9e5],
}
seal_speed = np.array([0.0, 500.0, 1000.0])
bearings = [
    rs.BearingElement(n=0, speed=speed, **first),
    rs.BearingElement(n=10, speed=second_speed, **second),
    rs.SealElement(n=6, speed=seal_speed, **seal),
]
rotor = rs.Rotor(shaft, discs, bearings)

speeds = np.array([60.0, 97.3, 150.0, 201.7, 333.3, 420.0, 555.5, 700.0, 880.0])
campbell = [np.asarray(rotor.run_modal(float(w), num_modes=24, sparse=False).evalues) for w in speeds]
unbalance = ([4, 12], [0.002, 0.0005], [0.3, 1.9])  # node, kg m, rad
response = rotor.run_unbalance_response(*unbalance, speed_range=speeds)

at = 50.0  # any speed: only what is constant is taken from these matrices
kept = {}
for name, matrix in (("M", rotor.M(at)), ("C", rotor.C(at)), ("K", rotor.K(at)), ("G", rotor.G())):
    matrix = np.asarray(matrix)
    where = np.nonzero(matrix)
    kept[f"{name}_at"], kept[name] = np.array(where), matrix[where]
for i, bearing in enumerate(bearings):
    kept[f"bearing{i}_n"] = bearing.n
    kept[f"bearing{i}_speed"] = bearing.speed
    kept[f"bearing{i}_K"], kept[f"bearing{i}_C"] = np.asarray(bearing.K(at)), np.asarray(bearing.C(at))
    for name in [f"{letter}{p}" for letter in "kc" for p in ("xx", "xy", "yx", "yy")]:
        kept[f"bearing{i}_{name}"] = np.array(getattr(bearing, name), dtype=float)
print(rs.__version__, campbell[0][:6], np.abs(response.forced_resp).max())
n_value = min(len(values) for values in campbell)
np.savez_compressed(
    sys.argv[1],
    version=rs.__version__,
    at=at,
    length=rotor.L,
    n_dof=rotor.ndof,
    speeds=speeds,
    eigenvalues=np.array([values[:n_value] for values in campbell]),
    response=response.forced_resp,
    **kept,
)
