//! The dives of thesis chapter 3: gradients, counting, conservation, requirements, bad input.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use num_dual::Dual64;
use somersault_core::argument::ArgumentError;
use somersault_core::spline::{SplineError, UniformBasis};
use somersault_dives::flight::{NodeDerivatives, OrientationPath, PathGradient};
use somersault_dives::{
    ALLOWED, Body, Capsule, Channels, Clearance, Dive, DiveError, DiveProgram, DiveSearch, DiveSearchError,
    KeyFrame, LiteralDive, Penalties, Range, nearest_points,
};
use somersault_multibody::counting::Counting;
use somersault_multibody::flight::{Flight, FlightData, TakeOff};
use somersault_multibody::joint_motion::{EigenpostureBase, JointMotionError, SplineMotion};
use somersault_multibody::models::{Diver, Posture};
use somersault_multibody::{Data, DynamicsError, Model};
use somersault_nlp::{Flow, Iteration, Nlp, Report, Sqp, Status};
use std::f64::consts::{PI, TAU};

/// The path of the spatial diver by three weights, and its coefficients.
fn spatial_path(n_steps: usize) -> (OrientationPath, Vec<f64>) {
    let postures = [Posture::C, Posture::E, Posture::I, Posture::H].map(Posture::spatial);
    let base = EigenpostureBase::try_new(&postures).unwrap();
    let basis = UniformBasis::try_new(5, 8).unwrap();
    let motion = SplineMotion::try_new(basis, base, &[]).unwrap();
    let coefficients = (0..motion.n_coefficients()).map(|k| 0.15 + 0.1 * (k as f64 * 1.7).sin()).collect();
    (OrientationPath::try_new(Diver::spatial().model().unwrap(), motion, n_steps).unwrap(), coefficients)
}

const ORIENTATION: [f64; 4] = [0.1, 0.2, -0.1, 0.969_535_971_483_266];
const MOMENTUM: Vector3<f64> = Vector3::new(5.0, 90.0, -8.0);

fn end_of(path: &mut OrientationPath, c: &[f64], q: &[f64], momentum: Vector3<f64>) -> UnitQuaternion<f64> {
    path.integrate(c, q, momentum, false).unwrap();
    path.orientations()[path.n_steps()]
}

fn displaced(q: &[f64], by: Vector3<f64>) -> Vec<f64> {
    let start = UnitQuaternion::new_normalize(Quaternion::new(q[3], q[0], q[1], q[2]));
    (start * UnitQuaternion::from_scaled_axis(by)).coords.as_slice().to_vec()
}

#[test]
fn derivatives_of_the_orientation_are_differences() {
    let (mut path, coefficients) = spatial_path(12);
    path.integrate(&coefficients, &ORIENTATION, MOMENTUM, true).unwrap();
    let n = path.n_steps();
    let end = path.orientations()[n];
    let mut found = NodeDerivatives::new(coefficients.len());
    path.node_derivatives(n, &mut found).unwrap();
    let h = 1e-5;
    let difference = |plus: UnitQuaternion<f64>, minus: UnitQuaternion<f64>| {
        ((end.inverse() * plus).scaled_axis() - (end.inverse() * minus).scaled_axis()) / (2.0 * h)
    };
    for k in 0..coefficients.len() {
        let mut at = |sign: f64| {
            let mut moved = coefficients.clone();
            moved[k] += sign * h;
            end_of(&mut path, &moved, &ORIENTATION, MOMENTUM)
        };
        let expected = difference(at(1.0), at(-1.0));
        assert!(
            (found.by_coefficients[k] - expected).norm() < 1e-7 * (1.0 + expected.norm()),
            "coefficient {k}"
        );
    }
    for axis in 0..3 {
        let unit = Vector3::ith(axis, 1.0);
        let mut at = |sign: f64| end_of(&mut path, &coefficients, &ORIENTATION, MOMENTUM + unit * (sign * h));
        let expected = difference(at(1.0), at(-1.0));
        let off = (found.by_momentum * unit - expected).norm();
        assert!(off < 1e-7 * (1.0 + expected.norm()), "momentum {axis}: {off:e} of {expected}");
        let mut at = |sign: f64| {
            end_of(&mut path, &coefficients, &displaced(&ORIENTATION, unit * (sign * h)), MOMENTUM)
        };
        let expected = difference(at(1.0), at(-1.0));
        let off = (found.by_start * unit - expected).norm();
        assert!(off < 1e-7 * (1.0 + expected.norm()), "start {axis}: {off:e} of {expected}");
    }
}

#[test]
fn the_adjoint_is_the_transpose_of_the_derivatives() {
    let (mut path, coefficients) = spatial_path(12);
    path.integrate(&coefficients, &ORIENTATION, MOMENTUM, true).unwrap();
    let n = path.n_steps();
    let by_nodes: Vec<_> = (0..=n).map(|k| Vector3::new(k as f64, 1.0, (k as f64).sin())).collect();
    let mut pulled = PathGradient {
        by_start: Vector3::zeros(),
        by_momentum: Vector3::zeros(),
        by_coefficients: vec![0.0; coefficients.len()],
    };
    path.pull_back(&by_nodes, &mut pulled).unwrap();
    let (mut start, mut momentum) = (Vector3::zeros(), Vector3::zeros());
    let mut by_coefficients = vec![0.0; coefficients.len()];
    let mut at = NodeDerivatives::new(coefficients.len());
    for (node, weight) in by_nodes.iter().enumerate() {
        path.node_derivatives(node, &mut at).unwrap();
        start += at.by_start.tr_mul(weight);
        momentum += at.by_momentum.tr_mul(weight);
        by_coefficients.iter_mut().zip(&at.by_coefficients).for_each(|(sum, by)| *sum += by.dot(weight));
    }
    let scale = 1e-12 * by_coefficients.iter().fold(1.0f64, |m, x| m.max(x.abs()));
    assert!((pulled.by_start - start).norm() < scale && (pulled.by_momentum - momentum).norm() < scale);
    assert!(pulled.by_coefficients.iter().zip(&by_coefficients).all(|(a, b)| (a - b).abs() < scale));
}

