"""Small runs of every step, as command lines: what `--same-bytes` compares. `@name` is the output of the run `name`.

They show what they exercise and no more: a branch that no line here takes needs a line, or a reason in words.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Run:
    """One command line; its `--out` is the folder `name`."""

    name: str
    step: str
    options: str = ""

    def needs(self) -> list[str]:
        """Names of the runs whose output it reads."""
        return [word[1:].split("/")[0] for word in self.options.split() if word.startswith("@")]


SEEN = "--sequence @needle_scene"
RUNS = (
    Run("library", "library build", "--shapes-per-class 2 --small-shapes-per-class 2 --seed 1"),
    Run("truth", "synthesize", "--library @library --frames 24 --width 240 --height 180 --seed 3"),
    Run(
        "stereo", "synthesize", "--library @library --frames 4 --width 240 --height 180 --seed 3 --stereo-baseline 0.1"
    ),
    Run(
        "driven",
        "synthesize",
        "--library @library --frames 6 --width 160 --height 120 --seed 3 --cameras 3 --path eight --rounds 2 "
        "--rearranged 1",
    ),
    Run("sequence", "ingest", "--log @truth/log.mcap"),
    Run("stereo_sequence", "ingest", "--log @stereo/log.mcap"),
    Run("disparity", "disparity", "--sequence @stereo_sequence"),
    Run("truth_moved", "synthesize", "--library @library --frames 24 --width 160 --height 120 --seed 3 --opened 4"),
    Run("sequence_moved", "ingest", "--log @truth_moved/log.mcap"),
    Run("articulations", "articulate", "--sequence @sequence_moved --frames-seen 2"),
    Run("segments", "segment", "--sequence @sequence --backend ground-truth --corruption 0.2"),
    Run("segments_geometric", "segment", "--sequence @sequence --backend geometric"),
    Run("segments_network", "segment", "--sequence @sequence --backend network"),
    Run("segments_objects", "segment", "--sequence @sequence --backend objects"),
    Run("map", "fuse", "--sequence @sequence --segments @segments --voxel-size 0.04"),
    Run("map_thesis", "fuse", "--sequence @sequence --segments @segments --voxel-size 0.04 --merging thesis"),
    Run("graph", "graph", "--panoptic-map @map"),
    Run("graph_thesis", "graph", "--panoptic-map @map --method thesis"),
    Run("cad", "cad", "--contact-graph @graph --panoptic-map @map --library @library"),
    Run("urdf", "urdf", "--cad-scene @cad"),
    Run("plan", "plan", "--scene @urdf --ground-truth @truth"),
    Run(
        "evaluation",
        "evaluate",
        "--ground-truth @truth --sequence @sequence --segments @segments --panoptic-map @map --contact-graph @graph "
        "--cad-scene @cad --cad-library @library --interactive-scene @urdf --plan @plan",
    ),
    Run(
        "report",
        "report",
        "--ground-truth @truth --sequence @sequence --segments @segments --panoptic-map @map --contact-graph @graph "
        "--cad-scene @cad --cad-library @library --interactive-scene @urdf --plan @plan --evaluation @evaluation",
    ),
    Run("poses", "poses", "--sequence @sequence"),
    Run("splat", "splat build", "--sequence @sequence --width 80 --steps 20 --hold-out-every 8 --refine-poses"),
    Run("splat_thesis", "splat build", "--sequence @sequence --width 80 --steps 20 --method thesis"),
    Run("splat_views", "splat render", "--splat @splat --sequence @sequence --pictures 1"),
    Run("language", "splat language", "--splat @splat --sequence @sequence --steps 5 --most-views 4"),
    Run("labels", "splat label", "--panoptic-map @map --sequence @sequence --most-views 6"),
    Run("asked", "splat query", "--language @language --text cup"),
    Run("asked_graph", "splat query", "--language @labels --contact-graph @graph --text bottle"),
    Run("exported", "export", "--sequence @sequence --layout mcap --dialect ros2"),
    Run("exported_tum", "export", "--sequence @sequence --layout tum"),
    Run("scene_sdf", "export scene", "--to sdf --scene @urdf"),
    Run("scene_usd", "export scene", "--to usd --scene @urdf"),
    Run("scene_moveit", "export scene", "--to moveit --scene @urdf"),
    Run("packing", "pack", "--seed 3"),
    Run("episode", "agent run", "--task move_cup_and_toy --seed 5 --image-width 300"),
    Run("episode_thesis", "agent run", "--task tidy_table --arm thesis --seed 6 --image-width 300"),
    Run("episode_again", "agent replay", "--episode @episode --image-width 300"),
    Run("agent_evaluation", "agent evaluate", "--trials 2"),
    Run("taught", "predicates teach", "--tasks 3 --seed 1"),
    Run(
        "taught_more",
        "predicates teach",
        "--learned @taught --domain set_table --tasks 1 --wording diverse --wrong 0.1",
    ),
    Run("kitchen_plan", "predicates plan", "--learned @taught --which novel_goals --image-width 240"),
    Run("kitchen_evaluation", "predicates evaluate", "--learned @taught --tasks 1 --states 20"),
    Run("table", "tableware scene", "--tier tier0_cups --seed 5"),
    Run("seen", "tableware detect", "@table"),
    Run("table_plan", "tableware plan", "--detections @seen --draws 5 --image-width 300"),
    Run("table_trial", "tableware simulate", "--scene @table --plan @table_plan --image-width 300"),
    Run("table_physics", "tableware simulate", "--scene @table --simulator physics --image-width 300"),
    Run("table_evaluation", "tableware evaluate", "--tier tier2 --scenes 3 --draws 3 --chances thesis_spills"),
    Run("needle_scene", "suture scene", "--frames 2 --seed 2000"),
    Run("needle_disparity", "disparity", SEEN),
    Run("needle", "suture needle", f"{SEEN} --disparity @needle_disparity"),
    Run("needle_thesis", "suture needle", f"{SEEN} --disparity @needle_disparity --estimator thesis"),
    Run("thread", "suture thread", f"{SEEN} --needle @needle"),
    Run("trial", "suture simulate", "--seed 3"),
    Run("suture_evaluation", "suture evaluate", "--trials @trial --scene @needle_scene --needle @needle"),
    Run("cut_shown", "cutting demonstrate", "--share 0.3 --image-width 300 --seed 1"),
    Run("cut_model", "cutting learn", "--demonstrations @cut_shown"),
    Run("cut_plan", "cutting plan", "--model @cut_model --demonstrations @cut_shown --trial 20 --image-width 300"),
    Run("cut_trial", "cutting simulate", "--plan @cut_plan --model @cut_model --image-width 300"),
    Run("cut_evaluation", "cutting evaluate", "--model @cut_model --cells n2m1 --goals 2"),
)
"""`library add`, `truth scenenn` and `truth supports` read what somebody downloaded, `edit ...` what somebody wrote: no
run here."""
