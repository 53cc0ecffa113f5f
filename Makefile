PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
ARGS   ?=
INSTALLED := $(VENV)/.installed
READY  := $(VENV)/.ready
COMPARED := $(VENV)/.compared

.PHONY: run test quick lint types contracts collected unit stress soak soak-agent oracle bench scenarios pictures atlas doctor-corpus clean

# Compiled tests are kept: each of the processes that run them would compile them again.
unexport PYTHONDONTWRITEBYTECODE

run: $(INSTALLED)
	@$(BIN)/trcvtui $(ARGS)

# Both cores: mypy on one, the tests compiled by pytest on the other.
test: $(READY)
	@$(MAKE) --no-print-directory -j2 lint types contracts collected
	@$(MAKE) --no-print-directory unit

# The minute between two edits: no screen, no real sockets, nothing slow.
quick: $(READY)
	@$(MAKE) --no-print-directory -j2 lint types contracts
	$(BIN)/pytest -n 2 --dist worksteal -m "not (screen or live or slow)" --ignore tests/tui --ignore tests/e2e --ignore tests/properties $(ARGS)

lint: $(READY)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .

types: $(READY)
	$(BIN)/mypy

contracts: $(READY)
	$(BIN)/lint-imports

collected: $(READY)
	@$(BIN)/pytest --collect-only -q >/dev/null || $(BIN)/pytest --collect-only -q

# Five on two cores: the tests of the screen wait for it as much as they compute.
unit: $(READY)
	$(BIN)/pytest -n 5 --dist worksteal $(ARGS)

scenarios: $(READY)
	$(BIN)/trcvtui scenario configs/scenarios/baosky/*.toml configs/scenarios/siemens/*.toml $(ARGS)

# Beside two busy loops: what fails there is a bug until proven otherwise. Of golden traces those of cut wires.
ROUNDS ?= 20
CUT    := $(wildcard configs/scenarios/baosky/80ab-*.toml) configs/scenarios/baosky/switch-dead-link-80a0.toml
LIVE   := test_a_scenario_on_real_sockets
RECORD := tests/recording/test_record_command.py::test_
TESTS  ?= tests/e2e/test_tap_screen.py tests/recording/test_black_box.py tests/tui/fleet/test_fleet_screen.py \
          tests/properties/test_killed_runs.py $(RECORD)record_ends_cleanly_when_all_its_programs_are_told_to \
          $(CUT:configs/scenarios/baosky/%.toml='tests/scenario/test_every_scenario.py::$(LIVE)[baosky/%]')
stress: $(READY)
	@$(BIN)/python .ci/stress.py $(ROUNDS) $(TESTS)

# A million random scans on simulated networks: minutes; ten million of self-checking traffic: an hour or two.
# TRCVTUI_SOAK_SCANS and TRCVTUI_SOAK_TRAFFIC say how many.
soak: $(READY)
	TRCVTUI_SOAK=1 TRCVTUI_SHARED_SCANS=400000 $(BIN)/pytest -s tests/properties tests/udt/test_blind_cases.py tests/udt/test_drift.py tests/udt/test_report.py tests/recording/test_recording.py tests/recording/test_record_command.py tests/history/test_waveforms.py tests/diagnosis/truth/test_truth.py tests/e2e/test_guide_terminal.py $(ARGS)
	$(BIN)/pytest -n 2 -m hypothesis --hypothesis-profile searching $(ARGS)

# A hundred thousand events of eight lines over TLS on a Mosquitto of its own: a minute or two.
soak-agent: $(READY)
	@TRCVTUI_SOAK_AGENT=100000 $(BIN)/pytest -s tests/fleet/test_many_messages.py $(ARGS)

# Ten thousand random types against gcc, offset for offset; `make test` compares a few hundred. Then every type
# file, own and of others, cut at every byte: minutes.
oracle: $(READY)
	TRCVTUI_ORACLE=10000 $(BIN)/pytest -s -o timeout=900 tests/udt/test_oracle_gcc.py $(ARGS)
	TRCVTUI_ORACLE=1 $(BIN)/pytest -n 2 -rs tests/udt/test_corpus.py $(ARGS)

bench: $(COMPARED)
	$(BIN)/python -m benchmarks $(ARGS)

# A marker is written last, so that an interrupted first run starts again from nothing. Compiled as pip does
# with an installed program: where PYTHONDONTWRITEBYTECODE is set, every start would compile it.
$(INSTALLED): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "trcvtui needs Python 3.11 or newer")'
	@echo "Installing trcvtui and what it needs into $(VENV): a minute, once."
	$(PYTHON) -m venv --clear $(VENV)
	$(BIN)/python -m pip install --disable-pip-version-check --quiet --upgrade 'pip>=25.1'  # its scripts import no re
	$(BIN)/python -m pip install --disable-pip-version-check --editable .
	@$(BIN)/python -m compileall -q trcvtui
	@touch $@

# What only the tests need: not on the way of `make run`.
$(READY): $(INSTALLED)
	@echo "Installing what the tests need into $(VENV): a minute, once."
	$(BIN)/python -m pip install --disable-pip-version-check --editable '.[test]'
	@touch $@

# What the benchmarks compare with; without a network they say what they could not measure.
$(COMPARED): $(READY)
	-$(BIN)/python -m pip install --disable-pip-version-check --editable '.[bench]' && touch $@

# How often the doctor is right, on captures of others and our own: half a minute, no test.
doctor-corpus: $(READY)
	@$(BIN)/python -m tests.diagnosis.corpus

pictures: $(READY)
	$(BIN)/python docs/make_pictures.py

atlas: $(READY)
	$(BIN)/python docs/make_status.py
	$(BIN)/python docs/make_keys.py
	$(BIN)/python docs/make_commands.py
	$(BIN)/python docs/make_bench_commands.py
	$(BIN)/python docs/make_key_table.py

clean:
	rm -rf $(VENV) .mypy_cache .pytest_cache .ruff_cache .hypothesis .import_linter_cache
