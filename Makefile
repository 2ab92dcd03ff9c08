# `make demo` and `make test` each set up by themselves; PYTHON names another interpreter (3.11 or newer),
# VENV another place for the packages. Nothing else is needed: pyright brings its own Node.
PYTHON ?= python3.11
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: demo picture test test-slow lint bench clean

$(READY): pyproject.toml constraints.txt hatch_build.py
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet -c constraints.txt torch
	$(BIN)/python -m pip install --quiet -c constraints.txt --editable . pytest pytest-benchmark hypothesis ruff "pyright[nodejs]"
	touch $@

demo: $(READY)
	rm -rf demo
	$(BIN)/echoscape simulate demo --seed 7 --scans 40 --workers 2

picture: demo
	$(BIN)/python -c "from pathlib import Path; from echoscape.eval.preview import small_copy; \
		small_copy(Path('demo/preview.png'), Path('docs/preview.png'))"

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright --pythonpath $(BIN)/python

test: lint
	$(BIN)/python -m pytest

test-slow: $(READY)
	$(BIN)/python -m pytest -m slow

bench: $(READY)
	$(BIN)/python -m benchmarks.scan_rate

clean:
	rm -rf $(VENV) build demo
