"""`rubhpc modes`: natural frequencies, damping ratios, kinds and whirl of a rig's modes."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import click

from rubhpc.commands.options import quantity
from rubhpc.errors import InputError

if TYPE_CHECKING:
    from pathlib import Path

    from rubhpc.fem.model import CarrierModel, Model
    from rubhpc.fem.modes import Mode

N_TABLE = 12  # modes of the rotor in a table, by default
N_SPEED = 61  # of a Campbell diagram: curves are smooth, and each speed is an eigenproblem


@click.command()
@click.argument("rig")
@click.option(
    "--speed", "speeds", multiple=True, metavar="SPEED", help='"1800 rpm", or rad/s; may be repeated.'
)
@click.option("--count", type=click.IntRange(min=1), help="Show only the lowest COUNT modes of each body.")
@click.option(
    "--range",
    "speed_range",
    nargs=2,
    metavar="LOW HIGH",
    help="Critical speeds, unbalance response, sag and stability from LOW to HIGH.",
)
@click.option(
    "--operating", nargs=2, metavar="LOW HIGH", help="Operating speeds, for separation margins (API 617)."
)
@click.option(
    "--response",
    "nodes",
    type=int,
    multiple=True,
    metavar="NODE",
    help="Unbalance response at NODE; may be repeated. With --figure, draw it at the first.",
)
@click.option("--shapes", is_flag=True, help="With --figure, draw the mode shapes at the critical speeds.")
@click.option(
    "--data",
    metavar="FILE",
    help="Write the data of --response or --shapes (.csv, .json, .zarr, .nc), or else all of the design.",
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of a table.")
@click.option(
    "--figure",
    type=click.Path(dir_okay=False),
    help="Draw a Campbell diagram up to the highest speed, or what --response or --shapes names.",
)
@click.option("--trust-rig", is_flag=True, help="Run the Python code of a RIG that is FILE.py:FUNCTION.")
def modes(
    rig: str,
    speeds: tuple[str, ...],
    count: int | None,
    speed_range: tuple[str, str] | None,
    operating: tuple[str, str] | None,
    nodes: tuple[int, ...],
    shapes: bool,
    data: str | None,
    as_json: bool,
    figure: str | None,
    trust_rig: bool,
) -> None:
    """Natural frequencies, damping ratios, kind and whirl of the modes of RIG.

    RIG is the name of a packaged rig, the path of a rig file, or FILE.py:FUNCTION. Without --speed the rotor
    stands still. --range, --operating, --response, --shapes or --data add a linear design: critical speeds,
    peaks of the unbalance response with amplification factor and separation margin, static sag, stability.
    """
    from postproc.figures.drawing import check_figure_path
    from postproc.figures.linear_design import mode_shapes, unbalance_response
    from postproc.store.export import check_data_path, write_data
    from rubhpc.commands.design import plain_design, print_design
    from rubhpc.fem.assemble import assemble
    from rubhpc.fem.linear_design import linear_design
    from rubhpc.fem.modes import modes as find_modes
    from rubhpc.fem.stability import decay_message, instability_message, undamped_message
    from rubhpc.fem.statics import FLOATS, find_rigid_body_mode, sag_remark
    from rubhpc.rig.reading import read_rig

    if nodes and shapes:
        raise InputError("--shapes: conflicts with --response; give one of them")
    if data and not (nodes or shapes) and check_data_path(data).suffix == ".csv":
        raise InputError(
            f"--data {data}: a whole design is not a table; add --response or --shapes, or name it .nc"
        )
    spins = [quantity(speed, "rad/s", "--speed") for speed in speeds] or [0.0]
    path = check_figure_path(figure) if figure else None
    read = read_rig(rig, trust_rig=trust_rig)
    model = assemble(read)
    # stators do not spin: their modes hold at every speed
    stators = [find_modes(stator.held.body)[:count] for stator in model.stators]
    carriers = [(carrier, find_modes(carrier.body)[:count]) for carrier in model.carriers]
    found = [(spin, find_modes(model.rotor, spin)[:count]) for spin in spins]
    if find_rigid_body_mode(model) == FLOATS:
        click.echo(f"warning: {FLOATS}, and some of its modes have no frequency", err=True)
    for spin in spins:
        if message := instability_message(model, spin):
            click.echo(f"warning: {message}", err=True)
    for message in dict.fromkeys([sag_remark(model), *(undamped_message(model, spin) for spin in spins)]):
        if message:
            click.echo(f"warning: {message}", err=True)
    design = None
    if speed_range or operating or nodes or shapes or data:
        design = linear_design(
            read,
            _ends(speed_range, "--range"),
            operating=_ends(operating, "--operating"),
            nodes=list(nodes) or None,
        )
    if as_json:
        standing = [[_plain(mode) for mode in stator] for stator in stators]
        carried: dict[str, Any] = {}
        if carriers:
            carried["carriers"] = [
                {"name": carrier.name, "stators": carrier.stators, "modes": [_plain(m) for m in of]}
                for carrier, of in carriers
            ]
        points = [
            {"speed": spin, "rotor": [_plain(m) for m in rotor], "stators": standing} | carried
            for spin, rotor in found
        ]
        added = plain_design(design, list(nodes)) if design is not None else {}
        click.echo(json.dumps({"speeds": points} | added))
    else:
        _print_tables(found, stators, carriers, count or N_TABLE)
        for message in filter(None, (decay_message([(model, spin)]) for spin in spins)):
            click.echo(f"\n{message[:1].upper()}{message[1:]}.")
        if design is not None:
            print_design(design)
    drawing = None
    if design is not None and (nodes or shapes):
        drawing = mode_shapes(design) if shapes else unbalance_response(design, nodes[0])
    if data and design is not None:
        click.echo(f"wrote {write_data(drawing.shown if drawing else design, data)}", err=True)
    if path and drawing:
        drawing.save(path)
    elif path:
        top_speed = design.attrs["speed_range"][1] if design is not None else max(abs(spin) for spin in spins)
        _draw(model, top_speed, count, path)


def _ends(pair: tuple[str, str] | None, option: str) -> tuple[float, float] | None:
    """Both ends of a range of speeds, rad/s."""
    return (quantity(pair[0], "rad/s", option), quantity(pair[1], "rad/s", option)) if pair else None


def _plain(mode: Mode) -> dict[str, Any]:
    return {key: getattr(mode, key) for key in ("frequency", "damping_ratio", "kind", "whirl")}


def _print_tables(
    found: list[tuple[float, list[Mode]]],
    stators: list[list[Mode]],
    carriers: list[tuple[CarrierModel, list[Mode]]],
    count: int,
) -> None:
    import math

    from rubhpc.fem.stability import stator_names

    tables = [(f"Rotor at {spin * 30 / math.pi:g} rpm ({spin:.6g} rad/s)", rotor) for spin, rotor in found]
    for carrier, listed in carriers:
        tables.append((f"Carrier {carrier.name} with {stator_names(carrier.stators)}", listed))
    on = {number: carrier.name for carrier, _ in carriers for number in carrier.stators}
    alike: dict[tuple[object, ...], list[int]] = {}  # a ring has one table
    for number, stator in enumerate(stators, start=1):
        values = ((mode.frequency, mode.damping_ratio, mode.kind) for mode in stator)
        alike.setdefault((on.get(number), *values), []).append(number)
    for (carrier_name, *_), among in alike.items():
        title = stator_names(among).capitalize() + (", each" if len(among) > 1 else "")
        held = f", carrier {carrier_name} fixed" if carrier_name else ""
        tables.append((title + held, stators[among[0] - 1]))
    click.echo("Natural and damped frequency in Hz, damping as a fraction of critical.")
    for title, listed in tables:
        if not listed:
            click.echo(f"\n{title}: a wall, which does not move")
            continue
        click.echo(f"\n{title}\n{'natural':>12} {'damped':>12} {'damping':>9}  {'kind':<10} whirl")
        for mode in listed[:count]:
            damping = round(mode.damping_ratio, 5) + 0.0  # no -0.00000
            numbers = f"{mode.frequency:12.4f} {mode.damped_frequency:12.4f} {damping:9.5f}"
            click.echo(f"{numbers}  {mode.kind:<10} {mode.whirl}")
        if len(listed) > count:
            click.echo(f"({len(listed) - count} more; --count {len(listed)} shows all)")


def _draw(model: Model, top_speed: float, count: int | None, path: Path) -> None:
    """Save the Campbell diagram from standstill to the highest speed asked for.

    Without a speed it ends at six times the first lateral frequency, where the paper's speeds end, and
    without a count it shows what lies under 2X there.
    """
    import math

    import numpy as np

    from postproc.figures.drawing import house_style, new_figure, save
    from postproc.figures.linear_design import campbell_diagram
    from rubhpc.fem.critical_speeds import campbell, find_critical_speeds, follow_modes
    from rubhpc.fem.linear_design import checked_range

    low, high = checked_range(model, None)
    low, high = (low, high) if not top_speed else (low if model.rotor.by_speed else 0.0, top_speed)
    speeds = np.linspace(low, high, N_SPEED)
    tracks = follow_modes(model.rotor, speeds)
    curves = campbell(model.rotor, speeds, tracks)
    lowest = curves["frequency"].min("speed")
    limit = 1.02 * max(high / math.pi, 1.1 * float(lowest[:4].max())) if count is None else None
    is_shown = (lowest < limit).values if limit else np.arange(len(tracks)) < (count or 0)
    found = find_critical_speeds(model, speeds, tracks)
    critical = [one.speed for one in found if is_shown[one.number - 1]]
    with house_style():
        figure, (ax,) = new_figure()
        campbell_diagram(curves.isel(mode=is_shown), ax, critical, limit)
        save(figure, path)
