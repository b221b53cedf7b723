"""Declaration of `scenewright segment`. Pixel counts hold for 640x480 and are rescaled by the area of the image."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field, create_model, field_validator
from pydantic_core import PydanticCustomError
from scenewright.schemas.errors import UsageError
from scenewright.schemas.segments import Segments
from scenewright.schemas.sequence import Sequence
from scenewright.stages.kit.estimates import USUAL_FRAME, Estimate, Inputs
from scenewright.stages.kit.stage import External, Optionally, Parameters, Stage
from scenewright.stages.segment.registry import (
    AND,
    all_backends,
    backend_help,
    check_backend,
    data_files,
    usual_detector,
    usual_witness,
    weights_help,
)


class CommonParameters(Parameters):
    """Options of `segment`, without those that one backend declares for itself. Defaults of the geometric part and of
    the fusion are those of the published system."""

    backend: str = Field("auto", description=f"Where panoptic masks come from: {backend_help()}")
    fusion: Literal["ours", "thesis", "voxblox++"] = Field(
        "ours",
        description="`thesis` follows the text; `ours` also keeps small segments that a mask claims and cuts a "
        "segment that several masks share; `voxblox++` neither splits nor clusters (give `--majority-share 0.5`)",
    )

    grid_columns: int = Field(
        320,
        ge=0,
        description="Geometric segments are found on every so many-th pixel, about so many columns; 0: on all pixels",
    )
    smoothing_window: int = Field(
        7, ge=0, le=31, description="Window of the bilateral filter on inverse depth [pixels]; 0 = none, as published"
    )
    smoothing_deviation: float = Field(
        0.009, gt=0, description="Depth steps under this are smoothed as noise, over it kept [1/m]"
    )
    normal_window: int = Field(
        9, ge=3, le=31, description="Window of the normals [pixels, odd]; published: 13, on depth that is not smoothed"
    )
    normal_step: int = Field(2, ge=1, le=6, description="Stride in that window")
    normal_distance_factor: float = Field(
        0.05, gt=0, description="Largest distance of a normal's points, times the depth"
    )
    convexity_window: int = Field(5, ge=3, le=31, description="Window of the minimum convexity [pixels, odd]")
    convexity_threshold: float = Field(0.97, gt=0, le=1, description="Less convex pixels are edges [cosine]")
    convexity_mask_threshold: float = Field(
        -0.0005, le=0, description="Neighbours less high over the tangent plane than this (negated) are convex [m]"
    )
    mutual_convexity: bool = Field(
        True, description="Judge convexity from both pixels of a pair (no: from the middle one alone, as published)"
    )
    discontinuity_ratio: float = Field(
        0.01, gt=0, lt=1, description="Depth discontinuities: least step, as a share of depth"
    )
    discontinuity_window: int = Field(3, ge=3, le=15, description="Window of the depth discontinuities [pixels]")
    opening: int = Field(1, ge=0, le=5, description="Radius of the opening of the convex map [pixels]")
    closing: int = Field(1, ge=0, le=5, description="Radius of the closing of the depth discontinuities [pixels]")
    geometric_minimum: int = Field(200, ge=1, description="Smallest geometric region [pixels at 640x480]")

    fusion_minimum: int = Field(800, ge=1, description="Smallest geometric segment that is fused [pixels at 640x480]")
    contained_share: float = Field(
        0.9, gt=0, lt=1, description="A mask of which more than this lies in one segment may be split out of it"
    )
    largest_part: float = Field(0.5, gt=0, le=1, description="... if it is less than this share of the segment")
    majority_share: float = Field(
        0.2, gt=0, le=1, description="A segment takes the label of a mask that covers at least this share of it"
    )
    cluster_distance: float = Field(
        0.05, gt=0, description="Segments of an instance within this distance belong together [m]"
    )
    cluster_step: int = Field(5, ge=1, description="Point stride of that clustering")
    small_object_pixels: int = Field(
        60, ge=1, description="Smallest segment that `ours` keeps for a mask [pixels at 640x480]"
    )

    score_threshold: float = Field(
        0.3, gt=0, lt=1, description="Minimum score of detections, instances and panoptic segments"
    )
    suppression_overlap: float = Field(
        0.5, gt=0, lt=1, description="Non-maximum suppression: IoU above which two detections of a class are one"
    )

    tiles: int | None = Field(
        None,
        ge=0,
        le=4,
        description="Overlapping tiles a side on which the network runs too: small things, at more time; 0: "
        "none. Default: those of `detector`; none of `tflite`, `onnx`",
    )

    @field_validator("backend")
    @classmethod
    def _check_backend(cls, backend: str) -> str:
        try:
            return check_backend(backend)
        except ValueError as error:
            raise PydanticCustomError("backend", "{reason}", {"reason": str(error)}) from None

    @field_validator("tiles")
    @classmethod
    def _check_tiles(cls, tiles: int | None) -> int | None:
        if tiles == 1:
            raise PydanticCustomError("tiles", "one tile is the frame itself; 0 for none, or 2 to 4 a side")
        return tiles


if TYPE_CHECKING:
    SegmentParameters = CommonParameters
else:
    _OWN = [declared.parameters for declared in all_backends() if declared.parameters is not None]
    SegmentParameters = create_model("SegmentParameters", __base__=(*reversed(_OWN), CommonParameters))
    """Options of `segment`: the common ones and those of every backend."""


def check(parameters: SegmentParameters, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError for masks that no backend asked for, and for a backend that asks for masks and has none."""
    names = parameters.backend.split(AND)
    if "masks" in names and "masks" not in inputs:
        raise UsageError("--backend masks needs a folder of masks", hint="--masks FOLDER (docs/MASKS.md)")
    if "masks" not in names and "masks" in inputs:
        raise UsageError("--masks is for --backend masks alone", hint="add --backend masks, or leave --masks out")


