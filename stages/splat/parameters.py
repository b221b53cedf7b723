"""Declarations of the steps of `splat`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field
from scenewright.schemas.contact_graph import ContactGraph
from scenewright.schemas.evaluation import Evaluation
from scenewright.schemas.language_map import Answers, LanguageMap
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.splat import Splat, SplatViews
from scenewright.schemas.trajectory import Trajectory
from scenewright.stages.kit.open_words.encoder import checked_text
from scenewright.stages.kit.open_words.options import EXTRAS, READING_FILES, WEIGHTS, EncoderParameters, encoder_files
from scenewright.stages.kit.stage import External, Optionally, Parameters, Stage

QUERIES = External("queries.toml: texts that are true of something there, with its boxes, and texts that are not")
LIBRARIES = ("numpy", "numba", "scipy", "opencv-python-headless", "pillow")


class BuildParameters(Parameters):
    """Options of `splat build`. Rates of learning and of density belong to the method: stages/splat/methods."""

    method: Literal["ours", "thesis"] = Field("ours", description="Who sets, moves and removes Gaussians")
    width: int = Field(320, ge=16, le=4096, description="Images are learned at most so wide [px]")
    most_views: int = Field(200, ge=0, le=100_000, description="At most so many images, evenly spread; 0: all")
    hold_out_every: int = Field(0, ge=0, le=1000, description="Every so many-th image is kept from learning; 0: none")
    steps_per_second: float = Field(
        20.0, ge=0.0, le=10_000.0, description="Steps of training in a second of the log: images arrive by their stamps"
    )
    steps: int = Field(1000, ge=0, le=1_000_000, description="Steps after the last image has arrived")
    most_gaussians: int = Field(
        500_000, ge=1, le=10_000_000, description="New images bring no further Gaussians once there are so many"
    )
    refine_poses: bool = Field(False, description="Learn the poses too, but for the first")
    adjust_every: int = Field(
        0,
        ge=0,
        le=100_000,
        description="Poses of all images so far are adjusted to each other, by depth and colour, when so many more "
        "have arrived, and after the last; 0: never",
    )


class RenderParameters(Parameters):
    """Options of `splat render`."""

    views: Literal["held_out", "learned", "all"] = Field("held_out", description="Which images are compared")
    pictures: int = Field(12, ge=0, le=10_000, description="At most so many are written, evenly spread")
    turntable: int = Field(36, ge=0, le=360, description="Pictures of a turn about the whole, from above; 0: none")


class LanguageParameters(EncoderParameters):
    """Options of `splat language`."""

    steps: int = Field(400, ge=0, le=1_000_000, description="Steps of training the field")
    most_views: int = Field(60, ge=0, le=100_000, description="At most so many images are read, evenly spread; 0: all")


class LabelParameters(EncoderParameters):
    """Options of `splat label`."""

    most_views: int = Field(120, ge=0, le=100_000, description="At most so many images are read, evenly spread; 0: all")


class QueryParameters(EncoderParameters):
    """Options of `splat query`."""

    text: str = Field("", description='What is looked for: "red mug"; with --contact-graph also "cup on the desk"')
    least_probability: float = Field(
        0.5, ge=0, le=1, description="Answers are at least so likely; else: the room has none"
    )
    most: int = Field(10, ge=1, le=20, description="At most so many answers")


class EvaluateParameters(EncoderParameters):
    """Options of `splat evaluate`."""

    least_probability: float = Field(0.5, ge=0, le=1, description="Answers are at least so likely")


def check_query(parameters: QueryParameters, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError for a text that asks for nothing, or is no query."""
    checked_text(parameters.text)


def word_files(parameters: EncoderParameters) -> tuple[str, ...]:
    """Return the files of data/ that pictures and words are held against each other with."""
    return (*encoder_files(parameters), *READING_FILES, "words/calibration.toml")


BUILD = Stage(
    name="splat build",
    summary="Learn a room as 3-D Gaussians from posed images that arrive one after another",
    parameters=BuildParameters,
    reads={"sequence": Sequence, "trajectory": Optionally(Trajectory)},
    writes=Splat,
    libraries=(*LIBRARIES, "pycolmap"),
    module="build_stage",
    example="scenewright splat build --sequence outputs/demo/sequence --hold-out-every 8 --out outputs/demo/splat",
)
RENDER = Stage(
    name="splat render",
    summary="Show what a splat shows where the camera stood, beside what the camera saw, and from all sides",
    parameters=RenderParameters,
    reads={"splat": Splat, "sequence": Sequence},
    writes=SplatViews,
    libraries=LIBRARIES,
    module="render_stage",
    example="scenewright splat render --splat outputs/demo/splat --sequence outputs/demo/sequence --out outputs/views",
)
LANGUAGE = Stage(
    name="splat language",
    summary="Keep in a splat what its images say, so that words find places",
    parameters=LanguageParameters,
    reads={"splat": Splat, "sequence": Sequence, "panoptic_map": Optionally(PanopticMap), "weights": WEIGHTS},
    writes=LanguageMap,
    libraries=(*LIBRARIES, "trimesh", "torch"),
    module="language_stage",
    extras=EXTRAS,
    data_files=word_files,
    example="scenewright splat language --splat outputs/demo/splat --sequence outputs/demo/sequence "
    "--out outputs/words",
)
LABEL = Stage(
    name="splat label",
    summary="Keep what images show of every entity of a panoptic map, so that words find it",
    parameters=LabelParameters,
    reads={"panoptic_map": PanopticMap, "sequence": Sequence, "trajectory": Optionally(Trajectory), "weights": WEIGHTS},
    writes=LanguageMap,
    libraries=("numpy", "opencv-python-headless", "trimesh", "torch"),
    module="label_stage",
    extras=EXTRAS,
    data_files=word_files,
    example="scenewright splat label --panoptic-map outputs/demo/panoptic_map --sequence outputs/demo/sequence "
    "--out outputs/labels",
)
QUERY = Stage(
    name="splat query",
    summary="Find what words ask for, with probabilities, or say that the room has none",
    parameters=QueryParameters,
    reads={"language": LanguageMap, "contact_graph": Optionally(ContactGraph), "weights": WEIGHTS},
    writes=Answers,
    libraries=("numpy", "torch"),
    module="query_stage",
    extras=EXTRAS,
    data_files=word_files,
    check=check_query,
    example='scenewright splat query --language outputs/words --text "red mug" --out outputs/answer',
)
EVALUATE = Stage(
    name="splat evaluate",
    summary="Ask a place for what somebody knows is there, and is not, and count what is found and rejected",
    parameters=EvaluateParameters,
    reads={"language": LanguageMap, "queries": QUERIES, "weights": WEIGHTS},
    writes=Evaluation,
    libraries=("numpy", "torch", "matplotlib"),
    module="evaluate_stage",
    extras=EXTRAS,
    data_files=word_files,
    example="scenewright splat evaluate --language outputs/words --queries queries.toml --out outputs/asked",
)
STAGES = (BUILD, RENDER, LANGUAGE, LABEL, QUERY, EVALUATE)
