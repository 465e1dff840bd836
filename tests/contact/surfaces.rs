//! Surfaces are examined where they are touched first.

use nalgebra::Vector3;
use somersault_contact::bodies::{BodiesInContact, BodyContacts, BodySphere, SpherePair};
use somersault_contact::contacts::{BodyInContact, Contact, Contacts};
use somersault_contact::event::EventKind;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::surface::{SignedDistance, Solid, SphericalSurface, Surface, SurfaceFault};
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::{Adaptive, Steps, TimeGrid};
use somersault_integrators::events::{Interrupted, Interruption, Location};
use somersault_integrators::force::Gravity;
use somersault_integrators::methods::{Dop853, RungeKuttaMuntheKaas};
use somersault_integrators::run::Run;
use somersault_integrators::state::{Pose, RigidBodyState, State};
use std::sync::Arc;

/// The ground with a height and a gradient that need not fit together.
#[derive(Debug, Clone, Copy)]
struct Ground {
    slope: f64,
    gradient: Vector3<f64>,
    lipschitz: f64,
}

impl Surface for Ground {
    fn signed_distance(&self, point: &Vector3<f64>) -> SignedDistance {
        SignedDistance { distance: self.slope * point.z, gradient: self.gradient }
    }
    fn lipschitz(&self) -> f64 {
        self.lipschitz
    }
}

fn ground(slope: f64, gradient: [f64; 3], lipschitz: f64) -> Ground {
    Ground { slope, gradient: gradient.into(), lipschitz }
}

type Ended = Result<u64, Box<Interrupted<Pose, EventKind, SurfaceFault>>>;

/// A ball dropped on a surface, with fixed and with adapted steps.
fn drop_on(surface: impl Surface + 'static) -> [Ended; 2] {
    let law = CompliantLaw::try_new(1e4, 10.0).unwrap();
    let contact = Contact::try_ball(Vector3::zeros(), 0.1, Arc::new(surface), law).unwrap();
    let body = RigidBody::try_box(1.0, Vector3::repeat(0.1)).unwrap();
    let system = BodyInContact::new(body, (Gravity::earth(), Contacts::new(vec![contact])));
    let mut start = RigidBodyState::default();
    start.configuration.position = Vector3::new(0.0, 0.0, 0.5);
    let stepper = RungeKuttaMuntheKaas(Dop853);
    let grid = TimeGrid::try_new(0.0, 0.5, 0.01).unwrap();
    [grid.into(), Steps::adapted((0.0, 0.5), Adaptive::default())].map(|steps| {
        let run = Run::by_embedded_stepper(&system, &stepper, steps).locating(Location::default());
        run.from(&start).map(|run| run.event_count)
    })
}

fn fault(ended: &Ended) -> SurfaceFault {
    let broken = ended.as_ref().unwrap_err();
    match &broken.reason {
        Interruption::Refused { guard: 0, fault, .. } => fault.clone(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_surface_that_is_right_is_touched() {
    for ended in drop_on(ground(1.0, [0.0, 0.0, 1.0], 1.0)) {
        assert_eq!(ended.unwrap(), 2);
    }
    // A larger constant than needed costs steps and nothing else.
    for ended in drop_on(ground(1.0, [0.0, 0.0, 1.0], 3.0)) {
        assert_eq!(ended.unwrap(), 2);
    }
}

#[test]
fn a_gradient_of_the_wrong_sign_is_named() {
    for ended in drop_on(ground(1.0, [0.0, 0.0, -1.0], 1.0)) {
        assert!(matches!(fault(&ended), SurfaceFault::WrongSign { .. }), "{ended:?}");
    }
}

#[test]
fn a_gradient_of_zero_is_named() {
    for ended in drop_on(ground(1.0, [0.0, 0.0, 0.0], 1.0)) {
        assert!(matches!(fault(&ended), SurfaceFault::ZeroGradient { .. }), "{ended:?}");
    }
}

#[test]
fn a_gradient_that_is_not_of_length_one_is_named() {
    for ended in drop_on(ground(0.5, [0.0, 0.0, 0.5], 1.0)) {
        assert!(matches!(fault(&ended), SurfaceFault::NotUnit { length: 0.5, .. }), "{ended:?}");
    }
    for ended in drop_on(ground(2.0, [0.0, 0.0, 2.0], 3.0)) {
        assert!(matches!(fault(&ended), SurfaceFault::NotUnit { length: 2.0, .. }), "{ended:?}");
    }
}

#[test]
fn a_gradient_that_is_not_that_of_the_distance_is_named() {
    for ended in drop_on(ground(1.0, [0.6, 0.0, 0.8], 1.0)) {
        assert!(matches!(fault(&ended), SurfaceFault::WrongGradient { .. }), "{ended:?}");
    }
}

#[test]
fn a_distance_steeper_than_its_constant_is_named_before_it_is_touched() {
    for ended in drop_on(ground(2.0, [0.0, 0.0, 2.0], 1.0)) {
        let expected =
            |f: &SurfaceFault| matches!(f, SurfaceFault::Steep { length: 2.0, lipschitz: 1.0, .. });
        assert!(expected(&fault(&ended)), "{ended:?}");
        assert_eq!(ended.unwrap_err().so_far.t, 0.0);
    }
}

#[test]
fn a_point_at_the_centre_of_a_sphere_is_named() {
    let centre = Vector3::new(0.0, 0.0, 0.5);
    for ended in drop_on(SphericalSurface::try_new(centre, 1.0, Solid::Inside).unwrap()) {
        assert_eq!(fault(&ended), SurfaceFault::ZeroGradient { point: centre.into() });
    }
}

#[test]
fn spheres_with_one_centre_are_named() {
    let law = CompliantLaw::try_new(1e4, 10.0).unwrap();
    let spheres = [0, 1].map(|i| BodySphere::try_new(i, Vector3::zeros(), 0.1).unwrap());
    let pair = SpherePair::try_new(spheres[0], spheres[1], law).unwrap();
    let contacts = BodyContacts::try_new(2, vec![], vec![pair]).unwrap();
    let body = RigidBody::try_box(1.0, Vector3::repeat(0.1)).unwrap();
    let system = BodiesInContact::try_new(vec![body, body], vec![Gravity::earth(); 2], contacts).unwrap();
    let start = State { configuration: vec![Pose::default(); 2], rate: vec![Default::default(); 2] };
    let grid = TimeGrid::try_new(0.0, 0.1, 0.01).unwrap();
    let stepper = RungeKuttaMuntheKaas(Dop853);
    let run = Run::by_stepper(&system, &stepper, grid).locating(Location::default());
    let broken = run.from(&start).unwrap_err();
    let Interruption::Refused { guard: 0, fault, .. } = broken.reason else { panic!("{}", broken.reason) };
    assert_eq!(fault, SurfaceFault::Concentric { point: [0.0; 3] });
}
