// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps in fixed storage give the same results as those on the heap.

use crate::common::{LAYOUTS, scene, truth};
use bearslam::{
    Bearing, Branch, Degeneracy, Error, FixedMap, Layout, Loss, Map, Pose, Problem, Real,
    RefineOptions, Scene, Termination, Workspace, pose, refine_map,
};
use nalgebra::Point2;

const SIGMA: f64 = 0.01;

/// The truth, shifted and turned by some centimetres and degrees.
fn guess(scene: &Scene, size: f64) -> Map {
    let mut map = truth(scene);
    let mut phase = 0.0_f64;
    let mut next = || {
        phase += 1.7;
        size * (phase * phase).sin()
    };
    for pose in map.poses.iter_mut().flatten() {
        let [x, y] = pose.translation.vector.into();
        *pose = bearslam::pose(x + next(), y + next(), pose.rotation.angle() + next());
    }
    for point in map.landmarks.iter_mut().flatten() {
        *point += nalgebra::Vector2::new(next(), next());
    }
    map
}

/// The bearings; with `gaps` about every ninth is missing.
fn bearings(scene: &Scene, gaps: bool) -> Vec<f64> {
    let all = scene.bearings.iter().enumerate();
    all.map(|(k, &b)| if gaps && k % 9 == 4 { f64::NAN } else { b })
        .collect()
}

/// The table as a map without poses and landmarks.
fn sightings<T: Real, const M: usize, const N: usize>(bearings: &[f64]) -> FixedMap<T, M, N> {
    let mut map = FixedMap::new();
    for (k, &bearing) in bearings.iter().enumerate() {
        if bearing.is_finite() {
            let bearing = Bearing::new(T::lit(bearing));
            map.see(k / N, k % N, bearing, T::lit(SIGMA)).unwrap();
        }
    }
    map
}

fn begin<T: Real, const M: usize, const N: usize>(map: &mut FixedMap<T, M, N>, start: &Map) {
    for (to, from) in map.poses.iter_mut().zip(&start.poses) {
        *to = from.map(|p| {
            pose(
                T::lit(p.translation.x),
                T::lit(p.translation.y),
                T::lit(p.rotation.angle()),
            )
        });
    }
    for (to, from) in map.landmarks.iter_mut().zip(&start.landmarks) {
        *to = from.map(|p| Point2::new(T::lit(p.x), T::lit(p.y)));
    }
}

fn on_the_heap<T: Real, const M: usize, const N: usize>(map: &FixedMap<T, M, N>) -> Map {
    let double = |p: &Pose<T>| {
        pose(
            p.translation.x.as_f64(),
            p.translation.y.as_f64(),
            p.rotation.angle().as_f64(),
        )
    };
    let poses = map.poses.iter().map(|p| p.as_ref().map(double));
    let landmarks = map.landmarks.iter();
    Map {
        poses: poses.collect(),
        landmarks: landmarks
            .map(|p| p.map(|p| Point2::new(p.x.as_f64(), p.y.as_f64())))
            .collect(),
    }
}

/// Largest difference between two maps in the gauge of this crate; for points far away relative to their
/// distance.
fn apart(a: &Map, b: &Map) -> f64 {
    let mut worst = 0.0_f64;
    for (a, b) in a.poses.iter().zip(&b.poses) {
        assert_eq!(a.is_some(), b.is_some());
        if let (Some(a), Some(b)) = (a, b) {
            worst = worst.max((a.translation.vector - b.translation.vector).norm());
            worst = worst.max(a.rotation.angle_to(&b.rotation).abs());
        }
    }
    for (a, b) in a.landmarks.iter().zip(&b.landmarks) {
        assert_eq!(a.is_some(), b.is_some());
        if let (Some(a), Some(b)) = (a, b) {
            worst = worst.max((a - b).norm() / a.coords.norm().max(1.0));
        }
    }
    worst
}

/// Whether a landmark of a map lies on a view or at infinity: such minima are on the boundary, which only
/// the heap version enters.
fn on_an_edge(map: &Map) -> bool {
    let views = || map.poses.iter().flatten().map(|p| p.translation.vector);
    map.landmarks.iter().flatten().any(|point| {
        point.coords.norm() > 1e4 || views().any(|view| (point.coords - view).norm() < 1e-6)
    })
}

#[derive(Debug, Default)]
struct Tally {
    all: usize,
    edge: usize,
    within: usize,
    worst: f64,
}

