"""The candidates of one object: matched, aligned, measured, checked against what it carries and where walls are."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace

import numpy as np

from schemas.cad_library import CadModel
from schemas.contact_graph import ContactGraphFile, GraphNode
from schemas.vocabulary import load_vocabulary
from stages.cad.alignment import AlignmentWeights, align, unaligned
from stages.cad.fitting import QUICK_ITERATIONS, fitted, refine, shapes_of_model
from stages.cad.matching import Match, rank_matches
from stages.cad.model_surfaces import ModelSurface, alignment_error, robust_error
from stages.cad.parameters import CadParameters
from stages.cad.placing import (
    placement_of,
    size_misfit,
)
from stages.cad.scoring import Surroundings, score_of, unsupported_children, why_invalid
from stages.cad.shapes import Observed, Placement, Shape, observed_frames, shape_of_state, turned_frames
from stages.kit.geometry.boxes import bottom, points_in_box
from stages.kit.geometry.point_clouds import thin_to_grid

GRID = 0.01
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
BOX_MARGIN = 0.01
"""Vertices outside the observed box by more than this were stray to the graph and are so here [m]."""
SAME_PLACE = (0.01, 0.03)
"""Placements of one model nearer than this in metres and radians are one candidate."""


@dataclass(frozen=True)
class Shortlist:
    """What the global check chooses from, for one object."""

    node: GraphNode
    placements: tuple[Placement, ...]
    """Valid candidates, best first."""
    rejected: dict[str, int]
    reason: str
    """Why there is no valid candidate, or in what the valid ones fall short."""


def models_for(class_name: str, models: tuple[CadModel, ...]) -> list[CadModel]:
    """Return the library's models of the class, then of the classes that the vocabulary names as stand-ins (`library`):
    a desk may well be modelled by a table."""
    semantic = load_vocabulary().by_name(class_name)
    names = (class_name, *semantic.library)
    return [model for name in names for model in models if model.class_name == name]


def object_points(
    node: GraphNode, vertices: np.ndarray, normals: np.ndarray, count: int, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return at most `count` points (N, 3) and normals of the object's mesh, evenly spread, without what the graph
    left out."""
    if node.box_observed is not None:
        inside = points_in_box(node.box_observed, vertices, margin=BOX_MARGIN)
        if inside.any():
            vertices, normals = vertices[inside], normals[inside]
    points, normals = thin_to_grid(vertices, normals, GRID)
    if len(points) > count:
        drawn = np.sort(random.choice(len(points), size=count, replace=False))
        points, normals = points[drawn], normals[drawn]
    return points, normals


def support_height_of(node: GraphNode, graph: ContactGraphFile) -> float:
    """Return -d^s of the plane that the node stands on [m]: after refinement that is the bottom of its box (2.1)."""
    if node.box is None:
        raise ValueError(f"{node.id} has no box")
    return bottom(node.box)


