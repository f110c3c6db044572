#[path = "../tests/rust/shapes.rs"]
mod shapes;
use bearslam::*;
use shapes::*;
fn show(p: &Problem<f64>, map: &Map<f64>) {
    for q in map.poses.iter().flatten() {
        println!("  {:.5} {:.5}", q.translation.x, q.translation.y);
    }
    for q in map.landmarks.iter().flatten() {
        println!("    {:.5} {:.5}", q.x, q.y);
    }
    let d = diagnose(p, Some(map), None).unwrap();
    println!("{d}\n {:?}", d.singular_values);
}
fn main() {
    for (seed, noise) in [
        (1, 0.0),
        (1, 0.01_f64.to_radians()),
        (5, 0.01_f64.to_radians()),
    ] {
        let s = Drawn::new(Draw::OtherLine, Draw::Line, (5, 8), noise, seed);
        let p = s.problem(1.0);
        println!("seed {seed} truth");
        show(&p, &s.truth());
        println!("{}", diagnose(&p, None, None).unwrap());
        match solve(&p, &SolveOptions::default(), None) {
            Ok(f) => {
                println!(
                    "cost {:e} rms {:e} und {:?} alt {} {:?}",
                    f.cost,
                    f.rms.to_degrees(),
                    f.undetermined,
                    f.alternatives.len(),
                    f.termination
                );
                show(&p, &f.map);
                for a in &f.alternatives {
                    println!("ALT");
                    show(&p, &a.map)
                }
            }
            Err(e) => println!("{e}"),
        }
        let f = refine(&p, &s.truth(), &RefineOptions::default(), None).unwrap();
        println!("from truth: cost {:e} {:?}", f.cost, f.undetermined);
        show(&p, &f.map);
    }
}
