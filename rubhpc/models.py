"""Which contact is computed where a study does not say: the defaults, published models, and older stores."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

# Laws of friction and of the normal force; their places are the numbers in `kernels.laws`.
FRICTION_LAWS = ("sliding", "coulomb", "stribeck", "table")
NORMAL_LAWS = ("lagrange", "penalty", "hertz")
# Geometry of a beam stator, which is that of the gap where it bends.
LINEAR, SECOND_ORDER = "linear", "second_order"
# What a study has that gives none of these keys, nor a model.
NORMAL, FRICTION_LAW, GEOMETRY = "updated", "coulomb", SECOND_ORDER

MOKHTAR2017 = "mokhtar2017"
MODELS = {
    MOKHTAR2017: {"normal": "fixed", "friction_law": "sliding", "geometry": LINEAR},
}
# What these keys mean where a store lacks them: it was made before they existed, or before they were written.
ABSENT = MODELS[MOKHTAR2017]

_FRICTION = {"coulomb": "Coulomb", "stribeck": "Stribeck", "table": "tabulated"}
_GEOMETRY = {LINEAR: "linear", SECOND_ORDER: "second-order"}


def default_of(key: str) -> str:
    """Return what normal, friction_law or geometry is where nothing is given."""
    return {"normal": NORMAL, "friction_law": FRICTION_LAW, "geometry": GEOMETRY}[key]


def chosen(key: str, model: str | None) -> str:
    """Return what normal, friction_law or geometry is under a model, or without one by default."""
    return default_of(key) if model is None else MODELS[model][key]


def may_reverse(friction_law: str | None) -> bool:
    """Return whether slip may reverse under the friction law of a store, which may lack the key."""
    return (friction_law or ABSENT["friction_law"]) != "sliding"


def in_words(normals: Iterable[str], friction_laws: Iterable[str], geometries: Iterable[str]) -> str:
    """Return which model cases use, for people.

    Parameters
    ----------
    normals, friction_laws, geometries : iterable of str
        All that occur among the cases; no geometry where no stator is a beam.
    """
    found = {"normal": [*normals], "friction_law": [*friction_laws], "geometry": [*geometries]}
    for name, model in MODELS.items():
        if all(set(words) <= {model[key]} for key, words in found.items()):
            return f"model {name}"
    parts = [
        f"{' or '.join(found['normal'])} normal",
        f"{' or '.join(_FRICTION.get(law, law) for law in found['friction_law'])} friction",
        f"{' and '.join(_GEOMETRY.get(one, one) for one in found['geometry'])} stators",
    ]
    return ", ".join(parts if found["geometry"] else parts[:2])
