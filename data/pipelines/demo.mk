# Generated from data/pipelines/demo.toml by `make rules`; do not edit. A generated room, reconstructed from its images; a robot acts in it
# No .DELETE_ON_ERROR: an artifact whose outcome is not ok is complete and stays.
PYTHON ?= .venv/bin/python
OUTPUTS ?= outputs
RUN ?= demo
FOLDER := $(OUTPUTS)/$(RUN)
FRAMES ?= 120
RECIPE ?= room
WIDTH ?= 640
HEIGHT ?= 480
SEED ?= 7
CORRUPTION ?= 0.2
VOXEL_SIZE ?= 0.02
SHAPES ?= 4
.PHONY: all
all: $(FOLDER)/cad_library/manifest.json $(FOLDER)/ground_truth/manifest.json $(FOLDER)/sequence/manifest.json $(FOLDER)/segments/manifest.json $(FOLDER)/panoptic_map/manifest.json $(FOLDER)/contact_graph/manifest.json $(FOLDER)/cad_scene/manifest.json $(FOLDER)/interactive_scene/manifest.json $(FOLDER)/plan/manifest.json $(FOLDER)/geometric_segments/manifest.json $(FOLDER)/geometric_map/manifest.json $(FOLDER)/geometric_evaluation/manifest.json $(FOLDER)/evaluation/manifest.json $(FOLDER)/report/manifest.json

$(FOLDER)/cad_library/manifest.json: data/pipelines/demo.toml
	$(PYTHON) -m scenewright library build --shapes-per-class '$(SHAPES)' --small-shapes-per-class '$(SHAPES)' --seed 1 --shared $(FOLDER)/../.shared --out $(FOLDER)/cad_library

$(FOLDER)/ground_truth/manifest.json: data/pipelines/demo.toml $(FOLDER)/cad_library/manifest.json
	$(PYTHON) -m scenewright synthesize --library $(FOLDER)/cad_library --recipe '$(RECIPE)' --frames '$(FRAMES)' --width '$(WIDTH)' --height '$(HEIGHT)' --seed '$(SEED)' --out $(FOLDER)/ground_truth

$(FOLDER)/sequence/manifest.json: data/pipelines/demo.toml $(FOLDER)/ground_truth/manifest.json
	$(PYTHON) -m scenewright ingest --log $(FOLDER)/ground_truth/log.mcap --out $(FOLDER)/sequence

$(FOLDER)/segments/manifest.json: data/pipelines/demo.toml $(FOLDER)/sequence/manifest.json
	$(PYTHON) -m scenewright segment --sequence $(FOLDER)/sequence --backend ground-truth --corruption '$(CORRUPTION)' --out $(FOLDER)/segments

$(FOLDER)/panoptic_map/manifest.json: data/pipelines/demo.toml $(FOLDER)/sequence/manifest.json $(FOLDER)/segments/manifest.json
	$(PYTHON) -m scenewright fuse --sequence $(FOLDER)/sequence --segments $(FOLDER)/segments --voxel-size '$(VOXEL_SIZE)' --out $(FOLDER)/panoptic_map

$(FOLDER)/contact_graph/manifest.json: data/pipelines/demo.toml $(FOLDER)/panoptic_map/manifest.json
	$(PYTHON) -m scenewright graph --panoptic-map $(FOLDER)/panoptic_map --out $(FOLDER)/contact_graph

$(FOLDER)/cad_scene/manifest.json: data/pipelines/demo.toml $(FOLDER)/contact_graph/manifest.json $(FOLDER)/panoptic_map/manifest.json $(FOLDER)/cad_library/manifest.json
	$(PYTHON) -m scenewright cad --contact-graph $(FOLDER)/contact_graph --panoptic-map $(FOLDER)/panoptic_map --library $(FOLDER)/cad_library --out $(FOLDER)/cad_scene

$(FOLDER)/interactive_scene/manifest.json: data/pipelines/demo.toml $(FOLDER)/cad_scene/manifest.json
	$(PYTHON) -m scenewright urdf --cad-scene $(FOLDER)/cad_scene --accept unsettled --accept penetrating --accept nothing_movable --out $(FOLDER)/interactive_scene

