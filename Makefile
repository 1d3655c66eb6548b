# The first that is there, of a version that every package has wheels for, and can make environments.
USABLE := import sys, ensurepip, venv; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 12))
PYTHON ?= $(firstword $(foreach name,python3.11 python3.12 python3,\
	$(shell $(name) -c "$(USABLE)" >/dev/null 2>&1 && echo $(name))))
BIN := .venv/bin
STAMP := .venv/.installed
BENCH_STAMP := .venv/.installed-bench
DOCS_STAMP := .venv/.installed-docs
DRAKE_STAMP := .venv/.installed-drake
OUT ?= logs/benchmark.json

.PHONY: demo test bench docs crosscheck lint type format assets clean

demo: $(STAMP)
	$(BIN)/fulcrum run box-tilt

test: $(STAMP)
	$(BIN)/pytest

# One process, nothing beside it: what is timed is compared within this run.
bench: $(BENCH_STAMP)
	$(BIN)/pytest tests/bench -n 0 --out $(OUT)

# Into site/, without network; warnings are errors, but with --quiet mkdocs would not count them.
docs: $(DOCS_STAMP)
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build
	@echo "site/index.html"

# The same run in MuJoCo and in Drake, and at half the step; fails where they disagree.
crosscheck: $(DRAKE_STAMP)
	$(BIN)/fulcrum crosscheck panda-box --controller margin

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

type: $(STAMP)
	$(BIN)/mypy

format: $(STAMP)
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# Rewrites the MJCF files that are made from data: the robot from its URDF, the scenes and the
# schema from scenarios.
assets: $(STAMP)
	$(BIN)/python -m fulcrum.assets.from_urdf
	$(BIN)/python -m fulcrum.scenarios.scene_files

$(STAMP): pyproject.toml constraints.txt
	@test -n "$(PYTHON)" || { echo "fulcrum needs Python 3.11 or 3.12 with its module venv:" \
		"install one, or name it: make PYTHON=/path/to/python3.12" >&2; exit 1; }
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[dev]"
	touch $@

$(BENCH_STAMP): $(STAMP)
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[dev,bench]"
	touch $@

$(DRAKE_STAMP): $(STAMP)
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[dev,drake]"
	touch $@

$(DOCS_STAMP): $(STAMP)
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[dev,docs]"
	touch $@

clean:
	rm -rf .venv site
