//! Points of ℝᵐ × SO(3)ᵏ in one run of numbers, as the integrators move them.
//!
//! ```text
//! ℝ:      x ← x + h ẋ,            SO(3):  R ← R exp(h ω),   Ṙ = R ω̂
//! ```
//! Rates act from the right: angular velocities are in the axes of the body that turns, and brackets are
//! −x × y. A rotation is four numbers x, y, z, w here and three in its rate.

use nalgebra::Vector3;
use somersault_core::lie::so3;
use somersault_integrators::scratch::{OnHeap, Storage};
use somersault_integrators::state::{Configuration, ErrorSum, Rate, Tolerances};
use std::sync::Arc;

/// One factor of the group.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum Factor {
    /// A vector of up to three numbers, weighed by its length.
    Linear(usize),
    /// A number weighed against one radian.
    Angle,
    /// A rotation.
    Rotation,
}

/// A factor with the place of its numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Block {
    factor: Factor,
    at: usize,
    rate_at: usize,
}

/// The factors of a product, in their order.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(from = "Vec<Factor>", into = "Vec<Factor>")
)]
pub(crate) struct Layout(Arc<[Block]>);

impl From<Vec<Factor>> for Layout {
    fn from(factors: Vec<Factor>) -> Self {
        Self::new(factors)
    }
}

impl From<Layout> for Vec<Factor> {
    fn from(layout: Layout) -> Self {
        layout.0.iter().map(|block| block.factor).collect()
    }
}

impl Factor {
    /// Numbers of a point and of its rate.
    fn lengths(self) -> (usize, usize) {
        match self {
            Self::Linear(n) => (n, n),
            Self::Angle => (1, 1),
            Self::Rotation => (4, 3),
        }
    }
}

impl Layout {
    pub(crate) fn new(factors: impl IntoIterator<Item = Factor>) -> Self {
        let (mut at, mut rate_at) = (0, 0);
        let place = |factor| {
            let block = Block { factor, at, rate_at };
            let (numbers, rates) = Factor::lengths(factor);
            at += numbers;
            rate_at += rates;
            block
        };
        Self(factors.into_iter().map(place).collect())
    }

    fn rotations(&self) -> impl Iterator<Item = &Block> {
        self.0.iter().filter(|block| block.factor == Factor::Rotation)
    }

    /// A point at `numbers` with the given rates; the lengths are the caller's to check.
    pub(crate) fn state(&self, numbers: Vec<f64>, rates: Vec<f64>) -> (Coordinates, Rates) {
        (Coordinates { numbers, layout: self.clone() }, Rates { numbers: rates, layout: self.clone() })
    }
}

/// A point of ℝᵐ × SO(3)ᵏ: the positions q of a tree, say.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(try_from = "Parts"))]
pub struct Coordinates {
    numbers: Vec<f64>,
    layout: Layout,
}

/// A rate of [`Coordinates`], with angular velocities in body axes.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(try_from = "Parts"))]
pub struct Rates {
    numbers: Vec<f64>,
    layout: Layout,
}

/// A point or a rate as files hold it.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
struct Parts {
    numbers: Vec<f64>,
    layout: Vec<Factor>,
}

#[cfg(feature = "serde")]
impl Parts {
    /// The numbers, where `length` of the factors adds up to as many.
    fn checked(self, length: fn((usize, usize)) -> usize) -> Result<(Vec<f64>, Layout), &'static str> {
        if self.layout.iter().any(|factor| matches!(factor, Factor::Linear(n) if !(1..=3).contains(n))) {
            return Err("a linear factor must have one to three numbers");
        }
        if self.layout.iter().map(|factor| length(factor.lengths())).sum::<usize>() != self.numbers.len() {
            return Err("`numbers` must be as many as the factors of `layout` have");
        }
        Ok((self.numbers, Layout::new(self.layout)))
    }
}

#[cfg(feature = "serde")]
impl TryFrom<Parts> for Coordinates {
    type Error = &'static str;

