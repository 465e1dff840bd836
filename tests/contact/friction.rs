//! Friction: stick and slip, creep, the smooth law, rolling and spinning resistance, against closed forms.

use nalgebra::Vector3;
use somersault_contact::ContactError;
use somersault_contact::contacts::{BodyInContact, Contact, Contacts};
use somersault_contact::driver::{integrate_hybrid, integrate_located};
use somersault_contact::event::{EventKind, Located, Location};
use somersault_contact::friction::{
    CoulombFriction, CreepFriction, Friction, RegularisedFriction, Resistance,
};
use somersault_contact::hybrid::Frozen;
use somersault_contact::interface::{ContactLaw, ContactMode, Encounter};
use somersault_contact::law::CompliantLaw;
use somersault_contact::models::SlidingBlock;
use somersault_contact::surface::{HalfSpace, Solid, Sphere};
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::{Flow, Observer, Step, TimeGrid};
use somersault_integrators::force::Gravity;
use somersault_integrators::methods::{Method, Options, RungeKuttaMuntheKaas4};
use somersault_integrators::state::{Pose, RigidBodyState};
use somersault_testkit::bouncing_ball;
use somersault_testkit::order::slope;
use somersault_testkit::trees::Random;
use std::sync::Arc;

type System = BodyInContact<Gravity>;

const GRAVITY: f64 = 9.81;

/// A run by the classic method of order 4 on the group, in world axes.
fn run(system: &System, start: &RigidBodyState, end: f64, dt: f64) -> Located<Pose> {
    run_and_mode(system, start, end, dt, &mut ()).0
}

fn run_and_mode(
    system: &System,
    start: &RigidBodyState,
    end: f64,
    dt: f64,
    observer: &mut impl Observer<Pose>,
) -> (Located<Pose>, Vec<ContactMode>) {
    let frozen = Frozen::new(system.clone(), 0.0, start);
    let grid = TimeGrid::try_new(0.0, end, dt).unwrap();
    let stepper = RungeKuttaMuntheKaas4;
    let run = integrate_hybrid(&frozen, &stepper, start, &grid, &Location::as_given(), observer).unwrap();
    (run, frozen.mode())
}

fn kinds(run: &Located<Pose>) -> Vec<EventKind> {
    run.events.iter().map(|e| e.kind).collect()
}

fn block(law: CompliantLaw, friction: CoulombFriction) -> SlidingBlock {
    SlidingBlock::try_new(1.0, Vector3::new(0.2, 0.1, 0.06), law, friction).unwrap()
}

fn stiff() -> CompliantLaw {
    CompliantLaw::try_new(2e4, 50.0).unwrap()
}

fn coulomb(coefficient: f64, stiffness: f64, damping: f64) -> CoulombFriction {
    CoulombFriction::try_new(coefficient, stiffness, damping).unwrap()
}

// ---------------------------------------------------------------------------------------- stick and slip

#[test]
fn a_sliding_block_stops_at_the_right_place_and_time_and_stays() {
    let block = block(stiff(), coulomb(0.4, 1e4, 20.0));
    let (run, mode) = run_and_mode(&block.system, &block.sliding(3.0), 1.0, 0.01, &mut ());
    let (time, way) = (3.0 / (0.4 * GRAVITY), 9.0 / (2.0 * 0.4 * GRAVITY));
    assert_eq!(kinds(&run), [EventKind::Stick]);
    assert!((run.events[0].t - time).abs() < 1e-14, "{:e}", run.events[0].t - time);
    assert!((run.state.position().x - way).abs() < 1e-13, "{:e}", run.state.position().x - way);
    assert!(run.state.velocity().norm() < 1e-13, "{:e}", run.state.velocity().norm());
    assert!(matches!(mode[0], ContactMode::Stick { .. }));
}

const BOUNCE: bouncing_ball::BouncingBall =
    bouncing_ball::BouncingBall { mass: 1.0, stiffness: 400.0, damping: 4.0, gravity: GRAVITY };
const DROP: bouncing_ball::Motion = bouncing_ball::Motion { x: 0.1, v: 0.0 };
const THROW: f64 = 1.5;
const MU: f64 = 0.3;

