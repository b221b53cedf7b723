"""Figures over rooms: counts are pooled before they become a share; intervals resample whole rooms."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from benchmarks.experiment import Measure
from benchmarks.experiments.scene.measuring import BY_TRUTH, Outcome

Figure = Callable[[Sequence[Outcome]], float | None]


def edge_f1(relation: str) -> Figure:
    """F1 of the edges of one relation over all rooms."""

    def figure(outcomes: Sequence[Outcome]) -> float | None:
        counts = np.array([o.edges.get(relation, (0, 0, 0)) for o in outcomes], dtype=float).sum(axis=0)
        return float(2 * counts[2] / (counts[0] + counts[1])) if counts[0] + counts[1] else None

    return figure


def per_room(part: str, name: str, statistic: Callable[[np.ndarray], float] = np.mean) -> Figure:
    """Statistic over rooms of an outcome's figure `name` in `part` (graph, cad, physics)."""

    def figure(outcomes: Sequence[Outcome]) -> float | None:
        values = [getattr(o, part)[name] for o in outcomes if getattr(o, part).get(name) is not None]
        return float(statistic(np.array(values, dtype=float))) if values else None

    return figure


def over_objects(name: str, weight: str = "true_objects") -> Figure:
    """Mean over all objects of all rooms of a figure of `room_summary` that is a mean over `weight` objects."""

    def figure(outcomes: Sequence[Outcome]) -> float | None:
        pairs = [(o.cad[name], o.cad[weight]) for o in outcomes if o.cad.get(name) is not None and o.cad.get(weight)]
        total = sum(count or 0.0 for _, count in pairs)
        return sum((value or 0.0) * (count or 0.0) for value, count in pairs) / total if total else None

    return figure


def _ratio(outcomes: Sequence[Outcome], part: str, whole: str) -> float | None:
    total = sum(o.cad.get(whole) or 0.0 for o in outcomes)
    return sum(o.cad.get(part) or 0.0 for o in outcomes) / total if total else None


def _of_loose(name: str, ending: str = "") -> Figure:
    """Share of all things that have to be free, over all rooms."""

    def figure(outcomes: Sequence[Outcome]) -> float | None:
        known = [o.physics for o in outcomes if f"loose{ending}" in o.physics]  # records of before lack some
        loose = sum(physics[f"loose{ending}"] for physics in known)
        return sum(physics[f"{name}{ending}"] for physics in known) / loose if loose else None

    return figure


FIGURES: dict[str, Figure] = {
    "support_f1": edge_f1("support"),
    "supports_f1": edge_f1("supports"),
    "contains_f1": edge_f1("contains"),
    "carries_on_wall_f1": edge_f1("carries_on_wall"),
    "edit_distance": per_room("graph", "edit_distance"),
    "edit_distance_worst": per_room("graph", "edit_distance", np.max),
    "edit_distance_exact": per_room("graph", "edit_distance_exact"),
    "wrong_support": per_room("graph", "wrong_support"),
    "missing_detection": per_room("graph", "missing_detection"),
    "wrong_detection": per_room("graph", "wrong_detection"),
    "shown": over_objects("shown"),
    "shown_in_several": over_objects("shown_in_several"),
    "detected": lambda outcomes: _ratio(outcomes, "detected", "true_objects"),
    "replaced": lambda outcomes: _ratio(outcomes, "replaced", "true_objects"),
    "class_right": over_objects("class_right"),
    "true_model_first": over_objects("true_model_first"),
    "true_model_among_candidates": over_objects("true_model_among_candidates"),
    "nearest_stand_in": per_room("cad", "nearest_stand_in", np.median),
    "scan2cad_success": over_objects("scan2cad_success"),
    "scan2cad_success_detected": over_objects("scan2cad_success_detected", "detected"),
    "scan2cad_success_every_axis": over_objects("scan2cad_success_every_axis"),
    "translation_error_m": over_objects("translation_error_m_mean", "replaced"),
    "translation_error_m_median": per_room("cad", "translation_error_m_median", np.median),
    "rotation_error_rad": over_objects("rotation_error_rad_mean", "replaced"),
    "rotation_error_rad_median": per_room("cad", "rotation_error_rad_median", np.median),
    "scale_ratio_error": over_objects("scale_ratio_error_mean", "replaced"),
    "penetration_volume_cm3": per_room("cad", "penetration_volume_cm3"),
    "max_penetration_mm": per_room("physics", "max_penetration_mm", np.max),
    "collisions": per_room("physics", "collisions"),
    "conflicts_before": per_room("cad", "conflicts_before"),
    "settled_rooms": per_room("physics", "settled_rooms"),
    "settled_rooms_mujoco": per_room("physics", "settled_rooms_mujoco"),
    "at_rest": _of_loose("at_rest"),
    "at_rest_both": _of_loose("at_rest_both"),
    "colliding": _of_loose("colliding"),
    "held": _of_loose("held"),
    "loose": per_room("physics", "loose"),
    **{f"{name}{BY_TRUTH}": _of_loose(name, BY_TRUTH) for name in ("at_rest_both", "colliding", "held")},
    f"loose{BY_TRUTH}": per_room("physics", f"loose{BY_TRUTH}"),
    "unsettled": per_room("physics", "unsettled"),
    "unsettled_mujoco": per_room("physics", "unsettled_mujoco"),
    "movable": per_room("physics", "movable"),
    "blocked_joints": per_room("physics", "blocked_joints"),
    "joints_found": over_objects("joints_found", "joints_compared"),
    "joints_spurious": per_room("cad", "joints_spurious"),
    "joint_axis_angle_rad": over_objects("joint_axis_angle_rad_mean", "joints_compared"),
    "joint_axis_offset_m": over_objects("joint_axis_offset_m_mean", "joints_compared"),
    "joint_limit_error_revolute_rad": over_objects("joint_limit_error_revolute_rad_mean", "joints_compared"),
    "joint_limit_error_prismatic_m": over_objects("joint_limit_error_prismatic_m_mean", "joints_compared"),
    "joint_value_error_revolute_rad": over_objects("joint_value_error_revolute_rad_mean", "joints_compared"),
    "joint_value_error_prismatic_m": over_objects("joint_value_error_prismatic_m_mean", "joints_compared"),
    "functional": over_objects("functional"),
    "without_style": lambda outcomes: _ratio(outcomes, "without_style", "true_objects"),
    "functional_without_style": over_objects("functional_without_style", "without_style"),
    "functional_class_and_relations": over_objects("functional_class_and_relations"),
    "functional_affordance": over_objects("functional_affordance"),
    "functional_size_and_shape": over_objects("functional_size_and_shape"),
    "functional_appearance": over_objects("functional_appearance"),
    "color_difference": over_objects("color_difference_mean", "replaced"),
    "seconds_per_object": per_room("cad", "seconds_per_object", np.median),
}
"""Name in metrics.json -> figure."""
MEASURES = {name: Measure(figure, interval=not name.startswith("seconds")) for name, figure in FIGURES.items()}
