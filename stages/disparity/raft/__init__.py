"""RAFT-Stereo (Lipson, Teed, Deng: Multilevel Recurrent Field Transforms for Stereo Matching, 3DV 2021), for inference.

Names and shapes of all parameters are those of the authors' checkpoints, so that these load; the code is ours.
"""
