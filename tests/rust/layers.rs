// SPDX-License-Identifier: MIT OR Apache-2.0
//! Dependencies point one way: a module names only those in the layers below it.

use std::fs;
use std::path::{Path, PathBuf};

/// From the bottom up.
const LAYERS: [&[&str]; 11] = [
    &["scalar", "error"],
    &["geometry"],
    &["kernels"],
    &["lm"],
    &["fixed"],
    &["estimation"],
    &["reconstruction", "simulate"],
    &["diagnosis"],
    &["batch"],
    &["sweep"],
    &["python", "capi"],
];

fn layer(module: &str) -> usize {
    LAYERS
        .iter()
        .position(|modules| modules.contains(&module))
        .unwrap_or_else(|| panic!("module {module} has no layer"))
}

fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, found);
        } else {
            found.push(path);
        }
    }
}

#[test]
fn modules_use_only_what_is_below_them() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut all = Vec::new();
    files(&source, &mut all);
    let mut checked = 0;
    for path in all {
        let relative = path.strip_prefix(&source).unwrap();
        let first = relative.components().next().unwrap().as_os_str();
        let module = first.to_str().unwrap().trim_end_matches(".rs");
        // The bindings use the crate as everybody else does, by its top-level names.
        if module == "lib" || module == "python" {
            continue;
        }
        let text = fs::read_to_string(&path).unwrap();
        for part in text.split("crate::").skip(1) {
            let used: String = part
                .chars()
                .take_while(|c| c.is_ascii_lowercase() || *c == '_')
                .collect();
            if LAYERS
                .iter()
                .any(|modules| modules.contains(&used.as_str()))
            {
                checked += 1;
                let fits = used == module || layer(&used) < layer(module);
                assert!(fits, "{} uses {used}", relative.display());
            }
        }
    }
    assert!(checked > 20);
}
