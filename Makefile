# `make run` starts the service, `make test` passes every check; each first installs what it needs, into one place.
PORT ?= 8000
HOST ?= 127.0.0.1
PYTHON ?= python3
BIN := .venv/bin
# Groups of test files at a time.
PROCESSES ?= 2

.PHONY: run test lint types borders docs unit bench hooks constraints clean

# Workers compile at the first start what is not compiled yet, beside the first answers.
run: .venv/service
	$(BIN)/python -m app serve --host $(HOST) --port $(PORT)

# What looks at the code, beside what compiles it.
test: .venv/development
	$(MAKE) --jobs 2 --output-sync=line lint types borders docs .venv/compiled
	$(MAKE) unit

lint: .venv/development
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: .venv/development
	$(BIN)/mypy

borders: .venv/development
	$(BIN)/lint-imports

# A site of all pages, in .docs/site; a broken link is an error. The variable silences advertising for a fork.
docs: .venv/development
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --config-file .docs/mkdocs.yml

# The bytecode of tests takes each process six seconds to make, so it is kept whatever the environment says.
unit: export PYTHONDONTWRITEBYTECODE =
unit: .venv/compiled
	$(BIN)/python -m pytest --numprocesses $(PROCESSES) --dist loadfile --no-loadscope-reorder

bench: .venv/development
	$(BIN)/python tests/benchmarks/bench_simulator.py
	$(BIN)/python tests/benchmarks/bench_training.py
	$(BIN)/python tests/benchmarks/bench_local_search.py
	$(BIN)/python tests/benchmarks/bench_crash.py --quick
	$(BIN)/python tests/benchmarks/bench_missions.py days --quick
	$(BIN)/python tests/benchmarks/bench_load.py --quick
	$(BIN)/python tests/benchmarks/bench_mutations.py --quick
	$(BIN)/python tests/benchmarks/bench_slow_senders.py
	-$(BIN)/python tests/benchmarks/bench_overhead.py --quick
	-$(BIN)/python tests/benchmarks/bench_lateness.py --quick

# Every commit is checked from now on, as .pre-commit-config.yaml says.
hooks: .venv/development
	$(BIN)/pre-commit install

# Pins everything, from a clean environment: run it after a change of the dependencies.
constraints:
	rm -rf .venv-constraints
	$(PYTHON) -m venv .venv-constraints
	.venv-constraints/bin/pip install --quiet ".[dev]"
	.venv-constraints/bin/pip freeze --exclude uav-allocator --exclude pip --exclude setuptools | sed 's/+cpu$$//' > constraints.txt
	rm -rf .venv-constraints

# Bytecode is left to the first start, which writes a quarter of what there could be.
INSTALL = $(BIN)/pip install --quiet --disable-pip-version-check --no-compile --constraint constraints.txt --editable

.venv/service: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(INSTALL) ".[client]"
	.deploy/shrink $(BIN)/python
	touch $@

# Bytecode on all cores; pip would do that on one. What is left out is large, and nobody needs it, or one file of it.
.venv/development: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(INSTALL) ".[dev]"
	$(BIN)/python -m compileall -qq -j 0 -x '/(pymavlink/dialects|tests)/' .venv/lib || true
	touch .venv/service $@

# Once for all, so that several workers that start at once do not all do it.
.venv/compiled: .venv/development $(shell find app -name '*.py')
	$(BIN)/python -m app compile
	touch $@

clean:
	rm -rf .venv .docs/site build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find app policy_store tests -name __pycache__ -prune -exec rm -rf {} +
