"""What a step is going to write and to use, declared beside its parameters as measured ratios and honest bounds.

The figures were measured on demo runs (24 frames of 240x180 to 120 of 640x480, voxels of 4, 2 and 1 cm) and on real
logs (docs/EDIT.md). What nobody knows before, such as how much surface was seen, makes the lower bound far
less than what is expected, and only that bound stops a run.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

MEGABYTE, MEBIBYTE = 1e6, 2**20
"""Bytes a megabyte and a mebibyte."""
LOG_MEGABYTES_PER_MEGAPIXEL = 0.87
"""JPEG colour and zstd-packed 16-bit depth, as frames are stored; 0.84 to 0.88 on generated logs."""
USUAL_FRAME = 0.3072
"""Megapixels of 640x480, where the size of the frames is not known yet."""


@dataclass(frozen=True)
class Estimate:
    """What an artifact or a log holds, or is going to hold, as far as it is known."""

    megabytes: float
    lower: float
    """Megabytes that it has at least."""
    mebibytes: float = 0.0
    """Peak resident memory of the step that writes it [MiB]."""
    frames: float | None = None
    megapixels: float | None = None
    """Of all frames together."""

    @property
    def frame_megapixels(self) -> float:
        """Megapixels of one frame; less than one frame says nothing about its size."""
        if self.frames is None or self.frames < 1.0 or self.megapixels is None:
            return USUAL_FRAME
        return self.megapixels / self.frames

    @property
    def disk(self) -> int:
        """Bytes that are expected to be written."""
        return int(self.megabytes * MEGABYTE)

    @property
    def disk_lower(self) -> int:
        """Bytes that are written at least."""
        return int(self.lower * MEGABYTE)

    @property
    def memory(self) -> int:
        """Peak resident memory [bytes]."""
        return int(self.mebibytes * MEBIBYTE)

    def as_json(self) -> dict[str, int]:
        """Return the figures in bytes, for --json."""
        return {"disk_bytes": self.disk, "disk_bytes_at_least": self.disk_lower, "memory_bytes": self.memory}

    def __str__(self) -> str:
        return f"about {size(self.disk)} (at least {size(self.disk_lower)}), {size(self.memory)} of memory"


Inputs = Mapping[str, Estimate]
"""Role -> what the input holds."""
Formula = Callable[[Any, Inputs], Estimate]
"""Parameters and inputs -> what the step writes and uses."""


def grows_with(
    role: str, megabytes: float, per_megabyte: float, mebibytes: float, mebibytes_per_megabyte: float
) -> Formula:
    """Return the formula of a step whose output and memory grow with one of its inputs."""

    def formula(parameters: Any, inputs: Inputs) -> Estimate:
        input_megabytes = inputs[role].megabytes if role in inputs else 0.0
        expected = megabytes + per_megabyte * input_megabytes
        return Estimate(expected, 0.02 * expected, mebibytes + mebibytes_per_megabyte * input_megabytes)

    return formula


def size(count: float) -> str:
    """Return a number of bytes for people."""
    return f"{count / 1e9:.1f} GB" if count >= 1e9 else f"{count / 1e6:.1f} MB"
