//! Limbs nearest to each other over a whole motion.
//!
//! With a bound s on its rate a distance d stays above ½ (d(a) + d(b)) − ½ s (b − a) between a and b: intervals where that
//! is not enough are halved. A radian of a hinge moves no point by more than the chain from there to the end is long, and the
//! rates of a spline stay within
//!
//! ```text
//! |w′| ≤ |w′(m)| + ½ (b − a) max |w″|,   m = ½ (a + b)
//! ```
//! whose second derivatives between two knots stay within the second differences of its coefficients.

use crate::Body;
use somersault_multibody::joint_motion::SplineMotion;
use somersault_multibody::{Data, DynamicsError, Model};

/// How far above the minimum distance the one that is found may be, m.
const RESOLUTION: f64 = 1e-5;
/// Intervals between take-off and entry to begin with, at least.
const INTERVALS: usize = 400;
/// Distances that are looked at beside these, at most: a motion of a dive needs some thousand.
const BUDGET: usize = 200_000;

/// A pair of limbs at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Approach {
    /// Of the surfaces, m.
    pub(crate) distance: f64,
    /// Of the body.
    pub(crate) pair: usize,
    /// Fraction of the duration.
    pub(crate) fraction: f64,
}

/// Distances along a motion.
pub(crate) struct Approaches<'a> {
    body: &'a Body,
    model: &'a Model,
    motion: &'a SplineMotion,
    coefficients: &'a [f64],
    /// For each pair and channel what a unit of it changes the distance by, at most, m.
    reaches: Vec<f64>,
    data: Data,
    q: Vec<f64>,
    channels: Vec<f64>,
    left: usize,
    /// What was not looked at is no nearer than this, m.
    unresolved: f64,
}

impl<'a> Approaches<'a> {
    pub(crate) fn new(
        body: &'a Body,
        model: &'a Model,
        motion: &'a SplineMotion,
        coefficients: &'a [f64],
    ) -> Self {
        let directions = motion.base().directions();
        let mut reaches = Vec::with_capacity(body.pairs().len() * directions.ncols());
        for row in body.reaches(model).chunks_exact(directions.nrows().max(1)) {
            let of_channel = |column: usize| {
                row.iter()
                    .zip(directions.column(column).iter())
                    .map(|(reach, by)| reach * by.abs())
                    .sum::<f64>()
            };
            reaches.extend((0..directions.ncols()).map(of_channel));
        }
        Self {
            data: Data::new(model),
            q: model.neutral(),
            channels: vec![0.0; motion.n_channels()],
            left: BUDGET,
            unresolved: f64::INFINITY,
            body,
            model,
            motion,
            coefficients,
            reaches,
        }
    }

    /// The minimum distance of all pairs: none is nearer, and one at that time at most [`RESOLUTION`] farther. None without
    /// pairs.
    pub(crate) fn least(mut self) -> Result<Option<Approach>, DynamicsError> {
        let (fractions, samples) = self.samples()?;
        let n_pairs = self.body.pairs().len();
        let of_sample =
            |k: usize| Approach { distance: samples[k], pair: k % n_pairs, fraction: fractions[k / n_pairs] };
        let nearest = (0..samples.len()).map(of_sample).min_by(|a, b| a.distance.total_cmp(&b.distance));
        let Some(mut least) = nearest else { return Ok(None) };
        for pair in 0..n_pairs {
            for k in 0..fractions.len() - 1 {
                self.descend(&mut least, pair, self.ends(&fractions, &samples, pair, k))?;
            }
        }
        // no two surfaces overlap by more than both are thick
        let deepest = self.body.radii().fold(0.0, f64::max);
        let distance = (least.distance - RESOLUTION).min(self.unresolved.max(-deepest));
        Ok(Some(Approach { distance, ..least }))
    }

    /// For each pair the minimum distance of each run of intervals in which it is below `distance`, and its time.
    pub(crate) fn below(mut self, distance: f64) -> Result<Vec<Approach>, DynamicsError> {
        let (fractions, samples) = self.samples()?;
        let mut found: Vec<Approach> = Vec::new();
        for pair in 0..self.body.pairs().len() {
            let mut run: Option<Approach> = None;
            for k in 0..fractions.len() - 1 {
                let ends = self.ends(&fractions, &samples, pair, k);
                let mut least = Approach { distance, pair, fraction: f64::NAN };
                for (fraction, distance) in ends {
                    if distance < least.distance {
                        least = Approach { distance, pair, fraction };
                    }
                }
                self.descend(&mut least, pair, ends)?;
                if least.distance < distance {
                    run = run.filter(|run| run.distance <= least.distance).or(Some(least));
                } else {
                    found.extend(run.take());
                }
            }
            found.extend(run);
        }
        Ok(found)
    }

    /// Fractions between which a spline has no knot, and the distances of all pairs there, one row for each fraction.
    fn samples(&mut self) -> Result<(Vec<f64>, Vec<f64>), DynamicsError> {
        let n = INTERVALS.next_multiple_of(self.motion.basis().n_intervals());
        let n_pairs = self.body.pairs().len();
        let fractions: Vec<f64> = (0..=n).map(|k| k as f64 / n as f64).collect();
        let mut samples = vec![0.0; fractions.len() * n_pairs];
        for (fraction, row) in fractions.iter().zip(samples.chunks_exact_mut(n_pairs.max(1))) {
            self.pose(*fraction);
            self.body.distances(&self.model.positions(&mut self.data, &self.q)?, 0.0, row, None)?;
        }
        Ok((fractions, samples))
    }

