//! Seeded random trees with all kinds of joints, states for them, and a humanoid to time.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use somersault_core::random::SplitMix64;
use somersault_multibody::models::Diver;
use somersault_multibody::{
    DynamicsError, Force, Joint, Link, MassProperties, Model, ModelBuilder, ModelError,
};

/// Random trees, bodies, rotations and numbers from a seed.
#[derive(Debug, Clone)]
pub struct Random(SplitMix64);

impl Random {
    /// A sequence of its own for every seed.
    pub fn new(seed: u64) -> Self {
        Self(SplitMix64::new(seed))
    }

    /// In [low, high).
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.unit()
    }

    /// Below `n`.
    pub fn below(&mut self, n: usize) -> usize {
        (self.0.bits() % n as u64) as usize
    }

    /// Components in [−size, size).
    pub fn vector(&mut self, size: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.within(-size, size))
    }

    /// `n` numbers in [−size, size).
    pub fn numbers(&mut self, n: usize, size: f64) -> Vec<f64> {
        (0..n).map(|_| self.within(-size, size)).collect()
    }

    /// Any rotation.
    pub fn rotation(&mut self) -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(self.vector(std::f64::consts::PI))
    }

    /// A box somewhere, turned somehow.
    pub fn body(&mut self) -> MassProperties {
        let mass = self.within(0.2, 5.0);
        let [x, y, z] = [self.within(0.05, 0.5), self.within(0.05, 0.5), self.within(0.05, 0.5)];
        let moments = Vector3::new(y * y + z * z, x * x + z * z, x * x + y * y) * (mass / 12.0);
        let r = self.rotation().to_rotation_matrix().into_inner();
        let inertia = r * Matrix3::from_diagonal(&moments) * r.transpose();
        MassProperties { mass, center: self.vector(0.3), inertia: 0.5 * (inertia + inertia.transpose()) }
    }

    /// A joint of any kind.
    pub fn joint(&mut self) -> Joint {
        match self.below(6) {
            0 => Joint::Fixed,
            1 => Joint::Revolute { axis: self.vector(1.0) },
            2 => Joint::Prismatic { axis: self.vector(1.0) },
            3 => Joint::Spherical,
            4 => Joint::Planar,
            _ => Joint::Free,
        }
    }
}

/// A tree of `n` bodies named `b0`, `b1`, …, each with a damping below `damping`.
pub fn random_tree(random: &mut Random, n: usize, damping: f64) -> Result<Model, ModelError> {
    let mut builder = ModelBuilder::new().with_gravity(random.vector(10.0));
    for i in 0..n {
        let (joint, body) = (random.joint(), random.body());
        let name = format!("b{i}");
        let link = if i == 0 {
            Link::root(name, joint, body)
        } else {
            // mostly chains, some branches
            let parent = i - 1 - random.below(i.min(3));
            Link::child(name, format!("b{parent}"), joint, body)
        };
        let link = link.at(random.vector(0.5)).turned(random.rotation());
        builder.add(link.with_damping(random.within(0.0, damping)))?;
    }
    builder.build()
}

/// A configuration away from all special ones.
pub fn random_configuration(random: &mut Random, model: &Model) -> Result<Vec<f64>, DynamicsError> {
    let mut q = model.neutral();
    model.displace(&model.neutral(), &random.numbers(model.n_velocities(), 1.5), &mut q)?;
    Ok(q)
}

/// One wrench per body.
pub fn random_wrenches(random: &mut Random, model: &Model) -> Vec<Force<f64>> {
    (0..model.n_bodies()).map(|_| Force::new(random.vector(5.0), random.vector(2.0))).collect()
}

/// A random tree with a state, accelerations and wrenches.
#[derive(Debug, Clone)]
pub struct Case {
    /// The tree.
    pub model: Model,
    /// Configuration.
    pub q: Vec<f64>,
    /// Velocity.
    pub v: Vec<f64>,
    /// Acceleration.
    pub a: Vec<f64>,
    /// One wrench per body.
    pub wrenches: Vec<Force<f64>>,
    /// For what else a test needs.
    pub random: Random,
}

/// The same trees in every test: up to 40 bodies with all kinds of joints, their seeds from 0.
///
/// # Panics
/// If a tree is refused, which its construction rules out.
pub fn cases(count: u64) -> impl Iterator<Item = Case> {
    (0..count).map(|seed| {
        let mut random = Random::new(seed);
        let n = 1 + random.below(40);
        let model = random_tree(&mut random, n, 0.5).expect("a tree");
        let q = random_configuration(&mut random, &model).expect("lengths fit");
        let n = model.n_velocities();
        let (v, a) = (random.numbers(n, 2.0), random.numbers(n, 5.0));
        let wrenches = random_wrenches(&mut random, &model);
        Case { model, q, v, a, wrenches, random }
    })
}

