//! The event-locating driver: what it guarantees in each kind of case.

use somersault_contact::driver::integrate_located;
use somersault_contact::event::Location;
use somersault_contact::hybrid::{Guard, Hybrid, HybridBodies};
use somersault_contact::interface::ContactMode;
use somersault_contact::law::CompliantLaw;
use somersault_contact::models::BouncingBall;
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::TimeGrid;
use somersault_integrators::methods::{Method, Options};
use somersault_integrators::state::{Pose, RigidBodyState, Twist};
use somersault_integrators::system::{RigidSystem, System};

/// A ball whose spin doubles at each touch-down.
struct Doubling(BouncingBall);

impl System for Doubling {
    type Configuration = Pose;
    type Workspace = ();
    fn workspace(&self) {}
    fn acceleration(&self, w: &mut (), t: f64, x: &RigidBodyState, out: &mut Twist) {
        self.0.system.acceleration(w, t, x, out);
    }
}

impl RigidSystem for Doubling {
    fn body(&self, i: usize) -> &RigidBody {
        self.0.system.body(i)
    }
    fn rest(&self) -> RigidBodyState {
        self.0.system.rest()
    }
    fn wrenches(&self, t: f64, x: &RigidBodyState, out: &mut Twist) {
        self.0.system.wrenches(t, x, out);
    }
    fn is_free(&self) -> bool {
        false
    }
    fn is_torque_free(&self) -> bool {
        true
    }
    fn depends_on_velocity(&self) -> bool {
        true
    }
}

impl Hybrid for Doubling {
    type Mode = Vec<ContactMode>;
    const RESETS: bool = true;
    fn mode(&self, t: f64, x: &RigidBodyState) -> Vec<ContactMode> {
        self.0.system.mode(t, x)
    }
    fn guards(&self, mode: &Vec<ContactMode>, t: f64, x: &RigidBodyState, out: &mut Vec<Guard>) {
        self.0.system.guards(mode, t, x, out);
    }
    fn acceleration_in(
        &self,
        mode: &Vec<ContactMode>,
        w: &mut (),
        t: f64,
        x: &RigidBodyState,
        out: &mut Twist,
    ) {
        self.0.system.acceleration_in(mode, w, t, x, out);
    }
    fn reset(&self, _: f64, before: &Vec<ContactMode>, after: &Vec<ContactMode>, x: &mut RigidBodyState) {
        if before[0] == ContactMode::Open && after[0] != ContactMode::Open {
            x.rate.angular *= 2.0;
        }
    }
}

impl HybridBodies for Doubling {
    fn wrenches_in(&self, mode: &Vec<ContactMode>, t: f64, x: &RigidBodyState, out: &mut Twist) {
        self.0.system.wrenches_in(mode, t, x, out);
    }
}

#[test]
fn a_state_that_jumps_at_events_does_so_in_every_form() {
    let ball = BouncingBall::try_new(1.0, 0.1, CompliantLaw::try_new(400.0, 4.0).unwrap()).unwrap();
    let mut start = ball.at(0.5, 0.0);
    start.rate.angular.y = 3.0;
    let grid = TimeGrid::try_new(0.0, 1.3, 1e-2).unwrap();
    let system = Doubling(ball);
    for method in [Method::Rkmk, Method::RkmkL, Method::RkmkB, Method::Ab4L, Method::Lgvi] {
        let (options, location) = (Options::default(), Location::default());
        let run = integrate_located(method, options, &system, &start, &grid, &location, &mut ()).unwrap();
        // Two touch-downs and two releases.
        assert_eq!(run.event_count, 4, "{method}");
        assert!((run.state.angular_velocity().y - 12.0).abs() < 1e-12, "{method}: {:?}", run.state);
        // The log has the state that the jump finds.
        let logged: Vec<f64> = run.events.iter().map(|e| e.state.angular_velocity().y.round()).collect();
        assert_eq!(logged, [3.0, 6.0, 6.0, 12.0], "{method}");
    }
}
