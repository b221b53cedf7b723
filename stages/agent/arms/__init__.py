"""What an arm may call, and how it looks, grasps and places: the thesis's ways and ours."""
