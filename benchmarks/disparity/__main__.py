"""`make bench-disparity`: bad-2, end-point error, coverage and CPU time, ours beside OpenCV's matchers in one run.

    python -m benchmarks.disparity --data FOLDER --out FOLDER [--quick] [--tuning] [--cases NAME ...]

Writes metrics.json (`<arm>/<case>/<measure>`; `pairs/<case>/count`), table.md and a picture of the first pair of every
case. Cases that are not asked for keep what an earlier run measured.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import cv2
import numpy as np

from benchmarks.disparity.arms import ARMS
from benchmarks.disparity.cases import CASES, Pair, Setting
from stages.kit.stereo.disparity_map import DisparityMap
from stages.kit.stereo.pictures import confidence_colors, disparity_colors
from stages.kit.stereo.search_range import search_range
from stages.kit.stereo.semi_global import gray_of

MEASURES = {
    "bad2": "bad-2, of known [%]",
    "bad2_all": "bad-2, holes are bad [%]",
    "epe": "end-point error [px]",
    "median": "median error [px]",
    "coverage": "known [%]",
    "cpu_seconds": "CPU s a frame",
}
SHOWN = ("opencv_default", "ours")


def scores(found: DisparityMap, truth: np.ndarray) -> dict[str, float]:
    """Return the figures of one map where the truth is known; shares are per cent."""
    there = np.isfinite(truth)
    both = there & found.known
    error = np.abs(found.disparity[both] - truth[both])
    wrong = float((error > 2).sum())
    return {
        "bad2": 100 * wrong / max(len(error), 1),
        "bad2_all": 100 * (wrong + (there & ~found.known).sum()) / there.sum(),
        "epe": float(error.mean()) if len(error) else float("nan"),
        "median": float(np.median(error)) if len(error) else float("nan"),
        "coverage": 100 * len(error) / there.sum(),
    }


def measured(pair: Pair, arm: str) -> tuple[DisparityMap, dict[str, float]]:
    """Return what an arm makes of a pair, with its scores and CPU time (one thread)."""
    limits = search_range(gray_of(pair.left), gray_of(pair.right))
    started = time.process_time()
    found = ARMS[arm][1](pair.left, pair.right, limits)
    spent = time.process_time() - started
    return found, scores(found, pair.truth) | {"cpu_seconds": spent}


def picture(pair: Pair, maps: dict[str, DisparityMap]) -> np.ndarray:
    """Return left eye, truth (made visible where it is sparse), the shown arms and our confidence in one row."""
    limits = tuple(np.nanpercentile(pair.truth, [1, 99]))
    truth = pair.truth
    if np.isfinite(truth).mean() < 0.1:  # single features: draw them larger
        grown = cv2.dilate(np.nan_to_num(truth), np.ones((9, 9), np.uint8))
        truth = np.where(grown > 0, grown, np.nan)
    tiles = [pair.left, disparity_colors(truth, limits)]
    tiles += [disparity_colors(maps[arm].disparity, limits) for arm in SHOWN]
    tiles.append(confidence_colors(maps[SHOWN[-1]].confidence))
    height = 300
    sized = [cv2.resize(tile, (round(tile.shape[1] * height / tile.shape[0]), height)) for tile in tiles]
    return np.hstack(sized)


def table(metrics: dict[str, float]) -> str:
    """Return one table a case, in Markdown."""
    parts = []
    for case in CASES:
        count = int(metrics.get(f"pairs/{case}/count", 0))
        if not count:
            continue
        parts += [f"### {case} ({count} pair{'s' if count > 1 else ''})", ""]
        parts += ["| matcher | " + " | ".join(MEASURES.values()) + " |", "|---|" + "---|" * len(MEASURES)]
        for arm, (words, _) in ARMS.items():
            cells = [f"{metrics[f'{arm}/{case}/{measure}']:.2f}" for measure in MEASURES]
            parts.append(f"| {words} | {' | '.join(cells)} |")
        parts.append("")
    return "\n".join(parts)


def main() -> None:
    """Run the arms on the cases; means over the pairs of a case."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--tuning", action="store_true")
    parser.add_argument("--cases", nargs="+", choices=tuple(CASES), default=tuple(CASES))
    options = parser.parse_args()
    cv2.setNumThreads(1)
    options.out.mkdir(parents=True, exist_ok=True)
    setting = Setting(options.data, options.out / "logs", options.quick, options.tuning)
    kept = options.out / "metrics.json"
    metrics: dict[str, float] = json.loads(kept.read_text()) if kept.exists() else {}
    for case in options.cases:
        rows: dict[str, list[dict[str, float]]] = {arm: [] for arm in ARMS}
        for number, pair in enumerate(CASES[case](setting)):
            maps = {}
            for arm in ARMS:
                maps[arm], figures = measured(pair, arm)
                rows[arm].append(figures)
            if number == 0:
                cv2.imwrite(str(options.out / f"{case}.png"), picture(pair, maps)[..., ::-1])
            print(f"{pair.name}: " + ", ".join(f"{arm} {rows[arm][-1]['bad2']:.1f}" for arm in ARMS), flush=True)
        metrics[f"pairs/{case}/count"] = len(rows["ours"])
        for arm, figures_of_all in rows.items():
            for measure in MEASURES:
                values = [figures[measure] for figures in figures_of_all]
                metrics[f"{arm}/{case}/{measure}"] = round(float(np.nanmean(values)), 4)
        kept.write_text(json.dumps(metrics, indent=1, sort_keys=True) + "\n")
        (options.out / "table.md").write_text(table(metrics))


if __name__ == "__main__":
    main()
