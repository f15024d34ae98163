# `make run` starts the service, `make test` passes every check; both do the whole set-up first.
PORT ?= 8000
HOST ?= 127.0.0.1
PYTHON ?= python3
BIN := .venv/bin
# Groups of test files at a time.
PROCESSES ?= 2

.PHONY: run test lint types borders unit bench constraints clean

run: .venv/compiled
	$(BIN)/python -m app serve --host $(HOST) --port $(PORT)

# What looks at the code, beside what compiles it.
test: .venv/installed
	$(MAKE) --jobs 2 --output-sync=line lint types borders .venv/compiled
	$(MAKE) unit

lint: .venv/installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: .venv/installed
	$(BIN)/mypy

borders: .venv/installed
	$(BIN)/lint-imports

unit: .venv/compiled
	$(BIN)/python -m pytest --numprocesses $(PROCESSES) --dist loadfile --no-loadscope-reorder

bench: .venv/installed
	$(BIN)/python tests/benchmarks/bench_simulator.py
	$(BIN)/python tests/benchmarks/bench_training.py
	$(BIN)/python tests/benchmarks/bench_local_search.py
	$(BIN)/python tests/benchmarks/bench_crash.py --quick
	$(BIN)/python tests/benchmarks/bench_load.py --quick
	$(BIN)/python tests/benchmarks/bench_mutations.py --quick
	$(BIN)/python tests/benchmarks/bench_slow_senders.py
	-$(BIN)/python tests/benchmarks/bench_overhead.py --quick
	-$(BIN)/python tests/benchmarks/bench_lateness.py --quick

# Pins everything, from a clean environment: run it after a change of the dependencies.
constraints:
	rm -rf .venv-constraints
	$(PYTHON) -m venv .venv-constraints
	.venv-constraints/bin/pip install --quiet ".[dev]"
	.venv-constraints/bin/pip freeze --exclude uav-allocator --exclude pip --exclude setuptools | sed 's/+cpu$$//' > constraints.txt
	rm -rf .venv-constraints

# On all cores; pip would do that on one. What is left out is large, and nobody needs it, or one file of it.
.venv/installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check --no-compile --constraint constraints.txt --editable ".[dev]"
	$(BIN)/python -m compileall -qq -j 0 -x '/(pymavlink/dialects|tests)/' .venv/lib || true
	touch $@

# Once for all, so that several workers that start at once do not all do it.
.venv/compiled: .venv/installed $(shell find app -name '*.py')
	$(BIN)/python -m app compile
	touch $@

clean:
	rm -rf .venv build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find app policy_store tests -name __pycache__ -prune -exec rm -rf {} +
