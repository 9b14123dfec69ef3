"""The places that signals belong to: their names for captions, and the motion at a place that is chosen."""

from __future__ import annotations

import math
from itertools import combinations
from typing import TYPE_CHECKING, Any

from postproc.signals.spectra import WHIRL, default_signal
from postproc.store.attributes import MEASURED
from postproc.store.axes import refusal
from postproc.store.rig_of_case import has_place, recorded_node, rig_of
from postproc.store.variables import probe_of, probes_of, require_variables
from rubhpc.errors import InputError
from rubhpc.rig.probes import TWISTS
from rubhpc.schema import PROBE, SIGNAL_NAMES

if TYPE_CHECKING:
    import xarray as xr

_OF_STATORS = ("stator_", "contact_")
_PREFIXES = ("spectrum_", "section_", "amplitude_", "phase_")  # of what is derived from a signal
_LEAST_SINE = 0.05  # of the angle between two probes: 3 degrees


def named_places(store: xr.Dataset) -> xr.Dataset:
    """Return the store with the attribute `place` of its signals, for captions; as it is without a rig.

    Measured signals have theirs.
    """
    if MEASURED in store.attrs:
        return store
    try:
        disc, nodes = recorded_node(store), {stator.node for stator in rig_of(store).stator}
    except InputError:  # none, or one of another version
        return store
    probes, found = probes_of(store), {}
    for name, values in store.data_vars.items():
        signal = str(name)
        for prefix in _PREFIXES:
            signal = signal.removeprefix(prefix)
        if signal in SIGNAL_NAMES and (not signal.startswith(_OF_STATORS) or nodes == {disc}):
            found[name] = values.assign_attrs(place=f"motion at node {disc}")
        elif signal.startswith(PROBE) and (probe := probes.get(signal.removeprefix(PROBE))):
            where = f"{_words(probe['name'])}: {_place(probe)}{_angle(probe)}"
            found[name] = values.assign_attrs(place=where)
    return store.assign(found)


def moved_at(
    store: xr.Dataset,
    probes: tuple[str, str] | None = None,
    node: int | None = None,
    stator: int | None = None,
) -> xr.Dataset:
    """Return the store with the vertical and horizontal motion of one place; lazy.

    Parameters
    ----------
    probes : (name, name), optional
        Two probes at one place, whose signals, which need not be at right angles, give the motion there.
    node : int, optional
        A node of the rotor: the recorded one, or one that two probes look at.
    stator : int, optional
        Number of a stator, from 1: the node that it stands around.

    Returns
    -------
    Dataset
        `store` itself for the recorded node. Else `vertical` and `horizontal` are those of the place, the
        attribute `node` is its node, 0 at the tip of a stator, and `probes` the names and angles (rad) of its
        probes.

    Raises
    ------
    InputError
        More than one is given, or the motion of the place is not recorded.
    """
    if sum(given is not None for given in (probes, node, stator)) > 1:
        raise InputError("--probes, --node and --stator each name a place; give one of them")
    if stator is not None:
        stators = rig_of(store).stator
        if not 1 <= stator <= len(stators):
            known = f"1 to {len(stators)}" if len(stators) > 1 else "1"
            raise refusal(store, f"stator: there is no {stator}; give {known}")
        node = stators[stator - 1].node
    if probes is not None:
        return seen_by_two(store, *_pair(store, probes))
    recorded_nodes = [recorded_node(store)] if node is not None and has_place(store) else []
    if node is None or node in recorded_nodes:
        return store
    probed = [p for p in probes_of(store).values() if p["quantity"] == "displacement" and "node" in p]
    pairs = {a["node"]: (a, b) for a, b in combinations(probed, 2) if a["node"] == b["node"] and _sine(a, b)}
    if node in pairs:
        return seen_by_two(store, *pairs[node])
    known = ", ".join(str(n) for n in sorted({*recorded_nodes, *pairs}))
    fix = f"choose one of {known}, or record two displacement probes at it" if known else "leave it out"
    raise refusal(store, f"node {node}: its motion is not recorded; {fix}")


