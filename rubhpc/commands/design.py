"""What `rubhpc modes` prints of a linear design: critical speeds, peaks and margins, sag, stability."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import click

from rubhpc.commands.options import plain_number

if TYPE_CHECKING:
    import xarray as xr

_RPM = 30 / math.pi
_OF_CRITICAL = (
    *("critical_speed", "critical_mode", "critical_whirl", "critical_damping_ratio"),
    "is_excited",
)
_OF_PEAK = (
    *("peak_speed", "peak_amplitude", "peak_node", "lower_half_power_speed", "upper_half_power_speed"),
    *("amplification_factor", "separation_margin", "required_margin", "is_separated"),
)


def print_design(design: xr.Dataset) -> None:
    """Print the tables of a linear design."""
    low, high = (_RPM * speed for speed in design.attrs["speed_range"])
    click.echo(f"\nCritical speeds from {low:.6g} to {high:.6g} rpm")
    if design.sizes["critical"]:
        click.echo(
            f"{'rpm':>12} {'Hz':>12} {'mode':>5} {'damping':>9} {'log dec':>9}  {'whirl':<9} unbalance"
        )
    for i in range(design.sizes["critical"]):
        one = design.isel(critical=i)
        ratio = float(one["critical_damping_ratio"])
        shown = round(ratio, 5) + 0.0  # no -0.00000
        excited = "excites" if bool(one["is_excited"]) else "does not excite"
        speed = float(one["critical_speed"])
        click.echo(
            f"{_RPM * speed:12.2f} {speed / (2 * math.pi):12.4f} {int(one['critical_mode']):5d} {shown:9.5f} "
            f"{_decrement(ratio):9.4f}  {one['critical_whirl'].item():<9} {excited}"
        )
    if not design.sizes["critical"]:
        click.echo("none")
    _print_peaks(design)
    _print_sag(design)
    threshold = float(design["threshold_speed"])
    stable = (
        f"unstable from {_RPM * threshold:.6g} rpm on" if math.isfinite(threshold) else "stable throughout"
    )
    click.echo(f"\nStability: {stable}{_least(design)}")


def plain_design(design: xr.Dataset, nodes: list[int]) -> dict[str, Any]:
    """Return a linear design for JSON, SI units; the response at some nodes."""
    sag = design.isel(speed=0)
    response = [
        {
            "node": node,
            "speed": design["response_speed"].values.tolist(),
            "major_axis": design["major_axis"].sel(node=node).values.tolist(),
            "minor_axis": design["minor_axis"].sel(node=node).values.tolist(),
            "probes": [
                {
                    "angle": float(angle),
                    "amplitude": design["amplitude"].sel(node=node, probe=angle).values.tolist(),
                    "phase": plain_number(design["phase"].sel(node=node, probe=angle).values.tolist()),
                }
                for angle in design["probe"].values
            ],
        }
        for node in nodes
    ]
    return {
        "speed_range": design.attrs["speed_range"],
        "operating": design.attrs.get("operating"),
        "critical_speeds": _listed(design, "critical", _OF_CRITICAL),
        "peaks": _listed(design, "peak", _OF_PEAK),
        "static_sag": [
            {"node": int(node), "vertical": float(v), "horizontal": float(w)}
            for node, v, w in zip(
                sag["node"].values, sag["sag_vertical"].values, sag["sag_horizontal"].values, strict=True
            )
        ],
        "threshold_speed": plain_number(design["threshold_speed"].item()),
        "response": response,
    }


def _listed(design: xr.Dataset, dim: str, names: tuple[str, ...]) -> list[dict[str, Any]]:
    """What is known of each critical speed or peak, under names without that of the dimension."""
    columns = {
        n.removeprefix(f"{dim}_"): plain_number(design[n].values.tolist()) for n in names if n in design
    }
    return [{name: values[i] for name, values in columns.items()} for i in range(design.sizes[dim])]


def _print_peaks(design: xr.Dataset) -> None:
    has_margin = "separation_margin" in design
    click.echo("\nPeaks of the unbalance response" + (": none" if not design.sizes["peak"] else ""))
    if not design.sizes["peak"]:
        return
    head = f"{'node':>5} {'rpm':>12} {'amplitude um':>13} {'AF':>9}"
    click.echo(head + (f" {'margin %':>9} {'API 617':>9}  verdict" if has_margin else ""))
    for i in range(design.sizes["peak"]):
        one = design.isel(peak=i)
        line = (
            f"{int(one['peak_node']):5d} {_RPM * float(one['peak_speed']):12.2f} "
            f"{1e6 * float(one['peak_amplitude']):13.4g} {float(one['amplification_factor']):9.3f}"
        )
        if has_margin:
            margins = 100 * float(one["separation_margin"]), 100 * float(one["required_margin"])
            verdict = "separated" if bool(one["is_separated"]) else "too close"
            line += f" {margins[0]:9.2f} {margins[1]:9.2f}  {verdict}"
        click.echo(line)
    if any(math.isnan(factor) for factor in design["amplification_factor"].values):
        click.echo(
            "AF nan: within the range the amplitude does not fall to 0.707 of that peak on both sides, "
            "or exceeds the peak before it does"
        )


def _print_sag(design: xr.Dataset) -> None:
    sag = design.isel(speed=0)
    size = abs(sag["sag_vertical"]) + abs(sag["sag_horizontal"])
    if not float(size.max()):
        click.echo("\nStatic sag: none, neither gravity nor a load acts")
        return
    click.echo(f"\nStatic sag at {_RPM * float(sag['speed']):.6g} rpm, um")
    click.echo(f"{'node':>5} {'vertical':>12} {'horizontal':>12}")
    for node in sag["node"].values:
        one = sag.sel(node=node)
        parts = (1e6 * float(one[f"sag_{direction}"]) for direction in ("vertical", "horizontal"))
        click.echo(f"{int(node):5d} " + " ".join(f"{round(part, 4) + 0.0:12.4f}" for part in parts))


def _least(design: xr.Dataset) -> str:
    """Least logarithmic decrement of the lateral modes that the spin reaches; "" where it reaches none."""
    reached = design["frequency"] < design.attrs["speed_range"][1] / (2 * math.pi)
    lateral = design["logarithmic_decrement"].where((design["kind"] == "lateral") & reached)
    least = lateral.min("mode")
    if not bool(least.notnull().any()):
        return ""
    at = int(least.fillna(math.inf).argmin("speed"))
    rpm = _RPM * float(design["speed"][at])
    return f"; least logarithmic decrement of the modes reached {float(least[at]):.4g}, at {rpm:.6g} rpm"


def _decrement(ratio: float) -> float:
    return 2 * math.pi * ratio / math.sqrt(1.0 - ratio**2)
