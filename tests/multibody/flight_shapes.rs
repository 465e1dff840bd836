//! Many shapes of a flight in lanes, and second derivatives along many directions: equal to single ones and to dual numbers.

use crate::flight::{flying_tree, orientation, take_off};
use nalgebra::{Matrix3, Matrix3xX, UnitQuaternion, Vector3};
use num_dual::Dual64;
use somersault::multibody::flight::{
    Flight, FlightData, FlightDerivatives, FlightSecondDerivatives, FlightShapes, TakeOff,
};
use somersault::multibody::{DynamicsError, Joint, Link, MassProperties, Model, ModelBuilder};
use somersault_core::argument::ArgumentError;
use somersault_core::lanes::InstructionSet;
use somersault_testkit::trees::{Random, random_configuration};

/// A tree in flight with rows of positions and velocities of its joints.
struct Case {
    model: Model,
    start: TakeOff,
    q: Vec<Vec<f64>>,
    v: Vec<Vec<f64>>,
    orientations: Vec<Vec<f64>>,
}

impl Case {
    fn new(random: &mut Random, root: Joint, n: usize, count: usize) -> Self {
        let model = flying_tree(random, root, n);
        let (n_q, n_v) = (model.positions_of(0).end, model.velocities_of(0).end);
        let n = model.n_velocities() - n_v;
        Self {
            start: take_off(random, 5.0),
            q: (0..count).map(|_| random_configuration(random, &model).unwrap()[n_q..].to_vec()).collect(),
            v: (0..count).map(|_| random.numbers(n, 2.0)).collect(),
            orientations: (0..count).map(|_| orientation(random, &model)).collect(),
            model,
        }
    }

    fn flight(&self) -> Flight<'_> {
        Flight::try_new(&self.model, self.start).unwrap()
    }

    /// Configuration and velocities with shape `k`.
    fn state(&self, k: usize) -> (Vec<f64>, Vec<f64>) {
        let (mut q, mut v) = (self.model.neutral(), vec![0.0; self.model.n_velocities()]);
        let root = self.model.positions_of(0);
        q[root.end - self.orientations[k].len()..root.end].copy_from_slice(&self.orientations[k]);
        q[root.end..].copy_from_slice(&self.q[k]);
        v[self.model.velocities_of(0).end..].copy_from_slice(&self.v[k]);
        (q, v)
    }
}

#[test]
fn shapes_in_lanes_have_the_bits_of_single_shapes_with_all_instructions() {
    let mut random = Random::new(41);
    for case in 0..40 {
        let root = if case % 2 == 0 { Joint::Free } else { Joint::Planar };
        let (n, count) = (1 + random.below(20), random.below(12));
        let case = Case::new(&mut random, root, n, count);
        let flight = case.flight();
        let mut data = FlightData::new(&case.model);
        for set in InstructionSet::supported() {
            let mut shapes = FlightShapes::with_instructions(set);
            // the second time with all that the first has left behind
            for with_directions in [false, true] {
                let (q, v) = (case.q.concat(), case.v.concat());
                flight.set_shapes(&mut shapes, count, &q, &v, with_directions).unwrap();
                for k in 0..count {
                    let (q, v) = case.state(k);
                    let expected = flight.derivatives(&mut data, &q, &v).unwrap();
                    let found = flight.rate_of_shape(&shapes, k, &case.orientations[k]).unwrap();
                    assert_eq!(found.angular_velocity, expected.angular_velocity);
                    assert_eq!(found.by_orientation, expected.by_orientation);
                }
            }
            let mut read = 0;
            let orientations = case.orientations.concat();
            flight
                .derivatives_of_shapes(&mut shapes, &orientations, &mut |k, found| {
                    let (q, v) = case.state(k);
                    let expected = flight.derivatives(&mut data, &q, &v).unwrap();
                    assert_eq!(found.angular_velocity, expected.angular_velocity);
                    assert_eq!(found.by_shape, expected.by_shape);
                    assert_eq!(found.by_shape_velocity, expected.by_shape_velocity);
                    assert_eq!(found.by_orientation, expected.by_orientation);
                    assert_eq!(found.by_angular_momentum, expected.by_angular_momentum);
                    read += 1;
                })
                .unwrap();
            assert_eq!(read, count);
        }
    }
}

