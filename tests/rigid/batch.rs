//! Batches of bodies, free and under forces: the method, the vector instructions and the threads.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use rayon::ThreadPoolBuilder;
use somersault_core::cancel::CancellationToken;
use somersault_core::{Inertia, lie::so3};
use somersault_integrators::batch::{
    AdaptedRuns, BatchError, ForcedRuns, Forces, FreeBodyBatch, FreeRuns, InstructionSet, Runs,
};
use somersault_integrators::body::{PrincipalBody, RigidBody};
use somersault_integrators::driver::{Adaptive, IntegrateError, Steps, TimeGrid};
use somersault_integrators::exact::FreeBody;
use somersault_integrators::force::{BoxedForce, ForceModel, Gravity, ScheduledTorque, Spring, Wrench};
use somersault_integrators::methods::Method;
use somersault_integrators::orbit::{Elements, Orbit};
use somersault_integrators::reversal::{TimeReversed, reversed};
use somersault_integrators::rotors::{LinearSchedule, ReactionWheel, ReactionWheels, Rotors};
use somersault_integrators::run::Run;
use somersault_integrators::satellite::{AerodynamicDrag, Field, GravityGradient, MagneticDipole, Plate};
use somersault_integrators::series::WrenchTerm;
use somersault_integrators::solution::Recorder;
use somersault_integrators::state::RigidBodyState;
use somersault_integrators::system::RigidBodySystem;
use somersault_testkit::problems::under;
use somersault_testkit::trees::Random;
use std::f64::consts::FRAC_PI_2;

/// Numbers spread over (−1, 1), the same in every run.
fn spread(seed: usize, i: usize) -> f64 {
    (1e3 * ((seed + 1) as f64 * 0.7548776662466927 + i as f64 * 0.5698402909980532)).sin()
}

fn spread_vector(seed: usize, i: usize) -> Vector3<f64> {
    Vector3::new(spread(seed, 3 * i), spread(seed, 3 * i + 1), spread(seed, 3 * i + 2))
}

/// `n` different tumbling bodies with angular velocities of the size `speed`.
struct Bodies {
    moments: Vec<Vector3<f64>>,
    orientations: Vec<UnitQuaternion<f64>>,
    omegas: Vec<Vector3<f64>>,
}

impl Bodies {
    fn new(n: usize, speed: f64) -> Self {
        // Half extents between 0.5 and 1.5: the moments of boxes.
        let sides = |i| spread_vector(1, i).map(|x| (1.0 + 0.5 * x).powi(2));
        Self {
            moments: (0..n).map(sides).map(|s| Vector3::new(s.y + s.z, s.z + s.x, s.x + s.y)).collect(),
            orientations: (0..n)
                .map(|i| UnitQuaternion::from_scaled_axis(spread_vector(2, i) * 3.0))
                .collect(),
            omegas: (0..n).map(|i| spread_vector(3, i) * speed).collect(),
        }
    }

    fn batch(&self) -> FreeBodyBatch {
        FreeBodyBatch::try_new(&self.moments, &self.orientations, &self.omegas).unwrap()
    }
}

/// The states as bits, so that −0 differs from 0 and nothing is rounded away.
fn bits(batch: &FreeBodyBatch) -> Vec<[u64; 7]> {
    let state =
        |(q, w): (&UnitQuaternion<f64>, &Vector3<f64>)| [q.w, q.i, q.j, q.k, w.x, w.y, w.z].map(f64::to_bits);
    batch.orientations().iter().zip(batch.angular_velocities_body()).map(state).collect()
}

/// The method as it is written in books, for one body.
fn textbook(
    moments: &Vector3<f64>,
    q: &mut UnitQuaternion<f64>,
    omega: &mut Vector3<f64>,
    h: f64,
    steps: u64,
) {
    let euler = |w: &Vector3<f64>| moments.component_mul(w).cross(w).component_div(moments);
    for _ in 0..steps {
        let w1 = *omega;
        let w2 = w1 + euler(&w1) * (h / 2.0);
        let w3 = w1 + euler(&w2) * (h / 2.0);
        let w4 = w1 + euler(&w3) * h;
        let u = (w1 + w2 * 2.0 + w3 * 2.0 + w4) * (h / 6.0) + w1.cross(&w4) * (h * h / 12.0);
        *q *= UnitQuaternion::from_scaled_axis(u);
        *omega += (euler(&w1) + euler(&w2) * 2.0 + euler(&w3) * 2.0 + euler(&w4)) * (h / 6.0);
    }
}

#[test]
fn a_batch_agrees_with_the_textbook_to_rounding() {
    let bodies = Bodies::new(150, 2.0);
    let mut batch = bodies.batch();
    batch.advance(&[0.01; 150], &[500; 150]).unwrap();
    for i in 0..150 {
        let (mut q, mut omega) = (bodies.orientations[i], bodies.omegas[i]);
        textbook(&bodies.moments[i], &mut q, &mut omega, 0.01, 500);
        // 500 steps of at most a few units of rounding each.
        assert!(batch.orientations()[i].angle_to(&q) < 2e-13);
        assert!((batch.angular_velocities_body()[i] - omega).norm() < 2e-13);
    }
}

