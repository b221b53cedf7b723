"""Views in which enough of the needle is seen, as a surgeon, or a robot that plans its views, would have them."""

from __future__ import annotations

from scenewright.stages.suture.rig import TWO_CAMERAS, StereoRig
from scenewright.stages.suture.world.render import StereoView, render
from scenewright.stages.suture.world.scene import NeedleScene, make_scene

LEAST_SEEN = 0.4
"""The least share of the arc that each eye sees."""


def seen_scene(
    seed: int,
    rig: StereoRig = TWO_CAMERAS,
    holder: str | None = None,
    place: str | None = None,
    calibration_error: float = 0.0,
) -> tuple[NeedleScene, StereoView]:
    """Return the first scene of `seed` of whose needle each eye sees at least LEAST_SEEN, and its geometry.

    The arguments are those of `make_scene`.
    """
    attempt = 0
    while True:
        scene = make_scene(seed, rig, holder, place, calibration_error, attempt)
        view = render(scene, pictures=False)
        if view.seen >= LEAST_SEEN:
            return scene, view
        attempt += 1