#[test]
fn derivatives_of_many_flights_are_those_of_single_ones_row_by_row() {
    let mut random = Random::new(44);
    for number in 0..12 {
        let root = if number % 2 == 0 { Joint::Free } else { Joint::Planar };
        let (n_bodies, count) = (1 + random.below(12), random.below(150));
        let case = Case::new(&mut random, root, n_bodies, count);
        let (flight, n) = (case.flight(), case.model.n_velocities());
        let states: Vec<_> = (0..count).map(|k| case.state(k)).collect();
        let (q, v): (Vec<_>, Vec<_>) = states.iter().cloned().unzip();
        let length = 6 * n + 12;
        let mut rows = vec![f64::NAN; count * length];
        let mut shapes = FlightShapes::default();
        flight.derivatives_many(&mut shapes, &q.concat(), &v.concat(), &mut rows).unwrap();
        let (mut data, n_root) = (FlightData::new(&case.model), case.model.velocities_of(0).end);
        for ((q, v), row) in states.iter().zip(rows.chunks_exact(length)) {
            let found = flight.derivatives(&mut data, q, v).unwrap();
            assert_eq!(&row[..3], found.angular_velocity.as_slice());
            let matrix =
                |first: usize, columns: usize| Matrix3xX::from_row_slice(&row[first..first + 3 * columns]);
            let (by_q, by_v) = (matrix(3, n), matrix(3 + 3 * n, n));
            for k in 0..n {
                let turning = if root == Joint::Planar { k + 1 } else { k };
                let (of_q, of_v) = match k.checked_sub(n_root) {
                    Some(k) => (found.by_shape[k], found.by_shape_velocity[k]),
                    None if turning >= 3 && root == Joint::Free => {
                        (found.by_orientation.column(k - 3).into_owned(), Vector3::zeros())
                    }
                    None if turning >= 3 => (found.by_orientation.column(2).into_owned(), Vector3::zeros()),
                    None => (Vector3::zeros(), Vector3::zeros()),
                };
                assert_eq!((by_q.column(k).into_owned(), by_v.column(k).into_owned()), (of_q, of_v));
            }
            assert_eq!(matrix(3 + 6 * n, 3), found.by_angular_momentum);
        }
        // one state that stands for all
        let Some((q, v)) = states.first() else { continue };
        let mut alike = vec![0.0; 3 * length];
        flight.derivatives_many(&mut shapes, q, v, &mut alike).unwrap();
        assert!(alike.chunks_exact(length).all(|row| row == &rows[..length]));
    }
}

/// A tree whose joints are hinges and slides.
fn hinged(random: &mut Random, root: Joint, n: usize) -> Model {
    let mut builder = ModelBuilder::new();
    builder.add(Link::root("b0", root, random.body()).turned(random.rotation())).unwrap();
    for i in 1..n {
        let axis = random.vector(1.0);
        let joint = if random.below(4) == 0 { Joint::Prismatic { axis } } else { Joint::Revolute { axis } };
        let parent = format!("b{}", i - 1 - random.below(i.min(3)));
        let link = Link::child(format!("b{i}"), parent, joint, random.body());
        builder.add(link.at(random.vector(0.5)).turned(random.rotation())).unwrap();
    }
    builder.build().unwrap()
}

