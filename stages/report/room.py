"""Views of the whole room, drawn with names, that the sections about map and CAD scene share."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.kit.rendering.ray_casting import Rendering
from scenewright.stages.report.images import Picture, jpeg
from scenewright.stages.report.surfaces import Model, map_model
from scenewright.stages.report.views import Label, View, oblique_view, place_labels, render


@dataclass(frozen=True)
class DrawnView:
    """A rendered picture with names on it."""

    picture: Picture
    labels: tuple[Label, ...]
    width: int
    height: int
    caption: str
    font_size: float = 13.0
    """Of the labels [px of the picture]."""
    of_masks: bool = True
    """Whether the segmentation masks have to do with it: then their label stands beside it."""


def draw(model: Model, view: View, caption: str, font_size: float | None = None) -> DrawnView:
    """Draw a model; with names on it where a font size is given (larger for pictures that are shown small)."""
    drawn: Rendering = render(model, view)
    labels = tuple(place_labels(drawn.instance, model.names, font_size)) if font_size else ()
    camera = view.camera
    picture = jpeg(drawn.color, caption, camera.width)
    return DrawnView(picture, labels, camera.width, camera.height, caption + ".", font_size or 0.0)


class RoomViews:
    """The map as it is drawn, and from where; what follows is seen from the same place."""

    def __init__(self, panoptic_map: PanopticMap | None, width: int) -> None:
        self.width, self.height = width, round(0.62 * width)
        self._map = panoptic_map

    def font_size(self, size: float) -> float:
        """Return a size of labels [px] that was chosen for pictures 960 px wide."""
        return size * self.width / 960

    @cached_property
    def scanned(self) -> Model | None:
        """The surface of the map; None without a map, or of an empty one."""
        return map_model(self._map) if self._map is not None else None

    @cached_property
    def coloured(self) -> Model | None:
        """The same, every instance in its colour."""
        return self.scanned.by_instance() if self.scanned is not None else None

    @cached_property
    def oblique(self) -> View | None:
        """From where the room is seen; None without a map."""
        return oblique_view(self.coloured, self.width, self.height) if self.coloured is not None else None

    @cached_property
    def in_image_colours(self) -> DrawnView | None:
        """The map in the colours of the images."""
        if self.scanned is None or self.oblique is None:
            return None
        return draw(self.scanned, self.oblique, "In the colours of the images")

    def whole(self, model: Model) -> View:
        """Return from where to see a model of the whole room: the place of the map, where there is one."""
        return self.oblique or oblique_view(model, self.width, self.height)
