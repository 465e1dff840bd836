//! The step of a body under forces that are sums of [`WrenchTerm`]s, for a tile of bodies at once.
//!
//! In the principal frame of a body, where its inertia is I = diag(I₁, I₂, I₃) and the torque M(q, r, v, ω),
//!
//! ```text
//! ṙ = v,   v̇ = F/m,   q̇ = ½ q ⊗ (0, ω),   I ω̇ = M − ω × I ω
//! ```
//!
//! A step is that of [`RungeKuttaMuntheKaas4`](crate::methods::RungeKuttaMuntheKaas4) in the body frame, whose brackets are
//! −a × b: the four stages of the classical method with K₃ for the third displacement, and
//!
//! ```text
//! K₃ = ω⁽²⁾ + h/4 ω⁽¹⁾ × ω⁽²⁾,   q ← q ⊗ exp(h/6 (ω⁽¹⁾ + 2ω⁽²⁾ + 2ω⁽³⁾ + ω⁽⁴⁾) + h²/12 ω⁽¹⁾ × ω⁽⁴⁾)
//! ```
//!
//! Bodies of a tile may be under different terms: each kind of term has a row of coefficients, zero for the bodies that have none of it.
//! Terms along the way s from one centre to one point of a body are one tie, F = (Σ cₙ |s|⁻ⁿ + (s · ṡ) Σ dₙ |s|⁻ⁿ) s, n ≤ 3.
//! Other forces are evaluated by [`ForceModel::add_in_lanes`](crate::force::ForceModel::add_in_lanes), for several bodies at once
//! where these are neighbours and have the same forces.
//!
//! # Cost
//!
//! 4 evaluations, 4 exponentials and 4 products of quaternions; of an evaluation a tie off the centre costs 100 operations, one at the
//! centre 40.

use super::Forces;
use super::rows::{
    Row, TILE, advance, apply, apply_transposed, cross, dot, exp, load, moved, one, product, renormalise,
    rotation, scaled, select, store, sum,
};
use crate::body::RigidBody;
use crate::force::{StatesInLanes, WrenchesInLanes};
use crate::series::WrenchTerm;
use crate::state::RigidBodyState;
use crate::tableau::RUNGE_KUTTA_4;
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use somersault_core::lanes::{Kernel, Lanes, WIDEST};

const ZERO: Row = Row([0.0; TILE]);
/// The centre of a tie that a body does not have, m: far from all that it has, and its cube is finite.
const FAR: f64 = 1e100;
/// How many powers |s|⁰ … |s|⁻³ a tie has.
const POWERS: usize = 4;

/// Forces along the way s from a centre to a point of a body.
struct Tie {
    centre: [Row; 3],
    /// In the principal frame.
    point: [Row; 3],
    /// cₙ, and dₙ of dampers.
    strengths: [[Row; POWERS]; 2],
    /// 1/|s| where s is zero: zero, where the force has a limit or none is exerted there, as by a spring, else NaN.
    at_zero: Row,
    has_points: bool,
}

impl Tie {
    fn new() -> Self {
        Self {
            centre: [Row([FAR; TILE]); 3],
            point: [ZERO; 3],
            strengths: [[ZERO; POWERS]; 2],
            at_zero: ZERO,
            has_points: false,
        }
    }

    /// Whether it is that of the body in entry `at` from a centre to a point, or of none.
    fn is_of(&self, at: usize, centre: &Vector3<f64>, point: &Vector3<f64>) -> bool {
        let of = |rows: &[Row; 3]| Vector3::from(rows.each_ref().map(|row| row.0[at]));
        of(&self.centre) == *centre && of(&self.point) == *point
    }
}

/// A force −k gap − c rate along the normal of a plane.
#[derive(Default)]
struct Plane {
    normal: [Row; 3],
    /// In the principal frame.
    point: [Row; 3],
    offset: Row,
    stiffness: Row,
    damping: Row,
}

/// The terms of the bodies of a tile.
#[derive(Default)]
struct Terms {
    /// World axes.
    force: [Row; 3],
    /// Of the principal frame.
    torque: [Row; 3],
    world_torque: [Row; 3],
    thrust: [Row; 3],
    angular_drag: Row,
    quadratic_drag: Row,
    /// A and B of A r + B v, by rows, where a body has them.
    linear: Option<[[[Row; 3]; 3]; 2]>,
    /// Constant forces at points: the force, and the point in the principal frame.
    pushes: Vec<[[Row; 3]; 2]>,
    ties: Vec<Tie>,
    planes: Vec<Plane>,
    /// Whether a term needs the axes of a body in the world.
    needs_axes: bool,
    has_drag: bool,
}

