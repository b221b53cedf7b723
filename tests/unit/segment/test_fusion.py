"""The thesis's fusion rules against label images made by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scenewright.stages.segment import fusion_ours, fusion_thesis
from scenewright.stages.segment.claims import claim_unlabelled
from scenewright.stages.segment.clustering import clouds_touch, largest_cluster
from scenewright.stages.segment.fusion import (
    FusionRule,
    FusionSettings,
    far_from_instance,
    majority_labels,
    overlap_table,
    split_contained,
)
from scenewright.stages.segment.fusion_ours import has_core, reach_of
from scenewright.stages.segment.overlaps import pixels_of_labels
from scenewright.stages.segment.panoptic import PanopticFrame, PanopticMask

HEIGHT, WIDTH = 480, 640
SETTINGS = FusionSettings()
THING = PanopticMask(class_id=17, is_thing=True, score=0.9)
OTHER = PanopticMask(class_id=5, is_thing=True, score=0.8)
STUFF = PanopticMask(class_id=1, is_thing=False)


def image(*rectangles: tuple[int, int, int, int, int]) -> np.ndarray:
    """Labels (480, 640) with rectangles (label, top, left, bottom, right), later ones on top."""
    labels = np.zeros((HEIGHT, WIDTH), dtype=np.int32)
    for label, top, left, bottom, right in rectangles:
        labels[top:bottom, left:right] = label
    return labels


def points(depth: np.ndarray | float = 1.0) -> np.ndarray:
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH]
    z = np.broadcast_to(np.asarray(depth, dtype=np.float32), (HEIGHT, WIDTH))
    return np.stack([(u - 320) / 500 * z, (v - 240) / 500 * z, z], axis=-1).astype(np.float32)


def pixels_of(labels: np.ndarray) -> tuple[np.ndarray, int]:
    return np.flatnonzero(labels == 1), WIDTH


def by_category(fused, category: int) -> np.ndarray:
    return np.isin(fused.ids, [segment.id for segment in fused.segments if segment.class_id == category])


def test_overlap_table_counts_pixels() -> None:
    geometric, panoptic = image((1, 0, 0, 10, 10), (2, 0, 10, 10, 20)), image((3, 0, 5, 10, 15))
    table = overlap_table(geometric, panoptic)
    assert table.shape == (3, 4)
    assert table[1, 3] == 50 and table[2, 3] == 50 and table[1, 0] == 50 and table.sum() == HEIGHT * WIDTH


@pytest.mark.parametrize("fuse", [fusion_thesis.fuse, fusion_ours.fuse])
def test_a_contained_mask_is_split_out(fuse: FusionRule) -> None:
    """The keyboard of figure 2.2: flat on the desk, no crease, yet recognised."""
    geometric = image((1, 200, 100, 400, 500))
    keyboard = (2, 280, 250, 320, 350)
    panoptic = PanopticFrame(image((1, 200, 100, 400, 500), keyboard), {1: OTHER, 2: THING})
    fused = fuse(geometric, panoptic, points(), SETTINGS)
    assert np.array_equal(by_category(fused, 17), image((1, *keyboard[1:])) == 1)
    assert by_category(fused, 5).sum() == 200 * 400 - 40 * 100
    assert sorted(segment.instance for segment in fused.segments) == [1, 2]
    assert {segment.score for segment in fused.segments} == {0.9, 0.8}


def test_split_needs_more_than_90_percent_inside() -> None:
    geometric = image((1, 100, 100, 300, 300), (2, 100, 300, 300, 500))
    for inside, splits in ((91, True), (90, False), (89, False)):
        mask = image((1, 150, 300 - inside, 160, 400 - inside))
        result = split_contained(geometric, mask, contained_share=0.9, largest_part=0.5)
        assert (int(result.max()) == 3) == splits, inside


def test_split_needs_less_than_half_of_the_segment() -> None:
    geometric = image((1, 100, 100, 200, 200))
    for width, splits in ((49, True), (50, False), (51, False)):
        mask = image((1, 100, 100, 200, 100 + width))
        result = split_contained(geometric, mask, contained_share=0.9, largest_part=0.5)
        assert (int(result.max()) == 2) == splits, width


def test_majority_needs_a_fifth() -> None:
    geometric = image((1, 0, 0, 100, 100), (2, 0, 200, 100, 300))
    panoptic = image((1, 0, 0, 100, 20), (2, 0, 200, 100, 219))
    assert majority_labels(geometric, panoptic, majority_share=0.2).tolist() == [0, 1, 0]


def test_majority_takes_the_larger_share_and_ties_the_smaller_id() -> None:
    geometric = image((1, 0, 0, 100, 100), (2, 0, 200, 100, 300))
    panoptic = image((1, 0, 0, 100, 40), (2, 0, 40, 100, 90), (4, 0, 200, 100, 250), (3, 0, 250, 100, 300))
    assert majority_labels(geometric, panoptic, majority_share=0.2).tolist() == [0, 2, 3]


def test_geometry_completes_a_mask() -> None:
    geometric = image((1, 100, 100, 300, 300))
    panoptic = PanopticFrame(image((1, 100, 100, 300, 220)), {1: THING})
    fused = fusion_thesis.fuse(geometric, panoptic, points(), SETTINGS)
    assert by_category(fused, 17).sum() == 200 * 200


def test_far_background_leaves_the_instance() -> None:
    """The floor behind the chair that the mask took along."""
    geometric = image((1, 100, 100, 300, 200), (2, 100, 200, 200, 300))
    depth = np.where(geometric == 2, 3.0, 1.0)
    panoptic = PanopticFrame(image((1, 100, 100, 300, 300)), {1: THING})
    fused = fusion_thesis.fuse(geometric, panoptic, points(depth), SETTINGS)
    assert np.array_equal(by_category(fused, 17), geometric == 1)
    background = [segment for segment in fused.segments if segment.class_id == 0]
    assert len(background) == 1 and background[0].instance == 0 and background[0].area == 100 * 100
    near = fusion_thesis.fuse(geometric, panoptic, points(np.where(geometric == 2, 1.04, 1.0)), SETTINGS)
    assert by_category(near, 17).sum() == 200 * 100 + 100 * 100


def test_stuff_is_not_clustered() -> None:
    geometric = image((1, 100, 100, 300, 200), (2, 100, 400, 300, 500))
    panoptic = PanopticFrame(image((1, 100, 100, 300, 500)), {1: STUFF})
    fused = fusion_thesis.fuse(geometric, panoptic, points(), SETTINGS)
    assert by_category(fused, 1).sum() == 2 * 200 * 100
    assert {segment.instance for segment in fused.segments} == {1}


def test_chains_hang_together() -> None:
    clouds = [np.array([[x, 0.0, 1.0]]) for x in (0.0, 0.04, 0.08, 1.0)]
    assert largest_cluster(clouds, [1, 1, 1, 2], distance=0.05) == {0, 1, 2}
    assert largest_cluster(clouds, [1, 1, 1, 4], distance=0.05) == {3}
    assert largest_cluster(clouds, [1, 1, 1, 3], distance=0.05) == {0, 1, 2}, "of equal clusters the first"


@given(
    arrays(float, (6, 3), elements=st.floats(-1, 1, width=32)),
    arrays(float, (5, 3), elements=st.floats(-1, 1, width=32)),
    st.floats(0.01, 1),
)
@settings(max_examples=60, deadline=None)
def test_clouds_touch_as_brute_force_says(first: np.ndarray, second: np.ndarray, distance: float) -> None:
    nearest = float(np.linalg.norm(first[:, None] - second[None], axis=-1).min())
    if abs(nearest - distance) > 1e-9:
        assert clouds_touch(first, second, distance) == (nearest < distance)


def test_far_segments_are_judged_by_pixels_not_by_samples() -> None:
    labels = image((1, 0, 0, 40, 100), (2, 200, 0, 240, 101), (3, 40, 0, 41, 100))
    removed = far_from_instance(pixels_of_labels(labels), [1, 2, 3], points(), distance=0.05, step=5)
    assert removed == [2], "1 and 3 together have more points than 2"
    labels = image((1, 0, 0, 40, 100), (2, 200, 0, 240, 105), (3, 40, 0, 41, 100))
    assert far_from_instance(pixels_of_labels(labels), [1, 2, 3], points(), distance=0.05, step=5) == [1, 3]


def test_small_segments() -> None:
    small = (2, 10, 10, 30, 49)  # 780 pixels
    geometric = image((1, 100, 100, 300, 300), small)
    cup = PanopticFrame(image((1, *small[1:])), {1: THING})
    nothing = PanopticFrame(image(), {})
    assert not fusion_thesis.fuse(geometric, cup, points(), SETTINGS).ids[10:30, 10:49].any(), "the thesis discards it"
    assert by_category(fusion_ours.fuse(geometric, cup, points(), SETTINGS), 17).sum() == 780
    assert not fusion_ours.fuse(geometric, nothing, points(), SETTINGS).ids[10:30, 10:49].any()
    lower = replace(SETTINGS, minimum_pixels=780)
    assert fusion_thesis.fuse(geometric, nothing, points(), lower).ids[10:30, 10:49].all()


def test_two_things_without_a_crease() -> None:
    geometric = image((1, 100, 100, 300, 500), (2, 100, 500, 300, 560))
    panoptic = PanopticFrame(image((1, 100, 100, 300, 320), (2, 100, 320, 300, 560)), {1: THING, 2: OTHER})
    thesis, ours = (rule.fuse(geometric, panoptic, points(), SETTINGS) for rule in (fusion_thesis, fusion_ours))
    assert by_category(thesis, 17).sum() == 200 * 400, "three quarters of the second mask are not contained"
    assert by_category(ours, 17).sum() == 200 * 220 and by_category(ours, 5).sum() == 200 * 240


def test_ours_gives_a_mask_the_pixels_that_no_segment_holds() -> None:
    """A cup too small for a geometric segment, and the far background that its mask took along."""
    geometric = image((1, 200, 100, 400, 500))
    panoptic = PanopticFrame(image((1, 200, 100, 400, 500), (2, 170, 200, 200, 230)), {1: OTHER, 2: THING})
    depth = np.where(image((1, 170, 222, 200, 230)) == 1, 3.0, 1.0)
    ours, thesis = (rule.fuse(geometric, panoptic, points(depth), SETTINGS) for rule in (fusion_ours, fusion_thesis))
    assert not by_category(thesis, 17).any()
    assert np.array_equal(by_category(ours, 17), image((1, 170, 200, 200, 222)) == 1)
    assert by_category(ours, 0)[170:200, 222:230].all(), "the far part is background"


def test_claims_follow_masks_and_jumps() -> None:
    claims = np.array([[1, 1, 2, 2, 1], [1, 1, 2, 2, 1]], dtype=np.int32)
    geometric = np.zeros_like(claims)
    flat = np.ones(claims.shape, dtype=np.float32)
    assert claim_unlabelled(geometric, claims, flat, minimum_pixels=2).tolist() == [[1, 1, 2, 2, 3]] * 2
    assert claim_unlabelled(geometric, claims, flat, minimum_pixels=3).tolist() == [[1, 1, 2, 2, 0]] * 2
    step = flat + np.array([0, 0.5, 0, 0, 0], dtype=np.float32)
    assert claim_unlabelled(geometric, claims, step, minimum_pixels=2).tolist() == [[1, 2, 3, 3, 4]] * 2
    held = np.array([[5, 0, 0, 0, 0]] * 2, dtype=np.int32)
    assert claim_unlabelled(held, claims, flat, minimum_pixels=2).tolist() == [[5, 6, 7, 7, 8]] * 2


def test_mask_pixels_without_depth_do_not_count() -> None:
    geometric = image((1, 100, 100, 300, 300))
    depth = np.where(geometric == 1, 1.0, 0.0)
    # A third of the mask lies where there is no depth: of what has depth, all is inside.
    panoptic = PanopticFrame(image((1, 150, 80, 200, 140)), {1: THING})
    fused = fusion_thesis.fuse(geometric, panoptic, points(depth), SETTINGS)
    assert by_category(fused, 17).sum() == 50 * 40


def test_an_empty_frame() -> None:
    fused = fusion_ours.fuse(image(), PanopticFrame(image(), {}), points(0.0), SETTINGS)
    assert not fused.ids.any() and fused.segments == ()


def test_ids_are_numbered_in_order_and_areas_add_up() -> None:
    geometric = image((7, 300, 0, 480, 640), (3, 0, 0, 200, 300), (5, 0, 300, 200, 640))
    panoptic = PanopticFrame(image((4, 0, 0, 200, 640), (2, 300, 0, 480, 640)), {4: THING, 2: STUFF})
    fused = fusion_ours.fuse(geometric, panoptic, points(), SETTINGS)
    assert [segment.id for segment in fused.segments] == [1, 2, 3]
    assert fused.ids[0, 0] == 1 and fused.ids[0, 639] == 2 and fused.ids[479, 0] == 3
    assert [segment.instance for segment in fused.segments] == [1, 1, 2]
    assert sum(segment.area for segment in fused.segments) == (fused.ids > 0).sum()


def test_pixel_counts_follow_the_area_of_the_image() -> None:
    geometric = image((1, 100, 100, 128, 128))[::2, ::2]  # 784 pixels become 196, the limit 800 becomes 200
    nothing = PanopticFrame(np.zeros_like(geometric), {})
    assert not fusion_thesis.fuse(geometric, nothing, points()[::2, ::2], SETTINGS).ids.any()
    larger = image((1, 100, 100, 130, 130))[::2, ::2]  # 900 become 225
    assert (fusion_thesis.fuse(larger, nothing, points()[::2, ::2], SETTINGS).ids > 0).sum() == 225


def test_a_rim_has_no_core_and_a_patch_has() -> None:
    assert not has_core(*pixels_of(image((1, 100, 100, 104, 400))), 60)
    assert has_core(*pixels_of(image((1, 100, 100, 110, 140))), 60)
    assert has_core(*pixels_of(image((1, 100, 100, 110, 115))), 66) and not has_core(
        *pixels_of(image((1, 100, 100, 110, 115))), 67
    )
    assert has_core(*pixels_of(image((1, 0, 0, 10, 40))), 60), "the edge of the image is an outline as any other"


def test_the_foot_of_a_monitor_leaves_the_desk_and_a_rim_does_not() -> None:
    """A part that is small beside both the desk and its mask is a thing's when it is no mere rim."""
    desk = (1, 240, 0, 480, 640)
    screen = (2, 40, 200, 200, 440)
    geometric = image(desk, screen)
    for foot, leaves in (((2, 260, 290, 275, 350), True), ((2, 240, 200, 243, 440), False)):
        panoptic = PanopticFrame(image(desk, screen, foot), {1: OTHER, 2: THING})
        found = by_category(fusion_ours.fuse(geometric, panoptic, points(), SETTINGS), 17)
        assert found[foot[1] + 1, foot[2] + 20] == leaves, foot
        thesis = by_category(fusion_thesis.fuse(geometric, panoptic, points(), SETTINGS), 17)
        assert not thesis[foot[1] + 1, foot[2] + 20]


def test_parts_may_lie_as_far_apart_as_the_thing_is_large() -> None:
    small = np.array([[0.0, 0.0, 1.0], [0.05, 0.05, 1.0]])
    assert reach_of(small) == pytest.approx(0.5 * 0.9 * np.hypot(0.05, 0.05))
    assert reach_of(np.array([[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0]])) == 0.2
    assert reach_of(np.array([[0.0, 0.0, 8.0]])) == pytest.approx(0.24)


def test_the_foot_of_a_lamp_stays_with_its_shade() -> None:
    shade, foot = (1, 100, 270, 200, 370), (2, 240, 290, 270, 350)
    geometric = image(shade, foot)
    panoptic = PanopticFrame(np.where(geometric > 0, 1, 0).astype(np.int32), {1: THING})
    assert by_category(fusion_ours.fuse(geometric, panoptic, points(), SETTINGS), 17)[255, 320]
    assert not by_category(fusion_thesis.fuse(geometric, panoptic, points(), SETTINGS), 17)[255, 320]