    fn try_from(parts: Parts) -> Result<Self, Self::Error> {
        let (numbers, layout) = parts.checked(|(numbers, _)| numbers)?;
        // a NaN is not within
        if !layout
            .rotations()
            .all(|block| (so3::from_xyzw(&numbers[block.at..]).coords.norm() - 1.0).abs() <= 1e-9)
        {
            return Err("rotations must be of unit norm");
        }
        Ok(Self { numbers, layout })
    }
}

#[cfg(feature = "serde")]
impl TryFrom<Parts> for Rates {
    type Error = &'static str;

    fn try_from(parts: Parts) -> Result<Self, Self::Error> {
        let (numbers, layout) = parts.checked(|(_, rates)| rates)?;
        Ok(Self { numbers, layout })
    }
}

impl Coordinates {
    /// The numbers; for a tree the positions q of its [`Model`](crate::Model).
    pub fn as_slice(&self) -> &[f64] {
        &self.numbers
    }

    /// The rate of what stands still.
    pub(crate) fn still(&self) -> Rates {
        let n = self.layout.0.iter().map(|block| block.factor.lengths().1).sum();
        Rates { numbers: vec![0.0; n], layout: self.layout.clone() }
    }

    /// self ← numbers as [`as_slice`](Self::as_slice) gives them, rotations of unit norm; where there are not as many, those that
    /// there are.
    pub fn read(&mut self, numbers: &[f64]) {
        assign(&mut self.numbers, numbers);
    }
}

impl Rates {
    /// The numbers.
    pub fn as_slice(&self) -> &[f64] {
        &self.numbers
    }

    pub(crate) fn as_mut_slice(&mut self) -> &mut [f64] {
        &mut self.numbers
    }
}

fn triple(numbers: &[f64]) -> Vector3<f64> {
    Vector3::new(numbers[0], numbers[1], numbers[2])
}

/// The first `n` numbers from `at`, filled up with zeros.
fn vector(numbers: &[f64], at: usize, n: usize) -> Vector3<f64> {
    Vector3::from_fn(|i, _| if i < n { numbers[at + i] } else { 0.0 })
}

/// Overwrites the first numbers of `to`.
fn assign(to: &mut [f64], from: &[f64]) {
    to.iter_mut().zip(from).for_each(|(a, b)| *a = *b);
}

impl Storage for Rates {
    type Allocation = OnHeap;
}

impl Rate for Rates {
    fn dimension(&self) -> usize {
        self.numbers.len()
    }
    fn write(&self, out: &mut [f64]) {
        out.copy_from_slice(&self.numbers);
    }
    fn read(&mut self, numbers: &[f64]) {
        self.numbers.copy_from_slice(numbers);
    }
    fn assign(&mut self, other: &Self) {
        assign(&mut self.numbers, &other.numbers);
    }
    fn set_zero(&mut self) {
        self.numbers.fill(0.0);
    }
    fn scale(&mut self, a: f64) {
        self.numbers.iter_mut().for_each(|s| *s *= a);
    }
    fn axpy(&mut self, a: f64, x: &Self) {
        self.numbers.iter_mut().zip(&x.numbers).for_each(|(s, x)| *s += a * x);
    }
    fn add_bracket(&mut self, a: f64, x: &Self, y: &Self) {
        let Self { numbers, layout } = self;
        for Block { rate_at: i, .. } in layout.rotations() {
            let bracket = triple(&y.numbers[*i..]).cross(&triple(&x.numbers[*i..])) * a;
            numbers[*i..].iter_mut().zip(&bracket).for_each(|(s, b)| *s += b);
        }
    }
    fn dexp_inv(&mut self, u: &Self) {
        let Self { numbers, layout } = self;
        for Block { rate_at: i, .. } in layout.rotations() {
            let carried = so3::dexp_inv(&-triple(&u.numbers[*i..]), &triple(&numbers[*i..]));
            assign(&mut numbers[*i..], carried.as_slice());
        }
    }
    fn angle(&self) -> f64 {
        let angle = |block: &Block| triple(&self.numbers[block.rate_at..]).norm();
        self.layout.rotations().map(angle).fold(0.0, f64::max)
    }
    fn is_finite(&self) -> bool {
        self.numbers.iter().all(|x| x.is_finite())
    }
    fn weigh(&self, other: &Self, error: &Self, tolerances: &Tolerances, sum: &mut ErrorSum) {
        for block in self.layout.0.iter() {
            let n = match block.factor {
                Factor::Linear(n) => n,
                Factor::Angle => 1,
                Factor::Rotation => 3,
            };
            let part = |rates: &Self| vector(&rates.numbers, block.rate_at, n);
            sum.add(&part(error), part(self).norm().max(part(other).norm()), tolerances);
        }
    }
    fn weigh_all(&self, other: &Self, error: &Self, tolerances: &Tolerances, sum: &mut ErrorSum) {
        self.weigh(other, error, tolerances, sum);
    }
}

