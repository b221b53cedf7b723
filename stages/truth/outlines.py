"""Outlines that somebody painted in frames of a recording, a name for each: which part of what is seen is which thing.

A small JSON file beside a support annotation, whose nodes it names (docs/FORMATS.md). Boxes of the annotation hold of a
thing what stands near it too; an outline follows its border. A frame is known by its time, which stays when fewer
or more frames are taken from the log.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from scenewright.schemas.base import Model, Name
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.geometry.outlines import fill
from scenewright.stages.truth.support_annotation import Making

LARGEST_FILE = 16 * 2**20
"""Most bytes of a file of outlines."""
HINT = 'docs/FORMATS.md, "Outlines", shows one'

Pixel = Annotated[float, Field(ge=-1e5, le=1e5)]


class Outline(Model):
    """What is of one thing in one frame, or of none."""

    name: Name | None = None
    """A node of the annotation; None: nothing is said of what is there."""
    points: tuple[tuple[Pixel, Pixel], ...] = Field(min_length=3)
    """Corners x, y [pixels]; (0, 0) is the corner of the first pixel."""
    farthest: Annotated[float, Field(gt=0)] | None = None
    """What lies farther [m] is seen through it, between leaves or bars: the outline says nothing of that."""


class PaintedFrame(Model):
    """The outlines of one frame. Later ones lie over earlier ones."""

    time: Annotated[float, Field(ge=0)]
    """Of the frame [s]."""
    outlines: tuple[Outline, ...] = Field(min_length=1)


class OutlinesFile(Model):
    """The whole file."""

    format: Literal["scenewright-outlines"]
    version: Literal[1]
    scene: str = Field(min_length=1)
    made: Making
    note: str = ""
    frames: tuple[PaintedFrame, ...] = Field(min_length=1)


def read_outlines(path: Path, nodes: Iterable[str]) -> OutlinesFile:
    """Read and check outlines of the `nodes` of an annotation.

    Raises BadInput when the file is missing, too large or no JSON of this format and version, when it names what is no
    node, or a frame twice.
    """
    file = OutlinesFile.read(path, largest=LARGEST_FILE, hint=HINT)
    known = set(nodes)
    times: set[float] = set()
    for frame in file.frames:
        if frame.time in times:
            raise BadInput(f"{path}: two frames have the time {frame.time:g} s", hint="put their outlines into one")
        times.add(frame.time)
        for number, outline in enumerate(frame.outlines, 1):
            if outline.name is not None and outline.name not in known:
                where = f"{path}: outline {number} of the frame at {frame.time:g} s"
                raise BadInput(
                    f"{where}: the annotation has no node {outline.name}",
                    hint="call it as the annotation does, or leave out its name",
                )
    return file


def painted_labels(frame: PaintedFrame, numbers: dict[str, int], depth: np.ndarray) -> np.ndarray:
    """Return the number (H, W) of the thing that each pixel of a painted frame is of, 0 where nothing is said.

    numbers: name -> number; depth (H, W) [m], 0 unknown. Raises BadInput for an outline longer than any picture's.
    """
    labels = np.zeros(depth.shape, dtype=np.int64)
    for outline in frame.outlines:
        inside = fill([np.array(outline.points, dtype=np.float64)], depth.shape)
        if outline.farthest is not None:
            inside &= depth <= outline.farthest
        labels[inside] = 0 if outline.name is None else numbers[outline.name]
    return labels
