# Generated from data/pipelines/annotated-scan.toml by `make rules`; do not edit. An annotated scan in, an interactive scene and a report out
# No .DELETE_ON_ERROR: an artifact whose outcome is not ok is complete and stays.
PYTHON ?= .venv/bin/python
OUTPUTS ?= outputs
RUN ?= annotated-scan
FOLDER := $(OUTPUTS)/$(RUN)
$(if $(SCAN),,$(error annotated-scan needs SCAN=... (labelled mesh or points: a file, or a scene's folder (docs/MASKS.md))))
UNIT ?= declared
UP ?= declared
VOXEL_SIZE ?= 0.02
SEED ?= 0
$(if $(SCAN),$(if $(wildcard $(SCAN)),,$(error SCAN=$(SCAN): no such file or folder)))
$(if $(LABELS),$(if $(wildcard $(LABELS)),,$(error LABELS=$(LABELS): no such file or folder)))
.PHONY: all
all: $(FOLDER)/panoptic_map/manifest.json $(FOLDER)/contact_graph/manifest.json $(FOLDER)/cad_library/manifest.json $(FOLDER)/cad_scene/manifest.json $(FOLDER)/interactive_scene/manifest.json $(FOLDER)/evaluation/manifest.json $(FOLDER)/report/manifest.json

$(FOLDER)/panoptic_map/manifest.json: data/pipelines/annotated-scan.toml $(SCAN) $(LABELS)
	$(PYTHON) -m scenewright fuse --from-mesh '$(SCAN)' $(if $(LABELS),--labels '$(LABELS)') --voxel-size '$(VOXEL_SIZE)' --unit '$(UNIT)' --up '$(UP)' --out $(FOLDER)/panoptic_map

$(FOLDER)/contact_graph/manifest.json: data/pipelines/annotated-scan.toml $(FOLDER)/panoptic_map/manifest.json
	$(PYTHON) -m scenewright graph --panoptic-map $(FOLDER)/panoptic_map --seed '$(SEED)' --out $(FOLDER)/contact_graph

$(FOLDER)/cad_library/manifest.json: data/pipelines/annotated-scan.toml
	$(PYTHON) -m scenewright library build --seed 1 --shared $(FOLDER)/../.shared --out $(FOLDER)/cad_library

$(FOLDER)/cad_scene/manifest.json: data/pipelines/annotated-scan.toml $(FOLDER)/contact_graph/manifest.json $(FOLDER)/panoptic_map/manifest.json $(FOLDER)/cad_library/manifest.json
	$(PYTHON) -m scenewright cad --contact-graph $(FOLDER)/contact_graph --panoptic-map $(FOLDER)/panoptic_map --library $(FOLDER)/cad_library --seed '$(SEED)' --out $(FOLDER)/cad_scene

$(FOLDER)/interactive_scene/manifest.json: data/pipelines/annotated-scan.toml $(FOLDER)/cad_scene/manifest.json
	$(PYTHON) -m scenewright urdf --cad-scene $(FOLDER)/cad_scene --accept unsettled --accept penetrating --accept nothing_movable --out $(FOLDER)/interactive_scene

$(FOLDER)/evaluation/manifest.json: data/pipelines/annotated-scan.toml $(FOLDER)/panoptic_map/manifest.json $(FOLDER)/contact_graph/manifest.json $(FOLDER)/cad_scene/manifest.json $(FOLDER)/interactive_scene/manifest.json
	$(PYTHON) -m scenewright evaluate --panoptic-map $(FOLDER)/panoptic_map --contact-graph $(FOLDER)/contact_graph --cad-scene $(FOLDER)/cad_scene --interactive-scene $(FOLDER)/interactive_scene --out $(FOLDER)/evaluation

$(FOLDER)/report/manifest.json: data/pipelines/annotated-scan.toml $(FOLDER)/panoptic_map/manifest.json $(FOLDER)/contact_graph/manifest.json $(FOLDER)/cad_scene/manifest.json $(FOLDER)/cad_library/manifest.json $(FOLDER)/interactive_scene/manifest.json $(FOLDER)/evaluation/manifest.json
	$(PYTHON) -m scenewright report --panoptic-map $(FOLDER)/panoptic_map --contact-graph $(FOLDER)/contact_graph --cad-scene $(FOLDER)/cad_scene --cad-library $(FOLDER)/cad_library --interactive-scene $(FOLDER)/interactive_scene --evaluation $(FOLDER)/evaluation --out $(FOLDER)/report
