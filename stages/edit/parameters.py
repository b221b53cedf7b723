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
        0.5,
        ge=0.1,
        le=1,
        description="A thing fits an edit when the boxes, grown by --margin, share this much of their union",
    )
    minimum_part: float = Field(
        0.25, ge=0.05, le=1, description="... or this much, and it lies in the edit's box as the only one of its class"
    )
    margin: float = Field(
        0.03, ge=0, le=1, description="Boxes are compared grown by this on every side [m]: flat things have no volume"
    )
    reach: float = Field(
        0.06, gt=0, le=1, description="... and when its surface comes this near to the edit's point [m]"
    )
    minimum_share: float = Field(
        0.5,
        gt=0,
        le=1,
        description="Where the edit says points of the surface: the thing has this share of those that are of any, "
        "and --minimum-part of all",
    )
    minimum_inside: float = Field(
        0.5, gt=0, le=1, description="... and this share of the thing lies in the edit's box, grown by --margin"
    )
    rival_share: float = Field(
        0.5, gt=0, le=1, description="... and no other thing has more than this share of what it has"
    )
    clear_share: float = Field(
        0.7, gt=0, le=1, description="A second thing that fits by this share of the best fit makes the edit a conflict"
    )


class EditMasksParameters(Parameters):
    """How masks are drawn from a map."""

    reach: float = Field(
        0.04, gt=0, le=1, description="A pixel is of the thing whose surface is nearest to its point, within this [m]"
    )
    pose_tolerance: float = Field(
        0.02, ge=0, description="A pose of --trajectory belongs to the frame at most this far from its time [s]"
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
