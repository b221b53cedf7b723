"""What the protocol found, as JSON and as a table: every number by the name that docs/FORMATS.md defines."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from scenewright.stages.kit.simulation.margins import is_marginal
from scenewright.stages.kit.simulation.world import GRAVITY
from scenewright.stages.urdf.joint_sweep import START_SHARE, JointRange
from scenewright.stages.urdf.motions import MOVED_LIMIT, BodyMotion
from scenewright.stages.urdf.protocol import (
    OLD_SECONDS,
    OLD_TURNED,
    SECONDS,
    TURNED,
    VERSION,
    EngineRun,
    Protocol,
    stable_by_old_limits,
)
from scenewright.stages.urdf.scene_penetration import Overlap
from scenewright.stages.urdf.settle_report import COLLISION_DEPTH

ENGINES = {"mujoco": "MuJoCo", "bullet": "Bullet"}


def as_json(found: Protocol, scene: str, scene_format: str, findings: Sequence[str]) -> dict[str, Any]:
    """Return everything as plain values for JSON; what has no value is None."""
    free, counts = len(found.free), found.counts
    held = None if counts.held is None else len(counts.held)
    return {
        "protocol": VERSION,
        "scene": scene,
        "format": scene_format,
        "limits": {
            "gravity": GRAVITY,
            "seconds": SECONDS,
            "moved_mm": _mm(MOVED_LIMIT),
            "turned_deg": _degrees(TURNED),
            "depth_mm": _mm(COLLISION_DEPTH),
            "start_share": START_SHARE,
        },
        "old_limits": {"seconds": OLD_SECONDS, "moved_mm": _mm(MOVED_LIMIT), "turned_deg": _degrees(OLD_TURNED)},
        "sound": found.sound,
        "bodies": free + len(found.fixed),
        "free": free,
        "stable": len(found.stable),
        "stable_share": share(len(found.stable), free),
        "all_stable": len(found.stable) == free if free else None,
        "engines": {name: _engine(found, name) for name in ENGINES},
        "colliding_pairs": len(found.colliding),
        "colliding_bodies": len(found.colliding_bodies),
        "colliding_share": share(len(found.colliding_bodies), free),
        "fixed_pairs": len(found.overlaps) - len(found.colliding),
        "joints": len(found.joints),
        "joints_free": sum(joint.hit_link is None for joint in found.joints),
        "joints_free_at_start": len(found.joints) - len(found.blocked),
        "yield": {
            "seen": counts.seen,
            "kept": counts.kept,
            "kept_free": counts.free,
            "held": held,
            "kept_share": share(counts.kept, counts.seen),
            "free_share": share(counts.free, counts.seen),
            "held_share": share(held, counts.seen),
        },
        "free_bodies": [_body(found, name) for name in found.free],
        "held_bodies": None if counts.held is None else list(counts.held),
        "pairs": [_pair(found, pair) for pair in found.overlaps],
        "sweeps": [_sweep(joint) for joint in found.joints],
        "findings": list(findings),
    }


def share(count: int | None, of: int | None) -> float | None:
    """Return a share to four digits, None where it has no value."""
    return None if count is None or not of else round(count / of, 4)


def _engine(found: Protocol, name: str) -> dict[str, Any]:
    if name not in found.runs:
        return {"not_run": found.not_run[name]}
    run = found.runs[name]
    stable, old = sum(body.stays for body in run.motions), sum(map(stable_by_old_limits, run.motions))
    return {
        "version": run.version,
        "stable": stable,
        "stable_share": share(stable, len(run.motions)),
        "all_stable": stable == len(run.motions) if run.motions else None,
        "stable_old": old,
        "stable_old_share": share(old, len(run.motions)),
        "fell_through": sum(body.fell_through for body in run.motions),
        "largest_move_mm": _mm(max((body.moved for body in run.motions), default=0.0)),
        "marginal": _marginal(run),
    }


def _marginal(run: EngineRun) -> list[str]:
    return [body.name for body in run.motions if is_marginal(body.margin)]


def _body(found: Protocol, name: str) -> dict[str, Any]:
    return {
        "name": name,
        "stable": name in found.stable,
        "collides": name in found.colliding_bodies,
        **{engine: _motion(_of(run, name)) for engine, run in found.runs.items()},
    }


def _of(run: EngineRun, name: str) -> BodyMotion:
    return next(body for body in run.motions if body.name == name)


def _motion(body: BodyMotion) -> dict[str, Any]:
    return {
        "moved_mm": _mm(body.moved),
        "turned_deg": _degrees(body.turned),
        "fell_through": body.fell_through,
        "stable": body.stays,
        "stable_old": stable_by_old_limits(body),
        "margin": _margin(body.margin),
    }


def _pair(found: Protocol, pair: Overlap) -> dict[str, Any]:
    first, second = sorted((pair.first, pair.second), key=lambda name: name not in found.free)
    return {
        "first": first,
        "second": second,
        "depth_mm": _mm(pair.depth),
        "colliding": pair in found.colliding,
        "margin": _margin(pair.margin),
    }


def _sweep(joint: JointRange) -> dict[str, Any]:
    return {
        "joint": joint.joint,
        "body": joint.body,
        "free_range_share": round(joint.free_share, 4),
        "free": joint.hit_link is None,
        "free_at_start": joint.free_at_start,
        "meets": joint.hit_link,
        "margin": _margin(joint.margin),
    }


def _mm(metres: float) -> float | None:
    return round(1000 * metres, 3) if math.isfinite(metres) else None


def _degrees(radians: float) -> float | None:
    return round(math.degrees(radians), 3) if math.isfinite(radians) else None


def _margin(margin: float | None) -> float | None:
    return None if margin is None else round(margin, 2)


def table(document: dict[str, Any]) -> list[str]:
    """Return the lines of a table of `as_json`, and one for each thing that does not hold."""
    ran = [name for name in ENGINES if "not_run" not in document["engines"][name]]
    free, limits, old = document["free"], document["limits"], document["old_limits"]
    titles = [f"{ENGINES[name]} {document['engines'][name]['version']}" for name in ran]
    counts = (
        (f"stable ({limits['seconds']:g} s, 1 cm, {limits['turned_deg']:g} degrees)", "stable"),
        (f"by the old limits ({old['seconds']:g} s, 1 cm, {old['turned_deg']:g} degrees)", "stable_old"),
        ("fell through", "fell_through"),
    )
    rows = [("", *titles)]
    rows += [(title, *(_of_all(document["engines"][name][key], free) for name in ran)) for title, key in counts]
    rows.append(("marginal", *(str(len(document["engines"][name]["marginal"])) for name in ran)))
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    lines = [f"{document['scene']}: {document['format']}, {document['bodies']} bodies, {free} of them free"]
    padded = [[cell.ljust(width) for cell, width in zip(row, widths, strict=True)] for row in rows]
    lines += [f"  {'  '.join(row).rstrip()}" for row in padded]
    kept = document["yield"]
    joints = document["joints"]
    lines += [
        f"  stable in every engine: {_of_all(document['stable'], free)}",
        f"  colliding: {document['colliding_pairs']} pairs, {_of_all(document['colliding_bodies'], free)} free bodies; "
        f"between what stands fast: {document['fixed_pairs']} pairs",
        f"  joints: {document['joints_free']} of {joints} free over their range, "
        f"{document['joints_free_at_start']} of {joints} in its first tenth",
        _yield_line(kept),
    ]
    missing = [name for name in ENGINES if name not in ran]
    lines += [f"  not run: {ENGINES[name]}: {document['engines'][name]['not_run']}" for name in missing]
    return lines + [f"  {line}" for line in _troubles(document, ran)] + [f"  note: {f}" for f in document["findings"]]


def _of_all(count: int, of: int) -> str:
    return f"{count} of {of}" + (f" ({100 * count / of:.1f} %)" if of else "")


def _yield_line(kept: dict[str, Any]) -> str:
    if kept["seen"] is None:
        return f"  yield: {kept['kept']} things, {kept['kept_free']} of them free; of how many seen: --seen N"
    held = "" if kept["held"] is None else f", {_of_all(kept['held'], kept['seen'])} held"
    return (
        f"  yield: {_of_all(kept['kept'], kept['seen'])} things seen are in the scene, "
        f"{_of_all(kept['kept_free'], kept['seen'])} free{held}"
    )


def _troubles(document: dict[str, Any], ran: Sequence[str]) -> list[str]:
    lines = []
    for body in document["free_bodies"]:
        fates = [f"{_fate(body[name])} in {ENGINES[name]}" for name in ran if not body[name]["stable"]]
        lines += [f"{body['name']}: {', '.join(fates)}"] if fates else []
        lines += [
            f"{body['name']}: marginal in {ENGINES[name]}: {body[name]['margin']:.1f} standard deviations to a limit"
            for name in ran
            if is_marginal(body[name]["margin"])
        ]
    lines += [f"{p['first']}: {p['depth_mm']:.1f} mm in {p['second']}" for p in document["pairs"] if p["colliding"]]
    lines += [
        f"{sweep['joint']}: meets {sweep['meets']} after {100 * sweep['free_range_share']:.0f} % of its range"
        for sweep in document["sweeps"]
        if not sweep["free"]
    ]
    lines += [f"{name}: held" for name in document["held_bodies"] or ()]
    if not document["free"] and not document["joints"]:
        lines.append("nothing can move, so that standing still says nothing")
    return lines


def _fate(motion: dict[str, Any]) -> str:
    if motion["fell_through"]:
        return "falls through"
    if motion["moved_mm"] is None:
        return "is lost: the engine's numbers are not finite"
    return f"moves {motion['moved_mm']:.1f} mm, turns {motion['turned_deg']:.1f} degrees"