/// x and v of the bouncing block before it stops, from the closed form of its height.
fn slide(t: f64) -> (f64, f64) {
    let (z, _) = BOUNCE.run(DROP, t);
    let way = THROW * t - MU * (0.5 * GRAVITY * t * t + z.x - DROP.x - DROP.v * t);
    (way, THROW - MU * (GRAVITY * t + z.v - DROP.v))
}

/// Time and place of the stop.
fn bounced_stop() -> (f64, f64) {
    let (mut near, mut far) = (0.0, 2.0);
    for _ in 0..100 {
        let middle = 0.5 * (near + far);
        if slide(middle).1 > 0.0 { near = middle } else { far = middle }
    }
    (far, slide(far).0)
}

#[test]
fn every_method_keeps_its_order_to_the_stop_of_a_block_that_bounces_while_it_slides() {
    const END: f64 = 0.7;
    let (time, place) = bounced_stop();
    let (height, switches) = BOUNCE.run(DROP, END);
    assert!((0.5..0.7).contains(&time) && switches.len() == 3, "{time} {switches:?}");
    let law = CompliantLaw::try_new(BOUNCE.stiffness, BOUNCE.damping).unwrap();
    let block = block(law, coulomb(MU, 400.0, 40.0));
    let start = block.at(DROP.x, Vector3::new(THROW, 0.0, 0.0));
    let location = Location::as_given();
    for method in Method::ALL {
        let order = f64::from(method.info().orders.translation_with_velocity);
        let bases: [u32; 6] =
            if order > 4.0 { [10, 14, 20, 28, 40, 80] } else { [50, 100, 200, 400, 800, 1600] };
        let mut points = Vec::new();
        for base in bases {
            let mut sum = 0.0;
            for i in 0..5 {
                let n = base + base * i / 10;
                let grid = TimeGrid::try_with_steps(0.0, END, n.into()).unwrap();
                let run = integrate_located(
                    method,
                    Options::default(),
                    &block.system,
                    &start,
                    &grid,
                    &location,
                    &mut (),
                )
                .unwrap();
                let stops: Vec<_> = run.events.iter().filter(|e| e.kind == EventKind::Stick).collect();
                if run.events.len() != 4 || stops.len() != 1 {
                    sum = f64::NAN;
                    break;
                }
                let x = &run.state;
                sum +=
                    (stops[0].t - time).powi(2) + (x.position().x - place).powi(2) + x.velocity().x.powi(2);
                sum += (x.position().z - 0.03 - height.x).powi(2) + (x.velocity().z - height.v).powi(2);
            }
            let error = (sum / 5.0).sqrt();
            if error > if order > 4.0 { 1e-13 } else { 3e-12 } {
                points.push((END / f64::from(base), error));
            }
        }
        let last = &points[points.len().saturating_sub(4)..];
        let found = slope(last);
        println!("{method:10} order {order} found {found:.2} {:.1e}", last.last().unwrap().1);
        assert!((found - order).abs() < 0.4, "{method}: {found} {points:?}");
    }
}

#[test]
fn stick_and_slip_alternate_as_in_closed_form_and_do_not_chatter() {
    // On a slope of tan α < μ, released with the spring unstretched and undamped, the load swings to twice
    // its value and breaks loose, slides to a stop, and so on.
    let (angle, mu, k) = (0.3f64, 0.4, 900.0);
    let block = block(stiff(), coulomb(mu, k, 0.0)).on_slope(angle);
    let (load, hold) = (GRAVITY * angle.sin(), mu * GRAVITY * angle.cos());
    let w = k.sqrt();
    let loose = (1.0 - hold / load).acos() / w;
    let speed = load / w * (w * loose).sin();
    let slides = speed / (hold - load);
    let (run, _) = run_and_mode(&block.system, &block.sliding(0.0), 2.0, 2e-4, &mut ());
    let cycle = loose + slides;
    assert_eq!(run.events.len(), 2 * (2.0 / cycle) as usize + usize::from(2.0 % cycle > loose));
    for (i, pair) in run.events.chunks(2).enumerate() {
        let begin = i as f64 * cycle;
        assert!(pair[0].kind == EventKind::Slip && (pair[0].t - begin - loose).abs() < 1e-9, "{i}");
        if let Some(stop) = pair.get(1) {
            assert!(stop.kind == EventKind::Stick && (stop.t - begin - cycle).abs() < 1e-9, "{i}");
            let way = (i + 1) as f64 * (hold / k + 0.5 * speed * slides);
            assert!((stop.state.position().x - way).abs() < 1e-9, "{i}");
        }
    }
    assert!(run.events.len() > 8, "{}", run.events.len());
}

