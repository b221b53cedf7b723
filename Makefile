SHELL := bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help
# No .DELETE_ON_ERROR: an artifact whose outcome is not ok is complete and stays.

VENV := .venv
PYTHON := $(VENV)/bin/python
STAMP := $(VENV)/.installed
OUTPUTS ?= outputs
# Where pip finds torch, for machines on which it would bring a CUDA build (for example https://.../whl/cpu).
TORCH_INDEX ?=
PIPELINES := $(sort $(patsubst data/pipelines/%.toml,%,$(wildcard data/pipelines/*.toml)))

.PHONY: help
help: ## List the targets
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | column -t -s $$'\t'
	@echo; echo "Pipelines (make NAME RUN=folder VARIABLE=value ...):"
	@for name in $(PIPELINES); do printf '  %-14s %s\n' $$name "$$(sed -n 's/^summary = "\(.*\)"/\1/p' data/pipelines/$$name.toml)"; done

# ---- installation -------------------------------------------------------------------------------------------------

.PHONY: setup
setup: $(STAMP) ## Create .venv from requirements.lock when it is missing or stale (BASE_PYTHON=python3.12)

$(STAMP): requirements.lock pyproject.toml data/setup.sh
	TORCH_INDEX="$(TORCH_INDEX)" BASE_PYTHON="$(BASE_PYTHON)" bash data/setup.sh $(VENV)
	touch $@

INSTALL := $(PYTHON) -m pip --disable-pip-version-check install --quiet -r

.PHONY: development extras
development: $(VENV)/.development ## Install what tests, lint, site and notebooks need

$(VENV)/.development: requirements-dev.lock $(STAMP)
	$(INSTALL) requirements-dev.lock
	touch $@

extras: $(VENV)/.extras ## Install the extras too: Rerun, Ray, atheris, transformers, ONNX Runtime

$(VENV)/.extras: requirements-extras.lock $(VENV)/.development
	$(INSTALL) requirements-extras.lock
	touch $@

NAMES_OF = $$(cat $(1) | sed 's/==.*//; s/^/--exclude /')
# Two have no package for Linux on ARM; what needs them says so.
MARKED = sed -E 's/\+cpu$$//; s/^(pycolmap|embreex)==.*/&; platform_machine != "aarch64"/'

.PHONY: lock
lock: development ## Write requirements.lock and requirements-dev.lock from what is installed
	$(PYTHON) -m pip freeze --exclude-editable -r requirements-dev.lock | sed '/^##/,$$d' > requirements-dev.lock.new
	mv requirements-dev.lock.new requirements-dev.lock
	$(PYTHON) -m pip freeze --all --exclude-editable --exclude scenewright --exclude pip $(call NAMES_OF,requirements-dev.lock requirements-extras.lock) | $(MARKED) > requirements.lock

# ---- checks -------------------------------------------------------------------------------------------------------

.PHONY: test test-all test-slice fuzz lint format rules
TEST_JOBS ?= 2
PYTEST := OMP_NUM_THREADS=1 $(PYTHON) -m pytest -n $(TEST_JOBS) --dist loadfile $(OPTIONS)
test: development ## Run the tests in a drawn order (OPTIONS=--randomly-seed=7 repeats one; TEST_JOBS=2)
	$(PYTEST)

test-all: extras ## Run the slow tests and those of the extras too
	$(PYTEST) -m ''

# The hash of a commit is as good as a drawn number: of SLICES slices, twelve landings run nine tenths.
SLICES := 6
test-slice: extras ## Run the slice of the slow tests that the commit's hash draws
	$(PYTEST) -m slow --slice $$((16#$$(git rev-parse HEAD | cut -c1-7) % $(SLICES)))/$(SLICES)

SECONDS_EACH ?= 60
MINUTES ?= 10
SEED ?= 0
fuzz: extras ## Fuzz the commands (MINUTES=10 of processor time, SEED=0), then every parser with coverage guidance (SECONDS_EACH=60)
	$(PYTHON) -m tests.fuzz.commands.run --minutes $(MINUTES) --seed $(SEED)
	$(PYTHON) -m tests.fuzz.run --seconds $(SECONDS_EACH)

lint: development ## Format and lint check, types, who may import whom
	$(PYTHON) -m ruff format --check .
	$(PYTHON) -m ruff check .
	$(PYTHON) -m tests.wheel_layout .mypy_cache/packages
	$(PYTHON) -m mypy
	$(PYTHON) -m pytest -p no:cacheprovider tests/contract/test_floors.py

format: development ## Format the code
	$(PYTHON) -m ruff format .
	$(PYTHON) -m ruff check --fix .

rules: setup ## Generate data/pipelines/*.mk and schemas/json from their declarations
	for name in $(PIPELINES); do $(PYTHON) -m scenewright makefile $$name > data/pipelines/$$name.mk.new; mv data/pipelines/$$name.mk.new data/pipelines/$$name.mk; done
	$(PYTHON) -m scenewright schemas --out schemas/json

# ---- pipelines ----------------------------------------------------------------------------------------------------

# Steps that do not need each other run beside each other: JOBS=1 runs one at a time, in less memory.
.PHONY: $(PIPELINES)
$(PIPELINES): setup
	@$(MAKE) --no-print-directory -j$(or $(JOBS),2) -f data/pipelines/$@.mk PYTHON=$(PYTHON) OUTPUTS=$(OUTPUTS) $(if $(RUN),RUN=$(RUN))
	@echo "report: $(OUTPUTS)/$(or $(RUN),$@)/report/report.html"
	@folder=$(OUTPUTS)/$(or $(RUN),$@)/plan; if [ -d $$folder ]; then cat $$folder/plan.txt; $(PYTHON) -m scenewright inspect $$folder --expect ok > /dev/null; fi

.PHONY: batch
batch: setup ## Run a pipeline over a data set: make batch SPEC=batch.toml RUN=folder JOBS=2
	$(PYTHON) -m scenewright batch $(SPEC) --out $(OUTPUTS)/$(or $(RUN),batch) $(if $(JOBS),--jobs $(JOBS))

.PHONY: clean
clean: ## Remove everything that runs made (outputs/*)
	find outputs -mindepth 1 -not -name README.md -delete

# ---- experiments and measurements ---------------------------------------------------------------------------------

# `python -m benchmarks` lists the experiments. What is measured already is kept, trial by trial, until the code that it
# was measured with changes. QUICK=1: fewer seeds, smaller trials; FRESH=1 measures again; OPTIONS="--arms ours --count 5".
EXPERIMENT := $(PYTHON) -m benchmarks
TRAIN := $(PYTHON) -m scenewright train
ASKED = $(if $(QUICK),--quick) $(if $(FRESH),--fresh) $(OPTIONS)

# The folder that holds the real logs (see docs/DATA.md); none of it is part of the project.
REAL_DATA ?= ../shared/data

.PHONY: board board-check
# Twelve shards of at most twenty minutes on two cores: SHARDS="public-1 real" runs some, METHOD=commit measures another
# commit, COMMIT=1 commits the records of each. QUICK=1: one small room and whatever else five minutes allow.
board: setup ## The benchmark whose rooms stay the same: METHOD=commit SHARDS="..." TRUTH=folder COMMIT=1 (QUICK=1: 5 minutes)
	$(PYTHON) -m benchmarks.board --out $(OUTPUTS)/board $(if $(QUICK),--quick) $(if $(METHOD),--method $(METHOD)) $(if $(SHARDS),--shards $(SHARDS)) $(if $(TRUTH),--truth $(TRUTH)) $(if $(COMMIT),--commit) --data $(REAL_DATA)
	$(if $(or $(QUICK),$(TRUTH)),,$(PYTHON) -m benchmarks.board.publishing)

board-check: setup ## Measure one published trial again, drawn by the commit, and compare every digit
	$(PYTHON) -m benchmarks.board.checking --out $(OUTPUTS)/board-check

.PHONY: real real-all bench bench-preflight
# A quarter of an hour of one core; with OPTIONS=--halves half an hour. What it makes stays: bench-scene, real-plan take it.
real: setup ## The chain on real logs, held against what was annotated there (REAL_DATA=folder; TRUTH=folder: one's own log)
	OMP_NUM_THREADS=1 $(PYTHON) -m benchmarks.board.real --data $(REAL_DATA) --out $(OUTPUTS)/experiments/real$(if $(TRUTH),-truth --truth $(TRUTH)) $(if $(QUICK),--quick) $(OPTIONS)

# Under an hour of two cores; a stopped run goes on where it was. `OPTIONS="--detector FILE.onnx"`.
real-all: setup ## Every real log through every backend that runs here; fails unless each run explains itself (QUICK=1: few frames)
	OMP_NUM_THREADS=1 $(EXPERIMENT) real_all --data $(REAL_DATA) --out $(OUTPUTS)/experiments/real-all$(if $(QUICK),-quick) --jobs 2 $(ASKED)

# Twelve generated rooms (three with QUICK=1) and the real logs, each with every planted fault.
bench-preflight: setup ## What `inspect` makes of planted faults (QUICK=1: three rooms)
	$(EXPERIMENT) preflight --data $(REAL_DATA) --out $(OUTPUTS)/experiments/bench-preflight $(ASKED)

.PHONY: house
# Four rooms of the models in REAL_DATA; none where those are not there. Six minutes a room on two busy cores.
house: setup ## Rooms of models that others made, another renderer, true masks: is what comes out right? (QUICK=1: fewer frames)
	OMP_NUM_THREADS=1 $(EXPERIMENT) house --data $(REAL_DATA) --out $(OUTPUTS)/experiments/house$(if $(QUICK),-quick) $(ASKED)

.PHONY: bench-poses
# The red kitchen, Redwood's living room, the dining room (REAL_DATA), and six generated rooms of the reporting seeds
# (QUICK=1: one).
bench-poses: setup ## Estimated camera paths: error, speed, effect on the map (QUICK=1: one room, two arms)
	$(EXPERIMENT) poses --data $(REAL_DATA) --out $(OUTPUTS)/experiments/bench-poses$(if $(QUICK),-quick) $(ASKED)

.PHONY: bench-poses-refined
# Five generated rooms of the reporting seeds, four cases: a quarter of an hour of one core (QUICK=1: one room).
bench-poses-refined: setup ## Given camera paths that drift, refined (QUICK=1: one room)
	$(EXPERIMENT) poses_refined --out $(OUTPUTS)/experiments/bench-poses-refined$(if $(QUICK),-quick) $(ASKED)

# Two real logs (REAL_DATA) and twenty generated rooms, budgets of 1, 5 and 20 processor minutes: a day of one core. QUICK=1:
# 10 and 30 seconds, one room.
.PHONY: interpret
# Ten training seeds an arm, three domains, five sets; a stopped run goes on where it was.
interpret: setup ## Words learned from corrections (InterPreT): the thesis's sets, a hundred goals (QUICK=1: one seed, ten goals)
	OMP_NUM_THREADS=1 $(EXPERIMENT) interpret --out $(OUTPUTS)/experiments/interpret$(if $(QUICK),-quick) $(ASKED)

# Six minutes of a GPU (DEVICE=cuda), about a day of one core (not run), rooms not counted; stands in data/words/two_towers.safetensors.
# calibration.toml is fitted after it.
.PHONY: words-train words-calibrate legs
WORDS = $(OUTPUTS)/experiments/words-train$(if $(QUICK),-quick)
words-train: setup ## Train the embedded encoder of pictures and words anew (QUICK=1: proves the recipe)
	OMP_NUM_THREADS=1 $(PYTHON) -m benchmarks.words.making $(if $(QUICK),--quick) --out $(WORDS)/samples
	OMP_NUM_THREADS=1 $(TRAIN) words $(if $(QUICK),--quick) $(if $(DEVICE),--device $(DEVICE)) --samples $(WORDS)/samples --out $(WORDS)

words-calibrate: setup ## Fit the probabilities of answers on tuning rooms (QUICK=1: one room; printed, not kept)
	OMP_NUM_THREADS=1 $(PYTHON) -m benchmarks.words.asking $(if $(QUICK),--quick) --data $(REAL_DATA) --out $(OUTPUTS)/experiments/legs-words-tuning
	OMP_NUM_THREADS=1 $(TRAIN) word-probabilities $(if $(QUICK),,--write) --places $(OUTPUTS)/experiments/legs-words-tuning --out $(OUTPUTS)/experiments/legs-words-tuning

legs: setup ## Rooms as Gaussians, learned while pictures arrive, beside the thesis's method (QUICK=1: seconds, one room)
	OMP_NUM_THREADS=1 $(EXPERIMENT) legs --data $(REAL_DATA) --out $(OUTPUTS)/experiments/legs$(if $(QUICK),-quick) $(ASKED)
	OMP_NUM_THREADS=1 $(EXPERIMENT) legs_words --out $(OUTPUTS)/experiments/legs-words$(if $(QUICK),-quick) $(if $(QUICK),--quick) $(if $(FRESH),--fresh)

.PHONY: bench-surface
bench-surface: setup ## Seen surface that is in the map, at any angle, beside Open3D (QUICK=1: one board and room a case)
	OMP_NUM_THREADS=1 $(EXPERIMENT) surface --out $(OUTPUTS)/experiments/bench-surface$(if $(QUICK),-quick) $(ASKED)

.PHONY: bench-moving
bench-moving: setup ## Joints of doors and drawers that a log shows in two states, beside registration (QUICK=1: one room)
	OMP_NUM_THREADS=1 $(EXPERIMENT) moving --out $(OUTPUTS)/experiments/bench-moving$(if $(QUICK),-quick) $(ASKED)

.PHONY: bench-built-ins
# Two minutes of one core a room, once it is there.
bench-built-ins: setup ## What stands for counters and cabinets that no model fits, beside box and mesh (QUICK=1: one room)
	OMP_NUM_THREADS=1 $(EXPERIMENT) built_ins --out $(OUTPUTS)/experiments/bench-built-ins$(if $(QUICK),-quick) $(ASKED)

.PHONY: gap
gap: setup ## Boxes of a real scan and outlines in a real bin beside those of generated rooms (QUICK=1: one room)
	$(EXPERIMENT) gap --data $(REAL_DATA) --out $(OUTPUTS)/experiments/gap$(if $(QUICK),-quick) $(ASKED)

.PHONY: bench-edits
bench-edits: setup ## Edits by hand, applied again to maps fused with other parameters (QUICK=1: four rooms)
	OMP_NUM_THREADS=1 $(EXPERIMENT) edits --out $(OUTPUTS)/experiments/bench-edits$(if $(QUICK),-quick) $(ASKED)

.PHONY: mosd train-pairs pair-rules
mosd: setup ## Objects of real tabletop frames against their labels (QUICK=1: every fifth frame; REAL_DATA=folder)
	$(EXPERIMENT) mosd --data $(REAL_DATA) --out $(OUTPUTS)/experiments/mosd$(if $(QUICK),-quick) $(ASKED)

.PHONY: real-plan
# Twenty plans, about a minute each.
real-plan: setup ## A cup put on the counter of the real kitchen, in its reconstruction, after `make real` (QUICK=1: one seed)
	$(EXPERIMENT) real_plan --runs $(OUTPUTS)/experiments/real --out $(OUTPUTS)/experiments/real-plan$(if $(QUICK),-quick) $(ASKED)

.PHONY: mosd-supports
mosd-supports: setup ## Which object rests on which on real tabletop frames (QUICK=1: every fifth frame; REAL_DATA=folder)
	$(EXPERIMENT) mosd_supports --data $(REAL_DATA) --out $(OUTPUTS)/experiments/mosd-supports$(if $(QUICK),-quick) $(ASKED)

# About a quarter of an hour on one core; stands in data/networks/tabletop_pairs.safetensors.
train-pairs: setup ## Train the trees of `segment --backend objects` anew (QUICK=1: few generated frames)
	$(TRAIN) tabletop-pairs $(if $(QUICK),--quick) --data $(REAL_DATA) --out $(OUTPUTS)/experiments/train-pairs$(if $(QUICK),-quick)

# About a quarter of an hour on one core; prints what stands in stages/segment/backends/objects/rules.py.
pair-rules: setup ## Fit the rules of `segment --backend objects` anew (QUICK=1: few generated frames)
	$(TRAIN) pair-rules $(if $(QUICK),--quick) --data $(REAL_DATA) --out $(OUTPUTS)/experiments/pair-rules$(if $(QUICK),-quick)

bench: setup ## Speed beside named peers, medians (QUICK=1: fewer runs)
	$(EXPERIMENT) speed_fusion --out $(OUTPUTS)/experiments/bench-speed-fusion$(if $(QUICK),-quick) $(ASKED)
	$(EXPERIMENT) speed_segmentation --out $(OUTPUTS)/experiments/bench-speed-segmentation$(if $(QUICK),-quick) $(ASKED)
	$(EXPERIMENT) speed_splatting --out $(OUTPUTS)/experiments/bench-speed-splatting$(if $(QUICK),-quick) $(ASKED)

.PHONY: bench-growth
bench-growth: setup ## What a frame costs as the map grows, and what holds the memory (QUICK=1: 300 frames)
	$(EXPERIMENT) growth --out $(OUTPUTS)/experiments/bench-growth$(if $(QUICK),-quick) $(ASKED)

.PHONY: bench-supports bench-timeline
# Four studios of tuning and four of reporting seeds, on perfect maps.
bench-supports: setup ## Hanging, leaning, contained, carried by two: edges by relation, ours and thesis (QUICK=1: one room)
	$(EXPERIMENT) graph_supports --out $(OUTPUTS)/experiments/bench-supports$(if $(QUICK),-quick) $(ASKED)

bench-timeline: setup ## The contact graph while the map grows: edit distance and cost of every snapshot (QUICK=1: one room)
	$(EXPERIMENT) graph_timeline --out $(OUTPUTS)/experiments/bench-timeline$(if $(QUICK),-quick) $(ASKED)

.PHONY: scenenn
# DATA=folder with SceneNN's scenes (docs/DATA.md); OPTIONS are those of the experiment, for example
# OPTIONS="--backend detector --weights yolox.onnx --arms ours thesis --sequences 011 030".
scenenn: setup ## The thesis's tables on SceneNN: make scenenn DATA=folder (OPTIONS="--backend ... --arms ...")
	$(EXPERIMENT) scenenn $(if $(DATA),--data $(DATA)) --out $(OUTPUTS)/experiments/scenenn $(ASKED)

.PHONY: bench-planning
# 200 reporting seeds a query set (QUICK=1: 10); SCENE is an interactive scene (or several), for the case reconstructed_room.
SCENE ?= $(OUTPUTS)/demo/interactive_scene
bench-planning: setup ## Planning beside OMPL with pybullet checks (QUICK=1: 10 queries a set; SCENE=folder)
	$(EXPERIMENT) planning_motion $(if $(wildcard $(SCENE)),--scene $(SCENE)) --out $(OUTPUTS)/experiments/bench-planning$(if $(QUICK),-quick) $(ASKED)

.PHONY: tidy
# Fast: 30 reporting seeds a tier, minutes of one core; seen: images before each action, a second each;
# physics and detect: docs/TIDY.md. Stopped runs go on where they were. PARTS="fast seen" runs some of them.
PARTS ?= fast wrong seen physics detect
TIDY := $(OUTPUTS)/experiments/tidy$(if $(QUICK),-quick)
tidy: setup ## Clearing tables (TIDY): tables 7.1 to 7.3, joint planner, optimum, vision (QUICK=1: few tables; PARTS=...)
	$(if $(filter fast,$(PARTS)),$(EXPERIMENT) tidy_fast --out $(TIDY)/fast $(ASKED))
	$(if $(filter wrong,$(PARTS)),$(EXPERIMENT) tidy_wrong --out $(TIDY)/wrong $(ASKED))
	$(if $(filter seen,$(PARTS)),$(EXPERIMENT) tidy_seen --out $(TIDY)/seen $(ASKED))
	$(if $(filter physics,$(PARTS)),$(EXPERIMENT) tidy_physics --out $(TIDY)/physics $(ASKED))
	$(if $(filter physics,$(PARTS)),$(EXPERIMENT) tidy_pulls --out $(TIDY)/pulls $(ASKED))
	$(if $(filter physics,$(PARTS)),$(EXPERIMENT) tidy_holds --out $(TIDY)/holds $(ASKED))
	$(if $(filter detect,$(PARTS)),$(EXPERIMENT) tidy_detect --out $(TIDY)/detect $(ASKED))
	$(if $(and $(filter detect,$(PARTS)),$(wildcard $(REAL_DATA)/tableware)),$(EXPERIMENT) tidy_detect_real --data $(REAL_DATA)/tableware --out $(TIDY)/detect_real $(ASKED))
	$(EXPERIMENT) gather $(TIDY)

.PHONY: stitch
# chain: every command on two rendered scenes and trials, into a report; the other parts are the benchmarks below, together
# about two hours of one core. Stopped runs go on where they were. STITCH_PARTS="chain trials" runs some of them.
STITCH_PARTS ?= chain needle segmentation follow thread trials
STITCH := $(OUTPUTS)/experiments/stitch$(if $(QUICK),-quick)
stitch: setup ## Suturing (STITCH): scene to disparity, needle, thread; trials, table 4.1, report (QUICK=1; STITCH_PARTS=...)
	$(if $(filter chain,$(STITCH_PARTS)),$(EXPERIMENT) stitch_chain --out $(STITCH)/chain $(ASKED))
	$(if $(filter needle,$(STITCH_PARTS)),$(EXPERIMENT) stitch_needle --out $(STITCH)/needle $(ASKED))
	$(if $(filter segmentation,$(STITCH_PARTS)),$(EXPERIMENT) stitch_segmentation --views $(STITCH_VIEWS) --out $(STITCH)/segmentation $(ASKED))
	$(if $(filter follow,$(STITCH_PARTS)),$(EXPERIMENT) stitch_follow --out $(STITCH)/follow $(ASKED))
	$(if $(filter thread,$(STITCH_PARTS)),$(EXPERIMENT) stitch_thread --views $(STITCH_VIEWS) --out $(STITCH)/thread $(ASKED))
	$(if $(filter trials,$(STITCH_PARTS)),$(EXPERIMENT) stitch_trials --out $(STITCH)/trials $(ASKED))
	$(EXPERIMENT) gather $(STITCH)

.PHONY: stitch-needle
# Five hundred rendered views and more without pictures, about forty minutes of one core; a stopped run goes on.
stitch-needle: setup ## The needle's pose: the thesis's estimator and ours on rendered views (QUICK=1: ten a case)
	$(EXPERIMENT) stitch_needle --out $(OUTPUTS)/experiments/stitch-needle$(if $(QUICK),-quick) $(ASKED)

.PHONY: stitch-absent
stitch-absent: setup ## Is there a needle at all: rendered views with and without one, recorded tissue (QUICK=1; REAL_DATA=folder)
	$(EXPERIMENT) stitch_absent --data $(REAL_DATA) --out $(OUTPUTS)/experiments/stitch-absent$(if $(QUICK),-quick) $(ASKED)

.PHONY: stitch-unknown
stitch-unknown: setup ## A needle of which less is known: no radius, a wrong one, its tip hidden (QUICK=1: four views)
	$(EXPERIMENT) stitch_unknown --out $(OUTPUTS)/experiments/stitch-unknown$(if $(QUICK),-quick) $(ASKED)

.PHONY: stitch-trials
# A hundred reporting seeds an arm, about three CPU minutes; a stopped run goes on where it was.
stitch-trials: setup ## Whole suture trials in the simulator: table 4.1, the thesis's arms and ours (QUICK=1: ten trials)
	$(EXPERIMENT) stitch_trials --out $(OUTPUTS)/experiments/stitch-trials$(if $(QUICK),-quick) $(ASKED)

.PHONY: stitch-train stitch-segmentation stitch-thread
# Rendered views are kept in one folder for all three: 206 to train on and to validate with, 100 to report on.
STITCH_VIEWS := $(OUTPUTS)/experiments/stitch-views
stitch-train: setup ## Train the needle and thread network anew, an hour of a core with rendering (QUICK=1: 40 steps)
	$(TRAIN) suture-network $(if $(QUICK),--quick) --views $(STITCH_VIEWS) --out $(OUTPUTS)/experiments/stitch-train$(if $(QUICK),-quick)
	$(TRAIN) suture-network $(if $(QUICK),--quick) --views $(STITCH_VIEWS) --steps 3000 --start $(OUTPUTS)/experiments/stitch-train$(if $(QUICK),-quick)/segmentation.safetensors --out $(OUTPUTS)/experiments/stitch-train-refined$(if $(QUICK),-quick)
	$(TRAIN) suture-network $(if $(QUICK),--quick) --views $(STITCH_VIEWS) --cluttered --start $(OUTPUTS)/experiments/stitch-train-refined$(if $(QUICK),-quick)/segmentation.safetensors --out $(OUTPUTS)/experiments/stitch-train-cluttered$(if $(QUICK),-quick)
	$(TRAIN) suture-network $(if $(QUICK),--quick) --views $(STITCH_VIEWS) --cluttered --trials --steps 3000 --start $(OUTPUTS)/experiments/stitch-train-cluttered$(if $(QUICK),-quick)/segmentation.safetensors --out $(OUTPUTS)/experiments/stitch-train-trials$(if $(QUICK),-quick)

stitch-segmentation: setup ## The network's masks on held-out views, and the needle's pose from them (QUICK=1: four views)
	$(EXPERIMENT) stitch_segmentation --views $(STITCH_VIEWS) --out $(OUTPUTS)/experiments/stitch-segmentation$(if $(QUICK),-quick) $(ASKED)

stitch-thread: setup ## Threads as curves in space, from true and from learned masks (QUICK=1: four views)
	$(EXPERIMENT) stitch_thread --views $(STITCH_VIEWS) --out $(OUTPUTS)/experiments/stitch-thread$(if $(QUICK),-quick) $(ASKED)

.PHONY: llm3
# A hundred reporting seeds a cell, about ten minutes of one core; a stopped run goes on where it was.
llm3: setup ## Box packing by proposals and motion feedback: tables 4.1 and 4.2, harder suites (QUICK=1: ten instances)
	$(EXPERIMENT) llm3 --out $(OUTPUTS)/experiments/llm3$(if $(QUICK),-quick) $(ASKED)

.PHONY: cutting
# A hundred goals a cell and five trainings of the networks; a stopped run goes on where it was.
cutting: setup ## Cutting towards goals: table 6.1, the thesis's arms and ours (QUICK=1: two goals a cell)
	OMP_NUM_THREADS=1 $(EXPERIMENT) cutting --out $(OUTPUTS)/experiments/cutting$(if $(QUICK),-quick) $(ASKED)
	OMP_NUM_THREADS=1 $(EXPERIMENT) cutting_touching --out $(OUTPUTS)/experiments/cutting_touching$(if $(QUICK),-quick)

.PHONY: come-robot
# A hundred reporting seeds a task, twelve tasks, ablations and curves: about fifteen minutes of one core. PHYSICS=N: N seeds a
# task in pybullet too, about a minute of a core for each. PUBLISH=1 writes docs/results from what is measured.
come-robot: setup ## A robot told in words (COME-robot): tables 3.2 to 3.4, ablations, curves (QUICK=1: ten seeds; PHYSICS=N; PUBLISH=1)
	$(EXPERIMENT) come_robot --out $(OUTPUTS)/experiments/come-robot$(if $(QUICK),-quick) $(ASKED) $(if $(PUBLISH),--publish)
	$(if $(PHYSICS),$(EXPERIMENT) come_robot_physics --count $(PHYSICS) --out $(OUTPUTS)/experiments/come-robot-physics $(ASKED) $(if $(PUBLISH),--publish))
	$(if $(PUBLISH),$(PYTHON) -m benchmarks.figures)

.PHONY: bench-disparity bench-deviation bench-reconstruct-stereo train-stereo
# Rendered pairs are kept below the output folder; the network's arms run when its checkpoint is there.
STEREO_NETWORK ?= data/disparity/raft_stereo_small.safetensors
bench-disparity: setup ## Disparity beside OpenCV's matchers: Middlebury, endoscope, rooms, needles (QUICK=1: fewer frames; REAL_DATA=folder)
	OMP_NUM_THREADS=1 $(EXPERIMENT) disparity --data $(REAL_DATA) $(if $(wildcard $(STEREO_NETWORK)),--network $(STEREO_NETWORK)) --out $(OUTPUTS)/experiments/bench-disparity$(if $(QUICK),-quick) $(ASKED)

# Eight generated rooms, a minute and a half each on one core.
bench-deviation: setup ## Maps of two eyes with depth weighed by its deviation, and whether that is true (QUICK=1: one room)
	OMP_NUM_THREADS=1 $(EXPERIMENT) deviation --data $(REAL_DATA) --out $(OUTPUTS)/experiments/bench-deviation$(if $(QUICK),-quick) $(ASKED)

bench-reconstruct-stereo: setup ## Rooms reconstructed from two eyes beside a depth camera, a reporting seed (QUICK=1: few small frames)
	$(EXPERIMENT) stereo_rooms --out $(OUTPUTS)/experiments/bench-reconstruct-stereo$(if $(QUICK),-quick) $(ASKED)

# Half an hour of one core with rendering; stop it and start it again at will.
train-stereo: setup ## Train the small RAFT-Stereo on our own renderings (QUICK=1: 10 steps)
	$(PYTHON) -m benchmarks.disparity.training_pairs $(if $(QUICK),--quick) --out $(OUTPUTS)/experiments/train-stereo$(if $(QUICK),-quick)/pairs
	$(TRAIN) raft-stereo $(if $(QUICK),--quick) --pairs $(OUTPUTS)/experiments/train-stereo$(if $(QUICK),-quick)/pairs --out $(OUTPUTS)/experiments/train-stereo$(if $(QUICK),-quick)

.PHONY: figures
figures: setup ## Write every figure of README and docs anew from docs/results/*.json
	$(PYTHON) -m benchmarks.figures

.PHONY: site
site: extras ## Build the docs as a site, links checked: outputs/site/index.html
	NO_MKDOCS_2_WARNING=1 $(PYTHON) -m mkdocs build --site-dir $(OUTPUTS)/site

.PHONY: pictures
pictures: setup ## Take the pictures of README and gallery out of the demo run
	$(PYTHON) docs/pictures.py $(OUTPUTS)/demo

.PHONY: train-network bench-network
# Hours for the frames and more for the training, on one core each; minutes with OPTIONS="--device cuda" WORKERS=12. Stop it and
# start it again at will. To ship it: cp NETWORK/run/panoptic.safetensors data/networks.
NETWORK = $(OUTPUTS)/experiments/train-network$(if $(QUICK),-quick)
train-network: setup ## Train a network for `segment --backend network` (QUICK=1: proves the recipe in a minute or two)
	$(PYTHON) -m benchmarks.training $(if $(QUICK),--quick) $(if $(WORKERS),--workers $(WORKERS)) --data $(REAL_DATA) --out $(NETWORK)
	$(TRAIN) network $(if $(QUICK),--quick) $(OPTIONS) --frames $(NETWORK)/data $$(if test -d $(NETWORK)/real; then echo --real $(NETWORK)/real; fi) --out $(NETWORK)/run

bench-network: setup ## Our own network on rooms held back, real clouds and real logs (QUICK=1: fewer frames)
	$(EXPERIMENT) network --data $(REAL_DATA) --out $(OUTPUTS)/experiments/bench-network$(if $(QUICK),-quick) $(ASKED)