#[test]
fn all_instructions_give_the_same_bits() {
    for (speed, dt) in [(2.0, 0.01), (2.0, 0.9), (30.0, 0.01)] {
        let bodies = Bodies::new(203, speed);
        let steps: Vec<u64> = (0..203).map(|i| 20 + (i * i % 37)).collect();
        let run = |set| {
            let mut batch = bodies.batch();
            batch.advance_with(set, &[dt; 203], &steps).unwrap();
            bits(&batch)
        };
        let results: Vec<_> = InstructionSet::supported().map(run).collect();
        assert!(results.iter().all(|r| *r == results[0]));
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let bodies = Bodies::new(1000, 3.0);
    let dt: Vec<f64> = (0..1000).map(|i| 0.02 + 0.01 * spread(4, i)).collect();
    let steps: Vec<u64> = (0..1000).map(|i| i % 91).collect();
    let run = |threads| {
        let mut batch = bodies.batch();
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| batch.advance(&dt, &steps)).unwrap();
        bits(&batch)
    };
    let one = run(1);
    assert!([2, 3].into_iter().all(|threads| run(threads) == one));
}

#[test]
fn a_body_moves_as_if_alone() {
    // Sizes around the tile of 64, steps and step sizes mixed, so that places and companions change.
    for n in [1, 5, 63, 64, 65, 130] {
        let bodies = Bodies::new(n, 3.0);
        let dt: Vec<f64> = (0..n).map(|i| 0.05 * spread(5, i)).collect();
        let steps: Vec<u64> = (0..n as u64).map(|i| (i * 7) % 23).collect();
        let mut batch = bodies.batch();
        batch.advance(&dt, &steps).unwrap();
        for i in 0..n {
            let one = i..i + 1;
            let mut alone = FreeBodyBatch::try_new(
                &bodies.moments[one.clone()],
                &bodies.orientations[one.clone()],
                &bodies.omegas[one.clone()],
            )
            .unwrap();
            alone.advance(&dt[one.clone()], &steps[one]).unwrap();
            assert_eq!(bits(&alone)[0], bits(&batch)[i]);
        }
    }
}

#[test]
fn bodies_without_steps_stay() {
    let bodies = Bodies::new(70, 3.0);
    let mut batch = bodies.batch();
    let before = bits(&batch);
    batch.advance(&[0.1; 70], &[0; 70]).unwrap();
    batch.advance(&[0.0; 70], &[9; 70]).unwrap();
    assert_eq!(bits(&batch), before);
}

#[test]
fn an_empty_batch_is_integrated() {
    let mut batch = FreeBodyBatch::default();
    assert!(batch.is_empty());
    batch.advance(&[], &[]).unwrap();
}

#[test]
fn a_batch_is_of_fourth_order() {
    let n = 100;
    let bodies = Bodies::new(n, 1.5);
    let at = |steps: u64| {
        let mut batch = bodies.batch();
        batch.advance(&vec![2.0 / steps as f64; n], &vec![steps; n]).unwrap();
        batch
    };
    let fine = at(20_000);
    let errors = [40, 80, 160].map(|steps| {
        let coarse = at(steps);
        let angle = |i: usize| coarse.orientations()[i].angle_to(&fine.orientations()[i]);
        let omega =
            |i: usize| (coarse.angular_velocities_body()[i] - fine.angular_velocities_body()[i]).norm();
        [(0..n).map(angle).sum::<f64>(), (0..n).map(omega).sum()]
    });
    for pair in errors.windows(2) {
        for k in 0..2 {
            let order = (pair[0][k] / pair[1][k]).log2();
            assert!((order - 4.0).abs() < 0.15, "order {order}");
        }
    }
}

#[test]
fn rotation_about_a_principal_axis_is_exact_for_any_step() {
    // One step of h = 2 from the identity: the half-angle is ω itself and q = ±(cos ω, sin ω) in so many words.
    let angles: Vec<f64> = (0..4000)
        .map(|i| if i % 2 == 0 { spread(6, i) * FRAC_PI_2 } else { 10f64.powf(4.0 + 4.0 * spread(6, i)) })
        .chain([0.0, 1e-300, -1e-9, FRAC_PI_2, 2.0 * FRAC_PI_2, 3.0 * FRAC_PI_2, 1e6])
        .collect();
    let n = angles.len();
    for axis in 0..3 {
        let omegas: Vec<_> = angles.iter().map(|&a| Vector3::ith(axis, a)).collect();
        let moments = vec![Vector3::new(1.0, 1.3, 2.0); n];
        let mut batch =
            FreeBodyBatch::try_new(&moments, &vec![UnitQuaternion::identity(); n], &omegas).unwrap();
        batch.advance(&vec![2.0; n], &vec![1; n]).unwrap();
        for (q, &a) in batch.orientations().iter().zip(&angles) {
            let bound = if a.abs() < FRAC_PI_2 / 2.0 { 3e-16 } else { 1e-15 + 3e-16 * a.abs() };
            let sign = (q.w * a.cos() + q.coords[axis] * a.sin()).signum();
            let error = (sign * q.w - a.cos()).abs().max((sign * q.coords[axis] - a.sin()).abs());
            assert!(error <= bound, "error {error:e} at {a:e}");
        }
        assert_eq!(batch.angular_velocities_body(), omegas);
    }
}

#[test]
fn large_steps_keep_unit_quaternions_and_agree() {
    // Equal moments: any step is exact, and h‖ω‖ up to 50 stays bounded.
    let n = 500;
    let bodies = Bodies::new(n, 50.0 / 3f64.sqrt());
    let moments = vec![Vector3::repeat(2.0); n];
    let mut results = Vec::new();
    for set in InstructionSet::supported() {
        let mut batch = FreeBodyBatch::try_new(&moments, &bodies.orientations, &bodies.omegas).unwrap();
        batch.advance_with(set, &vec![1.0; n], &vec![40; n]).unwrap();
        results.push(bits(&batch));
        for i in 0..n {
            let q = batch.orientations()[i];
            assert!((q.norm() - 1.0).abs() < 4e-16);
            let exact = bodies.orientations[i] * UnitQuaternion::from_scaled_axis(bodies.omegas[i] * 40.0);
            // 40 steps, each 3·10⁻¹⁶ h‖ω‖ + 10⁻¹⁵ at most, in half-angles.
            assert!(q.angle_to(&exact) < 80.0 * (1.5e-16 * bodies.omegas[i].norm() + 1e-15));
        }
    }
    assert!(results.iter().all(|r| *r == results[0]));
}