#[test]
fn critical_damping_holds_a_block_up_to_a_load_of_the_cone_over_one_and_e_to_the_minus_two() {
    // From rest k ξ + c ξ̇ = L − m ξ̈ swings up to (1 + e⁻²) L, at ω t = 2.
    let (mu, k) = (0.5f64, 1e4f64);
    let steepest = (mu / (1.0 + (-2.0f64).exp())).atan();
    for (angle, holds) in [(0.1, true), (0.3, true), (steepest - 1e-6, true), (steepest + 1e-6, false)] {
        let block = block(stiff(), coulomb(mu, k, 2.0 * k.sqrt())).on_slope(angle);
        let run = run(&block.system, &block.sliding(0.0), 1.0, 2e-4);
        if holds {
            let stretch = GRAVITY * angle.sin() / k;
            assert!(run.events.is_empty(), "{angle}: {:?}", kinds(&run));
            assert!((run.state.position().x - stretch).abs() < 1e-13, "{angle}: {:?}", run.state.position());
        } else {
            assert_eq!(run.events[0].kind, EventKind::Slip);
            assert!((run.events[0].t - 2.0 / k.sqrt()).abs() < 2e-4, "{}", run.events[0].t);
        }
    }
}

/// A block on a slope of tan α = μ, thrown at `angle` from the downhill direction.
fn oblique(angle: f64) -> (SlidingBlock, RigidBodyState) {
    let mu = 0.3f64;
    let law = CompliantLaw::try_new(400.0, 40.0).unwrap();
    let block = block(law, coulomb(mu, 1e4, 200.0)).on_slope(mu.atan());
    let mut start = block.sliding(0.0);
    start.rate.linear = Vector3::new(2.0 * angle.cos(), 2.0 * angle.sin(), 0.0);
    (block, start)
}

#[test]
fn sliding_that_turns_keeps_the_order_and_its_constant() {
    // With tan α = μ the speed changes as −(1 − cos φ) and v (1 + cos φ) = v + v_x is constant.
    let (block, start) = oblique(2.6);
    let constant = |x: &RigidBodyState| x.velocity().norm() + x.velocity().x;
    let mut points = Vec::new();
    for n in [50, 100, 200, 400] {
        let run = run(&block.system, &start, 1.5, 1.5 / f64::from(n));
        assert_eq!(kinds(&run), [EventKind::Turn; 2]);
        points.push((1.5 / f64::from(n), (constant(&run.state) - constant(&start)).abs()));
    }
    assert!((slope(&points) - 4.0).abs() < 0.4, "{} {points:?}", slope(&points));
}

#[test]
fn a_stop_at_the_end_of_a_curve_costs_order() {
    // With f = μ g cos α and s = g sin α, v (f + s cos φ) falls by f² − s² a second. The direction turns
    // as φ ~ v^p with p = s/(f − s) on the way to the stop.
    for (angle, mu) in [(0.1f64, 0.3f64), (0.2, 0.3)] {
        let (f, s) = (mu * GRAVITY * angle.cos(), GRAVITY * angle.sin());
        let law = CompliantLaw::try_new(400.0, 40.0).unwrap();
        let block = block(law, coulomb(mu, 1e4, 200.0)).on_slope(angle);
        let mut start = block.sliding(0.0);
        start.rate.linear = Vector3::new(1.2 * 2.0f64.cos(), 1.2 * 2.0f64.sin(), 0.0);
        let time = 1.2 * (f + s * 2.0f64.cos()) / (f * f - s * s);
        let points: Vec<_> = [100, 200, 400, 800, 1600, 3200]
            .into_iter()
            .map(|n| {
                let mut sum = 0.0;
                for i in 0..6 {
                    let h = 1.5 * time / f64::from(n + n * i / 12);
                    let run = run(&block.system, &start, 1.5 * time, h);
                    let stop = run.events.iter().find(|e| e.kind == EventKind::Stick).unwrap();
                    sum += (stop.t - time).powi(2);
                }
                (1.5 * time / f64::from(n), (sum / 6.0f64).sqrt())
            })
            .collect();
        println!("p = {:.2}: {:.2} {points:?}", s / (f - s), slope(&points));
        assert!((0.9..3.5).contains(&slope(&points)), "{angle}: {points:?}");
        assert!(points[5].1 < 2e-5, "{angle}: {points:?}");
    }
}

