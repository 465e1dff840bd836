//! Chains that touch the ground, a ball and a slope, with friction, against equations in minimal coordinates by another program.
//!
//! The literals are printed by tests/derivations/trees_in_contact.py: SymPy and DOP853 in pieces between located events.

use crate::passive;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use somersault_contact::contacts::Contact;
use somersault_contact::laws::ContactLaw;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::laws::coulomb::CoulombFriction;
use somersault_contact::surface::{HalfSpace, Solid, SphericalSurface, Surface};
use somersault_contact::tree::{LinkContact, TreeInContact};
use somersault_integrators::driver::{Adaptive, Steps};
use somersault_integrators::events::Location;
use somersault_integrators::methods::Method;
use somersault_integrators::run::Run;
use somersault_multibody::motion::TreeSystem;
use somersault_multibody::{Joint, Link, MassProperties, Model};
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

/// Mass, moment of inertia about the centre of mass, length, and where the centre of mass is along it, of each link.
type Links = [[f64; 4]];

/// Links on a hinge, which point along (sin a, −cos a) where their absolute angles are a.
fn chain(links: &Links, is_free: bool) -> Model {
    let down = -Vector3::y();
    let hinge = Joint::Revolute { axis: Vector3::z() };
    let plane = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2);
    let mut builder = Model::builder();
    for (i, [mass, moment, _, center]) in links.iter().enumerate() {
        let inertia = Matrix3::from_diagonal_element(*moment);
        let mass = MassProperties { mass: *mass, center: down * *center, inertia };
        let link = if i == 0 {
            Link::root("0", if is_free { Joint::Planar } else { hinge }, mass).turned(plane)
        } else {
            Link::child(i.to_string(), (i - 1).to_string(), hinge, mass).at(down * links[i - 1][2])
        };
        builder.add(link).unwrap();
    }
    builder.build().unwrap()
}

/// The points that touch: numbers of joints, of which 0 is the hinge and the last one the tip.
fn touching(
    links: &Links,
    joints: &[usize],
    surface: &Arc<dyn Surface>,
    [k, c, mu, kt, ct]: [f64; 5],
) -> Vec<LinkContact> {
    let friction = CoulombFriction::try_new(mu, kt, ct).unwrap();
    let law = ContactLaw::from(CompliantLaw::try_new(k, c).unwrap()).with_friction(friction);
    let at = |joint: usize| {
        let (link, length) = if joint == 0 { (0, 0.0) } else { (joint - 1, links[joint - 1][2]) };
        let contact = Contact::try_new(-Vector3::y() * length, surface.clone(), law.clone()).unwrap();
        LinkContact::new(joint.to_string(), link.to_string(), contact)
    };
    joints.iter().map(|joint| at(*joint)).collect()
}

/// Where a chain starts: its place and its absolute angles, and their rates; where it ends, with the times of its first and last event.
struct Case<'a> {
    links: &'a Links,
    contacts: Vec<LinkContact>,
    start: (&'a [f64], &'a [f64]),
    end: (f64, &'a [f64]),
    events: (usize, [f64; 2]),
    tolerance: f64,
}

/// Positions and velocities of joints of a chain.
fn joints(links: &Links, (places, rates): (&[f64], &[f64])) -> (Vec<f64>, Vec<f64>) {
    let free = places.len() - links.len();
    let differences = |x: &[f64]| {
        let angles = &x[free..];
        (0..angles.len())
            .map(|i| if i == 0 { angles[0] } else { angles[i] - angles[i - 1] })
            .collect::<Vec<_>>()
    };
    let (s, c) = places[free].sin_cos();
    // The planar joint has its velocity in the axes of its body.
    let velocity =
        if free == 2 { vec![c * rates[0] + s * rates[1], c * rates[1] - s * rates[0]] } else { vec![] };
    ([places[..free].to_vec(), differences(places)].concat(), [velocity, differences(rates)].concat())
}

