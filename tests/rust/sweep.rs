// SPDX-License-Identifier: MIT OR Apache-2.0
//! Monte-Carlo sweeps, and the bound to which they compare errors.

use crate::common::{LAYOUTS, problem, scene};
use bearslam::{
    Cell, Chunk, Error, Layout, Quantity, RefineOptions, SearchOptions, SolveOptions, Start,
    SweepTrial, Tally, TrialOutcome, refine, simulate, solve, sweep,
};

fn cell(layout: Layout, views: usize, landmarks: usize, noise_deg: f64) -> Cell {
    Cell {
        layout,
        views,
        landmarks,
        noise: noise_deg.to_radians(),
    }
}

/// All tallies of a sweep over chunks of one cell, merged, without the time.
fn tallies(cell: Cell, trials: u64, length: u64, threads: usize) -> Vec<Tally> {
    let chunks: Vec<Chunk> = (0..trials.div_ceil(length))
        .map(|k| Chunk {
            cell,
            trials: k * length..trials.min((k + 1) * length),
        })
        .collect();
    let mut sums = vec![Tally::default(); Start::ALL.len()];
    let mut seen = vec![false; chunks.len()];
    sweep(&chunks, &Start::ALL, 5, threads, &mut |done| {
        if let Some((index, tallies)) = done {
            assert!(!std::mem::replace(&mut seen[index], true));
            for (sum, tally) in sums.iter_mut().zip(&tallies) {
                sum.merge(tally);
            }
        }
        true
    })
    .unwrap();
    assert!(seen.iter().all(|seen| *seen));
    for sum in &mut sums {
        sum.nanoseconds = 0;
    }
    sums
}

#[test]
fn the_same_seed_gives_the_same_bits_however_the_work_is_cut() {
    let cell = cell(Layout::Enclosed, 4, 7, 1.0);
    let whole = tallies(cell, 40, 40, 1);
    assert_eq!(whole[0].trials, 40);
    assert_eq!(tallies(cell, 40, 7, 2), whole);
    assert_eq!(tallies(cell, 40, 1, 4), whole);
}

#[test]
fn better_starts_fail_less() {
    for layout in LAYOUTS {
        let [random, projective, calibrated, solve] = tallies(cell(layout, 6, 7, 1.0), 100, 10, 0)
            .try_into()
            .unwrap();
        assert!(random.failures > 20, "{}", random.failures);
        assert!(projective.failures < random.failures);
        assert!(2 * calibrated.failures < projective.failures);
        assert_eq!(solve.failures, 0);
    }
}

#[test]
fn a_sweep_stops_when_told_to() {
    let chunks = vec![
        Chunk {
            cell: cell(Layout::Mixed, 8, 11, 1.0),
            trials: 0..1_000_000,
        };
        4
    ];
    let begin = std::time::Instant::now();
    let mut looks = 0;
    let result = sweep(&chunks, &[Start::Random], 0, 2, &mut |_| {
        looks += 1;
        looks < 2
    });
    assert_eq!(result, Err(Error::Interrupted));
    assert!(begin.elapsed().as_secs() < 5);
}

#[test]
fn a_trial_can_be_drawn_again() {
    let cell = cell(Layout::Mixed, 5, 9, 0.5);
    let trial = SweepTrial::run(&cell, &[Start::Solve], 7, 3, &mut |_, _, _| true).unwrap();
    let again = simulate(
        cell.layout,
        cell.views,
        cell.landmarks,
        cell.noise,
        cell.scene_seed(7, 3),
        bearslam::Arena::default(),
    )
    .unwrap();
    let problem = bearslam::Problem::dense(5, 9, &again.bearings, cell.noise).unwrap();
    let found = solve(&problem, &SolveOptions::default(), None).unwrap();
    assert_eq!(found.cost, trial.outcomes[0].cost);
    let seeds = [(7, 3), (7, 4), (8, 3)].map(|(seed, trial)| cell.scene_seed(seed, trial));
    assert!(seeds[0] != seeds[1] && seeds[0] != seeds[2]);
    let other = Cell { views: 6, ..cell };
    assert_ne!(other.scene_seed(7, 3), seeds[0]);
}

