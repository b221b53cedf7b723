"""How near a library comes to the models that a room was furnished with, at its best scale; libraries that come less
near."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.schemas.cad_library import CadModel


def extents(model: CadModel) -> np.ndarray:
    """Return the edges (3,) of the closed model's box [m]."""
    closed = min(model.states, key=lambda state: sum(abs(value) for value in state.joints.values()))
    return np.asarray(closed.box_maximum) - np.asarray(closed.box_minimum)


def off_by(true: np.ndarray, other: np.ndarray) -> float:
    """Return by what share the worst edge of `other` (3,) is off that of `true` (3,), at the best of all scales.

    With ratios r = other / true and scale s, max |s r - 1| is least at s = 2 / (min r + max r).
    """
    ratios = np.asarray(other, float) / np.maximum(np.asarray(true, float), 1e-9)
    return float((ratios.max() - ratios.min()) / (ratios.max() + ratios.min()))


def nearest_stand_in(true: CadModel, library: Sequence[CadModel]) -> float | None:
    """Return how far the nearest model of the same class is off a true one; None where the library has none."""
    found = [off_by(extents(true), extents(model)) for model in library if model.class_name == true.class_name]
    return min(found, default=None)


def style_of(model: CadModel) -> tuple[str, float | int | str | None]:
    """Return class and style of a model: what its generator calls it, None where it has one style alone."""
    return model.class_name, model.recipe.get("style")


def without_styles(library: Sequence[CadModel], room: Sequence[CadModel]) -> list[CadModel]:
    """Return the models of the library in no style that the models of the room have.

    A class stays whole where it has one style, or none that the room lacks: shapes differ all the same when the library
    was drawn by another seed. What comes of it is told by `lacking`.
    """
    taken = {style_of(model) for model in room if style_of(model)[1] is not None}
    kept = [model for model in library if style_of(model) not in taken]
    left = {model.class_name for model in kept}
    return [model for model in library if style_of(model) not in taken or model.class_name not in left]


def lacking(true: CadModel, library: Sequence[CadModel]) -> bool:
    """Return whether the library has no model of the class and style of a true one."""
    return style_of(true) not in {style_of(model) for model in library}
