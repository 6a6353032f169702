# `make view` and `make test` work on a machine with git, make and Python 3.11 to 3.14 only.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SCENE ?= dvf5000_first
ARGS ?=
# where compiled modules may not be kept, each of some hundred processes of the tests compiles all anew
unexport PYTHONDONTWRITEBYTECODE

# pip puts the pinned versions of constraints.txt into .venv; the stamps let it run again only
# when what is to be installed has changed.
RUN_STAMP := $(VENV)/.installed-run
DEV_STAMP := $(VENV)/.installed-dev
DOCS_STAMP := $(VENV)/.installed-docs
SPHINX := OMP_NUM_THREADS=1 $(BIN)/python -m sphinx -d docs/_build/doctrees docs
# without compiling: what is never imported need not be
PIP_INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -c constraints.txt

.DEFAULT_GOAL := help
.PHONY: help view test nightly reliability coverage lint style format bench screenshots thumbnails docs linkcheck \
    drawings dist packaging golden clean system-packages nightly-packages

help: ## list the targets
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | expand -t 18

view: $(RUN_STAMP) ## open the app (make view SCENE=teach_squareness ARGS="--port 8080")
	$(BIN)/warpspace view $(SCENE) $(ARGS)

test: system-packages $(DEV_STAMP) ## install what is missing, then lint, type-check and test
	$(MAKE) --no-print-directory style
	bash .ci/tests.sh

nightly: nightly-packages $(DOCS_STAMP) ## run the long tests, documentation included (ARGS="--minutes 40")
	HYPOTHESIS_PROFILE=nightly $(BIN)/python -m pytest -m "nightly or hypothesis" --durations=10 $(ARGS)

golden: $(DEV_STAMP) ## keep the outputs of the commands anew (ARGS="report thesis-json"); read the difference
	PYTHONPATH=tests $(BIN)/python -m golden $(ARGS)

reliability: system-packages $(DEV_STAMP) ## try to break it, and write docs/reliability.md (ARGS="--fraction 0.01")
	PYTHONPATH=tests $(BIN)/python -m reliability $(ARGS)

coverage: system-packages $(DEV_STAMP) ## run the tests and say which lines none of them reaches
	rm -f .coverage
	bash .ci/tests.sh --cov --cov-append --cov-report=
	$(BIN)/python -m coverage report

lint: style ## format check, ruff, import contracts, pyright
	$(BIN)/pyright

style: $(DEV_STAMP)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/lint-imports --no-logo

format: $(DEV_STAMP) ## format the code and apply safe fixes
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

bench: system-packages $(DEV_STAMP) ## run every benchmark and write docs/performance.md
	$(BIN)/python benchmarks/run.py $(ARGS)

screenshots: system-packages $(DEV_STAMP) ## take the pictures of README and docs anew
	$(BIN)/python examples/screenshots.py $(ARGS)

thumbnails: system-packages $(DEV_STAMP) ## draw the pictures of the list of scenes anew (ARGS="ur10")
	$(BIN)/python examples/thumbnails.py $(ARGS)

docs: system-packages $(DOCS_STAMP) ## build the documentation site into docs/_build/html, run its doctests
	$(SPHINX) docs/_build/html -b html -W --keep-going $(ARGS)
	$(BIN)/python docs/_ext/check_links.py docs/_build/html
	$(BIN)/python -m pytest -q tests/documentation --deselect tests/documentation/test_build.py

linkcheck: docs ## check the links of the site; what cannot be asked without a network is listed
	$(SPHINX) docs/_build/linkcheck -b linkcheck -q || true
	$(BIN)/python docs/_ext/check_links.py docs/_build/html docs/_build/linkcheck/output.json

drawings: $(DOCS_STAMP) ## draw the pictures of docs/model.md anew
	$(BIN)/python docs/drawings.py

dist: $(DOCS_STAMP) ## build wheel and sdist into dist/, the same bytes every time
	bash .ci/dist.sh $(BIN)/python dist

packaging: system-packages $(DOCS_STAMP) ## try the wheel in empty environments: each Python, lowest and newest packages
	bash .ci/packaging.sh $(ARGS)

clean: ## remove what the other targets made, .venv included
	rm -rf $(VENV) build dist htmlcov docs/_build docs/gallery docs/reference/generated .coverage .coverage.* \
	    .pytest_cache .ruff_cache .hypothesis .import_linter_cache
	find src tests benchmarks examples -name __pycache__ -type d -prune -exec rm -rf {} + 2>/dev/null || true

system-packages:
	@bash .ci/system-packages.sh

nightly-packages:
	@bash .ci/system-packages.sh nginx-light openssl

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

$(DOCS_STAMP): pyproject.toml constraints.txt | $(BIN)/python
	$(PIP_INSTALL) hatchling editables
	$(PIP_INSTALL) --no-build-isolation -e '.[test,dev,docs]'
	@touch $(RUN_STAMP) $(DEV_STAMP) $@
