// SPDX-License-Identifier: MIT OR Apache-2.0
//! Instructions and stack of every kernel without std: `cargo bench --bench instructions`.
//!
//! Builds `tests/probe`, runs it under callgrind, and prints the mean and worst number of instructions over
//! 16 scenes and the deepest stack, beside the recorded figures. Fails if a mean or a stack has grown by more
//! than a tenth. `cargo bench --bench instructions -- --record` writes the record.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::{env, fs, io};

/// What a kernel costs.
#[derive(Clone, Copy)]
struct Cost {
    mean: u64,
    worst: u64,
    stack: u64,
}

/// Scalar and name of a kernel.
type Kernel = (String, String);

fn main() -> ExitCode {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let record = root.join("benches/instructions.txt");
    if Command::new("valgrind").arg("--version").output().is_err() {
        println!("SKIPPED: valgrind is not installed");
        return ExitCode::SUCCESS;
    }
    let probe = build(root);
    let kernels = lines(&run(Command::new(&probe).arg("list")));
    let stacks = lines(&run(Command::new(&probe).arg("stack")));
    let counts = count(&probe, &root.join("target/probe/callgrind"));
    let mut counts = counts.iter();
    let mut costs = Vec::new();
    for ((kernel, scenes), (_, stack)) in kernels.into_iter().zip(stacks) {
        let counts: Vec<u64> = (0..scenes).map_while(|_| counts.next().copied()).collect();
        assert_eq!(counts.len() as u64, scenes, "one count for each scene");
        let cost = Cost {
            mean: counts.iter().sum::<u64>() / scenes,
            worst: counts.iter().copied().max().unwrap_or(0),
            stack,
        };
        costs.push((kernel, cost));
    }
    assert!(counts.next().is_none(), "more counts than scenes");

    if env::args().any(|argument| argument == "--record") {
        let text: String = costs
            .iter()
            .map(|((scalar, name), cost)| {
                let Cost { mean, worst, stack } = cost;
                format!("{scalar}\t{name}\t{mean}\t{worst}\t{stack}\n")
            })
            .collect();
        let beside = record.with_extension("new");
        fs::write(&beside, text).expect("a record that can be written");
        fs::rename(beside, record).expect("a record that can be written");
        table(&costs, &BTreeMap::new());
        return ExitCode::SUCCESS;
    }
    let known = match fs::read_to_string(&record) {
        Ok(text) => read(&text),
        Err(error) if error.kind() == io::ErrorKind::NotFound => BTreeMap::new(),
        Err(error) => panic!("{}: {error}", record.display()),
    };
    if table(&costs, &known) {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}

/// Builds the probe as `make probe` does.
fn build(root: &Path) -> PathBuf {
    let target = root.join("target/probe");
    let cargo = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    run(Command::new(cargo)
        .args(["build", "--release", "--quiet", "--manifest-path"])
        .arg(root.join("tests/probe/Cargo.toml"))
        .arg("--target-dir")
        .arg(&target));
    target.join("release/probe")
}

/// Instructions of each call, in the order in which the probe makes them.
fn count(probe: &Path, folder: &Path) -> Vec<u64> {
    if folder.exists() {
        fs::remove_dir_all(folder).expect("a folder that can be cleared");
    }
    fs::create_dir_all(folder).expect("a folder for callgrind");
    run(Command::new("valgrind")
        .args(["--tool=callgrind", "--quiet"])
        .arg("--toggle-collect=bearslam_measured")
        .arg("--dump-after=bearslam_measured")
        .arg(format!(
            "--callgrind-out-file={}",
            folder.join("out").display()
        ))
        .arg(probe)
        .arg("run"));
    (1..)
        .map_while(|part| fs::read_to_string(folder.join(format!("out.{part}"))).ok())
        .map(|text| {
            let total = text.lines().find_map(|line| line.strip_prefix("totals: "));
            let total = total.expect("a total in each dump of callgrind");
            total.parse().expect("a number of instructions")
        })
        .collect()
}

/// Runs a program and returns its output.
fn run(command: &mut Command) -> String {
    let output = command
        .output()
        .unwrap_or_else(|error| panic!("{command:?}: {error}"));
    assert!(
        output.status.success(),
        "{command:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).expect("text")
}

/// Kernels with a number each, as the probe prints them.
fn lines(text: &str) -> Vec<(Kernel, u64)> {
    let line = |line: &str| {
        let mut fields = line.split('\t').map(str::to_owned);
        let kernel = (fields.next()?, fields.next()?);
        Some((kernel, fields.next()?.parse().ok()?))
    };
    text.lines()
        .map(|text| line(text).unwrap_or_else(|| panic!("scalar, name, number: {text}")))
        .collect()
}

fn read(text: &str) -> BTreeMap<Kernel, Cost> {
    let line = |line: &str| {
        let mut fields = line.split('\t');
        let kernel = (fields.next()?.to_owned(), fields.next()?.to_owned());
        let mut number = || fields.next()?.parse().ok();
        Some((
            kernel,
            Cost {
                mean: number()?,
                worst: number()?,
                stack: number()?,
            },
        ))
    };
    text.lines()
        .map(|text| line(text).unwrap_or_else(|| panic!("scalar, name, three numbers: {text}")))
        .collect()
}

/// Prints a row for each kernel; returns whether none exceeds the record by more than a tenth.
fn table(costs: &[(Kernel, Cost)], known: &BTreeMap<Kernel, Cost>) -> bool {
    println!("| kernel | scalar | instructions, mean | worst | stack \\[bytes\\] | on record |");
    println!("|---|---|---|---|---|---|");
    let mut worse = Vec::new();
    for (kernel, cost) in costs {
        let (scalar, name) = kernel;
        let mut beside = String::from("–");
        if let Some(before) = known.get(kernel) {
            beside = format!("{} / {}", before.mean, before.stack);
            let grown = |now: u64, before: u64| 10 * now > 11 * before;
            if grown(cost.mean, before.mean) || grown(cost.stack, before.stack) {
                worse.push(format!(
                    "{name}, {scalar}: {} instructions and {} bytes of stack, on record {} and {}",
                    cost.mean, cost.stack, before.mean, before.stack
                ));
            }
        }
        let Cost { mean, worst, stack } = cost;
        println!("| {name} | `{scalar}` | {mean} | {worst} | {stack} | {beside} |");
    }
    for line in &worse {
        println!("WORSE by more than a tenth: {line}");
    }
    worse.is_empty()
}
