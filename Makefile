# Sets up .venv by itself with what a target needs; no ROS on the machine is required.
.DEFAULT_GOAL := help

BIN := .venv/bin
PACKAGING := setup.py setup.cfg pyproject.toml
PYTHON ?=
SUPPORTED := import sys, ensurepip, venv; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))

# The last answer holds for .venv until there is another one.
LAST_BULLET := $(shell cat .venv/.bullet 2>/dev/null)
BULLET ?= $(LAST_BULLET)

# Robots of other makers, as data alone; most of these packages need much more than their files do.
ROBOTS := example-robot-data==6.0.0 icub-models==3.2.0 mani-skill==3.0.1 rtb-data==2.0.0 scikit-robot==0.4.7

export PIP_DISABLE_PIP_VERSION_CHECK := 1

# .venv has its own ROS: a sourced one, or another environment's, would be mixed into it.
ifneq ($(AMENT_PREFIX_PATH)$(_ROS_WHEELS_BOOTSTRAP_COMPLETE),)
unexport AMENT_PREFIX_PATH LD_LIBRARY_PATH PYTHONPATH RMW_IMPLEMENTATION _ROS_WHEELS_BOOTSTRAP_COMPLETE
endif

# Bytecode that is not kept would be compiled again at the start of each of hundreds of processes,
# and for each worker of the tests.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help venv demo backflip play test quick nightly docs hashes pages other-numpy bench soak kills noise long-recording documented robots format clean distclean

help: ## Show this list
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1|\2/p' $(MAKEFILE_LIST) | awk -F'|' '{ printf "%-16s %s\n", $$1, $$2 }'
	@echo "PYTHON=... chooses the interpreter of a new .venv (3.11 to 3.13)."
	@echo "BULLET=1 (in make venv) compiles PyBullet where it has no wheel (from 3.12 on), BULLET=0 leaves it out: the engine is then MuJoCo. Later targets keep to it."

venv: .venv/.installed ## Set up .venv

demo: .venv/.installed ## Let the humanoid walk for 20 s and record it in runs/demo
	$(BIN)/actuated_characters run --clip walk --duration 20 --planner hybrid --output runs/demo --overwrite
	@echo "to watch it: make play (live, in the browser), or $(BIN)/actuated_characters view runs/demo (this run; needs the extra 'view')"

backflip: .venv/.installed ## Let the humanoid do a backflip by its joints alone, planned; in runs/backflip
	$(BIN)/actuated_characters run --clip backflip --duration 1.75 --planner predictive --output runs/backflip --overwrite

play: .venv/.installed-view ## Let a humanoid walk in the browser, to be pushed and pelted with balls; in runs/play-walker
	$(BIN)/actuated_characters play

test: .venv/.installed-test ## Check style and types, run the tests
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m pytest -n auto --dist worksteal

quick: .venv/.installed-test ## Check style and types, run the tests that are not marked as slow
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m pytest -n auto --dist worksteal -m "not slow and not nightly" --durations 5 --durations-min 5

nightly: .venv/.installed-test ## What takes too long for each change: more tests, endurance, documented commands, other numpys (hours)
	$(BIN)/python -m pytest -n auto --dist worksteal -m nightly
	$(MAKE) soak noise kills long-recording other-numpy documented

hashes: .venv/.installed-test ## Renew the golden hashes, after a change that is meant to alter states
	$(BIN)/python -m tests.support.golden

docs: .venv/.installed-test ## Build the documentation as a site in build/docs
	$(BIN)/python -m sphinx -q -W --keep-going docs build/docs

pages: .venv/.installed-test ## Renew the pages that are made from the code
	$(BIN)/python -m tests.support.parameter_page
	$(BIN)/python -m tests.support.topic_table

other-numpy: .venv/.installed-test ## Compare the golden runs with the oldest and the newest numpy allowed
	for version in '==1.26.4' '>=2,<3'; do \
	    rm -rf build/numpy && $(BIN)/python -m pip install -qq --no-deps --target build/numpy "numpy$$version" && \
	    PYTHONPATH=build/numpy $(BIN)/python -m pytest -q -n auto -m "" tests/project/test_golden_hashes.py || exit 1; \
	done

bench: .venv/.installed-test ## Measure speed; ratios that got worse are red
	$(BIN)/python -m benchmarks