fn compare<const M: usize, const N: usize>(gaps: bool, tally: &mut Tally) {
    let mut workspace = Workspace::<f64, M, N>::new();
    for layout in LAYOUTS {
        for seed in 0..60 {
            let noise = [0.3, 1.0][usize::from(seed % 2 == 0)];
            let scene = scene(layout, M, N, noise, seed);
            let bearings = bearings(&scene, gaps);
            let problem = Problem::dense(M, N, &bearings, SIGMA).unwrap();
            let mut expected = guess(&scene, 0.05);
            let mut map = sightings::<f64, M, N>(&bearings);
            begin(&mut map, &expected);
            let options = RefineOptions {
                max_iterations: 300,
                tolerance: 1e-15,
                ..RefineOptions::default()
            };
            let on_heap = refine_map(&problem, &mut expected, &options, None).unwrap();
            assert_eq!(map.prune(), on_heap.undetermined.len());
            let found = map.refine(&mut workspace, &options).unwrap();
            map.normalize();
            let expected = expected.normalized();
            tally.all += 1;
            if on_an_edge(&expected) {
                tally.edge += 1;
                continue;
            }
            assert!(found.termination.was_successful(), "{found:?}");
            let difference = found.cost / on_heap.cost - 1.0;
            assert!(
                difference.abs() < 1e-10,
                "{M}x{N} {gaps} {layout:?} {seed}: {difference:e}"
            );
            assert!((map.cost() / found.cost - 1.0).abs() < 1e-9);
            let distance = apart(&expected, &on_the_heap(&map));
            tally.worst = tally.worst.max(distance);
            tally.within += usize::from(distance < 1e-8);
        }
    }
}

#[test]
fn the_minimum_is_that_of_the_heap() {
    let mut tally = Tally::default();
    compare::<3, 7>(false, &mut tally);
    for gaps in [false, true] {
        compare::<4, 9>(gaps, &mut tally);
        compare::<6, 20>(gaps, &mut tally);
        compare::<8, 11>(gaps, &mut tally);
    }
    assert!(50 * tally.edge < tally.all, "{tally:?}");
    // Near the minimum the cost determines only half the digits of a map, fewer along weak directions: the
    // results of the heap version from two starts are as far apart.
    assert!(
        100 * tally.within > 94 * (tally.all - tally.edge),
        "{tally:?}"
    );
    assert!(tally.worst < 1e-6, "{tally:?}");
}

#[test]
fn losses_are_those_of_the_heap() {
    let mut workspace = Workspace::<f64, 6, 20>::new();
    let losses = [
        Loss::Huber(Loss::<f64>::HUBER),
        Loss::Cauchy(Loss::<f64>::CAUCHY),
        Loss::Truncated(Loss::<f64>::TRUNCATED),
    ];
    for (seed, loss) in (0..30).flat_map(|seed| losses.map(|loss| (seed, loss))) {
        let scene = scene(LAYOUTS[0], 6, 20, 0.5, seed);
        let mut bearings = bearings(&scene, true);
        // Outliers.
        for k in [5, 47, 93] {
            bearings[k] += 0.3;
        }
        let problem = Problem::dense(6, 20, &bearings, SIGMA).unwrap();
        let options = RefineOptions {
            tolerance: 1e-15,
            loss,
            ..RefineOptions::default()
        };
        let mut expected = guess(&scene, 0.01);
        let mut map = sightings::<f64, 6, 20>(&bearings);
        begin(&mut map, &expected);
        let on_heap = refine_map(&problem, &mut expected, &options, None).unwrap();
        let found = map.refine(&mut workspace, &options).unwrap();
        let difference = found.cost / on_heap.cost - 1.0;
        assert!(difference.abs() < 1e-9, "{seed} {loss:?} {difference:e}");
        // `cost` has squared loss, so that outliers count in full.
        assert!(map.cost() > 2.0 * found.cost);
    }
}

#[test]
fn single_precision_is_far_below_the_noise() {
    let mut single = Workspace::<f32, 5, 12>::new();
    let mut double = Workspace::<f64, 5, 12>::new();
    for layout in LAYOUTS {
        for seed in 0..200 {
            let scene = scene(layout, 5, 12, 0.1, seed);
            let start = guess(&scene, 0.05);
            let mut a = sightings::<f32, 5, 12>(&scene.bearings);
            let mut b = sightings::<f64, 5, 12>(&scene.bearings);
            begin(&mut a, &start);
            begin(&mut b, &start);
            a.refine(&mut single, &RefineOptions::default()).unwrap();
            b.refine(&mut double, &RefineOptions::default()).unwrap();
            a.normalize();
            b.normalize();
            let (a, b) = (on_the_heap(&a), on_the_heap(&b));
            let noise = apart(&b, &truth(&scene).normalized());
            let share = apart(&a, &b) / noise;
            assert!(share < 0.05, "{layout:?} {seed} {share}");
        }
    }
}

