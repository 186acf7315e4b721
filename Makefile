# Every target installs what it needs into .venv, and is quick when that is done already.

PYTHON ?= python3
VENV := .venv
RUN := $(VENV)/bin/python

# The demo's packages are compiled when they are first imported, most of them never; with this,
# Python keeps what it compiled.
export PYTHONDONTWRITEBYTECODE :=

# Fails if a link leads nowhere. With --quiet, mkdocs would count no warning, and never fail.
SITE := NO_MKDOCS_2_WARNING=1 $(RUN) -m mkdocs build --strict

.PHONY: help demo test test-all faults check docs bench parity clean
.NOTPARALLEL:

help:
	@echo "make demo      two robots hand a cube over, ten times"
	@echo "make test      the tests"
	@echo "make test-all  the tests, those that take minutes included"
	@echo "make faults    whatever can go wrong, tried; writes docs/faults.md"
	@echo "make check     lint, format, types, which room imports which, sizes, documentation, distribution"
	@echo "make docs      the documentation as a site: open site/index.html"
	@echo "make bench     what steps, resets, vectors and plans cost, beside native ManiSkill"
	@echo "make parity    every task beside native ManiSkill; writes docs/parity.md's table"
	@echo "make clean     remove .venv"

demo: $(VENV)/.demo
	$(RUN) -m robot_layouts demo $(ARGS)

# One thread a process: the tests share the cores among processes, and results stay the same.
# To collect the faults, which are tried by `make faults`, takes every process some seconds.
test: $(VENV)/.test
	OMP_NUM_THREADS=1 $(RUN) -m pytest -n auto --maxprocesses 8 --ignore tests/faults $(ARGS)

test-all: $(VENV)/.test
	OMP_NUM_THREADS=1 $(RUN) -m pytest -n auto --maxprocesses 8 --ignore tests/faults \
		-m "not fault" $(ARGS)

# However it hangs, a fault fails after so many seconds.
faults: $(VENV)/.test
	OMP_NUM_THREADS=1 $(RUN) -m pytest -n auto --maxprocesses 8 -m fault --timeout 180 \
		--write-faults docs/faults.md --list-faults runs/faults.md tests/faults $(ARGS)

check: $(VENV)/.check
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check .
	$(RUN) -m pyright --pythonpath $(RUN)
	$(VENV)/bin/lint-imports
	$(RUN) .ci/budget.py
	$(RUN) .ci/house.py
	$(RUN) -m parity tables --check
	$(RUN) -m benchmarks tables --check
	$(RUN) -m benchmarks gallery --check
	$(SITE)
	rm -rf $(VENV)/dist && $(RUN) -m hatchling build --directory $(VENV)/dist
	$(RUN) -m twine check --strict $(VENV)/dist/*

docs: $(VENV)/.docs
	$(SITE)
	@echo "Open site/index.html."

# ARGS="--record" keeps the figures for docs/parity.md.
bench: $(VENV)/.test
	OMP_NUM_THREADS=1 $(RUN) -m benchmarks bench --native --out runs/bench $(ARGS)
	OMP_NUM_THREADS=1 $(RUN) -m benchmarks collisions
	OMP_NUM_THREADS=1 $(RUN) -m benchmarks planning --cells 14 --queries 10 \
		--out runs/bench/planning.jsonl
	$(RUN) -m benchmarks tables
	$(RUN) -m benchmarks gallery

# ARGS="--demos DIR" plays recorded demonstrations as well.
parity: $(VENV)/.test
	OMP_NUM_THREADS=1 $(RUN) -m parity compare --all --record $(ARGS)
	$(RUN) -m parity tables
	$(RUN) -m benchmarks gallery

clean:
	rm -rf $(VENV)

# An installation that was cut short leaves .unfinished behind and is made anew.
define install
	@if [ -e $(VENV)/.unfinished ]; then rm -rf $(VENV); fi
	@echo "Installing robot-layouts[$(1)] into $(VENV) (the first time takes some minutes)."
	@test -x $(VENV)/bin/pip || $(PYTHON) -m venv $(VENV)
	@touch $(VENV)/.unfinished
	@$(RUN) -m pip install --quiet --disable-pip-version-check $(2) -c constraints.txt -e '.[$(1)]'
	@rm $(VENV)/.unfinished && touch $@
endef

$(VENV)/.demo: pyproject.toml constraints.txt
	$(call install,demo,--no-compile)

$(VENV)/.test: pyproject.toml constraints.txt
	$(call install,test)

$(VENV)/.docs: pyproject.toml constraints.txt
	$(call install,docs)

$(VENV)/.check: pyproject.toml constraints.txt
	$(call install,check)
