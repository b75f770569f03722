# Every target does its own set-up; `make help` explains them.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
EXTRAS ?= test

.DEFAULT_GOAL := help
.PHONY: help install demo test lint bench docs fuzz fuzz-expressions wheel outside clean

help:  ## Explain every target
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-16s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

# The stamp names the extras, so that asking for more installs more.
$(VENV)/.installed-%: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "terratool needs Python 3.11 or newer; say which with make PYTHON=python3.12 …"; exit 1; }
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@echo "Installing terratool and what it needs into $(VENV) …"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[$*]'
	@touch $@

install: $(VENV)/.installed-$(EXTRAS)  ## Put terratool at .venv/bin/terratool
	@echo "terratool is at $(BIN)/terratool"

demo: $(VENV)/.installed-$(EXTRAS)  ## Validate the paper's example, write its DEM and its mesh to out/
	@mkdir -p out
	$(BIN)/terratool validate samples/paper-example.json
	$(BIN)/terratool export-dem samples/paper-example.json out/paper-example.tif --overwrite
	$(BIN)/terratool export-mesh samples/paper-example.json out/paper-example.glb --overwrite
	@echo "Look at it in QGIS, or ask it: $(BIN)/terratool query samples/paper-example.json 15 15"

test: $(VENV)/.installed-test  ## Run all tests, on all processors
	$(BIN)/python -m pytest -n auto --dist loadfile

lint: $(VENV)/.installed-dev  ## Check style, types and the direction of imports
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(VENV)/.installed-bench  ## Measure speed and memory, as ratios from one run
	$(BIN)/python benchmarks/query.py
	$(BIN)/python benchmarks/painting.py
	$(BIN)/python benchmarks/rutting.py
	$(BIN)/python benchmarks/exporting.py
	$(BIN)/python benchmarks/compiling.py
	$(BIN)/python benchmarks/validating.py
	$(BIN)/python benchmarks/startup.py
	$(BIN)/python benchmarks/scaling.py
	$(BIN)/python benchmarks/meshing.py
	$(BIN)/python benchmarks/importing.py
	$(BIN)/python benchmarks/reading.py
	$(BIN)/python benchmarks/zbuffer.py
	$(BIN)/python benchmarks/rutting.py
	$(BIN)/python benchmarks/routing.py
	$(BIN)/python benchmarks/traversing.py

docs: $(VENV)/.installed-$(EXTRAS)  ## Write docs/rules.md from the rules
	$(BIN)/terratool rules --markdown > docs/rules.md

fuzz: $(VENV)/.installed-test  ## Compare thousands of random terrains with the slow reading
	TERRATOOL_FUZZ=5000 $(BIN)/python -m pytest tests/test_field_properties.py

fuzz-expressions: $(VENV)/.installed-test  ## Try 100,000 strings as curves, each in 50 ms at most
	$(BIN)/python benchmarks/expressions.py

wheel: $(VENV)/.installed-test  ## Build a wheel into dist/
	@rm -rf dist
	$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir dist .

outside: wheel  ## Install the wheel elsewhere and use it there
	@set -e; there=$$(mktemp -d); trap 'rm -rf "$$there"' EXIT; here=$$PWD; cd "$$there"; \
	  $(PYTHON) -m venv venv; \
	  venv/bin/python -m pip install --quiet --disable-pip-version-check "$$here"/dist/terratool-*.whl; \
	  venv/bin/terratool validate "$$here"/samples/*.json; \
	  venv/bin/terratool export-dem "$$here"/samples/nested-site.json site.tif; \
	  venv/bin/python -c 'import terratool; print(terratool.schema()["title"])'

clean:  ## Remove everything that the other targets make
	rm -rf $(VENV) out dist build .pytest_cache .hypothesis .mypy_cache .ruff_cache
