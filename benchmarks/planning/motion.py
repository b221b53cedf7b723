"""Motion queries: three planners on the same seeded queries, one after the other in one process, CPU time each.

A path counts as success when a mesh checker of its own finds it free at a third of the resolution; one that it does
not is counted as rejected_by_mesh. No planner sees the check of another.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from benchmarks.planning.motion_arms import ARMS, RESOLUTION
from benchmarks.planning.motion_queries import MotionQuery, QuerySet, drawer_set, free_set, room_set, shelf_set
from stages.kit.motion.rrt_connect import FINER, densify

TUNING_SEED, REPORTING_SEED = 0, 1000
QUERIES, QUICK_QUERIES = 100, 10
CASES = ("free", "shelf", "drawer", "reconstructed_room")
MEASURES = ("success", "median_ms", "p95_ms", "mean_ms", "path_length", "rejected_by_mesh")
EVERYWHERE = "all"


def run(scene: Path | None, *, quick: bool, tuning: bool) -> dict[str, float]:
    """Return `<arm>/<case>/<measure>` for all cases; the reconstructed room only when a scene is given."""
    metrics: dict[str, float] = {}
    for case in CASES:
        if case == "reconstructed_room":
            if scene is None:
                continue
            queries = room_set(scene)
        else:
            queries = {"free": free_set, "shelf": shelf_set, "drawer": drawer_set}[case]()
        first = TUNING_SEED if tuning else REPORTING_SEED
        metrics |= measure(case, queries, range(first, first + (QUICK_QUERIES if quick else QUERIES)))
        queries.world.close()
    return metrics


def measure(case: str, queries: QuerySet, seeds: range) -> dict[str, float]:
    """Return the figures of every planner on the queries of the seeds.

    Lengths are compared over the queries that every planner solved.
    """
    warm = queries.query(TUNING_SEED)
    for arm in ARMS.values():
        arm(queries.checker, warm, 0)  # compile, build the arrays
    milliseconds: dict[str, list[float]] = {name: [] for name in ARMS}
    lengths: dict[str, list[float]] = {name: [] for name in ARMS}
    rejected = dict.fromkeys(ARMS, 0)
    for seed in seeds:
        query = queries.query(seed)
        for name, arm in ARMS.items():
            started = time.process_time()
            path = arm(queries.checker, query, seed)
            milliseconds[name].append(1e3 * (time.process_time() - started))
            good = path is not None and _accepted(queries, query, path)
            rejected[name] += path is not None and not good
            lengths[name].append(_length(path) if path is not None and good else np.nan)
    return _figures(case, milliseconds, lengths, rejected)


def _accepted(queries: QuerySet, query: MotionQuery, path: np.ndarray) -> bool:
    points = densify(path, np.full(7, RESOLUTION / FINER))
    ends = np.allclose(path[0], query.start) and np.allclose(path[-1], query.goal)
    return bool(ends) and all(
        queries.checker.check_meshes(np.concatenate([query.base, point])) is None for point in points
    )


def _length(path: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def _figures(
    case: str,
    milliseconds: Mapping[str, list[float]],
    lengths: Mapping[str, list[float]],
    rejected: Mapping[str, int],
) -> dict[str, float]:
    shared = np.all([np.isfinite(values) for values in lengths.values()], axis=0)
    metrics: dict[str, float] = {f"{EVERYWHERE}/{case}/queries": float(len(shared))}
    metrics[f"{EVERYWHERE}/{case}/solved_by_all"] = float(shared.sum())
    for name, times in milliseconds.items():
        values = {
            "success": float(np.isfinite(lengths[name]).mean()),
            "median_ms": float(np.median(times)),
            "p95_ms": float(np.quantile(times, 0.95)),
            "mean_ms": float(np.mean(times)),
            "path_length": float(np.mean(np.array(lengths[name])[shared])) if shared.any() else float("nan"),
            "rejected_by_mesh": float(rejected[name]),
        }
        metrics |= {f"{name}/{case}/{measure_name}": value for measure_name, value in values.items()}
    return metrics


def table(metrics: Mapping[str, float]) -> str:
    """Return the Markdown table of the motion cases."""
    lines = [
        "| case | planner | success | median [ms] | p95 [ms] | mean [ms] | path length [rad] | rejected by mesh |",
        "|:--|:--|--:|--:|--:|--:|--:|--:|",
    ]
    for case in CASES:
        if f"{EVERYWHERE}/{case}/queries" not in metrics:
            continue
        for arm in ARMS:
            success, median, p95, mean, length, rejected = (metrics[f"{arm}/{case}/{name}"] for name in MEASURES)
            lines.append(
                f"| {case} | {arm} | {success:.2f} | {median:.1f} | {p95:.1f} | {mean:.1f} | {length:.2f} "
                f"| {rejected:.0f} |"
            )
    return "\n".join([*lines, ""])
