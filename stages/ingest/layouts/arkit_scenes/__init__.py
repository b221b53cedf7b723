"""ARKitScenes' raw recordings: lowres_depth/, pictures, *.pincam, lowres_wide.traj."""

from __future__ import annotations

from scenewright.stages.ingest.registry import LogLayout

LAYOUT = LogLayout(
    "arkit-scenes", order=62, recognised_by="lowres_wide.traj and lowres_depth/", reader=f"{__name__}.reader"
)