/// Compares the end of a run at 1e-13 with a literal.
fn compare(case: Case<'_>) {
    let Case { links, contacts, start, end: (time, expected), events: (count, times), tolerance } = case;
    let free = start.0.len() - links.len();
    let model = chain(links, free == 2);
    let system = TreeInContact::try_new(TreeSystem::new(&model, passive()), contacts, vec![]).unwrap();
    let (q, v) = joints(links, start);
    let start = system.unstretched(model.state(&q, &v).unwrap());
    let steps = Steps::adapted((0.0, time), Adaptive::with_tolerances(1e-13, 1e-13));
    let run = Run::new(&system, Method::Rkmk8, steps).locating(Location::default()).from(&start).unwrap();
    let summed = |numbers: &[f64]| {
        let angles = numbers[free..].iter().scan(0.0, |angle, turn| {
            *angle += turn;
            Some(*angle)
        });
        numbers[..free].iter().copied().chain(angles).collect::<Vec<f64>>()
    };
    let found = [run.state.configuration.0.as_slice(), run.state.rate.base.as_slice()].map(summed).concat();
    let off = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let last = [run.events[0].t, run.events[run.events.len() - 1].t];
    println!("end {:e}, events {:e}", off(&found, expected), off(&last, &times));
    assert_eq!((run.events.len(), found.len()), (count, expected.len()));
    assert!(off(&last, &times) < tolerance && off(&found, expected) < tolerance, "{found:?} {last:?}");
}

/// Both ends bounce, stick and slip. By 1e-11 and 1e-13 the reference differs by 8e-12.
#[test]
fn a_rod_falls_to_the_digits_of_the_reference() {
    let links = [[0.8, 0.8 * 0.6 * 0.6 / 12.0, 0.6, 0.3]];
    let ground: Arc<dyn Surface> = Arc::new(HalfSpace::ground());
    compare(Case {
        links: &links,
        contacts: touching(&links, &[0, 1], &ground, [2e4, 40.0, 0.3, 1.5e4, 50.0]),
        start: (&[0.0, 0.7, 0.5], &[0.4, 0.0, 0.3]),
        end: (
            0.6,
            &[
                -0.08984567936875,
                0.01216323242744,
                1.552619075246,
                -0.01852484848588,
                -0.915596314148,
                2.160165851445,
            ],
        ),
        events: (14, [0.19729702110691655, 0.5947756665013056]),
        tolerance: 1e-11,
    });
}

/// The tip hits a ball twice, and its friction turns with the tangent plane. The reference differs by 5e-11.
#[test]
fn a_double_pendulum_hits_a_ball_to_the_digits_of_the_reference() {
    let links = [[1.0, 0.02, 0.5, 0.22], [0.7, 0.01, 0.4, 0.18]];
    let centre = Vector3::new(0.2, 0.0, -0.9);
    let ball: Arc<dyn Surface> = Arc::new(SphericalSurface::try_new(centre, 0.35, Solid::Inside).unwrap());
    compare(Case {
        links: &links,
        contacts: touching(&links, &[1, 2], &ball, [3e4, 30.0, 0.4, 2e4, 40.0]),
        start: (&[-1.2, -0.7], &[0.0, 0.5]),
        end: (1.6, &[-0.09311798624043, -0.3422812751909, 0.8965302490325, 5.770282755996]),
        events: (5, [0.38197411601021425, 0.9398033745788575]),
        tolerance: 1e-11,
    });
}

/// Four joints bounce, stick and slip on a slope of 0.35 rad. The reference differs by 1e-11, and a change of the start grows by 19.
#[test]
fn a_chain_on_a_slope_moves_to_the_digits_of_the_reference() {
    let links = [[0.9, 0.02, 0.4, 0.2], [0.6, 0.01, 0.35, 0.16], [0.5, 0.008, 0.3, 0.14]];
    let normal = Vector3::new(-f64::sin(0.35), 0.0, f64::cos(0.35));
    let slope: Arc<dyn Surface> = Arc::new(HalfSpace::try_new(Vector3::zeros(), normal).unwrap());
    compare(Case {
        links: &links,
        contacts: touching(&links, &[0, 1, 2, 3], &slope, [2e4, 40.0, 0.5, 1.5e4, 50.0]),
        start: (&[0.0, 0.65, 1.3, 1.6, 1.1], &[0.2, 0.0, 0.0, 0.5, -0.5]),
        end: (
            0.7,
            &[
                -0.2549513814943,
                -0.05910645214206,
                1.877907755911,
                1.973332530026,
                1.809859859818,
                -0.1879466651496,
                -2.09029441614,
                3.526076452644,
                1.181946990975,
                0.2577500567823,
            ],
        ),
        events: (28, [0.10203821682829974, 0.6346951918611212]),
        tolerance: 1e-11,
    });
}