/// Two Simpson steps for each interval of the planar diver, in dual numbers through the flight itself.
fn planar_angle(model: &Model<Dual64>, c: &[Dual64], momentum: Dual64, n_steps: usize) -> Dual64 {
    let postures = [Posture::A, Posture::H].map(|p| p.planar().unwrap());
    let basis = UniformBasis::try_new(5, c.len()).unwrap();
    let zero = Dual64::from(0.0);
    let take_off = TakeOff {
        time: zero,
        center_of_mass: nalgebra::Vector3::from_element(zero),
        velocity: nalgebra::Vector3::from_element(zero),
        angular_momentum: nalgebra::Vector3::new(zero, momentum, zero),
    };
    let flight = Flight::try_new(model, take_off).unwrap();
    let mut data = FlightData::new(model);
    let (mut q, mut v) = (vec![zero; 12], vec![zero; 12]);
    let mut rate = |share: f64| {
        let mut values = [0.0; 6];
        for (derivative, out) in [(0, &mut q), (1, &mut v)] {
            let first = basis.evaluate(share, derivative, &mut values);
            let weight = (0..6).fold(zero, |sum, j| sum + c[first + j] * values[j]);
            for joint in 0..9 {
                let fixed = if derivative == 0 { postures[0][joint] } else { 0.0 };
                out[3 + joint] = weight * (postures[1][joint] - postures[0][joint]) + fixed;
            }
        }
        flight.angular_velocity(&mut data, &q, &v).unwrap().z
    };
    let h = 1.0 / n_steps as f64;
    (0..n_steps).fold(zero, |angle, step| {
        let at = |part: f64| (step as f64 + part) * h;
        angle + (rate(at(0.0)) + rate(at(0.5)) * 4.0 + rate(at(1.0))) * (h / 6.0)
    })
}

#[test]
fn planar_derivatives_are_dual_numbers() {
    let model = Diver::planar().model().unwrap();
    let postures = [Posture::A, Posture::H].map(|p| p.planar().unwrap());
    let base = EigenpostureBase::try_new(&postures).unwrap();
    let motion = SplineMotion::try_new(UniformBasis::try_new(5, 8).unwrap(), base, &[]).unwrap();
    let mut path = OrientationPath::try_new(model.clone(), motion, 12).unwrap();
    let coefficients: Vec<f64> = (0..8).map(|k| 0.4 + 0.3 * (f64::from(k) * 1.3).sin()).collect();
    path.integrate(&coefficients, &[0.0], Vector3::y() * 80.0, true).unwrap();
    let n = path.n_steps();
    let mut found = NodeDerivatives::new(8);
    path.node_derivatives(n, &mut found).unwrap();
    let dual = model.cast::<Dual64>();
    for k in 0..9 {
        let mut c: Vec<Dual64> = coefficients.iter().map(|x| Dual64::from(*x)).collect();
        let mut momentum = Dual64::from(80.0);
        if k < 8 {
            c[k].eps = 1.0
        } else {
            momentum.eps = 1.0
        }
        let angle = planar_angle(&dual, &c, momentum, n);
        assert!((angle.re - path.angles()[n]).abs() < 1e-13);
        let derivative = if k < 8 { found.by_coefficients[k].z } else { found.by_momentum[(2, 1)] };
        assert!(
            (derivative - angle.eps).abs() < 1e-12 * (1.0 + angle.eps.abs()),
            "{k}: {derivative} {}",
            angle.eps
        );
    }
}

#[test]
fn the_orientation_converges_with_order_four() {
    let error = |n: usize| {
        let (mut path, c) = spatial_path(n);
        let (mut fine, _) = spatial_path(3 * 1024);
        let exact = end_of(&mut fine, &c, &ORIENTATION, MOMENTUM);
        let found = end_of(&mut path, &c, &ORIENTATION, MOMENTUM);
        (exact.inverse() * found).angle()
    };
    let order = (error(96) / error(192)).log2();
    assert!((order - 4.0).abs() < 0.3, "{order}");
}

#[test]
fn momentum_is_exact_at_every_node_of_a_flight() {
    let program = Dive::twisting(3.5, 1.5).unwrap().program().unwrap();
    let z = program.start(&Dive::twisting_template(1.5)).unwrap();
    let wanted = Vector3::new(0.0, program.momentum(&z), 0.0);
    for momentum in program.motion(&z).unwrap().angular_momentum {
        assert!((momentum - wanted).norm() < 1e-12 * (1.0 + wanted.norm()), "{momentum}");
    }
}

/// A body that turns somersaults and twists with a constant tilt: R = R_y(a t) R_x(tilt) R_z(b t).
fn tilted(somersault: f64, tilt: f64, twist: f64) -> UnitQuaternion<f64> {
    let about = |axis, angle| UnitQuaternion::from_axis_angle(&axis, angle);
    about(Vector3::y_axis(), somersault) * about(Vector3::x_axis(), tilt) * about(Vector3::z_axis(), twist)
}

#[test]
fn whole_turns_are_counted() {
    let counting = Counting::default();
    let path: Vec<_> = (0..=400)
        .map(|k| {
            let x = f64::from(k) / 400.0;
            tilted(7.0 * PI * x, 0.3 * (PI * x).sin(), 4.0 * PI * x)
        })
        .collect();
    let end = *counting.along(&path).last().unwrap();
    assert!((end.somersault - 7.0 * PI).abs() < 1e-12 && (end.twist - 4.0 * PI).abs() < 1e-12);
}

#[test]
fn projected_rates_miscount_a_tilted_dive() {
    // thesis 3.2 integrates ω_y and ω_zb; with tilt τ these are ψ̇ − φ̇ sin τ and φ̇ − ψ̇ sin τ
    let (somersault, tilt, twist) = (7.0 * PI, -0.2f64, 4.0 * PI);
    let (n, counting) = (2000, Counting::default());
    let (mut projected, mut counted) = ([0.0; 2], [0.0; 2]);
    for k in 0..n {
        let x = (f64::from(k) + 0.5) / f64::from(n);
        let orientation = tilted(somersault * x, tilt, twist * x);
        let ahead = tilted(somersault * (x + 1e-6), tilt, twist * (x + 1e-6));
        let omega = (orientation.inverse() * ahead).scaled_axis() / 1e-6;
        projected[0] += (orientation * omega).y / f64::from(n);
        projected[1] += omega.z / f64::from(n);
        let rates = counting.rates(&orientation, &omega);
        counted[0] += rates.somersault / f64::from(n);
        counted[1] += rates.twist / f64::from(n);
    }
    assert!((counted[0] - somersault).abs() < 1e-4 && (counted[1] - twist).abs() < 1e-4, "{counted:?}");
    assert!((projected[0] - (somersault - twist * tilt.sin())).abs() < 1e-4);
    assert!((projected[1] - (twist - somersault * tilt.sin())).abs() < 1e-4);
    assert!((projected[0] - counted[0]) / TAU > 0.3);
}