soak: .venv/.installed ## Run 500,000 ticks with disturbances; no tick lost, no memory grown
	$(BIN)/python -m tests.endurance.soak

kills: .venv/.installed-test ## Kill the recorder 100 times; every bag is recovered
	$(BIN)/python -m tests.endurance.kills

noise: .venv/.installed ## Run among 20,000 mutated messages on each topic; same states, no memory grown
	$(BIN)/python -m tests.endurance.noise

long-recording: .venv/.installed ## Record 5 minutes at 1 kHz; no message lost
	$(BIN)/python -m tests.endurance.long_recording

documented: .venv/.installed-test ## Run every documented command (an hour), and write docs/documented.md
	$(BIN)/python -m tests.documented

robots: .venv/.installed-test ## Try the URDF files of six packages (850 MB), and compare them with Pinocchio
	$(BIN)/python -m pip install -qq -e '.[robots]'
	test -d build/robots || $(BIN)/python -m pip install -qq --no-deps --target build/robots $(ROBOTS)
	$(BIN)/python -m tests.support.urdf_collection

format: .venv/.installed-test ## Format the code and fix what can be fixed
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

clean: ## Remove caches and builds
	rm -rf build dist install log *.egg-info .hypothesis .mypy_cache .pytest_cache .ruff_cache
	find . -path ./.venv -prune -o -name __pycache__ -type d -exec rm -rf {} +

distclean: clean ## Remove .venv too
	rm -rf .venv

.venv/.created:
	@found=; for python in $(or $(PYTHON),python3.11 python3.12 python3.13 python3); do \
	    if $$python -c '$(SUPPORTED)' 2>/dev/null; then found=$$python; break; fi; \
	done; \
	if [ -z "$$found" ]; then \
	    echo "error: $(if $(PYTHON),PYTHON=$(PYTHON) is not,found no) Python 3.11, 3.12 or 3.13 with venv; say which: make PYTHON=/path/to/python3.11" >&2; \
	    exit 1; \
	fi; \
	version=$$($$found -c 'import sys; print("%d.%d" % sys.version_info[:2])'); \
	if [ $$version != 3.11 ] && [ "$(BULLET)" = 1 ]; then time="some minutes: pip compiles PyBullet"; else time="about a minute"; fi; \
	echo "setting up .venv with Python $$version ($$time) ..."; \
	$$found -m venv --clear .venv
	@touch $@

ifneq ($(BULLET),$(LAST_BULLET))
.PHONY: .venv/.installed .venv/.installed-view .venv/.installed-test
endif

.venv/.installed: $(PACKAGING) | .venv/.created
	@echo "installing the package into .venv ..."
	$(call install,wheels)
	@touch $@

.venv/.installed-view: $(PACKAGING) | .venv/.created
	@echo "installing the package and its viewer into .venv ..."
	$(call install,wheels$(COMMA)view)
	@touch .venv/.installed $@

.venv/.installed-test: $(PACKAGING) | .venv/.created
	@echo "installing the package and its test tools into .venv ..."
	$(call install,wheels$(COMMA)test)
	@touch .venv/.installed .venv/.installed-view $@  # it has their extras, too

COMMA := ,
PIP := $(BIN)/python -m pip
# First PyBullet where it is asked for, by a pip that is not quiet while it compiles; then the package
# with its extras, robots and clips, which PyBullet's wheel has, and what is compiled once.
define install
$(if $(filter 1,$(BULLET)),@$(PIP) install pybullet==3.2.7 || { echo "$(PIP_FAILED)" >&2; exit 1; })
@$(PIP) install -qq -e '.[$(1)]' || { echo "$(PIP_FAILED)" >&2; exit 1; }
$(if $(filter 0,$(BULLET)),@$(PIP) uninstall -qq -y pybullet)
@$(BIN)/python -m msgs_config.fetch_robots || { echo "$(PIP_FAILED)" >&2; exit 1; }
@$(BIN)/python -m actuated_characters.compile_all $(if $(findstring test,$(1)),,--runs)
@echo '$(BULLET)' > .venv/.bullet
endef

PIP_FAILED := error: pip failed. It needs the network, and the wheels of ROS 2 are for Linux on x86-64 only.
