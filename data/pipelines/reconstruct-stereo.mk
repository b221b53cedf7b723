# Generated from data/pipelines/reconstruct-stereo.toml by `make rules`; do not edit. A generated room, recorded with two eyes and no depth, reconstructed into an interactive scene
# No .DELETE_ON_ERROR: an artifact whose outcome is not ok is complete and stays.
PYTHON ?= .venv/bin/python
OUTPUTS ?= outputs
RUN ?= reconstruct-stereo
FOLDER := $(OUTPUTS)/$(RUN)
FRAMES ?= 120
RECIPE ?= room
CLUTTER ?= medium
WIDTH ?= 640
HEIGHT ?= 480
BASELINE ?= 0.12
PICTURE_NOISE ?= 2
SEED ?= 7
CORRUPTION ?= 0.2
VOXEL_SIZE ?= 0.02
SHAPES ?= 4
MAXIMUM_DEPTH ?= 4
.PHONY: all
all: $(FOLDER)/cad_library/manifest.json $(FOLDER)/ground_truth/manifest.json $(FOLDER)/stereo_pairs/manifest.json $(FOLDER)/sequence/manifest.json $(FOLDER)/segments/manifest.json $(FOLDER)/panoptic_map/manifest.json $(FOLDER)/contact_graph/manifest.json $(FOLDER)/cad_scene/manifest.json $(FOLDER)/interactive_scene/manifest.json $(FOLDER)/evaluation/manifest.json $(FOLDER)/report/manifest.json

$(FOLDER)/cad_library/manifest.json: data/pipelines/reconstruct-stereo.toml
	$(PYTHON) -m scenewright library build --shapes-per-class '$(SHAPES)' --small-shapes-per-class '$(SHAPES)' --seed 1 --shared $(FOLDER)/../.shared --out $(FOLDER)/cad_library

$(FOLDER)/ground_truth/manifest.json: data/pipelines/reconstruct-stereo.toml $(FOLDER)/cad_library/manifest.json
	$(PYTHON) -m scenewright synthesize --library $(FOLDER)/cad_library --recipe '$(RECIPE)' --clutter '$(CLUTTER)' --frames '$(FRAMES)' --width '$(WIDTH)' --height '$(HEIGHT)' --stereo-baseline '$(BASELINE)' --no-depth --picture-noise '$(PICTURE_NOISE)' --seed '$(SEED)' --out $(FOLDER)/ground_truth

$(FOLDER)/stereo_pairs/manifest.json: data/pipelines/reconstruct-stereo.toml $(FOLDER)/ground_truth/manifest.json
	$(PYTHON) -m scenewright ingest --log $(FOLDER)/ground_truth/log.mcap --out $(FOLDER)/stereo_pairs

$(FOLDER)/sequence/manifest.json: data/pipelines/reconstruct-stereo.toml $(FOLDER)/stereo_pairs/manifest.json
	$(PYTHON) -m scenewright disparity --sequence $(FOLDER)/stereo_pairs --maximum-depth '$(MAXIMUM_DEPTH)' --out $(FOLDER)/sequence

$(FOLDER)/segments/manifest.json: data/pipelines/reconstruct-stereo.toml $(FOLDER)/sequence/manifest.json
	$(PYTHON) -m scenewright segment --sequence $(FOLDER)/sequence --backend ground-truth --corruption '$(CORRUPTION)' --out $(FOLDER)/segments

$(FOLDER)/panoptic_map/manifest.json: data/pipelines/reconstruct-stereo.toml $(FOLDER)/sequence/manifest.json $(FOLDER)/segments/manifest.json
	$(PYTHON) -m scenewright fuse --sequence $(FOLDER)/sequence --segments $(FOLDER)/segments --voxel-size '$(VOXEL_SIZE)' --out $(FOLDER)/panoptic_map

$(FOLDER)/contact_graph/manifest.json: data/pipelines/reconstruct-stereo.toml $(FOLDER)/panoptic_map/manifest.json
	$(PYTHON) -m scenewright graph --panoptic-map $(FOLDER)/panoptic_map --out $(FOLDER)/contact_graph

$(FOLDER)/cad_scene/manifest.json: data/pipelines/reconstruct-stereo.toml $(FOLDER)/contact_graph/manifest.json $(FOLDER)/panoptic_map/manifest.json $(FOLDER)/cad_library/manifest.json
	$(PYTHON) -m scenewright cad --contact-graph $(FOLDER)/contact_graph --panoptic-map $(FOLDER)/panoptic_map --library $(FOLDER)/cad_library --out $(FOLDER)/cad_scene

$(FOLDER)/interactive_scene/manifest.json: data/pipelines/reconstruct-stereo.toml $(FOLDER)/cad_scene/manifest.json
	$(PYTHON) -m scenewright urdf --cad-scene $(FOLDER)/cad_scene --accept unsettled --accept penetrating --accept nothing_movable --out $(FOLDER)/interactive_scene

$(FOLDER)/evaluation/manifest.json: data/pipelines/reconstruct-stereo.toml $(FOLDER)/ground_truth/manifest.json $(FOLDER)/sequence/manifest.json $(FOLDER)/segments/manifest.json $(FOLDER)/panoptic_map/manifest.json $(FOLDER)/contact_graph/manifest.json $(FOLDER)/cad_scene/manifest.json $(FOLDER)/cad_library/manifest.json $(FOLDER)/interactive_scene/manifest.json
	$(PYTHON) -m scenewright evaluate --ground-truth $(FOLDER)/ground_truth --sequence $(FOLDER)/sequence --segments $(FOLDER)/segments --panoptic-map $(FOLDER)/panoptic_map --contact-graph $(FOLDER)/contact_graph --cad-scene $(FOLDER)/cad_scene --cad-library $(FOLDER)/cad_library --interactive-scene $(FOLDER)/interactive_scene --out $(FOLDER)/evaluation

$(FOLDER)/report/manifest.json: data/pipelines/reconstruct-stereo.toml $(FOLDER)/ground_truth/manifest.json $(FOLDER)/sequence/manifest.json $(FOLDER)/segments/manifest.json $(FOLDER)/panoptic_map/manifest.json $(FOLDER)/contact_graph/manifest.json $(FOLDER)/cad_scene/manifest.json $(FOLDER)/cad_library/manifest.json $(FOLDER)/interactive_scene/manifest.json $(FOLDER)/evaluation/manifest.json
	$(PYTHON) -m scenewright report --ground-truth $(FOLDER)/ground_truth --sequence $(FOLDER)/sequence --segments $(FOLDER)/segments --panoptic-map $(FOLDER)/panoptic_map --contact-graph $(FOLDER)/contact_graph --cad-scene $(FOLDER)/cad_scene --cad-library $(FOLDER)/cad_library --interactive-scene $(FOLDER)/interactive_scene --evaluation $(FOLDER)/evaluation --out $(FOLDER)/report
