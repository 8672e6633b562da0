# `make run` and `make test` are all that is needed on a fresh machine with Python 3.10 or newer.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
STUBS := clients/python/ual/v1
PROTOS := proto/ual/v1/ual.proto proto/ual/v1/simulation.proto
GENERATED_STUBS_OF = $(BIN)/python -m grpc_tools.protoc --proto_path=proto --plugin=$(BIN)/protoc-gen-mypy \
	--plugin=$(BIN)/protoc-gen-mypy_grpc --python_out=$(1) --grpc_python_out=$(1) --mypy_out=quiet:$(1) \
	--mypy_grpc_out=quiet:$(1) $(PROTOS)

.PHONY: help install run test lint format proto proto-check bench clean

help:  ## What can be made
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 14

install: $(INSTALLED)  ## Both programs into .venv: ual-daemon and ual

$(INSTALLED): pyproject.toml clients/python/pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e clients/python -e '.[dev]'
	touch $@

run: $(INSTALLED)  ## Flies: a light (simulated) UAV, uav_1, armed by its simulated safety pilot
	@echo 'In another terminal: . $(BIN)/activate; ual takeoff 3; ual goto 4 2 3; ual land'
	$(BIN)/ual-daemon --backend light --ns uav_1 --auto-arm

test: $(INSTALLED)  ## The tests, but those that need a real autopilot
	$(BIN)/python -m pytest -n auto

lint: $(INSTALLED) tools/node_modules  ## Style, types, import contracts, the contract's style
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	tools/node_modules/.bin/buf lint

tools/node_modules: tools/package.json
	npm install --prefix tools --no-package-lock --no-fund --no-audit
	touch $@

format: $(INSTALLED)  ## The code in its style
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

proto: $(INSTALLED)  ## The stubs of the contract, from proto/ into clients/python/ual/v1
	$(call GENERATED_STUBS_OF,clients/python)

proto-check: $(INSTALLED)  ## Fails when the committed stubs are not those of the contract
	rm -rf build/proto && mkdir -p build/proto
	$(call GENERATED_STUBS_OF,build/proto)
	diff -r --exclude=__pycache__ --exclude=__init__.py build/proto/ual/v1 $(STUBS) \
		|| { echo 'the stubs are out of date: make proto'; exit 1; }

bench: $(INSTALLED)  ## How fast setpoints are
	$(BIN)/python benchmarks/setpoints.py

clean:  ## Everything that was made here
	rm -rf $(VENV) build dist tools/node_modules .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
