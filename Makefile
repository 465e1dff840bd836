# One target per chore. Needs Rust, Python >= 3.10 with venv, a C compiler and make; with Chromium or Chrome the pages of
# the viewer are tested too.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
RUST_SOURCES := $(shell find crates -name '*.rs' -o -name Cargo.toml) Cargo.toml Cargo.lock

.PHONY: help tour test test-rust test-python lint studies docs pictures notebooks public-names features deny bench bench-peers fuzz \
	mutate wheel package licences clean

# This list.
help:
	@awk '/^# / { said = substr($$0, 3); next } \
		/^[a-z][a-z-]*:( |$$)/ { printf "  make %-13s %s\n", substr($$1, 1, length($$1) - 1), said } { said = "" }' Makefile

# The guided tour: a report with what the library does and how it is known to be right.
tour:
	$(MAKE) --jobs 2 $(VENV)/.extension $(VENV)/.tour
	$(BIN)/python -m tour

# Everything that must pass. What waits for the network or for one core leaves the other to the compiler.
test:
	$(MAKE) --jobs 2 lint test-rust
	$(MAKE) test-python

# Formatting, lints and types. The quick part of `test`.
lint: $(VENV)/.extension-dev
	cargo fmt --check
	cargo clippy --workspace --all-targets -- -D warnings
	$(BIN)/ruff check docs python release tour tests/python benches/peers
	$(BIN)/mypy

# Benchmarks hold none, and without them the tests and the extension share one build of what they depend on; examples hold
# none either, and clippy compiles them. Compilers cannot reach the job server of make, and say so where they see one.
# The tests in Rust.
test-rust:
	MAKEFLAGS= cargo test --workspace --exclude somersault-benches --tests
	MAKEFLAGS= cargo test --workspace --exclude somersault-benches --doc

# The tests in Python.
test-python: $(VENV)/.extension-dev $(VENV)/.tour
	$(BIN)/python -m pytest --numprocesses auto --dist loadfile --no-loadscope-reorder

# Long versions of tests, which take minutes.
studies: $(VENV)/.extension-dev
	cargo test --workspace --exclude somersault-benches --tests -- --ignored
	$(BIN)/python -m pytest -m study

# The book with the documentation of the crates in it, in out/book; links are followed.
docs: $(VENV)/.extension
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet
	rm -rf out/book/rust
	cp -R $(or $(CARGO_TARGET_DIR),target)/doc out/book/rust
	$(BIN)/python docs/formulas.py out/book/rust
	$(BIN)/python docs/check_links.py out/book

# The pictures of the README and the book.
pictures: $(VENV)/.extension
	$(BIN)/python docs/pictures.py
	$(BIN)/python docs/crate_graph.py

# The notebooks, run again with their outputs stored in them.
notebooks: $(VENV)/.extension
	$(BIN)/python docs/notebooks.py

# Tests hold both against what there is, and so show what a change adds or removes.
# The lists of public names, and the parts of stubs that follow from the extension, written anew.
public-names: $(VENV)/.extension-dev
	$(BIN)/python tests/python/stubs.py
	$(BIN)/python tests/python/public_names.py
	$(BIN)/python tests/python/rust_names.py

# Licences, sources and known faults of the dependencies; needs cargo-deny.
deny:
	cargo deny check

# The benchmarks of the crates.
bench:
	cargo bench --workspace

# The facade with each of its features alone, and with none.
features:
	for feature in "" contact dives expr ftla motion multibody nlp ocp rayon robots serde storage; do \
		cargo check --package somersault --no-default-features --features "$$feature" || exit 1; done

# The same problems solved by other packages, side by side.
bench-peers: $(VENV)/.peers
	PYTHONPATH=. $(BIN)/python benches/peers

# Hostile files for the readers, ten minutes for each format; needs nightly and cargo-fuzz.
fuzz:
	mkdir -p out/corpus/urdf out/corpus/mjcf out/corpus/judged out/corpus/recording
	cargo +nightly fuzz run urdf out/corpus/urdf fuzz/corpus/urdf -- -dict=fuzz/urdf.dict -max_total_time=600 -max_len=4096
	cargo +nightly fuzz run mjcf out/corpus/mjcf fuzz/corpus/mjcf -- -dict=fuzz/mjcf.dict -max_total_time=600 -max_len=4096
	cargo +nightly fuzz run judged out/corpus/judged fuzz/corpus/judged -- -max_total_time=600 -max_len=4096 -rss_limit_mb=1024
	cargo +nightly fuzz run recording out/corpus/recording fuzz/corpus/recording -- -max_total_time=3000 -max_len=4096 \
		-rss_limit_mb=1024

# 30,000 calls of the Python package with wrong arguments, in children that an abort takes alone.
mutate: $(VENV)/.extension-dev
	$(BIN)/python tests/python/mutated_calls.py --calls 30000

# A wheel and a source distribution in dist/.
wheel: $(VENV)/.tools
	rm -rf dist
	$(BIN)/maturin build --release --strip --out dist
	$(BIN)/maturin sdist --out dist

# Every published crate, packaged and built from its package.
package:
	cargo package --workspace --exclude somersault-benches --exclude somersault-py --exclude somersault-testkit \
		--exclude somersault-tests

# The licence texts of what the wheel links, LICENSE-THIRD-PARTY, written again after a change of dependencies.
licences:
	$(PYTHON) release/licences.py

# Removes what was built.
clean:
	rm -rf $(VENV) dist
	cargo clean

# Stamps: each is made once, and again where what it depends on has changed.

# With uv, packages are there in a tenth of the time that pip takes.
$(VENV)/.tools:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet 'maturin>=1.9,<2' 'uv>=0.5'
	touch $@

# The package, editable, with its extension in the release profile.
$(VENV)/.extension: $(VENV)/.tools pyproject.toml $(RUST_SOURCES)
	MAKEFLAGS= $(BIN)/maturin develop --release --uv --extras docs,plot
	rm -f $(VENV)/.extension-dev
	touch $@

# The same in the profile of the tests, which checks its arithmetic and is built for them anyway.
$(VENV)/.extension-dev: $(VENV)/.tools pyproject.toml $(RUST_SOURCES)
	$(BIN)/maturin develop --profile dev --uv --extras test
	rm -f $(VENV)/.extension
	touch $@

# What the tour needs beside the package.
$(VENV)/.tour: $(VENV)/.tools tour/requirements.txt
	$(BIN)/uv pip install --quiet --python $(BIN)/python --requirement tour/requirements.txt
	touch $@

$(VENV)/.peers: $(VENV)/.extension
	$(BIN)/maturin develop --release --uv --extras bench
	touch $@
