"""What a run is worth, said from the facts of its artifacts."""

from __future__ import annotations

from scenewright.stages.report.outlook import Facts, Outlook, outlook

GOOD = {
    "sequence": Facts("ok", {"frames": 30, "dropped": 0, "gravity": "given"}),
    "segments": Facts("ok", {"label": "ground-truth masks"}),
    "panoptic_map": Facts("ok", {"frames": 30, "entities": 12, "frames_without_segments": 0}),
    "contact_graph": Facts("ok", {"objects": 10, "unknown": 0, "dropped": 0, "floor": "seen"}),
    "cad_scene": Facts("ok", {"cad": 10, "mesh": 0, "alignment_error_median": 0.006, "surroundings_m2": 0.5}),
    "interactive_scene": Facts("ok", {"movable": 4, "joints": 2, "collisions": 0, "settled": 1.0}),
}


def changed(role: str, outcome: str = "ok", **summary: object) -> Outlook:
    """The good run with one artifact that says something else."""
    return outlook(GOOD | {role: Facts(outcome, {**GOOD[role].summary, **summary})})


def test_a_good_run_is_said_to_be_one() -> None:
    found = outlook(GOOD)
    assert not found.doubtful and not found.missing
    assert "let go, all 4 movable bodies stay; 2 joints are free at their start" in found.sound
    assert found.advice == ("nothing speaks against acting in it: scenewright plan",)


def test_each_fault_is_named_with_what_to_do() -> None:
    faults = [
        (changed("sequence", dropped=30), "30 of 60 frames could not be used", "inspect LOG"),
        (changed("segments", label="geometry alone, class-agnostic"), "what things are", "--words"),
        (changed("contact_graph", floor="none"), "the floor", "record the floor"),
        (changed("contact_graph", unknown=5), "what 5 of 10 things stand on", "come closer"),
        (changed("cad_scene", cad=1, mesh=9), "9 of 10 things keep their scanned mesh", "walk around"),
        (changed("cad_scene", cad=1, mesh=9, built_in=2), "9 of 12 things keep their scanned mesh", "walk around"),
        (changed("interactive_scene", "unsettled", reason="cup_1 moves 755 mm"), "cup_1 moves 755 mm", "urdf settle"),
        (changed("interactive_scene", "nothing_movable", reason="no body is free"), "no body is free", "masks"),
    ]
    for found, said, advised in faults:
        assert any(said in text for text in found.doubtful + found.missing), said
        assert any(advised in text for text in found.advice), advised


def test_what_is_up_is_that_of_the_path_where_one_was_estimated() -> None:
    unposed = GOOD | {"sequence": Facts("ok", {"frames": 9, "gravity": "none"})}
    assert any("which way is up" in text for text in outlook(unposed).doubtful)
    path = Facts("ok", {"frames": 9, "posed": 9, "gravity": "floor_plane"})
    assert not outlook(unposed | {"trajectory": path}).doubtful
    lost = outlook(
        unposed | {"trajectory": Facts("tracking_lost", {"frames": 9, "posed": 3, "gravity": "mean_camera_up"})}
    )
    assert "6 frames whose place was not found" in lost.missing
    assert any("held upright" in text for text in lost.doubtful) and any("slowly" in text for text in lost.advice)


def test_what_was_not_measured_is_not_praised() -> None:
    """The sentence on collisions stands only where they were counted and are none."""
    apart = "nothing stands more than 5 mm in anything else"
    assert apart in changed("interactive_scene", "unsettled", collisions=0).sound
    assert apart not in changed("interactive_scene", "unsettled", collisions=51).sound
    untried = outlook(GOOD | {"interactive_scene": Facts("ok", {"movable": 4})})
    assert untried.doubtful == ("whether it stays when it is let go: that was not tried",)


def test_it_fits_on_a_screen() -> None:
    lines = changed("segments", label="geometry alone, class-agnostic").lines()
    assert len(lines) <= 24 and all(len(line) <= 120 for line in lines)
    assert outlook({}).lines() == []
