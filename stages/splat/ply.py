"""Gaussians as a PLY file in the order that viewers of splats read (Kerbl et al. 2023, its public code)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import file_content
from scenewright.stages.kit.rendering.splatting.gaussians import Gaussians

HIGHER = 15
"""Coefficients of a colour above degree 0, always written: viewers expect them."""
COLUMNS = (
    *("x", "y", "z", "nx", "ny", "nz"),
    *(f"f_dc_{k}" for k in range(3)),
    *(f"f_rest_{k}" for k in range(3 * HIGHER)),
    "opacity",
    *(f"scale_{k}" for k in range(3)),
    *(f"rot_{k}" for k in range(4)),
)
"""Names of a Gaussian's numbers, in order."""
LARGEST_FILE = 4 * 2**30
"""Largest file that is read [bytes]; by eye."""
LARGEST_HEADER = 4000
"""Longest header [bytes]; by eye."""


def write_gaussians(path: Path, gaussians: Gaussians) -> None:
    """Write Gaussians without their features; normals are zero, coefficients of a colour stand channel by channel."""
    count = len(gaussians)
    higher = np.zeros((count, 3, HIGHER), np.float32)
    higher[:, :, : gaussians.harmonics.shape[1] - 1] = gaussians.harmonics[:, 1:].transpose(0, 2, 1)
    columns = (
        gaussians.means,
        np.zeros((count, 3)),
        gaussians.harmonics[:, 0],
        higher.reshape(count, 3 * HIGHER),
        gaussians.logit_opacities[:, None],
        gaussians.log_scales,
        gaussians.quaternions / np.linalg.norm(gaussians.quaternions, axis=1, keepdims=True),
    )
    table = np.concatenate(columns, axis=1).astype("<f4")
    Path(path).write_bytes(_header(count) + table.tobytes())


def read_gaussians(path: Path) -> Gaussians:
    """Read what `write_gaussians` wrote. Raises BadInput for another layout, a torn file, or what is no number."""
    data = file_content(path, LARGEST_FILE)
    end = data.find(b"end_header\n", 0, LARGEST_HEADER) + len(b"end_header\n")
    words = data[:LARGEST_HEADER].split(maxsplit=7)
    count = int(words[6]) if len(words) > 7 and words[6].isdigit() and len(words[6]) < 12 else -1
    if count < 0 or data[:end] != _header(count):
        raise BadInput(f"{path}: no PLY of Gaussians in the expected order", hint="make the splat again")
    if len(data) - end != count * len(COLUMNS) * 4:
        raise BadInput(f"{path}: torn: {len(data) - end} bytes, expected {count * len(COLUMNS) * 4}")
    table = np.frombuffer(data[end:], "<f4").reshape(count, len(COLUMNS)).copy()
    if not np.isfinite(table).all() or (count and (table[:, -4:] == 0).all(axis=1).any()):
        raise BadInput(f"{path}: a Gaussian has a value that is not a number", hint="make the splat again")
    higher = table[:, 9 : 9 + 3 * HIGHER].reshape(count, 3, HIGHER).transpose(0, 2, 1)
    harmonics = np.concatenate([table[:, None, 6:9], higher], axis=1)
    at = 9 + 3 * HIGHER
    return Gaussians(
        np.ascontiguousarray(table[:, :3]),
        np.ascontiguousarray(table[:, at + 4 :]),
        np.ascontiguousarray(table[:, at + 1 : at + 4]),
        np.ascontiguousarray(table[:, at]),
        np.ascontiguousarray(harmonics),
        np.zeros((count, 0), np.float32),
    )


def _header(count: int) -> bytes:
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {count}"]
    return "\n".join([*lines, *(f"property float {name}" for name in COLUMNS), "end_header\n"]).encode()
