//! Tables.
use somersault_integrators::methods::Method;
use somersault_integrators::studies::{order::*, problem::*, silent, work_precision::*};

#[test]
fn orders() {
    let dts: Vec<f64> = (0..7).map(|k| 0.01 * 0.5f64.powi(k)).collect();
    let (p1, p3, pa) =
        (Case::One.problem().unwrap(), Case::Three.problem().unwrap(), asymmetric_body().unwrap());
    let (f, fv) = (spring_pendulum().unwrap(), damped_spring_pendulum().unwrap());
    let o = Default::default();
    let s = |x: Option<f64>| x.map_or("  - ".into(), |x| format!("{x:.2}"));
    for m in Method::ALL {
        let t = std::time::Instant::now();
        let a = convergence(&p1, m, o, &dts, &mut silent).unwrap();
        let b = convergence(&p3, m, o, &dts, &mut silent).unwrap();
        let c = convergence(&pa, m, o, &dts, &mut silent).unwrap();
        let d = convergence(&f, m, o, &dts, &mut silent).unwrap();
        let e = convergence(&fv, m, o, &dts, &mut silent).unwrap();
        println!(
            "{:8} c1 {} {}  c3 {} {}  as {} {}  f(r) {} {}  f(r,v) {} {} {:?} {:?}",
            m.info().name,
            s(a.orders.orientation),
            s(a.orders.angular_velocity),
            s(b.orders.orientation),
            s(b.orders.angular_velocity),
            s(c.orders.orientation),
            s(c.orders.angular_velocity),
            s(d.orders.position),
            s(d.orders.velocity),
            s(e.orders.position),
            s(e.orders.velocity),
            t.elapsed(),
            m.info().orders
        );
        if m.info().name.starts_with("rk") {
            println!("{:?}", a.measured.iter().map(|m| (m.dt, m.errors.orientation)).collect::<Vec<_>>());
            println!("{:?}", c.measured.iter().map(|m| (m.dt, m.errors.orientation)).collect::<Vec<_>>());
            println!("{:?}", d.measured.iter().map(|m| (m.dt, m.errors.position)).collect::<Vec<_>>());
        }
    }
}
#[test]
fn work() {
    let p2 = Case::Two.problem().unwrap();
    for m in Method::ALL {
        let w = work_precision(
            &p2,
            m,
            Default::default(),
            &[StepChoice::Fixed(1e-2), StepChoice::Fixed(1e-3)],
            2,
            &mut silent,
        )
        .unwrap();
        println!("{:8}", m.info().name);
        for p in w {
            println!(
                "    {:e} {:e} steps {} ev {} {:e} ns/step",
                p.errors.orientation,
                p.errors.angular_velocity,
                p.steps,
                p.evaluations,
                p.seconds / p.steps as f64 * 1e9
            );
        }
    }
}