// --------------------------------------------------------------------------------------- rolling and spin

/// A solid ball of 1 kg and radius 0.1 m resting on its spring, with its law.
fn ball(friction: impl Into<Friction>, resistance: Resistance) -> (System, RigidBodyState) {
    let inertia = somersault_core::Inertia::try_sphere(1.0, 0.1).unwrap();
    let law = ContactLaw::from(stiff()).with_friction(friction).with_resistance(resistance);
    let ground = Arc::new(HalfSpace::ground());
    let contact = Contact::try_ball(Vector3::zeros(), 0.1, ground, law).unwrap();
    let body = RigidBody::try_new(1.0, inertia).unwrap();
    let mut start = RigidBodyState::default();
    start.configuration.position.z = 0.1 - GRAVITY / stiff().stiffness();
    (BodyInContact::new(body, (Gravity::earth(), Contacts::new(vec![contact]))), start)
}

#[test]
fn a_ball_that_slides_comes_to_roll_with_five_sevenths_of_its_speed() {
    let (mu, c, throw) = (0.2, 50.0, 1.4);
    let (system, mut start) = ball(CreepFriction::try_new(mu, c).unwrap(), Resistance::default());
    start.rate.linear.x = throw;
    let bound = mu * GRAVITY / c;
    let time = (throw - bound) / (3.5 * mu * GRAVITY);
    let run = run(&system, &start, 1.0, 1e-3);
    assert_eq!(kinds(&run), [EventKind::Stick]);
    assert!((run.events[0].t - time).abs() < 1e-13);
    // Afterwards the sliding velocity u decays as exp(−7/2 c t/m) and v̇ = −c u/m.
    let rate = 3.5 * c;
    let decay = (-rate * (1.0 - time)).exp();
    let speed = throw - mu * GRAVITY * time - c * bound / rate * (1.0 - decay);
    let way = throw * time - 0.5 * mu * GRAVITY * time * time + (throw - mu * GRAVITY * time) * (1.0 - time)
        - c * bound / rate * ((1.0 - time) - (1.0 - decay) / rate);
    assert!((run.state.velocity().x - speed).abs() < 1e-9, "{:e}", run.state.velocity().x - speed);
    assert!((run.state.position().x - way).abs() < 1e-9, "{:e}", run.state.position().x - way);
    assert!((run.state.velocity().x - 5.0 / 7.0 * throw).abs() < 1e-9);
    assert!((run.state.angular_velocity().y - run.state.velocity().x / 0.1).abs() < 1e-8);
}

#[test]
fn smooth_friction_slows_a_block_as_in_closed_form() {
    // v̇ = −μ g v/√(v² + ε²): √(v² + ε²) + ε ln(v/(ε + √(v² + ε²))) falls as μ g t.
    let (mu, scale) = (0.3, 0.05);
    let law = ContactLaw::from(stiff()).with_friction(RegularisedFriction::try_new(mu, scale).unwrap());
    let ground = Arc::new(HalfSpace::ground());
    let contact = Contact::try_new(Vector3::zeros(), ground, law).unwrap();
    let body = RigidBody::try_box(1.0, Vector3::repeat(0.1)).unwrap();
    let system = BodyInContact::new(body, (Gravity::earth(), Contacts::new(vec![contact])));
    let mut start = RigidBodyState::default();
    start.configuration.position.z = -GRAVITY / stiff().stiffness();
    start.rate.linear = Vector3::new(0.6, 0.8, 0.0);
    let left = |v: f64| {
        let s = v.hypot(scale);
        s + scale * (v / (scale + s)).ln()
    };
    let mut points = Vec::new();
    for n in [100, 200, 400, 800] {
        let run = run(&system, &start, 0.4, 0.4 / f64::from(n));
        assert!(run.events.is_empty());
        let v = run.state.velocity();
        assert!((v.y / v.x - 0.8 / 0.6).abs() < 1e-12);
        points.push((0.4 / f64::from(n), (left(1.0) - left(v.norm()) - mu * GRAVITY * 0.4).abs()));
    }
    assert!((slope(&points) - 4.0).abs() < 0.3, "{} {points:?}", slope(&points));
}

