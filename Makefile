# gearstab: everything a developer or a reader of the paper runs. Needs Python >= 3.11 and make; all else is installed into .venv.

PYTHON ?= python3
UV ?= uv
FORMAT ?= png
BENCH ?= configs/lin_parker_2002/fig3.yaml configs/lin_parker_2002/fig6a.yaml configs/matrices.yaml configs/drive_train.yaml \
         configs/waveforms/harmonics.yaml configs/waveforms/trapezoidal.yaml

VENV := .venv
BIN := $(VENV)/bin
GEARSTAB := $(BIN)/gearstab

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help install demo test test-all test-portable test-sanitized test-oldest lint docs figures check-figures update-figures bench bench-scale benchmarks reproduction lock clean distclean

help: ## this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-15s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

# Byte code is stored as files are first imported, whatever the environment says: hundreds of tests start gearstab anew,
# and compiling all packages beforehand takes longer than installing them.
export PYTHONDONTWRITEBYTECODE :=
INSTALL := $(BIN)/python -m pip install --disable-pip-version-check --no-compile

# Install a lock and print the name of each package that pip takes up; the exit code of a pipe is that of its last command.
LOCKED = { $(INSTALL) --require-hashes --requirement $< || echo failed; } | awk \
  '/^(Collecting|Processing) / {sub(/.*\//, "", $$2); sub(/[=-][=0-9].*/, "", $$2); printf " %s", $$2; fflush()} \
  /^failed$$/ {exit 1} END {print ""}'

# Two locks, one a part of the other: what the program needs, and with what tests, pages and certificates need besides.
$(VENV)/.locked: scripts/runtime.lock
	@$(PYTHON) -c 'import sys; sys.exit("gearstab needs Python 3.11 or newer; choose one with make PYTHON=..." if sys.version_info < (3, 11) else 0)'
	@echo "Installing into $(VENV), once: the packages that the program needs (100 MB to fetch) ..."
	@$(PYTHON) -m venv --clear $(VENV)
	@$(LOCKED)
	@touch $@

# The editable install is done again when the packaging or the C kernel changed; Python files need no install.
$(VENV)/.installed: $(VENV)/.locked pyproject.toml setup.py $(wildcard gearstab/ckernel/*.[ch] gearstab/ckernel/*/*.[ch])
	@echo "Compiling the kernel (half a minute of one processor) ..."
	@$(BIN)/python scripts/compiler.py | xargs -r $(INSTALL) -qq
	@$(INSTALL) -qq --no-build-isolation --no-deps --editable .
	@touch $@

$(VENV)/.complete: scripts/requirements.lock | $(VENV)/.installed
	@echo "Installing what tests, pages and figures need besides ..."
	@$(LOCKED)
	@touch $@

install: $(VENV)/.installed ## a virtual environment in .venv with the locked packages and gearstab itself

demo: $(VENV)/.installed ## sweep of Lin & Parker's gear train and its stability map
	@echo "Sweeping the map and drawing it ..."
	@$(GEARSTAB) sweep configs/lin_parker_2002/fig3.yaml -o results/demo.h5 --overwrite
	@$(GEARSTAB) plot results/demo.h5 -o results/demo.$(FORMAT) --size double
	@echo "The stability map is in results/demo.$(FORMAT), the numbers are in results/demo.h5."

# Tests run on all processors and in the order in which they are written, so that they pass or fail again in the same
# way; SEED=17 shuffles them, and test-portable always does.
PYTEST := $(BIN)/python -m pytest -q -n auto --dist worksteal $(if $(SEED),-p randomly --randomly-seed=$(SEED))

test: $(VENV)/.complete ## all tests but the slow ones
	@$(PYTEST)

test-all: $(VENV)/.complete ## all tests
	@$(PYTEST) -m 'slow or not slow'

# Three runs of the fast tests in random order, in which every value of either occurs once: with the kernels that OpenBLAS
# has for Haswell (and our kernel at avx512), Zen (avx2) and Prescott (plain).
# CORE=Zen runs one of them, SEED=17 repeats an order.
test-portable: $(VENV)/.complete ## the fast tests as on other processors (CORE=Haswell|Zen|Prescott for one)
	@$(BIN)/python scripts/portable.py $(addprefix --core ,$(CORE)) $(addprefix --seed ,$(SEED))

# The C kernel with checks of every access and every operation whose result C leaves open; the normal one is not touched.
SANITIZED := build/sanitized
SANITIZE := -fsanitize=address,undefined,float-cast-overflow
SANITIZED_TESTS := tests/kernel tests/boundaries/test_boundaries_compiled.py tests/response/test_backlash_kernels.py \
  $(addprefix tests/floquet/,test_floquet.py test_blocks.py damping/test_required_damping.py)
RUN_SANITIZED := import sys, pytest; from gearstab import ckernel; assert "/$(SANITIZED)/" in ckernel.library.__file__; \
                 sys.exit(pytest.main(sys.argv[1:]))