/// The error and the cost of a complete map by growth.
fn grown<T: Real, const M: usize, const N: usize>(
    scene: &Scene,
    branch: Branch,
) -> Option<(f64, f64)> {
    let mut map = sightings::<T, M, N>(&bearings(scene, true));
    let found = map.start([0, 1, 2], branch).ok()?;
    assert!(found.motions[0].inconsistent <= found.motions[1].inconsistent);
    let motion = match branch {
        Branch::Best => &found.motions[0],
        Branch::Other => &found.motions[1],
    };
    assert!((0..3).all(|k| map.poses[k] == Some(motion.poses[k])));
    for view in 3..M {
        map.add_view(view).ok()?;
        for landmark in (0..N)
            .filter(|&k| map.landmarks[k].is_none())
            .collect::<Vec<_>>()
        {
            // Landmarks with too few views wait for the next view.
            let _ = map.add_landmark(landmark);
        }
        map.refine(&mut Workspace::default(), &RefineOptions::default())
            .ok()?;
    }
    map.normalize();
    Some((
        apart(&on_the_heap(&map), &truth(scene).normalized()),
        map.cost().as_f64(),
    ))
}

#[test]
fn a_map_grows_from_three_views() {
    let (mut single, mut double, mut told, mut all) = (0, 0, 0, 0);
    for layout in LAYOUTS {
        for seed in 0..40 {
            let scene = scene(layout, 6, 12, 0.0, seed);
            let Some((error, cost)) = grown::<f64, 6, 12>(&scene, Branch::Best) else {
                continue;
            };
            all += 1;
            double += usize::from(error < 1e-6);
            single += usize::from(
                grown::<f32, 6, 12>(&scene, Branch::Best).is_some_and(|(error, _)| error < 1e-2),
            );
            // One of the branches is the truth, and the further views decide which.
            let lower = match grown::<f64, 6, 12>(&scene, Branch::Other) {
                Some((distance, value)) if value < cost => distance,
                _ => error,
            };
            told += usize::from(lower < 1e-6);
        }
    }
    assert!(all >= 76, "{all}");
    assert!(
        double >= all - 2 && single >= all - 6 && told >= all - 2,
        "{single} {double} {told} {all}"
    );
}

/// Three views of six landmarks, refined.
fn small() -> (Scene, FixedMap<f64, 4, 6>) {
    let scene = scene(Layout::Enclosed, 4, 6, 0.1, 3);
    let mut map = sightings(&scene.bearings);
    begin(&mut map, &truth(&scene));
    (scene, map)
}

#[test]
fn figures_are_those_of_the_heap() {
    let (scene, map) = small();
    let problem = Problem::dense(4, 6, &scene.bearings, SIGMA).unwrap();
    let expected: Vec<f64> = truth(&scene).residuals(&problem).flatten().collect();
    let mut found = [f64::NAN; 24];
    for (view, landmark, residual) in map.residuals() {
        found[view * 6 + landmark] = residual;
    }
    for (a, b) in found.iter().zip(&expected) {
        assert!((a - b).abs() < 1e-15);
    }
    let sum: f64 = expected.iter().map(|r| r * r).sum();
    assert!((map.cost() - 0.5 * sum / (SIGMA * SIGMA)).abs() < 1e-12);
    assert!((map.rms() - (sum / 24.0).sqrt()).abs() < 1e-15);
    let mut normal = map.clone();
    normal.normalize();
    assert!(apart(&on_the_heap(&normal), &truth(&scene).normalized()) < 1e-14);
    assert_eq!(FixedMap::<f32, 2, 2>::new().rms(), 0.0);
    // A sighting is weighted by one over the square of its sigma.
    let mut weighted = map.clone();
    for landmark in 0..6 {
        let bearing = Bearing::new(scene.bearings[6 + landmark]);
        weighted.see(1, landmark, bearing, 2.0 * SIGMA).unwrap();
    }
    let of_view: f64 = expected[6..12].iter().map(|r| r * r).sum();
    let expected = 0.5 * (sum - 0.75 * of_view) / (SIGMA * SIGMA);
    assert!((weighted.cost() - expected).abs() < 1e-12);
}

