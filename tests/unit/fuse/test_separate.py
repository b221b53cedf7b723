"""Counting classes and instances apart: the rule of Voxblox++, beside the joint one on the same history."""

from __future__ import annotations

import numpy as np
from scenewright.stages.fuse.association import Prediction, associate_instances
from scenewright.stages.fuse.counts import TripleCounts
from scenewright.stages.fuse.extraction import class_of_instances
from scenewright.stages.fuse.separate import SeparateCounts, associate_separately

CHAIR, TABLE = 3, 4


def test_an_instance_wins_across_classes_where_the_joint_count_keeps_them_apart():
    joint, apart = TripleCounts(), SeparateCounts()
    for counts in (joint, apart):
        counts.add(1, CHAIR, 7, 5)
        counts.add(1, TABLE, 9, 6)
        counts.add(1, CHAIR, 9, 2)
    # Chair leads 7 to 6. Within chair it is instance 7; apart, instance 9 was seen eight times with any class.
    assert joint.best(1) == (CHAIR, 7)
    assert apart.best(1) == (CHAIR, 9)
    assert apart.instances(1, CHAIR) == {7: 5, 9: 8} == apart.instances(1, TABLE)
    chair = [Prediction(1, CHAIR, 1)]
    assert associate_instances(chair, joint, 20) == ({(1, CHAIR): 7}, 20)
    assert associate_separately(chair, [], apart, 20) == ({(1, CHAIR): 9}, 20)


def test_the_first_segment_decides_and_the_background_keeps_its_instance():
    counts = SeparateCounts()
    counts.add(1, CHAIR, 7, 5)
    counts.add(2, CHAIR, 8, 9)
    both = [Prediction(1, CHAIR, 1), Prediction(2, CHAIR, 1)]
    assert associate_separately(both, [], counts, 20) == ({(1, CHAIR): 7}, 20)
    # Instance 7 leads on segment 1, which nothing was predicted on: the prediction on 2 may have 8, not 7.
    counts.add(2, CHAIR, 7, 90)
    assert associate_separately([Prediction(2, CHAIR, 1)], [1], counts, 20) == ({(1, CHAIR): 8}, 20)
    assert associate_separately([Prediction(5, TABLE, 1)], [], counts, 20) == ({(1, TABLE): 20}, 21)


def test_the_class_of_an_instance_is_that_of_most_predictions_on_its_labels():
    counts = SeparateCounts()
    counts.add(1, CHAIR, 7, 5)
    counts.add(2, TABLE, 7, 6)
    counts.add(3, CHAIR, 7, 2)
    class_of = np.array([0, CHAIR, TABLE, CHAIR], dtype=np.int32)
    instance_of = np.array([0, 7, 7, 7], dtype=np.int32)
    assert class_of_instances(counts, class_of, instance_of) == {7: CHAIR}
