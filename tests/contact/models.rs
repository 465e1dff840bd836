//! Model bodies with friction: references, orders, what is conserved.

use nalgebra::{UnitQuaternion, Vector3};
use somersault_contact::contacts::BodyInContact;
use somersault_contact::event::EventKind;
use somersault_contact::laws::ContactLaw;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::laws::coulomb::CoulombFriction;
use somersault_contact::laws::regularised::RegularisedFriction;
use somersault_contact::models::{FallingBox, ModelError, RollingDisk, TippeTop};
use somersault_integrators::driver::{Flow, Observer, Step, TimeGrid};
use somersault_integrators::events::{Frozen, Located, Location};
use somersault_integrators::force::Gravity;
use somersault_integrators::methods::RungeKuttaMuntheKaas4;
use somersault_integrators::run::Run;
use somersault_integrators::state::{Pose, RigidBodyState};
use somersault_integrators::stepper::Stepper;
use somersault_testkit::order::slope;

type System = BodyInContact<Gravity>;

const GRAVITY: f64 = 9.81;

fn run_from<M: for<'a> Stepper<Frozen<'a, System>>>(
    stepper: &M,
    system: &System,
    start: &RigidBodyState,
    times: (f64, f64),
    dt: f64,
    observer: &mut impl Observer<Pose>,
) -> Located<Pose, EventKind> {
    let grid = TimeGrid::try_new(times.0, times.1, dt).unwrap();
    let run = Run::by_stepper(system, stepper, grid).locating(Location::as_given());
    run.observed_by(observer).from(start).unwrap()
}

fn run<M: for<'a> Stepper<Frozen<'a, System>>>(
    stepper: &M,
    system: &System,
    start: &RigidBodyState,
    end: f64,
    dt: f64,
) -> Located<Pose, EventKind> {
    run_from(stepper, system, start, (0.0, end), dt, &mut ())
}

fn kinds(run: &Located<Pose, EventKind>) -> Vec<EventKind> {
    run.events.iter().map(|e| e.kind).collect()
}

/// Kinetic energy, weight and the springs of the normal laws.
fn energy(system: &System, x: &RigidBodyState) -> f64 {
    let weight = -system.body.mass() * system.forces.0.acceleration.dot(x.position());
    system.body.kinetic_energy(x) + weight + system.forces.1.energy(x)
}

/// Watches a quantity: the most that it grows in a step.
struct Growth<'a> {
    quantity: &'a dyn Fn(&RigidBodyState) -> f64,
    most: f64,
}

impl Observer<Pose> for Growth<'_> {
    fn observe(&mut self, step: &mut Step<'_, Pose>) -> Flow {
        self.most = self.most.max((self.quantity)(step.after) - (self.quantity)(step.before));
        Flow::Continue
    }
}

// --------------------------------------------------------------------------------------------- tippe top

/// 0.02 kg, radius 0.02 m, α = 0.3, C = ⅖ m R², A = (131/350) m R²: A/C = 0.936 lies between 0.7 and 1.3.
fn tippe_top(damping_ratio: f64) -> TippeTop {
    let (mass, radius) = (0.02, 0.02);
    let inertia = mass * radius * radius;
    let law = CompliantLaw::from_frequency(mass, 1500.0, damping_ratio).unwrap();
    let friction = RegularisedFriction::try_new(0.3, 0.02).unwrap();
    let law = ContactLaw::from(law).with_friction(friction);
    TippeTop::try_new(mass, radius, 0.3, (131.0 / 350.0 * inertia, 0.4 * inertia), law).unwrap()
}

const SAG: f64 = GRAVITY / (1500.0 * 1500.0);

#[test]
fn a_tippe_top_above_the_threshold_turns_upside_down() {
    let top = tippe_top(0.5);
    let start = top.spinning(0.1, 180.0, SAG);
    let threshold = top.threshold().unwrap();
    assert!(top.jellett(&start) > 1.2 * threshold, "{} {threshold}", top.jellett(&start));
    let quantity = |x: &RigidBodyState| energy(&top.system, x);
    let mut growth = Growth { quantity: &quantity, most: 0.0 };
    let run = run_from(&RungeKuttaMuntheKaas4, &top.system, &start, (0.0, 6.0), 2e-4, &mut growth);
    let drift = top.jellett(&run.state) / top.jellett(&start) - 1.0;
    println!(
        "upright {} to {}, λ drifts by {drift:e}, {} events, energy grows by {:e}",
        top.uprightness(&start),
        top.uprightness(&run.state),
        run.events.len(),
        growth.most
    );
    assert!(top.uprightness(&run.state) < -0.99, "{}", top.uprightness(&run.state));
    assert!(growth.most < 1e-12 && drift.abs() < 1e-6, "{:e} {drift:e}", growth.most);
    assert!(quantity(&run.state) < quantity(&start));
    // The centre of mass has risen; the spin about the body's own axis is reversed.
    assert!(run.state.position().z > start.position().z + 1.9 * 0.3 * 0.02);
    let own = (run.state.orientation() * Vector3::z()).dot(run.state.angular_velocity());
    assert!(own < 0.0, "{own}");
}

#[test]
fn jelletts_quantity_is_conserved_to_the_order_of_the_method() {
    let top = tippe_top(0.5);
    let start = top.spinning(0.3, 180.0, SAG);
    let points: Vec<_> = [800, 1600, 3200, 6400]
        .into_iter()
        .map(|n| {
            let dt = 0.4 / f64::from(n);
            let end = run(&RungeKuttaMuntheKaas4, &top.system, &start, 0.4, dt).state;
            (dt, (top.jellett(&end) / top.jellett(&start) - 1.0).abs())
        })
        .collect();
    println!("{points:?}");
    assert!(slope(&points) > 3.6, "{} {points:?}", slope(&points));
}

