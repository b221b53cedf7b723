"""`python -m benchmarks.planning`: every part's queries, one metrics.json and table.md."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path

from benchmarks.planning import motion

PART_NAMES = ("motion",)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--scene", type=Path, help="interactive scene for the case reconstructed_room")
    parser.add_argument("--quick", action="store_true", help=f"{motion.QUICK_QUERIES} queries a case")
    parser.add_argument("--tuning", action="store_true", help="the tuning seeds instead of those for reporting")
    parser.add_argument("--parts", default=",".join(PART_NAMES), help="comma-separated; default: all")
    options = parser.parse_args(argv)
    parts: dict[str, Callable[[], tuple[dict[str, float], str]]] = {"motion": lambda: _motion(options)}
    metrics: dict[str, float] = {}
    texts = []
    for name in options.parts.split(","):
        figures, text = parts[name]()
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


if __name__ == "__main__":
    raise SystemExit(main())