impl Storage for Coordinates {
    type Allocation = OnHeap;
}

impl Configuration for Coordinates {
    type Rate = Rates;
    fn assign(&mut self, other: &Self) {
        assign(&mut self.numbers, &other.numbers);
    }
    fn drift(&mut self, rate: &Rates, h: f64) {
        let Self { numbers, layout } = self;
        for block in layout.0.iter() {
            let mut add = |n: usize| {
                let rates = &rate.numbers[block.rate_at..block.rate_at + n];
                numbers[block.at..block.at + n].iter_mut().zip(rates).for_each(|(x, v)| *x += h * v);
            };
            match block.factor {
                Factor::Linear(n) => add(n),
                Factor::Angle => add(1),
                Factor::Rotation => {
                    let numbers = &mut numbers[block.at..block.at + 4];
                    let moved =
                        so3::from_xyzw(numbers) * so3::exp(&(triple(&rate.numbers[block.rate_at..]) * h));
                    assign(numbers, moved.coords.as_slice());
                }
            }
        }
    }
    fn difference(&self, from: &Self, out: &mut Rates) {
        for block in self.layout.0.iter() {
            let n = match block.factor {
                Factor::Linear(n) => n,
                Factor::Angle => 1,
                Factor::Rotation => {
                    let (start, end) = (
                        so3::from_xyzw(&from.numbers[block.at..]),
                        so3::from_xyzw(&self.numbers[block.at..]),
                    );
                    let turn = so3::log(&(start.inverse() * end));
                    assign(&mut out.numbers[block.rate_at..], turn.as_slice());
                    continue;
                }
            };
            for i in 0..n {
                out.numbers[block.rate_at + i] = self.numbers[block.at + i] - from.numbers[block.at + i];
            }
        }
    }
    fn renormalize(&mut self) {
        let Self { numbers, layout } = self;
        for Block { at, .. } in layout.rotations() {
            let unit = so3::renormalize(&so3::from_xyzw(&numbers[*at..]));
            assign(&mut numbers[*at..], unit.coords.as_slice());
        }
    }
    fn is_finite(&self) -> bool {
        self.numbers.iter().all(|x| x.is_finite())
    }
    fn weigh(&self, other: &Self, error: &Rates, tolerances: &Tolerances, sum: &mut ErrorSum) {
        for block in self.layout.0.iter() {
            let (n, size) = match block.factor {
                Factor::Linear(n) => {
                    let length = |x: &Self| vector(&x.numbers, block.at, n).norm();
                    (n, length(self).max(length(other)))
                }
                Factor::Angle => (1, 1.0),
                Factor::Rotation => (3, 1.0),
            };
            sum.add(&vector(&error.numbers, block.rate_at, n), size, tolerances);
        }
    }
    fn weigh_all(&self, other: &Self, error: &Rates, tolerances: &Tolerances, sum: &mut ErrorSum) {
        self.weigh(other, error, tolerances, sum);
    }
}
