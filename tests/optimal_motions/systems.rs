//! Systems on which the misprints of thesis appendix D show: lengths other than one, two weights, two passive and two
//! active joints, a floating root.

use nalgebra::{Matrix3, Vector3};
use somersault_core::spline::UniformBasis;
use somersault_multibody::joint_motion::{Condition, EigenpostureBase, End, SplineMotion};
use somersault_multibody::{Joint, Link, MassProperties, Model, Split};

fn rod(mass: f64, center: Vector3<f64>, inertia: [f64; 3]) -> MassProperties {
    MassProperties { mass, center, inertia: Matrix3::from_diagonal(&Vector3::from(inertia)) }
}

/// A cart on a rail with a chain of three rods: cart and second rod passive, the others active.
pub(crate) fn chain() -> (Model, Split) {
    let mut builder = Model::builder();
    let y = Joint::Revolute { axis: Vector3::y() };
    let links = [
        Link::root(
            "cart",
            Joint::Prismatic { axis: Vector3::x() },
            MassProperties::point(1.7, Vector3::zeros()),
        ),
        Link::child("a", "cart", y, rod(1.1, Vector3::new(0.0, 0.0, 0.35), [0.05, 0.055, 0.01])),
        Link::child("b", "a", y, rod(0.8, Vector3::new(0.0, 0.0, 0.2), [0.03, 0.035, 0.01]))
            .at(Vector3::new(0.0, 0.0, 0.7)),
        Link::child("c", "b", y, rod(0.5, Vector3::new(0.1, 0.0, 0.15), [0.02, 0.02, 0.01]))
            .at(Vector3::new(0.0, 0.0, 0.45)),
    ];
    for link in links {
        builder.add(link).unwrap();
    }
    (builder.build().unwrap(), Split::new(vec![false, true, false, true]))
}

/// A free body with two active hinges about different axes, in the air.
pub(crate) fn floating() -> (Model, Split) {
    let mut builder = Model::builder();
    let links = [
        Link::root("trunk", Joint::Free, rod(4.0, Vector3::new(0.02, 0.01, 0.1), [0.4, 0.35, 0.1])),
        Link::child(
            "arm",
            "trunk",
            Joint::Revolute { axis: Vector3::x() },
            rod(1.0, Vector3::new(0.0, 0.0, -0.3), [0.05, 0.045, 0.01]),
        )
        .at(Vector3::new(0.2, 0.0, 0.3)),
        Link::child(
            "leg",
            "trunk",
            Joint::Revolute { axis: Vector3::y() },
            rod(2.0, Vector3::new(0.03, 0.0, -0.4), [0.1, 0.11, 0.02]),
        )
        .at(Vector3::new(0.0, 0.1, -0.3)),
    ];
    for link in links {
        builder.add(link).unwrap();
    }
    let mut active = vec![false; 6];
    active.extend([true, true]);
    (builder.build().unwrap(), Split::new(active))
}

/// Two weights that mix two joints, of `n` coefficients each, starting at given values at rest.
pub(crate) fn weights(n: usize) -> SplineMotion {
    let base = EigenpostureBase::try_new(&[[0.2, -0.3], [1.1, 0.4], [-0.5, 0.9]]).unwrap();
    let conditions = [
        [
            Condition { end: End::Start, derivative: 0, value: 0.3 },
            Condition { end: End::Start, derivative: 1, value: 0.0 },
        ],
        [
            Condition { end: End::Start, derivative: 0, value: -0.2 },
            Condition { end: End::Start, derivative: 1, value: 0.1 },
        ],
    ];
    SplineMotion::with_conditions(UniformBasis::try_new(5, n).unwrap(), base, &conditions).unwrap()
}

/// Numbers without a pattern, between −1 and 1.
pub(crate) fn scattered(n: usize, seed: f64) -> Vec<f64> {
    (0..n).map(|k| ((k as f64 + 1.0) * 12.9898 + seed).sin() * 43.7 % 1.0).collect()
}
