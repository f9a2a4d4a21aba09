# `make reports/roc.pdf` and `make test` do everything on a bare machine: they make .venv first, once.
#
#   make reports/roc.pdf   the figure, from whatever is in data/raw (CORES=8 make … for more than two cores)
#   make all               everything that the workflow makes
#   make test              lint, then every test but the long ones: a quarter of an hour on two cores
#   make test-all          lint, then every test, as CI does
#   make docs              the documentation site, build/docs/index.html
#   make setup             .venv alone
#   make track             record in MLflow the calls that it lacks
#   make mlflow-server     a team's MLflow on PostgreSQL, until Ctrl-C (SERVER="--host 0.0.0.0 --allowed-hosts …" make …)

SHELL := /bin/bash
CORES ?= 2
VENV := .venv
STAMP := $(VENV)/.complete
BIN := $(VENV)/bin
SYSTEM_LIBRARIES := libegl1 libgl1 libgomp1 libusb-1.0-0
# pybullet has wheels up to Python 3.11; on 3.12 pip compiles it and needs g++.
PYTHONS := python3.11 python3.12 python3
TYPED := src
# Tests run as the workflow's jobs do, one thread each: two processes with two threads each wait for each other most of the time.
ONE_THREAD := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1
TESTS = $(ONE_THREAD) $(BIN)/python -m pytest -n $(CORES) --dist loadscope

.PHONY: all test test-all lint docs setup format track mlflow-server FORCE
.DELETE_ON_ERROR:

all: $(STAMP)
	$(BIN)/snakemake -c$(CORES)

reports/%: $(STAMP) FORCE
	$(BIN)/snakemake -c$(CORES) $@

test: lint
	$(TESTS) -m "not long"

test-all: lint
	$(TESTS)

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/snakefmt --check --line-length 110 Snakefile workflow
	$(BIN)/mypy $(TYPED)

docs: $(STAMP)
	$(BIN)/sphinx-build -W --keep-going -q docs build/docs
	@echo "build/docs/index.html"

format: $(STAMP)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(BIN)/snakefmt --line-length 110 Snakefile workflow

setup: $(STAMP)

track: $(STAMP)
	$(BIN)/python -m pipeline.track again

mlflow-server: $(STAMP)
	$(BIN)/python -m pipeline.track.server $(SERVER)

$(STAMP): requirements.txt pyproject.toml
	@set -e; \
	fits='import sys, venv, ensurepip; sys.exit(not (3, 11) <= sys.version_info < (3, 13))'; \
	for candidate in $${PYTHON:-} $(PYTHONS); do \
	  if $$candidate -c "$$fits" 2>/dev/null; then python=$$candidate; break; fi; \
	done; \
	if [ -z "$${python:-}" ]; then \
	  echo "error: expected Python 3.11 or 3.12 with venv and pip, found none; install it (Debian 12: apt-get install python3.11-venv) or run PYTHON=/path/to/python3.11 make …" >&2; \
	  exit 1; \
	fi; \
	test -x $(BIN)/python && $(BIN)/python -c "$$fits" 2>/dev/null || $$python -m venv --clear $(VENV); \
	echo "Installing the packages of requirements.txt in $(VENV) (about 2.5 GB, some minutes)"; \
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r requirements.txt; \
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@$(MAKE) --no-print-directory .system-libraries
	@touch $@

# Open3D loads these when it is imported.
.PHONY: .system-libraries
.system-libraries:
	@if ! $(BIN)/python -c 'import open3d' 2>/dev/null; then \
	  install='apt-get update -qq && apt-get install -y -qq --no-install-recommends $(SYSTEM_LIBRARIES)'; \
	  echo "Open3D needs system libraries: $(SYSTEM_LIBRARIES)"; \
	  if ! command -v apt-get >/dev/null; then true; \
	  elif [ "$$(id -u)" = 0 ]; then bash -c "$$install" || true; \
	  elif sudo -n true 2>/dev/null; then sudo -n bash -c "$$install" || true; fi; \
	  if ! reason=$$($(BIN)/python -c 'import open3d' 2>&1); then \
	    echo "error: expected that Open3D can be imported, found: $$(tail -n 1 <<<"$$reason"); run: sudo apt-get install $(SYSTEM_LIBRARIES)" >&2; \
	    exit 1; \
	  fi; \
	fi
