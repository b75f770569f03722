# Every target does its own set-up; `make help` explains them.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
EXTRAS ?= plot
TESTS ?= tests
PIP := -m pip install -qq --disable-pip-version-check
# of the kernels: native for the processor at hand alone, or all
VARIANTS ?= native
CONFIG ?=
FUZZ ?=
KILLS ?=
RECORD ?=
TABLE = $(BIN)/python -c 'import tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))$(1), sep="\n")'
# CMake and Ninja, of PyPI where the machine has none
TOOLS := 'from scikit_build_core.build import get_requires_for_build_editable as wanted; print(*wanted({}), sep="\n")'
KERNEL_TESTS := tests/test_kernels.py tests/field/test_field.py tests/field/test_rays.py tests/raster/test_painter.py tests/field/test_tracks.py \
  tests/raster/test_loss.py tests/mesh/test_build.py tests/mesh/test_normals.py tests/mesh/test_solid.py \
  tests/mesh/test_tracks.py tests/simulators/test_solids.py \
  tests/importing/test_zbuffer.py tests/importing/test_structure.py tests/importing/test_vrml_numbers.py \
  tests/importing/test_vrml_polygons.py tests/traversability/test_terramechanics.py tests/traversability/test_map.py \
  tests/traversability/test_route_graph.py