/// Largest difference between derivatives and central differences, over the scale of each row.
fn worst_difference(program: &mut DiveProgram, z: &[f64]) -> f64 {
    let structure = program.structure().clone();
    let (n, m) = (z.len(), structure.constraints.len());
    let (mut c, mut gradient) = (vec![0.0; m], vec![0.0; n]);
    let mut jacobian = vec![0.0; structure.jacobian.n_entries()];
    program.evaluate(z, &mut c).unwrap();
    program.differentiate(z, &mut gradient, &mut jacobian).unwrap();
    let (h, mut worst) = (1e-6, 0.0f64);
    let (mut plus, mut minus) = (c.clone(), c.clone());
    for k in 0..n {
        let mut moved = z.to_vec();
        moved[k] = z[k] + h;
        let cost_plus = program.evaluate(&moved, &mut plus).unwrap();
        moved[k] = z[k] - h;
        let cost_minus = program.evaluate(&moved, &mut minus).unwrap();
        let expected = (cost_plus - cost_minus) / (2.0 * h);
        worst = worst.max((gradient[k] - expected).abs() / (1.0 + expected.abs()));
        for i in 0..m {
            let expected = (plus[i] - minus[i]) / (2.0 * h);
            let found = structure.jacobian.value(&jacobian, i, k);
            worst = worst.max((found - expected).abs() / (1.0 + expected.abs()));
        }
    }
    worst
}

#[test]
fn derivatives_of_the_programs_are_differences() {
    let planar =
        Dive { lean: Range::new(0.0, 0.3), duration: Range::new(1.5, 1.8), ..Dive::forward_pike().unwrap() };
    let spatial = Dive {
        lean: Range::new(0.0, 0.3),
        duration: Range::new(1.5, 2.0),
        penalties: Penalties { momentum: 1.0, rate: 1e-3, acceleration: 1e-5 },
        ..Dive::twisting(3.5, 1.5).unwrap()
    };
    for (dive, template) in [(planar, Dive::pike_template()), (spatial, Dive::twisting_template(1.5))] {
        let mut program = dive.program().unwrap();
        let z = program.start(&template).unwrap();
        let worst = worst_difference(&mut program, &z);
        assert!(worst < 1e-5, "{worst:e}");
        let mut soft = program.softened(3.0).unwrap();
        let worst = worst_difference(&mut soft, &z);
        assert!(worst < 1e-5, "soft: {worst:e}");
    }
}

fn found(program: &DiveProgram, search: &DiveSearch, template: &[KeyFrame]) -> Vec<f64> {
    let z = program.start(template).unwrap();
    let report = search.solve(program, z, &mut |_| Flow::Continue).unwrap();
    assert!(report.residuals.feasibility < 1e-6, "{}: {:?}", report.status, report.residuals);
    report.z
}

#[test]
fn the_planar_dive_does_what_is_asked() {
    let program = Dive::forward_pike().unwrap().program().unwrap();
    let z = program.start(&Dive::pike_template()).unwrap();
    let solved = DiveSearch::direct().solve(&program, z, &mut |_| Flow::Continue).unwrap();
    assert!(solved.status.is_converged(), "{}", solved.status);
    let report = program.report(&solved.z).unwrap();
    assert!((report.somersaults - 3.5).abs() < 1e-5, "{report:?}");
    assert!(report.entry_angle < 1f64.to_radians());
    assert!(report.momentum_drift < 1e-12 && report.full_dynamics_defect < 1e-8);
    assert!(report.least_channel > -1e-12 && report.greatest_sum < 1.0 + 1e-12);
    // near 1 through the middle, at rest at both ends, and out of the pike only in the last quarter (4.2.1)
    let coefficients = program.coefficients(&solved.z);
    let weight = |share: f64, derivative: usize| {
        let mut w = [0.0];
        program.path().motion().channels_into(&coefficients, share, derivative, &mut w);
        w[0]
    };
    assert!((20..=80).all(|k| weight(f64::from(k) / 100.0, 0) > 0.95));
    for end in [0.0, 1.0] {
        assert!(weight(end, 0).abs() < 1e-12 && weight(end, 1).abs() < 1e-12);
    }
}

/// Into the pike and out of it in a fall without rotation: all momentum is rounding, and the dive holds all the same.
#[test]
fn a_dive_without_momentum_is_confirmed() {
    let lean = 10f64.to_radians();
    let falling = Dive {
        somersaults: 0.0,
        entry_lean: lean,
        momentum: Range::new(-500.0, 500.0),
        ..Dive::forward_pike().unwrap()
    };
    let program = falling.program().unwrap();
    let mut z = program.start(&Dive::pike_template()).unwrap();
    // so small a momentum that no digit of it can be seen in the motion
    *z.last_mut().unwrap() = 1e-16;
    let report = program.report(&z).unwrap();
    assert!(report.momentum.abs() < 1e-12 && report.defect < 1e-6, "{report:?}");
    assert!(report.momentum_drift < 1e-12 && report.is_confirmed(ALLOWED), "{}", report.sentence(ALLOWED));
}

