// SPDX-License-Identifier: MIT OR Apache-2.0
//! Many problems on all cores.

#[cfg(feature = "rayon")]
#[test]
fn batches_are_single_solves_in_order() {
    use crate::common::{LAYOUTS, problem, scene};
    use bearslam::{SolveOptions, solve, solve_batch};

    let problems: Vec<_> = (0..40)
        .map(|seed| {
            problem(&scene(
                LAYOUTS[0],
                3 + seed % 3,
                4 + seed % 4,
                0.5,
                seed as u64,
            ))
        })
        .collect();
    let options = SolveOptions::default();
    let together = solve_batch(&problems, &options);
    assert!(together.iter().any(Result::is_err) && together.iter().any(Result::is_ok));
    for (problem, found) in problems.iter().zip(together) {
        match (solve(problem, &options, None), found) {
            (Ok(alone), Ok(found)) => assert_eq!(alone.map, found.map),
            (alone, found) => assert_eq!(alone.err(), found.err()),
        }
    }
}
