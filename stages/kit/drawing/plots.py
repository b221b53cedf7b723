"""Plots as PNG, drawn without a display and with the same bytes every time (no date, no version inside)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
from matplotlib.axes import Axes  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from scenewright.schemas.contact_graph import ContactGraphFile  # noqa: E402
from scenewright.schemas.scene_parts import TREE_RELATIONS  # noqa: E402
from scenewright.stages.kit.drawing.palette import RELATION_COLORS  # noqa: E402
from scenewright.stages.kit.drawing.tree_layout import tree_layout  # noqa: E402
from scenewright.stages.kit.geometry.boxes import polygon_area  # noqa: E402
from scenewright.stages.kit.measurement.edge_agreement import Edge  # noqa: E402

SERIES_COLORS = ("#2f6fb3", "#e08a2e", "#4d9a6a", "#7a4fb0", "#b0413e")
NAMED_FROM_AREA = 0.12
"""Outlines below this area have no name in the plan [m^2]."""
STYLE: Any = {
    "font.size": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#555555",
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "legend.frameon": False,
}
"""Settings of matplotlib for all plots."""


def save(figure: Figure, path: Path, dpi: int = 130) -> None:
    """Write the figure without metadata that changes, and close it."""
    figure.savefig(path, dpi=dpi, metadata={"Software": None}, bbox_inches="tight")
    plt.close(figure)


def plot_bars(
    path: Path,
    labels: Sequence[str],
    series: Mapping[str, Sequence[float | None]],
    *,
    title: str,
    axis: str,
    maximum: float | None = 1.0,
) -> None:
    """Horizontal bars, one group a label; undefined values (None) have no bar and are marked n/a."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(6.4, 0.9 + 0.3 * max(len(labels), 1) * max(1.0, 0.55 * len(series))))
        thickness = 0.8 / max(len(series), 1)
        rows = np.arange(len(labels))
        for k, (name, values) in enumerate(series.items()):
            places = rows + (k - (len(series) - 1) / 2) * thickness
            lengths = [value or 0.0 for value in values]
            axes.barh(places, lengths, height=0.9 * thickness, color=SERIES_COLORS[k % 5], label=name)
            for y, value in zip(places, values, strict=True):
                text = "n/a" if value is None else f"{value:.2f}"
                axes.annotate(text, (value or 0.0, y), (3, 0), textcoords="offset points", va="center", size=8)
        axes.set_yticks(rows, labels)
        axes.invert_yaxis()
        if maximum is not None:
            axes.set_xlim(0, maximum * 1.08)
        axes.set_xlabel(axis)
        axes.set_title(title)
        if len(series) > 1:
            axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), borderaxespad=3.8, ncols=len(series))
        save(figure, path)


def plot_histograms(
    path: Path, series: Mapping[str, np.ndarray], *, title: str, axis: str, limit: float, threshold: float | None = None
) -> None:
    """Shares of values in [0, limit] as step histograms; what lies beyond is in the last bin."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(6.4, 3.0))
        bins = np.linspace(0.0, limit, 51)
        for k, (name, values) in enumerate(series.items()):
            if not len(values):
                continue
            clipped = np.minimum(values, limit)
            shares = np.histogram(clipped, bins=bins)[0] / len(values)
            axes.stairs(shares, bins, color=SERIES_COLORS[k % 5], label=name, fill=k == 0, alpha=0.85 if k else 0.45)
        if threshold is not None:
            axes.axvline(threshold, color="#444444", linewidth=1, linestyle=":")
        axes.set_xlabel(axis)
        axes.set_ylabel("share")
        axes.set_title(title)
        axes.legend()
        save(figure, path)


def plot_floor_plan(
    path: Path,
    outlines: Sequence[tuple[str, np.ndarray, tuple[float, float, float]]],
    paths: Mapping[str, np.ndarray],
    *,
    title: str,
) -> None:
    """Outlines (name, (K, 2) corners, colour) and camera paths (N, 3) seen from above, metres."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(6.4, 5.2))
        for name, corners, color in outlines:
            axes.fill(corners[:, 0], corners[:, 1], facecolor=(*color, 0.35), edgecolor=color, linewidth=1)
            if abs(polygon_area(corners)) > NAMED_FROM_AREA:
                axes.annotate(name, corners.mean(axis=0), ha="center", va="center", size=6.5, color="#333333")
        for k, (name, points) in enumerate(paths.items()):
            style = "-" if k == 0 else "--"
            axes.plot(points[:, 0], points[:, 1], style, color=SERIES_COLORS[k % 5], linewidth=1.4, label=name)
            if len(points):
                axes.plot(*points[0, :2], "o", color=SERIES_COLORS[k % 5], markersize=4)
        axes.set_aspect("equal")
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
        axes.set_title(title)
        if paths:
            axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), borderaxespad=3.8, ncols=len(paths))
        save(figure, path)