/// The thesis' count of 3.1: fifteen coefficients that are free, and the momentum.
#[test]
fn the_planar_dive_with_sixteen_unknowns_does_what_is_asked() {
    let seven = Dive::forward_pike().unwrap();
    let sixteen = Dive { n_par: 19, ..seven.clone() };
    let [few, many] = [(seven, 7), (sixteen, 16)].map(|(dive, n_unknowns)| {
        let program = dive.program().unwrap();
        let z = found(&program, &DiveSearch::direct(), &Dive::pike_template());
        assert_eq!(z.len(), n_unknowns);
        program.report(&z).unwrap()
    });
    assert!((many.somersaults - 3.5).abs() < 1e-5 && many.entry_angle < 1f64.to_radians(), "{many:?}");
    assert!(many.momentum_drift < 1e-12 && many.least_channel > -1e-12, "{many:?}");
    // faster into the pike and out of it, so that less momentum is enough
    assert!((few.momentum - 66.558).abs() < 1e-3, "{}", few.momentum);
    assert!((many.momentum - 60.165).abs() < 1e-3, "{}", many.momentum);
    // and six coefficients more save hardly any
    let program = Dive { n_par: 25, ..Dive::forward_pike().unwrap() }.program().unwrap();
    let z = found(&program, &DiveSearch::direct(), &Dive::pike_template());
    let more = program.report(&z).unwrap();
    assert!(more.momentum < many.momentum && more.momentum > many.momentum - 0.05, "{}", more.momentum);
}

/// The cost of rates is ill-conditioned in many coefficients; steps that begin with its Hessian are as few as with seven.
#[test]
fn steps_are_as_few_with_many_unknowns() {
    let pike = Dive::forward_pike().unwrap();
    let free = Dive { lean: Range::new(0.0, 0.3), duration: Range::new(1.5, 1.75), ..pike.clone() };
    let joints = Dive { channels: Channels::Joints, ..pike.clone() };
    let mut third = pike.clone();
    third.postures.push(Posture::G.planar().unwrap().to_vec());
    let dives = [(pike, 31, 12), (third, 31, 12), (free, 31, 12), (joints, 10, 30)];
    let dives = dives.into_iter().chain([(Dive::forward_pike().unwrap(), 54, 12)]);
    for (dive, n_par, most) in dives {
        let dive = Dive { n_par, ..dive };
        let program = dive.program().unwrap();
        let z = program.start(&Dive::pike_template()).unwrap();
        let solved = DiveSearch::direct().solve(&program, z, &mut |_| Flow::Continue).unwrap();
        let Report { status, iterations, residuals, .. } = &solved;
        assert!(status.is_converged() && *iterations <= most, "{status} after {iterations}: {dive:?}");
        assert!(residuals.stationarity <= 1e-6 && residuals.feasibility <= 1e-8, "{residuals:?}");
    }
    // without penalties on rates there is no such Hessian to begin with
    let penalties = Penalties { momentum: 1.0, rate: 0.0, acceleration: 0.0 };
    let program = Dive { penalties, ..Dive::forward_pike().unwrap() }.program().unwrap();
    let z = program.start(&Dive::pike_template()).unwrap();
    let solved = DiveSearch::direct().solve(&program, z, &mut |_| Flow::Continue).unwrap();
    assert!(solved.status.is_converged(), "{}", solved.status);
}

#[test]
fn bad_starts_of_a_planar_dive_are_refused() {
    let program = Dive::forward_pike().unwrap().program().unwrap();
    let z = program.start(&Dive::pike_template()).unwrap();
    let solve = |z: Vec<f64>| DiveSearch::direct().solve(&program, z, &mut |_| Flow::Continue);
    for wrong in [Vec::new(), vec![0.0; z.len() + 1], vec![f64::NAN; z.len()]] {
        assert!(matches!(solve(wrong), Err(DiveSearchError::Solver(_))));
    }
    // without somersaults yet, and far from the weights allowed
    assert!(solve(vec![0.0; z.len()]).is_ok() && solve(vec![1e3; z.len()]).is_ok());
}

#[test]
fn the_twisting_dive_does_what_is_asked() {
    let program = Dive::forward_twisting().program().unwrap();
    let start = program.start(&Dive::twisting_template(2.0)).unwrap();
    let solved = DiveSearch::staged().solve(&program, start, &mut |_| Flow::Continue).unwrap();
    assert!(solved.status.is_converged(), "{}: {:?}", solved.status, solved.residuals);
    let z = solved.z;
    assert!(z.len() + 12 <= 92, "{}", z.len());
    let report = program.report(&z).unwrap();
    assert!((report.somersaults - 3.5).abs() < 1e-4 && (report.twists - 2.0).abs() < 1e-4, "{report:?}");
    assert!(report.defect < 5e-3, "{report:?}");
    assert!(report.entry_angle < 1f64.to_radians(), "{report:?}");
    assert!(report.momentum_drift < 1e-12, "{report:?}");
    assert!(report.least_channel > -1e-12 && report.greatest_sum < 1.0 + 1e-12, "{report:?}");
    assert!(report.nearest.as_ref().unwrap().distance >= 0.005, "{report:?}");
    // the order of a competition dive: a somersault in layout, throw, twists, square-out, pike, entry
    let angles = program.angles(&z).unwrap();
    let at = |share: f64| angles[(share * (angles.len() - 1) as f64).round() as usize];
    let coefficients = program.coefficients(&z);
    let weights = |share: f64| {
        let mut weights = [0.0; 5];
        program.path().motion().channels_into(&coefficients, share, 0, &mut weights);
        weights
    };
    let [_, mirror, throw, wrap, pike] = weights(0.22);
    assert!(mirror == 0.0 && throw == 0.0 && wrap == 0.0 && pike == 0.0);
    assert!(at(0.22).twist.abs() < 1e-9 && at(0.22).tilt.abs() < 1e-9, "{:?}", at(0.22));
    let tilting = angles.iter().find(|at| at.tilt.abs() > 1f64.to_radians()).unwrap();
    assert!(tilting.somersault > 0.85 * TAU && tilting.twist < 0.05 * TAU, "{tilting:?}");
    assert!(weights(0.32)[2] > 0.9);
    assert!((at(0.7).twist - 2.0 * TAU).abs() < 1e-6 && at(0.7).tilt.abs() < 1e-6, "{:?}", at(0.7));
    let [_, mirror, throw, wrap, pike] = weights(0.82);
    assert!(mirror == 0.0 && throw == 0.0 && wrap == 0.0 && pike > 0.9, "{:?}", weights(0.82));
    // what the twists cost: half as much momentum again as the planar dive has in its 1.7 s
    assert!((report.momentum - 100.885).abs() < 0.01, "{}", report.momentum);
}