def signal_or_whirl(
    store: xr.Dataset,
    signal: str | None,
    default: str,
    full: bool,
    probes: tuple[str, str] | None = None,
    node: int | None = None,
    stator: int | None = None,
) -> tuple[xr.Dataset, str]:
    """Return what a spectrum is of: the store and a signal, or for a full spectrum the whirl at a place.

    InputError of a signal with a full spectrum, a place without one, or a motion that is not recorded.
    """
    if not full:
        given = {"--probes": probes, "--node": node, "--stator": stator}
        if named := next((name for name, value in given.items() if value is not None), None):
            raise InputError(f"{named} names the orbit of a full spectrum; add --full, or give --signal")
        return store, signal or default_signal(store, default)
    if signal is not None:
        raise InputError(
            f"--full is of the orbit and conflicts with --signal {signal}; leave out one of them"
        )
    return moved_at(store, probes, node, stator), WHIRL


def see_motion(first: dict[str, Any], second: dict[str, Any]) -> bool:
    """Whether two probes see the displacement of one place in different directions."""
    is_one_place = all(first.get(key) == second.get(key) for key in ("node", "stator"))
    is_motion = first["quantity"] == second["quantity"] == "displacement"
    return is_one_place and is_motion and bool(_sine(first, second))


def seen_by_two(store: xr.Dataset, first: dict[str, Any], second: dict[str, Any]) -> xr.Dataset:
    """Return the store with the motion that two probes of different directions see."""
    names = [f"{PROBE}{probe['name']}" for probe in (first, second)]
    require_variables(store, names)
    x, y = (store[name].astype(float) for name in names)
    a, b, sine = first["angle"], second["angle"], _sine(first, second)
    motions = {}
    for name, value in (
        ("vertical", (x * math.sin(b) - y * math.sin(a)) / sine),
        ("horizontal", (y * math.cos(a) - x * math.cos(b)) / sine),
    ):
        motions[name] = value.assign_attrs(
            units=store[names[0]].attrs.get("units", "m"),
            long_name=f"{name} {first['quantity']}",
            place=f"motion at {_place(first)}",
        )
    pair = [(_words(probe["name"]), probe["angle"]) for probe in (first, second)]
    return store.assign(motions).assign_attrs(probes=pair, node=first.get("node", 0))


def _pair(store: xr.Dataset, probes: tuple[str, str]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return two probes by name; InputError where they do not give a motion."""
    if isinstance(probes, str) or len(probes) != 2:
        raise refusal(store, f"probes: {probes}: give the names of two probes at one place")
    first, second = (probe_of(store, name) for name in probes)
    for probe in (first, second):
        if probe["quantity"] not in ("displacement", "velocity", "acceleration"):
            problem = f"measures {probe['quantity'].replace('_', ' ')}, which has no orbit"
            raise refusal(store, f"probe {probe['name']}: {problem}; choose one of a displacement")
    names = f"{first['name']} and {second['name']}"
    for key in ("quantity", "node", "stator"):
        if first.get(key) != second.get(key):
            raise refusal(store, f"probes {names}: differ in their {key}; choose two at one place")
    if not _sine(first, second):
        raise refusal(store, f"probes {names}: look in one direction; choose two that do not")
    return first, second


def _sine(first: dict[str, Any], second: dict[str, Any]) -> float:
    """Sine of the angle from one probe to the other; 0 where they look in one direction."""
    sine = math.sin(second["angle"] - first["angle"])
    return sine if abs(sine) >= _LEAST_SINE else 0.0


def _place(probe: dict[str, Any]) -> str:
    """Where a probe is; a measured one may not say."""
    of_stator = f"the tip of stator {probe['stator']}" if "stator" in probe else "the probes"
    return f"node {probe['node']}" if "node" in probe else of_stator


def _angle(probe: dict[str, Any]) -> str:
    """The direction of a probe that has one."""
    angle = math.degrees(probe["angle"])
    return "" if probe["quantity"] in TWISTS else f" at {angle:.4g}\N{DEGREE SIGN}"


def _words(name: str) -> str:
    return name.replace("_", " ")