#[test]
fn a_start_without_a_map_has_failed() {
    // The projective tensor needs seven landmarks.
    let cell = cell(Layout::Mixed, 4, 6, 0.5);
    let trial = SweepTrial::run(&cell, &[Start::Projective], 0, 0, &mut |_, _, _| true).unwrap();
    let TrialOutcome { failed, errors, .. } = &trial.outcomes[0];
    assert!(*failed && errors.is_none());
    let mut tally = Tally::default();
    tally.add(&trial.outcomes[0], trial.bound.as_ref());
    assert_eq!((tally.failures, tally.without_map), (1, 1));
}

#[test]
fn small_noise_reaches_the_bound() {
    for (layout, views, landmarks) in [(Layout::Mixed, 8, 11), (Layout::Enclosed, 6, 9)] {
        let cell = cell(layout, views, landmarks, 0.01);
        let tally = tallies(cell, 400, 50, 0).pop().unwrap();
        for quantity in [Quantity::PositionOverBound, Quantity::HeadingOverBound] {
            let ratio = tally.histograms[quantity as usize].root_mean_square();
            assert!((ratio - 1.0).abs() < 0.06, "{quantity:?} {ratio}");
        }
    }
}

#[test]
fn the_bound_is_that_of_the_pseudo_inverse() {
    let (views, landmarks) = (5, 7);
    let scene = scene(Layout::Mixed, views, landmarks, 0.0, 4);
    let size = 3 * views + 2 * landmarks;
    let mut jacobian = nalgebra::DMatrix::zeros(views * landmarks, size);
    for (i, pose) in scene.poses.iter().enumerate() {
        for (j, point) in scene.landmarks.iter().enumerate() {
            let d = point.coords - pose.translation.vector;
            let g = nalgebra::Vector2::new(-d.y, d.x) / d.norm_squared();
            let row = i * landmarks + j;
            for k in 0..2 {
                jacobian[(row, 3 * i + k)] = -g[k];
                jacobian[(row, 3 * views + 2 * j + k)] = g[k];
            }
            jacobian[(row, 3 * i + 2)] = -1.0;
        }
    }
    // Four directions are free: compare the covariance orthogonal to them in the positions.
    let positions: Vec<usize> = (0..size).filter(|k| *k >= 3 * views || k % 3 < 2).collect();
    let svd = jacobian.svd(false, true);
    let v = svd.v_t.unwrap().transpose();
    let order = {
        let mut order: Vec<usize> = (0..size.min(views * landmarks)).collect();
        order.sort_by(|a, b| svd.singular_values[*b].total_cmp(&svd.singular_values[*a]));
        order
    };
    let mut covariance = nalgebra::DMatrix::zeros(size, size);
    for &k in &order[..size - 4] {
        let column = v.column(k);
        covariance += column * column.transpose() / svd.singular_values[k].powi(2);
    }
    let mut gauge = nalgebra::DMatrix::zeros(size, 4);
    for &k in &positions {
        let is_y = if k < 3 * views {
            k % 3 == 1
        } else {
            (k - 3 * views) % 2 == 1
        };
        let point = if k < 3 * views {
            scene.poses[k / 3].translation.vector
        } else {
            scene.landmarks[(k - 3 * views) / 2].coords
        };
        gauge[(k, usize::from(is_y))] = 1.0;
        gauge[(k, 2)] = if is_y { point.x } else { -point.y };
        gauge[(k, 3)] = if is_y { point.y } else { point.x };
    }
    let on_positions = gauge.clone();
    for view in 0..views {
        gauge[(3 * view + 2, 2)] = 1.0;
    }
    let fit = (on_positions.transpose() * &on_positions)
        .try_inverse()
        .unwrap();
    let project = nalgebra::DMatrix::identity(size, size) - gauge * fit * on_positions.transpose();
    let aligned = &project * covariance * project.transpose();
    let sum = |keep: &dyn Fn(usize) -> bool| -> f64 {
        (0..size)
            .filter(|k| keep(*k))
            .map(|k| aligned[(k, k)])
            .sum()
    };
    let is_heading = |k: usize| k < 3 * views && k % 3 == 2;
    let bound = scene.bound(0.01).unwrap();
    let heading = 0.01 * (sum(&is_heading) / views as f64).sqrt();
    let position = 0.01 * (sum(&|k| !is_heading(k)) / (views + landmarks) as f64).sqrt();
    assert!(
        (bound.heading_rms / heading - 1.0).abs() < 1e-9,
        "{bound:?} {heading}"
    );
    assert!(
        (bound.position_rms / position - 1.0).abs() < 1e-9,
        "{bound:?} {position}"
    );
}