/// Few steps, for dives of which only the counts matter.
fn quick() -> DiveSearch {
    DiveSearch { coarse_steps: Some(140), ..DiveSearch::staged() }
}

#[test]
fn a_dive_is_a_success_where_its_own_flight_agrees() {
    succeed_where_their_own_flight_agrees(&[(-2.5, 1.0, 1.8)]);
}

/// Somersaults forward and backward, whole and odd half twists to both sides.
#[test]
#[ignore = "long form of `a_dive_is_a_success_where_its_own_flight_agrees`, 14 s: `make studies` runs it"]
fn dives_are_a_success_where_their_own_flight_agrees() {
    succeed_where_their_own_flight_agrees(&[(2.5, 0.5, 1.8), (-2.5, 1.0, 1.8), (2.5, -1.5, 1.8)]);
}

/// Somersaults, twists and duration of each dive.
fn succeed_where_their_own_flight_agrees(dives: &[(f64, f64, f64)]) {
    for &(somersaults, twists, duration) in dives {
        let dive = Dive { duration: Range::fixed(duration), ..Dive::twisting(somersaults, twists).unwrap() };
        let lean = Range::fixed(dive.lean.lower.copysign(somersaults));
        let program = Dive { lean, n_steps: 420, ..dive }.program().unwrap();
        let start = program.start(&Dive::twisting_template(twists)).unwrap();
        let found = quick().solve_verified(&program, start, &mut |_| Flow::Continue).unwrap();
        let judged = found.verification.as_ref().unwrap();
        assert!(found.is_success(), "{}: {}", found.report.status, judged.sentence(ALLOWED));
        assert!((judged.somersaults - somersaults).abs() < ALLOWED / TAU, "{judged:?}");
        assert!((judged.twists - twists).abs() < ALLOWED / TAU && judged.tilt.abs() < ALLOWED, "{judged:?}");
        assert!(judged.defects.iter().all(|defect| *defect < ALLOWED), "{}", judged.defect);
        assert!(judged.nearest.as_ref().unwrap().distance >= 0.005, "{judged:?}");
        // no half turn between two nodes
        let motion = program.motion(&found.report.z).unwrap();
        for pair in motion.angles.windows(2) {
            let step =
                (pair[1].twist - pair[0].twist).abs().max((pair[1].somersault - pair[0].somersault).abs());
            assert!(step < 0.3, "{pair:?}");
        }
        // what was asked for otherwise is another dive: whole turns, and half ones, count
        for (more_somersaults, more_twists) in [(1.0, 0.0), (0.0, 1.0), (0.0, 0.5), (0.0, -2.0 * twists)] {
            let other = Dive {
                somersaults: somersaults + more_somersaults,
                twists: twists + more_twists,
                ..program.dive().clone()
            };
            let judged = other.program().unwrap().report(&found.report.z).unwrap();
            assert!(!judged.enters(ALLOWED) && !judged.is_confirmed(ALLOWED), "{judged:?}");
            assert!(judged.sentence(ALLOWED).contains("from the requested entry"));
        }
        // and so is one with more room than there is
        let clearance = Some(Clearance { distance: 0.02, n_times: 35 });
        let other = Dive { clearance, ..program.dive().clone() }.program().unwrap();
        let judged = other.report(&found.report.z).unwrap();
        assert!(!judged.is_clear() && !judged.is_confirmed(ALLOWED));
        assert!(
            judged.sentence(ALLOWED).contains("where 20.00 mm are requested"),
            "{}",
            judged.sentence(ALLOWED)
        );
    }
}

#[test]
fn mirror_images_have_the_same_variables() {
    for twists in [2.0, 1.5] {
        let dive = Dive { n_steps: 100, ..Dive::twisting(3.5, twists).unwrap() };
        let image = dive.mirrored().unwrap();
        assert_eq!(image.mirrored().unwrap(), dive);
        let [mut program, mut mirrored] = [&dive, &image].map(|dive| dive.program().unwrap());
        let template = Dive::twisting_template(twists);
        let z = program.start(&template).unwrap();
        let n = program.structure().constraints.len();
        assert_eq!(n, mirrored.structure().constraints.len());
        let [mut own, mut other] = [vec![0.0; n], vec![0.0; n]];
        let cost = program.evaluate(&z, &mut own).unwrap();
        assert_eq!(cost, mirrored.evaluate(&z, &mut other).unwrap());
        assert!(mirrored.start(&template).unwrap().iter().zip(&z).all(|(a, b)| (a - b).abs() < 1e-9));
        for (own, other) in program.angles(&z).unwrap().iter().zip(mirrored.angles(&z).unwrap()) {
            assert!((own.somersault - other.somersault).abs() < 1e-9, "{own:?} {other:?}");
            assert!((own.tilt + other.tilt).abs() < 1e-9 && (own.twist + other.twist).abs() < 1e-9);
        }
        // right and left limbs are as far apart as left and right ones, in another order
        let [own, other] = [own, other].map(|mut values| {
            values.iter_mut().for_each(|value| *value = value.abs());
            values.sort_by(f64::total_cmp);
            values
        });
        assert!(own.iter().zip(&other).all(|(a, b)| (a - b).abs() < 1e-9 * (1.0 + a.abs())));
    }
    // a throw to the other side, as letters have it
    let image = Dive::forward_twisting().mirrored().unwrap();
    assert_eq!(image.postures[2], Posture::E.spatial());
    assert_eq!(image.postures[3], Posture::D.spatial());
    assert_eq!(Dive::twisting(3.5, -2.0).unwrap(), image);
}

#[test]
fn a_search_that_is_stopped_keeps_what_it_has() {
    let program = Dive::forward_twisting().program().unwrap();
    let start = program.start(&Dive::twisting_template(2.0)).unwrap();
    let mut calls = 0;
    let stop = &mut |_: &Iteration<'_>| {
        calls += 1;
        Flow::Stop
    };
    let report = DiveSearch::staged().solve(&program, start.clone(), stop).unwrap();
    assert_eq!((report.status, calls), (Status::Stopped, 1));
    assert_eq!(report.z, start);
    // of the dive itself, whose entry is far off yet
    assert!(report.residuals.feasibility > 0.1 && report.residuals.stationarity.is_finite());
}

