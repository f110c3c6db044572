// SPDX-License-Identifier: MIT OR Apache-2.0
//! The header of the C interface is up to date with its source.

use std::path::Path;
use std::{env, fs};

/// If `BEARSLAM_WRITE_HEADER` is set, as by `make header`, the header is written first.
#[test]
fn header_is_up_to_date() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(root.join("cbindgen.toml")).unwrap();
    // Cbindgen does not follow `mod` here: list the files that are part of the interface.
    let bindings = ["status", "generic", "calls"]
        .iter()
        .map(|file| root.join(format!("src/capi/{file}.rs")))
        .fold(cbindgen::Builder::new(), cbindgen::Builder::with_src)
        .with_config(config)
        .generate()
        .unwrap();
    let mut made = Vec::new();
    bindings.write(&mut made);
    let made = String::from_utf8(made).unwrap();
    assert!(made.contains("bearslam_three_view("));
    let header = root.join("include/bearslam.h");
    if env::var_os("BEARSLAM_WRITE_HEADER").is_some() {
        fs::write(&header, &made).unwrap();
    }
    let kept = fs::read_to_string(&header).unwrap();
    assert!(
        kept == made,
        "include/bearslam.h is out of date with src/capi/: run `make header`"
    );
}
