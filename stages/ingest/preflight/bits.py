"""Is depth stored as its numbers: values that scatter over 16 bits, and lie smooth once their bytes are exchanged."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import get_args

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.detection import open_log
from scenewright.stages.ingest.images import depth_roughness
from scenewright.stages.ingest.parameters import DepthBits, IngestParameters
from scenewright.stages.ingest.preflight.looking import Look, look_at_entry
from scenewright.stages.ingest.preflight.report import Finding
from scenewright.stages.ingest.selection import select
from scenewright.stages.ingest.source import SourceCamera, Unusable

FRAMES = 3
"""Frames that are read again in every other way."""
ROUGH, SMOOTHER = 0.015, 1 / 3
"""Roughness from which other ways of storing are tried, and the share of it that the right one leaves at most."""
WORDS: dict[DepthBits, str] = {
    "as-is": "as they stand",
    "swapped": "with their two bytes exchanged",
    "rotated": "with their bits rotated by three",
}


def bits_finding(
    path: Path, parameters: IngestParameters, camera: SourceCamera, looks: Mapping[int, Look]
) -> Finding | None:
    """Return how else the depth of a log is stored, where it is no depth as it is read and is so read otherwise.

    `looks` are frames by their index among the selected ones of the camera.
    """
    chosen = [index for index, look in sorted(looks.items()) if look.depth is not None][:FRAMES]
    now = _roughness([looks[index].depth for index in chosen])
    if now < ROUGH:
        return None
    others = [bits for bits in get_args(DepthBits) if bits != parameters.depth_bits]
    found = {bits: _read_otherwise(path, parameters, camera, chosen, bits) for bits in others}
    bits = min(others, key=lambda bits: found[bits])
    if found[bits] > SMOOTHER * now:
        return None
    message = (
        f"depth is no depth as it is read: neighbouring pixels differ by {100 * now:.2g} %, and by "
        f"{100 * found[bits]:.2g} % {WORDS[bits]}"
    )
    return Finding(
        severity="wasted", check="depth", message=message, fix=f"ingest with --depth-bits {bits}", camera=camera.name
    )


def _read_otherwise(
    path: Path, parameters: IngestParameters, camera: SourceCamera, indices: list[int], bits: DepthBits
) -> float:
    """Return the roughness of frames whose depth is read otherwise; 1 where it can't be."""
    asked = parameters.model_copy(update={"depth_bits": bits})
    try:
        source = open_log(path, asked)
    except BadInput:  # a sequence: its depth is what ingest made of it
        return 1.0
    try:
        selected, _ = select(source.entries, asked, source.has_poses)
        entries = [entry for entry in selected if entry.camera_name == camera.name]
        depths = [look_at_entry(entries[index], index, camera.camera, False).depth for index in indices]
    except Unusable:
        return 1.0
    finally:
        source.close()
    return _roughness(depths)


def _roughness(depths: list[np.ndarray | None]) -> float:
    return float(np.median([depth_roughness(depth) for depth in depths if depth is not None] or [0.0]))
