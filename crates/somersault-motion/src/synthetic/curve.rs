//! The joint motion of a flight, and what a perturbation makes of it.

use super::{Perturbation, SyntheticError};
use crate::recording::CubicSpline;
use nalgebra::Vector1;
use somersault_multibody::Model;
use std::f64::consts::TAU;

/// A joint: how it departs from the straight way between its ends.
#[derive(Debug, Clone)]
struct Channel {
    first: f64,
    rise: f64,
    fold: CubicSpline<1>,
    /// 1 on the right, −1 on the left, 0 in the middle.
    side: f64,
}

/// The joints over the fraction of the duration.
#[derive(Debug, Clone)]
pub(super) struct FoldCurve {
    channels: Vec<Channel>,
    /// Middle of the fold and exit, as fractions of the duration.
    middle: f64,
    exit: f64,
    /// Of the unperturbed flight, s.
    duration: f64,
}

/// Fractions at which the size of the fold is looked at.
const SAMPLES: u32 = 1000;
/// The greatest slope of the smooth step.
const STEEPEST: f64 = 1.875;

impl FoldCurve {
    /// Of configurations at `times`, which grow.
    pub(super) fn try_new(model: &Model, times: &[f64], positions: &[f64]) -> Result<Self, SyntheticError> {
        let n_q = model.n_positions();
        let (first, duration) = (times[0], times[times.len() - 1] - times[0]);
        let fractions: Vec<f64> = times.iter().map(|t| (t - first) / duration).collect();
        let mut channels = Vec::new();
        for (body, link) in model.links().iter().enumerate().skip(1) {
            let at = model.positions_of(body);
            if at.is_empty() {
                continue;
            }
            if at.len() > 1 {
                let body = link.name().to_owned();
                return Err(SyntheticError::JointOfManyCoordinates { body, found: at.len() });
            }
            let joint: Vec<f64> = positions.chunks_exact(n_q).map(|q| q[at.start]).collect();
            let (first, rise) = (joint[0], joint[joint.len() - 1] - joint[0]);
            let fold =
                joint.iter().zip(&fractions).map(|(s, u)| Vector1::new(s - first - rise * u)).collect();
            let side = match link.name() {
                name if name.starts_with("right_") => 1.0,
                name if name.starts_with("left_") => -1.0,
                _ => 0.0,
            };
            channels.push(Channel {
                first,
                rise,
                fold: CubicSpline::try_new(fractions.clone(), fold)?,
                side,
            });
        }
        let fraction = |k: u32| f64::from(k) / f64::from(SAMPLES);
        let size = |u: f64| channels.iter().map(|c| c.fold.evaluate(u)[0].powi(2)).sum::<f64>().sqrt();
        let sizes: Vec<f64> = (0..=SAMPLES).map(|k| size(fraction(k))).collect();
        let half = 0.5 * sizes.iter().copied().fold(0.0, f64::max);
        if half < 1e-9 {
            return Err(SyntheticError::NoFold);
        }
        let is_folded = |size: &f64| *size >= half;
        let at = |k: Option<usize>| k.map_or(0.5, |k| k as f64 / f64::from(SAMPLES));
        let (entry, exit) = (at(sizes.iter().position(is_folded)), at(sizes.iter().rposition(is_folded)));
        Ok(Self { channels, middle: 0.5 * (entry + exit), exit, duration })
    }

    /// Fails where the delayed time would go back.
    pub(super) fn expect_delay(&self, found: f64) -> Result<(), SyntheticError> {
        // β rises over exit + delay − middle with a slope of at most STEEPEST · delay over that; it falls likewise
        let earliest = -(1.0 - self.exit) / (STEEPEST - 1.0);
        let earliest = earliest.max(self.middle - self.exit);
        let latest = ((self.exit - self.middle) / (STEEPEST - 1.0)).min(1.0 - self.exit);
        let (least, greatest) = (earliest * self.duration, latest * self.duration);
        let inside = found == 0.0 || (found > least && found < greatest);
        if inside { Ok(()) } else { Err(SyntheticError::ExitDelay { found, least, greatest }) }
    }

    /// β and its derivative at the fraction `u`, `delay` being a fraction too.
    fn delay(&self, u: f64, delay: f64) -> [f64; 2] {
        let peak = self.exit + delay;
        let (from, to) = if u < peak { (self.middle, peak) } else { (1.0, peak) };
        let x = (u - from) / (to - from);
        if delay == 0.0 || x <= 0.0 {
            return [0.0; 2];
        }
        let smooth = x * x * x * (10.0 - x * (15.0 - 6.0 * x));
        let slope = 30.0 * (x * (1.0 - x)).powi(2) / (to - from);
        [delay * smooth, delay * slope]
    }

