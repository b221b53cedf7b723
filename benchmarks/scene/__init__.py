"""The scene stage by stage against ground truth: contact graph, CAD replacement, physics (`make bench-scene`)."""