def shortlist(
    points: np.ndarray,
    normals: np.ndarray,
    around: Surroundings,
    models: list[CadModel],
    surfaces: dict[str, ModelSurface],
    parameters: CadParameters,
) -> Shortlist:
    """Return the valid candidates of one object (sections 2.4.2, 2.4.3 and the first half of 2.4.4).

    `points`, `normals` (N, 3): vertices of the object; `surfaces`: model id -> surface for every model in `models`.
    """
    node, graph = around.node, around.graph
    if not models:
        return Shortlist(node, (), {}, f"the library has no model of class {node.class_name}")
    ours = parameters.method == "ours"
    carried = [link for link in graph.links if link.source == node.id and link.relation in ("supports", "contains")]
    carrying = frozenset(link.plane for link in carried if link.plane is not None)
    height = support_height_of(node, graph)
    if ours:
        closed = [shape_of_state(model, model.states[0]) for model in models]
        shapes = [shape for one in closed for shape in shapes_of_model(surfaces[one.model.id], one)]
    else:
        shapes = [shape_of_state(model, state) for model in models for state in model.states]
    movable = load_vocabulary().by_name(node.class_name).movable
    scale_range = (parameters.minimum_scale, parameters.maximum_scale)
    frames = observed_frames(node, points, carrying, height, all_frames=ours)
    weights_of_matching = (parameters.size_weight, parameters.plane_weight, parameters.upright_weight)
    counts: dict[str, int]
    if ours:
        matches, counts = matches_to_screen(frames, shapes, node, points, movable, weights_of_matching, parameters)
        kept = screened(matches, surfaces, points, scale_range, parameters)
        counts["screening rank"] = len(matches) - len(kept)
        matches = kept
    else:
        matches, counts = rank_matches(
            frames,
            shapes,
            weights=weights_of_matching,
            unmatched=None,
            scale_range=scale_range,
            keep=parameters.candidates,
        )
    rejected = Counter(counts)
    weights = AlignmentWeights(
        parameters.support_weight,
        parameters.offset_weight,
        parameters.angle_weight,
        parameters.containment_weight,
        parameters.height_weight,
    )
    aligned = []
    for match in matches:
        allowed_scales = scale_range if ours else (0.0, math.inf)
        placement = placement_of(match, align(match, weights, parameters.evaluations, allowed_scales))
        if not parameters.minimum_scale <= placement.scale <= parameters.maximum_scale:
            rejected["aligned scale out of range"] += 1
            continue
        surface = surfaces[match.shape.model.id]
        if ours:
            error = alignment_error(surface, placement, points[::SCREENING_STEP], normals[::SCREENING_STEP])
        else:
            error = alignment_error(surface, placement, points)
        aligned.append((match, replace(placement, alignment_error=error)))
    if ours:
        # Planes alone rank badly where few were seen; vertices are the better judge of what deserves refinement.
        aligned.sort(key=lambda entry: entry[1].alignment_error + parameters.tilt_weight * entry[0].tilt)
        rejected["alignment rank"] = max(0, len(aligned) - parameters.candidates)
        aligned = aligned[: parameters.candidates]
        aligned = fit_the_best(aligned, surfaces, points, normals, around, parameters)
    placements: list[Placement] = []
    for placement in aligned_placements(aligned, surfaces, points, normals, around, parameters):
        reason = why_invalid(placement, surfaces[placement.shape.model.id], around, parameters)
        if reason is None:
            placements.append(placement)
        else:
            rejected[reason] += 1
    fitting = len(placements)
    missing = {id(p): unsupported_children(p, around, parameters) for p in placements}
    # One child that was badly seen must not cost a shelf its model: the best that exists will do, and the child goes
    # on the nearest surface. The thesis discards all.
    allowed = min((len(names) for names in missing.values()), default=0) if ours else 0
    placements = [p for p in placements if len(missing[id(p)]) <= allowed]
    rejected["does not support a child"] = fitting - len(placements)
    placements.sort(key=lambda p: p.score)
    unique = without_repeats(placements)
    rejected["same as a better candidate"] += len(placements) - len(unique)
    counted = {name: int(count) for name, count in sorted(rejected.items()) if count}
    reason = ""
    if not unique:
        reason = "no valid candidate: " + ", ".join(f"{name} {count}" for name, count in counted.items())
    elif missing[id(unique[0])]:
        reason = "does not quite support " + ", ".join(missing[id(unique[0])])
    return Shortlist(node, tuple(unique), counted, reason)