#[test]
fn a_search_that_finds_nothing_with_few_steps_says_why() {
    let program = Dive::forward_twisting().program().unwrap();
    let start = program.start(&Dive::twisting_template(2.0)).unwrap();
    let staged = DiveSearch::staged();
    let search = DiveSearch {
        soft_weights: vec![1.0],
        soft: Sqp { max_iterations: 2, ..staged.soft },
        hard: Sqp { max_iterations: 1, ..staged.hard },
        ..staged
    };
    let mut calls = 0;
    let count = &mut |_: &Iteration<'_>| {
        calls += 1;
        Flow::Continue
    };
    let report = search.solve(&program, start, count).unwrap();
    // three points of the soft stage, two with constraints, and the last one of the dive itself, which is told alone
    assert_eq!((report.status, report.iterations, calls), (Status::IterationLimit, 0, 6));
    let mut values = vec![0.0; program.structure().constraints.len()];
    let cost = program.clone().evaluate(&report.z, &mut values).unwrap();
    assert_eq!(report.cost, cost);
    assert!(report.residuals.feasibility > 1e-6 && report.residuals.stationarity.is_finite());
}

#[test]
fn a_path_is_the_same_whatever_was_integrated_before() {
    let (fresh, c) = spatial_path(40);
    let (q, momentum) = ([0.0, 0.0, 0.0, 1.0], Vector3::new(0.0, 60.0, 5.0));
    let derivatives = |path: &mut OrientationPath| {
        path.integrate(&c, &q, momentum, true).unwrap();
        let mut found = NodeDerivatives::new(c.len());
        path.node_derivatives(path.n_steps(), &mut found).unwrap();
        (path.orientations().to_vec(), found)
    };
    let expected = derivatives(&mut fresh.clone());
    let others: Vec<f64> = c.iter().map(|c| c + 1e-6).collect();
    for (c, q, momentum, with_derivatives) in [
        (&others, q, momentum, true),
        (&c, [0.0, 1e-6, 0.0, 1.0], momentum, true),
        (&c, q, momentum * 1.000_001, true),
        (&c, q, momentum, false),
        (&c, q, momentum, true),
    ] {
        let mut used = fresh.clone();
        used.integrate(c, &q, momentum, with_derivatives).unwrap();
        assert_eq!(derivatives(&mut used), expected);
    }
}

#[test]
fn another_diver_takes_another_momentum() {
    let momentum = |height: f64| {
        let dive = Dive { diver: Diver { height, ..Diver::planar() }, ..Dive::forward_pike().unwrap() };
        let program = dive.program().unwrap();
        program.momentum(&found(&program, &DiveSearch::direct(), &Dive::pike_template()))
    };
    // all inertias go with the square of the height, and L/L₀ is what the cost sees
    assert!((momentum(1.87) / momentum(1.70) - (1.87f64 / 1.70).powi(2)).abs() < 1e-4);
}

#[test]
fn without_eigenpostures_the_dive_costs_less_and_needs_more_unknowns() {
    let with = Dive::forward_pike().unwrap();
    let without = Dive { channels: Channels::Joints, ..with.clone() };
    let cost = |dive: &Dive| {
        let program = dive.program().unwrap();
        let z = program.start(&Dive::pike_template()).unwrap();
        let report = DiveSearch::direct().solve(&program, z, &mut |_| Flow::Continue).unwrap();
        assert!(report.residuals.feasibility < 1e-6, "{}: {:?}", report.status, report.residuals);
        (report.cost, report.z.len())
    };
    let (reduced, full) = (cost(&with), cost(&without));
    assert!(full.0 < reduced.0 && full.1 > 7 * reduced.1, "{reduced:?} {full:?}");
}

#[test]
fn a_third_posture_changes_little() {
    let two = Dive::forward_pike().unwrap();
    let mut three = two.clone();
    three.postures.push(Posture::G.planar().unwrap().to_vec());
    let momentum = |dive: &Dive| {
        let program = dive.program().unwrap();
        program.momentum(&found(&program, &DiveSearch::direct(), &Dive::pike_template()))
    };
    assert!((momentum(&three) / momentum(&two) - 1.0).abs() < 1e-3);
}

#[test]
fn the_work_of_the_joints_is_the_change_of_energy() {
    // without a square-out, where the orientation of a course that is no dive yet starts anew
    let twisting = Dive { square_out: 1.0, ..Dive::forward_twisting() };
    for (dive, template) in
        [(Dive::forward_pike().unwrap(), Dive::pike_template()), (twisting, Dive::twisting_template(2.0))]
    {
        let program = Dive { n_steps: 400, ..dive }.program().unwrap();
        let z = program.start(&template).unwrap();
        let motion = program.motion(&z).unwrap();
        let model = program.path().model();
        let (n_q, n_v) = (model.n_positions(), model.n_velocities());
        let mut data = Data::new(model);
        let mut energy = |k: usize| {
            let (q, v) = (&motion.positions[k * n_q..][..n_q], &motion.velocities[k * n_v..][..n_v]);
            let moving = model.velocities(&mut data, q, v).unwrap();
            moving.kinetic_energy() + moving.positions().potential_energy()
        };
        let n = motion.times.len() - 1;
        let power = |k: usize| -> f64 {
            let rows = motion.torques[k * n_v..][..n_v].iter().zip(&motion.velocities[k * n_v..][..n_v]);
            rows.map(|(torque, v)| torque * v).sum()
        };
        let third = motion.times[1] / 3.0;
        let work: f64 =
            (0..n).step_by(2).map(|k| third * (power(k) + 4.0 * power(k + 1) + power(k + 2))).sum();
        let change = energy(n) - energy(0);
        let size: f64 = (0..=n).map(|k| power(k).abs()).sum::<f64>() * motion.times[1];
        assert!((work - change).abs() < 1e-4 * size, "{work} {change} of {size}");
        // nothing pushes the root: inverse dynamics, which know no split, agree
        for k in (0..=n).step_by(37) {
            let row = |values: &[f64], width: usize| values[k * width..][..width].to_vec();
            let (q, v, a) =
                (row(&motion.positions, n_q), row(&motion.velocities, n_v), row(&motion.accelerations, n_v));
            let forces = model.inverse_dynamics(&mut data, &q, &v, &a, &[]).unwrap();
            let torques = row(&motion.torques, n_v);
            let largest = torques.iter().fold(1.0f64, |most, t| most.max(t.abs()));
            assert!(forces.iter().zip(&torques).all(|(f, t)| (f - t).abs() < 1e-9 * largest), "{k}");
        }
        let peaks = motion.peak_torques(model);
        assert_eq!(peaks.len(), n_v - model.velocities_of(0).len());
        let largest = motion.torques.iter().fold(0.0f64, |most, t| most.max(t.abs()));
        assert_eq!(peaks.iter().fold(0.0f64, |most, p| most.max(p.torque.abs())), largest);
    }
}