#[test]
fn on_its_head_the_top_stays_above_the_threshold_and_falls_below_it() {
    let top = tippe_top(0.5);
    // λ = C n R (1 + α) on its head.
    let spin = |factor: f64| {
        let c = 0.4 * 0.02 * 0.02 * 0.02;
        factor * top.threshold().unwrap() / (c * 0.02 * 1.3)
    };
    let lean = |factor: f64| {
        let tilt = std::f64::consts::PI - 0.05;
        let start = top.spinning(tilt, -spin(factor), SAG);
        let end = run(&RungeKuttaMuntheKaas4, &top.system, &start, 8.0, 2e-4).state;
        std::f64::consts::PI - top.uprightness(&end).acos()
    };
    let (above, below) = (lean(1.15), lean(0.85));
    println!("from 0.05 to {above} above the threshold, {below} below it");
    assert!(above < 0.05 && below > 0.08, "{above} {below}");
}

// -------------------------------------------------------------------------------------------------- disk

fn disk(damping: f64) -> RollingDisk {
    let law = CompliantLaw::try_new(1e5, 300.0).unwrap();
    RollingDisk::try_new(1.0, 0.2, law, CoulombFriction::try_new(0.8, 0.0, damping).unwrap()).unwrap()
}

#[test]
fn a_disk_rolls_steadily_on_a_circle_in_the_limit_of_no_creep() {
    let (tilt, turning) = (1.2f64, 2.5);
    let error = |damping: f64| {
        let disk = disk(damping);
        let start = disk.steady(tilt, turning).unwrap();
        let spin = disk.steady_spin(tilt, turning);
        let run = run(&RungeKuttaMuntheKaas4, &disk.system, &start, 0.5, 1e-4);
        assert!(run.events.is_empty(), "{:?}", kinds(&run));
        // The motion goes round the vertical: the start turned by Ω t about the centre of the circle.
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turning * 0.5);
        let circle = Vector3::new(0.2 * spin / turning, 0.0, 0.0);
        let centre = circle + turn * (start.position() - circle);
        let axis =
            (turn * start.orientation() * Vector3::z()).cross(&(run.state.orientation() * Vector3::z()));
        [
            (run.state.position() - centre).norm(),
            axis.norm(),
            (run.state.velocity() - turn * start.velocity()).norm(),
            (run.state.angular_velocity() - turn * start.angular_velocity()).norm(),
        ]
    };
    let sizes = [250.0, 500.0, 1000.0, 2000.0];
    let errors = sizes.map(error);
    println!("{errors:?}");
    for k in 0..4 {
        let points: Vec<_> = sizes.into_iter().zip(&errors).map(|(c, e)| (1.0 / c, e[k])).collect();
        assert!((slope(&points) - 1.0).abs() < 0.15, "{k}: {} {points:?}", slope(&points));
    }
    assert!(errors[3].iter().all(|e| *e < 0.02), "{errors:?}");
}

#[test]
fn a_disk_whose_centre_rests_goes_round_as_eulers_disk() {
    // Ω² = 4 g/(r sin θ): no component along the axis, no friction needed, and the motion is exact.
    let tilt = 0.3f64;
    let turning = (4.0 * GRAVITY / (0.2 * tilt.sin())).sqrt();
    let disk = disk(500.0);
    assert!(disk.steady_spin(tilt, turning).abs() < 1e-14);
    let start = disk.steady(tilt, turning).unwrap();
    let run = run(&RungeKuttaMuntheKaas4, &disk.system, &start, 0.5, 2e-5);
    let axis = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turning * 0.5)
        * start.orientation()
        * Vector3::z();
    let errors = [
        (run.state.position() - start.position()).norm(),
        (run.state.orientation() * Vector3::z()).cross(&axis).norm(),
    ];
    println!("{errors:?}");
    assert!(run.events.is_empty() && errors.iter().all(|e| *e < 1e-8), "{errors:?} {:?}", kinds(&run));
}

// ----------------------------------------------------------------------------------------------- bad input

fn compliant() -> CompliantLaw {
    CompliantLaw::try_new(1500.0, 8.0).unwrap()
}

#[test]
fn models_refuse_bad_input() {
    let plain = ContactLaw::from(compliant());
    let friction = CoulombFriction::try_new(0.3, 1.0, 1.0).unwrap();
    let boxed = FallingBox::try_new(1.0, Vector3::new(0.1, -0.1, 0.1), plain.clone());
    assert!(matches!(boxed, Err(ModelError::Body(_))));
    let block =
        somersault_contact::models::SlidingBlock::try_new(0.0, Vector3::repeat(0.1), compliant(), friction);
    assert!(matches!(block, Err(ModelError::Body(_))));
    let top = |eccentricity, law| TippeTop::try_new(1.0, 0.1, eccentricity, (1.0, 1.0), law).map(|_| ());
    for bad in [0.0, 1.0, -0.1, f64::NAN] {
        assert!(matches!(
            top(bad, plain.clone()),
            Err(ModelError::OutOfRange { argument: "eccentricity", .. })
        ));
    }
    let disk = disk(100.0);
    for tilt in [0.0, 1.6, f64::NAN] {
        assert!(matches!(disk.steady(tilt, 1.0), Err(ModelError::OutOfRange { argument: "tilt", .. })));
    }
    assert!(matches!(disk.steady(1.0, 0.0), Err(ModelError::OutOfRange { argument: "turning", .. })));
}