test-sanitized: $(VENV)/.complete ## tests of the C kernel built with address and undefined-behaviour sanitizers (GCC)
	@rm -rf $(SANITIZED)
	@GEARSTAB_CFLAGS="-O1 -g1 -fno-omit-frame-pointer $(SANITIZE) -fno-sanitize-recover=all" LDFLAGS="$(SANITIZE)" \
	  $(BIN)/python -W ignore setup.py -q build --build-base $(SANITIZED)/base --build-lib $(SANITIZED)/lib
	@grep -q __asan_ $(SANITIZED)/lib/gearstab/ckernel/_kernel*.so
	@PYTHONPATH=$(CURDIR)/$(SANITIZED)/lib LD_PRELOAD="$$($(CC) -print-file-name=libasan.so) $$($(CC) -print-file-name=libstdc++.so)" ASAN_OPTIONS=detect_leaks=0 \
	  UBSAN_OPTIONS=print_stacktrace=1 $(BIN)/python -P -c '$(RUN_SANITIZED)' -q -s $(SANITIZED_TESTS)

# The oldest versions that pyproject.toml allows have wheels for Python 3.11 and 3.12 only.
OLDEST := build/oldest

test-oldest: ## the fast tests with the oldest allowed version of every dependency (PYTHON=python3.11)
	@$(PYTHON) -m venv --clear $(OLDEST)
	@$(OLDEST)/bin/python -m pip install -qq --disable-pip-version-check --only-binary :all: --requirement scripts/oldest.txt
	@$(OLDEST)/bin/python -m pip install -qq --disable-pip-version-check --no-build-isolation --no-deps --editable .
	@$(OLDEST)/bin/python -m pytest -q -n auto --dist worksteal

lint: $(VENV)/.complete ## linter and type checker
	@$(BIN)/ruff check .
	@$(BIN)/mypy

# A page that is missing, a link to nowhere and every other warning of Sphinx is an error. Pictures of the gallery are those
# that `make figures` has drawn by then.
docs: $(VENV)/.complete ## the documentation site into build/docs, without warnings
	@$(BIN)/python -m sphinx -q -W --keep-going -b html docs build/docs
	@echo "The site begins with build/docs/index.html."

# Results and figures that are older than what they were made from are made again. FIGURES=lin_parker_2002 makes some of
# them, FIGURES="--within 120" those that take two minutes together.
figures: $(VENV)/.complete ## every figure of configs/ into results/figures/, with the time each takes
	@$(BIN)/python scripts/figures.py --format $(FORMAT) $(FIGURES)

check-figures: $(VENV)/.complete ## and compare them with the stored references
	@$(BIN)/python scripts/figures.py --check $(FIGURES)

update-figures: $(VENV)/.complete ## and write the references anew; git diff shows what changed
	@$(BIN)/python scripts/figures.py --update $(FIGURES)

bench: $(VENV)/.complete ## speed and error of the methods, side by side
	@PYTHONPATH=scripts $(BIN)/python -m bench
	@$(foreach scene,$(BENCH),echo; echo "$(scene)"; $(GEARSTAB) bench $(scene) -o results/bench/$(basename $(notdir $(scene))).h5 -q;)

bench-scale: $(VENV)/.complete ## laws of cost, whole sweeps beside the kernel alone, workers beside threads; LARGEST=8 for 10^8 points
	@PYTHONPATH=scripts $(BIN)/python -m bench laws scale $(LARGEST)

benchmarks: $(VENV)/.complete ## published numbers against ours: the table of configs/benchmarks/
	@$(BIN)/python scripts/benchmarks.py

reproduction: $(VENV)/.complete ## docs: what the papers state against what comes out, and the picture
	@$(BIN)/python scripts/reproduction.py --write
	@$(BIN)/python scripts/figures.py lin_parker_2002/fig3
	@$(GEARSTAB) plot results/lin_parker_2002/fig3.h5 -o docs/images/fig3.png --size double --dpi 130 --no-title

COMPILE := $(UV) pip compile pyproject.toml --universal --python-version 3.11 --generate-hashes --no-emit-index-url --no-annotate \
  --custom-compile-command "make lock" --quiet --extra build

lock: ## both locks in scripts/ from pyproject.toml (needs uv; UPGRADE=--upgrade for new versions)
	$(COMPILE) $(UPGRADE) --extra dev --extra cluster --extra docs --extra html --extra verify --output-file scripts/requirements.lock
	$(COMPILE) --constraints scripts/requirements.lock --output-file scripts/runtime.lock

clean: ## removes results, builds and caches
	@rm -rf results build dist gearstab.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	@find gearstab scripts tests -name __pycache__ -type d -prune -exec rm -rf {} +

distclean: clean ## removes the environment and the compiled kernel too
	@rm -rf $(VENV)
	@find gearstab -name '*.so' -delete
