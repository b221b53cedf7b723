"""Ours: candidates are screened, refined and compared on the vertices, and the scene is arranged so that it rests."""

from __future__ import annotations

import math
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scenewright.schemas.cad_scene import Way
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.cad.alignment import align, unaligned
from scenewright.stages.cad.apart import Apart
from scenewright.stages.cad.arranging import Placer, Standing
from scenewright.stages.cad.fitting import QUICK_ITERATIONS, fitted, refine, shapes_of_model
from scenewright.stages.cad.free_space import FreeSpace, load_free_space
from scenewright.stages.cad.matching import Match, rank_matches
from scenewright.stages.cad.method import Proposals, alignment_weights, matching_weights
from scenewright.stages.cad.model_surfaces import ModelSurface, alignment_error, robust_error, robust_errors
from scenewright.stages.cad.parameters import CadParameters
from scenewright.stages.cad.placing import placement_of, size_misfit
from scenewright.stages.cad.scoring import score_of, would_tip
from scenewright.stages.cad.shapes import Observed, Placement, Shape, shape_of_state, turned_frames
from scenewright.stages.cad.target import Target, out_of_walls, scale_fits
from scenewright.stages.cad.variety import varied

TURNS = 3
"""Standing movable things are tried at so many yaws within a quarter turn."""
SCREENING_POINTS = 120
"""Vertices that matches are screened with."""
SCREENING_STEP = 5
"""Every so many vertices count when aligned candidates are screened."""
QUICK_POINTS = 250
"""Vertices that the quick refinement looks at."""
TRUNCATION = 0.05
"""Distances are cut off here when candidates are compared [m]."""
FULL_FITS = 4
"""Candidates that are refined thoroughly."""

Aligned = tuple[Match, Placement]


def _model(match: Match) -> str:
    return match.shape.model.id


LEAST_EXPLAINED = 0.5
"""A model that explains less than half of what was seen of its thing, where it stands, gives the mesh back; by eye."""


