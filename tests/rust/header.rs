// SPDX-License-Identifier: MIT OR Apache-2.0
//! The header of the C interface is the one that its source makes.

use std::path::Path;
use std::{env, fs};

/// With `BEARSLAM_WRITE_HEADER` set, as `make header` does, the header is written instead.
#[test]
fn header_is_up_to_date() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(root.join("cbindgen.toml")).unwrap();
    // It does not follow `mod`. What holds no part of the interface is left out.
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
        "include/bearslam.h is not what src/capi/ makes: run `make header`"
    );
}
