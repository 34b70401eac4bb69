# `make demo` and `make test` are each all that a fresh machine with Python 3.11 needs:
# they make .venv, install into it and see to an OpenCL device, without root or a compiler.

PYTHON ?= python3
VENV ?= .venv
PY := $(VENV)/bin/python
PIP := $(PY) -m pip --disable-pip-version-check -qq

.PHONY: help demo test quick slow portable browser lint docs prose links mutants fuzz cpu clean

help:
	@echo "make demo    textures from real samples, into ./demo"
	@echo "make test    the tests"
	@echo "make quick   the tests of the NumPy reference that mutation testing runs; no device is needed"
	@echo "make slow    the tests that take long or need the package index"
	@echo "make portable the kernels compiled for GPUs by clang 15: registers and scratch, into docs/devices"
	@echo "make browser what tests in a browser need of npm; Chromium and its driver are the system's"
	@echo "make lint    ruff and mypy"
	@echo "make docs    the documentation, into docs/_build/html; checks its prose, links and pages"
	@echo "make prose   a check of the documentation's prose alone"
	@echo "make links   whether the links of the documentation to other sites still lead there; needs the network"
	@echo "make mutants mutation tests of the Markov random field"
	@echo "make fuzz    random command lines and damaged files, for MINUTES=10"
	@echo "make cpu     the CPU runtime of the package index, beside what is here already"
	@echo "make dist    the wheel and the source distribution, into dist, checked and tried"
	@echo "make clean   remove what these commands made, except $(VENV)"
	@echo "Another Python: make PYTHON=python3.12 ..."

# $(call install,NAME,EXTRAS): install once, again only when pyproject.toml or Python's version changed.
define install
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo "simdtex needs Python 3.11 or newer; name one with make PYTHON=python3.11"; exit 1; }
	@test "$$($(PY) -V 2>&1)" = "$$($(PYTHON) -V)" || \
	    { echo "Making the environment $(VENV) ..." && $(PYTHON) -m venv --clear $(VENV); }
	@cmp -s pyproject.toml $(VENV)/installed-$(1) || \
	    { echo "Installing simdtex$(2) into $(VENV) ..." && $(PIP) install --editable '.$(2)' && \
	      cp pyproject.toml $(VENV)/installed-$(1); }
endef

# A usable device already here (a GPU, PoCL) is used; else the Intel CPU runtime is installed, once.
ENSURE := $(PY) -c 'import sys; from simdtex.machine.devices import main; sys.exit(main())'
define device
	@$(ENSURE) 2>/dev/null || \
	    { echo "No OpenCL device works here yet: installing a CPU runtime from the package index (about 250 MB) ..." && \
	      $(PIP) install --editable '.[cpu]' && $(ENSURE); } || \
	    { echo "No OpenCL device works here: install a GPU driver or PoCL (Debian: apt install pocl-opencl-icd;" \
	           "conda: conda install pocl), or set SIMDTEX_DEVICE=reference to run slowly without."; exit 1; }
endef

demo:
	$(call install,base,)
	$(device)
	@$(VENV)/bin/simdtex demo

# JOBS=0 runs the tests one after another in this process, as one wants in a debugger.
# ONLY=Intel runs the tests that have a word in their name, here those on the devices of a platform.
# The tests start some hundred processes, each of which would compile the package where no bytecode is kept.
JOBS ?= auto
ONLY ?=
test:
	$(call install,test,[test])
	$(device)
	@PYTHONDONTWRITEBYTECODE= $(PY) -m pytest --numprocesses $(JOBS) --maxprocesses 4 --dist worksteal -k '$(ONLY)'

# The list is that of `make mutants`: what these tests do not notice, mutation testing does not either.
QUICK := import tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["tool"]["mutmut"]["pytest_add_cli_args_test_selection"])
quick:
	$(call install,test,[test])
	@SIMDTEX_REQUIRE_OPENCL= OCL_ICD_VENDORS=/nonexistent $(PY) -m pytest --numprocesses $(JOBS) --maxprocesses 4 $$($(PY) -c '$(QUICK)')

# After a crash of a process --dist loadfile would wait for ever for tests that are done; so the run ends.
slow:
	$(call install,slow,[slow])
	$(device)
	@$(PY) -m pytest -m slow --numprocesses $(JOBS) --maxprocesses 4 --dist loadfile --max-worker-restart 0 -k '$(ONLY)'

portable:
	$(call install,test,[test])
	$(device)
	@$(PY) tests/portable.py

browser:
	npm ci --prefix tests/browser --no-audit --no-fund --silent

lint:
	$(call install,dev,[dev])
	$(PY) -m ruff check
	$(PY) -m ruff format --check
	$(PY) docs/stubs.py --check
	$(PY) -m mypy --strict simdtex

# The gallery runs the examples. With Chromium, its driver and Selenium the pages are looked at in a browser, too.
# All is made anew: pages of an earlier build that are no more would be checked as well.
docs:
	$(call install,docs,[docs])
	$(device)
	@$(PY) docs/prose.py
	@rm -rf docs/_build/html docs/gallery
	$(PY) -m sphinx -W --keep-going -q -b html docs docs/_build/html
	@$(PY) docs/check.py docs/_build/html
	@echo "The documentation is in docs/_build/html/index.html"

prose:
	$(call install,docs,[docs])
	@$(PY) docs/prose.py

links:
	$(call install,docs,[docs])
	$(PY) -m sphinx -q -D plot_gallery=0 -b linkcheck docs docs/_build/links

# MUTANTS='simdtex.methods.pyramid.*' or 'simdtex.schedules.*' does others, a list of names those alone. No OpenCL: mutmut forks.
MUTANTS ?= simdtex.methods.mrf.*
mutants:
	$(call install,mutants,[mutants])
	set -f; OCL_ICD_VENDORS=/nonexistent $(PY) -m mutmut run --max-children 1 $(MUTANTS)
	$(PY) -m mutmut results

# MINUTES=1 SEED=7 give others.
MINUTES ?= 10
SEED ?= 1
fuzz:
	$(call install,test,[test])
	$(PY) -m fuzz --minutes $(MINUTES) --seed $(SEED)

# What goes to the package index: built, checked, and tried in an empty environment.
.PHONY: dist
dist:
	$(call install,slow,[slow])
	$(device)
	rm -rf dist
	$(PY) -m build --outdir dist
	@SIMDTEX_DIST=dist $(PY) -m pytest -m slow tests/test_wheel.py

cpu:
	$(call install,cpu,[cpu])

clean:
	rm -rf build dist demo docs/_build docs/gallery docs/generated .hypothesis .mypy_cache .pytest_cache .ruff_cache mutants
	find . -name __pycache__ -type d -not -path './$(VENV)/*' -prune -exec rm -rf {} +
