"""Kinds `splat` and `splat_views`: a room as 3-D Gaussians, and how its pictures compare with the camera's."""

from __future__ import annotations

from typing import ClassVar, Literal

from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Count, Model
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.trajectory import Trajectory


class SplatView(Model):
    """One posed picture."""

    frame: Count
    """Index in the sequence."""
    time: float
    camera: str
    use: Literal["learned", "held_out", "dark", "left_out"]
    """`left_out`: more pictures than were asked for."""
    arrived: Count | None = None
    """Steps of training before it, of a learned one."""
    moved: float | None = None
    """How far refinement took its camera [m], of a learned one whose pose was refined."""
    turned: float | None = None
    """... and turned it [rad]."""


class SplatFile(Model):
    """splat.json."""

    method: Literal["ours", "thesis"]
    gaussians: Count
    harmonics_degree: int
    steps: Count
    loss: float
    """Mean over the last hundred steps."""
    refined: bool
    """Whether poses were learned too."""
    cameras: dict[str, Camera]
    """As they were learned from: at the width that was asked for."""
    views: tuple[SplatView, ...]


class Splat(Trajectory):
    """`splat.ply` (Gaussians in the order of the viewers of splats), `splat.json`, `trajectory.tum`: the poses of all
    posed frames, refined where that was asked for, so that it can be read as a trajectory.
    """

    kind: ClassVar[str] = "splat"
    description: ClassVar[str] = "room as 3-D Gaussians, with the camera poses that belong to it"
    built = Document(SplatFile, "splat.json")


class ViewFigures(Model):
    """How well one view is shown."""

    frame: Count
    use: Literal["learned", "held_out"]
    psnr: float
    """[dB]"""
    ssim: float
    depth_error: float | None = None
    """Median distance of expected and measured depth [m]; None where none was measured."""
    cover: float
    """Mean alpha."""


class SplatViewsFile(Model):
    """views.json."""

    views: tuple[ViewFigures, ...]
    psnr: float
    """Means over the views; [dB]."""
    ssim: float
    depth_error: float | None = None


class SplatViews(Artifact):
    """`views.json`; `pictures/<frame>.png`: what the camera saw, what the splat shows, how the depths differ;
    `turntable.png`, `turntable.gif`: the splat from all sides."""

    kind: ClassVar[str] = "splat_views"
    description: ClassVar[str] = "pictures of a splat beside the camera's"
    info = Document(SplatViewsFile, "views.json")
