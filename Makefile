# Every target makes the environment in .venv first, system libraries included, where that is not done yet.

.DEFAULT_GOAL := help
.PHONY: help setup demo test test-lowest fuzz lint types bench kill check-exports check-export-files docs lock clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-18s %s\n", $$1, $$2}' Makefile

setup: ## make .venv with graspdb and all it needs
	@tools/setup.sh

demo: setup ## simulate a session, ingest it into demo/ and show what came out
	.venv/bin/graspdb demo demo

# One process a core runs the tests, so none of them shares out its matrices as well.
test test-lowest: export OMP_NUM_THREADS = 1
test test-lowest: export OPENBLAS_NUM_THREADS = 1

test: setup ## run the tests
	.venv/bin/python -m pytest

test-lowest: ## run the tests with the lowest versions that pyproject.toml allows
	@tools/setup.sh .venv-lowest constraints-lowest.txt
	.venv-lowest/bin/python -m pytest

fuzz: setup ## check 10,000 damaged sessions, in one process with 2 GB
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 .venv/bin/python tests/fuzz.py 10000

lint: setup ## check style and docstrings
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .

types: setup ## check types
	.venv/bin/mypy

bench: setup ## run the benchmarks, or NAME="similar speed" alone; print a table, write bench.json
	.venv/bin/python tests/benchmarks/run.py $(if $(NAME),"$(NAME)")

kill: setup ## kill 200 ingests, or N=20, at random moments, and see that nothing is lost
	.venv/bin/python tests/kill_ingest.py $(N)

check-exports: setup ## read exports with lerobot, robomimic and others, in an environment of its own (6 GB)
	tools/check_exports.sh

check-export-files: setup ## read exports with OpenSim, retarget to a robot hand, in environments of their own (2 GB)
	tools/check_export_files.sh

docs: setup ## write the pages of docs/ that come from the code
	.venv/bin/python tools/write_docs.py

lock: ## write constraints.txt and constraints-lowest.txt anew
	@tools/lock.sh

clean: ## remove environments, caches and built files
	rm -rf .venv .venv-lowest .venv-exports .venv-opensim .venv-retarget build dist bench.json .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
