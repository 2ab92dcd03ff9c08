# `make demo` and `make test` each set up by themselves; PYTHON names another interpreter (3.11 or newer),
# VENV another place for the packages. Nothing else is needed: pyright brings its own Node.
PYTHON ?= python3.11
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: demo picture fidelity training-set judge test test-slow lint bench clean

$(READY): pyproject.toml constraints.txt hatch_build.py
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet -c constraints.txt torch
	$(BIN)/python -m pip install --quiet -c constraints.txt --editable . pytest pytest-xdist hypothesis ruff "pyright[nodejs]"
	touch $@

demo: $(READY)
	rm -rf demo
	$(BIN)/echoscape simulate demo --seed 7 --scans 40 --workers 2
	$(BIN)/echoscape odometry demo --out demo/odometry

picture: demo
	$(BIN)/python -c "from pathlib import Path; from echoscape.eval.figures.preview import small_copy; \
		small_copy(Path('demo/preview.png'), Path('docs/preview.png'))"
	rm -rf build/junction
	$(BIN)/echoscape simulate build/junction --seed 102 --scans 40 --workers 2 --no-preview
	$(BIN)/python -c "from pathlib import Path; from echoscape.eval.figures.scan_image import write_scan_image; \
		write_scan_image(Path('build/junction'), Path('docs/scan.png'), scan=26)"

# Tables and pictures of docs/fidelity.md: seed 7 is the one that was calibrated on, 101 and 102 are others.
ARTEFACTS := $(BIN)/echoscape artefacts --seed 7 --scans 240
fidelity: $(READY)
	rm -rf build/fidelity
	for seed in 7 101 102; do \
		$(BIN)/echoscape simulate build/fidelity/town_$$seed --seed $$seed --scans 40 --workers 2 --no-preview && \
		$(BIN)/echoscape fidelity build/fidelity/town_$$seed || exit 1; done
	$(ARTEFACTS) docs/artefacts --scan 208
	$(ARTEFACTS) build/fidelity/turn --scan 116 --only motion_distortion
	mv build/fidelity/turn/motion_distortion.png docs/artefacts
	mv docs/artefacts/artefacts.md build/fidelity
	$(BIN)/python -m benchmarks.fidelity_tables docs/fidelity.md \
		build/fidelity/town_7/fidelity build/fidelity/town_101/fidelity build/fidelity/town_102/fidelity build/fidelity

# Scans to learn from, to choose weights and following by, and to judge on (docs/learning.md): 30 towns of 400, 3 of
# 100 and 4 of 600, 4 of 600; some 40 GB. A set that was stopped goes on.
TRAINING ?= build/training
VARIED = $(BIN)/echoscape simulate --randomize --no-preview --workers 2 --resume
training-set: $(READY)
	for seed in $$(seq 2001 2010); do $(VARIED) $(TRAINING)/train_town_$$seed --seed $$seed --scans 400 || exit 1; \
		$(VARIED) $(TRAINING)/train_suburb_$$((seed + 100)) --preset suburb --seed $$((seed + 100)) --scans 400 || exit 1; \
		$(VARIED) $(TRAINING)/train_industrial_$$((seed + 200)) --preset industrial --seed $$((seed + 200)) \
			--scans 400 || exit 1; done
	$(VARIED) $(TRAINING)/val_town_1001 --seed 1001 --scans 100
	$(VARIED) $(TRAINING)/val_suburb_1002 --preset suburb --seed 1002 --scans 100
	$(VARIED) $(TRAINING)/val_industrial_1003 --preset industrial --seed 1003 --scans 100
	$(VARIED) $(TRAINING)/val_town_1004 --seed 1004 --scans 600
	$(VARIED) $(TRAINING)/val_suburb_1005 --preset suburb --seed 1005 --scans 600
	$(VARIED) $(TRAINING)/val_industrial_1006 --preset industrial --seed 1006 --scans 600
	$(VARIED) $(TRAINING)/val_town_1007 --seed 1007 --scans 600
	$(VARIED) $(TRAINING)/test_town_3001 --seed 3001 --scans 600
	$(VARIED) $(TRAINING)/test_suburb_3002 --preset suburb --seed 3002 --scans 600
	$(VARIED) $(TRAINING)/test_industrial_3003 --preset industrial --seed 3003 --scans 600
	$(VARIED) $(TRAINING)/test_town_3004 --seed 3004 --scans 600

# The shipped weights on the four test towns (docs/results.md), which nothing was chosen by.
JUDGED := town_3001 suburb_3002 industrial_3003 town_3004
judge: $(READY)
	for town in $(JUDGED); do set -e; \
		$(BIN)/echoscape odometry $(TRAINING)/test_$$town --out build/judged/coarse/$$town --loop-pairs 25; \
		$(BIN)/echoscape odometry $(TRAINING)/test_$$town --out build/judged/fine/$$town --resolution 0.3456; \
		$(BIN)/echoscape odometry $(TRAINING)/test_$$town --out build/judged/fourier/$$town --method fourier; done
	for method in coarse fine fourier; do $(BIN)/python -m benchmarks.odometry_table build/judged/$$method/*; done

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright --pythonpath $(BIN)/python

# A process for each core, each with one thread; tests that share what is costly to make stay together.
PYTEST = $(BIN)/python -m pytest -n auto
test: lint
	$(PYTEST)

test-slow: $(READY)
	$(PYTEST) -m slow

bench: $(READY)
	$(BIN)/python -m benchmarks.scan_rate

clean:
	rm -rf $(VENV) build demo