impl Terms {
    /// Adds the terms of the body in entry `at`, whose principal axes lie so in it. None has a [`foreign_power`].
    fn add(&mut self, at: usize, axes: &UnitQuaternion<f64>, terms: &[WrenchTerm]) {
        let of_body = |v: &Vector3<f64>| axes.inverse() * v;
        let [mut pushes, mut planes] = [0; 2];
        for term in terms {
            match term {
                WrenchTerm::Force(force) => add_vector(&mut self.force, at, force),
                WrenchTerm::ForceAtPoint { force, point } => {
                    if pushes == self.pushes.len() {
                        self.pushes.push([[ZERO; 3]; 2]);
                    }
                    let [forces, points] = &mut self.pushes[pushes];
                    add_vector(&mut self.force, at, force);
                    add_vector(forces, at, force);
                    add_vector(points, at, &of_body(point));
                    self.needs_axes = true;
                    pushes += 1;
                }
                WrenchTerm::Thrust(force) => {
                    add_vector(&mut self.thrust, at, &of_body(force));
                    self.needs_axes = true;
                }
                WrenchTerm::LinearForce { position, velocity } => {
                    let [of_position, of_velocity] = self.linear.get_or_insert([[[ZERO; 3]; 3]; 2]);
                    add_matrix(of_position, at, position);
                    add_matrix(of_velocity, at, velocity);
                }
                WrenchTerm::CentralForce { centre, point, strength, power, is_damper } => {
                    let point = of_body(point);
                    let none = Vector3::repeat(FAR);
                    let is_free =
                        |tie: &Tie| tie.is_of(at, centre, &point) || tie.is_of(at, &none, &Vector3::zeros());
                    let k = self.ties.iter().position(is_free).unwrap_or_else(|| {
                        self.ties.push(Tie::new());
                        self.ties.len() - 1
                    });
                    let tie = &mut self.ties[k];
                    set_vector(&mut tie.centre, at, centre);
                    set_vector(&mut tie.point, at, &point);
                    let n = -*power as usize;
                    tie.strengths[usize::from(*is_damper)][n].0[at] += strength;
                    // |s|¹⁻ⁿ, the size of the force, is bounded where s vanishes; |s · ṡ| is at most |s| |ṡ|
                    if n > 1 + usize::from(*is_damper) && *strength != 0.0 {
                        tie.at_zero.0[at] = f64::NAN;
                    }
                    tie.has_points |= point != Vector3::zeros();
                    self.needs_axes |= point != Vector3::zeros();
                }
                WrenchTerm::QuadraticDrag(c) => {
                    self.quadratic_drag.0[at] += c;
                    self.has_drag = true;
                }
                WrenchTerm::Torque(torque) => add_vector(&mut self.torque, at, &of_body(torque)),
                WrenchTerm::WorldTorque(torque) => {
                    add_vector(&mut self.world_torque, at, torque);
                    self.needs_axes = true;
                }
                WrenchTerm::AngularDrag(c) => self.angular_drag.0[at] += c,
                WrenchTerm::Support { normal, offset, point, stiffness, damping } => {
                    if planes == self.planes.len() {
                        self.planes.push(Plane::default());
                    }
                    let plane = &mut self.planes[planes];
                    set_vector(&mut plane.normal, at, normal);
                    set_vector(&mut plane.point, at, &of_body(point));
                    plane.offset.0[at] = *offset;
                    plane.stiffness.0[at] = *stiffness;
                    plane.damping.0[at] = *damping;
                    self.needs_axes = true;
                    planes += 1;
                }
            }
        }
    }
}

/// The power of a central force other than 0, −1, −2 and −3, if there is one.
pub(super) fn foreign_power(terms: &[WrenchTerm]) -> Option<f64> {
    terms.iter().find_map(|term| match term {
        WrenchTerm::CentralForce { power, .. } => {
            (0..POWERS).all(|n| *power != -(n as f64)).then_some(*power)
        }
        _ => None,
    })
}

fn add_vector(rows: &mut [Row; 3], at: usize, v: &Vector3<f64>) {
    rows.iter_mut().zip(v).for_each(|(row, x)| row.0[at] += x);
}

