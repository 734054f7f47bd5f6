# Two commands matter: `make demo` and `make test`. Both set up everything they need in .venv first.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Modules are compiled when they are first imported; of the packages that are installed, most modules never are.
export PIP_NO_COMPILE := 1
# And kept: hundreds of processes begin in the tests, and each would compile numpy and scipy again, four times its work.
unexport PYTHONDONTWRITEBYTECODE
RUST_SOURCES := $(shell find rust -name '*.rs' -o -name 'Cargo.toml') Cargo.toml Cargo.lock pyproject.toml

.PHONY: demo docs wheel api test test-rust test-python data lint lint-rust lint-python format accuracy inspection reality reality-scenes bilateral station station-balls simulator experiments method shape-page check-faults kills line watch-station schema constants studies performance bench fuzz clean

demo: $(VENV)/.run-time ## Reconstruct the solder ball that ships with bgars
	$(BIN)/bgars demo -o demo-output

test: test-rust test-python ## All tests, Rust and Python

test-rust:
	@if command -v cargo >/dev/null; then cargo test --locked; \
	else echo "SKIPPED: the Rust tests need cargo on the PATH (the Python tests run without it)"; fi

test-python: $(VENV)/.installed
	@.ci/find-browser || test "$$BGARS_REQUIRE_BROWSER" != 1
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n auto --maxprocesses 4 --dist worksteal

lint: lint-rust lint-python ## Formatting, clippy, ruff, mypy, and the stub against the compiled module

lint-rust:
	cargo fmt --check --all
	cargo clippy --locked --workspace --all-targets -- -D warnings

lint-python: $(VENV)/.installed
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

SEEDS ?= 5001-5100
reality-scenes: $(VENV)/.installed ## Render SEEDS into benches/reality/scenes (10 to 60 s per seed; needs an LLVM, see benches/reality)
	$(BIN)/python -m pip install --quiet --requirement benches/reality/requirements.txt
	$(BIN)/python benches/reality/make_scenes.py $(SEEDS)

WORKERS ?= 2
reality: $(VENV)/.installed ## Judge benches/reality/scenes and rewrite its tables of docs/accuracy.md
	$(BIN)/python docs/make_reality.py --workers $(WORKERS) --keep benches/reality/judged

bilateral: data $(VENV)/.installed ## Rewrite the bilateral tables of docs/accuracy.md, draw their pictures (needs BGARS_DATA)
	PYTHONPATH=. $(BIN)/python docs/make_bilateral.py

station: data $(VENV)/.installed ## Measure the calibration of stations and rewrite the tables of docs/station.md (5 minutes; needs BGARS_DATA)
	$(BIN)/python docs/make_station.py

station-balls: $(VENV)/.installed ## Render balls for it with Mitsuba (5 s per seed; needs an LLVM, see benches/reality)
	$(BIN)/python -m pip install --quiet --requirement benches/reality/requirements.txt
	$(BIN)/python benches/station/render_balls.py benches/station/balls board 301 302 303 304 401 402 403 501 502 503 504 505 506 601 602 603 604 605 606 607 608 609 610
	$(BIN)/python benches/station/render_balls.py benches/station/balls grey 301 302 303 304 401 402 403 501 502 503 504 505 506
	$(BIN)/python benches/station/render_balls.py benches/station/balls matt 301 302 303 304 401 402 403

simulator: data $(VENV)/.installed ## Rewrite the tables of docs/simulator.md (needs BGARS_DATA)
	$(BIN)/python docs/make_simulator_check.py

experiments: $(VENV)/.installed ## Run the paper's experiments again and rewrite docs/experiments.md
	$(BIN)/python -m experiments all -o docs/images/experiments --page docs/experiments.md

method: $(VENV)/.installed ## Draw the pictures of docs/reflectance.md and one of docs/inspection.md again
	PYTHONPATH=. $(BIN)/python docs/make_method_pictures.py

shape-page: $(VENV)/.installed ## Draw the pictures of docs/shape.md and write its table again
	$(BIN)/python docs/make_shape.py