#[test]
fn a_spinning_ball_slows_as_in_closed_form() {
    let (arm, scale) = (2e-3, 0.5);
    let resistance = Resistance::try_new(0.0, arm, scale).unwrap();
    let (system, mut start) = ball(Friction::None, resistance);
    start.rate.angular.z = 10.0;
    // I ω̇ = −m g s ω/√(ω² + ε²), as in the block above.
    let torque = GRAVITY * arm / (0.4 * 0.01);
    let left = |v: f64| {
        let s = v.hypot(scale);
        s + scale * (v / (scale + s)).ln()
    };
    let run = run(&system, &start, 1.5, 1e-3);
    let spin = run.state.angular_velocity().z;
    assert!(spin > 0.3 && spin < 3.0, "{spin}");
    assert!((left(10.0) - left(spin) - torque * 1.5).abs() < 1e-9, "{spin}");
}

#[test]
fn rolling_resistance_slows_a_rolling_ball_by_five_sevenths_of_b_over_r() {
    // m v̇ = −c u, I ω̇ = c u r − m g b, u = v − r ω: u grows to its limit with the rate 7/2 c/m, and then
    // v̇ = −(5/7) g b/r.
    let (arm, damping) = (1e-3, 50.0);
    let resistance = Resistance::try_new(arm, 0.0, 1e-4).unwrap();
    let (system, mut start) = ball(CreepFriction::try_new(0.5, damping).unwrap(), resistance);
    (start.rate.linear.x, start.rate.angular.y) = (1.0, 10.0);
    let run = run(&system, &start, 1.0, 1e-3);
    let slowing = 5.0 / 7.0 * GRAVITY * arm / 0.1;
    let delay = 1.0 / (3.5 * damping);
    let speed = 1.0 - slowing * (1.0 - delay * (1.0 - (-1.0 / delay).exp()));
    assert!(run.events.is_empty());
    assert!((run.state.velocity().x - speed).abs() < 1e-9, "{:e}", run.state.velocity().x - speed);
}

// ------------------------------------------------------------------------------------------------ energy

#[test]
fn friction_and_resistance_never_give_energy() {
    let mut random = Random::new(7);
    let resistance = Resistance::try_new(0.01, 0.02, 0.1).unwrap();
    let laws = [
        Friction::None,
        RegularisedFriction::try_new(0.4, 0.1).unwrap().into(),
        coulomb(0.4, 100.0, 3.0).into(),
        CreepFriction::try_new(0.4, 10.0).unwrap().into(),
    ]
    .map(|friction| ContactLaw::from(stiff()).with_friction(friction).with_resistance(resistance));
    for case in 0..2000 {
        let normal = random.vector(1.0).normalize();
        let sliding = random.vector(1.0) * 10f64.powf(3.0 * random.within(-1.0, 1.0));
        let at = Encounter {
            gap: -0.01 * random.within(-1.0, 1.0).abs(),
            rate: -random.within(-1.0, 1.0).abs(),
            normal,
            point: random.vector(1.0),
            sliding: sliding - normal * normal.dot(&sliding),
            turning: random.vector(1.0),
            mass: 1.0,
        };
        for law in &laws {
            let mode = law.mode(&at);
            let effort = law.effort_in(&mode, &at);
            let push = law.normal.force_in_contact(at.gap, at.rate);
            let friction = effort.force - normal * push;
            let power = friction.dot(&at.sliding) + effort.torque.dot(&at.turning);
            let size = friction.norm() * at.sliding.norm();
            assert!(power <= 1e-12 * size, "case {case}: {law:?} {mode:?} {at:?} {power:e}");
            assert!(normal.dot(&friction).abs() <= 1e-12 * push, "case {case}: {law:?} {at:?}");
            let bound = 0.4 * push * (1.0 + 1e-12);
            assert!(friction.norm() <= bound, "case {case}: {law:?} {mode:?} {at:?}");
        }
    }
}

/// Watches the energy, that of the sticking springs included.
struct Energy<'a> {
    frozen: &'a Frozen<System>,
    growth: f64,
}

