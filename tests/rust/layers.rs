// SPDX-License-Identifier: MIT OR Apache-2.0
//! Dependencies point one way, file by file: no cycles between files, and each layer uses only the layers
//! below it.
//!
//! The imports are read from the source text. A name that a module re-exports counts as the file that defines it,
//! so that an import through the parent module cannot hide a cycle.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The layers from the bottom up: a file belongs to the longest prefix that fits, and may use its own layer and
/// those before it.
const LAYERS: [&str; 52] = [
    "scalar",
    "float",
    "error",
    "geometry",
    "kernels",
    "lm",
    "fixed",
    "problem",
    "adjustment",
    "uncertainty",
    "simulate",
    "reconstruction/certificate",
    "reconstruction/result",
    "reconstruction/judge",
    "reconstruction/choice",
    "reconstruction/infinity",
    "reconstruction/collapsed",
    "reconstruction/sight",
    "reconstruction/search/options",
    "reconstruction/incremental/options",
    "reconstruction/global/options",
    "reconstruction/robust/options",
    "reconstruction/odometry/options",
    "reconstruction/verify/options",
    "reconstruction/stages",
    "reconstruction/options",
    "reconstruction/attempt",
    "reconstruction/far_views",
    "reconstruction/behind",
    "reconstruction/grow",
    "reconstruction/search",
    "reconstruction/incremental",
    "reconstruction/global",
    "reconstruction/strategy",
    "reconstruction/robust",
    "reconstruction/relabel",
    "reconstruction/persist",
    "reconstruction/odometry",
    "reconstruction/home",
    "reconstruction/alternatives",
    "reconstruction/verify",
    "reconstruction/solve",
    "fit",
    "diagnosis/options",
    "diagnosis/finding",
    "diagnosis/sentences",
    "diagnosis/shapes",
    "diagnosis/parts",
    "diagnosis/maps",
    "diagnosis",
    "batch",
    "sweep",
];

/// The root of the crate and the bindings, which use the crate by its public names like any user.
const ABOVE: [&str; 3] = ["lib", "python", "capi"];

/// A file's module path, such as `kernels/motion`, and what it imports, each as the path of a name.
type Imports = BTreeMap<String, BTreeSet<Vec<String>>>;

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

/// The source without comments and without the tests at its end.
fn code(text: &str) -> String {
    let text = text.split("#[cfg(test)]\nmod ").next().unwrap();
    let lines = text.lines().map(|line| line.split("//").next().unwrap());
    lines.collect::<Vec<_>>().join("\n")
}

/// The names behind a path with braces: `a::{b, c::{d, e}}` is `a::b`, `a::c::d`, `a::c::e`.
fn names(tree: &str, before: &[String], found: &mut Vec<Vec<String>>) {
    let tree = tree.trim();
    let (head, group) = match tree.find('{') {
        Some(open) => (
            &tree[..open],
            Some(&tree[open + 1..tree.rfind('}').unwrap()]),
        ),
        None => (tree, None),
    };
    let mut path = before.to_vec();
    let segments = head.split(" as ").next().unwrap().split("::");
    path.extend(
        segments
            .map(str::trim)
            .filter(|s| !s.is_empty() && *s != "self")
            .map(String::from),
    );
    let Some(group) = group else {
        found.push(path);
        return;
    };
    let (mut depth, mut start) = (0, 0);
    for (place, letter) in group.char_indices() {
        match letter {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                if !group[start..place].trim().is_empty() {
                    names(&group[start..place], &path, found);
                }
                start = place + 1;
            }
            _ => {}
        }
    }
    if !group[start..].trim().is_empty() {
        names(&group[start..], &path, found);
    }
}

/// A path from the root of the crate, `None` for one that leads out of it.
fn absolute(
    module: &str,
    path: Vec<String>,
    is_child: impl Fn(&str) -> bool,
) -> Option<Vec<String>> {
    let here: Vec<String> = module.split('/').map(String::from).collect();
    match path.first().map(String::as_str)? {
        "crate" => Some(path[1..].to_vec()),
        "super" => {
            let up = path
                .iter()
                .take_while(|segment| *segment == "super")
                .count();
            Some([&here[..here.len().checked_sub(up)?], &path[up..]].concat())
        }
        first if is_child(first) => Some([&here[..], &path[..]].concat()),
        _ => None,
    }
}

