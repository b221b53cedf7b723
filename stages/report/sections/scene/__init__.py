"""Section `scene`: bodies and the kinematic tree."""
