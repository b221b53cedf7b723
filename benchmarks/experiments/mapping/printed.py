"""The thesis's own figures (SceneNN, other masks, other sensor): context, never compared with."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np

from benchmarks.experiment import Results
from benchmarks.tabulation import markdown

PRINTED = Path(__file__).resolve().parents[2] / "expectations" / "thesis_mapping.toml"


def printed_by_the_thesis(results: Results) -> str:
    """The thesis's own figures (SceneNN, other masks, other sensor): context, never compared with."""
    with PRINTED.open("rb") as stream:
        printed = tomllib.load(stream)
    instances, boxes = printed["table_2_3"], printed["table_2_4"]
    rows = []
    for name in dict.fromkeys([*printed["table_2_2"], *instances, *boxes]):
        quality = printed["table_2_2"].get(name)
        cells = [f"{quality[which]['all']:.1f}" if quality else "–" for which in ("pq", "sq", "rq")]
        by_class = list(instances.get(name, {}).values())
        cells += [f"{np.mean(by_class):.1f}" if by_class else "–"]
        cells += [f"{boxes[name]['all']:.1f}" if name in boxes else "–"]
        rows.append((name, *cells))
    head = ("as printed", "PQ", "SQ", "RQ", "instance AP, mean of the classes", "box AP")
    return markdown("Context: what the thesis prints for SceneNN", head, rows)
