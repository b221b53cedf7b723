"""Stereo for the page: left picture, disparity and confidence of some frames, and whether the eyes were rectified."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scenewright.schemas.disparity import Disparity, RowReport
from scenewright.stages.kit.formats.disparity_file import DisparityReader
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.stereo.pictures import confidence_colors, disparity_colors
from scenewright.stages.report.frames import choose_frames
from scenewright.stages.report.images import Picture, jpeg
from scenewright.stages.report.page import Page

MOST_FRAMES = 3
"""Most frames that are shown."""


@dataclass(frozen=True)
class StereoFrame:
    """Pictures of one frame."""

    index: int
    pictures: tuple[Picture, ...]
    """Left eye, disparity, confidence; the first may be missing."""
    known: float
    """Per cent of the pixels."""
    trusted: float


@dataclass(frozen=True)
class StereoView:
    """Everything the page says about the matching."""

    detail: str
    rows: tuple[RowReport, ...]
    frames: tuple[StereoFrame, ...]
    known: float
    trusted: float
    minimum_confidence: float


def stereo_view(disparity: Disparity, wanted: int, width: int) -> StereoView:
    """Read a disparity; at most MOST_FRAMES frames are shown, pictures at most `width` wide [px]."""
    file, frames = disparity.matching, []
    with (
        FrameReader(disparity.path("frames.mcap")) as reader,
        DisparityReader(disparity.path("disparity.mcap")) as maps,
    ):
        stamps = reader.stamps
        for index in choose_frames(len(reader), min(wanted, MOST_FRAMES)):
            frame, disparity_map = reader.read(index, ("color",)), maps.read(int(stamps[index]))
            drawn = [] if frame.color is None else [jpeg(frame.color, f"left eye of frame {index}", width)]
            drawn.append(jpeg(disparity_colors(disparity_map.disparity), f"disparity of frame {index}", width))
            drawn.append(jpeg(confidence_colors(disparity_map.confidence), f"confidence of frame {index}", width))
            shares_of = file.frames[index]
            frames.append(StereoFrame(index, tuple(drawn), 100 * shares_of.known, 100 * shares_of.trusted))
    shares = np.array([[frame.known, frame.trusted] for frame in file.frames]).reshape(-1, 2)
    matched, trusted = 100 * shares.mean(axis=0) if len(shares) else (0.0, 0.0)
    return StereoView(file.detail, file.rows, tuple(frames), float(matched), float(trusted), file.minimum_confidence)


def view(page: Page) -> dict[str, Any] | None:
    """Return the matching of a sequence from stereo pairs; None for any other."""
    disparity = page.given("sequence", Disparity)
    if disparity is None:
        return None
    return {"stereo": stereo_view(disparity, page.parameters.frames, page.parameters.frame_width)}
