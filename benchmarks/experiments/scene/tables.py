"""table.md of `make bench-scene`."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence

from benchmarks.experiments.scene.arms import REAL
from benchmarks.generated_rooms import CLUTTER
from benchmarks.results import Results, seeds_line
from benchmarks.tabulation import markdown, number, percent, with_interval

Column = tuple[str, str, Callable[[float | None], str] | None]
"""Head, measure, how it is written; None: a share with its interval."""
DEGREES = math.degrees(1.0)
"""In one radian."""
PRINTED = (
    "Printed by the thesis (section 2.5.3, SceneNN scenes 225, 231, 249, 322, not these rooms): edit distance 12, 9, "
    "7, 5 from its own maps (wrong supports 1, 0, 3, 1; missing 5, 2, 1, 2; wrong detections 5, 7, 0, 1) and 4, 4, 0, "
    "2 from ground-truth maps. It measures nothing of the CAD replacement.\n"
)


def plain(value: float | None) -> str:
    """A number."""
    return number(value)


def millimetres(value: float | None) -> str:
    """A length."""
    return number(value, 1, 1000.0)


def degrees(value: float | None) -> str:
    """An angle."""
    return number(value, 1, DEGREES)


def hundredths(value: float | None) -> str:
    """A mean count."""
    return number(value, 2)


def whole(value: float | None) -> str:
    """A number without digits after the point."""
    return number(value, 0)


GRAPHS: tuple[Column, ...] = (
    ("support F1", "support_f1", None),
    ("supports", "supports_f1", percent),
    ("contains", "contains_f1", percent),
    ("on wall", "carries_on_wall_f1", percent),
    ("edit distance", "edit_distance", plain),
    ("worst room", "edit_distance_worst", plain),
    ("wrong supports", "wrong_support", plain),
    ("missing", "missing_detection", plain),
    ("wrong detections", "wrong_detection", plain),
)
REPLACEMENT: tuple[Column, ...] = (
    ("success", "scan2cad_success", None),
    ("success of detected", "scan2cad_success_detected", percent),
    ("class right", "class_right", percent),
    ("true model first", "true_model_first", percent),
    ("translation [mm]", "translation_error_m", millimetres),
    ("rotation [deg]", "rotation_error_rad", degrees),
    ("scale [%]", "scale_ratio_error", percent),
    ("replaced", "replaced", percent),
    ("s an object", "seconds_per_object", hundredths),
)
PHYSICS: tuple[Column, ...] = (
    ("rooms that settle", "settled_rooms", percent),
    ("unsettled", "unsettled", hundredths),
    ("of movable", "movable", plain),
    ("blocked joints", "blocked_joints", hundredths),
    ("deepest penetration [mm]", "max_penetration_mm", plain),
    ("collisions a room", "collisions", hundredths),
    ("shared volume [cm³]", "penetration_volume_cm3", whole),
)
FUNCTION: tuple[Column, ...] = (
    ("all four", "functional", None),
    ("class and relations", "functional_class_and_relations", percent),
    ("affordance", "functional_affordance", percent),
    ("size and shape", "functional_size_and_shape", percent),
    ("appearance", "functional_appearance", percent),
    ("ΔE", "color_difference", plain),
    ("joints found", "joints_found", percent),
    ("axis [deg]", "joint_axis_angle_rad", degrees),
    ("axis [mm]", "joint_axis_offset_m", millimetres),
    ("value [deg]", "joint_value_error_revolute_rad", degrees),
    ("value [mm]", "joint_value_error_prismatic_m", millimetres),
)


def table(results: Results) -> str:
    """Return table.md."""
    generated = [case for case in results.cases if case != REAL]
    return "\n".join(
        [
            seeds_line(results)
            + f"Generated rooms, clutter {CLUTTER}, {results.bench.parameters.frames} frames of 640x480 each, depth "
            "noise, voxels of 20 mm. Shares in per cent. What was missed counts as failed.\n",
            columns_table(results, "Contact graphs", GRAPHS, results.cases),
            PRINTED,
            columns_table(
                results, "CAD replacement (Scan2CAD success: 20 cm, 20 degrees, 20 %, class right)", REPLACEMENT,
                generated,
            ),
            columns_table(results, "The exported scene in physics", PHYSICS, results.cases),
            columns_table(
                results, "Functional equivalence (section 2.1: the four criteria apart) and joints", FUNCTION, generated
            ),
            differences(results, generated),
            by_room(results),
            failures_table(results, generated),
            unsettled_table(results),
        ]
    )  # fmt: skip


def columns_table(results: Results, title: str, columns: Sequence[Column], cases: Sequence[str]) -> str:
    """Return a line an arm and case. `best_single` has the graph of `ours` and no line in that table."""
    rows = []
    for case in cases:
        for arm in results.arms(case):
            if columns is GRAPHS and arm == "best_single":
                continue
            cells = [
                with_interval(results.interval(arm, case, name)) if write is None
                else write(results.value(arm, case, name))
                for _, name, write in columns
            ]  # fmt: skip
            rows.append((case, results.experiment.arms[arm], str(len(results.of(arm, case))), *cells))
    return markdown(title, ("case", "arm", "rooms", *(head for head, _, _ in columns)), rows)


def differences(results: Results, cases: Sequence[str]) -> str:
    """`ours` minus the other arms over the same rooms."""
    rows = []
    for case in cases:
        for first, second in results.experiment.pairs:
            if {first, second} <= set(results.arms(case)):
                cells = [
                    with_interval(results.difference(first, second, case, name), 1, scale)
                    for name, scale in COMPARED.items()
                ]
                rows.append((case, second, *cells))
    head = ("case", "ours minus", *(name.replace("_", " ") for name in COMPARED))
    return markdown("Paired differences (95 %, bootstrap over rooms)", head, rows)


COMPARED = {
    "support_f1": 100.0, "scan2cad_success": 100.0, "functional": 100.0, "settled_rooms": 100.0, "edit_distance": 1.0,
    "collisions": 1.0,
}  # fmt: skip
"""Measure -> factor: shares in points."""


def by_room(results: Results) -> str:
    """Edit distance, success and settling, room by room."""
    rows = []
    for case in results.cases:
        for room in results.seeds(case):
            found = [outcome for arm in results.arms(case) if (outcome := results.get(arm, case, room))]
            cells = (
                [f"{outcome.graph['edit_distance']:.0f}" for outcome in found],
                [percent(outcome.cad.get("scan2cad_success")) for outcome in found],
                ["yes" if outcome.physics["settled_rooms"] else "no" for outcome in found],
            )
            rows.append((case, room, *(" / ".join(values) for values in cells)))
    head = ("case", "room", "edit distance", "success", "settles")
    return markdown(f"Room by room ({' / '.join(results.arms())})", head, rows)


def failures_table(results: Results, cases: Sequence[str]) -> str:
    """Why objects of `ours` are no success, by class."""
    rows = []
    for case in cases:
        kinds: dict[str, Counter[str]] = {}
        for outcome in results.of("ours", case):
            for _, class_name, why in outcome.failures:
                kind = why.split()[0] if why.split()[0] in ("missed", "no", "class") else "pose or size"
                kinds.setdefault(class_name, Counter())["no model" if kind == "no" else kind] += 1
        for class_name, counts in sorted(kinds.items(), key=lambda entry: -sum(entry[1].values())):
            rows.append((case, class_name, ", ".join(f"{name} {count}" for name, count in counts.most_common())))
    return markdown("Objects of `ours` that are no success", ("case", "class", "why"), rows)


def unsettled_table(results: Results) -> str:
    """What does not stay, is blocked or lies in something, of `ours`."""
    rows = [
        (trial.case, trial.seed, words)
        for trial, outcome in results.records.items()
        if trial.arm == "ours"
        for words in outcome.unsettled
    ]
    return markdown("What does not stand in `ours`", ("case", "room", "what"), rows)
