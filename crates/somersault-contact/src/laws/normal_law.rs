//! What a normal law is.

use super::value::LawValue;
use somersault_core::quadrature::GAUSS_3;
use somersault_integrators::events::Guard;
use std::any::Any;

/// The force of a normal law at its greatest in a contact, and its derivatives there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stiffest {
    /// Force, N.
    pub force: f64,
    /// Its derivative by the penetration, N/m.
    pub stiffness: f64,
    /// Its derivative by the rate of penetration, N s/m.
    pub damping: f64,
}

/// A direction in which a normal law is differentiated.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct NormalChange {
    /// Of the gap.
    pub gap: f64,
    /// Of its rate.
    pub rate: f64,
    /// The parameter of the law that grows at the rate 1, by its place in [`NormalLaw::parameters`].
    pub parameter: Option<usize>,
}

impl NormalChange {
    /// The changes of the N parameters of a law, in their order.
    #[inline]
    pub fn parameters<const N: usize>(&self) -> [f64; N] {
        unit(self.parameter)
    }
}

/// A vector of zeros with a one at some place.
#[inline]
pub(super) fn unit<const N: usize>(place: Option<usize>) -> [f64; N] {
    std::array::from_fn(|i| if place == Some(i) { 1.0 } else { 0.0 })
}

/// Derivatives of a normal law in some direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormalDerivative {
    /// Of the force in contact.
    pub force: f64,
    /// Of the lag.
    pub lag: f64,
}

/// A force along the normal as a function of the gap Δx (m, negative inside the surface) and its rate Δẋ (m/s).
///
/// The law acts where its [guard](Self::guard) is inside,
/// ```text
/// F = F_c(Δx, Δẋ)   where Δx + τ(Δx, Δẋ) max(Δẋ, 0) < 0,   F = 0 elsewhere,
/// ```
/// with the force F_c in contact and the lag τ ≥ 0. F_c is evaluated on both sides of the guard, since a step is
/// made in one mode and cut afterwards: it must be finite there, and a method of order p keeps its order where F_c
/// has p continuous derivatives up to the guard and across it.
///
/// A contact that is released should pull nowhere: where F_c falls to zero as the surfaces part, at the speed Δẋ₀ > 0,
/// the lag is −Δx/Δẋ₀. Then the force is continuous at release.
///
/// | Required | |
/// |---|---|
/// | [`force_in_contact`](Self::force_in_contact), [`lag`](Self::lag) | F_c and τ |
/// | [`energy`](Self::energy) | ∫ F_c d(−Δx) without damping: the judge of fixed steps in stiff contacts |
/// | [`stiffest`](Self::stiffest) | how steep F_c is at most: steps in contact are divided by it |
///
/// | Provided | unless overridden |
/// |---|---|
/// | [`impulse`](Self::impulse) | by quadrature, of order 4 |
/// | [`is_damped`](Self::is_damped) | it may be |
/// | [`derivative`](Self::derivative), [`parameters`](Self::parameters) | none: sensitivities refuse the law by name |
///
/// ```
/// use somersault_contact::laws::{NormalChange, NormalDerivative, NormalLaw, Stiffest};
///
/// /// A spring that hardens, F = k x + b x² with the penetration x = −Δx.
/// #[derive(Debug, PartialEq)]
/// struct Hardening { k: f64, b: f64 }
///
/// impl NormalLaw for Hardening {
///     fn force_in_contact(&self, gap: f64, _: f64) -> f64 {
///         -self.k * gap + self.b * gap * gap
///     }
///     fn lag(&self, _: f64, _: f64) -> f64 {
///         0.0
///     }
///     fn energy(&self, gap: f64) -> f64 {
///         let x = (-gap).max(0.0);
///         x * x * (self.k / 2.0 + self.b * x / 3.0)
///     }
///     fn stiffest(&self, gap: f64, rate: f64, mass: f64) -> Stiffest {
///         // The spring of constant k alone lets the mass go deeper.
///         let x = (gap * gap + mass * rate * rate / self.k).sqrt();
///         Stiffest { force: (self.k + self.b * x) * x, stiffness: self.k + 2.0 * self.b * x, damping: 0.0 }
///     }
///     fn is_damped(&self) -> bool {
///         false
///     }
///     fn parameters(&self) -> &'static [&'static str] {
///         &["k", "b"]
///     }
///     fn derivative(&self, gap: f64, _: f64, along: &NormalChange) -> Option<NormalDerivative> {
///         let [k, b] = along.parameters();
///         let by_gap = -self.k + 2.0 * self.b * gap;
///         Some(NormalDerivative { force: by_gap * along.gap - k * gap + b * gap * gap, lag: 0.0 })
///     }
/// }
///
/// assert_eq!(Hardening { k: 100.0, b: 1e3 }.force(-0.1, 0.0), 20.0);
/// ```
pub trait NormalLaw: LawValue {
    /// F_c, N: the force frozen in contact.
    fn force_in_contact(&self, gap: f64, rate: f64) -> f64;