impl Observer<Pose> for Energy<'_> {
    fn observe(&mut self, step: &mut Step<'_, Pose>) -> Flow {
        let (system, mode) = (self.frozen.system(), self.frozen.mode());
        let energy = |x: &RigidBodyState| {
            system.body.kinetic_energy(x)
                - system.body.mass() * system.forces.0.acceleration.dot(x.position())
                + system.forces.1.energy_in(&mode, &system.body, x)
        };
        self.growth = self.growth.max(energy(step.after) - energy(step.before));
        Flow::Continue
    }
}

#[test]
fn the_energy_of_a_block_that_sticks_and_slips_never_grows() {
    let angle = 0.3;
    for damping in [0.0, 5.0, 60.0] {
        let block = block(stiff(), coulomb(0.4, 900.0, damping)).on_slope(angle);
        let start = block.at(0.05, Vector3::new(0.7, -0.4, 0.0));
        let frozen = Frozen::new(block.system.clone(), 0.0, &start);
        let grid = TimeGrid::try_new(0.0, 2.0, 2e-4).unwrap();
        let mut energy = Energy { frozen: &frozen, growth: 0.0 };
        let stepper = RungeKuttaMuntheKaas4;
        let location = Location::as_given();
        let run = integrate_hybrid(&frozen, &stepper, &start, &grid, &location, &mut energy).unwrap();
        println!("{damping}: {} events, growth {:e}", run.events.len(), energy.growth);
        assert!(energy.growth < 1e-13 && run.events.len() > 3, "{damping}: {:e}", energy.growth);
    }
}

// ----------------------------------------------------------------------------------------------- bad input

#[test]
fn friction_laws_and_rolling_shapes_refuse_bad_input() {
    use ContactError::{AnchorOnRolling, Direction, Negative, NonFinite, NotPositive};
    let coulomb = CoulombFriction::try_new;
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(coulomb(bad, 1.0, 0.0), Err(Negative { argument: "coefficient", .. })));
        assert!(matches!(coulomb(0.3, bad, 0.0), Err(NotPositive { argument: "stiffness", .. })));
        assert!(matches!(coulomb(0.3, 1.0, bad), Err(Negative { argument: "damping", .. })));
        let regularised = RegularisedFriction::try_new;
        assert!(matches!(regularised(bad, 1.0), Err(Negative { argument: "coefficient", .. })));
        assert!(matches!(regularised(0.3, bad), Err(NotPositive { argument: "speed", .. })));
        assert!(matches!(CreepFriction::try_new(bad, 1.0), Err(Negative { argument: "coefficient", .. })));
        assert!(matches!(CreepFriction::try_new(0.3, bad), Err(NotPositive { argument: "damping", .. })));
        assert!(matches!(Resistance::try_new(bad, 0.0, 1.0), Err(Negative { argument: "rolling", .. })));
        assert!(matches!(Resistance::try_new(0.0, bad, 1.0), Err(Negative { argument: "spinning", .. })));
        assert!(matches!(Resistance::try_new(0.0, 0.0, bad), Err(NotPositive { argument: "speed", .. })));
    }
    assert!(matches!(coulomb(0.3, 0.0, 0.0), Err(NotPositive { argument: "stiffness", .. })));
    let zero = Vector3::zeros();
    let bowl = Arc::new(Sphere::try_new(zero, 1.0, Solid::Outside).unwrap());
    let anchored = ContactLaw::from(stiff()).with_friction(coulomb(0.3, 1.0, 0.0).unwrap());
    let ball = |centre, radius, law| Contact::try_ball(centre, radius, bowl.clone(), law).map(|_| ());
    let plain = ContactLaw::from(stiff());
    assert_eq!(ball(zero, 0.1, anchored), Err(AnchorOnRolling));
    assert!(matches!(ball(zero, 0.0, plain), Err(NotPositive { argument: "radius", .. })));
    assert!(matches!(
        ball(Vector3::new(f64::NAN, 0.0, 0.0), 0.1, plain),
        Err(NonFinite { argument: "centre", .. })
    ));
    let rim = |axis, law| Contact::try_rim(zero, axis, 0.1, HalfSpace::ground(), law).map(|_| ());
    assert_eq!(rim(Vector3::z(), anchored), Err(AnchorOnRolling));
    assert!(matches!(rim(zero, plain), Err(Direction { argument: "axis", .. })));
}