/// A tree in some state.
#[derive(Debug, Clone)]
pub struct State {
    /// The tree.
    pub model: Model,
    /// Configuration.
    pub q: Vec<f64>,
    /// Velocity.
    pub v: Vec<f64>,
    /// Acceleration.
    pub a: Vec<f64>,
    /// Joint forces.
    pub torque: Vec<f64>,
}

/// The spatial diver in the state that all packages are timed in.
///
/// # Panics
/// If the diver is refused, which its construction rules out.
pub fn diver() -> State {
    let model = Diver::spatial().model().expect("a tree");
    let mut random = Random::new(27);
    let q = random_configuration(&mut random, &model).expect("lengths fit");
    let n = model.n_velocities();
    let (v, a, torque) = (random.numbers(n, 2.0), random.numbers(n, 2.0), random.numbers(n, 2.0));
    State { model, q, v, a, torque }
}

/// The same diver, whose left elbow follows the right one.
///
/// # Panics
/// If the diver is refused, which its construction rules out.
pub fn geared_diver() -> State {
    let State { model, mut q, mut v, mut a, mut torque } = diver();
    let mut builder = Model::builder().with_gravity(*model.gravity());
    for link in model.links() {
        let link = link.clone();
        let follows = link.name() == "left_forearm";
        builder
            .add(if follows { link.following("right_forearm", -1.0, 0.0) } else { link })
            .expect("a link of a tree");
    }
    let model = builder.build().expect("a tree");
    q.truncate(model.n_positions());
    for numbers in [&mut v, &mut a, &mut torque] {
        numbers.truncate(model.n_velocities());
    }
    State { model, q, v, a, torque }
}

/// A humanoid with the 27 degrees of freedom of thesis Table 3.2 in 18 bodies: a free torso, waist and
/// pelvis with a hinge each, four hinges in each leg, one in the neck, ball joints in the shoulders, a
/// hinge in each elbow and wrist. Boxes for bodies; made for timing, not for anatomy.
pub fn humanoid() -> Result<Model, ModelError> {
    let solid = |mass: f64, x: f64, y: f64, z: f64| MassProperties {
        mass,
        center: Vector3::new(0.0, 0.0, 0.5 * z),
        inertia: Matrix3::from_diagonal(&Vector3::new(y * y + z * z, x * x + z * z, x * x + y * y))
            * (mass / 12.0),
    };
    let bend = Joint::Revolute { axis: Vector3::y() };
    let twist = Joint::Revolute { axis: Vector3::z() };
    let mut links = vec![
        Link::root("torso", Joint::Free, solid(21.0, 0.2, 0.35, 0.45)),
        Link::child("waist", "torso", twist, MassProperties::massless()),
        Link::child("pelvis", "waist", bend, solid(7.3, 0.2, 0.3, -0.15)),
        Link::child("head", "torso", bend, solid(4.5, 0.18, 0.15, 0.24)).at(Vector3::new(0.0, 0.0, 0.45)),
    ];
    for (side, y) in [("left", 1.0), ("right", -1.0)] {
        let name = |part: &str| format!("{side} {part}");
        let mut limb = |part: &str, parent: &str, joint, at: [f64; 3], mass| {
            let parent = if matches!(parent, "torso" | "pelvis") { parent.to_owned() } else { name(parent) };
            links.push(Link::child(name(part), parent, joint, mass).at(Vector3::from(at)));
        };
        limb("upper arm", "torso", Joint::Spherical, [0.0, 0.17 * y, 0.36], solid(1.8, 0.08, 0.08, -0.28));
        limb("forearm", "upper arm", bend, [0.0, 0.0, -0.28], solid(1.1, 0.07, 0.07, -0.26));
        limb("hand", "forearm", bend, [0.0, 0.0, -0.26], solid(0.4, 0.03, 0.08, -0.18));
        limb("thigh", "pelvis", bend, [0.0, 0.08 * y, -0.14], solid(9.2, 0.15, 0.15, -0.41));
        limb("shank", "thigh", bend, [0.0, 0.0, -0.41], solid(2.8, 0.1, 0.1, -0.43));
        limb("foot", "shank", bend, [0.0, 0.0, -0.43], solid(0.8, 0.18, 0.09, -0.06));
        limb("toes", "foot", bend, [0.12, 0.0, -0.06], solid(0.13, 0.06, 0.09, -0.02));
    }
    let mut builder = ModelBuilder::new();
    for link in links {
        builder.add(link)?;
    }
    builder.build()
}
