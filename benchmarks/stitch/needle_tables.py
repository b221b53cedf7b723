"""The needle benchmark's cases as the issue names them, and their tables."""

from __future__ import annotations

from benchmarks.stitch.needle_trials import CASES
from stages.suture.evaluation.judgement import Estimate
from stages.suture.evaluation.needle_figures import metrics as figures_of
from stages.suture.evaluation.needle_figures import rows


def groups(records: list[Estimate]) -> dict[str, list[Estimate]]:
    """Return the issue's cases (`needle_visible`, `needle_all`, ...) with their records of all arms.

    Names without an ending are of the rendered form; `_geometry` and `_endoscope` say the other forms.
    """
    by_case: dict[str, list[Estimate]] = {name: [] for name in CASES}
    for record in records:
        by_case.setdefault(record.case, []).append(record)
    named = {
        "needle_visible": [r for r in by_case["rendered"] if r.visible],
        "needle_all": by_case["rendered"],
        "needle_visible_geometry": [r for r in by_case["geometry"] if r.visible],
        "needle_all_geometry": by_case["geometry"],
        "needle_visible_filtered": [r for r in by_case["geometry_filtered"] if r.visible],
        "needle_all_filtered": by_case["geometry_filtered"],
        "needle_miscalibrated": [r for r in by_case["geometry_miscalibrated"] if r.visible],
        "needle_corner_left": by_case["geometry_corner_left"],
        "needle_corner_right": by_case["geometry_corner_right"],
        "needle_random": by_case["geometry"],
        "needle_visible_endoscope": [r for r in by_case["geometry_endoscope"] if r.visible],
        "needle_all_endoscope": by_case["geometry_endoscope"],
    }
    return {name: found for name, found in named.items() if found}


def metrics(records: list[Estimate]) -> dict[str, float]:
    """Return `<arm>/<case>/<measure>` -> number."""
    return figures_of(groups(records))


def table(records: list[Estimate]) -> str:
    """Return the tables in Markdown: by case, then by place and by holder, edge-on views and all."""
    lines = ["# The needle's pose", "", *rows("case", groups(records))]
    views = [record for record in records if record.case == "geometry"]
    for key in ("place", "holder"):
        values = sorted({getattr(record, key) for record in views})
        found = {value: [r for r in views if getattr(r, key) == value and r.visible] for value in values}
        lines += ["", f"## Visible views of the geometry form by {key}", "", *rows(key, found)]
    bins = ((0, 5), (5, 15), (15, 30), (30, 60), (60, 90))
    turned = {f"{low}–{high}°": [r for r in views if low < r.degrees_from_edge_on <= high] for low, high in bins}
    lines += ["", "## Geometry form by angle from edge-on", "", *rows("angle", turned)]
    return "\n".join(lines) + "\n"
