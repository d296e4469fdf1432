# posture: install, train, evaluate, check. `make` lists the targets.

# 3.11 is what constraints.txt was resolved on; another python3 serves where it is missing.
PYTHON ?= $(shell python3.11 -c '' 2>/dev/null && echo python3.11 || echo python3)
ARGS ?=
BIN := .venv/bin
STAMP := .venv/.installed

.DEFAULT_GOAL := help
ARGUMENTS = $(if $(seeds),seeds=$(seeds)) $(ARGS)

.PHONY: help setup play film train eval theory reproduce benchmark docs paper test test-slow test-gpu lint types check clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-10s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)
	@echo "Arguments: make train ARGS='env.freq=0.4 seed=1'; another interpreter: PYTHON=python3.12"

setup: $(STAMP) ## create .venv and install (again when pyproject.toml, setup.py or constraints.txt change)

$(STAMP): pyproject.toml setup.py constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || { \
		echo "posture needs Python >= 3.11, but PYTHON=$(PYTHON) is $$($(PYTHON) --version 2>&1 | head -n 1);" \
			"name a newer one, e.g. make setup PYTHON=python3.11" >&2; exit 1; }
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[dev]'
	@touch $@

play: setup ## a trained stander live in the browser; Hydra overrides in ARGS
	$(BIN)/python -m posture.play browser=true $(ARGS)

film: setup ## films of a policy, MP4 and GIF; Hydra overrides in ARGS
	$(BIN)/python -m posture.film $(ARGS)

train: setup ## train and evaluate a policy; Hydra overrides in ARGS
	$(BIN)/python -m posture.train $(ARGS)

eval: setup ## evaluate a trained policy; Hydra overrides in ARGS
	$(BIN)/python -m posture.eval $(ARGS)

theory: setup ## the torque-optimal stander, without learning; Hydra overrides in ARGS
	$(BIN)/python -m posture.theory $(ARGS)

reproduce: setup ## every experiment of the paper, and the report; seeds=1 for a policy of each condition; Hydra overrides in ARGS
	$(BIN)/python -m posture.reproduce $(ARGUMENTS)

benchmark: setup ## measure engines and learners (long)
	$(BIN)/python benchmarks/speed.py
	$(BIN)/python benchmarks/engines.py
	$(BIN)/python benchmarks/learners.py

docs: setup ## build the documentation site in build/site, with every broken link an error; Sphinx options in ARGS
	rm -rf build/site
	$(BIN)/python -m sphinx --quiet --fail-on-warning --keep-going --fresh-env -d build/doctrees -c docs $(ARGS) . build/site
	@echo "build/site/index.html"

paper: setup ## the paper on this software as one HTML file, build/paper.html
	$(BIN)/python docs/paper.py build/paper.html
	@echo "build/paper.html"

test: setup ## run the quick tests, on several cores; pytest options in ARGS
	$(BIN)/python -m pytest -n auto --maxprocesses 4 --dist worksteal --durations 40 $(ARGS)

test-slow: setup ## run the slow tests alone; pytest options in ARGS
	$(BIN)/python -m pytest -m slow $(ARGS)

test-gpu: setup ## run the tests that need a CUDA device; without one they are skipped; pytest options in ARGS
	$(BIN)/python -m pytest -m gpu -rs $(ARGS)

lint: setup ## check style, formatting and which package imports which
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports --no-logo

types: setup ## check types
	$(BIN)/mypy

check: lint types test ## lint, types and quick tests: what must pass before a commit

clean: ## remove caches and build output; never runs/ or .venv
	rm -rf build *.egg-info .pytest_cache .ruff_cache .mypy_cache .hypothesis .import_linter_cache
	find posture envs tests -type d -name __pycache__ -prune -exec rm -rf {} +
