"""`python -m benchmarks.planning`: every part's queries, one metrics.json and table.md."""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from benchmarks.planning import motion, tamp

ROOMS, QUICK_ROOMS = 50, 2
LIBRARY_SEED = 1


def main(argv: Sequence[str] | None = None) -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--scene", type=Path, help="interactive scene for the case reconstructed_room")
    parser.add_argument("--quick", action="store_true", help=f"{motion.QUICK_QUERIES} queries a case")
    parser.add_argument("--tuning", action="store_true", help="the tuning seeds instead of those for reporting")
    parser.add_argument("--parts", default=",".join(PARTS), help="comma-separated; default: all")
    parser.add_argument(
        "--rooms", type=int, help=f"rooms of the part tamp; default {ROOMS}, {QUICK_ROOMS} with --quick"
    )
    parser.add_argument("--cases", default=",".join(tamp.CASES), help="cases of the part tamp, comma-separated")
    parser.add_argument("--jobs", type=int, default=min(2, os.cpu_count() or 1), help="rooms at a time")
    options = parser.parse_args(argv)
    for option, known in (("parts", PARTS), ("cases", tamp.CASES)):
        for name in getattr(options, option).split(","):
            if name not in known:
                parser.error(f"--{option}: {name!r} is none of {', '.join(known)}")
    metrics: dict[str, float] = {}
    texts = []
    for name in options.parts.split(","):
        figures, text = PARTS[name](options)
        metrics |= {key: value for key, value in figures.items() if math.isfinite(value)}
        texts.append(text)
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "metrics.json").write_text(json.dumps(metrics, indent=1, sort_keys=True) + "\n")
    (options.out / "table.md").write_text("\n".join(texts))
    print("\n".join(texts))
    return 0


def _motion(options: argparse.Namespace) -> tuple[dict[str, float], str]:
    metrics = motion.run(options.scene, quick=options.quick, tuning=options.tuning)
    return metrics, motion.table(metrics)


def _tamp(options: argparse.Namespace) -> tuple[dict[str, float], str]:
    library = options.out / "cad_library"
    command = [sys.executable, "-m", "cli", "library", "build", "--seed", str(LIBRARY_SEED), "--out", str(library)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    rooms = options.rooms or (QUICK_ROOMS if options.quick else ROOMS)
    seeds = (tamp.TUNING if options.tuning else tamp.REPORTING)[:rooms]
    metrics = tamp.run(library, options.out / "rooms", seeds=seeds, cases=options.cases.split(","), jobs=options.jobs)
    return metrics, tamp.table(metrics)


PARTS: dict[str, Callable[[argparse.Namespace], tuple[dict[str, float], str]]] = {"motion": _motion, "tamp": _tamp}


if __name__ == "__main__":
    raise SystemExit(main())
