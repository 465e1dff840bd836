//! User-defined events on systems that are no bodies in contact: times in closed form.

use somersault_integrators::driver::{Adaptive, IntegrateError, Steps, TimeGrid};
use somersault_integrators::events::{
    Crossing, Frozen, Guard, Hybrid, Interruption, LocatedResult, Location,
};
use somersault_integrators::methods::{AdamsBashforth4, Dop853, RungeKutta4, RungeKuttaMuntheKaas, StartUp};
use somersault_integrators::run::Run;
use somersault_integrators::state::{Pose, RigidBodyState, Twist};
use somersault_integrators::stepper::Stepper;
use somersault_integrators::system::{Fault, OneForm, System};
use std::cell::Cell;
use std::convert::Infallible;
use std::fmt;
use std::num::ParseFloatError;

/// A point on a line.
fn at(x: f64, v: f64) -> RigidBodyState {
    let mut state = RigidBodyState::default();
    (state.configuration.position.x, state.rate.linear.x) = (x, v);
    state
}

fn along(acceleration: f64) -> Twist {
    let mut twist = Twist::default();
    twist.linear.x = acceleration;
    twist
}

fn fixed<H: Hybrid<Configuration = Pose>>(
    system: H,
    stepper: &impl for<'a> Stepper<Frozen<'a, H>>,
    start: &RigidBodyState,
    end: f64,
    dt: f64,
) -> LocatedResult<H> {
    let grid = TimeGrid::try_new(0.0, end, dt).unwrap();
    Run::by_stepper(&system, stepper, grid).locating(Location::default()).from(start)
}

fn adapted<H: Hybrid<Configuration = Pose>>(system: H, start: &RigidBodyState, end: f64) -> LocatedResult<H> {
    let steps = Steps::adapted((0.0, end), Adaptive::with_tolerances(1e-12, 1e-12));
    let stepper = RungeKuttaMuntheKaas(Dop853);
    Run::by_embedded_stepper(&system, &stepper, steps).locating(Location::default()).from(start)
}

// ------------------------------------------------------------------------------------ a table that switches

/// A mass driven by the rows of a table: the acceleration changes where x passes the ends of rows.
#[derive(Debug, Clone)]
struct Table {
    ends: Vec<f64>,
    accelerations: Vec<f64>,
}

/// Which row of a table is left, and for which.
#[derive(Debug, Clone, Copy, PartialEq)]
struct RowChange {
    from: usize,
    to: usize,
}

impl Table {
    fn guard(&self, row: usize, x: &RigidBodyState) -> Guard {
        Guard { gap: x.position().x - self.ends[row], rate: x.velocity().x, lag: 0.0 }
    }
}

impl System for Table {
    type Configuration = Pose;
    type Forms = OneForm;
    type Workspace = ();
    fn workspace(&self) {}
    fn acceleration(&self, w: &mut (), t: f64, x: &RigidBodyState, out: &mut Twist) {
        self.acceleration_in(&self.mode(t, x), w, t, x, out);
    }
}

impl Hybrid for Table {
    type Mode = usize;
    type Kind = RowChange;
    type Fault = Infallible;
    fn mode(&self, _: f64, x: &RigidBodyState) -> usize {
        (0..self.ends.len()).filter(|row| !self.guard(*row, x).is_inside()).count()
    }
    fn guards(&self, _: &usize, _: f64, x: &RigidBodyState, out: &mut Vec<Guard>) {
        out.extend((0..self.ends.len()).map(|row| self.guard(row, x)));
    }
    fn acceleration_in(&self, row: &usize, (): &mut (), _: f64, _: &RigidBodyState, out: &mut Twist) {
        *out = along(self.accelerations[*row]);
    }
    fn event_kind(&self, _: usize, _: &Guard, _: &Guard, (from, to): (&usize, &usize)) -> RowChange {
        RowChange { from: *from, to: *to }
    }
}

/// 2 up to 1, −1 from there on, −4 from 2.5 on.
fn table() -> Table {
    Table { ends: vec![1.0, 2.5], accelerations: vec![2.0, -1.0, -4.0] }
}

/// Over one period of the motion from rest at 0: it passes 1 at speed 2 and 2.5 at speed 1, turns and comes back.
fn exact() -> [(f64, RowChange); 4] {
    let row = |from, to| RowChange { from, to };
    [(1.0, row(0, 1)), (2.0, row(1, 2)), (2.5, row(2, 1)), (3.5, row(1, 0))]
}

