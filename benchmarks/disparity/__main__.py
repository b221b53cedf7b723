"""`make bench-disparity`: bad-2, end-point error, coverage and CPU time, ours beside OpenCV's matchers in one run.

    python -m benchmarks.disparity --data FOLDER --out FOLDER [--quick] [--tuning] [--cases NAME ...] [--network FILE]

Writes metrics.json (`<arm>/<case>/<measure>`; `pairs/<case>/count`; parts of a case as `<case>_<part>`), table.md and a
picture of the first pair of every case. Cases that are not asked for keep what an earlier run measured.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np

from benchmarks.disparity.arms import DERIVED, WORDS, Arm, arms_of
from benchmarks.disparity.cases import CASES, Pair, Setting
from stages.disparity.raft.matching import SMALL_UPDATES
from stages.disparity.search_range import search_range
from stages.disparity.semi_global import gray_of
from stages.kit.stereo.disparity_map import DisparityMap
from stages.kit.stereo.pictures import confidence_colors, disparity_colors

MEASURES = {
    "bad2": "bad-2, of known [%]",
    "bad2_all": "bad-2, holes are bad [%]",
    "epe": "end-point error [px]",
    "median": "median error [px]",
    "coverage": "known [%]",
    "cpu_seconds": "CPU s a frame",
}
SHOWN = ("opencv_default", "small_one_way", "ours")
"""Arms of the picture, as far as they ran."""
Figures = dict[str, dict[str, dict[str, float]]]


def scores(found: DisparityMap, truth: np.ndarray) -> dict[str, float]:
    """Return the figures of one map where the truth is known; shares are per cent."""
    there = np.isfinite(truth)
    both = there & found.known
    error = np.abs(found.disparity[both] - truth[both])
    wrong = float((error > 2).sum())
    if not there.any():
        return dict.fromkeys(("bad2", "bad2_all", "epe", "median", "coverage"), float("nan"))
    return {
        "bad2": 100 * wrong / len(error) if len(error) else float("nan"),
        "bad2_all": 100 * (wrong + (there & ~found.known).sum()) / there.sum(),
        "epe": float(error.mean()) if len(error) else float("nan"),
        "median": float(np.median(error)) if len(error) else float("nan"),
        "coverage": 100 * len(error) / there.sum(),
    }


def measured(pair: Pair, arms: Mapping[str, Arm]) -> tuple[dict[str, DisparityMap], Figures]:
    """Return what every arm makes of a pair, those that are made of others included, and arm -> part ("" is the whole
    picture) -> its scores with the CPU time of the arm (one thread)."""
    limits = search_range(gray_of(pair.left), gray_of(pair.right))
    maps, spent = {}, {}
    for name, arm in arms.items():
        started = time.process_time()
        maps[name] = arm(pair.left, pair.right, limits)
        spent[name] = time.process_time() - started
    for name, (_, needed, make) in DERIVED.items():
        if all(one in maps for one in needed):
            maps[name] = make(maps)
            spent[name] = sum(spent[one] for one in needed)
    whole = {"": np.ones(pair.truth.shape, bool)}
    figures = {
        name: {
            part: scores(found, np.where(inside, pair.truth, np.nan)) | {"cpu_seconds": spent[name]}
            for part, inside in (whole | pair.parts).items()
        }
        for name, found in maps.items()
    }
    return maps, figures


def picture(pair: Pair, maps: dict[str, DisparityMap]) -> np.ndarray:
    """Return left eye, truth (made visible where it is sparse), the shown arms and our confidence in one row."""
    limits = tuple(np.nanpercentile(pair.truth, [1, 99]))
    truth = pair.truth
    if np.isfinite(truth).mean() < 0.1:  # single features: draw them larger
        grown = cv2.dilate(np.nan_to_num(truth), np.ones((9, 9), np.uint8))
        truth = np.where(grown > 0, grown, np.nan)
    tiles = [pair.left, disparity_colors(truth, limits)]
    tiles += [disparity_colors(maps[arm].disparity, limits) for arm in SHOWN if arm in maps]
    tiles.append(confidence_colors(maps[SHOWN[-1]].confidence))
    height = 300
    sized = [cv2.resize(tile, (round(tile.shape[1] * height / tile.shape[0]), height)) for tile in tiles]
    return np.hstack(sized)


def table(metrics: dict[str, float]) -> str:
    """Return one table a case or part of a case, in Markdown."""
    parts = []
    known = sorted({key.split("/")[1] for key in metrics if key.startswith("pairs/")}, key=_place)
    for case in known:
        count = int(metrics[f"pairs/{case}/count"])
        parts += [f"### {case.replace('_', ', ')} ({count} pair{'s' if count > 1 else ''})", ""]
        parts += ["| matcher | " + " | ".join(MEASURES.values()) + " |", "|---|" + "---|" * len(MEASURES)]
        for arm, words in WORDS.items():
            if f"{arm}/{case}/bad2" in metrics:
                cells = [f"{metrics[f'{arm}/{case}/{measure}']:.2f}" for measure in MEASURES]
                parts.append(f"| {words} | {' | '.join(cells)} |")
        parts.append("")
    return "\n".join(parts)


def _place(case: str) -> tuple[int, str]:
    """Return the order of a case or of its part: that of CASES, the whole before its parts."""
    return list(CASES).index(case.split("_")[0]), case


def main() -> None:
    """Run the arms on the cases; means over the pairs of a case."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--tuning", action="store_true")
    parser.add_argument("--network", type=Path, help="checkpoint of RAFT-Stereo whose arms run too")
    parser.add_argument("--updates", type=int, default=SMALL_UPDATES, help="of the network's disparity")
    parser.add_argument("--cases", nargs="+", choices=tuple(CASES), default=tuple(CASES))
    options = parser.parse_args()
    cv2.setNumThreads(1)
    options.out.mkdir(parents=True, exist_ok=True)
    setting = Setting(options.data, options.out / "logs", options.quick, options.tuning)
    kept = options.out / "metrics.json"
    metrics: dict[str, float] = json.loads(kept.read_text()) if kept.exists() else {}
    arms = arms_of(options.network, options.updates)
    for case in options.cases:
        rows: dict[str, dict[str, list[dict[str, float]]]] = {}
        for number, pair in enumerate(CASES[case](setting)):
            maps, figures = measured(pair, arms)
            for name, of_parts in figures.items():
                for part, values in of_parts.items():
                    rows.setdefault(part, {}).setdefault(name, []).append(values)
            if number == 0:
                cv2.imwrite(str(options.out / f"{case}.png"), picture(pair, maps)[..., ::-1])
            print(f"{pair.name}: " + ", ".join(f"{name} {figures[name]['']['bad2']:.1f}" for name in maps), flush=True)
        for part, of_arms in rows.items():
            key = f"{case}_{part}" if part else case
            metrics[f"pairs/{key}/count"] = len(of_arms["ours"])
            for name, figures_of_all in of_arms.items():
                for measure in MEASURES:
                    values = [one[measure] for one in figures_of_all]
                    metrics[f"{name}/{key}/{measure}"] = round(float(np.nanmean(values)), 4)
        kept.write_text(json.dumps(metrics, indent=1, sort_keys=True) + "\n")
        (options.out / "table.md").write_text(table(metrics))


if __name__ == "__main__":
    main()
