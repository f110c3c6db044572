use crate::scenes::Class;
use bearslam::*;
pub fn explore(class: &Class, seeds: &[u64]) {
    for &seed in seeds {
        let instance = (class.build)(seed);
        let p = &instance.problem;
        let truth = refine(
            p,
            &instance.truth,
            &RefineOptions {
                max_iterations: 1000,
                ..Default::default()
            },
            None,
        )
        .unwrap();
        println!(
            "seed {seed}: truth {:.4} f {} unc {:.3}",
            truth.cost, truth.freedom, truth.uncertainty
        );
        let d = SolveOptions::default();
        let mut configs: Vec<(String, SolveOptions)> = vec![("default".into(), d)];
        for s in 1..4 {
            configs.push((
                format!("incr {s}"),
                SolveOptions {
                    strategy: Strategy::Incremental,
                    seed: s,
                    ..d
                },
            ));
        }
        let mut wide = d;
        wide.search = SearchOptions {
            triples: 120,
            grown: 40,
            candidates: 40,
            swept: 20,
        };
        wide.stages.sight.filled = 0.0;
        wide.stages.sight.many_views = 1000;
        configs.push(("wide".into(), wide));
        let mut plain = d;
        plain.stages.sight.filled = 0.0;
        plain.stages.sight.many_views = 1000;
        configs.push(("search".into(), plain));
        let mut i = SolveOptions {
            strategy: Strategy::Incremental,
            ..d
        };
        i.refine.loss = Loss::Cauchy(2.4);
        configs.push(("incr cauchy".into(), i));
        let mut i = SolveOptions {
            strategy: Strategy::Incremental,
            ..d
        };
        i.stages.incremental.views_per_added = 1000;
        configs.push(("incr one".into(), i));
        let mut i = SolveOptions {
            strategy: Strategy::Incremental,
            ..d
        };
        i.stages.incremental.gates = [3.0, 6.0, 12.0];
        configs.push(("incr narrow".into(), i));
        let mut i = SolveOptions {
            strategy: Strategy::Incremental,
            ..d
        };
        i.stages.incremental.max_deviation = 0.1;
        configs.push(("incr dev.1".into(), i));
        let mut i = SolveOptions {
            strategy: Strategy::Incremental,
            ..d
        };
        i.stages.incremental.seeds = 48;
        i.stages.incremental.max_finished = 12;
        i.stages.incremental.first_iterations = 30;
        configs.push(("incr seeds".into(), i));
        let mut i = SolveOptions {
            strategy: Strategy::Incremental,
            ..d
        };
        i.stages.incremental.views_before_choice = 4;
        i.stages.incremental.clear_ratio = 1e9;
        configs.push(("incr both".into(), i));
        configs.push(("robust".into(), SolveOptions { robust: true, ..d }));
        configs.push((
            "global".into(),
            SolveOptions {
                strategy: Strategy::Global,
                ..d
            },
        ));
        for (name, o) in configs {
            let t = std::time::Instant::now();
            match solve(p, &o, None) {
                Ok(f) => {
                    let g = if f.map.is_complete() { f.cost } else { f.cost };
                    let mut m = f.map.clone();
                    let again = refine_map(
                        p,
                        &mut m,
                        &RefineOptions {
                            max_iterations: 300,
                            ..Default::default()
                        },
                        None,
                    )
                    .map(|r| r.cost)
                    .unwrap_or(f64::NAN);
                    println!(
                        "   {name:12} cost {g:.4} again {again:.4} comps {} und {} {} {:.0} ms",
                        f.components.len(),
                        f.undetermined.len(),
                        f.termination,
                        t.elapsed().as_secs_f64() * 1e3
                    );
                }
                Err(e) => println!("   {name:12} {e} {:.0} ms", t.elapsed().as_secs_f64() * 1e3),
            }
        }
    }
}
