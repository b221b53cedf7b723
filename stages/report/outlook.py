"""What of a reconstruction can be relied on, what cannot, what was not seen, and what to do about it.

A pure function of what the steps say of their artifacts (outcome and summary): `scenewright run` prints it at the end,
and it is the first section of the report.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

CLASS_AGNOSTIC = "class-agnostic"
"""Word in the label of masks that have no names."""
MANY_UNKNOWN, MANY_MESHES, MANY_LOST = 0.25, 0.5, 0.1
"""Shares of supports, of things without a model, of frames, from which there is something to do about them."""
HELD_UPRIGHT = "which way is up: no floor was seen, the camera is taken to have been held upright"


@dataclass(frozen=True)
class Facts:
    """What a step says of its artifact."""

    outcome: str
    summary: Mapping[str, Any]

    def number(self, name: str) -> float:
        """Return an entry of the summary; 0 where it is absent or no number."""
        value = self.summary.get(name)
        return float(value) if isinstance(value, int | float) else 0.0

    def count(self, name: str) -> int:
        """Return an entry of the summary as a whole number."""
        return int(self.number(name))


@dataclass(frozen=True)
class Outlook:
    """Sentences; each group may be empty."""

    sound: tuple[str, ...] = ()
    doubtful: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    advice: tuple[str, ...] = ()

    def lines(self) -> list[str]:
        """Return it for a terminal, one screen at most."""
        groups = (
            ("to rely on", self.sound),
            ("not to rely on", self.doubtful),
            ("not seen", self.missing),
            ("what to do next", self.advice),
        )
        return [f"{title if not k else '':16} {text}" for title, texts in groups for k, text in enumerate(texts)]


def outlook(facts: Mapping[str, Facts]) -> Outlook:
    """Return what the facts of a run's artifacts amount to, role (`sequence`, `panoptic_map`) -> facts."""
    judged = Outlook()
    if "trajectory" in facts and "sequence" in facts:  # which way is up is then that of the trajectory
        summary = {name: value for name, value in facts["sequence"].summary.items() if name != "gravity"}
        facts = {**facts, "sequence": Facts(facts["sequence"].outcome, summary)}
    for role, judge in JUDGES.items():
        if role in facts:
            verdict = judge(facts[role])
            judged = Outlook(
                judged.sound + verdict.sound,
                judged.doubtful + verdict.doubtful,
                judged.missing + verdict.missing,
                judged.advice + tuple(text for text in verdict.advice if text not in judged.advice),
            )
    if "interactive_scene" in facts and not judged.doubtful and not judged.missing:
        return Outlook(judged.sound, advice=("nothing speaks against acting in it: scenewright plan",))
    return judged


def _sequence(facts: Facts) -> Outlook:
    used, lost = facts.count("frames"), facts.count("dropped")
    missing = [f"{lost} of {used + lost} frames could not be used"] if lost else []
    advice = ["scenewright inspect LOG says why frames are lost"] if lost > MANY_LOST * (used + lost) else []
    doubtful = ["which way is up: nothing in the log says it"] if facts.summary.get("gravity") == "none" else []
    if facts.summary.get("gravity") == "mean_camera_up":
        doubtful = [HELD_UPRIGHT]
    if facts.summary.get("damage"):
        doubtful.append("the log is damaged; what is whole of it was used")
    return Outlook((), tuple(doubtful), tuple(missing), tuple(advice))


def _trajectory(facts: Facts) -> Outlook:
    posed, frames = facts.count("posed"), facts.count("frames")
    sound = (f"{posed} of {frames} frames have an estimated pose",)
    doubtful = (HELD_UPRIGHT,) if facts.summary.get("gravity") == "mean_camera_up" else ()
    missing = (f"{frames - posed} frames whose place was not found",) if posed < frames else ()
    advice = ("move the camera slowly, so that neighbouring images share most of what they show",) if missing else ()
    return Outlook(sound, doubtful, missing, advice)


def _segments(facts: Facts) -> Outlook:
    label = str(facts.summary.get("label", ""))
    if CLASS_AGNOSTIC in label:
        advice = "bring masks of your own or another backend (segment --help), or name what to look for (--words)"
        return Outlook(doubtful=(f"what things are: the masks are {label}",), advice=(advice,))
    if not label or "ground-truth" in label:
        return Outlook()
    return Outlook(doubtful=(f"names and outlines are those of {label}: look at the images first",))


