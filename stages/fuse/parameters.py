"""Declaration of `scenewright fuse`. Defaults are the published system's, at the voxel size of the quick chain."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field
from scenewright.schemas.articulations import Articulations
from scenewright.schemas.class_counts import FILE as CLASS_COUNTS
from scenewright.schemas.errors import UsageError
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.segments import Segments
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.trajectory import Trajectory
from scenewright.stages.kit.estimates import Estimate, Inputs
from scenewright.stages.kit.known_names import AxisName, UnitName
from scenewright.stages.kit.labels import LABEL_TABLES
from scenewright.stages.kit.stage import External, Optionally, Parameters, Stage


class FuseParameters(Parameters):
    """Options of `fuse`."""

    voxel_size: float = Field(0.02, ge=0.001, le=1, description="TSDF voxel edge [m]")
    truncation_voxels: float = Field(4.0, ge=1, le=32, description="Truncation distance [voxels]")
    minimum_depth: float = Field(0.1, ge=0.01, description="Minimum depth [m]")
    maximum_depth: float = Field(4.0, gt=0.01, description="Maximum depth [m]")
    exposure: bool = Field(
        True, description="ours: take changes of exposure and white balance between frames out of the colours"
    )
    maximum_weight: float = Field(
        1000.0, gt=0, le=60000, description="Maximum weight of a voxel; older observations fade beyond it"
    )
    every: int = Field(1, ge=1, description="Integrate every n-th frame")
    block_stride: int = Field(4, ge=1, le=16, description="Pixel stride of the search for voxel blocks")
    snapshot_every: int = Field(
        0, ge=0, description="Keep a snapshot of the map every n frames, for `timeline` (0: never)"
    )
    pose_tolerance: float = Field(
        0.02, ge=0, description="Largest time difference between a pose of --trajectory and its frame [s]"
    )

    label_band: float = Field(
        0.4,
        gt=0,
        le=1,
        description="Band in which voxels are labelled, as a share of the truncation distance (thesis: 1)",
    )
    overlap_stride: int = Field(2, ge=1, le=16, description="Pixel stride of the overlap with the map")
    minimum_overlap_voxels: int = Field(
        8, ge=1, description="Smallest overlap, and frame segment, that is matched [voxels]"
    )
    minimum_overlap_share: float = Field(
        0.1, ge=0, le=1, description="Least share of a frame segment's voxels that agree with its match"
    )

    merging: Literal["ours", "thesis", "separate"] = Field(
        "ours",
        description="`thesis`: segment labels of one frame segment merge; `ours`: only those of a class, more "
        "often together than apart, and instances seen as one; `separate`: none (Voxblox++)",
    )
    merge_overlap_share: float = Field(
        0.2, gt=0, le=1, description="Least share of a frame segment that each of two labels fills when they share it"
    )
    merge_minimum_frames: int = Field(3, ge=1, description="Shared frame segments after which two labels merge")
    instance_minimum_frames: int = Field(
        2, ge=1, description="`ours`: frames that see two things as one, more than see them as two, before these merge"
    )
    instance_threshold: float = Field(0.5, gt=0, le=1, description="m_th of eq. 2.5")
    instance_minimum_count: int = Field(10, ge=0, description="Common count above which instances merge")
    regularize_every: int = Field(10, ge=1, description="Merge instances every n-th frame, and at the end")

    minimum_weight: float = Field(
        0.1, ge=0, description="Minimum voxel weight of the extracted surface (a frame at depth z: 1/z^2)"
    )
    smoothing: float = Field(
        0.2, ge=0, description="Smoothing of the TSDF before surface extraction: weight of a voxel's neighbours"
    )
    minimum_entity_voxels: int = Field(20, ge=1, description="Smallest entity that is kept [surface voxels]")
    minimum_observations: int = Field(
        3, ge=1, description="Fewest frames that vote for an entity; a tenth of the frames where that is less"
    )
    minimum_prediction_share: float = Field(
        0.15, ge=0, le=1, description="Least share of a segment's frames in which it is no background (thesis: 0)"
    )
    spread_steps: int = Field(
        2, ge=0, description="Iterations in which unlabelled vertices take the label of the smooth surface around them"
    )
    speck_share: float = Field(
        0.05, ge=0, lt=1, description="Smallest part of a thing that keeps its label, as a share of its largest part"
    )
    piece_share: float = Field(
        0.2,
        ge=0,
        lt=1,
        description="Size of a thing, as a share of one of its class that it touches, under which it is a part of that",
    )
    unnamed_area: float = Field(
        0.2,
        ge=0,
        description="`ours`: smallest free-standing unlabelled surface that becomes an `object` [m^2] (0: none does)",
    )
    unit: Literal["declared", UnitName] = Field(
        "declared", description="Unit of the file of --from-mesh, whatever it declares (a scan declares none: metres)"
    )
    up: Literal["declared", AxisName] = Field(
        "declared", description="Axis of --from-mesh that points up, whatever its file declares (GLB: +y; others: +z)"
    )
    part_distance: float = Field(
        0.2,
        gt=0,
        description="Largest distance of a thing's parts from its largest part; farther ones are unlabelled [m]",
    )


def check(parameters: FuseParameters, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError unless the depth range holds something, and for frames beside an annotated scan."""
    if parameters.minimum_depth >= parameters.maximum_depth:
        raise UsageError(
            f"--minimum-depth {parameters.minimum_depth} is not below --maximum-depth {parameters.maximum_depth}",
            hint="lower the one or raise the other",
        )
    frames = [role for role in ("sequence", "segments", "trajectory", "articulations") if role in inputs]
    if "from_mesh" in inputs and frames:
        raise UsageError(f"--from-mesh is a whole scan and takes no --{frames[0]}", hint="leave out one of the two")
    missing = [role for role in ("sequence", "segments") if role not in inputs and "from_mesh" not in inputs]
    if missing:
        raise UsageError(f"fuse: --{missing[0]} is missing", hint="see --help")
    if "from_mesh" not in inputs and (parameters.unit, parameters.up) != ("declared", "declared"):
        raise UsageError("--unit and --up are those of --from-mesh", hint="frames: ingest --gravity given --up AXIS")
    if "labels" in inputs and "from_mesh" not in inputs:
        raise UsageError("--labels names the labels of --from-mesh", hint="give the scan too")


