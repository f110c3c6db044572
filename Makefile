# SPDX-License-Identifier: MIT OR Apache-2.0
# Needs Rust, a C linker and Python >= 3.11; everything else goes into .venv.

.DEFAULT_GOAL := help
SHELL := bash
.SHELLFLAGS := -euo pipefail -c
.DELETE_ON_ERROR:
.SUFFIXES:

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check
# With CI set, Cargo.lock must be up to date.
LOCKED := $(if $(CI),--locked)
# The first interpreter that is new enough; `make PYTHON=...` chooses another.
PYTHON ?= $(shell for python in python3 python3.14 python3.13 python3.12 python3.11 python; do \
	$$python -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$python && break; done)
# One interpreter for all builds of the bindings; otherwise each would rebuild everything.
export PYO3_PYTHON := $(abspath $(BIN)/python)

SOURCES := $(shell find src python -name '*.rs' -o -name '*.py' -o -name '*.pyi') \
	Cargo.toml Cargo.lock pyproject.toml README.md

help: ## Show this help
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  %-8s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

demo: $(VENV)/.installed ## Solve the paper's two robot experiments and draw them into ./demo/
	$(BIN)/bearslam demo --output demo

test: test-rust probe test-python ## Run all tests, Rust and Python

all: lint test ## What CI runs: lint and test

test-rust:
	cargo test $(LOCKED) --features rayon,capi,serde
	cargo check $(LOCKED) --no-default-features
	cargo check $(LOCKED) --no-default-features --features alloc

PROBE := $(LOCKED) --quiet --release --manifest-path tests/probe/Cargo.toml --target-dir target/probe
# Targets to build for, if the toolchain has them.
BARE := thumbv7em-none-eabihf riscv32imac-unknown-none-elf

probe: ## Prove that the kernels need no std, no heap and no panic
	@# No dependency has its std or alloc feature enabled.
	@mkdir -p target/probe
	cargo tree $(LOCKED) --no-default-features --edges normal,features > target/probe/tree.txt
	! grep -E '"(std|alloc)"' target/probe/tree.txt
	@# It links only if it has no panic and no allocator.
	cargo build $(PROBE)
	nm target/probe/release/probe > target/probe/symbols.txt
	! grep -E 'panic|alloc|unwind' target/probe/symbols.txt
	@for target in $(BARE); do \
		if [[ -d $$(rustc --print sysroot)/lib/rustlib/$$target ]]; then \
			echo "cargo build --target $$target"; cargo build $(PROBE) --target $$target; \
		else \
			echo "SKIPPED $$target: rustup target add $$target"; \
		fi; \
	done

CAPI := $(LOCKED) --quiet --release --manifest-path capi/Cargo.toml --target-dir target/capi

capi: ## Build the static library of the C interface into ./target/capi/release/
	cargo build $(CAPI)

header: ## Regenerate the header of the C interface
	BEARSLAM_WRITE_HEADER=1 cargo test $(LOCKED) --features rayon,capi --test rust header

test-python: $(VENV)/.installed $(VENV)/.dev
	$(BIN)/python -m mypy.stubtest bearslam --allowlist tests/python/stubtest.txt --ignore-unused-allowlist
	$(BIN)/python -m pytest

format: $(VENV)/.dev ## Format Rust and Python
	cargo fmt
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

lint: $(VENV)/.dev ## Check format, clippy, ruff, types and documentation
	cargo fmt --check
	cargo fmt --check --manifest-path tests/probe/Cargo.toml
	cargo fmt --check --manifest-path capi/Cargo.toml
	cargo clippy $(PROBE) -- -D warnings
	cargo clippy $(CAPI) -- -D warnings
	cargo clippy $(LOCKED) --all-targets -- -D warnings
	cargo clippy $(LOCKED) --all-targets --all-features -- -D warnings
	cargo clippy $(LOCKED) --no-default-features -- -D warnings
	cargo clippy $(LOCKED) --no-default-features --features alloc -- -D warnings
	RUSTDOCFLAGS='-D warnings' cargo doc $(LOCKED) --no-deps --all-features
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

wheel: dist/.built ## Build the wheel into ./dist/

bench: ## Measure the speed of the core
	cargo bench $(LOCKED)

fuzz: $(VENV)/.installed ## Fuzz the many-view API for MINUTES=10, continuing the ledger ./fuzz.jsonl
	$(BIN)/python -m tests.fuzz run --minutes $(or $(MINUTES),10)

docs: $(VENV)/.dev ## Build the documentation of the crate
	cargo doc $(LOCKED) --no-deps --all-features

clean: ## Delete all build products
	cargo clean
	rm -rf $(VENV) dist demo .mypy_cache .pytest_cache .ruff_cache .hypothesis

$(VENV)/.ready:
	@[[ -n "$(PYTHON)" ]] || { echo 'bearslam needs Python >= 3.11; name one with make PYTHON=...' >&2; exit 1; }
	$(PYTHON) -m venv --clear $(VENV)
	$(PIP) install --quiet --upgrade 'pip>=25.1'
	touch $@

$(VENV)/.build: pyproject.toml | $(VENV)/.ready
	$(PIP) install --quiet --group build
	touch $@

$(VENV)/.dev: pyproject.toml | $(VENV)/.ready
	$(PIP) install --quiet --group dev
	touch $@

dist/.built: $(SOURCES) $(VENV)/.build
	rm -rf dist
	$(BIN)/maturin build --release $(LOCKED) --out dist
	touch $@

$(VENV)/.installed: dist/.built
	$(PIP) install --quiet --force-reinstall --no-deps dist/*.whl
	wheel=$$(echo dist/*.whl); $(PIP) install --quiet "$$wheel[plot]"
	touch $@

.PHONY: help demo test test-rust probe capi header test-python all format lint wheel bench fuzz docs clean
