"""Why a model stands for a node of a CAD scene, why not another, and why its joints are believed."""

from __future__ import annotations

import math
from collections.abc import Iterator

from scenewright.cli.explaining.reason import Reason, Reasons, counted, edit_reasons, length, listed, merged
from scenewright.schemas.cad_scene import CadCandidate, CadScene, JointEvidence, Replacement
from scenewright.stages.kit.measurement.cad_candidates import candidates_of

MOST_OTHERS = 3
"""Most other models that are named."""
GROUNDS = {
    "user": "a person vouches for it",
    "moved": "the log shows its part move",
    "open": "its part was seen open",
    "handle": "a handle stands out of its leaf",
    "seam": "a seam runs where its leaf ends",
    "thing": "another joint of the same thing is believed, and this one was not seen",
}


def cad_reasons(scene: CadScene) -> Reasons:
    """Return the reasons of every node, and of joints as `<node>__<joint>`."""
    parts: list[Reasons] = []
    for entry in scene.info.replacements:
        joints = {
            f"{entry.node}__{name}": [joint_reason(f"{entry.node}__{name}", evidence)]
            for name, evidence in sorted((entry.joint_evidence or {}).items())
        }
        parts += [
            {entry.node: [*replacement_reasons(entry), *(row for rows in joints.values() for row in rows)]},
            joints,
        ]
    return merged([*parts, edit_reasons(scene.edits)])


def replacement_reasons(entry: Replacement) -> Iterator[Reason]:
    """Yield why this stands for a node, and what was tried and discarded."""
    if entry.decision == "layout":
        yield Reason("It bounds the room: its own surface stays, and no model is tried.", {"decision": "layout"})
        return
    chosen = entry.chosen if entry.decision == "cad" else None
    if chosen is None:
        because = entry.reason or "no candidate was valid"
        yield Reason(f"No model stands for it, its own mesh stays: {because}.", _facts(entry))
    else:
        stretched = f", stretched from {chosen.stretched_from}," if chosen.stretched_from else ""
        yield Reason(f"The model {chosen.model_id}{stretched} stands for it. {_fit(chosen)}", _facts(entry))
        if entry.reason:
            yield Reason(f"The reason: {entry.reason}.", {"reason": entry.reason})
    listed_candidates = candidates_of(entry)
    best = entry.best_single
    if chosen is not None and best is not None and best.library_model != chosen.library_model:
        says = f"By itself {best.model_id} fitted best; the check of all things together chose another. {_fit(best)}"
        yield Reason(says, {"best_single": best.model_id})
    elif listed_candidates and listed_candidates[0][0] == "chosen, best by itself":
        yield Reason("It is also what fitted best by itself.", {"best_single": listed_candidates[0][1].model_id})
    yield from _others(entry, [candidate for role, candidate in listed_candidates if role == ""])
    if entry.rejected:
        total = counted(sum(entry.rejected.values()), "candidate")
        order = sorted(entry.rejected.items(), key=lambda row: (-row[1], row[0]))
        says = f"{total} were discarded before: {', '.join(f'{reason} ({count})' for reason, count in order)}."
        yield Reason(says, {"rejected": entry.rejected})


def joint_reason(name: str, evidence: JointEvidence) -> Reason:
    """Return why a joint moves or is held."""
    facts = evidence.model_dump(mode="json")
    if not evidence.grounds:
        return Reason(f"The joint {name} is held: nothing in the map speaks for it.", facts)
    says = f"The joint {name} is believed: {listed(GROUNDS[ground] for ground in evidence.grounds)}."
    if evidence.handle_height is not None:
        says += f" The handle stands out by {length(evidence.handle_height)}."
    if evidence.seam_contrast is not None:
        says += f" The seam runs along {100 * evidence.seam_contrast:.0f} % of the leaf's clearest inner edge."
    if evidence.motion is not None:
        turn = math.degrees(evidence.motion.angle)
        says += f" Its axis was seen {turn:.1f} degrees from the model's, and the scene takes the one seen."
    return Reason(says, facts)


def _others(entry: Replacement, candidates: list[CadCandidate]) -> Iterator[Reason]:
    known = {candidate.library_model for candidate in (entry.chosen, entry.best_single) if candidate is not None}
    best: dict[str, CadCandidate] = {}
    for candidate in candidates:
        before = best.get(candidate.model_id)
        if candidate.library_model not in known and (
            before is None or candidate.alignment_error < before.alignment_error
        ):
            best[candidate.model_id] = candidate
    order = sorted(best.values(), key=lambda one: (one.alignment_error, one.model_id))
    if order:
        rows = [f"{one.model_id} ({length(one.alignment_error)})" for one in order[:MOST_OTHERS]]
        more = f" and {len(order) - MOST_OTHERS} more" if len(order) > MOST_OTHERS else ""
        errors = {one.model_id: one.alignment_error for one in order}
        yield Reason(
            f"Other valid models, with their distance from what was seen: {', '.join(rows)}{more}.", {"others": errors}
        )


def _fit(candidate: CadCandidate) -> str:
    error = length(candidate.alignment_error)
    return f"It lies {error} (RMS) from what was seen, its matching error is {candidate.matching_error:.2f}."


def _facts(entry: Replacement) -> dict[str, object]:
    chosen = None if entry.chosen is None else entry.chosen.model_dump(mode="json", exclude={"world_from_model"})
    return {"decision": entry.decision, "reason": entry.reason, "chosen": chosen}
