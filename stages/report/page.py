"""The page while it is made, and its rendering: everything that comes from logs and artifacts is escaped."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import jinja2
from markupsafe import Markup
from scenewright.schemas.artifact import Artifact
from scenewright.schemas.evaluation import Evaluation
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.segments import Segments
from scenewright.stages.kit.explaining.sources import Source, sources_of
from scenewright.stages.report.parameters import ReportParameters
from scenewright.stages.report.provenance import Made, made_of
from scenewright.stages.report.room import RoomViews

FOLDER = Path(__file__).resolve().parent
Kind = TypeVar("Kind", bound=Artifact)


@dataclass
class Page:
    """What sections are made of."""

    artifacts: dict[str, Artifact]
    """Role -> what was given."""
    parameters: ReportParameters
    output: Path
    """Folder that links on the page are relative to."""

    def given(self, role: str, kind: type[Kind]) -> Kind | None:
        """Return the input of a role as its kind; None when it was not given, or is of another kind."""
        artifact = self.artifacts.get(role)
        return artifact if isinstance(artifact, kind) else None

    @property
    def label(self) -> str:
        """What the segmentation masks are; it stands beside everything that comes from them."""
        evaluation, segments = self.given("evaluation", Evaluation), self.given("segments", Segments)
        panoptic_map = self.given("panoptic_map", PanopticMap)
        if evaluation is not None and evaluation.info.label:
            return evaluation.info.label
        if segments is not None:
            return segments.info.label
        return panoptic_map.info.segmentation if panoptic_map is not None else ""

    @property
    def baseline_label(self) -> str:
        """The label of the evaluation that figures are compared with."""
        baseline = self.given("baseline_evaluation", Evaluation)
        return baseline.info.label if baseline is not None else ""

    @cached_property
    def made(self) -> tuple[Made, ...]:
        """How every artifact was made."""
        return tuple(made_of(self.artifacts, self.output))

    @cached_property
    def sources(self) -> list[Source]:
        """What the artifacts record of why things are as they are. Raises BadInput for a payload that is damaged."""
        return sources_of(self.artifacts.values())

    @cached_property
    def room(self) -> RoomViews:
        """The views of the whole room that the pictures of map and CAD scene share."""
        return RoomViews(self.given("panoptic_map", PanopticMap), self.parameters.view_width)


def render(template: str, values: Mapping[str, Any], folder: Path = FOLDER) -> Markup:
    """Fill a template of a folder, which may import those of this step. All values are escaped; a missing one raises
    jinja2.UndefinedError."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader([folder, FOLDER]),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=False,
    )
    return Markup(environment.get_template(template).render(**values))


def render_page(values: Mapping[str, Any]) -> str:
    """Return the whole page; `sections` have `id`, `name` and `html`. The style sheet is ours: not escaped."""
    style = Markup((FOLDER / "style.css").read_text(encoding="utf-8"))
    return str(render("template.html.j2", {**values, "style": style}))
