# One target per chore. Needs Rust, Python >= 3.10 with venv, a C compiler and make; with Chromium or Chrome the pages of
# the viewer are tested too.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
RUST_SOURCES := $(shell find crates -name '*.rs' -o -name Cargo.toml) Cargo.toml Cargo.lock

.PHONY: tour test test-rust test-python lint docs bench bench-peers fuzz wheel clean

# The guided tour: a report with what the library does and how it is known to be right.
tour: $(VENV)/.extension
	$(BIN)/python -m somersault tour

# Everything that must pass.
test: lint test-rust test-python

# Formatting, lints and types. The quick part of `test`.
lint: $(VENV)/.extension
	cargo fmt --check
	cargo clippy --workspace --all-targets -- -D warnings
	$(BIN)/ruff check python tests/python benches/peers
	$(BIN)/mypy
	$(BIN)/python -m mypy.stubtest --mypy-config-file pyproject.toml somersault._somersault

test-rust:
	cargo test --workspace

test-python: $(VENV)/.extension
	$(BIN)/python -m pytest

docs:
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps

bench:
	cargo bench --workspace

# The same problems solved by other packages, side by side.
bench-peers: $(VENV)/.peers
	$(BIN)/python benches/peers

# Each reader on ten minutes of hostile files; needs nightly and cargo-fuzz.
fuzz:
	mkdir -p out/corpus/urdf
	cargo +nightly fuzz run urdf out/corpus/urdf fuzz/corpus/urdf -- -dict=fuzz/urdf.dict -max_total_time=600 -max_len=4096
	for format in bvh c3d joint_motion judged marker_csv trc; do mkdir -p out/corpus/$$format && cargo +nightly fuzz run $$format \
		out/corpus/$$format fuzz/corpus/$$format -- -max_total_time=600 -max_len=4096 -rss_limit_mb=1024 || exit 1; done

# A wheel and a source distribution in dist/.
wheel: $(VENV)/.tools
	rm -rf dist
	$(BIN)/maturin build --release --strip --out dist
	$(BIN)/maturin sdist --out dist

clean:
	rm -rf $(VENV) dist
	cargo clean

# Stamps: each is made once, and again where what it depends on has changed.

$(VENV)/.tools:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet 'maturin>=1.9,<2'
	touch $@

# The package, editable, with its extension in the release profile.
$(VENV)/.extension: $(VENV)/.tools pyproject.toml $(RUST_SOURCES)
	$(BIN)/maturin develop --release --extras test,tour
	touch $@

$(VENV)/.peers: $(VENV)/.extension
	$(BIN)/maturin develop --release --extras bench
	touch $@
