# make          set everything up and run the demo on the simulated bus
# make test     set everything up and run every check
# make format   format the code and apply the fixes that ruff makes by itself
# make net      diagnose the fixed cases of tests/net again and print what changed (up to 40 min), then run
#               tests/net/incidents; continues a stopped run of this commit; NET=FOLDER for changes without a commit
# make fuzz, make fault-matrix: 20 000 damaged inputs; 10 000 runs with a fault (10 to 20 min each)
# make mutation run the tests against mutants of the safety code, SAMPLE of each module (an hour)
# make vm-test  boot a PREEMPT_RT kernel in a virtual machine and disturb the bench there (as root)
# make docs     build the site of the manual in build/site, for reading without a server or a network
# make test-long, make peers, make clean
PYTHON ?= python3.11
BIN := .venv/bin
INSTALLED := .venv/.installed
SAMPLE ?= 25
SEED ?= 1
# one folder holds the answers of one state of the code
NET ?= runs/net-$(shell git rev-parse --short HEAD 2>/dev/null)

.PHONY: all setup docs test test-long format net fuzz fault-matrix mutation vm-test peers clean

all: setup
	$(BIN)/hil demo

setup: $(INSTALLED)

$(INSTALLED): requirements.lock pyproject.toml
	@command -v $(PYTHON) >/dev/null || { echo "$(PYTHON) not found: install Python 3.11 or give PYTHON=..."; exit 2; }
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps -e .
	@touch $(INSTALLED)

test: setup
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/hil warm-up & compiling=$$!; trap "kill $$compiling" INT TERM; \
	if $(BIN)/mypy; then wait $$compiling; else kill $$compiling; exit 1; fi
	$(BIN)/lint-imports
	OPENBLAS_NUM_THREADS=1 $(BIN)/pytest -n 2 --dist loadfile -m "not long and not net"

test-long: setup
	OPENBLAS_NUM_THREADS=1 $(BIN)/pytest -n 2 --dist loadfile -m "not net"

fuzz: setup
	$(BIN)/python tests/fuzz/fuzz.py

fault-matrix: setup
	$(BIN)/python tests/faults/matrix.py

mutation: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check cosmic-ray==8.7.0
	$(BIN)/python tests/mutation/mutate.py --sample $(SAMPLE) --seed $(SEED)

vm-test: setup
	$(BIN)/python tests/vm/vm.py

format: setup
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

net: setup
	$(BIN)/python tests/net/net.py $(NET)
	$(BIN)/pytest -n 2 --dist loadfile -m net

docs: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[docs]'
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@echo "open build/site/index.html"

# what hil bench and hil prove measure the project against; not needed to run it
peers: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r requirements-peers.lock

clean:
	rm -rf .venv build runs out *.egg-info .mypy_cache .pytest_cache .ruff_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
