# Two commands from a bare Python to a result: `make demo` and `make test`. Both set themselves up.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.PHONY: demo test test-all from-wheel lint clean

demo: $(VENV)/.installed  ## install and run the whole way once: about four minutes
	$(BIN)/dotmask run fr3_walking_xyz --out runs/demo-$$(date +%Y%m%d-%H%M%S)

test: $(VENV)/.installed-dev  ## install and run the tests but the long ones
	$(BIN)/python -m pytest -m "not slow" -n auto --dist loadfile --cov --cov-report=term --cov-fail-under=85 $(PYTEST_ARGS)

test-all: $(VENV)/.installed-dev  ## install and run all tests
	$(BIN)/python -m pytest -n auto --dist loadfile $(PYTEST_ARGS)

from-wheel: $(VENV)/.installed-dev  ## the wheel in an environment of its own: sweep, Gymnasium, examples/ci
	$(BIN)/python .ci/from_wheel.py

lint: $(VENV)/.installed-dev  ## style, types, dependency rule, spelling
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/codespell

$(VENV)/bin/python:
	$(PYTHON) -c 'import sys; v = sys.version_info; sys.exit(0 if (3, 11) <= v < (3, 14) else "dotmask needs Python 3.11 to 3.13, this is %d.%d: make PYTHON=/path/to/python3.11" % v[:2])'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(BIN)/pip install --quiet --constraint constraints.txt --editable .
	touch $@

$(VENV)/.installed-dev: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(BIN)/pip install --quiet --constraint constraints.txt --editable '.[dev]'
	touch $@ $(VENV)/.installed

clean:  ## remove what the commands above made
	rm -rf $(VENV) runs .pytest_cache .mypy_cache .ruff_cache .coverage
