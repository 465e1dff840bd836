//! Finds the methods: the files under `src/methods` that call `register!`.
//!
//! Two files for `src/methods` come out: `modules.rs` declares these files as modules, and `rows.rs` is the table with the
//! rows they register, by place. Nothing else names a method.

use std::collections::BTreeMap;
use std::env;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

fn main() {
    println!("cargo::rerun-if-changed=src/methods");
    let variable = |name| PathBuf::from(env::var_os(name).unwrap_or_else(|| panic!("cargo sets {name}")));
    let sources = variable("CARGO_MANIFEST_DIR").join("src/methods");
    let mut files: Vec<PathBuf> = fs::read_dir(&sources)
        .unwrap_or_else(|error| panic!("{}: {error}", sources.display()))
        .map(|entry| entry.expect("an entry of src/methods").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "rs"))
        .collect();
    files.sort();

    let mut modules = String::new();
    let mut rows: BTreeMap<u32, (String, &Path)> = BTreeMap::new();
    for path in &files {
        let source = fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let source = source.replace("\r\n", "\n");
        let Some(registered) = registered(&source) else { continue };
        let module = path.file_stem().expect("a file has a name").to_string_lossy();
        writeln!(modules, "#[path = {path:?}]\npub mod {module};\n#[doc(inline)]\npub use {module}::*;")
            .expect("a string takes text");
        for row in registered.split_inclusive(";\n").map(str::trim).filter(|row| !row.is_empty()) {
            let place = row.split_whitespace().next().and_then(|place| place.parse().ok());
            let place = place.unwrap_or_else(|| {
                panic!("{}: a row of `register!` starts with its place, found `{row}`", path.display())
            });
            if let Some((_, other)) = rows.insert(place, (row.to_owned(), path)) {
                panic!("{}: place {place} is taken by {}", path.display(), other.display());
            }
        }
    }
    let rows: Vec<String> = rows.into_values().map(|(row, _)| row).collect();
    let table = format!("methods! {{ |options|\n{}\n}}\n", rows.join("\n"));

    let out = variable("OUT_DIR");
    for (name, text) in [("modules.rs", modules), ("rows.rs", table)] {
        let path = out.join(name);
        fs::write(&path, text).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    }
}

/// What stands between the braces of a file's `register!`.
fn registered(source: &str) -> Option<&str> {
    let (_, after) = source.split_once("\nregister! {\n")?;
    after.split_once("\n}").map(|(rows, _)| rows)
}
