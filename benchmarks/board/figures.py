"""From records to figures: a pure function, so that anybody can make the published ones again.

A figure of generated rooms is the mean over rooms of one number a room, with Student's interval. An arm that ended
without a scene has found nothing: its shares are zero.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.board.records import Line, by_case
from benchmarks.board.statistics import LEAST_ROOMS, Spread, over_rooms, paired
from benchmarks.tabulation import Figure

SHARES = (
    "pq",
    "pq_with_ghosts",
    "pq_thesis_form",
    "instance_ap",
    "support_f1",
    "contains_f1",
    *(
        f"{name}{size}"
        for name in ("found", "named", "standing", "replaced", "functional", "functional_of_found", "scan2cad")
        for size in ("", "_large", "_small")
    ),
    *(f"equal_{name}" for name in ("class_and_relations", "affordance", "size_and_shape", "appearance")),
    "joints_found",
    "at_rest_of_true",
    "at_rest_of_found",
    "held_of_found",
    "colliding_of_found",
    "settled",
    "success",
    "literals",
    "success in the map",
)
"""Figures between 0 and 1; the last three are of tasks."""
ALL_LOST = frozenset(
    name
    for name in SHARES
    if "of_found" not in name and not name.startswith("equal_") and name not in ("joints_found", "success in the map")
)
"""Those that are 0 where there is no scene; of what was found, which is nothing, there is no share."""
NUMBERS = {
    "ghosts": "",
    "false_things": "",
    "edit_distance": "",
    "things": "",
    "things_large": "",
    "things_small": "",
    "found_count_large": "",
    "named_count_large": "",
    "standing_count_large": "",
    "loose_true": "",
    "loose_found": "",
    "joints_false": "",
    "centre_off_mm": "mm",
    "minutes": "min",
    "failed": "",
}
"""Other figures, a room, and their units."""
OF_ROOMS = ("public", "sealed", "tasks")
"""Parts of which a line is a room."""
DIFFERENCES = (("ours", "reference"), ("ours", "thesis"))
DEVIATION, LEAST = "deviation between rooms", "least difference seen"
PER_MINUTE = 60.0


@dataclass(frozen=True)
class Version:
    """The records of one method."""

    commit: str
    lines: Sequence[Line]


def value_of(line: Line, name: str) -> float | None:
    """Return a figure of a trial; None where it is undefined there."""
    if name == "minutes":
        return sum(line.seconds.values()) / PER_MINUTE if line.seconds else None
    if name == "failed":
        return line.figures.get("failed", 0.0)
    if line.figures.get("failed") and name in ALL_LOST:
        return 0.0
    return line.figures.get(name)


def rooms_figures(lines: Iterable[Line]) -> dict[str, Figure]:
    """Return `<arm>/<part>/<case>/<measure>` of lines of generated rooms, with deviations and differences of arms."""
    own = (line for line in lines if line.trial.part in OF_ROOMS)
    groups = {group: {line.trial.seed: line for line in found} for group, found in by_case(own).items()}
    figures: dict[str, Figure] = {}
    for (part, case, arm), by_room in groups.items():
        for name in (*SHARES, *NUMBERS):
            values = [value for line in by_room.values() if (value := value_of(line, name)) is not None]
            if (spread := over_rooms(values, share=name in SHARES)) is None:
                continue
            place = f"{arm}/{part}/{case}"
            figures[f"{place}/{name}"] = shown(spread, NUMBERS.get(name, ""), least=0.0)
            if name in SHARES and spread.deviation is not None:
                figures[f"{place}, {DEVIATION}/{name}"] = Figure(spread.deviation, None, None, spread.rooms, "")
            if name in SHARES and spread.least_seen is not None:
                figures[f"{place}, {LEAST}/{name}"] = Figure(spread.least_seen, None, None, spread.rooms, "")
    for first, second in DIFFERENCES:
        for part, case in dict.fromkeys((part, case) for part, case, _ in groups):
            one, other = groups.get((part, case, first)), groups.get((part, case, second))
            if one and other:
                figures |= differences(f"{first} less {second}/{part}/{case}", one, other)
    return figures


def differences(place: str, first: Mapping[str, Line], second: Mapping[str, Line]) -> dict[str, Figure]:
    """Return the paired differences of the shares over the rooms that both have."""
    rooms = [room for room in first if room in second]
    figures = {}
    for name in SHARES:
        values = [[value_of(lines[room], name) for room in rooms] for lines in (first, second)]
        if (spread := paired(*values)) is not None:
            figures[f"{place}/{name}"] = shown(spread, "")
    return figures


def versions_figures(versions: Sequence[Version]) -> dict[str, Figure]:
    """Return `<commit>/versions/<part>/<case>/<measure>` of what every version of the method did in five public
    rooms or more, and `<commit> less <first commit>/...`, paired by room."""
    figures: dict[str, Figure] = {}
    first: dict[tuple[str, str, str], dict[str, Line]] = {}
    for version in versions:
        for group, found in by_case(version.lines).items():
            part, case, arm = group
            if part != "public" or arm != "ours":
                continue
            own = {line.trial.seed: line for line in found}
            if len(own) < LEAST_ROOMS:
                continue
            place = f"{version.commit}/versions/{part}/{case}"
            for name in SHARES:
                values = [value for line in own.values() if (value := value_of(line, name)) is not None]
                if (spread := over_rooms(values, share=True)) is not None:
                    figures[f"{place}/{name}"] = shown(spread, "")
            if group in first:
                before = next(iter(versions)).commit
                figures |= differences(f"{version.commit} less {before}/versions/{part}/{case}", own, first[group])
            first.setdefault(group, own)
    return figures


def others_figures(lines: Iterable[Line]) -> dict[str, Figure]:
    """Return `<arm>/others/<system>/<measure>`, with the intervals that the systems' own experiments made."""
    figures = {}
    for line in lines:
        if line.trial.part == "others":
            own = line.figures
            for name in (name for name in own if f"{name} cases" in own):
                low, high = own.get(f"{name} low"), own.get(f"{name} high")
                place = f"{line.trial.arm}/others/{line.trial.case}"
                figures[f"{place}/{name}"] = Figure(own[name], low, high, round(own[f"{name} cases"]), "")
    return figures