#[test]
fn what_the_bearings_do_not_determine_has_no_bound() {
    assert_eq!(scene(Layout::Mixed, 2, 9, 0.0, 1).bound(0.01), None);
    assert_eq!(scene(Layout::Mixed, 5, 3, 0.0, 1).bound(0.01), None);
}

/// A wall leaves a direction free, and in any direction the coordinates of its landmarks round otherwise.
#[test]
fn a_wall_has_no_bound() {
    for turn in 0..30 {
        let by = nalgebra::UnitComplex::new(0.1 * f64::from(turn));
        let mut scene = scene(Layout::Mixed, 5, 8, 0.0, 3);
        for (k, point) in scene.landmarks.iter_mut().enumerate() {
            *point = by * nalgebra::Point2::new(0.9 * k as f64 - 2.0, 6.0);
        }
        for pose in &mut scene.poses {
            *pose = by * *pose;
        }
        assert_eq!(scene.bound(0.01), None, "{turn}");
    }
}

/// The bound is computed up to 1024 parameters.
#[test]
fn large_scenes_have_a_bound_and_larger_ones_do_not() {
    let bound = |landmarks| scene(Layout::Mixed, 40, landmarks, 0.0, 3).bound(0.01);
    assert!(bound(452).is_some_and(|bound| bound.position_rms > 0.0));
    assert_eq!(bound(453), None);
}

/// Scenes that need the wide search or alternative positions of landmarks.
#[test]
fn doubt_widens_the_search() {
    let narrow = SolveOptions {
        search: SearchOptions {
            swept: 0,
            ..SearchOptions::default()
        },
        ..SolveOptions::default()
    };
    let mut helped = 0;
    for seed in 0..150 {
        let scene = scene(Layout::Enclosed, 4, 7, 1.0, seed);
        let problem = problem(&scene);
        let oracle = refine(&problem, &scene.map(), &RefineOptions::default(), None).unwrap();
        let wide = solve(&problem, &SolveOptions::default(), None).unwrap();
        assert!(wide.cost <= oracle.cost * (1.0 + 1e-5), "{seed}");
        let narrow = solve(&problem, &narrow, None).unwrap();
        helped += usize::from(wide.cost < narrow.cost * (1.0 - 1e-5));
    }
    assert!(helped > 0);
}

#[test]
fn a_landmark_in_the_wrong_place_is_moved() {
    let scene = simulate(
        Layout::Mixed,
        4,
        11,
        1.0_f64.to_radians(),
        16_863_023_029_418_477_098,
        bearslam::Arena::default(),
    )
    .unwrap();
    let problem = problem(&scene);
    let found = solve(&problem, &SolveOptions::default(), None).unwrap();
    let oracle = refine(&problem, &scene.map(), &RefineOptions::default(), None).unwrap();
    assert!(
        found.cost <= oracle.cost * (1.0 + 1e-5),
        "{} {}",
        found.cost,
        oracle.cost
    );
}
