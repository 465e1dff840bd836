//! The step of a free body, for a tile of bodies at once.
//!
//! With principal moments I₁, I₂, I₃ and the angular velocity ω in the principal frame, Euler's
//! equations and the kinematics of the unit quaternion q (principal frame → world) read
//!
//! ω̇₁ = (I₂ − I₃)/I₁ ω₂ω₃ and cyclic, q̇ = ½ q ⊗ (0, ω).
//!
//! One step of the fourth-order Runge–Kutta–Munthe-Kaas method (classical tableau, dexp⁻¹ truncated
//! after the first bracket) in the body frame, where the exponential acts from the right and the
//! brackets change sign:
//!
//! q ← q ⊗ exp(h/6 (ω⁽¹⁾ + 2ω⁽²⁾ + 2ω⁽³⁾ + ω⁽⁴⁾) + h²/12 ω⁽¹⁾ × ω⁽⁴⁾), where ω⁽¹⁾…ω⁽⁴⁾ are the
//! stages of the classical method for Euler's equations, which do not contain q, so that the inner
//! exponentials are not needed.
//!
//! The kernel works with the half-angle per step, v = hω/2, and with the products p = (v₂v₃, v₃v₁,
//! v₁v₂). In these h disappears: with a = ((I₂ − I₃)/I₁, …) taken entry by entry, v changes by 2ap
//! in one step, so that
//!
//! - v⁽²⁾ = v + a p⁽¹⁾, v⁽³⁾ = v + a p⁽²⁾, v⁽⁴⁾ = v + d with d = 2a p⁽³⁾
//! - v̄ = v + a/3 (p⁽¹⁾ + p⁽²⁾ + p⁽³⁾), which is the weighted mean of the stages
//! - v ← v̄ + a/3 (p⁽²⁾ + p⁽³⁾ + p⁽⁴⁾)
//! - q ← q ⊗ (cos |φ|, sin |φ| φ/|φ|) with φ = v̄ + v × d/6, then q ← q (3 − |q|²)/2.
//!
//! That v × v⁽⁴⁾ = v × d keeps the product small in small steps and zero where the axis rests.
//!
//! # Cost
//!
//! 141 floating-point operations (a fused multiply–add counts two) in 92 instructions, while |φ| <
//! π/4: 51 for v, 15 for φ, 5 for |φ|², 26 for the two polynomials, 3 + 28 for the product and 13
//! for the renormalisation. A vector with a larger half-angle in any lane costs 44 more, among them
//! a square root and a division.
//!
//! # Sources
//!
//! Munthe-Kaas, *High order Runge–Kutta methods on manifolds*, Appl. Numer. Math. 29 (1999);
//! Iserles, Munthe-Kaas, Nørsett and Zanna, *Lie-group methods*, Acta Numerica 9 (2000).

use super::rows::{
    Row, TILE, advance, apply, apply_transposed, cross, divided, exp, load, one, product, renormalise,
    rotation, scaled, select, store, sum,
};
use super::{STEPS_PER_LOOK, in_parts, moves};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use somersault_core::cancel::CancellationToken;
use somersault_core::lanes::{InstructionSet, Kernel, Lanes};

/// The state of up to [`TILE`] bodies and what their steps need.
///
/// Entries that no body fills have no steps: what they are makes no difference.
pub(super) struct Tile {
    /// I₁, I₂, I₃.
    moments: [Row; 3],
    /// a = (I₂ − I₃)/I₁ and cyclic.
    a: [Row; 3],
    /// 2a.
    a_double: [Row; 3],
    /// a/3.
    a_third: [Row; 3],
    /// The principal axes in the body: principal frame → body, real part first.
    axes: [Row; 4],
    /// v = hω/2 in the principal frame during the steps, and ω otherwise.
    v: [Row; 3],
    /// q, principal frame → world, real part first.
    q: [Row; 4],
    /// h/2, and 1 for a body without steps.
    half_step: Row,
    /// How many steps each body takes.
    steps: Row,
    /// The least and the largest of them among the bodies present.
    steps_range: (u64, u64),
}

impl Tile {
    /// A tile of bodies at rest, to be filled by [`set`](Self::set).
    pub(super) fn new() -> Self {
        let (zero, one) = (Row::default(), Row([1.0; TILE]));
        Self {
            moments: [one; 3],
            a: [zero; 3],
            a_double: [zero; 3],
            a_third: [zero; 3],
            axes: [one, zero, zero, zero],
            v: [zero; 3],
            q: [one, zero, zero, zero],
            half_step: one,
            steps: zero,
            steps_range: (u64::MAX, 0),
        }
    }