studies: $(VENV)/.installed ## Run the gauge studies of docs/studies.md again (15 minutes)
	$(BIN)/python docs/make_studies.py

check-faults: data $(VENV)/.installed ## Judge bgars check on captures with one fault each, rewrite the gallery of docs/captures.md (5 minutes; needs BGARS_DATA; BGARS_RENDERED: other rendered parts)
	$(BIN)/python docs/make_captures.py

api: $(VENV)/.run-time ## Write tests/unit/public_api.txt, the public names and signatures, again
	$(BIN)/python tests/unit/public_api.py

schema: $(VENV)/.installed ## Write docs/result.schema.json, the JSON Schema of result.json, again
	$(BIN)/python docs/make_result_schema.py

constants: $(VENV)/.installed ## Write docs/constants.md, the registry of constants, again
	$(BIN)/python docs/make_constants.py

docs: $(VENV)/.run-time ## Build the documentation site into site/ (warnings are errors; 1 to 3 minutes)
	$(BIN)/python -m pip install --quiet $$($(BIN)/python .ci/extra-requirements docs)
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --quiet

wheel: ## Build a manylinux wheel into dist/ and try it in a clean environment (minutes; Linux, needs cargo)
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet 'maturin[zig]>=1.9,<2'
	rm -rf dist
	PATH="$(CURDIR)/$(BIN):$$PATH" maturin build --release --locked --zig --compatibility manylinux2014 --out dist
	$(BIN)/python .ci/try-wheel dist

bench: $(VENV)/.run-time ## CPU seconds, wall time and memory of whole commands, into docs/performance.md
	$(BIN)/python benches/commands.py --docs

line: $(VENV)/.installed ## Measure batch, watch and store, and rewrite the tables of docs/line.md (10 minutes)
	$(BIN)/python docs/make_line.py

watch-station: $(VENV)/.installed ## Latency and memory of `bgars watch` over 6,000 small parts, into docs/line.md (20 minutes)
	$(BIN)/python benches/watch_station.py --docs

KILLS ?= 200
kills: $(VENV)/.installed ## Kill `bgars watch` at KILLS random times: every part is in the store once or still in the inbox (10 minutes)
	rm -rf kill-test && mkdir kill-test
	$(BIN)/python tests/unit/killed_watch.py kill-test $(KILLS) 1000
	rm -rf kill-test

FUZZ_INPUTS ?= 1000000
fuzz: $(VENV)/.installed ## Damaged files for every reader, hostile arguments for every call: FUZZ_INPUTS of them (hours); findings go to fuzz-findings
	$(BIN)/python tests/fuzz/fuzzer.py --inputs $(FUZZ_INPUTS)

performance: $(VENV)/.installed ## Measure against the peers and rewrite docs/performance.md (long; leave the machine alone)
	$(BIN)/python -m pip install --quiet --requirement benches/peers/requirements.txt
	$(BIN)/python docs/make_performance.py

clean:
	rm -rf $(VENV) target demo-output

# The compiled module is rebuilt when a Rust source changes; Python sources are used in place.
$(VENV)/.run-time: $(RUST_SOURCES)
	@echo "1 of 3: Python environment in $(VENV)"
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --upgrade pip
	@echo "2 of 3: packages (numpy, scipy, matplotlib, plotly and what they need)"
	@echo "3 of 3: compiling the Rust kernels; some minutes the first time"
	@$(BIN)/python -m pip install --editable '.[report]' | grep --line-buffered -E '^(Collecting|  Building|Building|Successfully|ERROR)' || true
	@$(BIN)/python -c "from bgars import _bgars" || { echo "bgars could not be installed: $(BIN)/python -m pip install -e '.[report]' says why" >&2; exit 1; }
	@touch $@

# What tests and linters need, on top of it.
$(VENV)/.installed: $(VENV)/.run-time pyproject.toml
	@echo "Tools for tests and lint"
	@$(BIN)/python -m pip install --quiet $$($(BIN)/python .ci/extra-requirements test lint)
	@touch $@