@dataclass(frozen=True)
class Ours:
    """The corrected method (`CadMethod`)."""

    parameters: CadParameters

    @property
    def corrects(self) -> bool:
        """All of it."""
        return True

    @property
    def ways(self) -> tuple[Way, ...]:
        """As the options say."""
        asked: dict[Way, bool] = {
            "library": True,
            "stretched": self.parameters.stretched,
            "by_shape": self.parameters.recognition_error > 0,
            "family": self.parameters.families,
            "built_in": self.parameters.built_ins,
        }
        return tuple(way for way, is_asked in asked.items() if is_asked)

    @property
    def least_explained(self) -> float:
        """Half of it."""
        return LEAST_EXPLAINED

    def free_space(self, panoptic_map: PanopticMap) -> FreeSpace:
        """What the cameras saw empty, a model must not fill."""
        return load_free_space(panoptic_map)

    def propose(self, target: Target) -> Proposals:
        """Match open and closed shapes, screen, align, refine on the vertices and score."""
        closed = [shape_of_state(model, model.states[0]) for model in target.models]
        shapes = [shape for state in closed for shape in shapes_of_model(target.surfaces[state.model.id], state)]
        matches, counts = self._matches(target, shapes)
        screened = self._screen(target, matches)
        rejected = Counter({**counts, "screening rank": len(matches) - len(screened)})
        aligned = self._refine(target, self._align(target, screened, rejected))
        return Proposals([self._measure(target, match, placement) for match, placement in aligned], rejected)

    def misfit(self, target: Target) -> float:
        """By the score that matches are screened with."""
        shapes = [shape_of_state(model, model.states[0]) for model in target.models]
        matches, _ = self._matches(target, shapes)
        return min(self._screening_scores(target, matches), default=math.inf)

    def why_invalid(self, placement: Placement, target: Target) -> str | None:
        """Scale, error and balance."""
        if not scale_fits(placement, self.parameters):
            return "refined scale out of range"
        if placement.alignment_error > self.parameters.maximum_alignment_error:
            return "alignment error too large"
        tips = not target.around.hangs and would_tip(placement, target.surfaces[placement.shape.model.id])
        return "does not stay as it lies" if tips else None

    def missing_allowed(self, missing: Sequence[int]) -> int:
        """One child that was badly seen must not cost a shelf its model: the best that exists will do, and the child
        goes on the nearest surface. The thesis discards all."""
        return min(missing, default=0)

    def eligible(self, scores: Sequence[float]) -> int:
        """Those that are hardly worse than the best: a wrong model is worse than a collision that a shift resolves."""
        return sum(score <= scores[0] + self.parameters.choice_margin for score in scores)

    def placer(self, alternatives: Mapping[str, Sequence[Placement]], surfaces: Mapping[str, ModelSurface]) -> Placer:
        """Every model stands on its support and, where shifts are allowed, in nothing else."""
        if self.parameters.maximum_shift <= 0:
            return Standing(surfaces)
        return Apart(surfaces, alternatives, self.parameters.resting_tolerance, self.parameters.maximum_shift)

    @property
    def _scale_range(self) -> tuple[float, float]:
        return self.parameters.minimum_scale, self.parameters.maximum_scale

    def _matches(self, target: Target, shapes: list[Shape]) -> tuple[list[Match], dict[str, int]]:
        """Return the best matches by planes and size, standing and lying ones apart, and what was left out.

        Furniture only stands. Of movable things the standing ones are also tried between the quarter turns, and lying
        ones have a share of their own, as either may have the planes that noise likes.
        """
        parameters = self.parameters

        def rank(frames: list[Observed], upright: bool) -> tuple[list[Match], dict[str, int]]:
            matches, counts = rank_matches(
                frames,
                shapes,
                weights=matching_weights(parameters),
                unmatched=parameters.unmatched_plane,
                scale_range=(0.0, math.inf),
                keep=sys.maxsize,
                upright_only=upright,
            )
            best_matches = varied(matches, parameters.matched, _model)
            return best_matches, {**counts, "matching rank": len(matches) - len(best_matches)}

        frames = target.frames(all_frames=True)
        if not target.movable:
            return rank(frames, True)
        turned = turned_frames(frames[0], target.node, target.points, TURNS)
        standing, counts = rank([*frames, *turned], True)
        lying, others = rank(frames, False)
        lying = [match for match in lying if match.tilt > 0][: parameters.matched // 3]
        return [*standing, *lying], dict(Counter(counts) + Counter(others))

    def _screen(self, target: Target, matches: list[Match]) -> list[Match]:
        """Return the matches that come closest to the vertices where the matching puts them, best first.

        Planes rank badly where they are few or misleading, the failure that the thesis names (section 2.6.6): a cup's
        side gives as many as noise likes, and lying models with as many planes outrank the upright one.
        """
        order = np.argsort(self._screening_scores(target, matches), kind="stable")
        ranked = [matches[k] for k in order]
        return varied(ranked, self.parameters.candidates * self.parameters.screening, _model)

    def _screening_scores(self, target: Target, matches: list[Match]) -> list[float]:
        parameters = self.parameters
        some = target.points[:: max(1, len(target.points) // SCREENING_POINTS)]
        placements = [placement_of(match, unaligned(match, self._scale_range)) for match in matches]
        errors = robust_errors(target.surfaces, placements, some, TRUNCATION)
        return [
            error
            + parameters.misfit_weight * size_misfit(match.frame.size, placement)
            + parameters.tilt_weight * match.tilt
            + parameters.scale_weight * abs(math.log(placement.scale))
            for match, placement, error in zip(matches, placements, errors, strict=True)
        ]

    def _align(self, target: Target, matches: list[Match], rejected: Counter[str]) -> list[Aligned]:
        """Return the matches aligned by planes, the best by their error on vertices: planes alone rank badly where few
        were seen; vertices are the better judge of what deserves refinement, and of whether planes did any good: a
        model with one plane to the observed two is shrunk until it has them."""
        parameters = self.parameters
        weights = alignment_weights(parameters)
        points, normals = target.points[::SCREENING_STEP], target.normals[::SCREENING_STEP]
        aligned: list[Aligned] = []
        for match in matches:
            surface = target.surfaces[match.shape.model.id]
            starts = (
                align(match, weights, parameters.evaluations, self._scale_range),
                unaligned(match, self._scale_range),
            )
            placements = [
                placement for start in starts if scale_fits(placement := placement_of(match, start), parameters)
            ]
            if not placements:
                rejected["aligned scale out of range"] += 1
                continue
            measured = [replace(p, alignment_error=alignment_error(surface, p, points, normals)) for p in placements]
            aligned.append((match, min(measured, key=lambda placement: placement.alignment_error)))
        aligned.sort(key=lambda entry: entry[1].alignment_error + parameters.tilt_weight * entry[0].tilt)
        rejected["alignment rank"] = max(0, len(aligned) - parameters.candidates)
        return varied(aligned, parameters.candidates, lambda entry: _model(entry[0]))

    def _refine(self, target: Target, aligned: list[Aligned]) -> list[Aligned]:
        """Refine all candidates quickly on the vertices, then the best `FULL_FITS` thoroughly, with joints."""
        points, normals, hangs = target.points, target.normals, target.around.hangs
        some = slice(None, None, max(1, len(points) // QUICK_POINTS))
        quick = [
            (
                match,
                refine(
                    target.surfaces[placement.shape.model.id],
                    placement,
                    points[some],
                    normals[some],
                    free_height=hangs,
                    move_joints=False,
                    iterations=QUICK_ITERATIONS,
                ),
            )
            for match, placement in aligned
        ]
        quick.sort(key=lambda entry: self._score(target, entry[0], entry[1], entry[1].alignment_error))
        return [
            (
                match,
                fitted(target.surfaces[placement.shape.model.id], placement, points, normals, free_height=hangs)
                if k < FULL_FITS
                else placement,
            )
            for k, (match, placement) in enumerate(quick)
        ]

    def _score(self, target: Target, match: Match, placement: Placement, error: float) -> float:
        surface = target.surfaces[placement.shape.model.id]
        return score_of(match, placement, error, surface, target.around, self.parameters)

    def _measure(self, target: Target, match: Match, placement: Placement) -> Placement:
        """Return the placement, out of walls, with the alignment error over all vertices and the score that the choice
        minimises.

        A bowl stands in for a plate where the library has no plate like it: what fits hardly worse, and has the name,
        comes first.
        """
        surface, placement = target.surfaces[placement.shape.model.id], out_of_walls(placement, target)
        error = alignment_error(surface, placement, target.points)
        oriented = robust_error(surface, placement, target.points, target.normals, TRUNCATION)
        name, model_class = target.node.class_name, placement.shape.model.class_name
        stands_in = name != model_class and any(model.class_name == name for model in target.models)
        score = self._score(target, match, placement, oriented) + self.parameters.choice_margin * stands_in
        return replace(placement, alignment_error=error, score=score)
