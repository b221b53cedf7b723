"""Declarations of the steps `suture scene`, `needle`, `thread`, `simulate` and `evaluate`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field
from scenewright.schemas.disparity import Disparity
from scenewright.schemas.errors import UsageError
from scenewright.schemas.places import data_file
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.suture_needle import SutureNeedle, SutureThread
from scenewright.schemas.suture_scene import SutureScene
from scenewright.schemas.suture_trial import SutureEvaluation, SutureTrial
from scenewright.stages.kit.stage import External, Optionally, Parameters, Stage
from scenewright.stages.suture.options import ARM_NAMES, CHECKPOINT, HolderName, MaskOptions, PlaceName

NEED_DISPARITY = ("thesis",)
"""Estimators that see no needle without a disparity."""
MASKS = Optionally(
    External("folder of masks <frame:06d>_left.png, _right.png: 1 or 255 needle, 2 thread, 3 and 4 what hides them")
)
SEGMENTER = Optionally(External("checkpoint of the segmenter (docs/STITCH.md)", weights=True))


class SceneParameters(Parameters):
    """Options of `suture scene`. Everything follows from them and --seed."""

    frames: int = Field(1, ge=1, le=500, description="Stereo pairs; rendering one takes a second or two")
    arrangement: Literal["motion", "views"] = Field(
        "motion", description="More frames than one: the needle moves (`motion`), or every frame is another scene"
    )
    rig: Literal["two_cameras", "endoscope"] = Field(
        "two_cameras", description="Two cameras 60 mm apart at 36 cm, or an endoscope of 6 mm baseline at 13 cm"
    )
    holder: HolderName = Field("any", description="Who holds the needle; drawn where `any`")
    place: PlaceName = Field("any", description="Where in the workspace the needle is; drawn where `any`")
    calibration_error: float = Field(
        0.15, ge=0.0, le=3.0, description="Shift of the right image that the calibration does not know [px, 1 sigma]"
    )


class NeedleParameters(MaskOptions):
    """Options of `suture needle`."""

    estimator: Literal["ours", "thesis"] = Field(
        "ours", description="Ours, or the thesis's (RANSAC plane and circle on the disparity's points)"
    )
    filter: Literal["auto", "none", "kinematics", "still"] = Field(
        "auto",
        description="Frames to one estimate: by the motion that a scene's kinematics report, as of a needle at rest, "
        "or not; `auto`: kinematics where they are known",
    )
    needle_radius: float = Field(
        0.012, ge=0.002, le=0.05, description="Radius of the needle's half circle [m]; 12 mm is a GS-21's"
    )
    fit_radius: bool = Field(
        False, description="Fit the radius (6 to 20 mm) to the first frames instead; wire and taper scale with it"
    )


class ThreadParameters(MaskOptions):
    """Options of `suture thread`."""


class SimulateParameters(Parameters):
    """Options of `suture simulate`. Trial k of every arm has the seed --seed + k: the same needle, thread, errors."""

    arms: tuple[str, ...] = Field(("ours",), description="Policies: " + ", ".join(ARM_NAMES))
    trials: int = Field(1, ge=1, le=2000, description="Trials of each arm")
    record: str = Field("", description="Arm whose first trial is recorded with its motions; empty: the first arm")
    sight: Literal["model", "geometry", "pictures"] = Field(
        "model",
        description="How the needle is seen: an error `model`, or the arm's estimator on rendered views: "
        "`geometry` with spoiled masks (15 s a trial), `pictures` with the network's (80 s)",
    )


class EvaluateParameters(Parameters):
    """Options of `suture evaluate`."""

    label: str = Field("", description="What the figures are about; empty: made from the inputs")


def check_masks(parameters: MaskOptions, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError for masks that are asked for and not given."""
    needed_input = {"files": "masks", "network": "segmenter"}.get(parameters.segmentation)
    if needed_input == "masks" and inputs.get("masks") is None:
        raise UsageError("--segmentation files needs --masks", hint="a folder of <frame:06d>_left.png and _right.png")
    for source, role in (("files", "masks"), ("network", "segmenter")):
        if inputs.get(role) is not None and parameters.segmentation not in ("auto", source):
            raise UsageError(f"--{role} is for --segmentation {source}", hint="leave one of them out")
    if inputs.get("masks") is not None and inputs.get("segmenter") is not None:
        raise UsageError("--masks and --segmenter both say where masks come from", hint="give one of them")


