"""The steps of `suture`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from tests.advice.inputs import suture
from tests.advice.rows import NotTried, Tried

MASKS, OPTIONS = "stages/suture/masks.py", "stages/suture/parameters.py"
SEGMENTER = "scenewright.stages.suture.segmentation.infer"
NEEDLE = "suture needle --sequence {suture}/scene --out out"
ASKED = "suture needle --sequence {golden}/suture_scene --out out"
OWN = "suture needle --sequence {suture}/sequence --out out"
KINDS = {role: f"--{role} {{golden}}/suture_{role}" for role in ("scene", "needle", "thread")}


def options(says: str, first: str, *then: str) -> list[Tried]:
    """Options that do not go together, and each way out."""
    return [Tried(OPTIONS, says, f"{first} --dry-run", f"{each} --dry-run") for each in then]


def the_needle(folder: Path) -> None:
    """Within 1 mm of where the scene has it."""
    frame = json.loads((folder / "out/needle.json").read_text())["frames"][0]
    view = json.loads(Path(suture(), "scene/scene.json").read_text())["views"][0]
    found, true = (np.array(told["camera_from_needle"])[:3, 3] for told in (frame["estimate"], view))
    assert np.abs(found - true).max() < 1e-3, found - true


ROWS = [
    *options(
        "--segmentation files needs --masks",
        f"{ASKED} --segmentation files",
        f"{ASKED} --segmentation files --masks {{golden}}",
    ),
    *options(
        "is for --segmentation",
        f"{ASKED} --segmentation truth --masks {{golden}}",
        f"{ASKED} --segmentation truth",
        f"{ASKED} --masks {{golden}}",
    ),
    *options(
        "both say where masks come from",
        f"{ASKED} --masks {{golden}} --segmenter {{golden}}/segments/segments.json",
        f"{ASKED} --masks {{golden}}",
        f"{ASKED} --segmenter {{golden}}/segments/segments.json",
    ),
    *options(
        "--fit-radius",
        f"{ASKED} --estimator thesis --disparity {{golden}}/disparity --fit-radius",
        f"{ASKED} --estimator thesis --disparity {{golden}}/disparity --needle-radius 0.01",
    ),
    *options(
        "needs --disparity",
        f"{ASKED} --estimator thesis",
        "disparity --sequence {golden}/suture_scene --out depth --dry-run && "
        f"{ASKED} --estimator thesis --disparity {{golden}}/disparity",
    ),
    *options("there is no arm", "suture simulate --out out --arms our", "suture simulate --out out --arms ours"),
    *options(
        "is none of the arms",
        "suture simulate --out out --arms thesis --record ours",
        "suture simulate --out out --arms ours --record ours",
        "suture simulate --out out --arms thesis --arms ours --record ours",
    ),
    *options(
        "--perception",
        "suture simulate --out out --sight geometry --perception {golden}/suture_trial/trial.json",
        "suture simulate --out out --sight geometry",
        "suture simulate --out out --perception {golden}/suture_trial/trial.json",
    ),
    *options(
        "named twice", "suture simulate --out out --arms ours --arms ours", "suture simulate --out out --arms ours"
    ),
    *options(
        "nothing to evaluate",
        "suture evaluate --out out",
        "suture evaluate --out out --trials {golden}/suture_trial",
        f"suture evaluate --out out {KINDS['needle']} {KINDS['scene']}",
    ),
    *options(
        "is judged by a scene's truth",
        f"suture evaluate --out out {KINDS['thread']}",
        f"suture evaluate --out out {KINDS['thread']} {KINDS['scene']}",
    ),
    *options(
        "--scene is the truth of",
        f"suture evaluate --out out --trials {{golden}}/suture_trial {KINDS['scene']}",
        "suture evaluate --out out --trials {golden}/suture_trial",
        f"suture evaluate --out out {KINDS['needle']} {KINDS['scene']}",
    ),
    Tried(MASKS, "has no truth to take them from", f"{OWN} --segmentation truth", OWN, code=3, right=the_needle),
    Tried(
        MASKS,
        "has no truth to take them from",
        f"{OWN} --segmentation truth",
        f"{OWN} --masks {{suture}}/scene/truth",
        code=3,
        right=the_needle,
    ),
    Tried(
        MASKS,
        "--masks FOLDER instead",
        OWN,
        f"{OWN} --masks {{suture}}/scene/truth",
        code=5,
        lacks=(SEGMENTER,),
        right=the_needle,
    ),
    Tried(
        "stages/suture/trials/sight.py",
        "--sight geometry",
        "suture simulate --out out --sight pictures",
        "suture simulate --out out --sight geometry --dry-run",
        code=5,
        lacks=(SEGMENTER,),
    ),
    *(
        Tried(
            "stages/suture/needle_stage.py",
            "--filter still",
            f"{NEEDLE} --segmentation truth --filter kinematics",
            f"{NEEDLE} --segmentation truth --filter {motion}",
            code=3,
            right=the_needle,
        )
        for motion in ("still", "none")
    ),
    NotTried(
        "stages/suture/segmentation/checkpoint.py", "scenewright suture", "names the format of a file, advises nothing"
    ),
    NotTried(
        "stages/suture/training/needle_evidence/train.py", "--quick", "a view takes seconds, all of them half an hour"
    ),
]
