"""Step `cad`: models of a library take the places of what a map found."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.cad.built_ins import may_be_built_in
    from scenewright.stages.cad.candidates import Shortlist
    from scenewright.stages.cad.made_models import is_built_in
    from scenewright.stages.cad.model_surfaces import ModelSurface
    from scenewright.stages.cad.parameters import CadParameters
    from scenewright.stages.cad.stage import choose_and_write, find_candidates

__getattr__ = exported(__name__)