#[test]
fn unit_quaternions_stay_so_for_absurd_steps() {
    let omegas = [1e12, 1e16, 1e40, 1e150].map(|w| Vector3::new(w, -w, 0.5 * w));
    let moments = [Vector3::repeat(1.0); 4];
    let mut batch = FreeBodyBatch::try_new(&moments, &[UnitQuaternion::identity(); 4], &omegas).unwrap();
    batch.advance(&[1.0; 4], &[3; 4]).unwrap();
    assert!(batch.orientations().iter().all(|q| (q.norm() - 1.0).abs() < 4e-16));
}

#[test]
fn misuse_is_a_typed_error_that_names_the_body() {
    let bodies = Bodies::new(3, 1.0);
    let make = |m: &[_], q: &[_], w: &[_]| FreeBodyBatch::try_new(m, q, w).map(|_| ());
    let (m, q, w) = (&bodies.moments[..], &bodies.orientations[..], &bodies.omegas[..]);
    assert_eq!(
        make(m, &q[..2], w),
        Err(BatchError::Length { argument: "orientations", expected: 3, found: 2 })
    );
    let mut spoiled = bodies.omegas.clone();
    spoiled[1].y = f64::NAN;
    assert!(matches!(
        make(m, q, &spoiled),
        Err(BatchError::NonFinite { argument: "angular_velocities_body", body: 1, .. })
    ));
    let mut spoiled = bodies.moments.clone();
    spoiled[2].x = 0.0;
    assert!(matches!(make(&spoiled, q, w), Err(BatchError::NotPositive { body: 2, .. })));
    let mut batch = bodies.batch();
    let infinite = batch.advance(&[1.0, f64::INFINITY, 1.0], &[1; 3]);
    assert!(matches!(infinite, Err(BatchError::NonFinite { argument: "dt", body: 1, .. })));
}

#[test]
fn a_diverging_body_is_named_and_the_batch_left_alone() {
    let mut bodies = Bodies::new(100, 1.0);
    bodies.omegas[70] = Vector3::new(1e100, 1e100, 1e100);
    bodies.omegas[80] = bodies.omegas[70];
    let mut batch = bodies.batch();
    let before = bits(&batch);
    assert_eq!(batch.advance(&[0.1; 100], &[5; 100]), Err(BatchError::Diverged { body: 70 }));
    assert_eq!(bits(&batch), before);
}

/// Rigid bodies with inclined principal axes, in flight, each with its own times.
fn flight(n: usize) -> (Vec<RigidBody>, Vec<RigidBodyState>, Vec<TimeGrid>) {
    let bodies = Bodies::new(n, 2.0);
    let incline = |i| {
        let inertia = Inertia::try_principal(bodies.moments[i]).unwrap();
        inertia.rotated(&UnitQuaternion::from_scaled_axis(spread_vector(7, i) * 2.0)).unwrap()
    };
    let state = |i| {
        RigidBodyState::new(
            spread_vector(8, i),
            bodies.orientations[i],
            spread_vector(9, i),
            bodies.omegas[i],
        )
    };
    // Starts, ends and steps all differ, and most steps do not divide the interval.
    let grid =
        |i| TimeGrid::try_new(spread(10, i), 3.0 + spread(11, i), 0.01 + 0.005 * spread(12, i)).unwrap();
    (
        (0..n).map(|i| RigidBody::try_new(1.0 + i as f64, incline(i)).unwrap()).collect(),
        (0..n).map(state).collect(),
        (0..n).map(grid).collect(),
    )
}

/// Largest difference of the parts of two states.
fn distance(a: &RigidBodyState, b: &RigidBodyState) -> f64 {
    so3::angle_between(a.orientation(), b.orientation())
        .max((a.position() - b.position()).norm())
        .max((a.velocity() - b.velocity()).norm())
        .max((a.angular_velocity() - b.angular_velocity()).norm())
}

#[test]
fn free_bodies_agree_with_rkmk_b_to_rounding() {
    let (bodies, states, grids) = flight(150);
    let systems: Vec<_> = bodies.iter().map(|body| RigidBodySystem::free(*body)).collect();
    let ends = FreeRuns::new(&bodies, &grids).from(&states).unwrap();
    let outcomes = Runs::new(&systems, Method::RkmkB, &grids).from(&states).unwrap();
    for (end, outcome) in ends.iter().zip(&outcomes) {
        assert!(distance(end, &outcome.state) < 1e-12);
    }
}

#[test]
fn bodies_by_their_moments_move_as_those_made_of_them() {
    let (_, states, grids) = flight(150);
    let moments = Bodies::new(150, 1.0).moments;
    let of = |(i, moments): (usize, &Vector3<f64>)| PrincipalBody::try_new(1.0 + i as f64, *moments).unwrap();
    let bodies: Vec<PrincipalBody> = moments.iter().enumerate().map(of).collect();
    let made: Vec<RigidBody> = bodies.iter().map(|body| (*body).into()).collect();
    for (i, (body, moments)) in made.iter().zip(&moments).enumerate() {
        assert_eq!(*body, RigidBody::try_principal(1.0 + i as f64, *moments).unwrap());
    }
    let ends = FreeRuns::new(&bodies, &grids).from(&states).unwrap();
    assert_eq!(ends, FreeRuns::new(&made, &grids).from(&states).unwrap());

    for (mass, moments) in [
        (0.0, [1.0, 1.0, 1.0]),
        (f64::INFINITY, [1.0, 1.0, 1.0]),
        (1.0, [1.0, f64::NAN, 1.0]),
        (1.0, [1.0, 0.0, 1.0]),
        (1.0, [1.0, 5.0, 1.0]),
    ] {
        let refused = PrincipalBody::try_new(mass, moments.into()).unwrap_err().to_string();
        assert_eq!(refused, RigidBody::try_principal(mass, moments.into()).unwrap_err().to_string());
    }
}