#[test]
fn explicit_euler_loses_the_momentum_with_order_one() {
    let program = Dive::forward_pike().unwrap().program().unwrap();
    let z = found(&program, &DiveSearch::direct(), &Dive::pike_template());
    let drift = |n: usize| {
        let along = program.momentum_in_coordinates(&z, n).unwrap();
        along[n] / along[0] - 1.0
    };
    let (coarse, fine) = (drift(400), drift(800));
    assert!(drift(200).abs() > 0.01 && (coarse / fine - 2.0).abs() < 0.1, "{coarse} {fine}");
    // and the same through the shooting: more in the pike, less at the entry, and a quarter turn too far
    let literal = program.literal_motion(&z, 200).unwrap();
    let along = &literal.angular_momentum;
    let most = along.iter().fold(0.0f64, |most, l| most.max(*l));
    assert!(along[200] < 0.97 * along[0] && most > 1.08 * along[0] && most < 1.16 * along[0]);
    let wanted = program.angles(&z).unwrap();
    // both count from the upright
    let turned = wanted[wanted.len() - 1].somersault;
    assert!((literal.somersault[0] - wanted[0].somersault).abs() < 1e-12);
    assert!((literal.somersault[200] - turned) / TAU > 0.2);
    let solved = program.solve_literal(&z, 200, &mut |_| Flow::Continue).unwrap();
    assert!(solved.report.unwrap().status.is_converged());
    assert!((solved.somersault[200] - turned).abs() < 1e-6);
    assert!(matches!(program.literal_motion(&z, 0), Err(DiveError::Problem(_))));
    for n_steps in [0, 1_000_000_000] {
        let refused = program.momentum_in_coordinates(&z, n_steps);
        assert!(
            matches!(
                refused,
                Err(DiveError::Argument(ArgumentError::OutOfRange { argument: "n_steps", .. }))
            ),
            "{refused:?}"
        );
    }
}

/// A dive stepped by explicit Euler, of these somersaults from an upright start.
fn rolled_out(somersaults: f64, momentum: f64) -> LiteralDive {
    let dive = Dive {
        somersaults,
        lean: Range::fixed(0.0),
        momentum: Range::new(-500.0, 500.0),
        ..Dive::forward_pike().unwrap()
    };
    let program = dive.program().unwrap();
    let mut z = program.start(&Dive::pike_template()).unwrap();
    *z.last_mut().unwrap() = momentum / (dive.diver.mass * dive.diver.height.powi(2));
    program.literal_motion(&z, 200).unwrap()
}

#[test]
fn a_change_of_momentum_is_relative_to_that_at_take_off() {
    let unit = Diver::planar().mass * Diver::planar().height.powi(2);
    for momentum in [60.0, -60.0] {
        let dive = rolled_out(3.5f64.copysign(momentum), momentum);
        let [first, last] = [0, 200].map(|k| dive.angular_momentum[k]);
        assert!((first - momentum).abs() < 1e-9, "{first}");
        let grown = (last.abs() - first.abs()) / first.abs();
        assert!(grown.abs() > 0.01 && (dive.momentum_change() - grown).abs() < 1e-12, "{grown}");
    }
    // rounding has no size, and no sense
    for momentum in [1e-14, 0.0, -1e-14] {
        let dive = rolled_out(0.0, momentum);
        let change = dive.angular_momentum[200] - dive.angular_momentum[0];
        assert!(change.abs() > 1e-3, "{change}");
        let expected = change / (1e-3 * unit);
        assert!((dive.momentum_change() - expected).abs() < 1e-9 * expected.abs());
    }
}

#[test]
fn capsules_have_the_distances_of_closed_form() {
    let point = |x: f64, y: f64, z: f64| Vector3::new(x, y, z);
    let parallel = nearest_points(
        &[point(0.0, 0.0, 0.0), point(0.0, 0.0, 1.0)],
        &[point(0.3, 0.0, 0.2), point(0.3, 0.0, 0.9)],
        0.0,
    );
    assert!((parallel.distance - 0.3).abs() < 1e-12);
    let crossing = nearest_points(
        &[point(-1.0, 0.0, 0.0), point(1.0, 0.0, 0.0)],
        &[point(0.0, -1.0, 0.1), point(0.0, 1.0, 0.1)],
        0.0,
    );
    assert!((crossing.distance - 0.1).abs() < 1e-12);
}

#[test]
fn the_standing_diver_is_as_wide_as_its_table() {
    let model = Diver::spatial().model().unwrap();
    let body = Body::try_new(&model).unwrap();
    let radius = |name: &str| {
        let number = model.body(name).unwrap();
        body.capsules().iter().find(|c: &&Capsule| c.body == number).unwrap().radius
    };
    for (name, millimetres) in [
        ("torso", 120.0),
        ("pelvis", 119.0),
        ("head", 99.0),
        ("right_thigh", 82.0),
        ("left_shank", 44.0),
        ("left_foot", 55.0),
        ("right_upper_arm", 44.0),
        ("left_forearm", 34.0),
        ("right_hand", 24.0),
    ] {
        assert!((radius(name) * 1e3 - millimetres).abs() < 0.6, "{name} {}", radius(name));
    }
}