def plot_graphs(
    path: Path,
    graphs: Mapping[str, ContactGraphFile],
    *,
    marked: Mapping[str, Mapping[str, str]],
    title: str,
    edges: Mapping[str, Mapping[Edge, str]] | None = None,
    partner: Mapping[str, str] | None = None,
) -> None:
    """Support trees side by side. `marked`: graph title -> node id -> colour of its name (red for errors, say).

    `edges`: graph title -> edge -> colour that it is drawn in instead of its relation's, and thicker. `partner`: node
    of the first graph -> node of the others that stands for it: the others then take the order of the first.
    """
    with plt.rc_context(STYLE):
        layouts: dict[str, dict[str, tuple[float, float]]] = {}
        order: dict[str, float] | None = None
        for name, graph in graphs.items():
            layouts[name] = tree_layout(_parents(graph), order)
            if order is None:
                rows_of_first = {node: row for node, (_, row) in layouts[name].items()}
                order = {(partner or {}).get(node, node): row for node, row in rows_of_first.items()}
        rows = max([1.0] + [row + 1 for layout in layouts.values() for _, row in layout.values()])
        figure, all_axes = plt.subplots(1, len(graphs), figsize=(5.0 * len(graphs), 0.9 + 0.24 * rows), squeeze=False)
        for axes, (name, graph) in zip(all_axes[0], graphs.items(), strict=True):
            _draw_tree(axes, graph, layouts[name], marked.get(name, {}), (edges or {}).get(name, {}))
            axes.set_title(name)
        used = {link.relation for graph in graphs.values() for link in graph.links} - {"proximal"}
        handles = [
            plt.Line2D(
                [],
                [],
                color=RELATION_COLORS[r],
                label=r.replace("_", " "),
                linestyle="-" if r in TREE_RELATIONS else "--",
            )
            for r in sorted(used)
        ]
        figure.suptitle(title, x=0.02, ha="left", size=10.5, weight="bold")
        if handles:
            figure.legend(handles=handles, loc="lower center", ncols=len(handles), bbox_to_anchor=(0.5, -0.04))
        figure.tight_layout()
        save(figure, path)


def _parents(graph: ContactGraphFile) -> dict[str, str | None]:
    result: dict[str, str | None] = {node.id: None for node in graph.nodes}
    for link in graph.links:
        if link.relation in TREE_RELATIONS and link.target in result:
            result[link.target] = link.source
    return result


def _draw_tree(
    axes: Axes,
    graph: ContactGraphFile,
    layout: dict[str, tuple[float, float]],
    marked: Mapping[str, str],
    colored: Mapping[Edge, str],
) -> None:
    # A column is as wide as its longest name; positions count letters.
    depth_left = {0: 0.0}
    for depth in range(int(max((x for x, _ in layout.values()), default=0.0)) + 1):
        depth_left[depth + 1] = (
            depth_left[depth] + max((len(name) for name, (x, _) in layout.items() if x == depth), default=0) + 4.0
        )
    places = {name: (depth_left[int(x)], y) for name, (x, y) in layout.items()}
    # Marked edges are drawn last, over the trunk that they share with their siblings.
    for link in sorted(graph.links, key=lambda k: (k.source, k.target, k.relation) in colored):
        if link.relation == "proximal" or link.source not in places or link.target not in places:
            continue
        (x0, y0), (x1, y1) = places[link.source], places[link.target]
        bend = x1 - 2.0
        style = "-" if link.relation in TREE_RELATIONS else "--"
        mark = colored.get((link.source, link.target, link.relation))
        color, width = (RELATION_COLORS[link.relation], 1.2) if mark is None else (mark, 2.2)
        if link.relation in TREE_RELATIONS:
            axes.plot([x0, bend, bend, x1], [y0, y0, y1, y1], color=color, linewidth=width, linestyle=style)
        else:  # beside the tree: an arc at the left of both names, so that it covers no line of the tree
            out = min(x0, x1) - 1.2
            axes.plot(
                [x0 - 0.3, out, out, x1 - 0.3],
                [y0 + 0.2, y0 + 0.2, y1, y1],
                color=color,
                linewidth=width,
                linestyle=style,
            )
    for name, (x, y) in places.items():
        axes.annotate(
            name,
            (x, y),
            ha="left",
            va="center",
            size=7.5,
            color=marked.get(name, "#222222"),
            weight="bold" if name in marked else "normal",
            bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none"},
        )
    axes.set_xlim(-1.0, max(depth_left.values()) + 1.0)
    axes.set_ylim(max((y for _, y in layout.values()), default=0.0) + 0.7, -0.7)
    axes.axis("off")