#[test]
fn falling_bodies_agree_with_rkmk_b_to_rounding() {
    let (bodies, states, grids) = flight(70);
    let gravity = Gravity::earth();
    let systems: Vec<_> = bodies.iter().map(|body| under(*body, gravity)).collect();
    let ends = FreeRuns::new(&bodies, &grids).in_gravity(&gravity).from(&states).unwrap();
    let outcomes = Runs::new(&systems, Method::RkmkB, &grids).from(&states).unwrap();
    for (end, outcome) in ends.iter().zip(&outcomes) {
        // Positions reach 80 m by up to 800 additions.
        assert!(distance(end, &outcome.state) < 1e-11);
    }
}

#[test]
fn any_method_gives_each_system_what_it_gives_it_alone() {
    let (bodies, states, grids) = flight(9);
    let spring = Spring {
        anchor: Vector3::zeros(),
        attachment: Vector3::x(),
        stiffness: 3.0,
        damping: 0.1,
        rest_length: 0.0,
    };
    assert!(!spring.is_torque_free());
    let systems: Vec<_> = bodies.iter().map(|body| under(*body, spring)).collect();
    for method in Method::ALL {
        let alone = |i: usize| Run::new(&systems[i], method, grids[i]).from(&states[i]);
        let first_failure =
            (0..9).find_map(|index| alone(index).err().map(|source| BatchError::Integrate { index, source }));
        for threads in [1, 3] {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            match pool.install(|| Runs::new(&systems, method, &grids).from(&states)) {
                Ok(outcomes) => {
                    assert!(first_failure.is_none());
                    assert!((0..9).all(|i| outcomes[i].state == alone(i).unwrap().state));
                }
                Err(error) => assert_eq!(Some(error), first_failure),
            }
        }
    }
}

#[test]
fn the_fronts_refuse_what_is_not_finite() {
    let (bodies, mut states, grids) = flight(5);
    states[3].rate.linear.z = f64::NAN;
    let refused = FreeRuns::new(&bodies, &grids).from(&states);
    assert!(matches!(refused, Err(BatchError::NonFinite { argument: "states", body: 3, .. })));
    let systems: Vec<_> = bodies.iter().map(|body| RigidBodySystem::free(*body)).collect();
    let refused = Runs::new(&systems, Method::Rk4, &grids).from(&states).map(|_| ());
    assert!(matches!(
        refused,
        Err(BatchError::Integrate { index: 3, source: IntegrateError::InitialState { .. } })
    ));
    let short = FreeRuns::new(&bodies, &grids).from(&states[..4]);
    assert_eq!(short, Err(BatchError::Length { argument: "states", expected: 5, found: 4 }));
}

#[test]
fn states_recorded_at_times_are_those_of_each_system_alone() {
    let (bodies, states, _) = flight(5);
    let systems: Vec<_> = bodies.iter().map(|body| under(*body, Gravity::earth())).collect();
    let grids: Vec<_> = [0.03, 0.1, 0.2, 0.25, 0.3].map(|dt| TimeGrid::try_new(0.0, 1.0, dt).unwrap()).into();
    let (times, token) = ([0.0, 0.2, 1.0], CancellationToken::new());
    let recorded = |times: &[f64], token: &CancellationToken| {
        Runs::new(&systems, Method::Rkmk8B, &grids).recorded(&states, times, token)
    };
    for (i, kept) in recorded(&times, &token).unwrap().into_iter().enumerate() {
        let mut recorder = Recorder::at_times((0.0, 1.0), &states[i], times.into()).unwrap();
        Run::new(&systems[i], Method::Rkmk8B, grids[i]).observed_by(&mut recorder).from(&states[i]).unwrap();
        assert_eq!(kept, recorder.into_solution().states);
    }
    let beyond = recorded(&[1.5], &token);
    assert!(matches!(beyond, Err(BatchError::Integrate { index: 0, source: IntegrateError::Argument(_) })));
    token.cancel();
    assert_eq!(recorded(&times, &token), Err(BatchError::Cancelled));
}

#[test]
fn long_runs_are_those_of_bodies_alone_and_end_when_they_are_cancelled() {
    let (bodies, states, _) = flight(3);
    // more steps than are made between two looks at the token, in company that ends early
    let grids =
        [70_000, 40_000, 10].map(|steps| TimeGrid::try_new(0.0, 1e-4 * f64::from(steps), 1e-4).unwrap());
    let ends = FreeRuns::new(&bodies, &grids).from(&states).unwrap();
    for i in 0..3 {
        let alone = FreeRuns::new(&bodies[i..=i], &grids[i..=i]).from(&states[i..=i]).unwrap();
        assert_eq!(ends[i], alone[0]);
        let exact = FreeBody::try_new(&bodies[i], &states[i]).unwrap();
        assert!(distance(&ends[i], &exact.at(grids[i].time(grids[i].steps())).unwrap()) < 1e-9, "{i}");
    }
    let token = CancellationToken::new();
    token.cancel();
    let cancelled = FreeRuns::new(&bodies, &grids).advance(&mut states.clone(), &token);
    assert_eq!(cancelled, Err(BatchError::Cancelled));
}