#[test]
fn bad_dives_are_refused() {
    let good = Dive::forward_pike().unwrap();
    let of = |change: &dyn Fn(&mut Dive)| {
        let mut dive = good.clone();
        change(&mut dive);
        dive.program().map(|_| ()).unwrap_err()
    };
    let too_few = JointMotionError::Spline(SplineError::TooFewCoefficients { degree: 5, found: 5 });
    assert_eq!(of(&|d| d.n_par = 5), DiveError::Motion(too_few));
    assert_eq!(
        of(&|d| d.postures[1] = d.postures[0].clone()),
        DiveError::Motion(JointMotionError::DependentPostures { rank: 0, expected: 1 })
    );
    assert!(matches!(
        of(&|d| d.momentum = Range::new(2.0, 1.0)),
        DiveError::Range { argument: "momentum", lower: 2.0, upper: 1.0 }
    ));
    assert!(matches!(
        of(&|d| d.duration = Range::fixed(0.0)),
        DiveError::Argument(ArgumentError::NotPositive { argument: "duration", .. })
    ));
    assert!(matches!(of(&|d| d.lean = Range::fixed(f64::NAN)), DiveError::Range { argument: "lean", .. }));
    assert!(matches!(
        of(&|d| d.somersaults = f64::NAN),
        DiveError::Argument(ArgumentError::NonFinite { argument: "somersaults", .. })
    ));
    assert!(matches!(
        of(&|d| d.penalties.rate = -1.0),
        DiveError::Argument(ArgumentError::Negative { argument: "penalties.rate", .. })
    ));
    for n_steps in [0, 1_000_000_000] {
        assert!(matches!(
            of(&|d| d.n_steps = n_steps),
            DiveError::Argument(ArgumentError::OutOfRange { argument: "n_steps", .. })
        ));
    }
    assert!(matches!(
        of(&|d| d.n_pieces = 1_000_000_000),
        DiveError::Argument(ArgumentError::OutOfRange { argument: "n_pieces", .. })
    ));
    assert!(matches!(
        of(&|d| d.n_par = 1_000_000_000),
        DiveError::Motion(JointMotionError::TooManyCoefficients { .. })
    ));
    // in the plane there is neither twist nor clearance
    assert!(matches!(
        of(&|d| d.twists = 1.0),
        DiveError::Argument(ArgumentError::OutOfRange { argument: "twists", .. })
    ));
    let clearance = Some(Clearance { distance: 0.005, n_times: 35 });
    assert!(matches!(
        of(&|d| d.clearance = clearance),
        DiveError::Argument(ArgumentError::OutOfRange { argument: "clearance", .. })
    ));
    assert!(matches!(
        of(&|d| d.windows = vec![Range::new(0.4, 0.5)]),
        DiveError::EmptyWindow { channel: 0, lower: 0.4, upper: 0.5 }
    ));
    let mut twisting = Dive::forward_twisting();
    twisting.windows[2] = Range::new(0.3, 0.31);
    assert!(matches!(twisting.program(), Err(DiveError::EmptyWindow { channel: 2, .. })));
    // forward momentum does not turn a dive backwards, and none turns none; backward momentum does
    assert!(matches!(of(&|d| d.somersaults = -3.5), DiveError::Opposed { .. }));
    assert!(matches!(of(&|d| d.momentum = Range::fixed(0.0)), DiveError::Opposed { .. }));
    let backwards = Dive { somersaults: -3.5, momentum: Range::new(-500.0, 0.0), ..good.clone() };
    assert!(backwards.program().is_ok());
    assert!(matches!(
        of(&|d| d.platform = -5.0),
        DiveError::Argument(ArgumentError::Negative { argument: "platform", .. })
    ));
    assert!(matches!(
        of(&|d| d.lean = Range::fixed(10.0)),
        DiveError::Argument(ArgumentError::OutOfRange { argument: "lean", .. })
    ));
    assert!(matches!(
        of(&|d| d.entry_lean = 90.0),
        DiveError::Argument(ArgumentError::OutOfRange { argument: "entry_lean", .. })
    ));
    assert!(matches!(
        of(&|d| d.square_out = 1.5),
        DiveError::Argument(ArgumentError::OutOfRange { argument: "square_out", .. })
    ));
    assert!(matches!(
        of(&|d| d.last = 2),
        DiveError::NoSuchPosture { argument: "last", n_postures: 2, found: 2 }
    ));
    assert!(matches!(
        of(&|d| d.postures[1][1] = f64::NAN),
        DiveError::Motion(JointMotionError::Argument(ArgumentError::NonFinite { .. }))
    ));
    assert!(matches!(of(&|d| d.postures[1][2] = -0.5), DiveError::JointLimit { posture: 1, .. }));
    assert!(matches!(of(&|d| d.diver.mass = -1.0), DiveError::Model(_)));
    assert!(matches!(
        of(&|d| d.diver = Diver::spatial()),
        DiveError::Dynamics(DynamicsError::Argument(ArgumentError::Length { .. }))
    ));
    // a quarter of a twist leaves the plane of the somersaults; at the entry it may
    let mut quarter = Dive { twists: 0.25, ..Dive::forward_twisting() };
    assert!(matches!(
        quarter.program(),
        Err(DiveError::Argument(ArgumentError::OutOfRange { argument: "twists", found: 0.25, .. }))
    ));
    quarter.square_out = 1.0;
    assert!(quarter.program().is_ok());
    let program = good.program().unwrap();
    let frame = |fraction, posture| KeyFrame { fraction, posture };
    for frames in [
        vec![],
        vec![frame(0.0, 0)],
        vec![frame(0.0, 0), frame(0.5, 1)],
        vec![frame(0.0, 0), frame(f64::NAN, 1), frame(1.0, 0)],
    ] {
        assert!(matches!(program.start(&frames), Err(DiveError::KeyFrames { .. })), "{frames:?}");
    }
    assert!(matches!(program.start(&[frame(0.0, 0), frame(1.0, 7)]), Err(DiveError::NoSuchPosture { .. })));
    assert!(matches!(
        program.softened(0.0),
        Err(DiveError::Argument(ArgumentError::NotPositive { argument: "weight", .. }))
    ));
}
