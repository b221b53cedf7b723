"""What stands below the figures of the experiment `scene`: why objects are no success, and what does not stand."""

from __future__ import annotations

from collections import Counter

from benchmarks.experiment import Results
from benchmarks.tabulation import markdown

PRINTED = (
    "Printed by the thesis (section 2.5.3, SceneNN scenes 225, 231, 249, 322, not these rooms): edit distance 12, 9, "
    "7, 5 from its own maps (wrong supports 1, 0, 3, 1; missing 5, 2, 1, 2; wrong detections 5, 7, 0, 1) and 4, 4, 0, "
    "2 from ground-truth maps. It measures nothing of the CAD replacement.\n"
)


def notes(results: Results) -> str:
    """Return all of it."""
    return "\n".join([PRINTED, failures_table(results), unsettled_table(results)])


def failures_table(results: Results) -> str:
    """Why objects of `ours` are no success, by class."""
    rows = []
    for case in results.cases:
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
