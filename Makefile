# kerfpath: `make demo` and `make test` are all a new user needs; each sets up its own .venv first.
PYTHON ?= python3
BIN := .venv/bin
DEMO_OUT ?= demo-out
# Commands are started a thousand times by the tests: modules are compiled once, as everywhere else.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: demo test test-slow check docs package bench figures screenshots lock clean

demo: .venv/run.stamp
	$(BIN)/kerfpath demo --out $(DEMO_OUT)
	@echo 'To see it cut and to change it, in the browser: $(BIN)/kerfpath studio'

test: .venv/dev.stamp
	$(BIN)/pytest -n auto --dist worksteal -m "not slow"

test-slow: .venv/dev.stamp
	$(BIN)/pytest -n auto --dist worksteal -m slow

check: .venv/dev.stamp
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/typos --format brief
	$(BIN)/python docs/_ext/terms.py

# The site, with every warning an error; then that no page of it asks another host for anything.
SITE := build/docs
docs: .venv/docs.stamp
	rm -rf $(SITE)
	$(BIN)/sphinx-build -q -W --keep-going -n -c docs -d build/doctrees . $(SITE)
	$(BIN)/python docs/_ext/own_host.py $(SITE)
	@echo 'To read it: $(SITE)/index.html'

package: .venv/dev.stamp
	.ci/package

bench: .venv/bench.stamp
	$(BIN)/python -m benchmarks

figures: .venv/run.stamp
	$(BIN)/python examples/feasibility_map.py
	$(BIN)/python examples/idea.py
	$(BIN)/python examples/comfort.py
	$(BIN)/python examples/known_against_proposed.py
	$(BIN)/python examples/techniques.py

# The pages that the documentation shows, photographed in Chromium, the output of the lessons, and FreeCAD.
screenshots: .venv/dev.stamp
	$(BIN)/python examples/screenshots.py
	$(BIN)/python docs/_ext/lessons.py pictures
	PICTURES=docs FREECAD=required $(BIN)/pytest -q tests/freecad/test_workbench.py

# One environment, filled in steps: what running needs, what developing adds, what benchmarks and the site add.
.venv/tools.stamp: requirements/build.txt
	$(PYTHON) -c 'import sys; sys.exit("kerfpath needs Python 3.11 or newer, this is " + sys.version.split()[0] if sys.version_info < (3, 11) else 0)'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --require-hashes -r requirements/build.txt
	touch $@

.venv/run.stamp: requirements/run.txt pyproject.toml .venv/tools.stamp
	VIRTUAL_ENV=.venv $(BIN)/uv pip install --quiet --compile-bytecode --require-hashes -r requirements/run.txt
	VIRTUAL_ENV=.venv $(BIN)/uv pip install --quiet --no-deps --no-build-isolation --editable .
	touch $@

.venv/dev.stamp: requirements/dev.txt .venv/run.stamp
	VIRTUAL_ENV=.venv $(BIN)/uv pip install --quiet --compile-bytecode --require-hashes -r requirements/dev.txt
	touch $@

.venv/bench.stamp: requirements/bench.txt .venv/dev.stamp
	VIRTUAL_ENV=.venv $(BIN)/uv pip install --quiet --compile-bytecode --require-hashes -r requirements/bench.txt
	touch $@

.venv/docs.stamp: requirements/docs.txt .venv/dev.stamp
	VIRTUAL_ENV=.venv $(BIN)/uv pip install --quiet --compile-bytecode --require-hashes -r requirements/docs.txt
	touch $@

# Resolve the pinned requirement files again (they name no host).
LOCK := $(BIN)/uv pip compile --quiet --universal --generate-hashes --no-header --no-annotate --python-version 3.11
lock: .venv/tools.stamp
	$(LOCK) requirements/build.in -o requirements/build.txt
	$(LOCK) requirements/outside.in -o requirements/outside.txt
	$(LOCK) --extra dev pyproject.toml -c requirements/build.txt -o requirements/dev.txt
	$(LOCK) --extra cad --extra cells --extra programs --extra report --extra studio pyproject.toml -c requirements/dev.txt -o requirements/run.txt
	$(LOCK) --extra bench pyproject.toml -c requirements/dev.txt -o requirements/bench.txt
	$(LOCK:--universal=--python-platform x86_64-manylinux_2_35) requirements/planners.in -o requirements/planners.txt
	$(LOCK) --extra compas pyproject.toml -c requirements/dev.txt -o requirements/compas.txt
	$(LOCK) --extra docs pyproject.toml -c requirements/dev.txt -o requirements/docs.txt

clean:
	rm -rf .venv $(DEMO_OUT) build dist .mypy_cache .pytest_cache .ruff_cache .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
