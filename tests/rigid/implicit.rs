//! Implicit methods, and those with a limit to the angle of a step: each step of a free body is within a bound of the exact
//! motion or refused by name; bodies come to rest, in units from 1e-9 to 1e9.

use rayon::prelude::*;
use somersault::integrators::driver::IntegrateError;
use somersault::integrators::exact::FreeBody;
use somersault::integrators::state::{Pose, State, Twist};
use somersault::integrators::stepper::StepError;
use somersault::integrators::system::StateOf;
use somersault::integrators::variation::{Tangent, Varied};
use somersault::prelude::*;
use somersault_testkit::problems::under;

/// What a bound takes for the angle θ of a step.
#[derive(Clone, Copy, PartialEq)]
enum Angle {
    /// h‖ω‖.
    Turned,
    /// h √(2T/I_min), T the kinetic energy of the rotation.
    ByEnergy,
}

/// The error of a step of a free body, rad: at most `factor` θ^`power`, as the headers of the methods say.
struct Bound {
    method: Method,
    angle: Angle,
    factor: f64,
    power: i32,
}

fn bounds() -> Vec<Bound> {
    use Angle::{ByEnergy, Turned};
    let bound = |method, angle, factor, power| Bound { method, angle, factor, power };
    vec![
        bound(Method::Dmv2, Turned, 0.8, 3),
        bound(Method::Dmv2s, Turned, 0.8, 3),
        bound(Method::Lgvi, ByEnergy, 0.4, 3),
        bound(Method::Pmv4, Turned, 0.04, 5),
        bound(Method::Pmv6, Turned, 0.003, 7),
        bound(Method::Pmv8, Turned, 2.5e-4, 9),
        bound(Method::Pmv10, Turned, 2e-5, 11),
        bound(Method::Imid, Turned, 0.12, 3),
        bound(Method::Radau5, Turned, 2e-3, 6),
        bound(Method::Aso, Turned, 0.16, 3),
        bound(Method::Sieg, ByEnergy, 0.19, 2),
        bound(Method::Split2, Turned, 0.0, 3),
        bound(Method::Split4, Turned, 0.0, 5),
    ]
}

/// Numbers in (−1, 1), the same in every run.
fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(7919).wrapping_add(13);
    let mut next = move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    for _ in 0..5 {
        next();
    }
    next
}

/// Balls, needles, plates, nearly symmetric and random bodies, turning at 1 rad/s about a random axis.
fn body(seed: u64) -> (RigidBody, RigidBodyState) {
    let mut random = noise(seed);
    let d = match seed % 6 {
        0 => Vector3::repeat(1.0),
        1 => Vector3::new(1e-3, 1e-3, 1.0),
        2 => Vector3::new(1.0, 1.0, 1e-3),
        3 => Vector3::new(1.0, 10f64.powf(2.0 * random()), 1.0 + 0.3 * random()),
        4 => Vector3::from_fn(|_, _| 10f64.powf(0.5 * random())),
        _ => Vector3::from_fn(|_, _| 10f64.powf(2.0 * random())),
    };
    let moments = Vector3::new(d.y + d.z, d.x + d.z, d.x + d.y);
    let axis = Vector3::from_fn(|_, _| random()).normalize();
    (RigidBody::try_principal(1.0, moments).unwrap(), RigidBodyState::spinning(axis))
}

/// The states that a run goes through.
struct States(Vec<RigidBodyState>);

impl Observer<Pose> for States {
    fn observe(&mut self, step: &mut Step<'_, Pose>) -> Flow {
        self.0.push(*step.after);
        Flow::Continue
    }
}