/// A sum of terms, evaluated as their documentation says.
#[derive(Clone)]
struct SumOfTerms(Vec<WrenchTerm>);

impl ForceModel for SumOfTerms {
    fn wrench(&self, _: f64, _: &RigidBody, x: &RigidBodyState) -> Wrench {
        let mut sum = Wrench::default();
        let (r, v, q, omega) = (x.position(), x.velocity(), x.orientation(), x.angular_velocity());
        for term in &self.0 {
            let (force, torque) = match *term {
                WrenchTerm::Force(force) => (force, Vector3::zeros()),
                WrenchTerm::ForceAtPoint { force, point } => (force, (q * point).cross(&force)),
                WrenchTerm::Thrust(force) => (q * force, Vector3::zeros()),
                WrenchTerm::LinearForce { position, velocity } => {
                    (position * r + velocity * v, Vector3::zeros())
                }
                WrenchTerm::CentralForce { centre, point, strength, power, is_damper } => {
                    let arm = q * point;
                    let way = r + arm - centre;
                    let rate = if is_damper { way.dot(&(v + omega.cross(&arm))) } else { 1.0 };
                    let force = way * (strength * way.norm().powf(power) * rate);
                    (force, arm.cross(&force))
                }
                WrenchTerm::QuadraticDrag(c) => (v * (c * v.norm()), Vector3::zeros()),
                WrenchTerm::Torque(torque) => (Vector3::zeros(), q * torque),
                WrenchTerm::WorldTorque(torque) => (Vector3::zeros(), torque),
                WrenchTerm::AngularDrag(c) => (Vector3::zeros(), omega * c),
                WrenchTerm::Support { normal, offset, point, stiffness, damping } => {
                    let arm = q * point;
                    let (place, rate) = (r + arm, v + omega.cross(&arm));
                    let force =
                        normal * (stiffness * (offset - normal.dot(&place)) - damping * normal.dot(&rate));
                    (force, arm.cross(&force))
                }
                _ => unreachable!("a term without a meaning here"),
            };
            sum.force += force;
            sum.torque += torque;
        }
        sum
    }
}

/// Up to five terms of any kind, with centres a few metres away.
fn random_terms(random: &mut Random) -> Vec<WrenchTerm> {
    let matrix = |random: &mut Random| Matrix3::from_fn(|_, _| random.within(-0.5, 0.5));
    let term = |random: &mut Random| match random.below(10) {
        0 => WrenchTerm::Force(random.vector(3.0)),
        1 => WrenchTerm::ForceAtPoint { force: random.vector(2.0), point: random.vector(0.5) },
        2 => WrenchTerm::Thrust(random.vector(2.0)),
        3 => WrenchTerm::LinearForce { position: matrix(random), velocity: matrix(random) },
        4 => WrenchTerm::QuadraticDrag(random.within(-0.3, 0.0)),
        5 => WrenchTerm::Torque(random.vector(1.0)),
        6 => WrenchTerm::WorldTorque(random.vector(1.0)),
        7 => WrenchTerm::AngularDrag(random.within(-0.5, 0.0)),
        8 => WrenchTerm::Support {
            normal: random.rotation() * Vector3::z(),
            offset: random.within(-1.0, 1.0),
            point: random.vector(0.5),
            stiffness: random.within(0.0, 5.0),
            damping: random.within(0.0, 0.5),
        },
        _ => WrenchTerm::CentralForce {
            centre: random.rotation() * Vector3::x() * 6.0,
            point: random.vector(0.5) * random.below(2) as f64,
            strength: random.within(-2.0, 0.0),
            power: -(random.below(4) as f64),
            is_damper: random.below(2) == 0,
        },
    };
    (0..random.below(6)).map(|_| term(random)).collect()
}

/// Bodies in flight under terms of all kinds, some under none.
fn forced_flight(n: usize) -> (Vec<RigidBody>, Vec<RigidBodyState>, Vec<TimeGrid>, Vec<Vec<WrenchTerm>>) {
    let (bodies, states, grids) = flight(n);
    let mut random = Random::new(5);
    let terms = (0..n).map(|_| random_terms(&mut random)).collect();
    (bodies, states, grids, terms)
}

#[test]
fn forced_bodies_agree_with_rkmk_b_to_rounding() {
    let (bodies, states, grids, terms) = forced_flight(300);
    let system = |(body, terms): (&RigidBody, &Vec<WrenchTerm>)| under(*body, SumOfTerms(terms.clone()));
    let systems: Vec<_> = bodies.iter().zip(&terms).map(system).collect();
    let outcomes = Runs::new(&systems, Method::RkmkB, &grids).from(&states).unwrap();
    let ends = ForcedRuns::try_new(&bodies, &grids, &terms).unwrap().from(&states).unwrap();
    for (i, (end, outcome)) in ends.iter().zip(&outcomes).enumerate() {
        let gap = distance(end, &outcome.state);
        assert!(gap < 1e-11, "{i}: {gap:e} {:?}", terms[i]);
    }
}

#[test]
fn forced_bodies_have_the_same_bits_in_any_company_and_by_any_instructions() {
    let (bodies, states, grids, terms) = forced_flight(130);
    let runs = ForcedRuns::try_new(&bodies, &grids, &terms).unwrap();
    let token = CancellationToken::new();
    let ends = runs.from(&states).unwrap();
    for set in InstructionSet::supported() {
        let mut moved = states.clone();
        runs.advance_with(set, &mut moved, &token).unwrap();
        assert_eq!(moved, ends, "{}", set.name());
    }
    for i in 0..bodies.len() {
        let alone = ForcedRuns::try_new(&bodies[i..=i], &grids[i..=i], &terms[i..=i]).unwrap();
        assert_eq!(alone.from(&states[i..=i]).unwrap()[0], ends[i], "{i}");
    }
}

