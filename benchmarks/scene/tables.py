"""table.md of `make bench-scene`."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence

from benchmarks.mapping.tables import markdown, percent, rows_of, with_interval
from benchmarks.scene.experiment import Outcome
from benchmarks.scene.figures_of_merit import FIGURES, interval, paired_difference
from stages.kit.measurement.bootstrap import Interval

Results = Mapping[tuple[str, str], Sequence[Outcome]]
"""(arm, case) -> outcomes, one a room, rooms in the same order everywhere."""

DEGREES = math.degrees(1.0)
"""In one radian."""
PRINTED = (
    "Printed by the thesis (section 2.5.3, SceneNN scenes 225, 231, 249, 322, not these rooms): edit distance 12, 9, "
    "7, 5 from its own maps (wrong supports 1, 0, 3, 1; missing 5, 2, 1, 2; wrong detections 5, 7, 0, 1) and 4, 4, 0, "
    "2 from ground-truth maps. It measures nothing of the CAD replacement.\n"
)


def number(value: float | None, digits: int = 1) -> str:
    """Format a plain number."""
    return "–" if value is None else f"{value:.{digits}f}"


def plain_interval(found: Interval | None) -> str:
    """Format a figure that is no share with its interval."""
    return "–" if found is None else f"{found.value:.1f} [{found.low:.1f}, {found.high:.1f}]"


def graph_table(results: Results, arms: Mapping[str, str], cases: Sequence[str]) -> str:
    """Contact graphs: support edges and edit distance with its parts, means per room."""
    head = ("case", "arm", "rooms", "support F1", "supports", "contains", "on wall", "edit distance", "worst room",
            "wrong supports", "missing", "wrong detections")  # fmt: skip
    rows = []
    # `best_single` has the graph of `ours`.
    own_graphs = {arm: title for arm, title in arms.items() if arm != "best_single"}
    for case, title, outcomes in rows_of(results, own_graphs, cases):
        cells = [with_interval(interval(FIGURES["support_f1"], outcomes))]
        cells += [percent(FIGURES[f"{name}_f1"](outcomes)) for name in ("supports", "contains", "carries_on_wall")]
        cells += [plain_interval(interval(FIGURES["edit_distance"], outcomes))]
        cells += [
            number(FIGURES[name](outcomes))
            for name in ("edit_distance_worst", "wrong_support", "missing_detection", "wrong_detection")
        ]
        rows.append((case, title, str(len(outcomes)), *cells))
    return markdown("Contact graphs", head, rows)


def cad_table(results: Results, arms: Mapping[str, str], cases: Sequence[str]) -> str:
    """CAD replacement: shares over all true objects that were seen, errors over the replaced ones."""
    head = ("case", "arm", "success", "success of detected", "class right", "true model first", "translation [mm]",
            "rotation [deg]", "scale [%]", "replaced", "s an object")  # fmt: skip
    rows = []
    for case, title, outcomes in rows_of(results, arms, cases):
        translation, rotation = (FIGURES[n](outcomes) for n in ("translation_error_m", "rotation_error_rad"))
        rows.append(
            (
                case,
                title,
                with_interval(interval(FIGURES["scan2cad_success"], outcomes)),
                percent(FIGURES["scan2cad_success_detected"](outcomes)),
                percent(FIGURES["class_right"](outcomes)),
                percent(FIGURES["true_model_first"](outcomes)),
                number(None if translation is None else 1000 * translation, 0),
                number(None if rotation is None else DEGREES * rotation),
                percent(FIGURES["scale_ratio_error"](outcomes)),
                percent(FIGURES["replaced"](outcomes)),
                number(FIGURES["seconds_per_object"](outcomes), 2),
            )
        )
    return markdown("CAD replacement (Scan2CAD success: 20 cm, 20 degrees, 20 %, class right)", head, rows)


def physics_table(results: Results, arms: Mapping[str, str], cases: Sequence[str]) -> str:
    """The exported scene: does it stand?"""
    head = ("case", "arm", "rooms that settle", "unsettled of movable", "blocked joints", "deepest penetration [mm]",
            "collisions a room", "shared volume [cm³]")  # fmt: skip
    rows = []
    for case, title, outcomes in rows_of(results, arms, cases):
        rows.append(
            (
                case,
                title,
                percent(FIGURES["settled_rooms"](outcomes)),
                f"{number(FIGURES['unsettled'](outcomes), 2)} of {number(FIGURES['movable'](outcomes))}",
                number(FIGURES["blocked_joints"](outcomes), 2),
                number(FIGURES["max_penetration_mm"](outcomes)),
                number(FIGURES["collisions"](outcomes), 2),
                number(FIGURES["penetration_volume_cm3"](outcomes), 0),
            )
        )
    return markdown("The exported scene in physics", head, rows)


def function_table(results: Results, arms: Mapping[str, str], cases: Sequence[str]) -> str:
    """Functional equivalence by the thesis's four criteria apart, and the joints."""
    head = ("case", "arm", "all four", "class and relations", "affordance", "size and shape", "appearance", "ΔE",
            "joints found", "axis [deg]", "axis [mm]", "value [deg]", "value [mm]")  # fmt: skip
    rows = []
    for case, title, outcomes in rows_of(results, arms, cases):
        scaled = {
            name: None if (value := FIGURES[name](outcomes)) is None else factor * value
            for name, factor in (
                ("joint_axis_angle_rad", DEGREES),
                ("joint_axis_offset_m", 1000.0),
                ("joint_value_error_revolute_rad", DEGREES),
                ("joint_value_error_prismatic_m", 1000.0),
            )
        }
        criteria = ("class_and_relations", "affordance", "size_and_shape", "appearance")
        rows.append(
            (
                case,
                title,
                with_interval(interval(FIGURES["functional"], outcomes)),
                *(percent(FIGURES[f"functional_{name}"](outcomes)) for name in criteria),
                number(FIGURES["color_difference"](outcomes)),
                percent(FIGURES["joints_found"](outcomes)),
                *(number(value) for value in scaled.values()),
            )
        )
    return markdown("Functional equivalence (section 2.1) and joints", head, rows)