def logs_figures(lines: Iterable[Line]) -> dict[str, Figure]:
    """Return `ours/real <case>/<log>/<measure>` of recorded logs, each by itself: they are too few for an interval."""
    return {
        f"{line.trial.arm}/real {line.trial.case}/{line.trial.seed}/{name}": Figure(value, None, None, None, "")
        for line in lines
        if line.trial.part == "real"
        for name, value in line.figures.items()
    }


def line_for_a_lab(lines: Sequence[Line]) -> str:
    """Return what a lab wants to know of rooms under one condition, in a sentence. `lines`: of one arm, one a room."""

    def total(name: str) -> float:
        return sum(line.figures.get(name, 0.0) for line in lines)

    large = max(total("things_large"), 1.0)
    found, named, standing = (10 * total(f"{name}_count_large") / large for name in ("found", "named", "standing"))
    off = [line.figures["centre_off_mm"] for line in lines if "centre_off_mm" in line.figures]
    minutes = [value for line in lines if (value := value_of(line, "minutes")) is not None]
    return (
        f"of ten large things {found:.1f} are found, {named:.1f} named right, {standing:.1f} stand where they stood; "
        f"{total('false_things') / max(len(lines), 1):.1f} false things a room; "
        f"{float(np.median(off)) if off else float('nan'):.0f} mm off; "
        f"{float(np.mean(minutes)) if minutes else float('nan'):.1f} minutes of a processor"
    )


def shown(spread: Spread, unit: str, least: float | None = None) -> Figure:
    """Return a mean as it stands in a file of figures, to six digits; nothing is below `least`."""
    low, high = (None if value is None else _digits(value) for value in (spread.low, spread.high))
    low = low if low is None or least is None else max(low, least)
    return Figure(_digits(spread.mean), low, high, spread.rooms, unit)


def _digits(value: float) -> float:
    return float(f"{value:.6g}")
