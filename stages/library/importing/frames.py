"""Unit, up axis and front of a model: declared, assumed, or found by what is usual; the model frame from them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scenewright.stages.kit.geometry.file_axes import (
    AXES,
    UNITS,
    Direction,
    axis_name,
    clean,
    size_text,
    size_under,
    unit_name,
    upright_rotation,
)
from scenewright.stages.kit.known_names import UnitName
from scenewright.stages.library.importing.classes import UsualSize
from scenewright.stages.library.importing.source_model import Declared

LIKELY_UNITS: tuple[UnitName, ...] = ("m", "cm", "mm", "inch")
SMALLEST_THING, LARGEST_THING = 0.01, 10.0
"""Largest extent of things of any class [m]."""
Y_UP, Z_UP = AXES["+y"], AXES["+z"]
SLACK = 1.25
"""A size that is out of the usual bounds by more than this is spoken of."""


@dataclass(frozen=True)
class Choice:
    """Unit and up axis as they are taken, where from, and what is to be said about it."""

    unit: float
    """Metres per unit."""
    unit_origin: str
    up: Direction
    up_origin: str
    findings: tuple[str, ...] = ()


def choose(
    unit: Declared,
    up: Declared,
    points_in: Callable[[float], np.ndarray],
    usual: UsualSize | None,
    y_first: bool,
    told_up: Direction | None = None,
) -> Choice:
    """Return the unit and the up axis of a model; `points_in` gives its points (N, 3) [m] for a unit.

    What is declared is taken, and only questioned. What is not is the first of metres, centimetres, millimetres and
    inches, with the likelier of y and z up (`y_first`), that makes the size usual for the class; `told_up`, which the
    shape tells, is the likeliest.
    """
    ups = (Y_UP, Z_UP) if y_first else (Z_UP, Y_UP)
    declared_unit = unit.value if isinstance(unit.value, float) else None
    declared_up = up.value if isinstance(up.value, tuple) else None
    findings: list[str] = []
    units = [declared_unit] if declared_unit is not None else [UNITS[name] for name in LIKELY_UNITS]
    directions = [declared_up] if declared_up is not None else list(ups)
    if declared_up is None and told_up in directions and told_up != directions[0]:
        directions = [told_up, *(direction for direction in directions if direction != told_up)]
        up = replace(up, origin="guessed")
        findings.append(f"nothing declares its up axis: it has a back rest with {axis_name(told_up)} up alone")
    taken_unit, taken_up = units[0], directions[0]
    unit_origin, up_origin = unit.origin, up.origin
    if usual is not None and (len(units) > 1 or len(directions) > 1):
        fitting = [(u, d) for u in units for d in directions if usual.fits(size_under(points_in(u), d))]
        if fitting and fitting[0] != (taken_unit, taken_up):
            unit_origin = "guessed" if fitting[0][0] != taken_unit else unit_origin
            up_origin = "guessed" if fitting[0][1] != taken_up else up_origin
            taken_unit, taken_up = fitting[0]
            choice_words = f"{unit_name(taken_unit)}, {axis_name(taken_up)} up"
            findings.append(f"nothing declares its {_what(unit, up)}: {choice_words} make its size usual")
    size = size_under(points_in(taken_unit), taken_up)
    if usual is None and not SMALLEST_THING <= float(size.max()) <= LARGEST_THING:
        findings.append(f"size {size_text(size)} is unusual for anything in a room (--unit)")
    if usual is not None and not usual.fits(size, SLACK):
        better = _better(points_in, taken_unit, taken_up, usual)
        findings.append(f"size {size_text(size)} is unusual for its class{better}")
    return Choice(taken_unit, unit_origin, taken_up, up_origin, tuple(findings))


def _what(unit: Declared, up: Declared) -> str:
    missing = [name for name, entry in (("unit", unit), ("up axis", up)) if entry.value is None]
    return " and ".join(missing)


def _better(points_in: Callable[[float], np.ndarray], unit: float, up: Direction, usual: UsualSize) -> str:
    """Return a hint: in which unit, or with which axis up, the size would be usual."""
    for name in LIKELY_UNITS:
        if UNITS[name] != unit and usual.fits(size_under(points_in(UNITS[name]), up)):
            return f"; in {name} it would be usual (--unit {name})"
    for other_up in (Z_UP, Y_UP):
        if other_up != up and usual.fits(size_under(points_in(unit), other_up)):
            return f"; with {axis_name(other_up)} up it would be usual (--up {axis_name(other_up)})"
    return ""


def model_rotation(up: Direction, front: Direction | None) -> np.ndarray:
    """Return model_from_source (3, 3): up to z, front (its part across up) to -y."""
    upright = upright_rotation(up)
    if front is None:
        return upright
    x, y, _ = upright @ np.asarray(front)
    length = float(np.hypot(x, y))
    if length < 1e-6:
        return upright
    cosine, sine = -y / length, -x / length  # the turn about z that takes (x, y) to (0, -1)
    return clean(np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1.0]]) @ upright)