def differences(results: Results, cases: Sequence[str]) -> str:
    """`ours` minus the other arms over the same rooms."""
    rows = []
    for case in cases:
        for rival in ("thesis", "best_single"):
            ours, theirs = results.get(("ours", case)), results.get((rival, case))
            if not ours or not theirs:
                continue
            cells = [
                with_interval(paired_difference(FIGURES[name], ours, theirs))
                for name in ("support_f1", "scan2cad_success", "functional", "settled_rooms")
            ]
            cells += [
                plain_interval(paired_difference(FIGURES[name], ours, theirs))
                for name in ("edit_distance", "collisions")
            ]
            rows.append((case, rival, *cells))
    head = ("case", "ours minus", "support F1", "success", "functional", "settled rooms", "edit distance", "collisions")
    return markdown("Paired differences (95 %, bootstrap over rooms)", head, rows)


def by_room(results: Results, arms: Sequence[str], cases: Sequence[str]) -> str:
    """Edit distance, success and settling, room by room."""
    rows = []
    for case in cases:
        shown = [arm for arm in arms if results.get((arm, case))]
        for k, outcome in enumerate(results[shown[0], case] if shown else ()):
            cells = []
            for name in ("edit_distance", "success", "settled"):
                values = []
                for arm in shown:
                    found = results[arm, case][k]
                    if name == "edit_distance":
                        values.append(f"{found.graph['edit_distance']:.0f}")
                    elif name == "success":
                        values.append(percent(found.cad.get("scan2cad_success")))
                    else:
                        values.append("yes" if found.physics["settled_rooms"] else "no")
                cells.append(" / ".join(values))
            rows.append((case, outcome.room, *cells))
    return markdown(f"Room by room ({' / '.join(arms)})", ("case", "room", "edit distance", "success", "settles"), rows)


def failures_table(results: Results, cases: Sequence[str]) -> str:
    """Why objects of `ours` are no success, by class."""
    rows = []
    for case in cases:
        kinds: dict[str, Counter[str]] = {}
        for outcome in results.get(("ours", case), ()):
            for _, class_name, why in outcome.failures:
                kind = why.split()[0] if why.split()[0] in ("missed", "no", "class") else "pose or size"
                kinds.setdefault(class_name, Counter())["no model" if kind == "no" else kind] += 1
        for class_name, counts in sorted(kinds.items(), key=lambda entry: -sum(entry[1].values())):
            rows.append((case, class_name, ", ".join(f"{name} {count}" for name, count in counts.most_common())))
    return markdown("Objects of `ours` that are no success", ("case", "class", "why"), rows)


def unsettled_table(results: Results, cases: Sequence[str]) -> str:
    """What does not stay, is blocked or lies in something, of `ours`."""
    rows = [
        (case, outcome.room, words)
        for case in cases
        for outcome in results.get(("ours", case), ())
        for words in outcome.unsettled
    ]
    return markdown("What does not stand in `ours`", ("case", "room", "what"), rows)
