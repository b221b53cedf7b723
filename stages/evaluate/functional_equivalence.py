"""Functional equivalence by the thesis's four criteria (Han 2024, section 2.1): what a replacement preserves.

"(i) semantic class and spatial relations with nearby objects, (ii) affordance, (iii) similar geometry in terms of size
and shape, (iv) similar appearance". The thesis gives no thresholds; those here are ours and stand in the constants.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile
from scenewright.schemas.scene_parts import TREE_RELATIONS
from scenewright.stages.evaluate.color_difference import color_difference, mean_lab
from scenewright.stages.evaluate.model_shapes import ModelShape, PlacedShape, supporting_area
from scipy.spatial import cKDTree

SIZE_RATIO = 0.20
"""An extent is similar within this share of the true one."""
SIZE_SLACK = 0.02
"""Difference of an extent [m] that is similar whatever its share (cups are small)."""
SHAPE_DISTANCE = 0.05
"""Shapes are similar up to this mean distance of their surfaces, as a share of the true box's diagonal."""
COLOR_DIFFERENCE = 20.0
"""Appearances are similar up to this CIE 1976 difference of the mean colours."""
CARRYING_AREA = 0.01
"""A level surface from this area on can carry things [m^2]."""


@dataclass(frozen=True)
class Affordance:
    """What a thing offers."""

    carried: bool
    """An arm can carry it."""
    swings: bool
    """Something on it opens by turning."""
    slides: bool
    """Something on it opens by sliding."""
    contains: bool
    carries: bool


@dataclass(frozen=True)
class Equivalence:
    """The four criteria for one object, and what they were judged by."""

    same_class: bool
    same_relation: bool
    """Its parent in the tree is the partner of the true parent, by the same relation."""
    affordance: bool
    """All five of `Affordance` agree."""
    affordance_share: float
    """Share of the five that agree."""
    size: bool
    shape: bool
    shape_distance: float
    """Mean distance of the surfaces over the true diagonal, once the boxes' middles and axes are laid on each other."""
    appearance: bool
    color_difference: float | None
    """CIE 1976; None where no colour is known."""

    @property
    def class_and_relations(self) -> bool:
        """Criterion (i)."""
        return self.same_class and self.same_relation

    @property
    def size_and_shape(self) -> bool:
        """Criterion (iii)."""
        return self.size and self.shape

    @property
    def functional(self) -> bool:
        """All four criteria."""
        return self.class_and_relations and self.affordance and self.size_and_shape and self.appearance


def affordance_of(placed: PlacedShape) -> Affordance:
    """Return what a placed model offers; whether it carries is read off its closed surface."""
    shape = placed.shape
    kinds = {joint.type for joint in placed.joints}
    return Affordance(
        carried=shape.movable,
        swings="revolute" in kinds,
        slides="prismatic" in kinds,
        contains=shape.contains,
        carries=supporting_area(shape, placed.scale) >= CARRYING_AREA,
    )


def affordance_agreement(true: Affordance, placed: Affordance) -> float:
    """Return the share of the five questions that have the same answer."""
    names = ("carried", "swings", "slides", "contains", "carries")
    return sum(getattr(true, name) == getattr(placed, name) for name in names) / len(names)


def similar_size(ratios: tuple[float, float, float], true_extents: np.ndarray) -> bool:
    """Whether every extent (its ratio to the true one) is within 20 % or 2 cm of the true one (3,) [m]."""
    off = np.abs(np.array(ratios) - 1.0)
    return bool(np.all((off <= SIZE_RATIO + 1e-9) | (off * true_extents <= SIZE_SLACK + 1e-9)))


def surface_distance(true: PlacedShape, placed: PlacedShape, rotation: np.ndarray) -> float:
    """Return the mean distance of two closed surfaces over the true diagonal, poses left out, sizes left in.

    Each model is moved to the middle of its box; `rotation` (3, 3) is the symmetry of the true model that the
    placement took (true axes from placed axes). Both directions are averaged.
    """
    low, high = true.shape.closed_bounds
    first = true.scale * (true.shape.closed_points - 0.5 * (low + high))
    low, high = placed.shape.closed_bounds
    second = placed.scale * (placed.shape.closed_points - 0.5 * (low + high)) @ rotation.T
    forward = cKDTree(second).query(first)[0].mean()
    back = cKDTree(first).query(second)[0].mean()
    return float(0.5 * (forward + back) / np.linalg.norm(true.extents))


def look_of(shape: ModelShape, colors: Mapping[str, tuple[int, int, int]] | None = None) -> np.ndarray | None:
    """Return the mean colour of a model, L*a*b* (3,), its parts weighted by area.

    `colors` are those that a replacement took from the map; parts without one are left out. Without any the model's
    own colours count. None when there is nothing to look at.
    """
    given_colors: dict[str, tuple[float, float, float]] = {p: c for p, c in (colors or {}).items() if p in shape.parts}
    shown_colors = given_colors or {name: part.color for name, part in shape.parts.items()}
    areas = np.array([shape.parts[name].area for name in shown_colors])
    if not areas.sum() > 0:
        return None
    return mean_lab(np.array(list(shown_colors.values()), dtype=float), areas)


def same_relation(
    true: ContactGraphFile, predicted: ContactGraphFile, partner: Mapping[str, str], true_node: str
) -> bool:
    """Whether the partner of `true_node` hangs on the partner of its parent by the same tree relation.

    `partner`: true node id -> predicted node id; the scene roots pair by themselves.
    """
    node = partner.get(true_node)
    true_link = next((k for k in true.links if k.target == true_node and k.relation in TREE_RELATIONS), None)
    link = next((k for k in predicted.links if k.target == node and k.relation in TREE_RELATIONS), None)
    if true_link is None or link is None:
        return true_link is None and link is None and node is not None
    parent = SCENE_NODE if true_link.source == SCENE_NODE else partner.get(true_link.source)
    return link.source == parent and link.relation == true_link.relation


def equivalence(
    true: PlacedShape,
    placed: PlacedShape,
    *,
    rotation: np.ndarray,
    scale_ratios: tuple[float, float, float],
    same_class: bool,
    relation: bool,
    colors: Mapping[str, tuple[int, int, int]],
) -> Equivalence:
    """Judge one replacement. `rotation`, `scale_ratios` as in `alignment_error`; `relation` from `same_relation`."""
    agreement = affordance_agreement(affordance_of(true), affordance_of(placed))
    distance = surface_distance(true, placed, rotation)
    looks = look_of(true.shape), look_of(placed.shape, colors)
    difference = None if looks[0] is None or looks[1] is None else color_difference(looks[0], looks[1])
    return Equivalence(
        same_class=same_class,
        same_relation=relation,
        affordance=agreement == 1.0,
        affordance_share=agreement,
        size=similar_size(scale_ratios, true.extents),
        shape=distance <= SHAPE_DISTANCE,
        shape_distance=distance,
        appearance=difference is not None and difference <= COLOR_DIFFERENCE,
        color_difference=difference,
    )
