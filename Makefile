# Two commands set everything up on a fresh Debian machine:
#   make demo    the whole chain on a shipped mesh -> out/phalanx.h and pictures in out/keep
#   make test    the test suite
# `make whole` runs the tests that take longer, and `make docs` builds the documentation into out/docs.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
SYSTEM := libegl1 libgl1 libusb-1.0-0 libopengl0 python3-venv
CNC := linuxcnc-uspace gcc libc6-dev
BROWSER := chromium fonts-dejavu-core
# Compiled modules are kept: tests start hundreds of processes, and each would compile the package anew.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: demo test whole processor oldest docs papers replay gallery lint types system cnc browser clean

demo: $(VENV)/installed
	mkdir -p out
	$(BIN)/bonecam demo -o out/phalanx.h --keep out/keep --report out/phalanx.json

# The core's tests run without plugins, those marked `plugged` with them.
DEFAULT := not whole and not slow and not fuzz
test: $(VENV)/developing cnc browser
	BONECAM_NO_PLUGINS=1 OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist loadfile --ignore tests/plugins -m 'not plugged and $(DEFAULT)'
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist loadfile -m 'plugged and $(DEFAULT)'

# The tests that run the whole chain, in variants.
whole: $(VENV)/developing cnc browser
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist loadfile -m 'whole and not slow and not fuzz'

# Whole runs again with the kernels of another processor, whose last bits differ.
processor: $(VENV)/developing browser
	OPENBLAS_CORETYPE=Prescott OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist loadfile -m 'not slow and not fuzz' tests/report/page tests/report/test_second_outputs.py

# The oldest direct versions that pyproject.toml allows, on what meets each library and the programs kept as text.
oldest: | system
	$(PYTHON) -m venv $(VENV)/oldest
	$(VENV)/oldest/bin/pip install -qq uv
	$(VENV)/oldest/bin/uv pip install -q --python $(VENV)/oldest/bin/python --resolution lowest-direct -e .
	$(VENV)/oldest/bin/uv pip install -q --python $(VENV)/oldest/bin/python pytest hypothesis beartype
	OMP_NUM_THREADS=1 $(VENV)/oldest/bin/python -m pytest tests/plugins/meshlab/test_meshset.py tests/mesh/test_repair.py tests/nc/test_golden.py

docs: $(VENV)/documenting
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict -q -f docs/mkdocs.yml
	@echo "open out/docs/index.html"

# Our figures in the docs: BONES="bone.stl:m:paper ..." are compared (by default the phalanx that ships), all benchmarks run; ONLY="compare
# bench_skin.py ..." makes some of it.
papers: $(VENV)/developing
	$(BIN)/pip install -qq -e ".[bench]"
	$(BIN)/python docs/papers.py $(addprefix --only ,$(ONLY)) $(BONES)

# What runs write on the working tree, beside what they write on the revision BASE.
replay: $(VENV)/developing
	$(BIN)/python tests/replay.py --base $(BASE) $(addprefix --only ,$(ONLY))

# The pictures of the docs.
gallery: $(VENV)/developing
	$(BIN)/python tests/figures/draw.py

lint: $(VENV)/developing
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .

types: $(VENV)/developing
	$(BIN)/mypy

# The libraries that open3d and pymeshlab load, and (for tests only) LinuxCNC's interpreter, which runs
# what we write, and a browser, which shows it.
system:
	@sh .ci/system-packages $(SYSTEM)

cnc:
	@sh .ci/system-packages $(CNC) || echo "LinuxCNC's checks will be skipped"

browser:
	@sh .ci/system-packages $(BROWSER) || echo "the checks of pages in a browser will be skipped"

$(VENV)/installed: pyproject.toml | system
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install -qq --upgrade pip
	$(BIN)/pip install -qq -e .
	touch $@

$(VENV)/developing: $(VENV)/installed
	$(BIN)/pip install -qq -e ".[test,dev]"
	touch $@

$(VENV)/documenting: $(VENV)/installed
	$(BIN)/pip install -qq -e ".[docs]"
	touch $@

clean:
	rm -rf out build *.egg-info .pytest_cache .mypy_cache .ruff_cache