/// a · ∂ω by shape, its velocity, orientation and L, of numbers that carry a derivative.
fn weighted(case: &Case, direction: &[f64], a: &Vector3<f64>) -> Vec<f64> {
    let lift = |x: &f64| Dual64::from_re(*x);
    let wide = case.model.cast::<Dual64>();
    let TakeOff { time, center_of_mass, velocity, angular_momentum } = case.start;
    let start = TakeOff {
        time: lift(&time),
        center_of_mass: center_of_mass.map(Dual64::from_re),
        velocity: velocity.map(Dual64::from_re),
        angular_momentum: angular_momentum.map(Dual64::from_re),
    };
    let (q, v) = case.state(0);
    let (mut q, v): (Vec<_>, Vec<_>) = (q.iter().map(lift).collect(), v.iter().map(lift).collect());
    let root = case.model.positions_of(0).end;
    for (x, along) in q[root..].iter_mut().zip(direction) {
        x.eps = *along;
    }
    let flight = Flight::try_new(&wide, start).unwrap();
    let mut data = FlightData::new(&wide);
    let found = flight.derivatives(&mut data, &q, &v).unwrap();
    let matrices = [found.by_orientation, found.by_angular_momentum];
    let columns = found.by_shape.iter().chain(found.by_shape_velocity).copied();
    let of_matrices = matrices.iter().flat_map(|m| (0..3).map(|c| m.column(c).into_owned()));
    columns.chain(of_matrices).map(|column| column.map(|x| x.eps).dot(a)).collect()
}

#[test]
fn second_derivatives_along_many_directions_are_those_of_dual_numbers() {
    let mut random = Random::new(42);
    for number in 0..40 {
        let root = if number % 2 == 0 { Joint::Free } else { Joint::Planar };
        let n_bodies = 1 + random.below(14);
        let model = hinged(&mut random, root, n_bodies);
        let n = n_bodies - 1;
        let (q, v) = (vec![random.numbers(n, 2.0)], vec![random.numbers(n, 2.0)]);
        let orientations = vec![orientation(&mut random, &model)];
        let case = Case { start: take_off(&mut random, 5.0), q, v, orientations, model };
        let flight = case.flight();
        let count = if n == 0 { 0 } else { random.below(11) };
        let mut directions = random.numbers(n * count, 1.0);
        directions.iter_mut().step_by(3).for_each(|x| *x = 0.0);
        let a = random.vector(1.0);
        let length = 2 * count + 6;
        for set in InstructionSet::supported() {
            let mut data = FlightSecondDerivatives::with_instructions(set);
            flight.set_shape_along(&mut data, &case.q[0], &case.v[0], &directions).unwrap();
            let mut rows = vec![0.0; count * length];
            flight.second_derivatives_of_shape(&mut data, &case.orientations[0], &a, &mut rows).unwrap();
            for (row, direction) in rows.chunks_exact(length).zip(directions.chunks_exact(n.max(1))) {
                let exact = weighted(&case, direction, &a);
                let size = 1.0 + exact.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
                let along = |part: usize, l: usize| -> f64 {
                    let columns = exact[part * n..].iter();
                    columns.zip(&directions[l * n..(l + 1) * n]).map(|(x, d)| x * d).sum()
                };
                let of_shape = (0..2).flat_map(|part| (0..count).map(move |l| (part, l)));
                let expected: Vec<f64> =
                    of_shape.map(|(part, l)| along(part, l)).chain(exact[2 * n..].iter().copied()).collect();
                for (found, expected) in row.iter().zip(&expected) {
                    let error = (found - expected).abs();
                    assert!(error < 1e-12 * size * (1 + n) as f64, "{}: {error:e}", set.name());
                }
            }
        }
    }
}

