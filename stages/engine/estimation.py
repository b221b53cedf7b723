"""What a step is going to write and to use, before it starts: a table of measured ratios, and honest bounds.

The figures were measured on demo runs (24 frames of 240x180 to 120 of 640x480, voxels of 4, 2 and 1 cm) and on real
logs (docs/HOUSEKEEPING.md has them beside what the table says). A map's size depends on how much surface was seen,
which nobody knows before: the lower bound is therefore far below what is expected, and only that bound stops a run.
"""

from __future__ import annotations

import logging
import os
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from schemas.errors import BadInput, MachineFailure
from schemas.ground_truth import GroundTruthFile
from schemas.manifest import MANIFEST_NAME
from schemas.sequence import SequenceFile
from stages.engine.reading import read_manifest

logger = logging.getLogger("scenewright")

MEGABYTE, MEBIBYTE = 1e6, 2**20
LOG_MEGABYTES_PER_MEGAPIXEL = 0.87
"""JPEG colour and zstd-packed 16-bit depth, as ingest stores them; 0.84 to 0.88 on generated logs."""
REPACKED = 1.2
"""Size of a sequence beside its log: 1.0 for MCAP that is packed already, 1.4 for a folder of JPEG and depth PNG."""
USUAL_FRAME = 0.3072
"""Megapixels of 640x480, where the size of the frames is not known yet."""


@dataclass(frozen=True)
class Amount:
    """How much an artifact or a log holds, as far as it is known."""

    megabytes: float
    lower: float
    """Megabytes that it has at least."""
    frames: float | None = None
    megapixels: float | None = None
    """Of all frames together."""

    @property
    def frame_megapixels(self) -> float:
        """Megapixels of one frame; less than one frame says nothing about its size."""
        if self.frames is None or self.frames < 1.0 or self.megapixels is None:
            return USUAL_FRAME
        return self.megapixels / self.frames


@dataclass(frozen=True)
class Estimate:
    """What a step is expected to write and use."""

    output: Amount
    memory: float
    """Peak resident memory [bytes]."""

    @property
    def disk(self) -> int:
        """Bytes that are expected to be written."""
        return int(self.output.megabytes * MEGABYTE)

    @property
    def disk_lower(self) -> int:
        """Bytes that are written at least."""
        return int(self.output.lower * MEGABYTE)

    def as_json(self) -> dict[str, int]:
        """Return the figures in bytes, for --json."""
        return {"disk_bytes": self.disk, "disk_bytes_at_least": self.disk_lower, "memory_bytes": int(self.memory)}

    def __str__(self) -> str:
        return f"about {_size(self.disk)} (at least {_size(self.disk_lower)}), {_size(self.memory)} of memory"


Inputs = Mapping[str, Amount]
Formula = Callable[[Any, Inputs], Estimate]
"""Parameters and what the inputs hold -> estimate."""


def estimate(stage_name: str, parameters: Any, inputs: Inputs) -> Estimate | None:
    """Return what a step is expected to write and use; None for a step that nobody measured."""
    formula = FORMULAS.get(stage_name)
    return formula(parameters, inputs) if formula else None


def estimate_step(stage_name: str, parameters: Any, paths: Mapping[str, Path]) -> Estimate | None:
    """Return the estimate of a step for inputs on the disk, role -> path; None when nothing can be said."""
    try:
        return estimate(stage_name, parameters, {role: measured(path) for role, path in paths.items()})
    except (BadInput, OSError):
        return None  # an estimate never stops a step: whoever opens the input says what is wrong with it


def measured(path: Path) -> Amount:
    """Return how much an input on the disk holds: an artifact by its manifest, a raw file or folder by its size.

    Raises OSError when it is not there.
    """
    path = Path(path)
    for root in (path, path.parent):
        if (root / MANIFEST_NAME).is_file():
            try:
                return _artifact_amount(root)
            except BadInput:
                break
    files = [p for p in path.rglob("*") if p.is_file()] if path.is_dir() else [path]
    size = sum(file.stat().st_size for file in files)
    return Amount(size / MEGABYTE, size / MEGABYTE)


def free_bytes(out: Path) -> int:
    """Return the free space where `out` is going to stand [bytes]."""
    folder = Path(os.path.abspath(out)).parent
    while not folder.exists():
        folder = folder.parent
    return shutil.disk_usage(folder).free


def available_memory() -> int:
    """Return the memory that is available now without swapping [bytes]."""
    import psutil

    return psutil.virtual_memory().available


def check(what: str, expected: Estimate, out: Path) -> list[str]:
    """Compare an estimate with the machine. Returns warnings.

    Raises MachineFailure when not even the least fits on the disk.
    """
    free = free_bytes(out)
    if free < expected.disk_lower:
        raise MachineFailure(
            f"{what} writes at least {_size(expected.disk_lower)}, and {_size(free)} are free at {out}",
            hint="free space (scenewright gc) or choose another --out",
        )
    warnings = []
    if free < expected.disk:
        warnings.append(f"{what} may fill the disk: {expected} expected, {_size(free)} are free at {out}")
    memory = available_memory()
    if memory < expected.memory:
        warnings.append(f"{what} may run out of memory: {_size(expected.memory)} expected, {_size(memory)} available")
    return warnings


def warn_or_refuse(stage_name: str, parameters: Any, paths: Mapping[str, Path], out: Path) -> None:
    """Log a warning when a step may not fit on this machine. Raises MachineFailure when it cannot."""
    expected = estimate_step(stage_name, parameters, paths)
    if expected is not None:
        for warning in check(stage_name, expected, out):
            logger.warning("%s", warning)