fn check_table(run: LocatedResult<Table>, periods: usize, tolerance: f64, name: &str) {
    let run = run.unwrap();
    assert_eq!(run.event_count, 4 * periods as u64, "{name}");
    for (i, event) in run.events.iter().enumerate() {
        let (t, kind) = exact()[i % 4];
        assert_eq!(event.kind, kind, "{name}");
        let off = event.t - (t + 4.5 * (i / 4) as f64);
        assert!(off.abs() < tolerance, "{name}: event {i} is off by {off:e}");
    }
    let state = (run.state.position().x, run.state.velocity().x);
    assert!(state.0.abs().max(state.1.abs()) < tolerance, "{name}: {state:?}");
}

#[test]
fn a_table_switches_at_the_times_of_its_closed_form() {
    // Each row is a parabola, which all of these follow exactly, in whichever steps.
    for dt in [0.013, 0.3, 2.0] {
        check_table(fixed(table(), &RungeKutta4, &at(0.0, 0.0), 13.5, dt), 3, 1e-13, "rk4");
        let adams = AdamsBashforth4 { start_up: StartUp::default() };
        check_table(fixed(table(), &adams, &at(0.0, 0.0), 13.5, dt), 3, 1e-12, "ab4");
    }
    check_table(adapted(table(), &at(0.0, 0.0), 13.5), 3, 1e-12, "rkmk8");
}

/// A table whose last row cannot be read, with what was wrong.
struct Torn(Table, Cell<Option<Fault>>);

impl System for Torn {
    type Configuration = Pose;
    type Forms = OneForm;
    type Workspace = ();
    fn workspace(&self) {}
    fn acceleration(&self, w: &mut (), t: f64, x: &RigidBodyState, out: &mut Twist) {
        self.acceleration_in(&self.mode(t, x), w, t, x, out);
    }
    fn take_fault(&self) -> Option<Fault> {
        self.1.take()
    }
}

impl Hybrid for Torn {
    type Mode = usize;
    type Kind = RowChange;
    type Fault = Infallible;
    fn mode(&self, t: f64, x: &RigidBodyState) -> usize {
        self.0.mode(t, x)
    }
    fn guards(&self, row: &usize, t: f64, x: &RigidBodyState, out: &mut Vec<Guard>) {
        self.0.guards(row, t, x, out);
    }
    fn acceleration_in(&self, row: &usize, w: &mut (), t: f64, x: &RigidBodyState, out: &mut Twist) {
        if *row < self.0.ends.len() {
            self.0.acceleration_in(row, w, t, x, out);
        } else if let Err(error) = "–".parse::<f64>() {
            self.1.set(Some(Fault::new(error)));
            *out = along(f64::NAN);
        }
    }
    fn event_kind(&self, guard: usize, a: &Guard, b: &Guard, rows: (&usize, &usize)) -> RowChange {
        self.0.event_kind(guard, a, b, rows)
    }
}

#[test]
fn a_system_without_a_value_in_some_mode_says_why_and_the_solution_up_to_there_is_kept() {
    let broken = [
        fixed(Torn(table(), Cell::default()), &RungeKutta4, &at(0.0, 0.0), 3.0, 0.13).unwrap_err(),
        adapted(Torn(table(), Cell::default()), &at(0.0, 0.0), 3.0).unwrap_err(),
    ];
    for broken in broken {
        let Interruption::Integrate(IntegrateError::Fault { source, .. }) = &broken.reason else {
            panic!("{}", broken.reason)
        };
        assert!(source.downcast_ref::<ParseFloatError>().is_some(), "{source}");
        // It passes 2.5 after 2 s.
        assert!(broken.so_far.event_count == 2 && (broken.so_far.t - 2.0).abs() < 1e-12);
    }
}

#[test]
fn a_row_that_is_entered_and_left_within_one_step_is_found_without_bounds() {
    // 2.5e-10 beyond 2.5: in the third row for 2.2e-5 s, within steps of 0.5 s.
    let speed = (3.0f64 + 2e-9).sqrt();
    let run = fixed(table(), &RungeKutta4, &at(1.0, speed), 3.0, 0.5).unwrap();
    let first: Vec<RowChange> = run.events.iter().take(2).map(|event| event.kind).collect();
    assert_eq!(first, [RowChange { from: 1, to: 2 }, RowChange { from: 2, to: 1 }]);
    let inside = 2.0 * (2e-9f64).sqrt() / 4.0;
    let found = run.events[1].t - run.events[0].t;
    assert!((found - inside).abs() < 1e-5 * inside, "{found:e} {inside:e}");
    assert!(run.trials > 0);
}