    /// τ ≥ 0, s, also above the surface; see [`Guard`].
    fn lag(&self, gap: f64, rate: f64) -> f64;

    /// Energy that is stored at a gap, J; zero above the surface.
    fn energy(&self, gap: f64) -> f64;

    /// Force, stiffness and damping where a mass (kg) comes from a gap and its rate if nothing is lost on the way, or
    /// upper bounds of them.
    fn stiffest(&self, gap: f64, rate: f64, mass: f64) -> Stiffest;

    /// ∫ F_c dt over a step of h in contact, N s, from gap and rate at its ends.
    ///
    /// By default Gauss' rule of three points on the cubic through the four numbers and on its derivative: of order 4 in
    /// h, and exact for linear laws on that cubic.
    fn impulse(&self, h: f64, before: &Guard, after: &Guard) -> f64 {
        let step = |s: f64| {
            let (gap, rate) = between(h, before, after, s);
            self.force_in_contact(gap, rate)
        };
        h * GAUSS_3.map(|(s, w)| w * step(s)).iter().sum::<f64>()
    }

    /// Whether F_c depends on the rate of the gap.
    fn is_damped(&self) -> bool {
        true
    }

    /// Whether F_c jumps where the gap closes, so that motions that graze the surface have no derivative.
    fn jumps(&self) -> bool {
        self.force_in_contact(0.0, -1.0) != 0.0
    }

    /// The names of the constants by which the law can be differentiated.
    fn parameters(&self) -> &'static [&'static str] {
        &[]
    }

    /// Derivatives of F_c and τ in contact along a change of gap, rate and one parameter; `None` where the law has none.
    fn derivative(&self, _gap: f64, _rate: f64, _along: &NormalChange) -> Option<NormalDerivative> {
        None
    }

    /// The guard that is inside exactly where the law acts.
    #[inline(always)]
    fn guard(&self, gap: f64, rate: f64) -> Guard {
        Guard { gap, rate, lag: self.lag(gap, rate) }
    }

    /// The force of the law, N: F_c where it acts, zero elsewhere.
    #[inline]
    fn force(&self, gap: f64, rate: f64) -> f64 {
        if self.guard(gap, rate).is_inside() { self.force_in_contact(gap, rate) } else { 0.0 }
    }
}

impl dyn NormalLaw {
    /// The law itself, where it is of the type `L`.
    pub fn downcast_ref<L: NormalLaw>(&self) -> Option<&L> {
        (self as &dyn Any).downcast_ref()
    }
}

impl PartialEq for dyn NormalLaw {
    fn eq(&self, other: &Self) -> bool {
        self.is_equal(other as &dyn Any)
    }
}

/// Gap and rate at the part s of a step of h, by the cubic through both at its ends.
pub(super) fn between(h: f64, before: &Guard, after: &Guard, s: f64) -> (f64, f64) {
    let (first, last, r) = (h * before.rate, h * after.rate, 1.0 - s);
    let gap =
        r * r * ((1.0 + 2.0 * s) * before.gap + s * first) + s * s * ((3.0 - 2.0 * s) * after.gap - r * last);
    let rate = 6.0 * r * s * (after.gap - before.gap) / h
        + r * (1.0 - 3.0 * s) * before.rate
        + s * (3.0 * s - 2.0) * after.rate;
    (gap, rate)
}