def _size(count: float) -> str:
    return f"{count / 1e9:.1f} GB" if count >= 1e9 else f"{count / 1e6:.1f} MB"


def _artifact_amount(root: Path) -> Amount:
    manifest = read_manifest(root)
    megabytes = sum(record.bytes for record in manifest.files) / MEGABYTE
    amount = Amount(megabytes, megabytes)
    if manifest.kind in ("sequence", "disparity"):
        info = SequenceFile.read(root / "sequence.json")
        sizes = {camera.name: camera.camera.width * camera.camera.height / 1e6 for camera in info.cameras}
        pixels = sum(sizes[camera.name] * camera.frame_count for camera in info.cameras)
        return Amount(megabytes, megabytes, info.frame_count, pixels or info.frame_count * sizes[info.cameras[0].name])
    if manifest.kind == "ground_truth":
        truth = GroundTruthFile.read(root / "ground_truth.json")
        return Amount(
            megabytes, megabytes, truth.frame_count, truth.frame_count * truth.camera.width * truth.camera.height / 1e6
        )
    return amount


# --- the table -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Linear:
    """A step whose output and memory grow with one of its inputs."""

    role: str
    megabytes: float
    per_megabyte: float
    mebibytes: float
    mebibytes_per_megabyte: float

    def __call__(self, parameters: Any, inputs: Inputs) -> Estimate:
        size = inputs[self.role].megabytes if self.role in inputs else 0.0
        expected = self.megabytes + self.per_megabyte * size
        memory = (self.mebibytes + self.mebibytes_per_megabyte * size) * MEBIBYTE
        return Estimate(Amount(expected, 0.02 * expected), memory)


def _library(parameters: Any, inputs: Inputs) -> Estimate:
    classes = len(parameters.classes) or 51
    models = classes * (parameters.shapes_per_class + parameters.small_shapes_per_class) / 2
    return Estimate(Amount(0.08 * models, 0.01 * models), 190 * MEBIBYTE)


def _synthesize(parameters: Any, inputs: Inputs) -> Estimate:
    megapixels = parameters.frames * parameters.width * parameters.height / 1e6
    log = LOG_MEGABYTES_PER_MEGAPIXEL * megapixels
    return Estimate(Amount(15 + log, 5 + 0.5 * log, parameters.frames, megapixels), 850 * MEBIBYTE)


def _ingest(parameters: Any, inputs: Inputs) -> Estimate:
    log = inputs["log"]
    share = 1 / parameters.every
    if log.megapixels is not None and log.frames is not None:
        frames = min(log.frames * share, parameters.max_frames or log.frames)
        megapixels = frames * log.frame_megapixels
        expected = LOG_MEGABYTES_PER_MEGAPIXEL * megapixels
        return Estimate(Amount(expected, 0.3 * expected, frames, megapixels), 120 * MEBIBYTE)
    expected = REPACKED * log.megabytes * share
    cut = parameters.max_frames is not None or parameters.stop is not None or parameters.start > 0
    # Raw images shrink to a sixth. A part of the log may be any part of it.
    return Estimate(
        Amount(expected, 0.0 if cut else 0.1 * expected, None, expected / LOG_MEGABYTES_PER_MEGAPIXEL), 150 * MEBIBYTE
    )


def _segment(parameters: Any, inputs: Inputs) -> Estimate:
    sequence = inputs["sequence"]
    megapixels = sequence.megapixels if sequence.megapixels is not None else sequence.megabytes
    frames = sequence.frames or megapixels / USUAL_FRAME
    expected = 0.015 * frames + 0.048 * megapixels
    memory = (215 + 300 * sequence.frame_megapixels) * MEBIBYTE
    return Estimate(Amount(expected, 0.2 * expected, frames, megapixels), memory)


def _fuse(parameters: Any, inputs: Inputs) -> Estimate:
    # A room of 30 m2: 1 cm voxels give 134 MB, 2 cm 30 MB, 4 cm 5.6 MB.
    blocks = 1 / parameters.voxel_size**2
    pixels = inputs["sequence"].frame_megapixels
    expected = 0.0127 * blocks
    return Estimate(Amount(expected, 0.05 * expected), (230 + 0.08 * blocks + 400 * pixels) * MEBIBYTE)


def _export(parameters: Any, inputs: Inputs) -> Estimate:
    sequence = inputs["sequence"]
    share = 1 / parameters.every * {"tum": 1.16, "nerfstudio": 1.08, "mcap": 1.0}[parameters.layout]
    cut = bool(parameters.streams) or parameters.camera is not None
    expected = sequence.megabytes * share
    return Estimate(Amount(expected, 0.0 if cut else 0.5 * expected), 120 * MEBIBYTE)


FORMULAS: dict[str, Formula] = {
    "library build": _library,
    "synthesize": _synthesize,
    "ingest": _ingest,
    "segment": _segment,
    "fuse": _fuse,
    "graph": _Linear("panoptic_map", 0.1, 0.0, 280, 3.0),
    "cad": _Linear("panoptic_map", 0.6, 0.28, 490, 0.0),
    "urdf": _Linear("cad_scene", 0.0, 2.1, 130, 23.0),
    "plan": _Linear("scene", 2.2, 0.0, 640, 0.0),
    "evaluate": _Linear("panoptic_map", 0.4, 0.0, 390, 3.5),
    "report": _Linear("panoptic_map", 1.0, 0.02, 840, 9.5),
    "export": _export,
}
"""Step -> formula. Outputs in megabytes, memory in MiB."""
