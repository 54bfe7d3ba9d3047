# What a person does with a clone. Needs make and a Python 3.10 to 3.14 with venv; `make help` lists everything.
SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help

VENV ?= .venv
BIN := $(VENV)/bin
PIP := PIP_NO_COMPILE=1 $(BIN)/python -m pip --disable-pip-version-check --quiet
# (pip would compile thousands of files that are never imported)
CHOOSE := $(BIN)/uv pip compile pyproject.toml --quiet --upgrade --universal --python-version 3.10 \
	--no-header --no-annotate --no-emit-index-url --no-emit-find-links --constraint requirements/limits.in
OUT ?= demo

# A Python is usable when it starts, is of a supported version and can make environments with pip in them.
USABLE := import sys, venv, ensurepip; sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, 14))
PYTHON ?= $(shell for p in python3.13 python3.14 python3.12 python3.11 python3.10 python3; do \
	"$$p" -c '$(USABLE)' >/dev/null 2>&1 && echo "$$p" && break; done)

# The package itself is installed editable; only what these files say makes another installation necessary.
RECIPE := pyproject.toml Makefile

.PHONY: help demo test lint format types docs compare wheel lock clean

help: ## list the targets
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## /  make \1\t/' | expand -t 16
	@echo '  PYTHON=/path/to/python chooses the interpreter; VENV=folder the environment (.venv)'

demo: $(VENV)/.run ## pose a person reaching into a shelf, and say where the pictures are
	$(BIN)/wholebody demo --out $(OUT)

test: $(VENV)/.test ## run the tests on two cores (ARGS="-k name" passes arguments to pytest)
	$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder $(ARGS) # a third on two cores makes all slower: 296 s, not 261

lint: $(VENV)/.test ## check style and formatting
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

format: $(VENV)/.test ## mend style and formatting
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

types: $(VENV)/.test ## check types strictly
	$(BIN)/mypy

docs: $(VENV)/.docs ## build the documentation into site/, with every link checked
	$(BIN)/mkdocs build --strict --clean

compare: $(VENV)/.compare ## add the other tools and QP solvers that `wholebody bench` can be compared with
	$(BIN)/wholebody doctor

wheel: $(VENV)/.test ## build the source archive into dist/, and the wheel, which has the compiled loops for this Python
	rm -rf dist
	$(BIN)/python -m wholebody.base.compiled --precompile
	$(BIN)/python -m build --no-isolation --outdir dist --sdist --wheel .
	rm -rf wholebody/base/precompiled

lock: $(VENV)/.lock ## choose the newest versions that work together and write them to requirements/
	$(CHOOSE) --extra placo --output-file requirements/run.txt
	$(CHOOSE) --constraint requirements/run.txt --extra placo --extra test --extra build --output-file requirements/test.txt
	$(CHOOSE) --constraint requirements/run.txt --extra docs --output-file requirements/docs.txt
	$(CHOOSE) --constraint requirements/test.txt --extra placo --extra solvers --extra compare --output-file requirements/compare.txt

clean: ## remove the environment and everything that was built
	rm -rf $(VENV) build dist site demo .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find wholebody tests examples docs -name __pycache__ -type d -prune -exec rm -rf {} +

# Each stamp says that what its list names is installed; made again when a list changes.
$(BIN)/python:
	@test -n "$(PYTHON)" && "$(PYTHON)" -c '$(USABLE)' 2>/dev/null || { echo "wholebody needs a Python 3.10 to 3.14 with venv\
	 ($(if $(PYTHON),$(PYTHON) is not one,none was found)): install python3 and python3-venv, or say make PYTHON=/path/to/python." >&2; exit 1; }
	@echo "Making the environment $(VENV) with $(PYTHON) (a few minutes the first time) ..."
	"$(PYTHON)" -m venv $(VENV)

$(VENV)/.run: requirements/run.txt $(RECIPE) | $(BIN)/python
	$(PIP) install -r requirements/run.txt
	$(PIP) install --no-deps --editable .
	$(BIN)/python -m wholebody.base.compiled
	touch $@

$(VENV)/.test: requirements/test.txt $(VENV)/.run
	$(PIP) install -r requirements/test.txt
	touch $@

$(VENV)/.docs: requirements/docs.txt $(VENV)/.run
	$(PIP) install -r requirements/docs.txt
	touch $@

$(VENV)/.compare: requirements/compare.txt $(VENV)/.test
	$(PIP) install -r requirements/compare.txt
	touch $@

$(VENV)/.lock: | $(BIN)/python
	$(PIP) install uv
	touch $@
