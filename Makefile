# Two commands matter: `make demo` and `make test`. Both set up everything they need in .venv first.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
RUST_SOURCES := $(shell find rust -name '*.rs' -o -name 'Cargo.toml') Cargo.toml Cargo.lock pyproject.toml

.PHONY: demo test test-rust test-python data lint format accuracy inspection reality reality-scenes bilateral simulator experiments method schema constants studies performance instructions fuzz clean

demo: $(VENV)/.installed ## Reconstruct the solder ball that ships with bgars
	$(BIN)/bgars demo -o demo-output

test: test-rust test-python ## All tests, Rust and Python

test-rust:
	@if command -v cargo >/dev/null; then cargo test --locked; \
	else echo "SKIPPED: the Rust tests need cargo on the PATH (the Python tests run without it)"; fi

test-python: $(VENV)/.installed
	@.ci/find-browser || test "$$BGARS_REQUIRE_BROWSER" != 1
	$(BIN)/python -m pytest -n auto --maxprocesses 4 --dist worksteal -m "not alone"
	$(BIN)/python -m pytest -m alone

lint: $(VENV)/.installed ## Formatting, clippy, ruff, mypy, and the stub against the compiled module
	cargo fmt --check --all
	cargo clippy --locked --workspace --all-targets -- -D warnings
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/stubtest bgars._bgars

format: $(VENV)/.installed
	cargo fmt --all
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

data:
	@test -n "$$BGARS_DATA" || { echo "BGARS_DATA is not set: it names the folder of scenes, photographs and normal maps" >&2; exit 1; }

accuracy: data $(VENV)/.installed ## Rewrite the tables of docs/accuracy.md (needs BGARS_DATA)
	$(BIN)/python docs/make_accuracy.py

inspection: data $(VENV)/.installed ## Rewrite the inspection tables of docs/accuracy.md (needs BGARS_DATA)
	$(BIN)/python docs/make_inspection_accuracy.py

SEEDS ?= 1001-1100
reality-scenes: $(VENV)/.installed ## Render SEEDS into benches/reality/scenes (10 to 60 s a seed; needs an LLVM, see benches/reality)
	$(BIN)/python -m pip install --quiet --requirement benches/reality/requirements.txt
	$(BIN)/python benches/reality/make_scenes.py $(SEEDS)

WORKERS ?= 2
reality: $(VENV)/.installed ## Judge benches/reality/scenes and rewrite its tables of docs/accuracy.md
	$(BIN)/python docs/make_reality.py --workers $(WORKERS) --keep benches/reality/judged

bilateral: data $(VENV)/.installed ## Rewrite the bilateral tables of docs/accuracy.md, draw their pictures (needs BGARS_DATA)
	$(BIN)/python docs/make_bilateral.py

simulator: data $(VENV)/.installed ## Rewrite the tables of docs/simulator.md (needs BGARS_DATA)
	$(BIN)/python docs/make_simulator_check.py

experiments: $(VENV)/.installed ## Run the paper's experiments again and rewrite docs/experiments.md
	$(BIN)/bgars experiment all -o docs/images/experiments --page docs/experiments.md

method: $(VENV)/.installed ## Draw the pictures of docs/reflectance.md and one of docs/inspection.md again
	$(BIN)/python docs/make_method_pictures.py

studies: $(VENV)/.installed ## Run the gauge studies of docs/studies.md again (15 minutes)
	$(BIN)/python docs/make_studies.py

schema: $(VENV)/.installed ## Write docs/result.schema.json, the JSON Schema of result.json, again
	$(BIN)/python docs/make_result_schema.py

constants: $(VENV)/.installed ## Write docs/constants.md, the registry of constants, again
	$(BIN)/python docs/make_constants.py

FUZZ_INPUTS ?= 1000000
fuzz: $(VENV)/.installed ## Damaged files for every reader: FUZZ_INPUTS of them (hours); findings go to fuzz-findings
	$(BIN)/python tests/fuzz/fuzzer.py --inputs $(FUZZ_INPUTS)

instructions: ## Instructions a pixel of each kernel against the kept counts (needs valgrind)
	python3 benches/count_instructions.py

performance: $(VENV)/.installed ## Measure against the peers and rewrite docs/performance.md (long; leave the machine alone)
	$(BIN)/python -m pip install --quiet --requirement benches/peers/requirements.txt
	$(BIN)/python docs/make_performance.py

clean:
	rm -rf $(VENV) target demo-output

# The compiled module is rebuilt when a Rust source changes; Python sources are used in place.
$(VENV)/.installed: $(RUST_SOURCES)
	@echo "Building bgars in $(VENV): fetches packages, compiles Rust; minutes the first time, without a word"
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --editable '.[test,lint]'
	touch $@