fn set_vector(rows: &mut [Row; 3], at: usize, v: &Vector3<f64>) {
    rows.iter_mut().zip(v).for_each(|(row, x)| row.0[at] = *x);
}

fn add_matrix(rows: &mut [[Row; 3]; 3], at: usize, m: &Matrix3<f64>) {
    for (i, rows) in rows.iter_mut().enumerate() {
        add_vector(rows, at, &m.row(i).transpose());
    }
}

/// States of up to [`TILE`] bodies.
pub(super) struct States {
    /// r, v, q (principal frame → world, real part first), ω (principal frame).
    r: [Row; 3],
    v: [Row; 3],
    q: [Row; 4],
    omega: [Row; 3],
}

impl States {
    /// All at rest.
    pub(super) fn new() -> Self {
        Self { r: [ZERO; 3], v: [ZERO; 3], q: [Row([1.0; TILE]), ZERO, ZERO, ZERO], omega: [ZERO; 3] }
    }

    /// The bodies `at..at + WIDTH`.
    #[inline(always)]
    pub(super) fn load<L: Lanes>(&self, l: L, at: usize) -> Stage<L> {
        Stage {
            r: load(l, &self.r, at),
            v: load(l, &self.v, at),
            q: load(l, &self.q, at),
            omega: load(l, &self.omega, at),
        }
    }

    /// Puts the bodies `at..at + WIDTH` there.
    #[inline(always)]
    pub(super) fn store<L: Lanes>(&mut self, l: L, at: usize, x: &Stage<L>) {
        store(l, x.r, &mut self.r, at);
        store(l, x.v, &mut self.v, at);
        store(l, x.q, &mut self.q, at);
        store(l, x.omega, &mut self.omega, at);
    }

    /// Takes the state of the body in entry `at` from others.
    pub(super) fn take(&mut self, at: usize, others: &Self) {
        let take = |rows: &mut [Row], others: &[Row]| {
            rows.iter_mut().zip(others).for_each(|(row, other)| row.0[at] = other.0[at]);
        };
        take(&mut self.r, &others.r);
        take(&mut self.v, &others.v);
        take(&mut self.q, &others.q);
        take(&mut self.omega, &others.omega);
    }
}

/// Forces on the bodies of a tile that are no sums of terms.
struct Others<'a> {
    bodies: Vec<&'a RigidBody>,
    /// On each of them.
    forces: Vec<Forces<'a>>,
    /// Whether a body has any.
    exist: bool,
    /// The rotation from the frame of each body to its principal frame: unit quaternions, real part first.
    to_principal: [Row; 4],
}

impl Others<'_> {
    /// Force in world axes and torque in the principal frame of the bodies `at..at + WIDTH` at a stage and at times.
    #[inline(always)]
    fn wrench<L: Lanes>(&self, l: L, at: usize, t: L::Vector, x: &Stage<L>) -> [[L::Vector; 3]; 2] {
        let axes = rotation(l, x.q);
        let [w, i, j, k] = product(l, x.q, load(l, &self.to_principal, at));
        let spin = apply(l, &axes, x.omega);
        let bodies = self.bodies.get(at..).unwrap_or_default();
        let mut on = StatesInLanes::new(&bodies[..bodies.len().min(L::WIDTH)]);
        l.store(t, &mut on.times[..L::WIDTH]);
        put(l, x.r, &mut on.position);
        put(l, [i, j, k, w], &mut on.orientation);
        put(l, x.v, &mut on.velocity);
        put(l, spin, &mut on.angular_velocity);
        let mut sums = WrenchesInLanes::default();
        self.add(at, &on, &mut sums);
        [taken(l, &sums.force), apply_transposed(l, &axes, taken(l, &sums.torque))]
    }

    /// Adds what acts on the bodies from `at` on.
    fn add(&self, at: usize, on: &StatesInLanes<'_>, sums: &mut WrenchesInLanes) {
        let forces = &self.forces[at.min(self.forces.len())..];
        let forces = &forces[..on.bodies().len()];
        let Some((first, others)) = forces.split_first() else { return };
        if others.iter().all(|forces| std::ptr::eq(*forces, *first)) {
            first.iter().for_each(|force| force.add_in_lanes(on, sums));
            return;
        }
        for (lane, forces) in forces.iter().enumerate() {
            let (alone, mut sum) = (on.alone(lane), WrenchesInLanes::default());
            forces.iter().for_each(|force| force.add_in_lanes(&alone, &mut sum));
            sums.add(lane, &sum.wrench(0));
        }
    }
}

