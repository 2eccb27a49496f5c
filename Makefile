# Needs python3 >= 3.11 and make, nothing else. Each target installs what it needs into .venv first.
PYTHON ?= python3
BIN := .venv/bin
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable

.PHONY: demo test setup lint types unit pictures clean

demo: .venv/core.stamp
	$(BIN)/towline demo

test: lint types unit

setup: .venv/dev.stamp
	$(INSTALL) ".[viewer,cluster,mujoco,timing,mesh,bench,notebooks,docs,dev]"

lint: .venv/dev.stamp
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: .venv/dev.stamp
	$(BIN)/basedpyright --pythonpath $(BIN)/python

unit: .venv/dev.stamp
	$(BIN)/python -m pytest -n 2

# Runs every example where the README's pictures are; the plans that they save there are ignored by git.
pictures: .venv/core.stamp
	mkdir -p docs/pictures
	cd docs/pictures && for example in ../../examples/*.py; do ../../$(BIN)/python $$example || exit 1; done

clean:
	rm -rf .venv towline-demo build *.egg-info

.venv/core.stamp: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "towline needs python3 >= 3.11, this is " + sys.version.split()[0] + ": make PYTHON=python3.11")'
	$(PYTHON) -m venv .venv
	$(INSTALL) .
	touch $@

.venv/dev.stamp: .venv/core.stamp
	$(INSTALL) ".[bench,cluster,dev,mesh,mujoco,notebooks,timing]"
	touch $@