#[test]
fn iterations_are_bounded() {
    let scene = scene(Layout::Mixed, 8, 11, 1.0, 3);
    let mut start = sightings::<f64, 8, 11>(&scene.bearings);
    begin(&mut start, &guess(&scene, 0.3));
    let mut workspace = Workspace::default();
    let mut before = start.cost() * (1.0 + 1e-12);
    for max_iterations in 0..4 {
        let mut map = start.clone();
        let options = RefineOptions {
            max_iterations,
            ..RefineOptions::default()
        };
        let report = map.refine(&mut workspace, &options).unwrap();
        assert_eq!(report.iterations, max_iterations);
        assert_eq!(report.termination, Termination::MaxIterations);
        assert!(report.cost <= before && (report.cost / map.cost() - 1.0).abs() < 1e-12);
        assert!(max_iterations > 0 || map == start);
        before = report.cost;
    }
    let mut exact = sightings::<f64, 8, 11>(&scene.bearings);
    let truth = truth(&scene);
    begin(&mut exact, &truth);
    for (k, point) in truth.landmarks.iter().enumerate() {
        for (view, pose) in truth.poses.iter().enumerate() {
            let bearing = bearslam::bearing_to(&pose.unwrap(), &point.unwrap()).unwrap();
            exact.see(view, k, bearing, SIGMA).unwrap();
        }
    }
    let report = exact
        .refine(&mut workspace, &RefineOptions::default())
        .unwrap();
    assert_eq!(
        (report.termination, report.iterations),
        (Termination::ZeroResidual, 0)
    );
    assert_eq!(exact.poses.to_vec(), truth.poses);
}

#[test]
fn what_the_rest_does_not_fix_is_dropped() {
    let (scene, map) = small();
    // Landmark 5 is left with one view, and when it is removed, view 3 with two landmarks.
    let mut bearings = scene.bearings.clone();
    for k in [5, 11, 17, 18, 19, 20] {
        bearings[k] = f64::NAN;
    }
    let mut cut = sightings::<f64, 4, 6>(&bearings);
    cut.poses = map.poses;
    cut.landmarks = map.landmarks;
    let mut pruned = cut.clone();
    assert_eq!((pruned.prune(), pruned.prune()), (2, 0));
    cut.refine(&mut Workspace::default(), &RefineOptions::default())
        .unwrap();
    assert_eq!(
        cut.poses.map(|pose| pose.is_some()),
        [true, true, true, false]
    );
    assert_eq!(cut.landmarks.iter().flatten().count(), 5);
    assert_eq!(cut.residuals().count(), 15);
}

#[test]
fn a_place_serves_again() {
    let (scene, mut map) = small();
    let full = map.clone();
    map.forget_view(3).unwrap();
    map.forget_landmark(2).unwrap();
    assert_eq!((map.poses[3], map.landmarks[2]), (None, None));
    assert_eq!(map.residuals().count(), 15);
    for k in 0..6 {
        map.see(3, k, Bearing::new(scene.bearings[18 + k]), SIGMA)
            .unwrap();
    }
    for view in 0..4 {
        map.see(view, 2, Bearing::new(scene.bearings[6 * view + 2]), SIGMA)
            .unwrap();
    }
    map.add_view(3).unwrap();
    map.add_landmark(2).unwrap();
    let mut workspace = Workspace::default();
    let (mut map, mut full) = (map, full);
    map.refine(&mut workspace, &RefineOptions::default())
        .unwrap();
    full.refine(&mut workspace, &RefineOptions::default())
        .unwrap();
    assert!((map.cost() / full.cost() - 1.0).abs() < 1e-9);
    assert_eq!(map.residuals().count(), 24);
}

