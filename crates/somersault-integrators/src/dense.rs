//! Dense output: the state between the ends of a step, on the group.
//!
//! A segment is q(θ) = exp(σ(θ)) q₀, p(θ) = p₀ + π(θ) with polynomials σ, π in θ = (t − t₀)/h that
//! vanish at θ = 0, so that q(θ) stays on the group and is met exactly at the start.

use crate::state::{Configuration, Rate, State};
use crate::system::{Decoder, RateOf, StateOf, System};

/// The curve of one step.
#[derive(Debug, Clone)]
pub struct Segment<Q: Configuration> {
    /// Time at the start.
    pub t: f64,
    /// Length in time.
    pub h: f64,
    /// State at the start.
    pub start: State<Q>,
    /// Coefficients of θ, θ², … in the displacement σ of the configuration.
    pub displacement: Vec<Q::Rate>,
    /// Coefficients of θ, θ², … in the change of the rate.
    pub change: Vec<Q::Rate>,
}

impl<Q: Configuration> Segment<Q> {
    /// Cubic Hermite interpolation between two states, with the velocities and accelerations there.
    pub fn hermite<S: System<Configuration = Q>>(
        system: &S,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        after: &StateOf<S>,
    ) -> Self {
        let mut w = system.workspace();
        let zero = || {
            let mut r: RateOf<S> = x.rate.clone();
            r.set_zero();
            r
        };
        // σ(1) and the slopes σ'(0) = h v₀, σ'(1) = h dexp⁻¹_{σ(1)}(v₁).
        let (mut jump, mut first, mut last) = (zero(), zero(), zero());
        after.configuration.difference(&x.configuration, &mut jump);
        system.velocity(&mut w, t, x, &mut first);
        system.velocity(&mut w, t + h, after, &mut last);
        last.dexp_inv(&jump);
        let displacement = cubic(&jump, &first, &last, h);
        let mut jump = after.rate.clone();
        jump.axpy(-1.0, &x.rate);
        system.acceleration(&mut w, t, x, &mut first);
        system.acceleration(&mut w, t + h, after, &mut last);
        let change = cubic(&jump, &first, &last, h);
        Self { t, h, start: x.clone(), displacement, change }
    }
}

impl<Q: Configuration> Interpolant<Q> for Segment<Q> {
    fn evaluate(&self, t: f64, out: &mut State<Q>) {
        let theta = (t - self.t) / self.h;
        let mut sum = self.start.rate.clone();
        polynomial(&self.displacement, theta, &mut sum);
        out.configuration.assign(&self.start.configuration);
        out.configuration.drift(&sum, 1.0);
        polynomial(&self.change, theta, &mut sum);
        out.rate.assign(&self.start.rate);
        out.rate.axpy(1.0, &sum);
    }
}

/// Coefficients of the cubic with value 0 and `jump` and slopes h·`first` and h·`last` at the ends.
fn cubic<V: Rate>(jump: &V, first: &V, last: &V, h: f64) -> Vec<V> {
    let combine = |a: f64, b: f64, c: f64| {
        let mut sum = jump.clone();
        sum.set_zero();
        sum.axpy(a, jump);
        sum.axpy(b * h, first);
        sum.axpy(c * h, last);
        sum
    };
    vec![combine(0.0, 1.0, 0.0), combine(3.0, -2.0, -1.0), combine(-2.0, 1.0, 1.0)]
}

/// Σ c_k θᵏ⁺¹.
fn polynomial<V: Rate>(coefficients: &[V], theta: f64, out: &mut V) {
    out.set_zero();
    let mut power = 1.0;
    for c in coefficients {
        power *= theta;
        out.axpy(power, c);
    }
}

/// A curve through the states of a step.
pub trait Interpolant<Q: Configuration>: Send + Sync {
    /// The state at time `t`.
    fn evaluate(&self, t: f64, out: &mut State<Q>);
}

/// A curve in the variables of a form, read as states of the bodies.
pub struct Decoded<B: Configuration, D> {
    /// The curve in the variables of the form.
    pub curve: Box<dyn Interpolant<B>>,
    /// A state of the size of those of the form.
    pub pattern: State<B>,
    /// The way back.
    pub decoder: D,
}

impl<B, Q, D> Interpolant<Q> for Decoded<B, D>
where
    B: Configuration,
    Q: Configuration,
    D: Decoder<B, Q>,
{
    fn evaluate(&self, t: f64, out: &mut State<Q>) {
        let mut x = self.pattern.clone();
        self.curve.evaluate(t, &mut x);
        self.decoder.decode(&x, out);
    }
}
