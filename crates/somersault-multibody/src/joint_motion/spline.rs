//! Channels that are uniform splines.

use super::elimination::{Solved, solve};
use super::{Condition, EigenpostureBase, JointMotionError, expect_fractions};
use nalgebra::{DMatrix, DVector};
use somersault_core::argument::{expect_finite, expect_length};
use somersault_core::spline::UniformBasis;

/// A joint motion whose channels are splines, after elimination of the conditions at its ends.
///
/// Time is the fraction of the duration, in [0, 1]; rates are by the fraction. Coefficients are stored channel by channel, and
/// so are the parameters, each of which is a coefficient that was not solved for. There may be 10 000 coefficients.
#[derive(Debug, Clone, PartialEq)]
pub struct SplineMotion {
    basis: UniformBasis,
    base: EigenpostureBase,
    offset: Vec<f64>,
    terms: Vec<Dependence>,
    /// Coefficient that each parameter is.
    parameters: Vec<usize>,
}

/// Coefficients of all channels together: a dense Hessian of so many variables takes a gigabyte with its pattern.
pub(crate) const MAX_COEFFICIENTS: usize = 10_000;

/// One entry of E.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Dependence {
    coefficient: usize,
    parameter: usize,
    factor: f64,
}

impl SplineMotion {
    /// Splines of `basis` as the channels of `base`, each under the same `conditions`.
    pub fn try_new(
        basis: UniformBasis,
        base: EigenpostureBase,
        conditions: &[Condition],
    ) -> Result<Self, JointMotionError> {
        let each = vec![conditions; base.n_weights()];
        Self::with_conditions(basis, base, &each)
    }

    /// The same with conditions of its own for each channel.
    pub fn with_conditions<C: AsRef<[Condition]>>(
        basis: UniformBasis,
        base: EigenpostureBase,
        conditions: &[C],
    ) -> Result<Self, JointMotionError> {
        expect_length("conditions", conditions.len(), base.n_weights())?;
        let n = basis.n_coefficients();
        Self::expect_coefficients(conditions.len(), n)?;
        let mut motion = Self {
            basis,
            base,
            offset: vec![0.0; n * conditions.len()],
            terms: Vec::new(),
            parameters: Vec::new(),
        };
        for (channel, conditions) in conditions.iter().enumerate() {
            motion.eliminate(channel, conditions.as_ref())?;
        }
        Ok(motion)
    }

    /// Refuses splines that have too many coefficients together.
    pub fn expect_coefficients(n_channels: usize, of_each: usize) -> Result<(), JointMotionError> {
        let found = of_each.saturating_mul(n_channels);
        if found > MAX_COEFFICIENTS {
            return Err(JointMotionError::TooManyCoefficients { found, limit: MAX_COEFFICIENTS });
        }
        Ok(())
    }

    /// The motion with those of its parameters that are to be kept, in their order; the others are zero.
    pub fn retain_parameters(mut self, keep: impl Fn(usize) -> bool) -> Self {
        let kept: Vec<usize> = (0..self.n_parameters()).filter(|p| keep(*p)).collect();
        self.terms.retain_mut(|term| match kept.binary_search(&term.parameter) {
            Ok(parameter) => {
                term.parameter = parameter;
                true
            }
            Err(_) => false,
        });
        self.parameters = kept.iter().map(|p| self.parameters[*p]).collect();
        self
    }

