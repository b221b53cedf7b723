"""What nobody should trust of a scene, listed in the scene itself: inferred, held, hardly explained, assumed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.interactive_scene import Doubt
from scenewright.stages.kit.formats.scene_bundle import BundleBody

WELL_EXPLAINED = 0.75
"""Share of what was seen from which on a model stands for its thing, as for families and built-ins."""
SCENE = "scene"
"""Name of what is doubtful of the scene as a whole."""
ASSUMED = (
    "masses and friction are those of the materials that things of a class are made of; nothing was weighed",
    "the light is assumed: one lamp over the middle of the floor",
)


def doubts_of(cad_scene: CadScene, bodies: Sequence[BundleBody]) -> tuple[Doubt, ...]:
    """Return the doubts about the bodies of a scene, in their order, and then about all of it."""
    told = {entry.node: list(_about_stand_in(cad_scene, entry.node)) for entry in cad_scene.info.replacements}
    unseen = _unseen_shares(cad_scene)
    doubts = []
    for body in bodies:
        words = [body.because] if body.because else []
        words += told.get(body.name, [])
        if body.name in unseen:
            words.append(f"inferred: nobody saw {unseen[body.name]:.0%} of its face")
        doubts += [Doubt(name=body.name, says=text) for text in words]
    left = 0.0 if cad_scene.manifest is None else cad_scene.manifest.summary.get("unexplained_m2")
    of_all = [f"{left} m² of mapped surface lie near nothing in it"] if left else []
    return (*doubts, *(Doubt(name=SCENE, says=text) for text in (*of_all, *ASSUMED)))


def _about_stand_in(cad_scene: CadScene, node: str) -> Iterator[str]:
    entry = next(entry for entry in cad_scene.info.replacements if entry.node == node)
    if entry.decision == "mesh":
        yield "its shape is what was mapped: what nobody saw of it is missing"
    if entry.decision == "cad" and entry.explained is not None and entry.explained.by_model < WELL_EXPLAINED:
        yield f"its model lies near {entry.explained.by_model:.0%} of what was seen of it"
    if entry.held:
        yield f"nothing in the map speaks for its joints: {', '.join(sorted(entry.held))}"


def _unseen_shares(cad_scene: CadScene) -> dict[str, float]:
    """Return layout node -> share of its plates' face that nobody saw, where that is any."""
    full: dict[str, float] = {}
    unseen: dict[str, float] = {}
    for panel in () if cad_scene.shell is None else cad_scene.shell.panels:
        area = sum((right - left) * (top - low) for left, low, right, top in panel.boxes)
        full[panel.node] = full.get(panel.node, 0.0) + area
        unseen[panel.node] = unseen.get(panel.node, 0.0) + (1.0 - panel.seen) * area
    return {node: unseen[node] / full[node] for node in full if unseen[node] >= 0.005 * full[node]}