#[test]
fn wrong_input_is_named_and_changes_nothing() {
    let (_, map) = small();
    let mut changed = map.clone();
    let bearing = Bearing::new(0.5);
    let nan = Bearing::new_unchecked(nalgebra::Complex::new(f64::NAN, 0.0));
    let beyond = |what, value, bound| Error::OutOfRange {
        what,
        index: 0,
        value,
        bound,
    };
    assert_eq!(changed.see(4, 0, bearing, 0.1), Err(beyond("view", 4, 4)));
    assert_eq!(
        changed.see(0, 6, bearing, 0.1),
        Err(beyond("landmark", 6, 6))
    );
    assert!(matches!(
        changed.see(0, 0, nan, 0.1),
        Err(Error::NotFinite {
            what: "bearing",
            ..
        })
    ));
    for sigma in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-200, 1e200] {
        let found = changed.see(0, 0, bearing, sigma);
        assert!(
            matches!(found, Err(Error::NotPositive { what: "sigma", .. })),
            "{sigma}"
        );
    }
    assert_eq!(changed.add_view(4).unwrap_err(), beyond("view", 4, 4));
    assert_eq!(
        changed.add_landmark(9).unwrap_err(),
        beyond("landmark", 9, 6)
    );
    assert_eq!(changed.forget_view(4).unwrap_err(), beyond("view", 4, 4));
    assert_eq!(
        changed.forget_landmark(6).unwrap_err(),
        beyond("landmark", 6, 6)
    );
    assert_eq!(
        changed.start([0, 7, 1], Branch::Best).unwrap_err(),
        beyond("view", 7, 4)
    );
    for views in [[0, 0, 1], [2, 1, 2], [3, 3, 3]] {
        let found = changed.start(views, Branch::Best);
        assert!(found.is_err(), "{views:?} {found:?}");
    }
    assert_eq!(changed, map);

    let mut empty = FixedMap::<f64, 4, 6>::new();
    let needed = |found| matches!(found, Error::TooFew { .. });
    assert!(needed(empty.start([0, 1, 2], Branch::Best).unwrap_err()));
    assert!(needed(empty.add_view(0).unwrap_err()));
    assert!(needed(empty.add_landmark(0).unwrap_err()));
    let (mut workspace, options) = (Workspace::default(), RefineOptions::default());
    assert!(needed(empty.refine(&mut workspace, &options).unwrap_err()));
    let mut refuse =
        |broken: &FixedMap<f64, 4, 6>| broken.clone().refine(&mut workspace, &options).unwrap_err();
    let mut broken = map.clone();
    broken.landmarks[2] = Some(Point2::new(f64::INFINITY, 0.0));
    assert!(matches!(
        refuse(&broken),
        Error::NotFinite {
            what: "positions of the start",
            index: 6
        }
    ));
    broken = map.clone();
    broken.poses[1].as_mut().unwrap().rotation = nan;
    assert!(matches!(
        refuse(&broken),
        Error::NotFinite {
            what: "residuals of the start",
            ..
        }
    ));
    broken = map.clone();
    broken.poses = [Some(pose(1.0, 2.0, 0.3)); 4];
    broken.landmarks = [Some(Point2::new(1.0, 2.0)); 6];
    assert!(matches!(
        refuse(&broken),
        Error::Degenerate {
            kind: Degeneracy::CoincidentStart,
            ..
        }
    ));
}

#[test]
fn nothing_trips_it() {
    let mut state = 1_u64;
    let mut next = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut workspace = Workspace::<f32, 4, 6>::new();
    let (mut refined, mut refused) = (0, 0);
    for round in 0..2000 {
        // Sizes from the smallest to the largest of single precision, coincident places, and gaps.
        let size = 10_f64.powf([0.0, 1.0, 76.0][round % 3] * (next() - 0.5));
        let mut at = || Point2::new(next(), next()).map(|x| f32::lit(size * (5.0 * x).round()));
        let places: Vec<_> = (0..10).map(|_| at()).collect();
        let mut map = FixedMap::<f32, 4, 6>::new();
        for k in 0..24 {
            if next() < 0.8 {
                let bearing = Bearing::new(f32::lit(6.3 * next()));
                map.see(k / 6, k % 6, bearing, [0.01, 1e-15, 1e15][k % 3])
                    .unwrap();
            }
        }
        let _ = map.start([0, 1, 2], Branch::Best);
        let _ = map.add_view(3);
        if round % 4 > 0 {
            map.poses =
                core::array::from_fn(|k| Some(pose(places[k].x, places[k].y, f32::lit(next()))));
            map.landmarks = core::array::from_fn(|k| Some(places[4 + k]));
        }
        let before = map.cost();
        match map.refine(&mut workspace, &RefineOptions::default()) {
            Ok(report) => {
                refined += 1;
                assert!(report.cost <= before * 1.001, "{round} {report:?} {before}");
                let positions = map
                    .poses
                    .iter()
                    .flatten()
                    .map(|pose| pose.translation.vector);
                let points = map.landmarks.iter().flatten().map(|point| point.coords);
                assert!(
                    positions.chain(points).all(|p| p.amax().is_finite()),
                    "{round} {map:?}"
                );
                map.normalize();
            }
            Err(_) => refused += 1,
        }
    }
    assert!(refined > 1000 && refused > 10, "{refined} {refused}");
}

#[test]
fn sizes_are_as_documented() {
    use core::mem::size_of;
    assert_eq!(size_of::<FixedMap<f32, 8, 12>>(), 1840);
    assert_eq!(size_of::<FixedMap<f32, 16, 24>>(), 6752);
    assert_eq!(size_of::<Workspace<f32, 8, 12>>(), 4672);
    assert_eq!(size_of::<Workspace<f32, 16, 24>>(), 17024);
    assert_eq!(size_of::<FixedMap<f64, 8, 12>>(), 2 * 1840);
    assert_eq!(size_of::<Workspace<f64, 8, 12>>(), 2 * 4672);
}