/// Twenty steps of `h`: the worst error of a step over its bound, and the largest angle of the method's limit.
fn check(bound: &Bound, seed: u64, h: f64) -> Result<(), String> {
    let Bound { method, angle, factor, power } = bound;
    let (body, start) = body(seed);
    let least = body.inertia().principal_moments().min();
    let turned = |x: &RigidBodyState| h * x.angular_velocity().norm();
    let by_energy = |x: &RigidBodyState| h * (2.0 * body.rotational_energy(x) / least).sqrt();
    let mut states = States(vec![start]);
    let grid = TimeGrid::try_with_steps(0.0, 20.0 * h, 20).unwrap();
    let system = RigidBodySystem::free(body);
    let outcome = Run::new(&system, *method, grid).observed_by(&mut states).from(&start);
    for pair in states.0.windows(2) {
        let exact = FreeBody::try_new(&body, &pair[0]).unwrap().at(h).unwrap();
        let error = so3::angle_between(pair[1].orientation(), exact.orientation());
        let theta = match angle {
            Angle::Turned => turned(&pair[0]),
            Angle::ByEnergy => by_energy(&pair[0]),
        };
        let allowed = factor * theta.powi(*power) + 1e-13 * (1.0 + theta);
        if error > allowed {
            return Err(format!("{method}, body {seed}, h = {h}: off by {error:e}, allowed {allowed:e}"));
        }
    }
    let limit = method.info().angle_limit;
    let fastest = by_energy(&start);
    let refused = match &outcome {
        Ok(_) => None,
        Err(IntegrateError::Step(StepError::Angle { method: name, angle, limit: allowed, .. })) => {
            if *name != method.info().name || Some(*allowed) != limit || angle <= allowed {
                return Err(format!("{method}, body {seed}, h = {h}: {outcome:?}"));
            }
            None
        }
        Err(IntegrateError::Step(error @ StepError::NotConverged { method: name, .. })) => {
            // The iteration of `imid` may end before its limit, and that of `radau5` has no other.
            (!["imid", "radau5"].contains(name) || fastest < 1.0).then(|| error.to_string())
        }
        Err(error) => Some(error.to_string()),
    };
    if let Some(message) = refused {
        return Err(format!("{method}, body {seed}, h = {h}: {message}"));
    }
    match limit {
        // By dmv2 steps beyond its limit are made where its equation has a solution.
        Some(limit) if outcome.is_err() && fastest <= limit => {
            Err(format!("{method}, body {seed}, h = {h}: refused, {outcome:?}"))
        }
        Some(limit) if outcome.is_ok() && turned(&start) > 1.5 * limit => {
            Err(format!("{method}, body {seed}, h = {h}: not refused"))
        }
        Some(_) | None => Ok(()),
    }
}

#[test]
fn a_step_of_a_free_body_is_within_its_bound_or_refused_by_name() {
    let bounds = bounds();
    for method in Method::ALL {
        let info = method.info();
        let known = bounds.iter().any(|bound| bound.method == method);
        assert!(known || !(info.implicit || info.angle_limit.is_some()), "no bound for {method}");
    }
    let steps = [0.02, 0.1, 0.3, 0.5, 0.7, 0.76, 0.9, 0.99, 1.1, 1.4, 1.6, 2.0, 4.0, 10.0];
    let wrong: Vec<String> = (0..60_u64)
        .into_par_iter()
        .flat_map_iter(|seed| {
            let of_body = |bound| steps.iter().filter_map(move |h| check(bound, seed, *h).err());
            bounds.iter().flat_map(of_body).collect::<Vec<_>>()
        })
        .collect();
    assert!(wrong.is_empty(), "{} of them\n{}", wrong.len(), wrong[..wrong.len().min(20)].join("\n"));
}

/// Units of length (m), time (s) and mass (kg).
const UNITS: [[f64; 3]; 11] = [
    [1.0, 1.0, 1.0],
    [1e-9, 1.0, 1.0],
    [1e9, 1.0, 1.0],
    [1.0, 1e-9, 1.0],
    [1.0, 1e9, 1.0],
    [1.0, 1.0, 1e-9],
    [1.0, 1.0, 1e9],
    [1e-9, 1e-9, 1e-9],
    [1e9, 1e9, 1e9],
    [1e-9, 1e9, 1e-27],
    [1e9, 1e-9, 1e27],
];

#[test]
fn a_free_rotation_is_the_same_in_all_units() {
    let run = |method: Method, [l, t, m]: [f64; 3]| {
        let body = RigidBody::try_principal(m, Vector3::new(1.0, 2.0, 2.5) * (m * l * l)).unwrap();
        let start = RigidBodyState::spinning(Vector3::new(0.5, 1.0, -0.7) / t);
        let grid = TimeGrid::try_with_steps(0.0, 10.0 * t, 100).unwrap();
        let end = Run::new(&RigidBodySystem::free(body), method, grid).from(&start);
        *end.unwrap_or_else(|error| panic!("{method} in units {l} m, {t} s, {m} kg: {error}"))
            .state
            .orientation()
    };
    for Bound { method, .. } in bounds() {
        let expected = run(method, UNITS[0]);
        for units in UNITS {
            let gap = so3::angle_between(&run(method, units), &expected);
            assert!(gap < 1e-10, "{method} in units {units:?}: {gap:e}");
        }
    }
}

