//! Lists the methods: the files beside `src/methods/mod.rs`, which declares them and makes the table.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};

fn main() {
    println!("cargo::rerun-if-changed=src/methods");
    let mut methods: Vec<String> = fs::read_dir("src/methods")
        .expect("cargo runs this in the folder of the package")
        .map(|entry| PathBuf::from(entry.expect("an entry of src/methods").file_name()))
        .filter(|file| file.extension().is_some_and(|extension| extension == "rs"))
        .filter_map(|file| file.file_stem()?.to_str().map(str::to_owned))
        .filter(|method| method != "mod")
        .collect();
    methods.sort();
    let out = env::var_os("OUT_DIR").expect("cargo sets it");
    fs::write(Path::new(&out).join("table.rs"), format!("table! {{ {} => }}\n", methods.join(" ")))
        .expect("cargo makes this folder");
}