#[inline(always)]
fn put<L: Lanes, const N: usize>(l: L, x: [L::Vector; N], rows: &mut [[f64; WIDEST]; N]) {
    for i in 0..N {
        l.store(x[i], &mut rows[i][..L::WIDTH]);
    }
}

#[inline(always)]
fn taken<L: Lanes>(l: L, rows: &[[f64; WIDEST]; 3]) -> [L::Vector; 3] {
    [l.load(&rows[0]), l.load(&rows[1]), l.load(&rows[2])]
}

/// Up to [`TILE`] bodies in their states under their terms and other forces.
pub(super) struct Moving<'a> {
    pub(super) states: States,
    terms: Terms,
    others: Others<'a>,
    /// (I₂ − I₃)/I₁ and cyclic, 1/I₁ and so on, 1/m.
    gyration: [Row; 3],
    inverse_moments: [Row; 3],
    inverse_mass: Row,
}

impl<'a> Moving<'a> {
    /// No bodies.
    pub(super) fn new() -> Self {
        let unit = [Row([1.0; TILE]), ZERO, ZERO, ZERO];
        Self {
            states: States::new(),
            terms: Terms::default(),
            others: Others { bodies: Vec::new(), forces: Vec::new(), exist: false, to_principal: unit },
            gyration: [ZERO; 3],
            inverse_moments: [ZERO; 3],
            inverse_mass: ZERO,
        }
    }

    /// Puts a body in a state under terms and other forces into the next entry.
    pub(super) fn add(
        &mut self,
        body: &'a RigidBody,
        x: &RigidBodyState,
        terms: &[WrenchTerm],
        forces: Forces<'a>,
    ) {
        let at = self.others.bodies.len();
        let (moments, axes) = (body.inertia().principal_moments(), body.inertia().principal_axes());
        for i in 0..3 {
            self.gyration[i].0[at] = (moments[(i + 1) % 3] - moments[(i + 2) % 3]) / moments[i];
            self.inverse_moments[i].0[at] = 1.0 / moments[i];
        }
        self.inverse_mass.0[at] = 1.0 / body.mass();
        let q = x.orientation() * axes;
        set_vector(&mut self.states.r, at, x.position());
        set_vector(&mut self.states.v, at, x.velocity());
        set_vector(&mut self.states.omega, at, &(q.inverse() * x.angular_velocity()));
        for (row, x) in self.states.q.iter_mut().zip([q.w, q.i, q.j, q.k]) {
            row.0[at] = x;
        }
        self.terms.add(at, axes, terms);
        let to_principal = axes.inverse();
        let parts = [to_principal.w, to_principal.i, to_principal.j, to_principal.k];
        for (row, x) in self.others.to_principal.iter_mut().zip(parts) {
            row.0[at] = x;
        }
        self.others.bodies.push(body);
        self.others.forces.push(forces);
        self.others.exist |= !forces.is_empty();
    }

    /// The state of the body in entry `at`.
    pub(super) fn state(&self, at: usize, body: &RigidBody) -> RigidBodyState {
        let vector = |rows: &[Row; 3]| Vector3::from(rows.each_ref().map(|row| row.0[at]));
        let States { r, v, q, omega } = &self.states;
        let [w, x, y, z] = q.each_ref().map(|row| row.0[at]);
        let q = UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z));
        RigidBodyState::new(
            vector(r),
            q * body.inertia().principal_axes().inverse(),
            vector(v),
            q * vector(omega),
        )
    }

    /// Acceleration in world axes and angular acceleration in the principal frame of the bodies `at..at + WIDTH` at a stage and at times.
    #[inline(always)]
    pub(super) fn accelerations<L: Lanes>(
        &self,
        l: L,
        at: usize,
        t: L::Vector,
        x: &Stage<L>,
    ) -> [[L::Vector; 3]; 2] {
        let [mut force, mut torque] = wrench(l, &self.terms, at, x);
        if self.others.exist {
            let of_others = self.others.wrench(l, at, t, x);
            force = sum(l, force, of_others[0]);
            torque = sum(l, torque, of_others[1]);
        }
        let [a, b, c] = x.omega;
        let products = [l.mul(b, c), l.mul(c, a), l.mul(a, b)];
        let inverse_moments = load(l, &self.inverse_moments, at);
        let of_torque = advance(l, [l.splat(0.0); 3], inverse_moments, torque);
        let spin_up = advance(l, of_torque, load(l, &self.gyration, at), products);
        [scaled(l, one(l, &self.inverse_mass, at), force), spin_up]
    }
}

