# Plain verbs. Each sets up .venv first, once: only Python 3 and its venv module are needed.
PYTHON ?= python3
BIN := .venv/bin
INSTALLED := .venv/.installed
# pytest loads torch before murmillo.envs, which would choose this (docs/benchmarks.md)
BENCH := GOMP_SPINCOUNT=10000 $(BIN)/python -m pytest benchmarks --benchmark-only

.DEFAULT_GOAL := help
.PHONY: help train test lint type bench bench-compare bench-baseline wheel clean

help:  ## list the verbs
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "make %-14s %s\n", $$1, $$2}' Makefile

$(INSTALLED): pyproject.toml constraints.txt
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --disable-pip-version-check --quiet -c constraints.txt -e '.[dev]'
	touch $@

train: $(INSTALLED)  ## train ASE on the built-in clips for seven minutes at most; ARGS="seed=2" adds settings
	$(BIN)/murmillo train $(ARGS)

test: $(INSTALLED)  ## run the tests; ARGS="-k rotations" adds pytest's options
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist loadfile $(ARGS)

lint: $(INSTALLED)  ## ruff and the import contracts
	$(BIN)/ruff check .
	$(BIN)/lint-imports --no-cache

type: $(INSTALLED)  ## pyright
	$(BIN)/pyright

bench: $(INSTALLED)  ## run the benchmarks, six minutes; ARGS="-k environments" some of them
	$(BENCH) $(ARGS)

bench-compare: $(INSTALLED)  ## run what the gate needs, and fail where a ratio has fallen by more than 15 %
	$(BENCH) -m gate $(ARGS)
	$(BIN)/python -m benchmarks.gate compare

bench-baseline: $(INSTALLED)  ## run the same on an idle machine, and keep its ratios as the baseline
	$(BENCH) -m gate $(ARGS)
	$(BIN)/python -m benchmarks.gate baseline

wheel: $(INSTALLED)  ## build dist/*.whl
	rm -rf build dist
	$(BIN)/python -m build --wheel --no-isolation

clean:  ## remove what the other verbs made, except runs/
	rm -rf .venv build dist *.egg-info .pytest_cache .ruff_cache .hypothesis .benchmarks
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
