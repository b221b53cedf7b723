"""`scenewright ask`: what a map or scene answers to words."""
