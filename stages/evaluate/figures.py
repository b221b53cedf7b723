"""The plots of an evaluation."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.scene_parts import Box
from scenewright.stages.evaluate.graph_measures import GraphComparison, upright
from scenewright.stages.evaluate.truth import stuff_classes
from scenewright.stages.kit.drawing.palette import instance_color
from scenewright.stages.kit.drawing.plots import plot_bars, plot_floor_plan, plot_graphs, plot_histograms
from scenewright.stages.kit.geometry.boxes import footprint
from scenewright.stages.kit.measurement.edge_agreement import edge_errors
from scenewright.stages.kit.measurement.panoptic_quality import ClassQuality

MISSED, WRONG = "#b3261e", "#c2571a"
"""Colours of nodes that are missing (or too many), and of those with a wrong support."""


def draw_quality(path: Path, qualities: Mapping[str, ClassQuality], label: str) -> None:
    """PQ, SQ and RQ by class, stuff first."""
    stuff = stuff_classes()
    names = sorted(qualities, key=lambda name: (name not in stuff, name))
    plot_bars(
        path,
        names,
        {
            "PQ": [qualities[n].pq for n in names],
            "SQ": [qualities[n].sq if qualities[n].true_positives else None for n in names],
            "RQ": [qualities[n].rq for n in names],
        },
        title=f"Panoptic quality by class\n{label}",
        axis="share",
    )


def draw_surface(path: Path, to_truth: np.ndarray, to_map: np.ndarray, threshold: float, label: str) -> None:
    """Distances between map and true surface, in millimetres."""
    plot_histograms(
        path,
        {"map to true surface": 1000 * to_truth, "true surface to map": 1000 * to_map},
        title=f"Distance between the map and the true surface\n{label}",
        axis="distance [mm], last bin: all beyond",
        limit=1000 * threshold * 1.2,
        threshold=1000 * threshold,
    )


def draw_comparison(path: Path, comparison: GraphComparison, label: str, ignored: frozenset[str] = frozenset()) -> None:
    """The true graph beside the reconstructed one, partners in the same order; what is missing, extra or wrongly
    supported is coloured, nodes and edges."""
    distance = comparison.distance
    true_marks = dict.fromkeys(distance.missing, MISSED) | {t: WRONG for t, _ in distance.wrong_supports}
    predicted_marks = dict.fromkeys(distance.extra, MISSED) | {p: WRONG for _, p in distance.wrong_supports}
    predicted_marks |= {p: WRONG for _, p in distance.substituted}
    partner = dict(distance.pairs)
    missing, wrong = edge_errors(comparison.true, comparison.predicted, partner, ignored=ignored)
    plot_graphs(
        path,
        {"true": comparison.true, "reconstructed": comparison.predicted},
        marked={"true": true_marks, "reconstructed": predicted_marks},
        edges={"true": dict.fromkeys(missing, MISSED), "reconstructed": dict.fromkeys(wrong, MISSED)},
        partner=partner,
        title=f"Contact graphs, edit distance {distance.total} "
        f"(red names and lines: missing or extra; orange: wrong support or class)\n{label}",
    )


def draw_graph(path: Path, graph: ContactGraphFile, label: str) -> None:
    """The reconstructed graph alone."""
    plot_graphs(path, {"reconstructed": graph}, marked={}, title=f"Contact graph\n{label}")


def draw_floor_plan(path: Path, boxes: list[tuple[str, int, Box]], paths: Mapping[str, np.ndarray], label: str) -> None:
    """Boxes (name, instance, box) and camera paths from above."""
    outlines = [(name, footprint(box), instance_color(instance)) for name, instance, box in boxes if upright(box)]
    plot_floor_plan(path, outlines, paths, title=f"Camera path from above\n{label}")
