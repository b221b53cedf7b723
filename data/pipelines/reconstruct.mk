# Generated from data/pipelines/reconstruct.toml by `make rules`; do not edit. An RGB-D log in, an interactive scene and a report out
# No .DELETE_ON_ERROR: an artifact whose outcome is not ok is complete and stays.
PYTHON ?= .venv/bin/python
OUTPUTS ?= outputs
RUN ?= reconstruct
FOLDER := $(OUTPUTS)/$(RUN)
$(if $(LOG),,$(error reconstruct needs LOG=... (log file or folder)))
BACKEND ?= auto
VOXEL_SIZE ?= 0.02
EVERY ?= 1
FORMAT ?= auto
POSE_CONVENTION ?= as-is
SEED ?= 0
$(if $(LOG),$(if $(wildcard $(LOG)),,$(error LOG=$(LOG): no such file or folder)))
$(if $(MASKS),$(if $(wildcard $(MASKS)),,$(error MASKS=$(MASKS): no such file or folder)))
$(if $(LABELS),$(if $(wildcard $(LABELS)),,$(error LABELS=$(LABELS): no such file or folder)))
.PHONY: all
all: $(FOLDER)/sequence/manifest.json $(FOLDER)/segments/manifest.json $(FOLDER)/articulations/manifest.json $(FOLDER)/panoptic_map/manifest.json $(FOLDER)/contact_graph/manifest.json $(FOLDER)/cad_library/manifest.json $(FOLDER)/cad_scene/manifest.json $(FOLDER)/interactive_scene/manifest.json $(FOLDER)/evaluation/manifest.json $(FOLDER)/report/manifest.json

$(FOLDER)/sequence/manifest.json: data/pipelines/reconstruct.toml $(LOG)
	$(PYTHON) -m scenewright ingest --log '$(LOG)' --format '$(FORMAT)' $(if $(CAMERA),--camera '$(CAMERA)') --every '$(EVERY)' $(if $(MAX_FRAMES),--max-frames '$(MAX_FRAMES)') $(if $(DEPTH_SCALE),--depth-scale '$(DEPTH_SCALE)') $(if $(DEPTH_BITS),--depth-bits '$(DEPTH_BITS)') $(if $(FRAME_RATE),--frame-rate '$(FRAME_RATE)') $(if $(POSE_SCALE),--pose-scale '$(POSE_SCALE)') --pose-convention '$(POSE_CONVENTION)' $(if $(FX),--fx '$(FX)') $(if $(FY),--fy '$(FY)') $(if $(CX),--cx '$(CX)') $(if $(CY),--cy '$(CY)') --out $(FOLDER)/sequence

$(FOLDER)/segments/manifest.json: data/pipelines/reconstruct.toml $(FOLDER)/sequence/manifest.json $(wildcard $(WEIGHTS)) $(wildcard $(SEMANTIC_WEIGHTS)) $(MASKS) $(LABELS)
	$(PYTHON) -m scenewright segment --sequence $(FOLDER)/sequence $(if $(WEIGHTS),--weights '$(WEIGHTS)') $(if $(SEMANTIC_WEIGHTS),--semantic-weights '$(SEMANTIC_WEIGHTS)') $(if $(MASKS),--masks '$(MASKS)') $(if $(LABELS),--labels '$(LABELS)') --backend '$(BACKEND)' --seed '$(SEED)' --out $(FOLDER)/segments

$(FOLDER)/articulations/manifest.json: data/pipelines/reconstruct.toml $(FOLDER)/sequence/manifest.json
	$(PYTHON) -m scenewright articulate --sequence $(FOLDER)/sequence --out $(FOLDER)/articulations

$(FOLDER)/panoptic_map/manifest.json: data/pipelines/reconstruct.toml $(FOLDER)/sequence/manifest.json $(FOLDER)/segments/manifest.json $(FOLDER)/articulations/manifest.json
	$(PYTHON) -m scenewright fuse --sequence $(FOLDER)/sequence --segments $(FOLDER)/segments --articulations $(FOLDER)/articulations --voxel-size '$(VOXEL_SIZE)' --out $(FOLDER)/panoptic_map

$(FOLDER)/contact_graph/manifest.json: data/pipelines/reconstruct.toml $(FOLDER)/panoptic_map/manifest.json
	$(PYTHON) -m scenewright graph --panoptic-map $(FOLDER)/panoptic_map --seed '$(SEED)' --out $(FOLDER)/contact_graph

$(FOLDER)/cad_library/manifest.json: data/pipelines/reconstruct.toml
	$(PYTHON) -m scenewright library build --seed 1 --shared $(FOLDER)/../.shared --out $(FOLDER)/cad_library

$(FOLDER)/cad_scene/manifest.json: data/pipelines/reconstruct.toml $(FOLDER)/contact_graph/manifest.json $(FOLDER)/panoptic_map/manifest.json $(FOLDER)/cad_library/manifest.json $(FOLDER)/articulations/manifest.json
	$(PYTHON) -m scenewright cad --contact-graph $(FOLDER)/contact_graph --panoptic-map $(FOLDER)/panoptic_map --library $(FOLDER)/cad_library --articulations $(FOLDER)/articulations --seed '$(SEED)' --out $(FOLDER)/cad_scene

$(FOLDER)/interactive_scene/manifest.json: data/pipelines/reconstruct.toml $(FOLDER)/cad_scene/manifest.json
	$(PYTHON) -m scenewright urdf --cad-scene $(FOLDER)/cad_scene --accept unsettled --accept penetrating --accept nothing_movable --out $(FOLDER)/interactive_scene

$(FOLDER)/evaluation/manifest.json: data/pipelines/reconstruct.toml $(FOLDER)/sequence/manifest.json $(FOLDER)/segments/manifest.json $(FOLDER)/panoptic_map/manifest.json $(FOLDER)/contact_graph/manifest.json $(FOLDER)/cad_scene/manifest.json $(FOLDER)/interactive_scene/manifest.json
	$(PYTHON) -m scenewright evaluate --sequence $(FOLDER)/sequence --segments $(FOLDER)/segments --panoptic-map $(FOLDER)/panoptic_map --contact-graph $(FOLDER)/contact_graph --cad-scene $(FOLDER)/cad_scene --interactive-scene $(FOLDER)/interactive_scene --out $(FOLDER)/evaluation

$(FOLDER)/report/manifest.json: data/pipelines/reconstruct.toml $(FOLDER)/sequence/manifest.json $(FOLDER)/segments/manifest.json $(FOLDER)/panoptic_map/manifest.json $(FOLDER)/contact_graph/manifest.json $(FOLDER)/cad_scene/manifest.json $(FOLDER)/cad_library/manifest.json $(FOLDER)/interactive_scene/manifest.json $(FOLDER)/evaluation/manifest.json
	$(PYTHON) -m scenewright report --sequence $(FOLDER)/sequence --segments $(FOLDER)/segments --panoptic-map $(FOLDER)/panoptic_map --contact-graph $(FOLDER)/contact_graph --cad-scene $(FOLDER)/cad_scene --cad-library $(FOLDER)/cad_library --interactive-scene $(FOLDER)/interactive_scene --evaluation $(FOLDER)/evaluation --out $(FOLDER)/report