def _estimate(parameters: FuseParameters, inputs: Inputs) -> Estimate:
    if "from_mesh" in inputs:
        scan_megabytes = inputs["from_mesh"].megabytes
        return Estimate(1.5 * scan_megabytes, 0.05 * scan_megabytes, 250 + 20 * scan_megabytes)
    # A room of 30 m2: 1 cm voxels give 134 MB, 2 cm 30 MB, 4 cm 5.6 MB.
    blocks = 1 / parameters.voxel_size**2
    expected = 0.0127 * blocks
    return Estimate(expected, 0.05 * expected, 230 + 0.08 * blocks + 400 * inputs["sequence"].frame_megapixels)


STAGE = Stage(
    name="fuse",
    summary="Integrate posed frames and their segments into one labelled map with a mesh per entity",
    parameters=FuseParameters,
    reads={
        "sequence": Optionally(Sequence),
        "segments": Optionally(Segments),
        "trajectory": Optionally(Trajectory),
        "articulations": Optionally(Articulations),
        "from_mesh": Optionally(
            External("Mesh or points that others annotated, instead of a sequence and its segments (docs/MASKS.md)")
        ),
        "labels": Optionally(External("What the labels of that scan are (TOML as in data/labels, or words)")),
    },
    writes=PanopticMap,
    libraries=("numpy", "numba", "scipy"),
    data_files=lambda parameters: (*LABEL_TABLES, CLASS_COUNTS),
    check=check,
    example="scenewright fuse --sequence outputs/demo/sequence --segments outputs/demo/segments "
    "--out outputs/demo/panoptic_map",
    estimate=_estimate,
)
