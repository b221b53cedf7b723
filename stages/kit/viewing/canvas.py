"""What the viewers draw on: arrays in our conventions. Behind it are a Rerun recording, or a page for a browser."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
import trimesh
from numpy.typing import ArrayLike
from scenewright.schemas.scene_parts import Box, Camera

SHELL = "shell"
"""Walls and ceilings that are solid, below this path: hidden at first, as one looks from outside."""
Color = tuple[float, float, float]
"""(r, g, b) in 0..1."""


@dataclass(frozen=True)
class JointedLink:
    """A link of a kinematic tree, and the joint that it hangs on."""

    path: str
    """Where it is drawn, or a name of its own where it has no shape."""
    parent: str
    """Path of the link that it hangs on; empty: the world."""
    parent_from_link: np.ndarray
    """(4, 4) with the joint at 0."""
    kind: Literal["fixed", "turning", "sliding"] = "fixed"
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    """In the link's frame."""
    name: str = ""
    """Of the joint."""
    lower: float = 0.0
    """[rad, m]"""
    upper: float = 0.0
    value: float = 0.0
    """Where it was seen."""


@dataclass(frozen=True)
class Parts:
    """What the vertices of a mesh belong to, so that a click says it."""

    ids: np.ndarray
    """(V,) int, 0 none."""
    names: Mapping[int, str]


@dataclass(frozen=True)
class Trust:
    """How far a thing can be trusted."""

    share: float
    """0 (not at all) to 1."""
    reasons: tuple[str, ...] = ()
    """What speaks against it, in words."""


class Canvas(Protocol):
    """Lengths in metres, z up, times in seconds. Paths name what is drawn, their parts separated by /.

    What is drawn before `time` was called is there all the time; something that is drawn again at the same path takes
    the place of what was there until then.
    """

    def time(self, seconds: float, timeline: str = "time") -> None:
        """Set the time [s] of what is drawn from now on."""

    def always(self) -> None:
        """What is drawn from now on is there all the time."""

    def enclose(self, minimum: ArrayLike, maximum: ArrayLike) -> None:
        """Keep the box from `minimum` to `maximum` (3,) [m] in sight at first."""

    def view(self, name: str, *hidden: str) -> None:
        """Have a 3D view of everything but what lies under the hidden paths; without any there is one of all."""

    def mesh(
        self,
        path: str,
        mesh: trimesh.Trimesh,
        colors: np.ndarray | None = None,
        *,
        front_only: bool = False,
        parts: Parts | None = None,
    ) -> None:
        """Draw a mesh; `colors` (V, 3 or 4) uint8 per vertex override its own.

        `front_only` leaves out faces that look away, so that one looks into a room through its walls. `parts`: where a
        mesh is of several things.
        """

    def points(self, path: str, points: np.ndarray, colors: np.ndarray | None = None, radius: float = 0.005) -> None:
        """Draw points (N, 3) with colours (N, 3) uint8."""

    def line(
        self,
        path: str,
        strips: list[np.ndarray],
        colors: list[Color],
        radius: float = 0.004,
        labels: list[str] | None = None,
    ) -> None:
        """Draw polylines, each (N, 3), in one colour each; `labels` are shown for what is selected."""

    def boxes(
        self, path: str, boxes: list[Box], labels: list[str], colors: list[Color], *, show_labels: bool = True
    ) -> None:
        """Draw oriented boxes with labels."""

    def transform(self, path: str, parent_from_child: np.ndarray, scale: float = 1.0) -> None:
        """Place what lies under `path` with a rigid (4, 4) transform, after scaling it."""

    def joints(self, links: Sequence[JointedLink]) -> None:
        """Say how links that are drawn hang on each other, parents first, so that joints can be tried."""

    def camera(self, path: str, camera: Camera) -> None:
        """Say that `path` is a pinhole camera (OpenCV axes)."""

    def picture(self, path: str, data: bytes) -> None:
        """Show a JPEG or PNG as it is."""

    def depth(self, path: str, depth: np.ndarray) -> None:
        """Show depth (H, W) float [m], 0 = invalid."""

    def label_names(self, path: str, rows: list[tuple[int, str, Color]]) -> None:
        """Say what the ids of the label images under `path` mean."""

    def labels(self, path: str, ids: np.ndarray) -> None:
        """Show ids (H, W) 0..65535 over the picture; 0 is void."""

    def graph(self, names: list[str], colors: list[Color], edges: list[tuple[str, str]]) -> None:
        """Show a directed graph in a view of its own."""

    def trust(self, rows: Mapping[str, Trust]) -> None:
        """Say how far things can be trusted, by name: what is drawn at a path that holds the name can be seen so."""

    def moment(self, seconds: float, text: str, *, bad: bool = False) -> None:
        """Say what begins at a time [s]: an action, or (`bad`) what went wrong and why."""

    def document(self, path: str, markdown: str) -> None:
        """Show a text in Markdown."""


def bytes_of(color: Color) -> list[int]:
    """Return a colour as three bytes."""
    return [round(255 * min(max(channel, 0.0), 1.0)) for channel in color]


def vertex_colors(mesh: trimesh.Trimesh, colors: np.ndarray | None) -> tuple[trimesh.Trimesh, np.ndarray | None]:
    """Return a mesh and colours (V, 3 or 4) uint8 of its vertices, its own where none are given; None: it has none.

    Faces that have a colour each get vertices of their own.
    """
    if colors is not None:
        return mesh, colors
    visual: Any = mesh.visual
    if isinstance(visual, trimesh.visual.ColorVisuals) and visual.kind == "face":
        face_colors = np.asarray(visual.face_colors)
        mesh = mesh.copy()
        mesh.unmerge_vertices()
        return mesh, np.repeat(face_colors, 3, axis=0)
    if isinstance(visual, trimesh.visual.TextureVisuals):
        visual = visual.to_color()
    stored = np.asarray(visual.vertex_colors)
    return mesh, stored if stored.shape == (len(mesh.vertices), 4) else None


def trust_color(share: float) -> Color:
    """Return red for what cannot be trusted (0), yellow between, green for what can (1)."""
    share = min(max(share, 0.0), 1.0)
    return (0.8 if share < 0.5 else 0.8 * 2 * (1 - share), 0.7 if share > 0.5 else 0.7 * 2 * share, 0.15)


def trust_table(rows: Mapping[str, Trust]) -> str:
    """Return what can be trusted how far in Markdown, the least first."""
    lines = ["| thing | trust | what speaks against it |", "|---|--:|---|"]
    for name, trust in sorted(rows.items(), key=lambda row: (row[1].share, row[0])):
        lines.append(f"| {name} | {trust.share:.2f} | {'; '.join(trust.reasons)} |")
    return "\n".join(lines)
