"""What a mobile robot gets wrong of itself: where its base came to a stop, and where its joints stand.

**Assumed**, for a laser or RGB-D localisation indoors and an industrial arm; nobody measured them on a robot of ours.
"""

from __future__ import annotations

import numpy as np

LOCALISATION, TURNED = 0.008, 0.006
"""Standard deviation of where the base thinks that it stands [m], [rad], drawn at every stop."""
JOINTS = 0.001
"""Standard deviation of each joint's encoder [rad], drawn once."""


def stop_error(random: np.random.Generator) -> np.ndarray:
    """Draw an error of localisation (3,) [m, m, rad]: what is believed less what is true."""
    return random.normal(0, 1, 3) * (LOCALISATION, LOCALISATION, TURNED)


def encoder_errors(random: np.random.Generator, joints: int) -> np.ndarray:
    """Draw what the joints of an arm (J,) stand beside their encoders [rad]."""
    return random.normal(0, JOINTS, joints)
