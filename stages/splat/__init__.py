"""`scenewright splat`: a room as 3-D Gaussians, learned while its pictures arrive (docs/SPLATS.md)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.splat.asked_figures import calibration_error, recall_at_rejection
    from scenewright.stages.splat.evaluate_stage import MARGIN
    from scenewright.stages.splat.language.field import HashGrid, LanguageField
    from scenewright.stages.splat.language.looks import Sight
    from scenewright.stages.splat.ply import read_gaussians
    from scenewright.stages.splat.seeding import Seeds
    from scenewright.stages.splat.strays import no_strays
    from scenewright.stages.splat.trainer import Trainer
    from scenewright.stages.splat.training.words.lexicon import lexicon
    from scenewright.stages.splat.triangulation import with_points
    from scenewright.stages.splat.views import PosedView, evenly, held_out, posed_frames, read_view

__getattr__ = exported(__name__)
