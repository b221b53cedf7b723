"""What was tried in the place of a node: its candidates in order; what stood there before and after the check."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.cad_scene import CadCandidate, Replacement
from scenewright.stages.kit.measurement.shape_symmetry import rotation_angle


def candidates_of(replacement: Replacement) -> list[tuple[str, CadCandidate]]:
    """Return (role, candidate), each placement once: the chosen one, the one that fitted best by itself, the others."""
    listed: list[tuple[str, CadCandidate]] = []
    best = replacement.best_single
    if replacement.chosen is not None and replacement.decision == "cad":
        is_same = best is not None and same_placement(best, replacement.chosen)
        listed.append(("chosen, best by itself" if is_same else "chosen", replacement.chosen))
    if best is not None:
        listed.append(("best by itself", best))
    listed += [("", candidate) for candidate in replacement.alternatives]
    distinct: list[tuple[str, CadCandidate]] = []
    for role, candidate in listed:
        if not any(same_placement(candidate, listed_candidate) for _, listed_candidate in distinct):
            distinct.append((role, candidate))
    return distinct


def before_check(replacement: Replacement) -> CadCandidate | None:
    """Return what stood for a node before the global check: its best single candidate; in older scenes its choice."""
    return replacement.best_single or (replacement.chosen if replacement.decision == "cad" else None)


def after_check(replacement: Replacement) -> CadCandidate | None:
    """Return what stands for a node after the global check, None where it keeps its mesh."""
    return replacement.chosen if replacement.decision == "cad" else None


def same_placement(a: CadCandidate, b: CadCandidate, distance: float = 0.005, angle: float = 0.02) -> bool:
    """Whether two candidates are the same model in the same place (within [m], [rad])."""
    if a.model_id != b.model_id or abs(a.scale - b.scale) > 1e-3:
        return False
    first, second = np.array(a.world_from_model), np.array(b.world_from_model)
    turn = rotation_angle(first[:3, :3].T @ second[:3, :3])
    return bool(np.linalg.norm(first[:3, 3] - second[:3, 3]) <= distance) and turn <= angle
