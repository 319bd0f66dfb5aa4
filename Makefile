# Everything runs in .venv, made here; nothing else is needed but Python 3.11+ and make.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
DEMO_RUN := runs/demo
DEMO_BAY := runs/demo-bay
TANKER := runs/tanker
PIP_INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check

# Tests start the program some hundred times: compiled once, wherever that is switched off.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: install demo test test-long lint check bench bench-effects package docs site clean
.DELETE_ON_ERROR:

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(PIP_INSTALL) --editable .
	touch $@

# By uv, in a fifth of the time; by pip where uv does not reach the packages. Modules are compiled
# when they are imported, and most never are.
$(VENV)/.installed-dev: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(PIP_INSTALL) uv && $(BIN)/uv pip install --quiet --python $(BIN)/python --editable ".[dev]" \
		|| $(PIP_INSTALL) --no-compile --editable ".[dev]"
	touch $@ $(VENV)/.installed

install: $(VENV)/.installed

demo: $(VENV)/.installed
	$(BIN)/auvident run sample_logs/harbour_trial --vehicle sample_logs/remus100.toml --run $(DEMO_RUN)
	$(BIN)/auvident run sample_logs/bay_trial --vehicle sample_logs/tern180.toml --run $(DEMO_BAY)

test: $(VENV)/.installed-dev
	$(BIN)/python -m pytest --numprocesses auto --dist worksteal

# What takes long and has a stand-in among the others (tests/long_tests.py).
test-long: $(VENV)/.installed-dev
	$(BIN)/python -m pytest --long --numprocesses auto --dist worksteal

lint: $(VENV)/.installed-dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

check: lint test

# Figures go into docs/benchmarks.md, each part into its own section.
bench: $(VENV)/.installed-dev test-long
	$(BIN)/python -m tests.bench --write
	$(MAKE) package

# Wheel and source distribution, installed and run in a fresh environment of every Python there is.
package:
	PYTHON=$(PYTHON) .ci/package

# Seeds of their own, not those of development; a run that was interrupted goes on where it was.
EFFECTS_RUN := runs/bench-effects
bench-effects: $(VENV)/.installed-dev
	mkdir -p $(EFFECTS_RUN)
	$(BIN)/python -m tests.bench effects --seed-base 7000 \
		--resume $(EFFECTS_RUN)/outcomes.jsonl --json $(EFFECTS_RUN)/found.json --write

# Pages and pictures that the program makes: effects, commands, findings; and the figures and the
# report of a finished `make demo` and of the run on measured data that README.md shows.
docs: $(VENV)/.installed-dev
	$(BIN)/python -m tests.bench.pages $(wildcard $(DEMO_BAY) $(TANKER))
	$(BIN)/python -m tests.bench.interface

# The documentation as a site that needs neither a network nor a server: open site/index.html.
site: $(VENV)/.installed-dev
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet
	@echo site/index.html

clean:
	rm -rf $(VENV) runs build site *.egg-info .pytest_cache .mypy_cache .ruff_cache
