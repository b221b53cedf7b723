"""Declaration of `cad`: replace reconstructed objects by CAD models."""

from __future__ import annotations

from typing import Literal

from pydantic import Field
from scenewright.schemas.articulations import Articulations
from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import ContactGraph
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.kit.estimates import grows_with
from scenewright.stages.kit.stage import Optionally, Parameters, Stage


class CadParameters(Parameters):
    """Defaults are the thesis's constants where it states them, its released code's where it does not (PROTOCOLS 3)."""

    method: Literal["ours", "thesis"] = Field(
        "ours",
        description="`thesis`: matching, alignment and check as in section 2.4; `ours`: poses and joints are then "
        "refined on the vertices, and the choice also weighs the size",
    )
    candidates: int = Field(10, ge=1, description="Oriented candidates kept after matching")
    matched: int = Field(
        160, ge=1, description="ours: oriented candidates that are compared with the vertices where matching puts them"
    )
    screening: int = Field(
        2,
        ge=1,
        description="ours: so many times more candidates are aligned, and those with the least alignment error kept",
    )
    size_weight: float = Field(1.0, ge=0.0, description="omega_1 of the matching error (2.7): relative size")
    plane_weight: float = Field(1.0, ge=0.0, description="omega_2 of the matching error (2.7): surface planes")
    upright_weight: float = Field(0.2, ge=0.0, description="omega_3 of the matching error (2.7): not upright")
    unmatched_plane: float = Field(
        1.0,
        ge=0.0,
        description="ours: matching error of a plane that finds no partner (`thesis` rejects models with fewer planes)",
    )
    minimum_scale: float = Field(0.6, gt=0.0, description="Smaller scales of a CAD model are rejected")
    maximum_scale: float = Field(1.6, gt=0.0, description="Larger scales of a CAD model are rejected")
    support_weight: float = Field(8.0, ge=0.0, description="Alignment: weight of supporting planes' offsets")
    offset_weight: float = Field(5.0, ge=0.0, description="Alignment: weight of other planes' offsets")
    angle_weight: float = Field(5.0, ge=0.0, description="Alignment: weight of planes' angles")
    containment_weight: float = Field(0.5, ge=0.0, description="Alignment: weight of the footprint outside the box")
    height_weight: float = Field(2.0, ge=0.0, description="Alignment: weight of the height difference")
    evaluations: int = Field(1000, ge=1, description="Alignment: most evaluations of the residuals")
    vertices: int = Field(1500, ge=10, description="Object vertices drawn for the alignment error")
    misfit_weight: float = Field(
        0.05,
        ge=0.0,
        description="ours: metres of extent that differ from the observed box count this much beside the "
        "alignment error (vertices of a partial mesh fit every model that is large enough)",
    )
    tilt_weight: float = Field(
        0.02,
        ge=0.0,
        description="ours: not standing upright (2.10) counts this much beside the alignment error; "
        "furniture only stands upright",
    )
    free_space_weight: float = Field(
        0.5,
        ge=0.0,
        description="ours: metres by which the model's surface fills space that was seen empty count this much beside "
        "the alignment error",
    )
    scale_weight: float = Field(
        0.03,
        ge=0.0,
        description="ours: |ln(scale)| counts this much beside the alignment error, as the library's "
        "models have the size of real things",
    )
    carrying_weight: float = Field(
        0.1,
        ge=0.0,
        description="ours: the height by which children would move counts this much beside the alignment error",
    )
    facing_weight: float = Field(
        0.004,
        ge=0.0,
        description="ours: a front that looks at the wall right behind counts this much beside the alignment error",
    )
    choice_margin: float = Field(
        0.01,
        ge=0.0,
        description="ours: min-conflicts only exchanges candidates whose score is this close to the best: "
        "a wrong model is worse than a collision that a small shift resolves [m]",
    )
    maximum_alignment_error: float = Field(
        0.08, gt=0.0, description="ours: candidates with a larger alignment error are no candidates [m]"
    )
    area_threshold: float = Field(
        0.5, ge=0.0, le=1.0, description="b_th: least share of a child's footprint over the CAD model's surface"
    )
    support_tolerance: float = Field(
        0.12, gt=0.0, description="Largest height difference of a child's old and new supporting surface [m]"
    )
    wall_penetration: float = Field(0.15, ge=0.0, description="Candidates deeper than this in a wall are rejected [m]")
    collision_tolerance: float = Field(
        0.015, ge=0.0, description="Objects that interpenetrate by more than this are in conflict [m]"
    )
    conflict_iterations: int = Field(50, ge=0, description="Most steps of min-conflicts")
    maximum_shift: float = Field(
        0.08, ge=0.0, description="ours: objects that lie in others are moved aside by at most this, 0 for none [m]"
    )
    resting_tolerance: float = Field(
        0.002, ge=0.0, description="ours: penetration that is left in the finished scene where there is any way [m]"
    )
    vouched: tuple[str, ...] = Field(
        (),
        description="ours: things (nodes, as fridge_3) and classes that somebody knows to move as their models do; "
        "joints of others need a ground: seen to move, open, a handle, a seam",
    )
    recognition_error: float = Field(
        0.028,
        ge=0.0,
        description="ours: a thing without a name, or with one that no model fits as well, takes the class of the "
        "model that fits it so well; 0 for never [m]",
    )
    recognition_margin: float = Field(
        0.01, ge=0.0, description="ours: as long as models of all other classes fit it worse by this [m]"
    )
    built_ins: bool = Field(
        True, description="ours: a thing that no model fits becomes a run of boxes made for it, where that explains it"
    )
    stretched: bool = Field(
        True, description="ours: what no model is as large as may become one that is stretched along its own axes"
    )
    surroundings: bool = Field(
        True, description="ours: what the map shows and nothing has a name for becomes a static body of the scene"
    )
    surroundings_clearance: float = Field(
        0.03, ge=0.0, description="Nameless surface this near to something named counts as its rim [m]"
    )
    surroundings_area: float = Field(
        0.02, ge=0.0, description="Connected nameless patches with less surface are noise [m²]"
    )


STAGE = Stage(
    name="cad",
    summary="Replace objects by CAD models that fit, stand on their supports and do not collide",
    parameters=CadParameters,
    reads={
        "contact_graph": ContactGraph,
        "panoptic_map": PanopticMap,
        "library": CadLibrary,
        "articulations": Optionally(Articulations),
    },
    writes=CadScene,
    libraries=("numpy", "scipy", "trimesh", "open3d", "python-fcl"),
    example="scenewright cad --contact-graph outputs/demo/contact_graph --panoptic-map outputs/demo/panoptic_map "
    "--library outputs/demo/cad_library --out outputs/demo/cad_scene",
    estimate=grows_with("panoptic_map", 0.6, 0.28, 490, 0.0),
)
