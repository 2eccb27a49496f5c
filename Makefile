# Needs python3 >= 3.11 and make, nothing else. Each target installs what it needs into .venv first.
PYTHON ?= python3
BIN := .venv/bin
# Empty is off. Where it is set, each of the hundreds of processes that the tests start compiles all modules anew.
export PYTHONDONTWRITEBYTECODE :=
# uv downloads and unpacks on all processors; pip installs where only its own settings name an index that can be reached.
# Modules are compiled when they are first imported; most never are.
PIP := $(BIN)/python -m pip install --no-compile --quiet --disable-pip-version-check --constraint constraints.txt
UV := $(BIN)/uv pip install --python $(BIN)/python --quiet --constraint constraints.txt
# What developers' core is compiled without; `make WARNINGS= test` is for compilers that have others.
WARNINGS := -pedantic -Wall -Wextra -Wconversion -Werror -Wno-psabi
# What the extension is built from.
CORE := setup.py $(wildcard core/*.h core/*/*.[ch] core/packaging/*.py)

# What the page that computes runs.
LIVE := viewer/live/robot_at_rest.c $(sort $(wildcard core/*.h $(patsubst %,core/%/*.[ch],available_wrench distribution mechanics numbers)))

.PHONY: demo test setup lint types unit docs live lowest newest errata pictures clean

demo: .venv/core.stamp
	$(BIN)/towline demo

test: .venv/dev.stamp
	$(MAKE) lint
	$(MAKE) --jobs=3 docs types unit

setup: .venv/dev.stamp

lint: .venv/dev.stamp
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/clang-format --dry-run -Werror --style=file:core/.clang-format core/*.h core/*/*.[ch] export/fmu/sources/*.[ch] viewer/live/*.c

types: .venv/dev.stamp
	$(BIN)/pyrefly check --python-interpreter-path $(BIN)/python

# Three workers for two processors, because many tests wait for a browser, a command or a cluster. Each starts with a third
# of the tests in order, so that what a file's tests share is computed once. Linear algebra has one thread: workers with two
# each would wait for one another. glibc keeps memory that is free, because returning it and taking it again is a
# twentieth of the time. No test reads logs, and the plugin of Zarr, which a dependency installs, is not needed: both would
# cost each process and each of the thousands of tests some time.
unit: .venv/dev.stamp
	OMP_NUM_THREADS=1 MALLOC_MMAP_THRESHOLD_=33554432 MALLOC_TRIM_THRESHOLD_=268435456 \
	  $(BIN)/python -m pytest -n 3 --dist worksteal -p no:logging -p no:zarr

# The documentation site, in site/; a warning is an error, as long as no --quiet keeps it from being counted.
docs: .venv/dev.stamp
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

# The core for the page that computes. The package ziglang compiles to WebAssembly wherever it is installed; the sources' hash is
# the file's build ID, by which a test finds a file that is older than they are.
live: .venv/venv.stamp
	$(PIP) --target build/ziglang --upgrade ziglang
	PYTHONPATH=build/ziglang $(BIN)/python -m ziglang cc --target=wasm32-wasi -mexec-model=reactor -Os -s -Wall -Wextra -Werror \
	  -ffp-contract=off -fno-math-errno -fno-trapping-math -DTOWLINE_CABLES=32 -DTOWLINE_NO_LANES -Icore -Icore/distribution \
	  -Wl,-z,stack-size=262144 -Wl,--build-id=0x$$(cat $(LIVE) | sha256sum | cut -d ' ' -f 1) -o viewer/live/robot_at_rest.wasm \
	  viewer/live/robot_at_rest.c core/distribution/*.c core/numbers/processor.c \
	  core/available_wrench/available_wrench.c core/available_wrench/facets_plain.c

# A selection of the tests with the oldest versions of the dependencies that pyproject.toml accepts, or with the newest.
lowest newest:
	PYTHON=$(PYTHON) .ci/versions $@

# The site's two pages of errata, from the papers computed again.
errata: .venv/core.stamp
	for paper in flying ctmrts; do \
	  $(BIN)/towline reproduce $$paper --out build/$$paper && \
	  cp build/$$paper/$$paper-errata.md docs/errata/$$paper.md || exit 1; \
	done

# Runs the demo, every example where the documentation's pictures are, and a sweep; plans saved there are ignored by git.
pictures: .venv/core.stamp
	mkdir -p docs/pictures build
	cd build && ../$(BIN)/towline demo && cp towline-demo/tensions.png ../docs/pictures/circle.png
	printf 'name: circle\npath: {kind: circle, centre: [0, 0, -1], radius: 0.8, rate: 0.8}\nbase: {kind: free, ends: periodic}\n' > build/circle.yaml
	cd build && ../$(BIN)/towline plan wang-flying-quadrotor circle.yaml --animate ../docs/pictures/hero.gif --fps 7
	cd docs/pictures && for example in ../../examples/*.py; do ../../$(BIN)/python $$example || exit 1; done
	printf 'name: lift\npath: {kind: line, start: [0, 0, 1], end: [0.6, 0.4, 1.6]}\nduration: 3\n' > build/lift.yaml
	cd build && ../$(BIN)/towline plan ipanema-1 lift.yaml --vary margin=0:40:5 --vary duration=0.2:1.2:0.1 \
		--figures ../docs/pictures
	cd build && ../$(BIN)/towline robots cogiro --figure ../docs/pictures/cogiro.png
	$(BIN)/python docs/draw_reference.py
	cd build && ../$(BIN)/towline workspace cogiro --samples 20000 --figure ../docs/pictures/cogiro-workspace.png

clean:
	rm -rf .venv .editable towline-demo build site *.egg-info core/*.so

.venv/venv.stamp:
	@$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "towline needs python3 >= 3.11, this is " + sys.version.split()[0] + ": make PYTHON=python3.11")'
	$(PYTHON) -m venv .venv
	-$(PIP) uv
	touch $@

.venv/core.stamp: pyproject.toml constraints.txt $(CORE) | .venv/venv.stamp
	$(UV) --editable . || $(PIP) --editable .
	touch $@

# One installation, not one after the core's: each builds towline anew. Some warnings are due only where compilers optimise;
# the tests take what this compiles for the wheel.
.venv/dev.stamp: export CFLAGS := $(WARNINGS)
.venv/dev.stamp: EXTRAS := .[bench,cluster,dev,docs,fmu,logs,mesh,mujoco,notebooks,timing,viewer]
.venv/dev.stamp: pyproject.toml constraints.txt $(CORE) | .venv/venv.stamp
	$(UV) --editable "$(EXTRAS)" || $(PIP) --editable "$(EXTRAS)"
	touch .venv/core.stamp $@
