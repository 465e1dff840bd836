//! Tables.
use somersault_integrators::methods::Method;
use somersault_integrators::studies::{energy::*, silent};

#[test]
fn scan() {
    let bodies = prisms(100).unwrap();
    let t0 = std::time::Instant::now();
    for m in Method::ALL {
        let t = std::time::Instant::now();
        let s = energy(m, &EnergySetup::thesis(), &bodies, &mut silent).unwrap();
        println!("{:8} {:?} bound {:.12} failed {} {:?}", m.info().name, s.behaviour(), s.share_of_bound, s.failed, t.elapsed());
        for e in &s.extremes { print!("{:10.4e} ", e.max); } println!();
        for e in &s.extremes { print!("{:10.4} ", e.min); } println!();
        for e in &s.extremes { print!("{:5}/{:5}", e.gained,e.lost); } println!();
    }
    println!("{:?}", t0.elapsed());
}

#[test]
fn regions() {
    use somersault_integrators::studies::stability::*;
    for m in Method::ALL {
        let t = std::time::Instant::now();
        let s = stability_region(m, Default::default(), &mut silent).unwrap();
        println!("{:8} area {:.6} corr {:.6} im {:.10} re {:.10} n {} failed {} {:?}", m.info().name, s.area, s.corrected, s.imaginary_limit, s.real_limit, s.boundary.len(), s.failed, t.elapsed());
    }
}
#[test]
fn fails() {
    use somersault_integrators::studies::stability::*;
    for m in ["sv", "siabm4", "sv2","ab2","ab4"] {
        let m: Method = m.parse().unwrap();
        let mut k = 0;
        for i in 0..400 { for j in 0..200 {
            let l = Lambda { re: -2.5 + i as f64 * 0.0125, im: j as f64 * 0.0125 };
            if let Err(e) = spectral_radius(m, Default::default(), l) { k+=1; if k % 40 == 1 { println!("{m} {e}"); } }
        }}
        println!("{m} {k}");
    }
}