#[test]
fn what_does_not_fit_shapes_in_lanes_is_refused_by_name() {
    let mut random = Random::new(43);
    let case = Case::new(&mut random, Joint::Free, 6, 3);
    let flight = case.flight();
    let (q, v) = (case.q.concat(), case.v.concat());
    let (n_q, n) = (case.q[0].len(), case.v[0].len());
    let wrong = |argument, expected, found| {
        DynamicsError::Argument(ArgumentError::Length { argument, expected, found })
    };
    let mut shapes = FlightShapes::default();
    let found = flight.set_shapes(&mut shapes, 3, &q[1..], &v, true).unwrap_err();
    assert_eq!(found, wrong("q", 3 * n_q, 3 * n_q - 1));
    let found = flight.set_shapes(&mut shapes, 2, &q[..2 * n_q], &v, true).unwrap_err();
    assert_eq!(found, wrong("v", 2 * n, 3 * n));
    let body = Case::new(&mut random, Joint::Free, 1, 0);
    let found = body.flight().set_shapes(&mut shapes, usize::MAX, &[], &[], true).unwrap_err();
    assert!(found.to_string().contains("`count`"), "{found}");
    let turned = case.orientations.concat();
    let mut nothing = |_: usize, _: FlightDerivatives<'_>| {};
    let found = flight.derivatives_of_shapes(&mut shapes, &[], &mut nothing).unwrap_err();
    assert_eq!(found, DynamicsError::ForeignData);
    flight.set_shapes(&mut shapes, 3, &q, &v, false).unwrap();
    let found = flight.derivatives_of_shapes(&mut shapes, &turned, &mut nothing).unwrap_err();
    assert_eq!(found, DynamicsError::ForeignData);
    flight.set_shapes(&mut shapes, 3, &q, &v, true).unwrap();
    let found = flight.derivatives_of_shapes(&mut shapes, &turned[4..], &mut nothing).unwrap_err();
    assert_eq!(found, wrong("orientations", 12, 8));
    let start = UnitQuaternion::identity();
    for step in [1, usize::MAX] {
        let found = flight.turn_step(&mut shapes, step, &start, 0.1, None).unwrap_err();
        assert_eq!(found, DynamicsError::ForeignData);
    }
    assert_eq!(flight.rate_of_shape(&shapes, 3, &turned[..4]).unwrap_err(), DynamicsError::ForeignData);
    assert_eq!(flight.rate_of_shape(&shapes, 0, &[0.0]).unwrap_err(), wrong("orientation", 4, 1));
    // set for another tree
    let other = Case::new(&mut random, Joint::Free, 9, 3);
    let found = other.flight().derivatives_of_shapes(&mut shapes, &turned, &mut nothing).unwrap_err();
    assert_eq!(found, DynamicsError::ForeignData);

    // joints whose positions are quaternions have no directions
    let mut data = FlightSecondDerivatives::default();
    let mut builder = ModelBuilder::new();
    let body = MassProperties { mass: 1.0, center: Vector3::zeros(), inertia: Matrix3::identity() };
    builder.add(Link::root("body", Joint::Free, body)).unwrap();
    builder.add(Link::child("head", "body", Joint::Spherical, body)).unwrap();
    let balls = builder.build().unwrap();
    let flight = Flight::try_new(&balls, case.start).unwrap();
    let found = flight.set_shape_along(&mut data, &[0.0; 3], &[0.0; 3], &[1.0; 3]).unwrap_err();
    assert_eq!(found, wrong("positions of the joints", 3, 4));
    let hinges = hinged(&mut random, Joint::Free, 3);
    let flight = Flight::try_new(&hinges, case.start).unwrap();
    let a = Vector3::x();
    let found = flight.set_shape_along(&mut data, &[0.0; 2], &[0.0; 2], &[1.0; 3]).unwrap_err();
    assert_eq!(found, wrong("directions", 2, 3));
    flight.set_shape_along(&mut data, &[0.0; 2], &[0.0; 2], &[1.0; 2]).unwrap();
    let found = flight.second_derivatives_of_shape(&mut data, &turned[..4], &a, &mut [0.0; 7]).unwrap_err();
    assert_eq!(found, wrong("rows", 8, 7));
    let larger = hinged(&mut random, Joint::Free, 5);
    let larger = Flight::try_new(&larger, case.start).unwrap();
    let found = larger.second_derivatives_of_shape(&mut data, &turned[..4], &a, &mut [0.0; 8]).unwrap_err();
    assert_eq!(found, DynamicsError::ForeignData);

    // a needle has no inertia about its axis
    let rod = MassProperties::rod(1.0, Vector3::zeros(), Vector3::z());
    let mut builder = ModelBuilder::new();
    builder.add(Link::root("needle", Joint::Free, rod)).unwrap();
    let needle = builder.build().unwrap();
    let flight = Flight::try_new(&needle, case.start).unwrap();
    let singular = DynamicsError::Singular { joint: "needle".into() };
    let named = DynamicsError::InState { index: 0, source: Box::new(singular) };
    assert_eq!(flight.set_shapes(&mut shapes, 5, &[], &[], true).unwrap_err(), named);
}
