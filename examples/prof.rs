use bearslam::*;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let opts = SolveOptions::<f64>::default();
    let (m, n) = (12, 15);
    let scene = simulate(Layout::Mixed, m, n, 1f64.to_radians(), 5, Arena::default()).unwrap();
    let problem = Problem::dense(m, n, &scene.bearings, 1.0).unwrap();
    if args[1] == "solve" {
        let r = solve(&problem, &opts, None).unwrap();
        println!("{}", r.cost);
    } else if args[1] == "refine" {
        let truth = Map {
            poses: scene.poses.iter().map(|p| Some(*p)).collect(),
            landmarks: scene.landmarks.iter().map(|p| Some(*p)).collect(),
        };
        let r = refine(&problem, &truth, &opts.refine, None).unwrap();
        println!("{} {}", r.cost, r.iterations);
    } else {
        let k: usize = args[2].parse().unwrap();
        let triples: Vec<[Bearing<f64>; 3]> = (0..k)
            .map(|j| [0, 1, 2].map(|i| Bearing::new(scene.bearings[i * n + j])))
            .collect();
        let s = three_view(
            &triples,
            Method::Calibrated {
                reweights: if k == 5 { 0 } else { 1 },
            },
        )
        .unwrap();
        println!("{:?}", s.motions[0].cost);
    }
}