def _panoptic_map(facts: Facts) -> Outlook:
    if facts.outcome == "empty":
        return Outlook(missing=("everything: no frame with depth and a pose could be fused",))
    frames, bare = facts.count("frames"), facts.count("frames_without_segments")
    sound = (f"the map: {frames} frames are in it, {facts.count('entities')} things and pieces of the room",)
    skipped = {
        name.removeprefix("skipped_").replace("_", " "): facts.count(name)
        for name in sorted(facts.summary)
        if name.startswith("skipped_") and facts.count(name)
    }
    missing = [f"{count} frames left out of the map: {reason}" for reason, count in skipped.items()]
    if bare:
        missing.append(f"{bare} frames have no masks and gave shape alone")
    return Outlook(sound, missing=tuple(missing))


def _contact_graph(facts: Facts) -> Outlook:
    objects, unknown, dropped = (facts.count(name) for name in ("objects", "unknown", "dropped"))
    sound, doubtful, missing, advice = [], [], [], []
    if facts.summary.get("floor") == "seen":
        sound.append("the floor was seen: heights are measured from it")
    elif "floor" in facts.summary:
        missing.append("the floor")
        advice.append("record the floor in front of the furniture too")
    if unknown:
        doubtful.append(f"what {unknown} of {objects} things stand on")
    if unknown > MANY_UNKNOWN * max(objects, 1):
        advice.append("come closer to where things touch what carries them")
    if dropped:
        doubtful.append(f"pieces of the map that were too little or too vague to be things and are left out: {dropped}")
    return Outlook(tuple(sound), tuple(doubtful), tuple(missing), tuple(advice))


def _cad_scene(facts: Facts) -> Outlook:
    models, parts, built, meshes = (facts.count(name) for name in ("cad", "of_families", "built_in", "mesh"))
    thing_count, error = models + parts + built + meshes, facts.number("alignment_error_median")
    sound, doubtful, missing, advice = [], [], [], []
    if models:
        fit = f", the middle one within {1000 * error:.0f} mm of what was seen" if error else ""
        sound.append(f"{models} of {thing_count} things have a CAD model{fit}")
    if parts:
        sound.append(
            f"parts that were fitted one by one stand for {parts} of {thing_count} things, which no model explains"
        )
    if built:
        sound.append(f"boxes that were made for {built} of {thing_count} things, which no model fits, stand for them")
    if meshes:
        doubtful.append(f"{meshes} of {thing_count} things keep their scanned mesh: no doors, nothing behind them")
    if meshes > MANY_MESHES * thing_count:
        advice.append("walk around what matters, closer; add models of your own things (scenewright library add)")
    if facts.number("unexplained_m2") >= 1:
        missing.append(f"{facts.number('unexplained_m2'):.1f} m² of mapped surface that nothing in the scene explains")
    if facts.number("surroundings_m2") >= 1:
        missing.append(f"what {facts.number('surroundings_m2'):.1f} m² of mapped surface belong to")
    return Outlook(tuple(sound), tuple(doubtful), tuple(missing), tuple(advice))


def _interactive_scene(facts: Facts) -> Outlook:
    movable, joints, collisions = (facts.count(name) for name in ("movable", "joints", "collisions"))
    if facts.outcome == "ok":
        if "settled" not in facts.summary:
            return Outlook(doubtful=("whether it stays when it is let go: that was not tried",))
        sure = (f"let go, all {movable} movable bodies stay; {joints} joints are free at their start",)
        marginal = facts.summary.get("marginal")
        return Outlook(sure, doubtful=(f"physics is marginal: {marginal}",) if marginal else ())
    reason = str(facts.summary.get("reason", facts.outcome))
    if held_count := facts.count("held"):
        reason += f"; {held_count} things that could be pushed lie in others and stay"
    if facts.outcome == "nothing_movable":
        return Outlook(doubtful=(f"acting in it: {reason}",), advice=("masks that tell things from furniture",))
    sound = () if collisions else ("nothing stands more than 5 mm in anything else",)
    advice = "ask scenewright urdf settle SCENE: it names every body that does not stay or lies in another"
    return Outlook(sound, doubtful=(f"physics: {reason}",), advice=(advice,))


JUDGES: dict[str, Callable[[Facts], Outlook]] = {
    "sequence": _sequence,
    "trajectory": _trajectory,
    "segments": _segments,
    "panoptic_map": _panoptic_map,
    "contact_graph": _contact_graph,
    "cad_scene": _cad_scene,
    "interactive_scene": _interactive_scene,
}
"""Role -> what is said of it, in the order of the chain."""