/// Bodies of a tile, and what their fixed steps need. Entries that no body fills have no steps.
pub(super) struct ForcedTile<'a> {
    pub(super) bodies: Moving<'a>,
    /// When each body begins, its step, and how many it makes.
    t: Row,
    h: Row,
    steps: Row,
    most_steps: u64,
}

impl<'a> ForcedTile<'a> {
    /// A tile of bodies that are held.
    pub(super) fn new(bodies: Moving<'a>) -> Self {
        Self { bodies, t: ZERO, h: ZERO, steps: ZERO, most_steps: 0 }
    }

    /// Holds all bodies.
    pub(super) fn hold(&mut self) {
        (self.steps, self.most_steps) = (ZERO, 0);
    }

    /// Says how many steps of which size the body in entry `at` makes next, from a time on.
    pub(super) fn take(&mut self, at: usize, t: f64, h: f64, steps: u64) {
        self.t.0[at] = t;
        self.h.0[at] = h;
        self.steps.0[at] = steps as f64;
        self.most_steps = self.most_steps.max(steps);
    }
}

/// All steps of all bodies of a tile.
impl Kernel for &mut ForcedTile<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        for done in 0..self.most_steps {
            let done = lanes.splat(done as f64);
            for at in (0..TILE).step_by(L::WIDTH) {
                let moves = lanes.less(done, one(lanes, &self.steps, at));
                let x = self.bodies.states.load(lanes, at);
                let h = one(lanes, &self.h, at);
                let t = lanes.mul_add(done, h, one(lanes, &self.t, at));
                let next = step(lanes, &self.bodies, at, t, &x, h);
                let kept = Stage {
                    r: select(lanes, moves, next.r, x.r),
                    v: select(lanes, moves, next.v, x.v),
                    q: select(lanes, moves, next.q, x.q),
                    omega: select(lanes, moves, next.omega, x.omega),
                };
                self.bodies.states.store(lanes, at, &kept);
            }
        }
    }
}

/// Position, velocity, orientation and angular velocity of the bodies of a vector.
#[derive(Clone, Copy)]
pub(super) struct Stage<L: Lanes> {
    pub(super) r: [L::Vector; 3],
    pub(super) v: [L::Vector; 3],
    pub(super) q: [L::Vector; 4],
    pub(super) omega: [L::Vector; 3],
}

/// Force in world axes and torque in the principal frame at a stage.
#[inline(always)]
fn wrench<L: Lanes>(l: L, terms: &Terms, at: usize, x: &Stage<L>) -> [[L::Vector; 3]; 2] {
    let mut force = load(l, &terms.force, at);
    let mut torque = moved(l, one(l, &terms.angular_drag, at), x.omega, load(l, &terms.torque, at));
    if terms.has_drag {
        let speed = l.sqrt(dot(l, x.v, x.v));
        force = moved(l, l.mul(one(l, &terms.quadratic_drag, at), speed), x.v, force);
    }
    if let Some([of_position, of_velocity]) = &terms.linear {
        for i in 0..3 {
            let along = dot(l, load(l, &of_position[i], at), x.r);
            force[i] = l.add(force[i], l.add(along, dot(l, load(l, &of_velocity[i], at), x.v)));
        }
    }
    let unit = l.splat(1.0);
    let mut axes = [[unit; 3]; 3];
    if terms.needs_axes {
        axes = rotation(l, x.q);
        torque = sum(l, torque, apply_transposed(l, &axes, load(l, &terms.world_torque, at)));
        force = sum(l, force, apply(l, &axes, load(l, &terms.thrust, at)));
    }
    for [push, point] in &terms.pushes {
        let push = apply_transposed(l, &axes, load(l, push, at));
        torque = sum(l, torque, cross(l, load(l, point, at), push));
    }
    for tie in &terms.ties {
        let mut way = sub(l, x.r, load(l, &tie.centre, at));
        let mut rate = x.v;
        let point = load(l, &tie.point, at);
        if tie.has_points {
            way = sum(l, way, apply(l, &axes, point));
            rate = sum(l, rate, apply(l, &axes, cross(l, x.omega, point)));
        }
        let square = dot(l, way, way);
        let is_apart = l.less(l.splat(0.0), square);
        let inverse = l.select(is_apart, l.div(unit, l.sqrt(square)), one(l, &tie.at_zero, at));
        let [plain, damper] = &tie.strengths;
        let plain = horner(l, plain, at, inverse);
        let factor = l.mul_add(dot(l, way, rate), horner(l, damper, at, inverse), plain);
        let pull = scaled(l, factor, way);
        force = sum(l, force, pull);
        if tie.has_points {
            torque = sum(l, torque, cross(l, point, apply_transposed(l, &axes, pull)));
        }
    }
    for plane in &terms.planes {
        let (normal, point) = (load(l, &plane.normal, at), load(l, &plane.point, at));
        let place = sum(l, x.r, apply(l, &axes, point));
        let rate = sum(l, x.v, apply(l, &axes, cross(l, x.omega, point)));
        let gap = l.sub(dot(l, normal, place), one(l, &plane.offset, at));
        let damping = l.mul(one(l, &plane.damping, at), dot(l, normal, rate));
        let push = l.sub(l.splat(0.0), l.mul_add(one(l, &plane.stiffness, at), gap, damping));
        force = moved(l, push, normal, force);
        let of_body = apply_transposed(l, &axes, scaled(l, push, normal));
        torque = sum(l, torque, cross(l, point, of_body));
    }
    [force, torque]
}