/// A weight on a spring with a damper: in equilibrium at z = `origin`, from `height` above it, for 60 units of time.
fn hanging(
    method: Method,
    [l, t, m]: [f64; 3],
    origin: f64,
    damping: f64,
    height: f64,
) -> Result<f64, String> {
    let (stiffness, g) = (40.0 * m / (t * t), 9.81 * l / (t * t));
    let body = RigidBody::try_principal(m, Vector3::new(0.3, 0.4, 0.5) * (m * l * l)).unwrap();
    let damping = 2.0 * damping * (stiffness * m).sqrt();
    let anchor = origin * l + m * g / stiffness + 0.8 * l;
    let (z, zero) = (Vector3::z(), Vector3::zeros());
    let spring = Spring { anchor: z * anchor, attachment: zero, stiffness, damping, rest_length: 0.8 * l };
    let system = under(body, (Gravity { acceleration: z * -g }, spring));
    let start = RigidBodyState::new(z * ((origin + height) * l), UnitQuaternion::identity(), zero, zero);
    let grid = TimeGrid::try_new(0.0, 60.0 * t, 0.02 * t).unwrap();
    match Run::new(&system, method, grid).from(&start) {
        Ok(end) => Ok((end.state.position().z / l - origin).abs() + end.state.velocity().norm() * t / l),
        Err(error) => Err(error.to_string()),
    }
}

#[test]
fn damped_oscillators_come_to_rest_in_all_units() {
    for method in Method::ALL.into_iter().filter(|m| m.info().implicit) {
        for units in UNITS {
            for origin in [-1.0, 0.0, 0.37] {
                // In units far above a metre an equilibrium at the origin says nothing of the lengths that its forces are
                // made of, and their rounding may be taken for a motion.
                if origin == 0.0 && units[0] > 1.0 {
                    continue;
                }
                for damping in [0.5, 1.0] {
                    for height in [0.0, 1e-13, 0.2] {
                        let case = format!("{method}, {units:?}, {origin}, {damping}, {height}");
                        let left = hanging(method, units, origin, damping, height);
                        let left = left.unwrap_or_else(|error| panic!("{case}: {error}"));
                        assert!(left < 1e-13, "{case}: {left:e}");
                    }
                }
            }
        }
    }
}

#[test]
fn an_undamped_oscillator_in_equilibrium_stays_there() {
    for method in Method::ALL.into_iter().filter(|m| m.info().implicit) {
        let left = hanging(method, UNITS[0], 0.37, 0.0, 0.0).unwrap();
        assert!(left < 1e-12, "{method}: {left:e}");
    }
}

/// r̈ = −40 r with the variational equations beside it.
struct Oscillator;

impl System for Oscillator {
    type Configuration = Varied<Pose, Twist>;
    type Forms = OneForm;
    type Workspace = ();
    fn workspace(&self) {}
    fn acceleration(&self, (): &mut (), _: f64, x: &StateOf<Self>, out: &mut Varied<Twist>) {
        out.base = Twist { linear: x.configuration.base.position * -40.0, angular: Vector3::zeros() };
        for (column, displacement) in out.columns.iter_mut().zip(&x.configuration.columns) {
            *column = Twist { linear: displacement.linear * -40.0, angular: Vector3::zeros() };
        }
    }
}

/// A body at rest is where the iteration ends at once; the columns it carries must converge all the same.
#[test]
fn the_columns_of_a_body_at_rest_are_those_of_a_moving_one() {
    let column = Tangent {
        displacement: Twist { linear: Vector3::x(), angular: Vector3::zeros() },
        rate: Twist { linear: Vector3::y(), angular: Vector3::zeros() },
    };
    let grid = TimeGrid::try_with_steps(0.0, 1.0, 50).unwrap();
    let run = |position: Vector3<f64>, velocity: Vector3<f64>| {
        let base = RigidBodyState::new(position, UnitQuaternion::identity(), velocity, Vector3::zeros());
        let start = State::varied(base, [column]);
        Run::new(&Oscillator, Method::Imid, grid).from(&start).unwrap().state
    };
    let (at_rest, moving) = (run(Vector3::zeros(), Vector3::zeros()), run(Vector3::x(), Vector3::y()));
    let (displacement, rate) = (&at_rest.configuration.columns[0], &at_rest.rate.columns[0]);
    // The equations are linear: a motion from the tangent is the tangent's.
    assert!((displacement.linear - moving.configuration.base.position).norm() < 1e-13);
    assert!((rate.linear - moving.rate.base.linear).norm() < 1e-12);
}
