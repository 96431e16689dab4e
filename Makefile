# make demo | make test | make setup | make check | make docs | make release | make screenshots | make bench | make chaos | make world
PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check
RUNS := $(VENV)/.runs
READY := $(VENV)/.ready
CHECKERS := $(VENV)/checkers
export OPENBLAS_NUM_THREADS ?= 1
# Processes of the tests: one more than cores, as some tests wait for most of their time.
JOBS ?= $(shell expr $$(nproc) + 1)
# The processes share compiled bytecode.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: setup demo test fast check docs release screenshots bench chaos world clean

setup: $(READY) $(CHECKERS)/.ready

# What the demonstration runs: a third of the packages.
$(RUNS): requirements-demo.lock pyproject.toml scripts/system-packages
	@echo "setting up what sprung runs with, in $(VENV)"
	scripts/system-packages python
	@$$(command -v $(PYTHON) || command -v python3) -m venv $(VENV)
	$(PIP) --no-compile --require-hashes -r requirements-demo.lock
	@$(BIN)/python -m compileall -qq -j 0 $(VENV)/lib || true  # on all cores; a few files are templates
	$(PIP) --no-deps --no-build-isolation -e .
	@touch $@

# All extras and what checks, tests and the manual need, into the same environment.
$(READY): $(RUNS) requirements.lock
	@echo "adding the packages of all extras, checks and tests"
	scripts/system-packages
	$(PIP) --require-hashes -r requirements.lock
	@touch $@

# Programs of others that read our files in tests; their requirements contradict ours.
$(CHECKERS)/.ready: requirements-checkers.lock $(READY)
	@echo "adding programs of others that check files for them"
	@$(BIN)/python -m venv $(CHECKERS)
	$(CHECKERS)/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements-checkers.lock
	@touch $@

demo: $(RUNS)
	$(BIN)/sprung demo

test: check
	$(BIN)/python -m pytest -n $(JOBS) --dist worksteal --durations=25 --durations-min=5

fast: check
	$(BIN)/python -m pytest -n $(JOBS) --dist worksteal -m "not slow" --durations=10 --durations-min=1

check: $(READY) $(CHECKERS)/.ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python scripts/weight

# This manual as build/docs/index.html, with the tutorials run; without network, and every warning is an error.
docs: $(READY)
	rm -rf build/docs
	$(BIN)/python -m sphinx -W --keep-going -b html docs build/docs

# Wheel, sdist and bill of materials in dist, and a trial of the wheel in an environment of its own.
release: $(READY)
	scripts/release

# Every page in light, dark and on a phone, as build/screenshots/*.png.
screenshots: $(READY)
	$(BIN)/python -m pytest -n 0 -q tests/journeys/screenshots.py

bench: $(READY)
	benchmarks/run

# A thousand kills of box, broker and monitor, then take-overs by a monitor that stands by: about three quarters of an hour.
chaos: $(READY)
	$(BIN)/python benchmarks/chaos --kills 1000 --minutes 240 --drives 24 --every 1.6 --seed 1
	$(BIN)/python benchmarks/chaos/takeover.py

# A million faults in a simulated world of boxes, broker and monitor: a night. FIRST is the first seed.
FIRST ?= 1
world: $(READY)
	$(BIN)/python benchmarks/world --faults 1000000 --first $(FIRST)

clean:
	rm -rf $(VENV) benchmarks/.venv
