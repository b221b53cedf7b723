"""Step `urdf`: the functionally equivalent scene as a kinematic tree for simulators and robots."""