#[test]
fn forced_runs_refuse_what_they_cannot_move() {
    let (bodies, states, grids, mut terms) = forced_flight(70);
    let short = ForcedRuns::try_new(&bodies, &grids, &terms[1..]).unwrap_err();
    assert_eq!(short, BatchError::Length { argument: "terms", expected: 70, found: 69 });
    let towards = |centre, power| WrenchTerm::CentralForce {
        centre,
        point: Vector3::zeros(),
        strength: -1.0,
        power,
        is_damper: false,
    };
    terms[69].push(towards(Vector3::zeros(), 1.0));
    let refused = ForcedRuns::try_new(&bodies, &grids, &terms).unwrap_err();
    assert_eq!(refused, BatchError::Power { body: 69, found: 1.0 });
    // at the centre itself a spring has no direction and exerts no force there, and an attraction has no bound
    terms[69] = vec![towards(states[69].position().to_owned(), -1.0)];
    assert!(ForcedRuns::try_new(&bodies, &grids, &terms).unwrap().from(&states).is_ok());
    terms[69] = vec![towards(states[69].position().to_owned(), -3.0)];
    let runs = ForcedRuns::try_new(&bodies, &grids, &terms).unwrap();
    assert_eq!(runs.from(&states), Err(BatchError::Diverged { body: 69 }));
    let token = CancellationToken::new();
    token.cancel();
    assert_eq!(runs.advance(&mut states.clone(), &token), Err(BatchError::Cancelled));
}

#[test]
fn adapted_bodies_are_as_accurate_as_one_at_a_time() {
    let (bodies, states, _, terms) = forced_flight(200);
    let (interval, times) = ((0.0, 2.0), [0.7, 0.75, 2.0]);
    let settings = Adaptive::with_tolerances(1e-9, 1e-9);
    let runs = AdaptedRuns::try_new(&bodies, interval, settings, &terms).unwrap();
    let found = runs.recorded(&states, &times, &CancellationToken::new()).unwrap();
    let (mut sum, mut sum_alone) = (0.0, 0.0);
    for i in 0..bodies.len() {
        let system = under(bodies[i], SumOfTerms(terms[i].clone()));
        let recorded = |tolerance| {
            let steps = Steps::adapted(interval, Adaptive::with_tolerances(tolerance, tolerance));
            let mut recorder = Recorder::at_times(interval, &states[i], times.into()).unwrap();
            Run::new(&system, Method::Rkmk8B, steps).observed_by(&mut recorder).from(&states[i]).unwrap();
            recorder.into_solution().states
        };
        let (fine, alone) = (recorded(1e-13), recorded(1e-9));
        for k in 0..times.len() {
            let gap = distance(&found[i][k], &fine[k]);
            assert!(gap < 1e-7, "{i} at {}: {gap:e} {:?}", times[k], terms[i]);
        }
        sum += distance(&found[i][2], &fine[2]).ln();
        sum_alone += distance(&alone[2], &fine[2]).max(1e-13).ln();
    }
    // in the geometric mean; steps that end at the times are shorter
    let ratio = ((sum - sum_alone) / bodies.len() as f64).exp();
    assert!((0.2..1.5).contains(&ratio), "{ratio}");
}

#[test]
fn adapted_bodies_have_the_same_bits_in_any_company_and_by_any_instructions() {
    let (bodies, states, _, terms) = forced_flight(130);
    let (interval, times, token) = ((0.5, 1.5), [0.5, 1.0, 1.2], CancellationToken::new());
    let settings = Adaptive::with_tolerances(1e-7, 1e-8);
    let runs = AdaptedRuns::try_new(&bodies, interval, settings, &terms).unwrap();
    let found = runs.recorded(&states, &times, &token).unwrap();
    for set in InstructionSet::supported() {
        assert_eq!(runs.recorded_with(set, &states, &times, &token).unwrap(), found, "{}", set.name());
    }
    for i in 0..bodies.len() {
        assert_eq!(found[i][0], states[i]);
        let alone = AdaptedRuns::try_new(&bodies[i..=i], interval, settings, &terms[i..=i]).unwrap();
        assert_eq!(alone.recorded(&states[i..=i], &times, &token).unwrap()[0], found[i], "{i}");
    }
}

/// A turn of more than a radian in a step takes the closed form of the correction for rotations that do not commute.
#[test]
fn free_bodies_are_adapted_as_exactly_as_the_tolerance_is_small() {
    let (bodies, states, _) = flight(70);
    let terms = vec![Vec::new(); 70];
    let errors = [1e-3, 1e-6, 1e-9, 1e-12].map(|tolerance| {
        let settings = Adaptive::with_tolerances(tolerance, tolerance);
        let runs = AdaptedRuns::try_new(&bodies, (0.0, 20.0), settings, &terms).unwrap();
        let found = runs.recorded(&states, &[20.0], &CancellationToken::new()).unwrap();
        let exact = |i: usize| FreeBody::try_new(&bodies[i], &states[i]).unwrap().at(20.0).unwrap();
        let error = |i: usize| so3::angle_between(found[i][0].orientation(), exact(i).orientation());
        (0..70).map(error).fold(0.0, f64::max) / tolerance
    });
    assert!(errors.iter().all(|error| (0.1..300.0).contains(error)), "{errors:?}");
}

