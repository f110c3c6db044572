use bearslam::*;
use std::time::Instant;
fn main() {
    let opts = SolveOptions::<f64>::default();
    let args: Vec<String> = std::env::args().collect();
    let mode = args.get(1).map(|s| s.as_str()).unwrap_or("all");
    if mode == "free" || mode == "all" {
        for (m, n) in [
            (3, 5),
            (3, 8),
            (4, 4),
            (5, 4),
            (8, 4),
            (4, 5),
            (4, 7),
            (6, 6),
            (8, 10),
            (12, 15),
        ] {
            for layout in [Layout::Mixed, Layout::Enclosed] {
                let trials = 200;
                let (mut ok, mut alt, mut deg, mut bad) = (0, 0, 0, 0);
                let mut worst = 0.0_f64;
                for seed in 0..trials {
                    let scene = simulate(layout, m, n, 0.0, seed, Arena::default()).unwrap();
                    let problem = Problem::dense(m, n, &scene.bearings, 1.0).unwrap();
                    match solve(&problem, &opts, None) {
                        Ok(r) => {
                            let e = error(&r.map, &scene);
                            if e < 1e-7 {
                                ok += 1;
                                worst = worst.max(e);
                            } else if r.alternatives.iter().any(|a| error(&a.map, &scene) < 1e-7) {
                                alt += 1;
                            } else {
                                bad += 1;
                                if bad <= 3 {
                                    eprintln!(
                                        "bad {m} {n} {layout:?} seed {seed} cost {:e} err {e:e} alts {} {:?} unc {:?}",
                                        r.cost,
                                        r.alternatives.len(),
                                        r.termination,
                                        r.uncertainty
                                    );
                                }
                            }
                        }
                        Err(e) => {
                            deg += 1;
                            if deg <= 2 {
                                eprintln!("{m} {n} {seed} {e}");
                            }
                        }
                    }
                }
                println!(
                    "{m:2} {n:2} {layout:?} ok {ok} alt {alt} degenerate {deg} bad {bad} worst {worst:.1e}"
                );
            }
        }
    }
    if mode == "noise" || mode == "all" {
        for deg in [1.0_f64] {
            for (m, n) in [(4, 7), (8, 11), (12, 15), (12, 7), (4, 5), (4, 6), (6, 5)] {
                for layout in [Layout::Mixed, Layout::Enclosed] {
                    let trials = 300;
                    let mut fail = 0;
                    let mut err = 0;
                    let mut t = 0.0;
                    let mut tr = 0.0;
                    let mut its = 0;
                    let mut uncs = vec![];
                    let mut lower = 0;
                    let mut times = vec![];
                    for seed in 0..trials {
                        let scene = simulate(
                            layout,
                            m,
                            n,
                            deg.to_radians(),
                            seed + 10000,
                            Arena::default(),
                        )
                        .unwrap();
                        let problem = Problem::dense(m, n, &scene.bearings, 1.0).unwrap();
                        let truth = Map {
                            poses: scene.poses.iter().map(|p| Some(*p)).collect(),
                            landmarks: scene.landmarks.iter().map(|p| Some(*p)).collect(),
                        };
                        let t0 = Instant::now();
                        let oracle = refine(&problem, &truth, &opts.refine, None).unwrap();
                        tr += t0.elapsed().as_secs_f64();
                        its += oracle.iterations;
                        let t0 = Instant::now();
                        let r = solve(&problem, &opts, None);
                        let el = t0.elapsed().as_secs_f64();
                        t += el;
                        times.push(el);
                        match r {
                            Ok(r) => {
                                if r.cost > oracle.cost * (1.0 + 1e-5) + 1e-12 {
                                    fail += 1;
                                }
                                if r.cost < oracle.cost * (1.0 - 1e-5) {
                                    lower += 1;
                                }
                                uncs.push(r.uncertainty);
                            }
                            Err(e) => {
                                err += 1;
                                if err < 3 {
                                    eprintln!("{e}");
                                }
                            }
                        }
                    }
                    uncs.sort_by(|a, b| a.total_cmp(b));
                    times.sort_by(|a, b| a.total_cmp(b));
                    println!(
                        "{m:2} {n:2} {layout:?} {deg} fail {fail} err {err} lower {lower} of {trials}; solve {:.0} us (median {:.0}) refine {:.1} us its {:.1} unc med {:.2e} 90% {:.2e} max {:.2e}",
                        t / trials as f64 * 1e6,
                        times[times.len() / 2] * 1e6,
                        tr / trials as f64 * 1e6,
                        its as f64 / trials as f64,
                        uncs[uncs.len() / 2],
                        uncs[uncs.len() * 9 / 10],
                        uncs[uncs.len() - 1]
                    );
                }
            }
        }
    }
}
fn error(map: &Map<f64>, scene: &Scene) -> f64 {
    if !map.is_complete() {
        return f64::INFINITY;
    }
    let s: Vec<_> = map
        .poses
        .iter()
        .map(|p| p.unwrap().translation.vector.into())
        .chain(map.landmarks.iter().map(|p| p.unwrap()))
        .collect();
    let t: Vec<_> = scene
        .poses
        .iter()
        .map(|p| p.translation.vector.into())
        .chain(scene.landmarks.iter().copied())
        .collect();
    let a = align(&s, &t).unwrap();
    s.iter()
        .zip(&t)
        .map(|(s, t)| (a.transform_point(s) - t).norm())
        .fold(0.0, f64::max)
        / 7.0
}
