"""Vision on rendered tables: precision, recall, errors, heights; per class, tier, light level and arm.

    python -m benchmarks.tidy.detect --out FOLDER [--scenes N] [--tuning] [--tiers NAME ...]

Reporting seeds are 1000 and up, tuning seeds (`--tuning`) 0 and up. Light levels and colour schemes alternate from seed
to seed. Writes metrics.json (`<arm>/<case>/detect/<class>/<measure>`) and table.md; milliseconds are CPU time of one
thread for one frame of 1280 x 720.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import defaultdict
from pathlib import Path

import numpy as np

from benchmarks.tidy.detection_score import Match, compare, measures
from stages.tableware.vision.detection import detect
from stages.tableware.vision.thesis_detection import detect_thesis
from stages.tableware.world.overhead import LEVELS, SCHEMES, Scheme, overhead_camera, render_overhead
from stages.tableware.world.scenes import make_table

ARMS = {"ours": detect, "thesis": detect_thesis}
REPORTING, TUNING = 1000, 0
TIERS = ("tier1", "tier2", "tier3")


def conditions(seed: int) -> tuple[str, Scheme]:
    """Return the light level and the scheme of a seed: six in a row see all."""
    return list(LEVELS)[seed % 3], SCHEMES[seed // 3 % 2]


def main() -> None:
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.tidy.detect", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--scenes", type=int, default=66, help="seeds a tier")
    parser.add_argument("--tuning", action="store_true", help="tuning seeds instead of reporting seeds")
    parser.add_argument("--tiers", nargs="+", default=list(TIERS))
    parser.add_argument("--seconds", type=float, default=None, help="no new seed after so much wall time")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    matches: dict[tuple[str, str], list[Match]] = defaultdict(list)
    seconds: dict[str, list[float]] = defaultdict(list)
    view = overhead_camera()
    begun, seeds = time.monotonic(), 0
    first = TUNING if options.tuning else REPORTING
    for seed in range(first, first + options.scenes):
        if options.seconds is not None and time.monotonic() - begun > options.seconds:
            break
        level, scheme = conditions(seed)
        seeds += 1
        for tier in options.tiers:
            table = make_table(tier, seed)
            color, depth = render_overhead(table, seed, level, scheme, view=view)
            for arm, look in ARMS.items():
                if seed == first and tier == options.tiers[0]:
                    look(color, depth, view)  # compiles what is compiled; its time is not kept
                started = time.process_time()
                found = look(color, depth, view)
                seconds[arm].append(time.process_time() - started)
                rows = compare(table, found)
                for case in (tier, level, scheme, "all"):
                    matches[arm, case].extend(rows)
    result = {
        f"{arm}/{case}/detect/{kind}/{name}": value
        for (arm, case), rows in matches.items()
        for kind, values in measures(rows).items()
        for name, value in values.items()
    }
    result |= {f"{arm}/detect/milliseconds_median": 1e3 * float(np.median(times)) for arm, times in seconds.items()}
    result |= {f"{arm}/detect/milliseconds_least": 1e3 * float(np.min(times)) for arm, times in seconds.items()}
    result["seeds_per_tier"] = float(seeds)
    known = {name: round(value, 5) for name, value in result.items() if not np.isnan(value)}
    (options.out / "metrics.json").write_text(json.dumps(known, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    (options.out / "table.md").write_text(table_text(result, seeds, options.tiers), encoding="utf-8")


def table_text(result: dict[str, float], seeds: int, tiers: list[str]) -> str:
    """Return the Markdown table of all arms and cases."""
    columns = ("items", "found", "precision", "recall", "center_mm", "center_p95_mm", "angle_deg", "head_right",
               "height_right")  # fmt: skip
    lines = [f"{seeds} seeds a tier ({', '.join(tiers)}).", "", "| arm | case | class | " + " | ".join(columns) + " |"]
    lines.append("|---" * (3 + len(columns)) + "|")
    rows = sorted({name.rsplit("/", 1)[0] for name in result if name.count("/") == 4})
    for row in rows:
        arm, case, _, kind = row.split("/")
        values = [result.get(f"{row}/{column}", float("nan")) for column in columns]
        cells = ["" if np.isnan(value) else f"{value:.0f}" if column in ("items", "found") else f"{value:.3f}"
                 for column, value in zip(columns, values, strict=True)]  # fmt: skip
        lines.append(f"| {arm} | {case} | {kind} | " + " | ".join(cells) + " |")
    for arm in ARMS:
        median, least = (result[f"{arm}/detect/milliseconds_{name}"] for name in ("median", "least"))
        lines += ["", f"{arm}: {median:.0f} ms a frame (median), {least:.0f} ms (least)."]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
