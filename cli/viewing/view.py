"""Open any artifact in Rerun, or write it as a file: which viewer draws which kind."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import scenewright.cli.viewing
from scenewright.cli.explaining.explaining import sentences
from scenewright.cli.viewing.rerun_canvas import RerunCanvas, import_rerun
from scenewright.schemas.artifact import Artifact
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.plugins import taken
from scenewright.stages.engine.reading import open_artifact
from scenewright.stages.kit.viewing.canvas import Canvas
from scenewright.stages.kit.viewing.page.page_canvas import PageCanvas

PAGE, RECORDING = ".html", ".rrd"


def viewer_of(kind: type[Artifact]) -> Callable[[Any, Canvas], None] | None:
    """Return the function `draw_<kind>` out of a file `*_view.py` of this folder, or of a module that an installed
    package names in the entry points of `scenewright.viewers`; None when there is none.

    It takes the handle and the canvas. A kind without one is drawn as the kind that it can be read as.
    """
    files = [
        entry.name for entry in pkgutil.iter_modules(scenewright.cli.viewing.__path__) if entry.name.endswith("_view")
    ]
    modules = [importlib.import_module(f"scenewright.cli.viewing.{name}") for name in files]
    modules += [module for _, module in taken("scenewright.viewers", lambda module: module)]
    for name in [base.kind for base in kind.__mro__ if issubclass(base, Artifact)]:
        for module in modules:
            draw = getattr(module, f"draw_{name}", None)
            if draw is not None:
                return draw
    return None


def view_artifact(path: Path, save: Path | None = None) -> None:
    """Show an artifact in a Rerun window, or write it to `save`: an .rrd file for Rerun, or an .html page that any
    browser shows.

    Raises BadInput (no artifact, or nothing to draw), UsageError (`save` is neither), MissingDependency.
    """
    if save is not None and save.suffix not in (PAGE, RECORDING):
        raise UsageError(f"{save}: the file to write must end in {PAGE} or {RECORDING}")
    as_page = save is not None and save.suffix == PAGE
    if not as_page:
        import_rerun()
    artifact = open_artifact(path)
    draw = viewer_of(type(artifact))
    if draw is None:
        raise BadInput(f"{path}: a {artifact.kind!r} artifact has no view", hint="open its files in Foxglove or Rerun")
    name = f"{artifact.kind} {Path(path).resolve().name}"
    if as_page:
        assert save is not None
        with PageCanvas(name, save) as page:
            draw(artifact, page)
            page.explain(sentences(artifact))
    else:
        with RerunCanvas(name, save) as recording:
            draw(artifact, recording)
