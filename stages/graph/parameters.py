"""Declaration of `graph`: contact graph from a panoptic map."""

from __future__ import annotations

from typing import Literal

from pydantic import Field
from scenewright.schemas.contact_graph import ContactGraph
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.kit.estimates import grows_with
from scenewright.stages.kit.stage import Parameters, Stage


class GraphParameters(Parameters):
    """Defaults are the thesis's constants where it states them (PROTOCOLS section 3), and said to be ours elsewhere."""

    method: Literal["ours", "thesis"] = Field(
        "ours",
        description="`thesis`: equations 2.1 to 2.3 and nothing else; `ours`: with the corrections of stages/graph",
    )
    horizontal_threshold: float = Field(
        -0.9, ge=-1.0, le=0.0, description="a_th: a plane supports when its normal times gravity is at most this"
    )
    area_threshold: float = Field(
        0.5, ge=0.0, le=1.0, description="b_th: least share of the child's footprint over the supporting plane"
    )
    minimum_score: float = Field(0.2, ge=0.0, le=1.0, description="Least score (2.3) of a supporting relation")
    point_spacing: float = Field(
        0.01, ge=0.001, description="Grid on which meshes are downsampled for plane detection [m]"
    )
    plane_distance: float = Field(
        0.03, gt=0.0, description="RANSAC inlier distance, at most a quarter of the box's smallest edge [m]"
    )
    plane_iterations: int = Field(200, ge=1, description="RANSAC hypotheses per plane")
    normal_weight: float = Field(0.1, ge=0.0, le=1.0, description="Weight of normals in the RANSAC inlier rule")
    plane_share: float = Field(0.1, gt=0.0, le=1.0, description="Smallest plane, as a share of an entity's points")
    minimum_support_area: float = Field(0.004, gt=0.0, description="ours: smallest horizontal supporting plane [m^2]")
    stray_share: float = Field(
        0.05, ge=0.0, lt=1.0, description="Smallest cluster in an entity's box, as a share of its points"
    )
    box_trim: float = Field(0.01, ge=0.0, lt=0.25, description="ours: quantile trimmed at both ends of a box's axes")
    side_share: float = Field(
        0.5,
        gt=0.0,
        le=1.0,
        description="ours: least share of side normals that agree, modulo 90 degrees, on a box's yaw",
    )
    round_classes: tuple[str, ...] = Field(
        ("bottle", "bowl", "cup", "vase", "lamp", "bin", "plant"),
        description="ours: classes that side normals may show to be round",
    )
    stray_distance: float = Field(0.1, gt=0.0, description="Gap that separates clusters [m]")
    maximum_sinking: float = Field(
        0.05, ge=0.0, description="ours: largest height of a supporting plane over the child's bottom [m]"
    )
    tie_margin: float = Field(
        0.1, ge=0.0, le=1.0, description="ours: score difference within which the highest plane wins"
    )
    maximum_extension: float = Field(
        1.0, ge=0.0, description="Largest extension of a box down to its supporting plane [m]"
    )
    wall_distance: float = Field(
        0.12, ge=0.0, description="Largest distance of an unsupported object's mesh from the wall that it hangs on [m]"
    )
    wall_classes: tuple[str, ...] = Field(
        ("wall_cabinet", "wall_shelf", "clock", "picture", "monitor", "shelf", "lamp", "pendant_lamp"),
        description="ours: classes that rather hang on a near wall than float above a plane",
    )
    floating_gap: float = Field(0.15, ge=0.0, description="ours: gap above which `wall_classes` count as floating [m]")
    movable_gap: float = Field(
        0.3, ge=0.0, description="ours: largest gap between a movable thing and the plane that it stands on [m]"
    )
    minimum_points: int = Field(30, ge=1, description="Fewest points of an entity on the grid (small-entity filter)")
    minimum_diagonal: float = Field(0.03, ge=0.0, description="Smallest box diagonal of an entity [m]")
    dropped_classes: tuple[str, ...] = Field(("person",), description="Classes that are no part of a static scene")
    minimum_floor_area: float = Field(
        0.5, gt=0.0, description="Unlabelled surface at z = 0 from which a missing floor is assumed [m^2]"
    )


STAGE = Stage(
    name="graph",
    summary="Build the contact graph (who supports, contains, carries whom) from a panoptic map",
    parameters=GraphParameters,
    reads={"panoptic_map": PanopticMap},
    writes=ContactGraph,
    libraries=("numpy", "scipy", "trimesh"),
    example="scenewright graph --panoptic-map outputs/demo/panoptic_map --out outputs/demo/contact_graph",
    estimate=grows_with("panoptic_map", 0.1, 0.0, 280, 3.0),
)
