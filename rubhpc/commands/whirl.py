"""`rubhpc whirl`: dry whirl that can exist in the bores of a rig."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rubhpc.commands.options import plain_number, quantity
from rubhpc.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

    from rubhpc.rig.rig import Rig
    from rubhpc.study.study import Study

MOST_LISTED = 3  # speeds of a table; of more only the highest
SIDES = ("slower", "faster")  # starts of the simulations of a whirl
_WIDTHS = (6, 9, 8, 9, 11, 9, 10)
_RPM = 30 / math.pi


@click.command()
@click.argument("target", metavar="RIG|STUDY.toml")
@click.option(
    "--speed", "speeds", multiple=True, metavar="SPEED", help='"3000 rpm", or rad/s; may be repeated.'
)
@click.option("--range", "speed_range", nargs=2, metavar="LOW HIGH", help="Speeds from LOW to HIGH instead.")
@click.option(
    "--clearance", "clearances", multiple=True, metavar="LENGTH", help='"0.2 mm", or m; may be repeated.'
)
@click.option(
    "--friction", "frictions", multiple=True, type=click.FloatRange(0.0), help="Coefficient; may be repeated."
)
@click.option("--frequency", metavar="LIMIT", help='Highest whirl frequency searched, "500 Hz", or "inf".')
@click.option(
    "--certify", is_flag=True, help="Simulate each whirl from both sides, and search for the least knock."
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
@click.option(
    "--figure", type=click.Path(dir_okay=False), help="Draw the chart over the speed, or the clearance."
)
@click.option("--data", metavar="FILE", help="Write the data (.json, .zarr, .nc).")
@click.option("--trust-rig", is_flag=True, help="Run the Python code of a rig that is FILE.py:FUNCTION.")
def whirl(
    target: str,
    speeds: tuple[str, ...],
    speed_range: tuple[str, str] | None,
    clearances: tuple[str, ...],
    frictions: tuple[float, ...],
    frequency: str | None,
    certify: bool,
    as_json: bool,
    figure: str | None,
    data: str | None,
    trust_rig: bool,
) -> None:
    """Which dry whirl and whip can exist in each bore, from receptances, before any simulation.

    For each bore, the others open: the least coefficient of friction with which the rotor can whirl in it
    without unbalance, over the speed; and with --friction all such whirls, slipping (whip) or rolling, with
    frequency, force and stability. A study gives speeds, clearances, frictions and the contact law, as far as
    no option does. A rig needs --clearance; its bores are hard unless they have a law of their own.

    With --certify each whirl is simulated from a start that is slower and from one that is faster; and the
    least knock is searched for that takes the whole machine to whirl. This takes seconds to minutes a whirl:
    give few speeds.
    """
    import numpy as np

    from postproc.figures.drawing import check_figure_path
    from postproc.figures.whirl_chart import draw_whirl
    from postproc.store.export import check_data_path, write_data
    from rubhpc.fem import dry_whirl as whirls

    if speeds and speed_range:
        raise InputError("--range: conflicts with --speed; give one of them")
    path = check_figure_path(figure) if figure else None
    if data and check_data_path(data).suffix == ".csv":
        raise InputError(f"--data {data}: not a single table; name it .nc, .json or .zarr")
    rig, given = _read(target, trust_rig=trust_rig)
    if speeds:
        given["speeds"] = [quantity(speed, "rad/s", "--speed") for speed in speeds]
    elif speed_range:
        low, high = (quantity(end, "rad/s", "--range") for end in speed_range)
        given["speeds"] = np.linspace(low, high, whirls.N_SPEED)
    if clearances:
        given["clearances"] = [quantity(gap, "m", "--clearance") for gap in clearances]
    elif "clearances" not in given:
        raise InputError('--clearance: missing; a rig file has none, add --clearance "0.2 mm"')
    if frictions:
        given["frictions"] = frictions
    if frequency is not None:
        limit = math.inf if frequency == "inf" else 2.0 * math.pi * quantity(frequency, "Hz", "--frequency")
        given["most_frequency"] = limit
    if certify and not len(given.get("frictions", ())):
        raise InputError("--certify: no friction is given; add --friction 0.2")
    found = whirls.dry_whirl(rig, **given)
    if certify:
        from rubhpc.whirl_simulations import certify_whirl

        found = certify_whirl(rig, found, law=given.get("law"), report=_report)
    answer = whirls.in_words(found)
    if as_json:
        click.echo(json.dumps({"answer": answer} | _plain(found)))
    else:
        for line in answer:
            click.echo(line)
        _print_table(found)
    if data:
        click.echo(f"wrote {write_data(found, data)}", err=True)
    if path:
        draw_whirl(found).save(path)


def _read(target: str, *, trust_rig: bool) -> tuple[Rig, dict[str, Any]]:
    """The rig of a rig or study, and the arguments of `dry_whirl` that a study gives."""
    from rubhpc.input.reading import read_toml
    from rubhpc.rig.reading import read_rig
    from rubhpc.study.study import read_study

    path = Path(target)
    if path.suffix == ".toml" and path.is_file() and "rotor" not in read_toml(path):
        return _of_study(read_study(path, trust_rig=trust_rig))
    return read_rig(target, trust_rig=trust_rig), {}


def _of_study(study: Study) -> tuple[Rig, dict[str, Any]]:
    """Its first rig and law, and its speeds, clearances and frictions; of many some, evenly spread."""
    from rubhpc.fem.dry_whirl import MOST_SETTINGS, MOST_SPEEDS, thinned
    from rubhpc.rig.normal_law import NormalLaw
    from rubhpc.study.operating_points import operating_points_of

    points = operating_points_of(study)
    first = next(iter(points.along([])))
    contact = points.contact(first)
    values = {name: array for name, (_, array) in points.arrays().items()}
    given = {
        "clearances": thinned(values["clearance"], MOST_SETTINGS),
        "frictions": thinned(study.axis("friction").values, MOST_SETTINGS),
        "law": NormalLaw(
            kind=contact.law,
            stiffness=contact.stiffness,
            damping=contact.damping,
            restitution=contact.restitution,
        ),
    }
    if not study.changes_speed:
        given["speeds"] = thinned(values["spin_speed"], MOST_SPEEDS)
    return points.rig(first), given


def _print_table(found: xr.Dataset) -> None:
    """Print the whirls at the frictions given, or where whirl begins; of many speeds at the highest."""
    dim = "whirl" if found.attrs["frictions"] else "threshold"
    rows = _rows(found, dim)
    if found.sizes["speed"] > MOST_LISTED:
        highest = max(found["speed"].values.tolist(), key=abs)
        rows = [row for row in rows if row["speed"] == highest]
    if not rows:
        return
    heads = (
        "stator",
        "rpm",
        "gap um",
        "friction" if dim == "whirl" else "needs",
        "Hz",
        "orbit um",
        "force N",
    )
    click.echo(
        "\n" + " ".join(f"{head:>{width}}" for head, width in zip(heads, _WIDTHS, strict=True)) + "  kind"
    )
    for row in rows:
        numbers = (
            f"{row['stator']}",
            f"{_RPM * row['speed']:.1f}",
            f"{1e6 * row['clearance']:.1f}",
            f"{row['friction']:.4g}",
            f"{row['frequency'] / (2 * math.pi):.4f}",
            f"{1e6 * row['orbit']:.1f}",
            f"{row['normal_force']:.4g}",
        )
        kind = row["kind"]
        if dim == "whirl":
            kind += ", stable" if row["growth_rate"] < 0.0 else f", grows by {row['growth_rate']:.3g} 1/s"
        if "is_confirmed" in row:
            kind += f"; {'confirmed' if row['is_confirmed'] else 'not confirmed'}: {_ends(row)}"
        line = " ".join(f"{number:>{width}}" for number, width in zip(numbers, _WIDTHS, strict=True))
        click.echo(f"{line}  {kind}")


def _ends(row: dict[str, Any]) -> str:
    """Where the simulations of a whirl end."""
    ends = [
        f"{side} to {kind.replace('_', ' ')}"
        + (f" {frequency / (2 * math.pi):.4f} Hz" if math.isfinite(frequency) else "")
        for side, kind, frequency in zip(SIDES, row["reached_kind"], row["reached_frequency"], strict=True)
    ]
    return ", ".join(ends)


def _report(n_done: int, n_all: int) -> None:
    click.echo(f"{n_done}/{n_all} whirls and searches are done", err=True)


def _rows(found: xr.Dataset, dim: str) -> list[dict[str, Any]]:
    names = [str(name) for name in found.data_vars if str(name).startswith(f"{dim}_")]
    columns = [found[name].values.tolist() for name in names]
    keys = [name.removeprefix(f"{dim}_") for name in names]
    return [dict(zip(keys, row, strict=True)) for row in zip(*columns, strict=True)]


def _plain(found: xr.Dataset) -> dict[str, Any]:
    """The data for JSON, SI units; None for what is infinite."""
    bores = [
        {
            "stator": int(one["stator"]),
            "node": int(one["node"]),
            "least_friction": plain_number(one["least_friction"].values.tolist()),
            "is_approximate": one["is_approximate"].values.tolist(),
        }
        for one in (found.isel(stator=i) for i in range(found.sizes["stator"]))
    ]
    listed = {
        f"{dim}s": [{key: plain_number(value) for key, value in row.items()} for row in _rows(found, dim)]
        for dim in ("threshold", "whirl", *(["knock"] if "knock" in found.dims else []))
    }
    return {
        "speed": found["speed"].values.tolist(),
        "clearance": found["clearance"].values.tolist(),
        "most_frequency": plain_number(found.attrs["most_frequency"]),
        "bores": bores,
        **listed,
    }
