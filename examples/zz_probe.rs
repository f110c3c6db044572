use bearslam::*;
fn main() {
    for (v, n, l, seed) in [
        (4, 7, Layout::Enclosed, 36),
        (5, 9, Layout::Enclosed, 149),
        (5, 9, Layout::Enclosed, 37),
    ] {
        let noise = 0.5_f64.to_radians();
        let s = simulate(l, v, n, noise, seed, Arena::default()).unwrap();
        let p = Problem::dense(v, n, &s.bearings, 1.0).unwrap();
        let f = solve(&p, &SolveOptions::default(), None).unwrap();
        println!(
            "cost {} rms {} unc {} sens {} und {:?} alt {}",
            f.cost,
            f.rms.to_degrees(),
            f.uncertainty,
            f.sensitivity,
            f.undetermined,
            f.alternatives.len()
        );
        for q in f.map.poses.iter().flatten() {
            println!("  {:.5} {:.5}", q.translation.x, q.translation.y);
        }
        for q in f.map.landmarks.iter().flatten() {
            println!("    {:.5} {:.5}", q.x, q.y);
        }
        let d = diagnose(&p, Some(&f.map), None).unwrap();
        println!("{d}\n {:?}", d.singular_values);
        let d = diagnose(&p, Some(&s.map()), None).unwrap();
        println!("truth: {d}\n {:?}", d.singular_values);
    }
}