    /// Puts a body into entry `at`: its principal moments and axes, its orientation and its angular velocity.
    #[inline(always)]
    pub(super) fn set(
        &mut self,
        at: usize,
        moments: &Vector3<f64>,
        axes: &UnitQuaternion<f64>,
        orientation: &UnitQuaternion<f64>,
        omega: &Vector3<f64>,
    ) {
        set(&mut self.moments, at, (*moments).into());
        set(&mut self.axes, at, real_part_first(axes));
        set(&mut self.q, at, real_part_first(orientation));
        set(&mut self.v, at, (*omega).into());
    }

    /// The orientation and the angular velocity of the body in entry `at`.
    #[inline(always)]
    pub(super) fn get(&self, at: usize) -> (UnitQuaternion<f64>, Vector3<f64>) {
        let [w, x, y, z] = self.q.each_ref().map(|row| row.0[at]);
        let omega = self.v.each_ref().map(|row| row.0[at]);
        (UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z)), omega.into())
    }

    /// As [`turn`](Self::turn) for bodies whose orientations are those of the body frame, and angular velocities in world axes.
    pub(super) fn turn_in_world<const PARTS: usize>(
        &mut self,
        instructions: InstructionSet,
        bodies: usize,
        parts: [&[(f64, u64); TILE]; PARTS],
        token: &CancellationToken,
    ) {
        instructions.run(ByVector(self, Enter));
        self.turn(instructions, bodies, parts, token);
        instructions.run(ByVector(self, Leave));
    }

    /// Has the steps of the bodies in the first entries made, by the size and the number of the steps of each: those of `parts[0]`, then
    /// those of `parts[1]` and so on. Orientations are those of the principal frames, and angular velocities have their components there.
    ///
    /// A body without steps, or with steps of no size, stays as it is to the last bit. Where the token is cancelled some of the steps are not
    /// made.
    pub(super) fn turn<const PARTS: usize>(
        &mut self,
        instructions: InstructionSet,
        bodies: usize,
        parts: [&[(f64, u64); TILE]; PARTS],
        token: &CancellationToken,
    ) {
        instructions.run(ByVector(self, Ratios));
        for part in parts {
            if part[..bodies].iter().all(|(h, steps)| !moves(*h, *steps)) {
                continue;
            }
            for (half, (h, steps)) in self.half_step.0.iter_mut().zip(part) {
                *half = if moves(*h, *steps) { 0.5 * h } else { 1.0 };
            }
            instructions.run(ByVector(self, Scale));
            in_parts(part[..bodies].iter().copied(), STEPS_PER_LOOK, token, |next| {
                self.steps_range = (u64::MAX, 0);
                for (row, (_, steps)) in self.steps.0.iter_mut().zip(&next[..bodies]) {
                    *row = *steps as f64;
                    self.steps_range = (self.steps_range.0.min(*steps), self.steps_range.1.max(*steps));
                }
                instructions.run(&mut *self);
            });
            instructions.run(ByVector(self, Unscale));
        }
    }
}

/// Real part first.
fn real_part_first(q: &UnitQuaternion<f64>) -> [f64; 4] {
    [q.w, q.i, q.j, q.k]
}

#[inline(always)]
fn set<const N: usize>(rows: &mut [Row; N], at: usize, x: [f64; N]) {
    for i in 0..N {
        rows[i].0[at] = x[i];
    }
}

/// What is done to the bodies `at..at + WIDTH` of a tile.
trait Pass {
    fn at<L: Lanes>(l: L, tile: &mut Tile, at: usize);
}

/// A pass over all bodies of a tile.
struct ByVector<'a, P>(&'a mut Tile, P);

impl<P: Pass> Kernel for ByVector<'_, P> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, l: L) {
        for at in (0..TILE).step_by(L::WIDTH) {
            P::at(l, self.0, at);
        }
    }
}

/// Finds the ratios of the moments.
struct Ratios;

impl Pass for Ratios {
    #[inline(always)]
    fn at<L: Lanes>(l: L, tile: &mut Tile, at: usize) {
        let m = load(l, &tile.moments, at);
        let mut a = [l.splat(0.0); 3];
        for i in 0..3 {
            a[i] = l.div(l.sub(m[(i + 1) % 3], m[(i + 2) % 3]), m[i]);
        }
        store(l, a, &mut tile.a, at);
        store(l, scaled(l, l.splat(2.0), a), &mut tile.a_double, at);
        store(l, divided(l, a, l.splat(3.0)), &mut tile.a_third, at);
    }
}

