"""`scenewright inspect LOG`: what is in a log, what is wrong with it, what it is good for."""
