"""Plan what a robot does in a scene, execute it in physics, and say why when it cannot be done."""
