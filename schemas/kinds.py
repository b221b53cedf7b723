"""The table of artifact kinds. Importing this registers every kind in `schemas.artifact.KINDS`."""

from schemas.artifact import KINDS, Artifact
from schemas.cad_library import CadLibrary
from schemas.cad_scene import CadScene
from schemas.contact_graph import ContactGraph
from schemas.disparity import Disparity
from schemas.evaluation import Evaluation, Report
from schemas.exported_sequence import ExportedSequence
from schemas.ground_truth import GroundTruth
from schemas.interactive_scene import InteractiveScene
from schemas.packing import Packing
from schemas.panoptic_map import PanopticMap
from schemas.plan import Plan
from schemas.segments import Segments
from schemas.sequence import Sequence
from schemas.suture_needle import SutureNeedle, SutureThread
from schemas.suture_scene import SutureScene
from schemas.suture_trial import SutureEvaluation, SutureTrial
from schemas.tableware_detections import TablewareDetections
from schemas.tableware_plan import TablewarePlan
from schemas.tableware_scene import TablewareScene
from schemas.tableware_trial import TablewareEvaluation, TablewareTrial
from schemas.trajectory import Trajectory

__all__ = [
    "KINDS",
    "Artifact",
    "CadLibrary",
    "CadScene",
    "ContactGraph",
    "Disparity",
    "Evaluation",
    "ExportedSequence",
    "GroundTruth",
    "InteractiveScene",
    "Packing",
    "PanopticMap",
    "Plan",
    "Report",
    "Segments",
    "Sequence",
    "SutureEvaluation",
    "SutureNeedle",
    "SutureScene",
    "SutureThread",
    "SutureTrial",
    "TablewareDetections",
    "TablewareEvaluation",
    "TablewarePlan",
    "TablewareScene",
    "TablewareTrial",
    "Trajectory",
]
