"""The world's free parameters."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class World:
    """The simulator's parameters, the same for every arm. Chosen on tuning seeds 0 to 29 so that the thesis's arms come
    near its published rates, and fixed before `ours` ran; lengths [m], angles [degrees], forces [N].
    """

    thread_shortest: float = 0.15
    thread_longest: float = 0.40
    loading_normal: float = 8.0
    """How far the needle that is handed to the robot first is turned from where it should be, per axis."""
    loading_in_plane: float = 5.0
    hand_eye: float = 0.0005
    """Offset between robot and cameras, per axis, one for a trial."""
    jaw_half_opening: float = 0.0035
    jaw_half_width: float = 0.0022
    jaw_half_depth: float = 0.006
    closing_normal: float = 4.0
    """How far closing jaws turn the needle beyond aligning it with their faces, per axis."""
    closing_in_plane: float = 3.0
    insertion_slip: float = 2.5
    """Slip in the grip under the insertion's torque."""
    knock: float = 6.0
    """How far jaws that miss turn a needle in tissue that they touch."""
    knock_held: float = 1.0
    """The same for a needle that the other driver holds."""
    hold: float = 3.0
    """What a perfect grasp holds against [N]."""
    tissue_friction: float = 0.06
    """Force along the needle per millimetre of it in tissue [N/mm]."""
    tissue_stiffness: float = 0.2
    """Force against a needle that moves sideways in its hole [N/mm]."""
    thread_friction: float = 0.15
    """Force that draws thread through one free hole [N]."""
    capstan: float = 0.22
    """Friction of thread in tissue: each stitch multiplies the force by exp(pi * capstan)."""
    tug_angle_per_millimetre: float = 2.0
    """How far a needle turns in the grip per millimetre that taut thread is short, where it does not draw thread."""
    tug_loses: float = 0.020
    """Taut thread short by more than this pulls the needle out of the jaws."""
    handover_turn: float = 15.0
    """How far the second driver turns the normal of a needle that both hold; a part of it stays."""
    handover_turn_stays: float = 0.2
    pinched_share: float = 0.5
    """What jaws that hold thread too hold of the needle."""
    stitch_noise: float = 0.0015
    """Spread of the thread that a stitch uses."""
    loose: float = 0.006
    """A stitch with more slack than this [m] is not tensioned."""
    winds: float = 0.75
    """Turns of thread about a driver that count as a tangle."""
    sweep_height: float = 0.0035
    sweep_height_noise: float = 0.0015
    speed: float = 0.007
    """Tool speed [m/s]; a turn of the tool counts by its arc at 20 mm."""
    overhead: float = 4.0
    """Seconds that every primitive takes besides moving and seeing (planning, settling, jaws)."""
