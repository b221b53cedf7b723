"""Figures of an evaluation as rows for people, with a baseline beside them."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.evaluation import Evaluation
from scenewright.schemas.outside import LARGEST_SHOWN, file_text
from scenewright.stages.report.images import Picture, plot

MISSING = "–"


def percent(value: float) -> str:
    """0.623 -> 62.3 %."""
    return f"{100 * value:.1f} %"


def whole(value: float) -> str:
    """A count."""
    return f"{value:.0f}"


def millimetres(value: float) -> str:
    """Already in mm."""
    return f"{value:.1f} mm"


def from_metres(value: float) -> str:
    """Metres as mm (small) or m."""
    return f"{1000 * value:.0f} mm" if abs(value) < 1.0 else f"{value:.2f} m"


def degrees(value: float) -> str:
    """Radians as degrees."""
    return f"{np.degrees(value):.1f}°"


def yes_no(value: float) -> str:
    """1 -> yes."""
    return "yes" if value >= 0.5 else "no"


@dataclass(frozen=True)
class Measure:
    """A measure as the page names it."""

    key: str
    name: str
    form: Callable[[float], str]
    better: str = ""
    """`higher` or `lower`, where one is better."""


GROUPS: tuple[tuple[str, tuple[Measure, ...]], ...] = (
    (
        "Panoptic map",
        (
            Measure("map/pq", "Panoptic quality PQ, mean over classes", percent, "higher"),
            Measure("map/sq", "Segmentation quality SQ", percent, "higher"),
            Measure("map/rq", "Recognition quality RQ", percent, "higher"),
            Measure("map/pq_stuff", "PQ of stuff", percent, "higher"),
            Measure("map/pq_thing", "PQ of things", percent, "higher"),
            Measure("map/pq_class_agnostic", "PQ of things, whatever the class", percent, "higher"),
            Measure("map/pq_thesis_code", "PQ as the thesis's code counts", percent, "higher"),
            Measure("map/instance_ap50", "Instance AP at IoU 0.5", percent, "higher"),
            Measure("map/instance_ap50_thesis_code", "Instance AP as the thesis's code counts", percent, "higher"),
            Measure("map/instance_ap50_class_agnostic", "Instance AP whatever the class", percent, "higher"),
            Measure("map/accuracy_mean_mm", "Map to true surface, mean", millimetres, "lower"),
            Measure("map/accuracy_p95_mm", "Map to true surface, 95th percentile", millimetres, "lower"),
            Measure("map/mesh_precision", "Map near the true surface", percent, "higher"),
            Measure("map/mesh_recall", "Visible surface that is mapped", percent, "higher"),
        ),
    ),
    (
        "Contact graph",
        (
            Measure("graph/edit_distance", "Edit distance to the true graph", whole, "lower"),
            Measure("graph/true_nodes", "… of true nodes", whole),
            Measure("graph/wrong_supports", "… wrong supports (cost 2 each)", whole, "lower"),
            Measure("graph/missing_detections", "… missing detections", whole, "lower"),
            Measure("graph/wrong_detections", "… wrong detections", whole, "lower"),
            Measure("graph/support_f1", "Support edges with the right relation, F1", percent, "higher"),
            Measure("graph/any_support_f1", "Support edges whatever the relation, F1", percent, "higher"),
            Measure("graph/supports_f1", "… standing on", percent, "higher"),
            Measure("graph/contains_f1", "… standing in", percent, "higher"),
            Measure("graph/carries_on_wall_f1", "… on a wall", percent, "higher"),
            Measure("graph/hangs_from_f1", "… hanging", percent, "higher"),
            Measure("graph/also_supports_f1", "Second carriers, F1", percent, "higher"),
            Measure("graph/leans_on_f1", "Leaning, F1", percent, "higher"),
            Measure("graph/proximal_f1", "Proximal edges, F1", percent, "higher"),
            Measure("graph/obb_ap50_observed", "Oriented-box AP before refinement", percent, "higher"),
            Measure("graph/obb_ap50_refined", "Oriented-box AP after refinement", percent, "higher"),
            Measure("graph/obb_ap50_refined_thesis_code", "… as the thesis's code counts", percent, "higher"),
        ),
    ),
    (
        "CAD scene",
        (
            Measure("cad/replaced", "Things replaced by CAD models", whole, "higher"),
            Measure("cad/true_objects", "… of true things seen", whole),
            Measure("cad/class_match", "Right class", percent, "higher"),
            Measure("cad/model_top1", "The very model", percent, "higher"),
            Measure("cad/model_in_candidates", "The very model among the candidates", percent, "higher"),
            Measure("cad/position_error_m_mean", "Position error, mean", from_metres, "lower"),
            Measure("cad/yaw_symmetric_within_20deg", "Yaw within 20°, up to symmetry", percent, "higher"),
            Measure("cad/yaw_error_symmetric_rad_median", "Yaw error up to symmetry, median", degrees, "lower"),
            Measure("cad/yaw_error_rad_median", "Yaw error as it is, median", degrees, "lower"),
            Measure("cad/box_iou_mean", "Box IoU, mean", percent, "higher"),
            Measure("cad/joint_error_revolute_rad_mean", "Hinge angle error, mean", degrees, "lower"),
            Measure("cad/joint_error_prismatic_m_mean", "Drawer opening error, mean", from_metres, "lower"),
            Measure("cad/open_state_match", "Open or closed as in truth", percent, "higher"),
            Measure("cad/conflicts_after", "Collisions left after the global check", whole, "lower"),
        ),
    ),
    (
        "CAD replacement against the truth",
        (
            Measure(
                "replacement/scan2cad_success", "Right class, within 20 cm, 20°, 20 % (Scan2CAD)", percent, "higher"
            ),
            Measure("replacement/scan2cad_success_detected", "… of the detected things", percent, "higher"),
            Measure("replacement_before_check/scan2cad_success", "… before the global check", percent, "higher"),
            Measure("replacement/true_model_first", "The true model is the first candidate", percent, "higher"),
            Measure("replacement/class_right", "Class of the chosen model right", percent, "higher"),
            Measure("replacement/translation_error_m_mean", "Distance of the middles, mean", from_metres, "lower"),
            Measure("replacement/rotation_error_rad_mean", "Rotation up to symmetry, mean", degrees, "lower"),
            Measure("replacement/scale_ratio_error_mean", "Extents off, mean", percent, "lower"),
            Measure("replacement/max_penetration_mm", "Deepest penetration", millimetres, "lower"),
            Measure("replacement_before_check/max_penetration_mm", "… before the global check", millimetres, "lower"),
            Measure("replacement/collisions", "Pairs more than 5 mm in each other", whole, "lower"),
            Measure("replacement_before_check/collisions", "… before the global check", whole, "lower"),
            Measure("replacement/joints_found", "True joints that have a counterpart", percent, "higher"),
            Measure("replacement/joint_axis_offset_m_mean", "Hinge axes off by, mean", from_metres, "lower"),
            Measure("replacement/functional_class_and_relations", "Same class and carrier", percent, "higher"),
            Measure("replacement/functional_affordance", "Same affordances", percent, "higher"),
            Measure("replacement/functional_size_and_shape", "Similar size and shape", percent, "higher"),
            Measure("replacement/functional_appearance", "Similar colour", percent, "higher"),
            Measure("replacement/functional", "Functionally equivalent: all four", percent, "higher"),
        ),
    ),
    (
        "Camera",
        (
            Measure("trajectory/ate_rmse_m", "Trajectory error, root mean square", from_metres, "lower"),
            Measure("trajectory/rotation_error_mean_rad", "Rotation error, mean", degrees, "lower"),
        ),
    ),
    (
        "Plan",
        (
            Measure("plan/goal_reached", "Goal reached", yes_no, "higher"),
            Measure("plan/actions", "Actions", whole),
            Measure("plan/checks_held", "Conditions that hold afterwards", whole, "higher"),
            Measure("plan/checks", "… of conditions checked", whole),
        ),
    ),
    (
        "Counts",
        (
            Measure("counts/frames", "Frames used", whole),
            Measure("counts/frames_dropped", "Frames dropped", whole),
            Measure("counts/entities", "Entities in the map", whole),
            Measure("counts/labelled_vertices_share", "Map surface with a label", percent),
            Measure("counts/support_edges", "Support edges of things", whole),
            Measure("counts/edges_proximal", "Proximal edges", whole),
            Measure("counts/floor_height_rms_m", "Floor off z = 0, root mean square", from_metres),
            Measure("counts/floor_tilt_rad", "Floor tilt", degrees),
            Measure("counts/bodies", "Bodies of the interactive scene", whole),
            Measure("counts/joints", "Joints", whole),
        ),
    ),
)


@dataclass(frozen=True)
class Row:
    """A line of the table."""

    name: str
    value: str
    interval: str
    baseline: str
    better: str


@dataclass(frozen=True)
class DataTable:
    """A CSV table of the evaluation."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def metric_groups(evaluation: Evaluation, baseline: Evaluation | None) -> list[tuple[str, list[Row]]]:
    """Return the groups of rows of which at least one value is defined."""
    ours = evaluation.info.metrics
    theirs = baseline.info.metrics if baseline is not None else {}
    groups = []
    for title, measures in GROUPS:
        rows = [
            Row(m.name, _form(m, ours.get(m.key)), _interval(m, ours), _form(m, theirs.get(m.key)), m.better)
            for m in measures
            if ours.get(m.key) is not None or theirs.get(m.key) is not None
        ]
        if rows:
            groups.append((title, rows))
    return groups