    /// Writes joints and their rates at time `t` of the perturbed flight of `duration`.
    pub(super) fn joints_into(
        &self,
        perturbation: &Perturbation,
        duration: f64,
        t: f64,
        q: &mut [f64],
        v: &mut [f64],
    ) {
        let fraction = t / duration;
        let [delay, slope] = self.delay(fraction, perturbation.exit_delay / self.duration);
        let frequency = TAU * perturbation.wobble_frequency;
        let (sine, cosine) = (frequency * t + perturbation.wobble_phase).sin_cos();
        let size = 1.0 - perturbation.looseness + perturbation.wobble * sine;
        let size_rate = perturbation.wobble * frequency * cosine;
        for ((channel, q), v) in self.channels.iter().zip(q).zip(v) {
            let of_side = 1.0 + channel.side * perturbation.asymmetry;
            let fold = channel.fold.evaluate(fraction - delay)[0] * of_side;
            let fold_rate = channel.fold.derivative(fraction - delay)[0] * of_side * (1.0 - slope) / duration;
            *q = channel.first + channel.rise * fraction + size * fold;
            *v = channel.rise / duration + size * fold_rate + size_rate * fold;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use somersault_multibody::models::{Diver, Posture};

    /// In the plane, from posture A into posture H by w = sin⁴, which is half at fractions 0.318 and 0.682.
    fn curve() -> FoldCurve {
        let diver = Diver::planar();
        let [a, h] = [Posture::A, Posture::H].map(|p| diver.configuration(p).unwrap());
        let times: Vec<f64> = (0..=80).map(|i| 1.6 * f64::from(i) / 80.0).collect();
        let frame = |t: &f64| {
            let w = (std::f64::consts::PI * t / 1.6).sin().powi(4);
            a.iter().zip(&h).map(move |(a, h)| a + w * (h - a)).collect::<Vec<_>>()
        };
        let positions: Vec<f64> = times.iter().flat_map(frame).collect();
        FoldCurve::try_new(&diver.model().unwrap(), &times, &positions).unwrap()
    }

    fn at(curve: &FoldCurve, perturbation: &Perturbation, t: f64) -> [Vec<f64>; 2] {
        let (mut q, mut v) = (vec![0.0; 9], vec![0.0; 9]);
        curve.joints_into(perturbation, 1.6 * (1.0 + perturbation.duration), t, &mut q, &mut v);
        [q, v]
    }

    fn perturbed() -> Perturbation {
        Perturbation {
            exit_delay: 0.08,
            looseness: 0.1,
            wobble: 0.05,
            wobble_phase: 0.4,
            duration: -0.03,
            ..Perturbation::none()
        }
    }

    #[test]
    fn the_exit_comes_later_by_the_delay_and_the_rest_stays() {
        let curve = curve();
        let exit = 1.6 * curve.exit;
        assert!((curve.exit - 0.682).abs() < 1e-3 && (curve.middle - 0.5).abs() < 1e-12);
        for delay in [0.1, -0.1] {
            let late = Perturbation { exit_delay: delay, ..Perturbation::none() };
            let hip = |perturbation: &Perturbation, t: f64| at(&curve, perturbation, t)[0][1];
            let plain = Perturbation::none();
            assert!((hip(&late, exit + delay) - hip(&plain, exit)).abs() < 1e-12);
            for t in [0.0, 0.3, 0.8, 1.6] {
                assert!((hip(&late, t) - hip(&plain, t)).abs() < 1e-12, "at {t} s");
            }
        }
        assert!(matches!(curve.expect_delay(0.9), Err(SyntheticError::ExitDelay { .. })));
        assert!(curve.expect_delay(f64::NAN).is_err() && curve.expect_delay(0.1).is_ok());
    }

    #[test]
    fn allowed_delays_never_go_back() {
        let curve = curve();
        let Err(SyntheticError::ExitDelay { least, greatest, .. }) = curve.expect_delay(9.0) else {
            panic!()
        };
        for delay in [0.999 * least, 0.5 * least, 0.5 * greatest, 0.999 * greatest] {
            assert!(curve.expect_delay(delay).is_ok());
            let delay = delay / curve.duration;
            let steepest =
                (0..=10_000).map(|k| curve.delay(f64::from(k) / 1e4, delay)[1]).fold(0.0, f64::max);
            assert!(steepest < 1.0, "{steepest} at a delay of {delay}");
        }
    }

    #[test]
    fn a_loose_pike_is_less_of_it() {
        let curve = curve();
        let loose = Perturbation { looseness: 0.2, ..Perturbation::none() };
        let [straight, tight, open] =
            [(Perturbation::none(), 0.0), (Perturbation::none(), 0.8), (loose, 0.8)]
                .map(|(p, t)| at(&curve, &p, t)[0].clone());
        for k in 0..9 {
            assert!((open[k] - straight[k] - 0.8 * (tight[k] - straight[k])).abs() < 1e-12);
        }
    }

    #[test]
    fn rates_are_differences() {
        let (curve, perturbation) = (curve(), perturbed());
        for t in [0.05, 0.4, 0.75, 1.0, 1.15, 1.3, 1.5] {
            let h = 1e-6;
            let [[after, _], [before, _]] = [t + h, t - h].map(|t| at(&curve, &perturbation, t));
            for (k, v) in at(&curve, &perturbation, t)[1].iter().enumerate() {
                assert!((v - (after[k] - before[k]) / (2.0 * h)).abs() < 1e-7, "joint {k} at {t} s");
            }
        }
    }
}