    fn eliminate(&mut self, channel: usize, conditions: &[Condition]) -> Result<(), JointMotionError> {
        let n = self.basis.n_coefficients();
        let mut matrix = DMatrix::zeros(conditions.len(), n);
        let mut values = vec![0.0; self.basis.n_active()];
        for (row, condition) in conditions.iter().enumerate() {
            expect_finite("conditions", &[condition.value])?;
            let first = self.basis.evaluate(condition.end.fraction(), condition.derivative, &mut values);
            for (i, value) in values.iter().enumerate() {
                matrix[(row, first + i)] = *value;
            }
        }
        let constant = conditions.iter().map(|c| c.value).collect();
        let Solved { row_of, matrix, constant } = solve(matrix, constant)
            .map_err(|condition| JointMotionError::DependentConditions { channel, condition })?;
        let first_parameter = self.parameters.len();
        let free: Vec<usize> = (0..n).filter(|j| row_of[*j].is_none()).collect();
        self.parameters.extend(free.iter().map(|j| channel * n + j));
        for (j, row) in row_of.iter().enumerate() {
            let coefficient = channel * n + j;
            let mut depend = |i: usize, factor| {
                self.terms.push(Dependence { coefficient, parameter: first_parameter + i, factor });
            };
            match row {
                None => depend(free.partition_point(|k| *k < j), 1.0),
                Some(row) => {
                    self.offset[coefficient] = constant[*row];
                    for (i, k) in free.iter().enumerate() {
                        if matrix[(*row, *k)] != 0.0 {
                            depend(i, -matrix[(*row, *k)]);
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// The basis of the splines.
    pub fn basis(&self) -> &UniformBasis {
        &self.basis
    }

    /// What joins channels and joints.
    pub fn base(&self) -> &EigenpostureBase {
        &self.base
    }

    /// Number of channels.
    pub fn n_channels(&self) -> usize {
        self.base.n_weights()
    }

    /// Number of coefficients of all channels.
    pub fn n_coefficients(&self) -> usize {
        self.offset.len()
    }

    /// Number of free parameters.
    pub fn n_parameters(&self) -> usize {
        self.parameters.len()
    }

    /// Writes the coefficients C₀ + E p; NaN where a length is wrong, as from the following.
    pub fn coefficients_into(&self, p: &[f64], out: &mut [f64]) {
        if !self.fits(p, out) {
            return out.fill(f64::NAN);
        }
        out.copy_from_slice(&self.offset);
        for term in &self.terms {
            out[term.coefficient] += term.factor * p[term.parameter];
        }
    }

    /// Adds to `p` what a gradient by the coefficients is for the parameters: Eᵀ g.
    pub fn pull_back(&self, coefficients: &[f64], p: &mut [f64]) {
        if !self.fits(p, coefficients) {
            return p.fill(f64::NAN);
        }
        for term in &self.terms {
            p[term.parameter] += term.factor * coefficients[term.coefficient];
        }
    }

    fn fits(&self, p: &[f64], coefficients: &[f64]) -> bool {
        p.len() == self.n_parameters() && coefficients.len() == self.n_coefficients()
    }

    /// The entries of E: coefficient, parameter, factor.
    pub fn dependences(&self) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
        self.terms.iter().map(|t| (t.coefficient, t.parameter, t.factor))
    }

    /// C₀.
    pub fn offset(&self) -> &[f64] {
        &self.offset
    }

    /// The parameters of the motion that has the given coefficients, as far as its conditions allow.
    pub fn parameters_of(&self, coefficients: &[f64]) -> Vec<f64> {
        self.parameters.iter().map(|k| coefficients.get(*k).copied().unwrap_or(f64::NAN)).collect()
    }

    /// The `derivative`-th rate of the channels at `fraction`. Cost O(degree² + channels × degree).
    pub fn channels_into(&self, coefficients: &[f64], fraction: f64, derivative: usize, out: &mut [f64]) {
        let n = self.basis.n_coefficients();
        let mut values = [0.0; somersault_core::spline::MAX_DEGREE + 1];
        let first = self.basis.evaluate(fraction, derivative, &mut values);
        let values = &values[..self.basis.n_active()];
        for (channel, row) in out.iter_mut().zip(coefficients.chunks_exact(n)) {
            *channel = row[first..].iter().zip(values).map(|(c, b)| c * b).sum();
        }
    }

    /// The parameters for which the channels come nearest to `samples` at `fractions`, in the sense of least
    /// squares: a sample is one value for each channel. A start for a solver.
    ///
    /// Where the samples leave coefficients undetermined, the smallest that fit are taken.
    pub fn fit<S: AsRef<[f64]>>(
        &self,
        fractions: &[f64],
        samples: &[S],
    ) -> Result<Vec<f64>, JointMotionError> {
        expect_length("samples", samples.len(), fractions.len())?;
        expect_fractions("fractions", fractions)?;
        for sample in samples {
            expect_length("samples", sample.as_ref().len(), self.n_channels())?;
            expect_finite("samples", sample.as_ref())?;
        }
        if self.parameters.is_empty() || fractions.is_empty() {
            return Ok(vec![0.0; self.n_parameters()]);
        }
        let (n, n_channels) = (self.basis.n_coefficients(), self.n_channels());
        let mut by_coefficient = DMatrix::zeros(fractions.len() * n_channels, self.n_coefficients());
        let mut target = DVector::zeros(fractions.len() * n_channels);
        let mut values = vec![0.0; self.basis.n_active()];
        for (k, (fraction, sample)) in fractions.iter().zip(samples).enumerate() {
            let first = self.basis.evaluate(*fraction, 0, &mut values);
            for (channel, wanted) in sample.as_ref().iter().enumerate() {
                let row = k * n_channels + channel;
                target[row] = *wanted;
                for (i, value) in values.iter().enumerate() {
                    by_coefficient[(row, channel * n + first + i)] = *value;
                }
            }
        }
        target -= &by_coefficient * DVector::from_column_slice(&self.offset);
        let mut expansion = DMatrix::zeros(self.n_coefficients(), self.n_parameters());
        for (coefficient, parameter, factor) in self.dependences() {
            expansion[(coefficient, parameter)] = factor;
        }
        // a direction that only conditions decide is rounding against the basis, not against itself
        let rounding = 1e-12 * by_coefficient.norm();
        let found = (by_coefficient * expansion).svd(true, true).solve(&target, rounding);
        Ok(found.map_or_else(|_| vec![0.0; self.n_parameters()], |p| p.as_slice().to_vec()))
    }
}

#[cfg(test)]
mod tests {
    use super::super::End;
    use super::*;

    fn motion() -> SplineMotion {
        let basis = UniformBasis::try_new(5, 9).unwrap();
        let conditions = [
            Condition { end: End::Start, derivative: 0, value: -1.0 },
            Condition { end: End::Start, derivative: 1, value: 0.5 },
            Condition { end: End::Finish, derivative: 1, value: 0.0 },
        ];
        SplineMotion::try_new(basis, EigenpostureBase::joints(2), &conditions).unwrap()
    }

    #[test]
    fn parameters_that_are_not_retained_are_zero() {
        let motion = motion();
        let is_kept = |parameter: usize| parameter % 3 != 1;
        let fewer = motion.clone().retain_parameters(is_kept);
        assert_eq!(fewer.n_parameters(), 8);
        let p: Vec<f64> = (0..8).map(|i| f64::from(i).cos()).collect();
        let mut kept = p.iter();
        let whole: Vec<f64> = (0..12).map(|i| if is_kept(i) { *kept.next().unwrap() } else { 0.0 }).collect();
        let [mut coefficients, mut expected] = [(); 2].map(|()| vec![0.0; 18]);
        fewer.coefficients_into(&p, &mut coefficients);
        motion.coefficients_into(&whole, &mut expected);
        assert_eq!(coefficients, expected);
        assert_eq!(fewer.parameters_of(&coefficients), p);
        let (mut pulled, mut of_whole) = (vec![0.0; 8], vec![0.0; 12]);
        fewer.pull_back(&expected, &mut pulled);
        motion.pull_back(&expected, &mut of_whole);
        let of_kept: Vec<f64> = (0..12).filter(|i| is_kept(*i)).map(|i| of_whole[i]).collect();
        assert_eq!(pulled, of_kept);
    }

    #[test]
    fn conditions_hold_for_all_parameters() {
        let motion = motion();
        assert_eq!(motion.n_parameters(), 12);
        let p: Vec<f64> = (0..12).map(|i| f64::from(i).sin()).collect();
        let mut coefficients = vec![0.0; 18];
        motion.coefficients_into(&p, &mut coefficients);
        assert_eq!(motion.parameters_of(&coefficients), p);
        let mut channels = [0.0; 2];
        for (fraction, derivative, expected) in [(0.0, 0, -1.0), (0.0, 1, 0.5), (1.0, 1, 0.0)] {
            motion.channels_into(&coefficients, fraction, derivative, &mut channels);
            assert!(
                channels.iter().all(|c| (c - expected).abs() < 1e-13),
                "{fraction} {derivative} {channels:?}"
            );
        }
    }

    #[test]
    fn lengths_that_are_wrong_give_nan() {
        let motion = motion();
        let (mut coefficients, mut p) = (vec![0.0; 18], vec![0.0; 12]);
        motion.coefficients_into(&p[..11], &mut coefficients);
        motion.pull_back(&[0.0; 17], &mut p);
        let found = motion.parameters_of(&[]);
        assert!(coefficients.iter().chain(&p).chain(&found).all(|x| x.is_nan()));
    }

    #[test]
    fn solved_coefficients_have_small_factors() {
        assert!(motion().dependences().all(|(_, _, factor)| factor.abs() < 2.0));
    }

    #[test]
    fn a_fit_gives_back_the_parameters() {
        let motion = motion();
        let p: Vec<f64> = (0..12).map(|i| f64::from(i * i).cos()).collect();
        let mut coefficients = vec![0.0; 18];
        motion.coefficients_into(&p, &mut coefficients);
        let fractions: Vec<f64> = (0..=20).map(|k| f64::from(k) / 20.0).collect();
        let samples: Vec<[f64; 2]> = fractions
            .iter()
            .map(|fraction| {
                let mut c = [0.0; 2];
                motion.channels_into(&coefficients, *fraction, 0, &mut c);
                c
            })
            .collect();
        let found = motion.fit(&fractions, &samples).unwrap();
        assert!(found.iter().zip(&p).all(|(a, b)| (a - b).abs() < 1e-10), "{found:?} {p:?}");
    }

    #[test]
    fn a_fit_to_what_the_conditions_decide_leaves_parameters_at_zero() {
        let basis = UniformBasis::try_new(5, 9).unwrap();
        let at = |end| Condition { end, derivative: 0, value: 1.0 };
        let motion =
            SplineMotion::try_new(basis, EigenpostureBase::joints(1), &[at(End::Start), at(End::Finish)])
                .unwrap();
        for fractions in [&[0.0][..], &[0.0, 1.0]] {
            let found = motion.fit(fractions, &vec![[3.0]; fractions.len()]).unwrap();
            assert!(found.iter().all(|p| p.abs() < 1e-12), "{found:?}");
        }
    }

    #[test]
    fn shares_outside_of_the_motion_are_refused() {
        for found in [-1e-9, 1.5, f64::NAN] {
            let refused = motion().fit(&[0.0, found], &[[0.0; 2]; 2]);
            assert!(
                matches!(refused, Err(JointMotionError::Fraction { argument: "fractions", index: 1, .. })),
                "{found} {refused:?}"
            );
        }
    }

    #[test]
    fn too_many_coefficients_are_refused_before_memory_is_asked_for() {
        let basis = UniformBasis::try_new(5, 1_000_000_000).unwrap();
        let refused = SplineMotion::try_new(basis, EigenpostureBase::joints(2), &[]);
        let (found, limit) = (2_000_000_000, MAX_COEFFICIENTS);
        assert_eq!(refused, Err(JointMotionError::TooManyCoefficients { found, limit }));
    }

    #[test]
    fn conditions_that_repeat_are_refused() {
        let basis = UniformBasis::try_new(5, 9).unwrap();
        let same = Condition { end: End::Start, derivative: 0, value: 1.0 };
        let found = SplineMotion::try_new(basis, EigenpostureBase::joints(1), &[same, same]);
        assert_eq!(found, Err(JointMotionError::DependentConditions { channel: 0, condition: 1 }));
    }
}