def check_needle(parameters: NeedleParameters, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError for options and inputs that do not go together."""
    check_masks(parameters, inputs)
    if parameters.fit_radius and parameters.estimator != "ours":
        raise UsageError(
            f"--fit-radius is not for --estimator {parameters.estimator}", hint="give --needle-radius METRES instead"
        )
    if parameters.estimator in NEED_DISPARITY and inputs.get("disparity") is None:
        raise UsageError(
            f"--estimator {parameters.estimator} needs --disparity",
            hint="make it: scenewright disparity --sequence SCENE --out FOLDER",
        )


def check_simulate(parameters: SimulateParameters, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError for unknown arms, and for arms that are named twice."""
    for arm in parameters.arms:
        if arm not in ARM_NAMES:
            raise UsageError(f"--arms: there is no arm {arm!r}", hint=f"choose one of {', '.join(ARM_NAMES)}")
    if parameters.record and parameters.record not in parameters.arms:
        raise UsageError(f"--record {parameters.record} is none of the arms", hint=f"--arms {parameters.record}")
    if parameters.sight != "model" and inputs.get("perception") is not None:
        raise UsageError(
            f"--perception is not an error model of --sight {parameters.sight}", hint="leave one of them out"
        )
    if len(set(parameters.arms)) != len(parameters.arms):
        raise UsageError(f"--arms: an arm is named twice ({' '.join(parameters.arms)})", hint="name each once")


def check_evaluate(parameters: EvaluateParameters, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError unless there is something to evaluate, and a truth for what needs one."""
    if not set(inputs) & {"trials", "needle", "needle_thesis", "thread"}:
        raise UsageError("suture evaluate: nothing to evaluate", hint="give --trials, or --needle with --scene")
    judged_inputs = sorted(set(inputs) & {"needle", "needle_thesis", "thread"})
    if judged_inputs and "scene" not in inputs:
        raise UsageError(
            f"--{judged_inputs[0].replace('_', '-')} is judged by a scene's truth", hint="give --scene too"
        )
    if not judged_inputs and "scene" in inputs:
        raise UsageError("--scene is the truth of --needle or --thread", hint="give one of them, or leave it out")


def mask_files(parameters: MaskOptions) -> tuple[str, ...]:
    """Return the files of `data/` that masks may come from: the shipped segmenter, where there is one."""
    shipped = parameters.segmentation in ("auto", "network") and data_file(CHECKPOINT).is_file()
    return (CHECKPOINT,) if shipped else ()


def perception_files(parameters: SimulateParameters) -> tuple[str, ...]:
    """Return the files of `data/` that the arms see by."""
    models = ("stitch/perception_ours.toml", "stitch/perception_thesis.toml")
    return (*models, CHECKPOINT) if parameters.sight == "pictures" and data_file(CHECKPOINT).is_file() else models


SCENE = Stage(
    name="suture scene",
    summary="Render stereo pairs of a suture needle with thread, drivers and a wound pad, and the truth",
    parameters=SceneParameters,
    reads={},
    writes=SutureScene,
    libraries=("numpy", "scipy", "numba", "opencv-python-headless"),
    module="scene_stage",
    example="scenewright suture scene --frames 10 --seed 3 --out outputs/stitch/scene",
)
NEEDLE = Stage(
    name="suture needle",
    summary="Find the needle's pose in stereo pairs, with its covariance, or say why it cannot be known (STITCH)",
    parameters=NeedleParameters,
    reads={"sequence": Sequence, "disparity": Optionally(Disparity), "masks": MASKS, "segmenter": SEGMENTER},
    writes=SutureNeedle,
    libraries=("numpy", "scipy", "numba", "opencv-python-headless"),
    versions="versions",
    module="needle_stage",
    data_files=mask_files,
    check=check_needle,
    example="scenewright suture needle --sequence outputs/stitch/scene --disparity outputs/stitch/disparity "
    "--out outputs/stitch/needle",
)
THREAD = Stage(
    name="suture thread",
    summary="Trace the thread in both eyes and give its curve in space and its length",
    parameters=ThreadParameters,
    reads={"sequence": Sequence, "needle": Optionally(SutureNeedle), "masks": MASKS, "segmenter": SEGMENTER},
    writes=SutureThread,
    libraries=("numpy", "scipy", "numba", "opencv-python-headless"),
    versions="versions",
    module="thread_stage",
    data_files=mask_files,
    check=check_masks,
    example="scenewright suture thread --sequence outputs/stitch/scene --out outputs/stitch/thread",
)
SIMULATE = Stage(
    name="suture simulate",
    summary="Throw running sutures with two simulated arms until a failure that ends the trial, or six",
    parameters=SimulateParameters,
    reads={"perception": Optionally(External("error model of perception (TOML) that every arm sees by"))},
    writes=SutureTrial,
    libraries=("numpy", "scipy", "numba", "matplotlib"),
    module="simulate_stage",
    data_files=perception_files,
    check=check_simulate,
    example="scenewright suture simulate --arms ours --seed 3 --out outputs/stitch/trial",
)
EVALUATE = Stage(
    name="suture evaluate",
    summary="Figures of trials (table 4.1, figure 4.1) and of needle poses and threads against the truth",
    parameters=EvaluateParameters,
    reads={
        "trials": Optionally(SutureTrial),
        "scene": Optionally(SutureScene),
        "needle": Optionally(SutureNeedle),
        "needle_thesis": Optionally(SutureNeedle),
        "thread": Optionally(SutureThread),
    },
    writes=SutureEvaluation,
    libraries=("numpy", "scipy", "matplotlib"),
    module="evaluate_stage",
    check=check_evaluate,
    example="scenewright suture evaluate --trials outputs/stitch/trials --out outputs/stitch/evaluation",
)
STAGES = [SCENE, NEEDLE, THREAD, SIMULATE, EVALUATE]
