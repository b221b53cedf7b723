"""The rendered pairs that `scenewright train raft-stereo` reads; what is there is not made again.

    python -m benchmarks.disparity.training_pairs --out FOLDER [--quick]

Generated rooms (seeds 300 to 303) and the needle world (seeds 0 to 27, endoscope 200 to 205).
"""

from __future__ import annotations

from scenewright.stages.suture import ENDOSCOPE

from benchmarks.disparity.rendered_pairs import needle_stem, room_stems
from benchmarks.options import Recipe, asked
from benchmarks.steps import made

ROOMS, NEEDLES, ENDOSCOPES = range(300, 304), range(28), range(200, 206)
ROOM_FRAMES, ROOM_SIZE = 16, (480, 360)
CALIBRATION_ERROR = 0.15
"""Of the right eye of needles [px]."""


def main() -> None:
    """Render what is missing."""
    options = asked(Recipe)
    few = 1 if options.quick else None
    shapes = ("--shapes-per-class", 4, "--small-shapes-per-class", 4)
    library = made("library build", options.out / "cad_library", *shapes, "--seed", 1)
    for seed in ROOMS[:few]:
        room_stems(options.out, library, seed, 2 if options.quick else ROOM_FRAMES, ROOM_SIZE)
    for seed in NEEDLES[:few]:
        needle_stem(options.out, seed, calibration_error=CALIBRATION_ERROR)
    for seed in ENDOSCOPES[:few]:
        needle_stem(options.out, seed, ENDOSCOPE, CALIBRATION_ERROR)


if __name__ == "__main__":
    main()
