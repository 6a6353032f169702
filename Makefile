# `make view` and `make test` work on a machine with git, make and Python >= 3.11 only.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SCENE ?= dvf5000_first
ARGS ?=

# pip puts the pinned versions of constraints.txt into .venv; the stamps let it run again only
# when what is to be installed has changed.
RUN_STAMP := $(VENV)/.installed-run
DEV_STAMP := $(VENV)/.installed-dev
PIP_INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt

.DEFAULT_GOAL := help
.PHONY: help view test proofs reliability coverage lint format bench screenshots clean system-packages

help: ## list the targets
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | expand -t 18

view: $(RUN_STAMP) ## open the app (make view SCENE=teach_squareness ARGS="--port 8080")
	$(BIN)/warpspace view $(SCENE) $(ARGS)

test: system-packages $(DEV_STAMP) ## install what is missing, then lint, type-check and test
	$(MAKE) --no-print-directory lint
	bash .ci/tests.sh

proofs: system-packages $(DEV_STAMP) ## run the slow proofs: kills, hostile messages, the largest page
	$(BIN)/python -m pytest -m proof --durations=10 $(ARGS)

reliability: system-packages $(DEV_STAMP) ## try to break it, and write docs/reliability.md (ARGS="--fraction 0.01")
	$(PIP_INSTALL) --no-build-isolation -e '.[fuzz]' || echo "no atheris here: leave out the row coverage"
	PYTHONPATH=tests $(BIN)/python -m reliability $(ARGS)

coverage: system-packages $(DEV_STAMP) ## run the tests and say which lines none of them reaches
	rm -f .coverage
	bash .ci/tests.sh --cov --cov-append --cov-report=
	$(BIN)/python -m coverage report

lint: $(DEV_STAMP) ## format check, ruff, pyright, import contracts
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright
	$(BIN)/lint-imports --no-logo

format: $(DEV_STAMP) ## format the code and apply safe fixes
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

bench: $(DEV_STAMP) ## run every benchmark
	@set -e; for script in benchmarks/bench_*.py; do \
	    [ -e "$$script" ] || { echo "no benchmarks/bench_*.py"; exit 1; }; \
	    echo "== $$script"; $(BIN)/python "$$script" $(ARGS); done

screenshots: system-packages $(DEV_STAMP) ## take the pictures of README and docs anew
	$(BIN)/python examples/screenshots.py $(ARGS)

clean: ## remove what the other targets made, .venv included
	rm -rf $(VENV) build dist htmlcov .coverage .coverage.* \
	    .pytest_cache .ruff_cache .hypothesis .import_linter_cache
	find src tests benchmarks examples -name __pycache__ -type d -prune -exec rm -rf {} + 2>/dev/null || true

system-packages:
	@bash .ci/system-packages.sh

$(BIN)/python:
	@bash .ci/check-python.sh "$(PYTHON)"
	$(PYTHON) -m venv $(VENV)

# hatchling comes first so that the build itself uses the pinned version.
$(RUN_STAMP): pyproject.toml constraints.txt | $(BIN)/python
	$(PIP_INSTALL) hatchling editables
	$(PIP_INSTALL) --no-build-isolation -e .
	@touch $@

$(DEV_STAMP): pyproject.toml constraints.txt | $(BIN)/python
	$(PIP_INSTALL) hatchling editables
	$(PIP_INSTALL) --no-build-isolation -e '.[test,dev]'
	@touch $(RUN_STAMP) $@