    /// Fraction and distance at both ends of interval `k`.
    fn ends(&self, fractions: &[f64], samples: &[f64], pair: usize, k: usize) -> [(f64, f64); 2] {
        let n_pairs = self.body.pairs().len();
        [k, k + 1].map(|k| (fractions[k], samples[k * n_pairs + pair]))
    }

    /// Lowers `least` to the minimum distance of a pair between two fractions, or to less than [`RESOLUTION`] above it.
    fn descend(
        &mut self,
        least: &mut Approach,
        pair: usize,
        ends: [(f64, f64); 2],
    ) -> Result<(), DynamicsError> {
        let mut open = vec![ends];
        while let Some([(from, near), (to, far)]) = open.pop() {
            let bound = 0.5 * (near + far) - 0.5 * self.speed(from, to, pair) * (to - from);
            if bound >= least.distance - RESOLUTION {
                continue;
            }
            let middle = 0.5 * (from + to);
            if bound.is_nan() {
                self.unresolved = f64::NEG_INFINITY;
                continue;
            }
            if self.left == 0 || !(from < middle && middle < to) {
                self.unresolved = self.unresolved.min(bound);
                continue;
            }
            self.left -= 1;
            self.pose(middle);
            let distance = self.body.distance(&self.model.positions(&mut self.data, &self.q)?, pair)?;
            if distance < least.distance {
                *least = Approach { distance, pair, fraction: middle };
            }
            let halves = [[(from, near), (middle, distance)], [(middle, distance), (to, far)]];
            // the half with the smaller end comes first
            open.extend(if near < far { [halves[1], halves[0]] } else { halves });
        }
        Ok(())
    }

    /// No less than the rate of a distance by the fraction between two fractions without a knot in between, m.
    fn speed(&mut self, from: f64, to: f64, pair: usize) -> f64 {
        let basis = self.motion.basis();
        let (n, degree, n_intervals) = (basis.n_coefficients(), basis.degree(), basis.n_intervals());
        let middle = 0.5 * (from + to);
        let interval = ((middle * n_intervals as f64) as usize).min(n_intervals - 1);
        let scale = 0.5 * (to - from) * (n_intervals as f64).powi(2);
        self.motion.channels_into(self.coefficients, middle, 1, &mut self.channels);
        let rows = self.channels.iter().zip(self.coefficients.chunks_exact(n));
        let rates = rows.map(|(rate, row)| {
            let bends =
                row[interval..=interval + degree].windows(3).map(|c| (c[2] - 2.0 * c[1] + c[0]).abs());
            rate.abs() + scale * bends.fold(0.0, f64::max)
        });
        rates.zip(&self.reaches[pair * self.channels.len()..]).map(|(rate, reach)| rate * reach).sum()
    }

    /// Leaves the posture at a fraction of the duration.
    fn pose(&mut self, fraction: f64) {
        self.motion.channels_into(self.coefficients, fraction, 0, &mut self.channels);
        let n_root = self.q.len() - self.motion.base().n_joints();
        self.motion.base().positions_into(&self.channels, &mut self.q[n_root..]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Dive;

    /// On a twisting dive as its template has it, against 20 000 samples of all pairs.
    #[test]
    fn nothing_is_nearer_than_what_is_found() {
        for twists in [2.0, 0.5] {
            let program = Dive::twisting(3.5, twists).unwrap().program().unwrap();
            let z = program.start(&Dive::twisting_template(twists)).unwrap();
            let (coefficients, path) = (program.coefficients(&z), program.path());
            let body = Body::try_new(path.model()).unwrap();
            let approaches = || Approaches::new(&body, path.model(), path.motion(), &coefficients);
            let found = approaches().least().unwrap().unwrap();
            let mut at = approaches();
            let mut distances = vec![0.0; body.pairs().len()];
            let (mut least, mut fastest) = (f64::INFINITY, 0.0f64);
            let n = 20_000;
            for k in 0..=n {
                at.pose(f64::from(k) / f64::from(n));
                let before = distances.clone();
                let positions = path.model().positions(&mut at.data, &at.q).unwrap();
                body.distances(&positions, 0.0, &mut distances, None).unwrap();
                least = distances.iter().fold(least, |least, d| least.min(*d));
                if k > 0 {
                    let fraction = f64::from(k) / f64::from(n);
                    for (pair, (now, before)) in distances.iter().zip(&before).enumerate() {
                        let rate = (now - before).abs() * f64::from(n);
                        let bound = at.speed(fraction - 1.0 / f64::from(n), fraction, pair);
                        assert!(rate <= bound + 1e-6, "{pair} at {fraction}: {rate} {bound}");
                        fastest = fastest.max(rate);
                    }
                }
            }
            assert!(fastest > 1.0, "{fastest}");
            assert!(
                found.distance <= least && found.distance > least - 2.0 * RESOLUTION,
                "{found:?} {least}"
            );
            // whatever is below some distance is found, at its lowest
            let lowest = approaches().below(least + 0.01).unwrap();
            let nearest = lowest.iter().map(|found| found.distance).fold(f64::INFINITY, f64::min);
            assert!((nearest - least).abs() < RESOLUTION, "{nearest} {least}");
            assert!(approaches().below(least - RESOLUTION).unwrap().is_empty());
        }
    }
}