def _estimate(parameters: SegmentParameters, inputs: Inputs) -> Estimate:
    sequence = inputs["sequence"]
    megapixels = sequence.megapixels if sequence.megapixels is not None else sequence.megabytes
    frames = sequence.frames or megapixels / USUAL_FRAME
    expected = 0.015 * frames + 0.048 * megapixels
    return Estimate(expected, 0.2 * expected, 215 + 300 * sequence.frame_megapixels, frames, megapixels)


STAGE = Stage(
    name="segment",
    summary="Segment every frame: panoptic masks of a backend fused with geometric segments of the depth",
    parameters=SegmentParameters,
    reads={
        "sequence": Sequence,
        "weights": Optionally(External(f"Network: {weights_help()}", weights=True), usual=usual_detector),
        "mask_weights": Optionally(
            External(
                "Segment Anything folder or hub id that turns the boxes of an open-vocabulary model into masks",
                weights=True,
            )
        ),
        "semantic_weights": Optionally(
            External(
                "Semantic network (.tflite, .onnx). With `detector` it is a witness: what both see counts at half the "
                "score, what it denies loses its name; with `tflite` and `onnx` it names what no instance covers",
                weights=True,
            ),
            usual=usual_witness,
        ),
        "labels": Optionally(
            External("The network's labels and their classes (TOML as in data/labels), or a list of words, one a line")
        ),
        "sidecar": Optionally(External("TOML that says what goes into a network and what comes out")),
        "masks": Optionally(
            External("Masks made elsewhere, for --backend masks: COCO, SAM, PNG or NPZ files (docs/MASKS.md)")
        ),
    },
    writes=Segments,
    libraries=("numpy", "opencv-python-headless", "numba", "scipy"),
    versions="registry",
    data_files=data_files,
    check=check,
    extras=tuple(dict.fromkeys(extra for declared in all_backends() for extra in declared.extras)),
    example="scenewright segment --sequence outputs/demo/sequence --out outputs/demo/segments",
    estimate=_estimate,
)
