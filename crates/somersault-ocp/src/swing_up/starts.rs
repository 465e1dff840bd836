//! Starts of the library's own.

use super::SwingUp;
use super::lifted::ERROR;
use crate::error::OcpError;
use somersault_core::argument::{expect_finite, expect_length, expect_positive};
use somersault_nlp::{Start, latin_hypercube};
use std::f64::consts::PI;

/// Half waves over the straight line of the cart.
const WAVES: usize = 5;
/// Largest distance of a node from the straight line of the pendulum, rad.
const SWING: f64 = 1.0;

impl SwingUp {
    /// Parameters with which the cart moves on the straight line from its start to its target, at constant rate.
    pub fn straight_line(&self) -> Vec<f64> {
        self.waving(&[])
    }

    /// The straight line of the cart with Σ aₘ sin(m π t / T) upon it, nearly: the values of a function are nearly the
    /// coefficients of its spline.
    fn waving(&self, amplitudes: &[f64]) -> Vec<f64> {
        let motion = &self.passes.tables.motion;
        let [[_, from, ..], [_, to, ..]] = [self.passes.start, self.passes.target];
        let n = motion.n_coefficients();
        let value = |k: usize| {
            let fraction = k as f64 / (n - 1) as f64;
            let wave = |(m, a): (usize, &f64)| a * ((m + 1) as f64 * PI * fraction).sin();
            from + (to - from) * fraction + amplitudes.iter().enumerate().map(wave).sum::<f64>()
        };
        motion.parameters_of(&(0..n).map(value).collect::<Vec<f64>>())
    }

    /// Parameters of the cart with nodes on the straight line from the start of the pendulum to its target: a cold start.
    pub fn start(&self, parameters: &[f64]) -> Result<Start, OcpError> {
        expect_length("parameters", parameters.len(), self.n_parameters())?;
        let mut z = parameters.to_vec();
        let [[from, ..], [to, ..]] = [self.passes.start, self.passes.target];
        for segment in &self.segments[1..] {
            let fraction = segment.steps.start as f64 / self.passes.n_steps as f64;
            z.extend([from + fraction * (to - from), 0.0]);
        }
        z.extend([0.0; ERROR]);
        Ok(z.into())
    }

    /// Parameters of the cart with nodes as the pendulum then moves: a start that violates no constraint.
    pub fn start_on_motion(&mut self, parameters: &[f64]) -> Result<Start, OcpError> {
        expect_length("parameters", parameters.len(), self.n_parameters())?;
        let mut z = parameters.to_vec();
        let Self { passes, segments, .. } = self;
        passes.set_cart(parameters);
        let mut state = passes.first_state();
        for segment in segments {
            if segment.start.is_some() {
                z.extend(state);
            }
            (_, state) = passes.forward(segment.steps.clone(), state);
        }
        let [angle, r, rate, r_rate] = passes.apart(passes.n_steps, state);
        z.extend([angle, rate, r, r_rate]);
        expect_finite("parameters", parameters)?;
        if z.iter().all(|z| z.is_finite()) {
            Ok(z.into())
        } else {
            Err(OcpError::Diverges { argument: "parameters".to_owned() })
        }
    }

    /// Cold starts: the straight lines of cart and pendulum, and others about them from a Latin hypercube, the same for the
    /// same seed. On the line of the cart go five half waves, the m-th of amplitude up to `reach`/m, so that starts with
    /// many splines are as smooth as those with few; nodes are up to 1 rad from the line of the pendulum, with rates up to
    /// 1 rad in a segment.
    pub fn starts(&self, count: usize, reach: f64, seed: u64) -> Result<Vec<Start>, OcpError> {
        expect_positive("reach", reach)?;
        let segment = self.passes.step * self.passes.n_steps as f64 / self.segments.len() as f64;
        let waves = (1..=WAVES).map(|m| reach / m as f64);
        let nodes = self.segments[1..].iter().flat_map(|_| [SWING, SWING / segment]);
        let sizes: Vec<f64> = waves.chain(nodes).collect();
        let drawn = latin_hypercube(&vec![(-1.0, 1.0); sizes.len()], count.saturating_sub(1), seed);
        let mut starts = vec![self.start(&self.straight_line())?];
        for mut deviation in drawn {
            deviation.iter_mut().zip(&sizes).for_each(|(d, size)| *d *= size);
            let (amplitudes, nodes) = deviation.split_at(WAVES);
            let mut start = self.start(&self.waving(amplitudes))?;
            start.z[self.n_parameters()..].iter_mut().zip(nodes).for_each(|(s, d)| *s += d);
            starts.push(start);
        }
        starts.truncate(count);
        Ok(starts)
    }
}