def _form(measure: Measure, value: float | None) -> str:
    return MISSING if value is None else measure.form(value)


def _interval(measure: Measure, metrics: dict[str, float | None]) -> str:
    low, high = metrics.get(f"{measure.key}_low"), metrics.get(f"{measure.key}_high")
    return "" if low is None or high is None else f"{measure.form(low)} to {measure.form(high)}"


def read_tables(evaluation: Evaluation) -> list[DataTable]:
    """Read every table of the evaluation for display (numbers rounded). Raises BadInput for one that is none."""
    tables = []
    for path in sorted((evaluation.root / "tables").glob("*.csv")):
        try:
            rows = list(csv.reader(io.StringIO(file_text(path, LARGEST_SHOWN), newline="")))
        except csv.Error as error:
            raise BadInput(f"{path}: no table: {error}", hint="evaluate again") from None
        if not rows:
            continue
        title = path.stem.replace("_", " ")
        markdown = path.with_suffix(".md")
        if markdown.is_file():
            title = file_text(markdown, LARGEST_SHOWN).split("\n", 1)[0].removeprefix("### ")
        tables.append(DataTable(title, tuple(rows[0]), tuple(tuple(_rounded(c) for c in row) for row in rows[1:])))
    return tables


def _rounded(cell: str) -> str:
    if cell == "":
        return MISSING
    if "." in cell or "e-" in cell:
        try:
            return f"{float(cell):.3f}"
        except ValueError:
            return cell
    return cell


def read_plots(evaluation: Evaluation) -> list[Picture]:
    """Embed every plot of the evaluation."""
    return [plot(path, path.stem.replace("_", " ")) for path in sorted((evaluation.root / "plots").glob("*.png"))]


def all_metrics(evaluation: Evaluation) -> list[tuple[str, str]]:
    """Every metric by name, as text."""
    return [
        (name, MISSING if value is None else f"{value:.4g}") for name, value in sorted(evaluation.info.metrics.items())
    ]