def matches_to_screen(
    frames: list[Observed],
    shapes: list[Shape],
    node: GraphNode,
    points: np.ndarray,
    movable: bool,
    weights: tuple[float, float, float],
    parameters: CadParameters,
) -> tuple[list[Match], dict[str, int]]:
    """Ours: return the best matches by planes and size, standing and lying ones apart, and what was left out.

    Furniture only stands. Of movable things the standing ones are also tried between the quarter turns, and lying ones
    have a share of their own, as either may have the planes that noise likes.
    """

    def rank(found: list[Observed], keep: int, upright: bool) -> tuple[list[Match], dict[str, int]]:
        return rank_matches(
            found,
            shapes,
            weights=weights,
            unmatched=parameters.unmatched_plane,
            scale_range=(0.0, math.inf),
            keep=keep,
            upright_only=upright,
        )

    if not movable:
        matches, counts = rank(frames, parameters.matched, True)
        return matches, counts
    standing, counts = rank([*frames, *turned_frames(frames[0], node, points, TURNS)], parameters.matched, True)
    lying, others = rank(frames, parameters.matched, False)
    lying = [match for match in lying if match.tilt > 0][: parameters.matched // 3]
    return [*standing, *lying], dict(Counter(counts) + Counter(others))


def screened(
    matches: list[Match],
    surfaces: dict[str, ModelSurface],
    points: np.ndarray,
    scale_range: tuple[float, float],
    parameters: CadParameters,
) -> list[Match]:
    """Ours: return the matches that come closest to the vertices (N, 3) where the matching puts them, best first.

    Planes rank badly where they are few or misleading, the failure that the thesis names (section 2.6.6): a cup's side
    gives as many as noise likes, and lying models with as many planes outrank the upright one.
    """
    some = points[:: max(1, len(points) // SCREENING_POINTS)]
    scores = []
    for match in matches:
        placement = placement_of(match, unaligned(match, scale_range))
        error = robust_error(surfaces[match.shape.model.id], placement, some, None, TRUNCATION)
        scores.append(
            error
            + parameters.misfit_weight * size_misfit(match.frame.size, placement)
            + parameters.tilt_weight * match.tilt
            + parameters.scale_weight * abs(math.log(placement.scale))
        )
    order = np.argsort(scores, kind="stable")[: parameters.candidates * parameters.screening]
    return [matches[k] for k in order]


def fit_the_best(
    aligned: list[tuple[Match, Placement]],
    surfaces: dict[str, ModelSurface],
    points: np.ndarray,
    normals: np.ndarray,
    around: Surroundings,
    parameters: CadParameters,
) -> list[tuple[Match, Placement]]:
    """Ours: refine all candidates quickly on the vertices (N, 3), then the best `FULL_FITS` thoroughly, with joints."""
    some = slice(None, None, max(1, len(points) // QUICK_POINTS))
    quick = [
        (
            match,
            refine(
                surfaces[placement.shape.model.id],
                placement,
                points[some],
                normals[some],
                free_height=around.hangs,
                move_joints=False,
                iterations=QUICK_ITERATIONS,
            ),
        )
        for match, placement in aligned
    ]

    def score(entry: tuple[Match, Placement]) -> float:
        match, placement = entry
        surface = surfaces[placement.shape.model.id]
        return score_of(match, placement, placement.alignment_error, surface, around, parameters)

    quick.sort(key=score)
    return [
        (
            match,
            fitted(surfaces[placement.shape.model.id], placement, points, normals, free_height=around.hangs)
            if k < FULL_FITS
            else placement,
        )
        for k, (match, placement) in enumerate(quick)
    ]


def aligned_placements(
    aligned: list[tuple[Match, Placement]],
    surfaces: dict[str, ModelSurface],
    points: np.ndarray,
    normals: np.ndarray,
    around: Surroundings,
    parameters: CadParameters,
) -> list[Placement]:
    """Return placements with the alignment error over all vertices (N, 3) and the score that the choice minimises."""
    result = []
    for match, placement in aligned:
        surface = surfaces[placement.shape.model.id]
        error = alignment_error(surface, placement, points)
        score = error
        if parameters.method == "ours":
            oriented = robust_error(surface, placement, points, normals, TRUNCATION)
            score = score_of(match, placement, oriented, surface, around, parameters)
        result.append(replace(placement, alignment_error=error, score=score))
    return result


def without_repeats(placements: list[Placement]) -> list[Placement]:
    """Drop placements that a better one (earlier in the list) repeats: same model, place, turn and joints."""
    kept: list[Placement] = []
    for placement in placements:
        for other in kept:
            if other.shape.model.id != placement.shape.model.id:
                continue
            near = np.linalg.norm(other.translation - placement.translation) < SAME_PLACE[0]
            turn = np.arccos(np.clip((np.trace(other.rotation.T @ placement.rotation) - 1) / 2, -1, 1))
            joints = _joint_distance(other.shape, placement.shape)
            if near and turn < SAME_PLACE[1] and joints < SAME_PLACE[1]:
                break
        else:
            kept.append(placement)
    return kept


def _joint_distance(a: Shape, b: Shape) -> float:
    names = set(a.joints) | set(b.joints)
    return max((abs(a.joints.get(name, 0.0) - b.joints.get(name, 0.0)) for name in names), default=0.0)