/// Takes the principal frame in the place of the body frame and of the world axes of ω.
struct Enter;

impl Pass for Enter {
    #[inline(always)]
    fn at<L: Lanes>(l: L, tile: &mut Tile, at: usize) {
        let q = product(l, load(l, &tile.q, at), load(l, &tile.axes, at));
        store(l, q, &mut tile.q, at);
        let omega = apply_transposed(l, &rotation(l, q), load(l, &tile.v, at));
        store(l, omega, &mut tile.v, at);
    }
}

/// The opposite of [`Enter`].
struct Leave;

impl Pass for Leave {
    #[inline(always)]
    fn at<L: Lanes>(l: L, tile: &mut Tile, at: usize) {
        let q = load(l, &tile.q, at);
        let omega = apply(l, &rotation(l, q), load(l, &tile.v, at));
        store(l, omega, &mut tile.v, at);
        let [w, x, y, z] = load(l, &tile.axes, at);
        let zero = l.splat(0.0);
        let back = [w, l.sub(zero, x), l.sub(zero, y), l.sub(zero, z)];
        store(l, product(l, q, back), &mut tile.q, at);
    }
}

/// Takes v = hω/2 in the place of ω.
struct Scale;

impl Pass for Scale {
    #[inline(always)]
    fn at<L: Lanes>(l: L, tile: &mut Tile, at: usize) {
        let v = scaled(l, one(l, &tile.half_step, at), load(l, &tile.v, at));
        store(l, v, &mut tile.v, at);
    }
}

/// The opposite of [`Scale`].
struct Unscale;

impl Pass for Unscale {
    #[inline(always)]
    fn at<L: Lanes>(l: L, tile: &mut Tile, at: usize) {
        let omega = divided(l, load(l, &tile.v, at), one(l, &tile.half_step, at));
        store(l, omega, &mut tile.v, at);
    }
}

/// All steps of all bodies of a tile.
impl Kernel for &mut Tile {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let (least, largest) = self.steps_range;
        for _ in 0..least.min(largest) {
            for at in (0..TILE).step_by(L::WIDTH) {
                let (v, q) = step(lanes, self, at);
                store(lanes, v, &mut self.v, at);
                store(lanes, q, &mut self.q, at);
            }
        }
        for done in least..largest {
            let done = lanes.splat(done as f64);
            for at in (0..TILE).step_by(L::WIDTH) {
                let moves = lanes.less(done, lanes.load(&self.steps.0[at..at + L::WIDTH]));
                let (v, q) = step(lanes, self, at);
                let v = select(lanes, moves, v, load(lanes, &self.v, at));
                let q = select(lanes, moves, q, load(lanes, &self.q, at));
                store(lanes, v, &mut self.v, at);
                store(lanes, q, &mut self.q, at);
            }
        }
    }
}

/// One step of the bodies `at..at + WIDTH`: their next v and q.
#[inline(always)]
fn step<L: Lanes>(l: L, tile: &Tile, at: usize) -> ([L::Vector; 3], [L::Vector; 4]) {
    let v = load(l, &tile.v, at);
    let a = load(l, &tile.a, at);
    let a_double = load(l, &tile.a_double, at);
    let a_third = load(l, &tile.a_third, at);

    let p1 = products(l, v);
    let p2 = products(l, advance(l, v, a, p1));
    let p3 = products(l, advance(l, v, a, p2));
    let d = [l.mul(a_double[0], p3[0]), l.mul(a_double[1], p3[1]), l.mul(a_double[2], p3[2])];
    let v4 = sum(l, v, d);
    let p4 = products(l, v4);
    let p23 = sum(l, p2, p3);
    let mean = advance(l, v, a_third, sum(l, p1, p23));
    let v_next = advance(l, mean, a_third, sum(l, p23, p4));

    let sixth = l.splat(1.0 / 6.0);
    let phi = advance(l, mean, [sixth; 3], cross(l, v, d));
    let q_next = renormalise(l, product(l, load(l, &tile.q, at), exp(l, phi)));
    (v_next, q_next)
}

/// (v₂v₃, v₃v₁, v₁v₂)
#[inline(always)]
fn products<L: Lanes>(l: L, v: [L::Vector; 3]) -> [L::Vector; 3] {
    [l.mul(v[1], v[2]), l.mul(v[2], v[0]), l.mul(v[0], v[1])]
}
