"""`scenewright suture follow`: a needle's pose as a line of JSON for every stereo pair that arrives."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer


def follow(
    pictures: Annotated[
        Path,
        typer.Argument(
            help="Folder of NAME_left.png and NAME_right.png (.jpg, .bmp) that grows; `-`: two files a line of stdin."
        ),
    ],
    rig: Annotated[Path, typer.Option("--rig", help="rig.json: the rectified pair (docs/STITCH.md).")],
    needle_radius: Annotated[
        float | None,
        typer.Option("--needle-radius", min=0.002, max=0.05, help="Radius of the half circle [m]; else rig.json's."),
    ] = None,
    masks: Annotated[
        Path | None,
        typer.Option("--masks", help="Folder of masks of your own: NAME_left.png, NAME_right.png, by the pair's name."),
    ] = None,
    segmenter: Annotated[
        Path | None, typer.Option("--segmenter", help="Checkpoint of the segmenter; else the one that comes along.")
    ] = None,
    latest: Annotated[bool, typer.Option("--latest", help="Pass over pairs that wait, but for the last.")] = False,
    idle: Annotated[
        float, typer.Option("--idle", min=0.0, max=86400.0, help="End when none came so long [s]; 0: what is there.")
    ] = 10.0,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> int:
    """Follow a needle: for every pair a line of JSON with its pose, covariance, or why there is none.

    Lines go to standard output as soon as they are known. What cannot be read is a line that says so.
    """
    from scenewright.stages.suture.following import Follower, growing_pairs, name_of, named_pairs, read_rig
    from scenewright.stages.suture.masks import masks_in, network_masks

    stereo, radius = read_rig(rig)
    make = masks_in(masks, (stereo.height, stereo.width), name_of) if masks is not None else network_masks(segmenter)
    follower = Follower(stereo, make, needle_radius or radius, cuts=masks is None)
    follower.ready()
    pairs = named_pairs(sys.stdin) if str(pictures) == "-" else growing_pairs(pictures, latest=latest, idle=idle)
    for files in pairs:
        sys.stdout.write(json.dumps(follower.line(files), allow_nan=False) + "\n")
        sys.stdout.flush()
    return 0