// ------------------------------------------------------------------------------- a state that jumps, and a fault

/// A ball that falls at 1 m/s² and rebounds with a part of its speed.
#[derive(Debug, Clone)]
struct Rebound {
    restitution: f64,
    /// The speed of a rebound from which on the floor does not hold.
    strength: f64,
}

/// A floor that was hit too hard.
#[derive(Debug, Clone, PartialEq)]
struct Broken {
    speed: f64,
}

impl fmt::Display for Broken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the floor breaks at {} m/s", self.speed)
    }
}

impl std::error::Error for Broken {}

impl System for Rebound {
    type Configuration = Pose;
    type Forms = OneForm;
    type Workspace = ();
    fn workspace(&self) {}
    fn acceleration(&self, (): &mut (), _: f64, _: &RigidBodyState, out: &mut Twist) {
        *out = along(-1.0);
    }
}

impl Hybrid for Rebound {
    /// Whether the ball is below the floor, by a rounding.
    type Mode = bool;
    type Kind = Crossing;
    type Fault = Broken;
    const RESETS: bool = true;
    fn mode(&self, _: f64, x: &RigidBodyState) -> bool {
        Guard { gap: x.position().x, rate: x.velocity().x, lag: 0.0 }.is_inside()
    }
    fn guards(&self, _: &bool, _: f64, x: &RigidBodyState, out: &mut Vec<Guard>) {
        out.push(Guard { gap: x.position().x, rate: x.velocity().x, lag: 0.0 });
    }
    fn acceleration_in(&self, _: &bool, w: &mut (), t: f64, x: &RigidBodyState, out: &mut Twist) {
        self.acceleration(w, t, x, out);
    }
    fn event_kind(&self, _: usize, before: &Guard, _: &Guard, _: (&bool, &bool)) -> Crossing {
        Crossing::of(before)
    }
    fn reset(&self, _: f64, _: &bool, is_below: &bool, x: &mut RigidBodyState) {
        if *is_below {
            x.rate.linear.x *= -self.restitution;
        }
    }
    fn examine(&self, _: usize, x: &RigidBodyState) -> Result<(), Broken> {
        let speed = x.velocity().x.abs();
        if speed < self.strength { Ok(()) } else { Err(Broken { speed }) }
    }
}

#[test]
fn a_ball_that_rebounds_does_so_at_the_times_of_its_closed_form() {
    // From 0.5 m it falls for 1 s and rebounds for 1 s; each flight takes half as long as the one before.
    let ball = Rebound { restitution: 0.5, strength: f64::INFINITY };
    let hit = |k: i32| 3.0 - 2.0 * 0.5f64.powi(k);
    let runs = [
        ("fixed", fixed(ball.clone(), &RungeKutta4, &at(0.5, 0.0), 2.95, 0.4)),
        ("adapted", adapted(ball, &at(0.5, 0.0), 2.95)),
    ];
    for (name, run) in runs {
        let run = run.unwrap();
        let hits: Vec<f64> =
            run.events.iter().filter(|e| e.kind == Crossing::Enters).map(|event| event.t).collect();
        assert_eq!(hits.len(), 6, "{name}: {hits:?}");
        for (k, t) in hits.iter().enumerate() {
            assert!((t - hit(k as i32)).abs() < 1e-13, "{name}: {k} {:e}", t - hit(k as i32));
        }
        let (s, v) = (2.95 - hit(5), 0.5f64.powi(6));
        let off = (run.state.position().x - (v * s - 0.5 * s * s)).abs();
        assert!(off < 1e-13 && (run.state.velocity().x - (v - s)).abs() < 1e-13, "{name}: {off:e}");
    }
}

#[test]
fn a_guard_that_may_not_go_in_ends_the_run_with_the_reason_of_the_system() {
    let ball = Rebound { restitution: 0.5, strength: 0.4 };
    for broken in [
        fixed(ball.clone(), &RungeKutta4, &at(0.5, 0.0), 4.0, 0.4).unwrap_err(),
        adapted(ball, &at(0.5, 0.0), 4.0).unwrap_err(),
    ] {
        let Interruption::Refused { guard: 0, t, fault } = &broken.reason else { panic!("{broken}") };
        assert!((t - 1.0).abs() < 1e-14 && (fault.speed - 0.5).abs() < 1e-13, "{broken}");
        assert_eq!((broken.so_far.event_count, broken.so_far.t), (1, *t));
    }
}
