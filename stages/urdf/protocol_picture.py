"""The picture of the protocol: a scene's boxes from above and from the side, coloured by what became of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch, Polygon
from scenewright.schemas.interactive_scene import InteractiveSceneFile, SceneBody
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.drawing.plots import STYLE, save
from scenewright.stages.kit.geometry.boxes import box_corners, convex_hull

COLORS = {"stable": "#4d9a6a", "not stable": "#b0413e", "held": "#e08a2e", "fixed": "#b8b8b8"}
VIEWS = (("from above", (0, 1), 2), ("from the side", (0, 2), 1))
"""Title, axes that are drawn, axis along which is looked."""
HATCH = "////"
"""Of what was seen in part."""
MARGIN = 0.3
"""Room around the bodies [m]."""


def draw_protocol(path: Path, folder: Path, document: dict[str, Any]) -> None:
    """Write a PNG of the scene folder `folder` with what `protocol_text.as_json` says of it. Same bytes every time."""
    bodies = InteractiveSceneFile.read(folder / "scene.json").bodies
    fates = {body["name"]: "stable" if body["stable"] else "not stable" for body in document["free_bodies"]}
    fates |= dict.fromkeys(document["held_bodies"] or (), "held")
    vocabulary = load_vocabulary()
    things = [body for body in bodies if not vocabulary.by_name(body.class_name).is_layout] or list(bodies)
    with plt.rc_context(STYLE):
        figure, all_axes = plt.subplots(1, 2, figsize=(12.0, 6.0))
        for axes, (title, shown, along) in zip(all_axes, VIEWS, strict=True):
            axes.set_title(title)
            # what is fixed, as a cabinet to the ceiling, must not hide what is judged
            for body in sorted(things, key=lambda body: (body.name in fates, _extreme(body, along), body.name)):
                _draw(axes, body, shown, COLORS[fates.get(body.name, "fixed")], named=body.name in fates)
            _mark_pairs(axes, bodies, document, shown)
            corners = np.concatenate([box_corners(body.box) for body in things])[:, shown]
            low, high = corners.min(axis=0) - MARGIN, corners.max(axis=0) + MARGIN
            axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
            axes.set(xlabel=f"{'xyz'[shown[0]]} [m]", ylabel=f"{'xyz'[shown[1]]} [m]")
        handles = [Patch(color=color, label=fate) for fate, color in COLORS.items()]
        if any(is_inferred(body) for body in things):
            handles.append(Patch(facecolor="white", edgecolor="#333333", hatch=HATCH, label="partly inferred"))
        handles.append(all_axes[0].plot([], [], "x--", color="black", label="colliding pair")[0])
        figure.legend(handles=handles, loc="lower center", ncols=len(handles))
        save(figure, path)


def is_inferred(body: SceneBody) -> bool:
    """Whether a part of its shape was not seen."""
    return body.because.startswith("inferred")


def _extreme(body: SceneBody, along: int) -> float:
    """Return what is drawn first: low things from above, far ones from the side."""
    values = box_corners(body.box)[:, along]
    return float(values.max()) if along == 2 else -float(values.min())


def _draw(axes: Axes, body: SceneBody, shown: tuple[int, int], color: str, *, named: bool) -> None:
    outline = convex_hull(box_corners(body.box)[:, shown])
    hatch = HATCH if is_inferred(body) else None
    axes.add_patch(Polygon(outline, facecolor=color, edgecolor="#333333", alpha=0.75, linewidth=0.6, hatch=hatch))
    if named:
        x, y = outline.mean(axis=0)
        axes.text(x, y, body.name, fontsize=5.5, ha="center", va="center", clip_on=True)


def _mark_pairs(axes: Axes, bodies: tuple[SceneBody, ...], document: dict[str, Any], shown: tuple[int, int]) -> None:
    boxes = {body.name: body.box for body in bodies}
    free = {body["name"] for body in document["free_bodies"]}
    for pair in document["pairs"]:
        if pair["colliding"]:
            ends = np.array([boxes[name].center for name in (pair["first"], pair["second"]) if name in free])[:, shown]
            axes.plot(ends[:, 0], ends[:, 1], "x--", color="black", linewidth=1.2, markersize=9)