$(FOLDER)/plan/manifest.json: data/pipelines/demo.toml $(FOLDER)/interactive_scene/manifest.json $(FOLDER)/ground_truth/manifest.json
	$(PYTHON) -m scenewright plan --scene $(FOLDER)/interactive_scene --ground-truth $(FOLDER)/ground_truth --accept infeasible --accept execution_failed --out $(FOLDER)/plan

$(FOLDER)/geometric_segments/manifest.json: data/pipelines/demo.toml $(FOLDER)/sequence/manifest.json
	$(PYTHON) -m scenewright segment --sequence $(FOLDER)/sequence --backend geometric --out $(FOLDER)/geometric_segments

$(FOLDER)/geometric_map/manifest.json: data/pipelines/demo.toml $(FOLDER)/sequence/manifest.json $(FOLDER)/geometric_segments/manifest.json
	$(PYTHON) -m scenewright fuse --sequence $(FOLDER)/sequence --segments $(FOLDER)/geometric_segments --voxel-size '$(VOXEL_SIZE)' --out $(FOLDER)/geometric_map

$(FOLDER)/geometric_evaluation/manifest.json: data/pipelines/demo.toml $(FOLDER)/ground_truth/manifest.json $(FOLDER)/sequence/manifest.json $(FOLDER)/geometric_segments/manifest.json $(FOLDER)/geometric_map/manifest.json
	$(PYTHON) -m scenewright evaluate --ground-truth $(FOLDER)/ground_truth --sequence $(FOLDER)/sequence --segments $(FOLDER)/geometric_segments --panoptic-map $(FOLDER)/geometric_map --out $(FOLDER)/geometric_evaluation

$(FOLDER)/evaluation/manifest.json: data/pipelines/demo.toml $(FOLDER)/ground_truth/manifest.json $(FOLDER)/sequence/manifest.json $(FOLDER)/segments/manifest.json $(FOLDER)/panoptic_map/manifest.json $(FOLDER)/contact_graph/manifest.json $(FOLDER)/cad_scene/manifest.json $(FOLDER)/cad_library/manifest.json $(FOLDER)/interactive_scene/manifest.json $(FOLDER)/plan/manifest.json
	$(PYTHON) -m scenewright evaluate --ground-truth $(FOLDER)/ground_truth --sequence $(FOLDER)/sequence --segments $(FOLDER)/segments --panoptic-map $(FOLDER)/panoptic_map --contact-graph $(FOLDER)/contact_graph --cad-scene $(FOLDER)/cad_scene --cad-library $(FOLDER)/cad_library --interactive-scene $(FOLDER)/interactive_scene --plan $(FOLDER)/plan --out $(FOLDER)/evaluation

$(FOLDER)/report/manifest.json: data/pipelines/demo.toml $(FOLDER)/ground_truth/manifest.json $(FOLDER)/sequence/manifest.json $(FOLDER)/segments/manifest.json $(FOLDER)/panoptic_map/manifest.json $(FOLDER)/contact_graph/manifest.json $(FOLDER)/cad_scene/manifest.json $(FOLDER)/cad_library/manifest.json $(FOLDER)/interactive_scene/manifest.json $(FOLDER)/plan/manifest.json $(FOLDER)/evaluation/manifest.json $(FOLDER)/geometric_evaluation/manifest.json
	$(PYTHON) -m scenewright report --ground-truth $(FOLDER)/ground_truth --sequence $(FOLDER)/sequence --segments $(FOLDER)/segments --panoptic-map $(FOLDER)/panoptic_map --contact-graph $(FOLDER)/contact_graph --cad-scene $(FOLDER)/cad_scene --cad-library $(FOLDER)/cad_library --interactive-scene $(FOLDER)/interactive_scene --plan $(FOLDER)/plan --evaluation $(FOLDER)/evaluation --baseline-evaluation $(FOLDER)/geometric_evaluation --out $(FOLDER)/report