KERNELS := CMakeLists.txt $(wildcard kernels/*.hpp kernels/*/*.hpp kernels/python/*.cpp)
# of a stamp, such as .installed-test-all
STAMP = $(subst -, ,$*)
SETTINGS = editable.rebuild=false cmake.define.TERRATOOL_VARIANTS=$(lastword $(STAMP)) $(CONFIG)
COMPILE := 'import sys; from scikit_build_core.build import build_editable as build; \
  build("build", dict(setting.split("=", 1) for setting in sys.argv[1:]))'

.DEFAULT_GOAL := help
.PHONY: help install demo test slow nightly baseline lint bench clocks docs pages site stubs schemas fuzz adapters kills fuzz-terrains fuzz-expressions wheel outside sanitize debug coverage clean

help:  ## Explain every target
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-16s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

# The stamp names the extras ("none" is what the commands need) and the variants of the kernels, so
# that asking for more installs more. Kernels are compiled before pip is asked, which would hide the
# progress; without isolation, what was built before is not built again; nor is it by each import,
# of which tests have many at a time.
$(VENV)/.installed-%: pyproject.toml $(KERNELS)
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "terratool needs Python 3.11 or newer; say which with make PYTHON=python3.12 …"; exit 1; }
	@command -v c++ >/dev/null || command -v clang++ >/dev/null || [ -n "$$CXX" ] || \
	  { echo "Building the kernels needs a C++ compiler: apt install g++, dnf install gcc-c++, or see docs/build.md."; exit 1; }
	@test -x $(BIN)/python || { echo "Making $(VENV) …"; $(PYTHON) -m venv $(VENV); }
	@$(call TABLE,["build-system"]["requires"]) | $(BIN)/python $(PIP) --requirement /dev/stdin
	@$(BIN)/python -c $(TOOLS) | $(BIN)/python $(PIP) --requirement /dev/stdin
	@echo "Compiling the kernels of terratool: about a minute on two cores …"
	@$(BIN)/python -c $(COMPILE) $(SETTINGS)
	@echo "Installing terratool and what it needs into $(VENV) …"
	@$(BIN)/python $(PIP) --no-build-isolation $(addprefix -C,$(SETTINGS)) \
	  --editable '.$(if $(filter-out none,$(firstword $(STAMP))),[$(firstword $(STAMP))])'
	@$(if $(filter-out all,$(lastword $(STAMP))),rm -f $(VENV)/.installed-*-all)
	@touch $@

install: $(VENV)/.installed-$(EXTRAS)-$(VARIANTS)  ## Put terratool at .venv/bin/terratool; EXTRAS=plot,import,usd for more, none for less
	@echo "terratool is at $(BIN)/terratool"

demo: $(VENV)/.installed-$(EXTRAS)-$(VARIANTS)  ## Validate the paper's example, write its DEM and its mesh to out/
	@mkdir -p out
	$(BIN)/terratool validate samples/paper-example.json
	$(BIN)/terratool export-dem samples/paper-example.json out/paper-example.tif --overwrite
	$(BIN)/terratool export-mesh samples/paper-example.json out/paper-example.glb --overwrite
	@echo "Open out/paper-example.tif in QGIS and out/paper-example.glb in Blender or any viewer of glTF,"
	@echo "or ask the terrain: $(BIN)/terratool query samples/paper-example.json 15 15"

test: $(VENV)/.installed-test-$(VARIANTS)  ## Run the tests that are quick, on all processors; TESTS=tests/raster for all of some
	$(BIN)/python -m pytest -n auto --dist loadfile $(if $(filter tests,$(TESTS)),-m "not (slow or nightly)") $(TESTS)

slow: $(VENV)/.installed-test-$(VARIANTS)  ## Run the tests that "make test" leaves out, but not those of a second or more
	$(BIN)/python -m pytest -n auto --dist load -m "slow and not nightly" tests

nightly: $(VENV)/.installed-test-all  ## Run all tests, each property with its full number of examples
	TERRATOOL_EXAMPLES=1 $(BIN)/python -m pytest -n auto --dist loadfile tests
	TERRATOOL_CPU=baseline $(BIN)/python -m pytest -n auto --dist loadfile $(KERNEL_TESTS)

baseline: $(VENV)/.installed-test-all  ## Run the quick tests of the kernels as built for any processor
	TERRATOOL_CPU=baseline $(BIN)/python -m pytest -n auto --dist loadfile -m "not (slow or nightly)" $(KERNEL_TESTS)

lint: $(VENV)/.installed-dev-$(VARIANTS)  ## Check style, types, sentences and the direction of imports
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/clang-format --dry-run -Werror $(filter kernels/%,$(KERNELS)) tests/rows.cpp tests/simulators/drop.cpp
	$(BIN)/python kernels/python/stubs.py --check
	$(BIN)/python -m tests.stubs --check
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m tests.prose

bench: $(VENV)/.installed-bench-$(VARIANTS)  ## Measure speed and memory, as ratios from one run
	$(BIN)/python benchmarks/query.py
	$(BIN)/python benchmarks/heights.py
	$(BIN)/python benchmarks/casting.py
	$(BIN)/python benchmarks/painting.py
	$(BIN)/python benchmarks/storeys.py
	$(BIN)/python benchmarks/exporting.py
	$(BIN)/python benchmarks/compiling.py
	$(BIN)/python benchmarks/validating.py
	$(BIN)/python benchmarks/startup.py --fresh
	$(BIN)/python benchmarks/scaling.py
	$(BIN)/python benchmarks/meshing.py
	$(BIN)/python benchmarks/importing.py
	$(BIN)/python benchmarks/grids.py
	$(BIN)/python benchmarks/reading.py
	$(BIN)/python benchmarks/zbuffer.py
	$(BIN)/python benchmarks/rutting.py
	$(BIN)/python benchmarks/routing.py
	$(BIN)/python benchmarks/traversing.py
	$(BIN)/python benchmarks/courses.py

clocks: $(VENV)/.installed-$(EXTRAS)-$(VARIANTS)  ## Print the ratios to watch beside the last recorded ones, in three minutes; RECORD=1 records them
	$(BIN)/python benchmarks/clocks.py $(if $(RECORD),--record)

stubs: $(VENV)/.installed-dev-$(VARIANTS)  ## Write the type stubs of the kernels and of the package
	$(BIN)/python kernels/python/stubs.py
	$(BIN)/python -m tests.stubs

schemas: $(VENV)/.installed-$(EXTRAS)-$(VARIANTS)  ## Write the schemas, of the table of keys and of the records of results
	$(BIN)/python -m terratool.cli.output_schemas schemas

docs: pages site  ## Write the pages that are generated, and build the site of all pages into out/site

pages: $(VENV)/.installed-$(EXTRAS)-$(VARIANTS)  ## Write docs/rules.md, the tables and picture of docs/validation.md, and pictures of docs/images
	$(BIN)/terratool rules --format markdown > docs/rules.md
	$(BIN)/python -m tests.validation
	$(BIN)/terratool traversability samples/ramp-yard.json --vehicle samples/vehicles/husky-a200.json \
		--report docs/images/slip.svg --overwrite > /dev/null
	$(BIN)/python docs/draw.py

site: $(VENV)/.installed-docs-$(VARIANTS)  ## Build the site of docs/ into out/site, without the net; a warning is an error
	@rm -rf out/site
	$(BIN)/python -m sphinx -q -E -W --keep-going -b html -d out/doctrees docs out/site
	@! grep -rlE '(src|data-src)="(https?:)?//|url\(.?https?:' out/site || { echo "These ask the net."; exit 1; }
	@echo "Open out/site/index.html"

fuzz: $(VENV)/.installed-test-$(VARIANTS)  ## Try 2,400,000 broken files; FUZZ="rasters --share 0.01" for less
	$(BIN)/python -m tests.fuzz $(FUZZ)

# mjlab wants an older MuJoCo than other tests, so it gets an environment of its own; each module runs
# by itself, as the programs' libraries do not bear one another
adapters:  ## Try Isaac Lab, mjlab, dm_control and Gymnasium with their adapters, in .venv-adapters: 3 GB
	$(MAKE) install VENV=.venv-adapters EXTRAS=test
	.venv-adapters/bin/python $(PIP) 'mjlab==1.6.*' dm_control 'gymnasium[mujoco]'
	.venv-adapters/bin/python $(PIP) --no-deps isaaclab
	for one in tests/integrations/with_*.py; do .venv-adapters/bin/python -m pytest -q -n 0 -W default $$one || exit 1; done

kills: $(VENV)/.installed-test-$(VARIANTS)  ## End 1,000 commands that write at random moments, and have others go wrong; KILLS="--kills 50" for less
	$(BIN)/python -m tests.kills $(KILLS)
	$(BIN)/python -m tests.adversity

fuzz-terrains: $(VENV)/.installed-test-$(VARIANTS)  ## Compare thousands of random terrains with the slow reading
	TERRATOOL_FUZZ=5000 $(BIN)/python -m pytest tests/field/test_properties.py
	TERRATOOL_FUZZ=2500 $(BIN)/python -m pytest tests/field/test_rays.py
	TERRATOOL_FUZZ=1000 $(BIN)/python -m pytest tests/field/test_storeys.py tests/field/test_storey_rays.py

fuzz-expressions: $(VENV)/.installed-test-$(VARIANTS)  ## Try 100,000 strings as curves, each in 50 ms at most
	$(BIN)/python benchmarks/expressions.py

wheel: $(VENV)/.installed-$(EXTRAS)-$(VARIANTS)  ## Build a wheel into dist/
	@rm -rf dist
	$(BIN)/python -m pip wheel -qq --disable-pip-version-check --no-build-isolation --no-deps --wheel-dir dist .

outside: wheel  ## Install the wheel elsewhere and use it there
	@set -e; there=$$(mktemp -d); trap 'rm -rf "$$there"' EXIT; here=$$PWD; cd "$$there"; \
	  $(PYTHON) -m venv venv; \
	  venv/bin/python -m pip install -qq --disable-pip-version-check "$$here"/dist/terratool-*.whl; \
	  venv/bin/terratool validate "$$here"/samples/*.json; \
	  venv/bin/terratool export-dem "$$here"/samples/nested-site.json site.tif; \
	  venv/bin/python -c 'import terratool; print(terratool.schema()["title"])'

# What the dynamic linker is to load before Python, so that the sanitizers see all of its memory.
RUNTIMES = $(foreach library,libasan.so libstdc++.so,$(shell $(or $(CXX),c++) -print-file-name=$(library)))

sanitize:  ## Run the tests of the kernels with ASan, UBSan and checks of every index
	@$(MAKE) --no-print-directory VENV=.venv-sanitize \
	  VARIANTS=baseline CONFIG='build-dir=build/sanitize cmake.define.SANITIZE=ON' .venv-sanitize/.installed-test-baseline
	LD_PRELOAD='$(RUNTIMES)' ASAN_OPTIONS=detect_leaks=0 TERRATOOL_CPU=baseline \
	  .venv-sanitize/bin/python -m pytest -q -n auto --dist loadfile $(KERNEL_TESTS)

debug:  ## Build the kernels for gdb, into .venv-debug
	@$(MAKE) --no-print-directory VENV=.venv-debug \
	  CONFIG='build-dir=build/debug cmake.build-type=Debug' .venv-debug/.installed-test-$(VARIANTS)
	@echo "gdb --args .venv-debug/bin/python -m terratool …"

coverage:  ## Run the tests of the kernels and say which of their lines none reaches
	@$(MAKE) --no-print-directory VENV=.venv-coverage \
	  VARIANTS=baseline CONFIG='build-dir=build/coverage cmake.build-type=Debug cmake.define.COVERAGE=ON' \
	  .venv-coverage/.installed-test-baseline
	@.venv-coverage/bin/python $(PIP) gcovr
	TERRATOOL_CPU=baseline .venv-coverage/bin/python -m pytest -q -n auto --dist loadfile $(KERNEL_TESTS)
	.venv-coverage/bin/gcovr --gcov-suspicious-hits-threshold 0 --filter kernels/ --exclude kernels/python build/coverage

clean:  ## Remove everything that the other targets make
	rm -rf $(VENV) .venv-sanitize .venv-debug .venv-coverage out dist build .pytest_cache .hypothesis .mypy_cache .ruff_cache
