# From a fresh clone: `make report`. Needs Python 3.11-3.14 with venv, git and make.
PYTHON ?= python3
PROFILE ?= full
PORT ?= 8888
UV ?= uv

BIN := .venv/bin
INSTALLED := .venv/.installed
INSTALLING := .venv/.installing
# JupyterLab needs this option if the user is root, as in containers.
AS_ROOT := $(if $(filter 0,$(shell id -u)),--allow-root)
export PIP_DISABLE_PIP_VERSION_CHECK := 1
export PIP_NO_INPUT := 1

.DEFAULT_GOAL := help
.PHONY: help setup system report test wheel-check test-lowest lab doctor lint coverage mutants lock release clean

help:
	@echo "make report [PROFILE=full]        run the study and build the report; quick, deep"
	@echo "make test                         run the tests, notebooks included"
	@echo "make wheel-check                  build the wheel, install and use it elsewhere"
	@echo "make test-lowest                  test on the lowest versions allowed"
	@echo "make lab                          open the notebooks in JupyterLab"
	@echo "make doctor                       check the installation, line by line"
	@echo "make lint                         check style, types, imports and spelling"
	@echo "make coverage                     run the tests, and list the lines they do not reach"
	@echo "make mutants                      change the code at random: do the tests fail?"
	@echo "make lock                         pin the environment again (needs uv)"
	@echo "make release VERSION=1.0.0        tag a version, with its report, wheel and checksums"
	@echo "make clean                        remove build results, but no downloads"

report: setup
	@$(BIN)/hicp report --profile $(PROFILE)

test: setup
	@$(BIN)/python -m pytest -n logical --dist loadfile $(PYTEST_ARGS)

wheel-check:
	@PYTHON=$(PYTHON) tools/wheel_check.sh

test-lowest:
	@UV=$(UV) tools/test_lowest.sh

lab: setup
	@$(BIN)/jupyter lab --notebook-dir=. --port=$(PORT) $(AS_ROOT) notebooks/00_quickstart.ipynb

doctor: $(INSTALLED)
	@$(BIN)/hicp doctor

# Everything in .pre-commit-config.yaml, from the locked environment, without network.
lint: $(INSTALLED)
	@$(BIN)/pre-commit run --all-files

coverage: setup
	@$(BIN)/python -m pytest -n logical --dist loadfile --cov --cov-report=term:skip-covered $(PYTEST_ARGS)

# Runs for hours; a sample: make mutants MUTANTS_ARGS="--n 60"
mutants: setup
	@$(BIN)/python tools/mutate.py $(MUTANTS_ARGS)

# Without a network, everything that is committed still runs, and the report says what is missing.
setup: $(INSTALLED) system
	@$(BIN)/hicp models fetch || echo "make: going on without MediaPipe's weights" >&2

# The locked environment. mediapipe's wheel declares two packages that the study leaves out
# (see pyproject.toml), hence --no-deps: the lock is complete.
# editable_mode=compat: otherwise every start of Python imports a finder for the package data.
# Where Python may not write bytecode (PYTHONDONTWRITEBYTECODE), every process would compile all its imports again.
# A marker file identifies an interrupted installation, which is then repeated.
$(INSTALLED): environment.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 14))' || \
	  { echo "make: $(PYTHON) is not Python 3.11-3.14; name one that is: make PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' || \
	  { echo "make: $(PYTHON) has no venv; on Debian and Ubuntu: apt-get install python3-venv" >&2; exit 1; }
	@echo "Installing the locked environment into .venv (a minute or two; 2 GB) ..."
	@test ! -e $(INSTALLING) || rm -rf .venv
	@$(BIN)/python -c pass 2>/dev/null || $(PYTHON) -m venv --clear .venv
	@rm -f $(INSTALLED) && touch $(INSTALLING)
	@$(BIN)/python -m pip install -qq --no-deps --no-compile --only-binary :all: --require-hashes \
	  -r environment.lock || { echo "make: the environment could not be installed; it needs the package" \
	  "index, 4 GB of disk and, on Linux, glibc 2.35 (Debian 12, Ubuntu 22.04) or newer" >&2; exit 1; }
	@$(BIN)/python -m pip install -qq --no-deps --no-build-isolation --no-index --editable . \
	  --config-settings editable_mode=compat
	@$(BIN)/python -c 'import sys; sys.exit(sys.dont_write_bytecode)' || $(BIN)/python -m compileall -q -j 0 \
	  -x '/tests?/' "$$($(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')" >/dev/null || true
	@ln -sfn $(CURDIR)/tools/jupyter/* .venv/etc/jupyter/
	@rm $(INSTALLING) && touch $(INSTALLED)

# System libraries that the wheels load but do not contain: installed if permitted.
system: $(INSTALLED)
	@packages="$$($(BIN)/python -m hicp_lib.cli.system_libraries)"; \
	if [ -z "$$packages" ]; then exit 0; fi; \
	if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	  echo "Installing system libraries: $$packages"; \
	  apt-get update -qq && \
	  DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends $$packages >/dev/null; \
	else \
	  echo "make: system libraries are missing; run: sudo apt-get install $$packages" >&2; exit 1; \
	fi

lock:
	@command -v $(UV) >/dev/null || { echo "make: uv is missing; run: pip install uv" >&2; exit 1; }
	@$(UV) pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-annotate \
	  --extra all --group mediapipe --group test --group lint --group build --custom-compile-command "make lock" \
	  --output-file environment.lock pyproject.toml

# RELEASE_ARGS=--dry-run says what it would do
release: setup
	@$(BIN)/python tools/release.py $(or $(VERSION),$(error name the version: make release VERSION=1.0.0)) $(RELEASE_ARGS)

clean:
	@rm -rf _build results