/// All paths in a file: those of its `use` statements, and those in its code that begin with `crate` or
/// `super`.
fn paths(code: &str) -> (Vec<Vec<String>>, Vec<Vec<String>>) {
    let (mut used, mut reexported) = (Vec::new(), Vec::new());
    let mut rest = String::new();
    for statement in code.split(';') {
        let line = statement.rfind("use ").filter(|&at| {
            let before = statement[..at].rsplit(['\n', '}']).next().unwrap().trim();
            before.is_empty()
                || before == "pub"
                || (before.starts_with("pub(") && before.ends_with(')'))
        });
        match line {
            Some(at) => {
                let mut found = Vec::new();
                names(&statement[at + 4..], &[], &mut found);
                let before = statement[..at].rsplit('\n').next().unwrap();
                if before.contains("pub") {
                    reexported.extend(found.clone());
                }
                used.extend(found);
                rest.push_str(&statement[..at]);
            }
            None => rest.push_str(statement),
        }
        rest.push(';');
    }
    for start in ["crate::", "super::"] {
        for (at, _) in rest.match_indices(start) {
            let before = rest[..at].chars().last();
            if before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':') {
                continue;
            }
            let letters = |c: &char| c.is_alphanumeric() || *c == '_' || *c == ':';
            let path: String = rest[at..].chars().take_while(letters).collect();
            used.push(
                path.split("::")
                    .filter(|s| !s.is_empty())
                    .map(String::from)
                    .collect(),
            );
        }
    }
    (used, reexported)
}

/// The graph of which file uses which.
fn graph() -> BTreeMap<String, BTreeSet<String>> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut all = Vec::new();
    files(&source, &mut all);
    let texts: BTreeMap<String, String> = all
        .iter()
        .map(|path| {
            let module = path.strip_prefix(&source).unwrap().with_extension("");
            let module = module.to_str().unwrap().replace('\\', "/");
            (module, code(&fs::read_to_string(path).unwrap()))
        })
        .filter(|(module, _)| {
            !ABOVE
                .iter()
                .any(|above| module.split('/').next() == Some(above))
        })
        .collect();
    let resolved = |module: &str, found: Vec<Vec<String>>| -> Vec<Vec<String>> {
        let is_child = |name: &str| texts.contains_key(&format!("{module}/{name}"));
        let found = found.into_iter();
        found
            .filter_map(|path| absolute(module, path, is_child))
            .collect()
    };
    let (mut uses, mut doors) = (Imports::new(), BTreeMap::new());
    for (module, text) in &texts {
        let (used, reexported) = paths(text);
        for path in resolved(module, reexported) {
            if let Some(name) = path.last() {
                doors.insert(format!("{module}/{name}"), path.join("/"));
            }
        }
        uses.insert(module.clone(), resolved(module, used).into_iter().collect());
    }
    // The file of a name: follow all re-exports, then take the longest path that is a file.
    let file = |path: &[String]| -> Option<String> {
        let mut path = path.to_vec();
        for _ in 0..4 {
            let door = (1..=path.len()).rev().find_map(|length| {
                let behind = doors.get(&path[..length].join("/"))?;
                Some((length, behind.clone()))
            });
            let Some((length, behind)) = door else { break };
            let mut next: Vec<String> = behind.split('/').map(String::from).collect();
            next.extend_from_slice(&path[length..]);
            path = next;
        }
        let found = (1..=path.len())
            .rev()
            .map(|length| path[..length].join("/"));
        found.into_iter().find(|module| texts.contains_key(module))
    };
    let mut graph = BTreeMap::new();
    for (module, used) in &uses {
        // A file that only re-exports its submodules uses nothing itself.
        let opens = texts
            .keys()
            .any(|other| other.starts_with(&format!("{module}/")));
        let mut found: BTreeSet<String> = used.iter().filter_map(|path| file(path)).collect();
        found.remove(module);
        if opens {
            found.retain(|other| !other.starts_with(&format!("{module}/")));
        }
        graph.insert(module.clone(), found);
    }
    graph
}

fn layer(module: &str) -> usize {
    let fits = |layer: &&str| module == *layer || module.starts_with(&format!("{layer}/"));
    let layers = LAYERS.iter().enumerate().filter(|(_, layer)| fits(layer));
    layers
        .max_by_key(|(_, layer)| layer.len())
        .unwrap_or_else(|| panic!("{module} is in no layer"))
        .0
}

#[test]
fn no_files_use_each_other_in_a_circle() {
    let mut graph = graph();
    // Repeatedly remove files that use none of the remaining ones: what is left is in cycles or uses them.
    loop {
        let done: Vec<String> = graph
            .iter()
            .filter(|(_, used)| used.iter().all(|other| !graph.contains_key(other)))
            .map(|(module, _)| module.clone())
            .collect();
        if done.is_empty() {
            break;
        }
        for module in done {
            graph.remove(&module);
        }
    }
    for used in graph.values_mut() {
        used.retain(|other| layer(other) < LAYERS.len());
    }
    assert!(
        graph.is_empty(),
        "files in a cycle, or that use one: {graph:#?}"
    );
}

#[test]
fn layers_use_only_what_is_below_them() {
    let graph = graph();
    let mut checked = 0;
    for (module, used) in &graph {
        // The parent module of several layers.
        if ["reconstruction"].contains(&module.as_str()) {
            continue;
        }
        for other in used {
            checked += 1;
            assert!(layer(other) <= layer(module), "{module} uses {other}");
        }
    }
    assert!(checked > 300, "{checked} imports were found");
}
