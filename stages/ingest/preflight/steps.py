"""Which steps can run on this log, and what is missing for the others."""

from __future__ import annotations

from collections.abc import Set

from scenewright.stages.ingest.preflight.report import StepReport

NEEDS: dict[str, tuple[str, ...]] = {
    "ingest": ("usable frames",),
    "segment": ("usable frames", "depth"),
    "segment --backend detector": ("usable frames", "depth", "colour"),
    "segment --backend ground-truth": ("usable frames", "depth", "labels"),
    "disparity": ("usable frames", "a stereo pair with a baseline"),
    "poses": ("usable frames", "colour"),
    "fuse": ("usable frames", "depth", "poses"),
    "graph": ("usable frames", "depth", "poses"),
    "cad": ("usable frames", "depth", "poses"),
    "urdf": ("usable frames", "depth", "poses"),
    "run reconstruct": ("usable frames", "depth", "poses"),
}
"""Step -> what the log must have for it, through the steps before it. `run reconstruct` takes another segmenter where a
log has no colour for the detector."""
SUBSTITUTES = {"depth": ("disparity", "a stereo pair with a baseline"), "poses": ("poses", "colour")}
"""What a log lacks -> (step that makes it, what that step needs)."""


def step_reports(have: Set[str]) -> tuple[StepReport, ...]:
    """Return a row per step for a log that has what `have` names."""
    rows = []
    for step, needs in NEEDS.items():
        word = step.split()[0]
        missing = []
        for need in needs:
            if need in have:
                continue
            maker, source = SUBSTITUTES.get(need, ("", ""))
            if maker and maker != word and source in have:
                missing.append(f"{need} (make it with `{maker}`)")
            else:
                missing.append(need)
        rows.append(StepReport(step=step, ready=not missing, missing=tuple(missing)))
    return tuple(rows)