/// x − y
#[inline(always)]
fn sub<L: Lanes>(l: L, x: [L::Vector; 3], y: [L::Vector; 3]) -> [L::Vector; 3] {
    [l.sub(x[0], y[0]), l.sub(x[1], y[1]), l.sub(x[2], y[2])]
}

/// Σ cₙ xⁿ
#[inline(always)]
fn horner<L: Lanes>(l: L, strengths: &[Row; POWERS], at: usize, x: L::Vector) -> L::Vector {
    let mut y = one(l, &strengths[POWERS - 1], at);
    for n in (0..POWERS - 1).rev() {
        y = l.mul_add(y, x, one(l, &strengths[n], at));
    }
    y
}

/// One step of h of the bodies `at..at + WIDTH`, which are at x at the times t.
#[inline(always)]
fn step<L: Lanes>(
    l: L,
    bodies: &Moving<'_>,
    at: usize,
    t: L::Vector,
    x: &Stage<L>,
    h: L::Vector,
) -> Stage<L> {
    let zero = [l.splat(0.0); 3];
    // Sums of velocities, accelerations and their turning counterparts, by the weights of the stages.
    let [mut way, mut gain, mut turn, mut spin_gain] = [zero; 4];
    // Those of the stage before.
    let [mut acceleration, mut spin_up] = [zero; 2];
    let mut stage = *x;
    let quarter = l.mul(h, l.splat(0.25));
    for (i, weight) in RUNGE_KUTTA_4.weights.factors.iter().enumerate() {
        if i > 0 {
            let node = l.mul(h, l.splat(RUNGE_KUTTA_4.nodes[i]));
            let mut displacement = stage.omega;
            if i == 2 {
                displacement = moved(l, quarter, cross(l, x.omega, stage.omega), stage.omega);
            }
            let half_angle = l.mul(node, l.splat(0.5));
            let (r, v) = (moved(l, node, stage.v, x.r), moved(l, node, acceleration, x.v));
            let q = product(l, x.q, exp(l, scaled(l, half_angle, displacement)));
            stage = Stage { r, v, q, omega: moved(l, node, spin_up, x.omega) };
        }
        let now = l.mul_add(h, l.splat(RUNGE_KUTTA_4.nodes[i]), t);
        [acceleration, spin_up] = bodies.accelerations(l, at, now, &stage);
        let weight = l.splat(*weight);
        way = moved(l, weight, stage.v, way);
        gain = moved(l, weight, acceleration, gain);
        turn = moved(l, weight, stage.omega, turn);
        spin_gain = moved(l, weight, spin_up, spin_gain);
    }
    let twelfth = l.mul(h, l.splat(1.0 / 12.0));
    let turn = moved(l, twelfth, cross(l, x.omega, stage.omega), turn);
    let half_angle = l.mul(h, l.splat(0.5));
    let q = renormalise(l, product(l, x.q, exp(l, scaled(l, half_angle, turn))));
    Stage { r: moved(l, h, way, x.r), v: moved(l, h, gain, x.v), q, omega: moved(l, h, spin_gain, x.omega) }
}
