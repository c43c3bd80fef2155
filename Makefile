# magtip: `make demo` runs the main job, `make test` runs every check. Both set up .venv first.
PYTHON ?= python3
BIN := .venv/bin
PLAIN := .venv/plain
ONE_THREAD := OMP_NUM_THREADS=1 MKL_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
OUT ?= out/demo

.PHONY: demo test pytest check scripts compile plain setup docs format clean

demo: setup
	$(BIN)/magtip demo --out $(OUT)

# two at a time, in this order: numba compiles beside the checks, and all tests read its files; what is left out,
# because a program is missing, is said in the last lines
test:
	$(MAKE) --no-print-directory -j2 compile check plain pytest
	@command -v npm >/dev/null || echo "left out: format and rules of the pages' scripts, npm is not installed"

# as many processes as cores, so each on one thread; one that has ended takes tests over from another
pytest: compile
	$(ONE_THREAD) $(BIN)/python -m pytest -n auto --dist worksteal

check: setup scripts
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

# format and rules of the pages' scripts, by prettier and eslint; node is needed for this only
scripts:
	@if command -v npm >/dev/null; then { [ -f node_modules/.package-lock.json ] || npm ci --silent --no-fund --no-audit --ignore-scripts; } && npm run --silent check; \
	elif [ -n "$$MAGTIP_NEEDS_NPM" ]; then echo "npm is missing, which checks the pages' scripts"; exit 1; \
	else echo "npm is not installed: the pages' scripts are not checked (Debian: apt-get install npm)"; fi

node_modules/.package-lock.json: package-lock.json
	npm ci --silent --no-fund --no-audit --ignore-scripts
	touch $@

compile: setup
	PYTHONPATH=. $(ONE_THREAD) $(BIN)/python tests/compile_functions.py

# the verdicts of stability without MKL, in an environment of their own; what a mesh or a scale changes is no verdict
plain: compile $(PLAIN)/ready
	MAGTIP_PLAIN=1 $(ONE_THREAD) $(PLAIN)/bin/python -m pytest -p no:cacheprovider tests/test_without_extras.py tests/test_linear_solvers.py tests/test_stability.py \
	  -k "not depend_on_the_mesh and not scale_with_size"

$(PLAIN)/ready: .venv/ready tests/plain_environment.py
	$(BIN)/python tests/plain_environment.py $(PLAIN)
	touch $@

setup: .venv/ready

# a recent pip resolves the packages in a third of the time of the one that Python 3.11 brings
.venv/ready: pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "magtip needs Python 3.11 or newer; run: make PYTHON=python3.11")'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check 'pip>=25'
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[fast,cluster,test]'
	touch $@

# the site, in out/docs and for `magtip help`: tutorials are run for their pictures, with the one thread of OpenBLAS that the command
# has, since sums have other last digits with two, and must print what they show; a warning is an error, as is a link that leads nowhere
docs: .venv/docs
	OPENBLAS_NUM_THREADS=1 $(BIN)/python docs/documented_commands.py out/tutorials
	$(BIN)/sphinx-build -E -W --keep-going -q -c docs . out/docs
	mkdir -p .venv/share/doc && ln -sfn "$(CURDIR)/out/docs" .venv/share/doc/magtip
	@echo "open out/docs/index.html"

.venv/docs: .venv/ready
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[docs]'
	touch $@

format: setup
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .
	if command -v npm >/dev/null; then $(MAKE) node_modules/.package-lock.json && npm run --silent format; fi

clean:
	rm -rf .venv node_modules out