#[test]
fn adapted_runs_refuse_what_they_cannot_move() {
    let (bodies, mut states, _, terms) = forced_flight(70);
    let (settings, token) = (Adaptive::with_tolerances(1e-6, 1e-6), CancellationToken::new());
    let runs = |interval, settings| AdaptedRuns::try_new(&bodies, interval, settings, &terms);
    assert!(matches!(runs((1.0, 0.0), settings), Err(BatchError::Integrate { .. })));
    let few = runs((0.0, 1.0), Adaptive { max_steps: 3, max_step: 0.01, ..settings }).unwrap();
    let spent = few.recorded(&states, &[1.0], &token).unwrap_err();
    let is_spent = |error: &BatchError| {
        matches!(
            error,
            BatchError::Integrate { index: 0, source: IntegrateError::Budget { max_steps: 3, .. } }
        )
    };
    assert!(is_spent(&spent), "{spent}");
    let all = runs((0.0, 1.0), settings).unwrap();
    assert!(matches!(all.recorded(&states, &[1.5], &token), Err(BatchError::Integrate { .. })));
    let short = all.recorded(&states[1..], &[1.0], &token);
    assert_eq!(short, Err(BatchError::Length { argument: "states", expected: 70, found: 69 }));
    states[68].rate.linear.x = f64::NAN;
    let unknown = all.recorded(&states, &[1.0], &token).unwrap_err();
    let is_unknown = |error: &BatchError| {
        matches!(error, BatchError::Integrate { index: 68, source: IntegrateError::InitialState { .. } })
    };
    assert!(is_unknown(&unknown), "{unknown}");
    // drawn to the centre that it is at, a body has no force, and the others go on
    states[68].rate.linear.x = 0.0;
    let mut terms = terms.clone();
    terms[68] = vec![WrenchTerm::CentralForce {
        centre: *states[68].position(),
        point: Vector3::zeros(),
        strength: -1.0,
        power: -3.0,
        is_damper: false,
    }];
    let drawn = AdaptedRuns::try_new(&bodies, (0.0, 1.0), settings, &terms).unwrap();
    let error = drawn.recorded(&states, &[1.0], &token).unwrap_err();
    assert!(matches!(error, BatchError::Integrate { index: 68, .. }), "{error}");
    token.cancel();
    assert_eq!(all.recorded(&states, &[1.0], &token), Err(BatchError::Cancelled));
}

/// Lists of forces that are no sums of terms: none, on a satellite, by schedules, of wheels, and of a user.
fn other_forces() -> Vec<Vec<BoxedForce>> {
    let elements =
        Elements { eccentricity: 0.3, inclination: 0.7, mean_anomaly: 0.2, ..Elements::circle(2.0, 1.5) };
    let orbit = Orbit::try_new(elements).unwrap();
    let field = Field::Dipole { orbit, strength: Vector3::new(0.1, -0.2, 0.5) };
    let dipole = MagneticDipole { moment: Vector3::new(0.3, 0.1, -0.2), field };
    let plate = Plate::try_new(0.5, Vector3::y(), Vector3::new(0.1, 0.4, 0.2), 0.2, 0.1).unwrap();
    let drag = AerodynamicDrag::try_new(orbit, vec![plate], 0.3, 2.2).unwrap();
    // the fixed steps of no body end at these times, so that their order falls there, one at a time and in lanes alike
    let schedule = |a: f64| LinearSchedule::try_new(vec![0.2, 0.9, 1.7], vec![0.1 * a, a, -0.5 * a]).unwrap();
    let torque = |is_in_body| ScheduledTorque {
        components: [schedule(0.4), schedule(-0.3), schedule(0.2)],
        is_in_body,
    };
    let wheel = ReactionWheel::try_new(Vector3::z(), 0.05, 3.0, schedule(0.1)).unwrap();
    let wind = |t: f64, body: &RigidBody, x: &RigidBodyState| Wrench {
        force: (Vector3::new((3.0 * t).sin(), 1.0, 0.0) - x.velocity()) * (0.2 * body.mass()),
        torque: x.orientation() * Vector3::new(0.0, 0.1, 0.0) - x.angular_velocity() * 0.05,
    };
    vec![
        Vec::new(),
        vec![Box::new(GravityGradient { orbit })],
        vec![Box::new(dipole), Box::new(drag)],
        vec![Box::new(torque(true)), Box::new(torque(false))],
        vec![Box::new(Rotors(ReactionWheels(vec![wheel]))), Box::new(wind)],
    ]
}

/// What a run takes of such lists.
fn as_forces(lists: &[Vec<BoxedForce>]) -> Vec<Vec<&(dyn ForceModel + Sync)>> {
    fn of(force: &BoxedForce) -> &(dyn ForceModel + Sync) {
        &**force
    }
    lists.iter().map(|list| list.iter().map(of).collect()).collect()
}

/// Which list acts on a body: neighbours under the same one, and under different ones.
fn list_of(i: usize) -> usize {
    if i < 150 { i / 30 } else { i % 5 }
}

