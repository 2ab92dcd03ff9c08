# `make demo` and `make test` set up by themselves; PYTHON names another interpreter (3.11 to 3.13), VENV another
# folder for the packages. Nothing else is needed: pyright brings its own Node.
PYTHON ?= python3.11
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
PIP = $(BIN)/python -m pip install --quiet -c constraints.txt
TORCH := torch==$(shell sed -n 's/^torch==//p' constraints.txt)

.PHONY: demo docs figures fidelity training-set judge test test-slow golden lint bench clean

# PyTorch for the CPU: from a folder of wheels that pip is configured to search (find-links), else by uv from
# PyTorch's index of CPU builds, else the build that pip finds, which on Linux brings CUDA.
$(READY): pyproject.toml constraints.txt hatch_build.py
	$(PYTHON) -m venv $(VENV)
	$(PIP) --no-index --no-deps $(TORCH) 2> /dev/null \
		|| { $(PIP) uv && $(BIN)/uv pip install --quiet --python $(BIN)/python --torch-backend=cpu $(TORCH); } \
		|| { echo "make: no CPU build of PyTorch can be reached: installing the one with CUDA, some 6 GB" >&2; \
			$(PIP) $(TORCH); }
	$(PIP) --editable ".[learn]" pytest pytest-xdist hypothesis ruff "pyright[nodejs]"
	touch $@

demo: $(READY)
	rm -rf demo
	$(BIN)/echoscape simulate demo --seed 7 --scans 40 --workers 2
	$(BIN)/echoscape odometry demo --out demo/odometry

# The site in build/site: the pages of docs/, the notebook, and the API from docstrings. Its packages are installed for
# it alone; the build needs no network.
DOCS_READY := $(VENV)/.ready-docs
$(DOCS_READY): $(READY)
	$(PIP) $$($(BIN)/python -c "import tomllib; \
		print(*tomllib.load(open('pyproject.toml', 'rb'))['dependency-groups']['docs'])")
	touch $@

docs: $(DOCS_READY)
	rm -rf build/site
	$(BIN)/python -m sphinx -q -E -b html -d build/doctrees -W --keep-going docs build/site

figures: demo
	$(BIN)/python -c "from pathlib import Path; from echoscape.eval.figures.preview import small_copy; \
		small_copy(Path('demo/preview.png'), Path('docs/preview.png'))"
	rm -rf build/junction
	$(BIN)/echoscape simulate build/junction --seed 101 --scans 40 --workers 2 --no-preview
	$(BIN)/python -c "from pathlib import Path; from echoscape.eval.figures.scan_image import write_scan_image; \
		write_scan_image(Path('build/junction'), Path('docs/scan.png'), scan=38)"
	$(BIN)/python -c "from pathlib import Path; from echoscape.eval.methods.figure import write_keypoints_figure; \
		write_keypoints_figure(Path('build/junction'), Path('docs/keypoints.png'), scan=38)"
	ECHOSCAPE_TUTORIAL_FIGURES=1 $(BIN)/python -m pytest -m "slow or not slow" tests/test_tutorials.py

# Tables and figures of docs/fidelity.md: seed 7 was used for the calibration, 101 and 102 were not.
ARTEFACTS := $(BIN)/echoscape artefacts --seed 7 --scans 240
fidelity: $(READY)
	rm -rf build/fidelity
	for seed in 7 101 102; do \
		$(BIN)/echoscape simulate build/fidelity/town_$$seed --seed $$seed --scans 40 --workers 2 --no-preview && \
		$(BIN)/echoscape fidelity build/fidelity/town_$$seed || exit 1; done
	$(ARTEFACTS) docs/artefacts --scan 184
	$(ARTEFACTS) build/fidelity/turn --scan 116 --only motion_distortion interference
	mv build/fidelity/turn/motion_distortion.png build/fidelity/turn/interference.png docs/artefacts
	mv docs/artefacts/artefacts.md build/fidelity
	$(BIN)/python -m benchmarks.fidelity_tables docs/fidelity.md \
		build/fidelity/town_7/fidelity build/fidelity/town_101/fidelity build/fidelity/town_102/fidelity \
		build/fidelity build/fidelity/turn

# Data sets of docs/learning.md, some 40 GB: training, 30 towns of 400 scans; validation, 3 of 100 and 4 of 600;
# test, 4 of 600. Started again, it continues where it was stopped.
TRAINING ?= build/training
RANDOMIZED = $(BIN)/echoscape simulate --randomize --no-preview --workers 2 --resume
training-set: $(READY)
	for seed in $$(seq 2001 2010); do $(RANDOMIZED) $(TRAINING)/train_town_$$seed --seed $$seed --scans 400 || exit 1; \
		$(RANDOMIZED) $(TRAINING)/train_suburb_$$((seed + 100)) --preset suburb --seed $$((seed + 100)) --scans 400 || exit 1; \
		$(RANDOMIZED) $(TRAINING)/train_industrial_$$((seed + 200)) --preset industrial --seed $$((seed + 200)) \
			--scans 400 || exit 1; done
	$(RANDOMIZED) $(TRAINING)/val_town_1001 --seed 1001 --scans 100
	$(RANDOMIZED) $(TRAINING)/val_suburb_1002 --preset suburb --seed 1002 --scans 100
	$(RANDOMIZED) $(TRAINING)/val_industrial_1003 --preset industrial --seed 1003 --scans 100
	$(RANDOMIZED) $(TRAINING)/val_town_1004 --seed 1004 --scans 600
	$(RANDOMIZED) $(TRAINING)/val_suburb_1005 --preset suburb --seed 1005 --scans 600
	$(RANDOMIZED) $(TRAINING)/val_industrial_1006 --preset industrial --seed 1006 --scans 600
	$(RANDOMIZED) $(TRAINING)/val_town_1007 --seed 1007 --scans 600
	$(RANDOMIZED) $(TRAINING)/test_town_3001 --seed 3001 --scans 600
	$(RANDOMIZED) $(TRAINING)/test_suburb_3002 --preset suburb --seed 3002 --scans 600
	$(RANDOMIZED) $(TRAINING)/test_industrial_3003 --preset industrial --seed 3003 --scans 600
	$(RANDOMIZED) $(TRAINING)/test_town_3004 --seed 3004 --scans 600

# The bundled weights and phase correlation on the four test towns (docs/results.md).
TEST_TOWNS := town_3001 suburb_3002 industrial_3003 town_3004
judge: $(READY)
	for town in $(TEST_TOWNS); do set -e; \
		$(BIN)/echoscape odometry $(TRAINING)/test_$$town --out build/judged/coarse/$$town --loop-pairs 25; \
		$(BIN)/echoscape odometry $(TRAINING)/test_$$town --out build/judged/fine/$$town --resolution 0.3456; \
		$(BIN)/echoscape odometry $(TRAINING)/test_$$town --out build/judged/fourier/$$town --method fourier; done
	for method in coarse fine fourier; do $(BIN)/python -m benchmarks.odometry_table build/judged/$$method/*; done

# The golden scan of the example project, after a change of scans that is meant.
golden: $(READY)
	cd examples/foreign_project && $(abspath $(BIN))/python -m pytest -q -p no:cacheprovider --radar-update-golden

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright --pythonpath $(BIN)/python

# One process a core, each with one thread; tests that share costly fixtures stay in one process.
PYTEST = $(BIN)/python -m pytest -n auto
test: lint
	$(PYTEST)

test-slow: $(READY)
	$(PYTEST) -m slow

bench: $(READY)
	$(BIN)/python -m benchmarks.scan_rate

clean:
	rm -rf $(VENV) build demo
