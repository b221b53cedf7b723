"""Declarations of `scenewright edit map`, `edit graph`, `edit scene` and `edit masks`."""

from __future__ import annotations

from pydantic import Field
from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import ContactGraph
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.segments import Segments
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.trajectory import Trajectory
from scenewright.stages.kit.stage import External, Optionally, Parameters, Stage


class EditMapParameters(Parameters):
    """When a thing is the one that an edit means."""

    minimum_overlap: float = Field(
        0.5, ge=0.1, le=1, description="Least IoU of a thing's box and the edit's, both grown by --margin"
    )
    minimum_part: float = Field(
        0.25, ge=0.05, le=1, description="Least such IoU of a thing that is the only one of its class in the edit's box"
    )
    margin: float = Field(
        0.03,
        ge=0,
        le=1,
        description="Margin added to boxes on every side before they are compared [m]: flat things have no volume",
    )
    reach: float = Field(
        0.06, gt=0, le=1, description="Largest distance of a thing's surface from the edit's point [m]"
    )
    minimum_share: float = Field(
        0.5,
        gt=0,
        le=1,
        description="Of an edit with surface points: least share of the labelled ones that lie on the thing",
    )
    minimum_inside: float = Field(
        0.5, gt=0, le=1, description="Least share of the thing in the edit's box, grown by --margin"
    )
    rival_share: float = Field(0.5, gt=0, le=1, description="Largest share of its points that another thing may have")
    clear_share: float = Field(
        0.7, gt=0, le=1, description="Share of the best fit from which a second thing makes the edit a conflict"
    )


class EditMasksParameters(Parameters):
    """How masks are drawn from a map."""

    reach: float = Field(
        0.04, gt=0, le=1, description="Largest distance of a pixel's point from the surface that labels it [m]"
    )
    pose_tolerance: float = Field(
        0.02, ge=0, description="Largest time difference between a pose of --trajectory and its frame [s]"
    )


MAP = Stage(
    name="edit map",
    summary="Apply edits (edits.toml) to a panoptic map; what no longer fits is a conflict, and not applied",
    parameters=EditMapParameters,
    reads={"panoptic_map": PanopticMap, "edits": External("edits.toml, as `edit rename` and the like write it")},
    writes=PanopticMap,
    libraries=("numpy", "scipy", "trimesh"),
    module="map_stage",
    example="scenewright edit map --panoptic-map outputs/demo/panoptic_map --edits edits.toml "
    "--out outputs/demo/edited_map",
)

GRAPH = Stage(
    name="edit graph",
    summary="Apply edits (edits.toml) to a contact graph: supports that a person pins, things that are fixed or free",
    parameters=EditMapParameters,
    reads={"contact_graph": ContactGraph, "edits": External("edits.toml, as `edit support` and the like write it")},
    writes=ContactGraph,
    libraries=("numpy", "scipy"),
    module="graph_stage",
    example="scenewright edit graph --contact-graph outputs/demo/contact_graph --edits edits.toml "
    "--out outputs/demo/edited_graph",
)

SCENE = Stage(
    name="edit scene",
    summary="Apply edits (edits.toml) to a CAD scene: another model or none, another place, joints",
    parameters=EditMapParameters,
    reads={
        "cad_scene": CadScene,
        "edits": External("edits.toml, as `edit model` and the like write it"),
        "library": Optionally(CadLibrary),
        "panoptic_map": Optionally(PanopticMap),
    },
    writes=CadScene,
    libraries=("numpy", "scipy", "trimesh"),
    module="scene_stage",
    example="scenewright edit scene --cad-scene outputs/demo/cad_scene --edits edits.toml "
    "--out outputs/demo/edited_scene",
)

MASKS = Stage(
    name="edit masks",
    summary="Draw masks for every frame from a map that was put right, to train with (`export --layout coco`)",
    parameters=EditMasksParameters,
    reads={"sequence": Sequence, "panoptic_map": PanopticMap, "trajectory": Optionally(Trajectory)},
    writes=Segments,
    libraries=("numpy", "scipy", "open3d"),
    module="masks_stage",
    example="scenewright edit masks --sequence outputs/demo/sequence --panoptic-map outputs/demo/edited_map "
    "--out outputs/demo/masks",
)

STAGES = (MAP, GRAPH, SCENE, MASKS)
