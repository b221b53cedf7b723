"""What a user brings of a generated room: masks with the errors of a detector, a log whose depth bends.

Run as a file by the generator's checkout, whose modules are found by their names of that day:
`python spoil.py --sequence FRAMES --masks FOLDER --errors detector --seed 5 [--dense FRAMES --bent LOG]`.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

FAULT_STREAM = 12
BIAS = 0.013
"""Largest share by which depth is too long or too short: kitchen, living room and office differ by as much."""
BENDING = 0.010
"""Largest 1/z by which a plane bends at the corner of the picture [1/m]: that of the kitchen."""
SHIFT = 8.0
"""Largest shift of the picture against the depth, along each axis [pixels at 640 width]: that of the office."""


@dataclass(frozen=True)
class DepthFaults:
    """What depth of one real camera is wrong by, beyond noise, at the levels of real logs."""

    bias: float
    bending: float
    shift: tuple[float, float]

    def depth(self, depth: np.ndarray, camera: Any) -> np.ndarray:
        """Return depth (H, W) [m] scaled and bent: 1/z' = 1/z - bending * r^2, r = 1 at the corner; 0 stays 0."""
        v, u = np.mgrid[0 : camera.height, 0 : camera.width]
        square = ((u - camera.cx) ** 2 + (v - camera.cy) ** 2) / (camera.cx**2 + camera.cy**2)
        with np.errstate(divide="ignore"):
            bent = 1.0 / (1.0 / depth.astype(float) - self.bending * square)
        return np.where(depth > 0, (1.0 + self.bias) * bent, 0.0).astype(np.float32)

    def shifted(self, picture: np.ndarray) -> np.ndarray:
        """Return a picture (H, W, ...) as one beside the depth has it; nothing comes in over the border."""
        du, dv = (round(value * picture.shape[1] / 640) for value in self.shift)
        moved = np.roll(picture, (dv, du), (0, 1))
        moved[: max(dv, 0)], moved[:, : max(du, 0)] = 0, 0
        if dv < 0:
            moved[dv:] = 0
        if du < 0:
            moved[:, du:] = 0
        return moved


def drawn_faults(seed: int) -> DepthFaults:
    """Return faults drawn evenly up to the levels, of either sign."""
    random = np.random.default_rng([seed, FAULT_STREAM])
    bias, bending, du, dv = random.uniform(-1.0, 1.0, 4) * [BIAS, BENDING, SHIFT, SHIFT]
    return DepthFaults(float(bias), float(bending), (float(du), float(dv)))


def opened_sequence(folder: Path) -> Any:
    """Return the sequence artifact at `folder`."""
    kind = import_module("schemas.sequence").Sequence
    return import_module("stages.engine.reading").open_artifact(folder, kind)


def write_masks(sequence: Path, folder: Path, errors: str, seed: int, faults: DepthFaults | None) -> None:
    """Write the masks of every frame as an NPZ that is named by its time; `errors`: `none`, or whose rates."""
    segment, choice = import_module("stages.segment.parameters"), import_module("stages.segment.choice")
    geometric = import_module("stages.segment.geometric")
    vocabulary = import_module("schemas.vocabulary").load_vocabulary()
    names = {entry.id: entry.name for entry in vocabulary.classes}
    parameters = segment.SegmentParameters.model_validate({"backend": "ground-truth", "lasting": errors})
    found = opened_sequence(sequence)
    folder.mkdir(parents=True)
    with import_module("stages.kit.formats.frames").FrameReader(found.path("frames.mcap")) as reader:
        backend = choice.choose_backend(choice.BackendRequest(parameters, sequence=found, reader=reader, seed=seed))
        for frame in reader.frames():
            camera = reader.cameras[frame.camera_name]
            segments = geometric.segment_depth(frame.depth, camera)
            masks = backend(frame, segments, np.random.default_rng([seed, frame.index]))
            ids = masks.ids if faults is None else faults.shifted(masks.ids)
            known = sorted(masks.masks)
            np.savez_compressed(
                folder / f"{frame.time:.6f}.npz",
                ids=ids.astype(np.int32),
                id=np.array(known, dtype=np.int32),
                classes=np.array([names[masks.masks[k].category_id] for k in known], dtype="U32"),
                scores=np.ones(len(known), dtype=np.float32),
            )


def write_bent(sequence: Path, log: Path, faults: DepthFaults) -> None:
    """Write the frames of a sequence as a log whose depth is wrong and whose pictures lie beside it."""
    frames, found = import_module("stages.kit.formats.frames"), opened_sequence(sequence)
    with frames.FrameReader(found.path("frames.mcap")) as reader:
        camera = reader.cameras[frames.CAMERA_FRAME]
        with frames.FrameWriter(log, camera) as writer:
            for frame in reader.frames():
                color, depth = faults.shifted(frame.color), faults.depth(frame.depth, camera)
                writer.write(frame.time, color, depth, frame.world_from_camera)


def main() -> None:
    """Write what the options name."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sequence", type=Path, required=True, help="the frames that are mapped")
    parser.add_argument("--masks", type=Path, required=True, help="folder to write")
    parser.add_argument("--errors", default="none", help="whose rates: none, detector, network")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--dense", type=Path, help="all frames of the recording, for --bent")
    parser.add_argument("--bent", type=Path, help="log to write, with faults of depth, which shift the masks too")
    asked = parser.parse_args()
    faults = drawn_faults(asked.seed) if asked.bent else None
    write_masks(asked.sequence, asked.masks, asked.errors, asked.seed, faults)
    if faults is not None:
        write_bent(asked.dense, asked.bent, faults)


if __name__ == "__main__":
    main()