#[test]
fn forces_that_are_no_sums_of_terms_act_in_lanes_as_one_at_a_time() {
    let (bodies, states, grids, terms) = forced_flight(200);
    let (lists, mut acting) = (other_forces(), Vec::new());
    for i in 0..bodies.len() {
        let mut of_body = other_forces().swap_remove(list_of(i));
        of_body.push(Box::new(SumOfTerms(terms[i].clone())));
        acting.push(RigidBodySystem::new(bodies[i], of_body));
    }
    let refs = as_forces(&lists);
    let forces: Vec<Forces> = (0..bodies.len()).map(|i| &refs[list_of(i)][..]).collect();

    let outcomes = Runs::new(&acting, Method::RkmkB, &grids).from(&states).unwrap();
    let runs = ForcedRuns::try_new(&bodies, &grids, &terms).unwrap().with_forces(&forces).unwrap();
    let ends = runs.from(&states).unwrap();
    for (i, (end, outcome)) in ends.iter().zip(&outcomes).enumerate() {
        let gap = distance(end, &outcome.state);
        assert!(gap < 1e-11, "{i}: {gap:e} {:?}", terms[i]);
    }
    let token = CancellationToken::new();
    for set in InstructionSet::supported() {
        let mut moved = states.clone();
        runs.advance_with(set, &mut moved, &token).unwrap();
        assert_eq!(moved, ends, "{}", set.name());
    }
    for i in (0..bodies.len()).step_by(7) {
        let alone = ForcedRuns::try_new(&bodies[i..=i], &grids[i..=i], &terms[i..=i]).unwrap();
        let alone = alone.with_forces(&forces[i..=i]).unwrap();
        assert_eq!(alone.from(&states[i..=i]).unwrap()[0], ends[i], "{i}");
    }

    let (interval, times) = ((0.1, 2.0), [0.7, 2.0]);
    let settings = Adaptive::with_tolerances(1e-9, 1e-9);
    let runs = AdaptedRuns::try_new(&bodies, interval, settings, &terms).unwrap();
    let runs = runs.with_forces(&forces).unwrap();
    let found = runs.recorded(&states, &times, &token).unwrap();
    let mut logarithms = 0.0;
    for i in 0..bodies.len() {
        let end = |tolerance| {
            let steps = Steps::adapted(interval, Adaptive::with_tolerances(tolerance, tolerance));
            Run::new(&acting[i], Method::Rkmk8B, steps).from(&states[i]).unwrap().state
        };
        let fine = end(1e-12);
        let (gap, of_one) = (distance(&found[i][1], &fine), distance(&end(1e-9), &fine));
        // the kink where a plate turns into the wind costs both digits
        let bound = if list_of(i) == 2 { 2e-6 } else { 1e-7 };
        assert!(gap < bound, "{i}: {gap:e} {:?}", terms[i]);
        logarithms += (gap.max(1e-13) / of_one.max(1e-13)).ln();
    }
    let ratio = (logarithms / bodies.len() as f64).exp();
    assert!((0.2..1.5).contains(&ratio), "{ratio}");
    for set in InstructionSet::supported() {
        assert_eq!(runs.recorded_with(set, &states, &times, &token).unwrap(), found, "{}", set.name());
    }
}

/// About a principal axis the angular momentum grows by the integral of the torque. A pulse is short beside the steps before it: alone, back
/// from there, and in a batch.
#[test]
fn no_pulse_of_a_schedule_is_stepped_over() {
    let (mut random, end) = (Random::new(20), 40.0);
    let inertia = Inertia::try_principal(Vector3::new(1.0, 1.5, 2.0)).unwrap();
    let body = RigidBody::try_new(1.0, inertia).unwrap();
    let state = RigidBodyState::spinning(Vector3::z());
    for i in 0..200 {
        let (begin, width) = (random.within(1.0, 30.0), 10f64.powf(random.within(-3.0, 0.5)));
        let torque = random.within(0.5, 2.0);
        let times: Vec<f64> = [0.0, 0.3, 0.6, 1.0].map(|part| begin + part * width).into();
        let pulse = LinearSchedule::try_new(times, vec![0.0, torque, torque, 0.0]).unwrap();
        let spin = 1.0 + pulse.integral(end) / 2.0;
        let none = LinearSchedule::constant(0.0);
        let components = [none.clone(), none, pulse];
        let force = ScheduledTorque { components, is_in_body: random.below(2) == 1 };
        let tolerance = 10f64.powf(random.within(-10.0, -4.0));
        let settings = Adaptive::with_tolerances(tolerance, tolerance);

        let system = under(body, force.clone());
        let steps = Steps::adapted((0.0, end), settings);
        let out = Run::new(&system, Method::Rkmk8B, steps).from(&state).unwrap().state;
        let system = under(body, TimeReversed(force.clone()));
        let steps = Steps::adapted((-end, 0.0), settings);
        let home = Run::new(&system, Method::Rkmk8B, steps).from(&reversed(&out)).unwrap().state;
        let (bodies, terms, acting): (_, _, [&(dyn ForceModel + Sync); 1]) = ([body], [Vec::new()], [&force]);
        let runs = AdaptedRuns::try_new(&bodies, (0.0, end), settings, &terms).unwrap();
        let forces = [&acting[..]];
        let runs = runs.with_forces(&forces).unwrap();
        let in_batch = runs.recorded(&[state], &[end], &CancellationToken::new()).unwrap()[0][0];
        for (x, expected) in [(&out, spin), (&in_batch, spin), (&home, -1.0)] {
            let error = (x.angular_velocity().z - expected).abs();
            assert!(error < 30.0 * tolerance, "{i}: {error:e} at {tolerance:e}");
        }
    }
}

#[test]
fn forces_beside_terms_are_as_many_as_bodies() {
    let (bodies, _, grids, terms) = forced_flight(3);
    let refused = BatchError::Length { argument: "forces", expected: 3, found: 2 };
    let runs = ForcedRuns::try_new(&bodies, &grids, &terms).unwrap();
    assert_eq!(runs.with_forces(&[&[], &[]]).err(), Some(refused.clone()));
    let settings = Adaptive::with_tolerances(1e-6, 1e-6);
    let runs = AdaptedRuns::try_new(&bodies, (0.0, 1.0), settings, &terms).unwrap();
    assert_eq!(runs.with_forces(&[&[], &[]]).err(), Some(refused));
}
