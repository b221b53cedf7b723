"""Outcomes as files: one JSON a room, so that rooms run in processes of their own and a stopped run goes on."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.mapping.experiment import Outcome
from stages.kit.measurement.average_precision import Candidates
from stages.kit.measurement.panoptic_quality import ClassQuality

QUALITIES = ("qualities", "qualities_thesis_code")
CANDIDATES = ("instances", "boxes", "boxes_refined")


def write_outcomes(path: Path, outcomes: list[Outcome]) -> None:
    """Write the outcomes of a room; the file appears whole."""
    rows = []
    for outcome in outcomes:
        row: dict[str, Any] = {key: getattr(outcome, key) for key in ("room", "arm", "case", "frames", "seconds")}
        for key in QUALITIES:
            row[key] = {name: asdict(quality) for name, quality in getattr(outcome, key).items()}
        for key in CANDIDATES:
            row[key] = {
                name: {
                    "shape": found.iou.shape,
                    "iou": found.iou.ravel().tolist(),
                    "confidence": list(found.confidence),
                }
                for name, found in getattr(outcome, key).items()
            }
        rows.append(row)
    partial = path.with_suffix(".partial")
    partial.write_text(json.dumps(rows))
    partial.rename(path)


def _candidates_as_json(found: Candidates) -> dict[str, Any]:
    return {"shape": found.iou.shape, "iou": found.iou.ravel().tolist(), "confidence": found.confidence.tolist()}


def read_outcomes(path: Path) -> list[Outcome]:
    """Read what `write_outcomes` wrote."""
    outcomes = []
    for row in json.loads(path.read_text()):
        for key in QUALITIES:
            row[key] = {name: ClassQuality(**sums) for name, sums in row[key].items()}
        for key in CANDIDATES:
            row[key] = {
                name: Candidates(np.array(found["iou"]).reshape(found["shape"]), np.array(found["confidence"]))
                for name, found in row[key].items()
            }
        outcomes.append(Outcome(**row))
    return outcomes
