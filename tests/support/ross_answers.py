"""A rotor of ROSS taken over by `Rig.from_ross`, against what ROSS computes of it."""

from __future__ import annotations

import math

import numpy as np

from rubhpc import Rig, Unbalance, assemble
from rubhpc.fem.assemble import model_at
from rubhpc.fem.modes import modes
from rubhpc.fem.response import steady_response


def differences(rotor, speeds, nodes, **given):
    """Largest relative difference of lateral eigenvalues, and of the response to unbalances at two nodes."""
    moments, phases = [0.002, 0.0005], [0.3, 1.9]
    # ROSS counts phases from x, a quarter turn before its y, which is up.
    of_nodes = zip(nodes, moments, phases, strict=True)
    unbalance = [Unbalance(node=n + 1, mass=m, radius=1.0, phase=p - math.pi / 2) for n, m, p in of_nodes]
    model = assemble(Rig.from_ross(rotor, unbalance=unbalance, **given))
    theirs = rotor.run_unbalance_response(nodes, moments, phases, np.array(speeds)).forced_resp
    of_values, of_response = 0.0, 0.0
    for column, speed in enumerate(speeds):
        values = np.asarray(rotor.run_modal(float(speed), num_modes=2 * rotor.ndof, sparse=False).evalues)
        found = [m for m in modes(model.rotor, speed) if m.kind == "lateral" and m.frequency > 1.0]
        for value in [m.eigenvalue for m in found if m.eigenvalue.imag > 0.0][:8]:
            of_values = max(of_values, np.abs(values - value).min() / abs(value))
        ours = steady_response(model_at(model, float(speed)), speed)
        for node in range(len(rotor.nodes)):
            v, w = (ours[model.rotor.index(node + 1, name)] for name in "vw")
            expected = np.array([theirs[6 * node + 1, column], -theirs[6 * node, column]])
            of_response = max(of_response, np.abs([v, w] - expected).max() / np.abs(expected).max())
    return of_values, of_response
