"""Backend `ground-truth`: the labels stream of a generated log, corrupted on request."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.sequence import SequenceFile
from scenewright.schemas.vocabulary import Vocabulary, load_vocabulary
from scenewright.stages.kit.acting.errors import Luck, SegmenterErrors, segmenter_rates
from scenewright.stages.kit.acting.spoiled_masks import MaskView, spoiled
from scenewright.stages.kit.formats.frames import Frame
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.segment.backends.ground_truth import GroundTruthParameters
from scenewright.stages.segment.backends.ground_truth.corruption import corrupt, rates_of_level
from scenewright.stages.segment.choice import BackendRequest
from scenewright.stages.segment.geometric import GeometricFrame
from scenewright.stages.segment.panoptic import PanopticFrame, PanopticMask


class GroundTruthBackend:
    """True masks with a stated level of errors.

    Raises BadInput when the sequence has no labels stream, or no table that says what the labels mean.
    """

    name = "ground-truth"
    streams: tuple[str, ...] = ("depth", "labels")

    def __init__(
        self, sequence: SequenceFile, vocabulary: Vocabulary, level: float, lasting: str = "none", seed: int = 0
    ) -> None:
        if "labels" not in sequence.streams or not sequence.label_table:
            raise BadInput(
                "this sequence has no ground-truth labels",
                hint="use --backend detector with --weights, or --backend geometric (class-agnostic)",
            )
        self.corruption = level
        self.label = f"ground-truth masks, corruption {level:g}"
        if lasting != "none":
            self.label = f"ground-truth masks, lasting errors of a {lasting}"
        self._rates = rates_of_level(level)
        self._corrupted = level > 0
        self._masks: dict[int, PanopticMask] = {}
        stuff: dict[int, int] = {}
        self._lookup = np.zeros(1 << 16, dtype=np.int32)
        for entry in sequence.label_table:
            semantic = vocabulary.by_name(entry.class_name)
            # Masks are numbered 1..n, whatever the log's instance numbers are: the overlap tables stay small.
            mask_id = len(self._masks) + 1
            if semantic.kind == "stuff":
                # A stuff class has one instance label: every wall is the wall.
                mask_id = stuff.setdefault(semantic.id, mask_id)
            self._lookup[entry.instance] = mask_id
            self._masks[mask_id] = PanopticMask(semantic.id, semantic.kind == "thing")
        self._lookup[0] = 0
        # Classes that came after `object` take no part, so that a seed keeps its confusions as the vocabulary grows.
        named = [c for c in vocabulary.classes if c.id < vocabulary.by_name("object").id]
        self._classes = {
            True: tuple(c.id for c in named if c.kind == "thing"),
            False: tuple(c.id for c in named if c.kind == "stuff"),
        }
        self._ids = {entry.name: entry.id for entry in vocabulary.classes if entry.kind == "thing"}
        self._lasting = None
        if lasting != "none":
            self._lasting = SegmenterErrors(segmenter_rates(lasting), Luck(seed), self._ids)

    def __call__(self, frame: Frame, geometric: GeometricFrame, random: np.random.Generator) -> PanopticFrame:
        """Return the masks of a frame. Raises BadInput when the frame has no labels."""
        if frame.labels is None:
            raise BadInput(f"frame {frame.index} has no labels image", hint="synthesize the log again")
        ids = self._lookup[frame.labels]
        present = set(np.unique(ids).tolist()) - {0}
        true = PanopticFrame(ids=ids, masks={i: self._masks[i] for i in sorted(present)})
        if self._lasting is not None:
            return self._with_lasting_errors(true, frame, geometric, self._lasting)
        return corrupt(true, self._rates, self._classes, random) if self._corrupted else true

    def _with_lasting_errors(
        self, true: PanopticFrame, frame: Frame, geometric: GeometricFrame, errors: SegmenterErrors
    ) -> PanopticFrame:
        pose = np.eye(4) if frame.world_from_camera is None else frame.world_from_camera
        seen = frame.depth > 0 if frame.depth is not None else np.zeros(true.ids.shape, bool)
        class_names = {number: name for name, number in self._ids.items()}
        things = {k: class_names[mask.class_id] for k, mask in true.masks.items() if mask.is_thing}
        bare = (true.ids > 0) & ~np.isin(true.ids, list(things))
        view = MaskView(apply(pose, geometric.points), seen, bare, pose[:3, 3], frame.index)
        ids, told = spoiled(true.ids, things, view, errors, max(self._masks, default=0) + 1)
        masks = {k: PanopticMask(self._ids[name], True) for k, name in told.items()}
        stuff = set(np.unique(ids).tolist()) & (set(true.masks) - set(things))
        return PanopticFrame(ids, masks | {k: true.masks[k] for k in stuff})


def open_backend(request: BackendRequest) -> GroundTruthBackend:
    """Return the backend that the request asks for. Raises UsageError without a log, BadInput as the class does."""
    sequence, _ = request.log()
    own = request.own(GroundTruthParameters)
    return GroundTruthBackend(sequence.info, load_vocabulary(), own.corruption, own.lasting, request.seed)
