"""A pipeline over a data set: scenes x parameter sets x seeds, on this machine or a cluster. docs/BATCH.md.

`expansion` turns the batch file into jobs, `resuming` leaves out what stands, `scheduler` hands the rest to an
executor, `scene_run` runs one, `results` keeps what came of it, `summary` says it to people; `session` ties them.
"""

from scenewright.stages.engine.batch.expansion import Batch, read_batch
from scenewright.stages.engine.batch.outcomes import worst_exit_code

__all__ = ["Batch", "read_batch", "worst_exit_code"]
