//! What is scaled, and whether the result is the recorded body.

use super::groups::ScaleGroup;
use super::scaled::{GroupScale, MarkerOffset, ScaledModel, ScalingStatus};
use super::search::{Body, End, Posterior, Search, State};
use super::{ScalingError, ScalingOptions};
use crate::fit::{FitOptions, FitStatus, Marker, MarkerFit, MarkerSet, MotionFit, Scale, Targets};
use crate::frame_fits::{UNKNOWN_NOISE, axes_of};
use crate::noise::standard_deviation;
use crate::reconstruction::BeyondLimit;
use crate::recording::MarkerRecording;
use nalgebra::Vector3;
use somersault_core::cancel::CancellationToken;
use somersault_multibody::{Data, Model};

/// A model with markers, to be scaled to recordings.
///
/// ```
/// use somersault_motion::fit::{MarkerProtocol, MarkerSet};
/// use somersault_motion::scaling::{ModelScaler, ScalingOptions};
/// use somersault_motion::synthetic::synthetic_markers;
/// use somersault_multibody::models::{Diver, Posture, SegmentScales};
///
/// // a diver with long thighs goes from the layout to a pike
/// let usual = Diver::spatial();
/// let person = Diver { segments: SegmentScales::default().with("thigh", [1.08; 3])?, ..usual };
/// let (straight, pike) = (usual.configuration(Posture::A)?, usual.configuration(Posture::G)?);
/// let times: Vec<f64> = (0..20).map(|i| 0.05 * f64::from(i)).collect();
/// let bent = |t: f64| straight.iter().zip(&pike).map(move |(a, b)| a + t * (b - a));
/// let positions: Vec<f64> = times.iter().flat_map(|t| bent(*t)).collect();
/// let markers = |diver: &Diver| MarkerSet::on_diver(diver, MarkerProtocol::PlugInGait);
/// let seen = synthetic_markers(&person.model()?, &markers(&person)?, &times, &positions, 0.002, 1)?;
///
/// let scaler = ModelScaler::try_new(&usual.model()?, markers(&usual)?, ScalingOptions::default())?;
/// let found = scaler.scale(&seen)?;
/// assert!(found.success(), "{}", found.message());
/// let thigh = found.groups.iter().find(|group| group.name == "thigh").unwrap();
/// assert!((thigh.scale - 1.08).abs() < 4.0 * thigh.deviation && thigh.deviation < 0.04);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct ModelScaler {
    model: Model,
    markers: MarkerSet,
    groups: Vec<ScaleGroup>,
    numbers: Vec<[Option<usize>; 3]>,
    options: ScalingOptions,
}

/// Estimates of the noise, at most, and the fraction by which the last may differ from the one before.
const MAX_ESTIMATES: usize = 20;
const SAME: f64 = 0.01;
/// Fits of single frames to the scaled model, at most.
const MAX_ROUNDS: usize = 8;
/// The fraction of its cost, and half the number of squared deviations, by which a frame that is fitted by itself must be nearer to count.
const NEARER: f64 = 0.01;
const NEARER_BY: f64 = 0.5;
/// Markers without noise have that of rounding, m.
const LEAST_NOISE: f64 = 1e-7;
/// Coordinates beyond the unknowns that tell the noise.
const LEAST_OVER: f64 = 6.0;
/// Correlations of residuals that are noise.
const CORRELATED: f64 = 0.05;
/// Standard deviations before the markers are looked at that a body is within.
const POSSIBLE: f64 = 4.0;
/// Distance of the mean place of a marker from where it is said to be that residuals alone may make, in fractions of the body's spread.
const MISPLACED: f64 = 0.1;
/// Root mean square of residuals that is taken for noise, in fractions of that spread.
const FAR: f64 = 0.05;
/// Fraction of points that may be outliers.
const OUTLIERS: f64 = 0.05;
/// Standard deviations by which χ² is a misfit, and what it may differ from 1 by whatever the noise is.
const MISFIT: f64 = 5.0;
const TOLERANCE: f64 = 0.1;
/// Numbers that the quadratic model may have: 1 GB.
const MAX_NUMBERS: f64 = 1.25e8;
/// A group is seen where its deviation is this many times that of the prior.
const SEEN: f64 = 0.9;

impl ModelScaler {
    /// Scales `model` with `markers` as `options` say.
    pub fn try_new(model: &Model, markers: MarkerSet, options: ScalingOptions) -> Result<Self, ScalingError> {
        options.validate()?;
        let groups = match &options.groups {
            Some(groups) => groups.clone(),
            None => ScaleGroup::of_model(model, &markers),
        };
        let numbers = ScaleGroup::numbers(model, &groups)?;
        let (n_markers, n_frames) = (markers.markers().len(), options.max_frames);
        let (n, n_common) = (model.n_velocities() as f64, (1 + groups.len() + 3 * n_markers) as f64);
        let of_frame = n_common * n_common + n * (n + 2.0 * n_common);
        if 3.0 * n_common * n_common + n_frames as f64 * of_frame > MAX_NUMBERS {
            return Err(ScalingError::TooManyMarkers { n_markers, n_frames });
        }
        Ok(Self { model: model.clone(), markers, groups, numbers, options })
    }

    /// Its choices.
    pub fn options(&self) -> &ScalingOptions {
        &self.options
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Its markers.
    pub fn markers(&self) -> &MarkerSet {
        &self.markers
    }

    /// What is scaled by itself.
    pub fn groups(&self) -> &[ScaleGroup] {
        &self.groups
    }

    /// The model of the person in a recording. Markers of the recording that the model has not are ignored, those that the recording has not
    /// are missing, and stay where they are said to be.
    pub fn scale(&self, recording: &MarkerRecording) -> Result<ScaledModel, ScalingError> {
        self.scale_cancellable(recording, &CancellationToken::new())
    }

    /// As [`scale`](Self::scale), and ends with [`FitError::Interrupted`](crate::fit::FitError::Interrupted) within a step over all frames of the
    /// cancellation.
    pub fn scale_cancellable(
        &self,
        recording: &MarkerRecording,
        token: &CancellationToken,
    ) -> Result<ScaledModel, ScalingError> {
        let Self { model, markers, options, .. } = self;
        let range = (POSSIBLE * options.size_deviation).exp();
        let scale = Scale::Common { lower: range.recip(), upper: range };
        let fit = self.frame_fit(model, markers.clone(), scale)?;
        let recording = recording.chosen(&self.frames(&fit.targets(recording)?)?)?;
        let targets = fit.targets(&recording)?;
        let begun = fit.fit_cancellable(&recording, token)?;
        let axes = axes_of(model);
        let size = begun.frames.first().map_or(1.0, |frame| frame.estimate.scale);
        let mut search = Search {
            model,
            markers,
            groups: &self.numbers,
            options,
            targets: &targets,
            axes: &axes,
            token,
            state: State {
                size: size.ln(),
                proportions: vec![0.0; self.groups.len()],
                offsets: vec![Vector3::zeros(); markers.markers().len()],
                configurations: begun.frames.iter().map(|frame| frame.estimate.q.clone()).collect(),
            },
            noise: options.noise.or(begun.rms()).unwrap_or(UNKNOWN_NOISE).max(LEAST_NOISE),
            iterations: 0,
        };
        let before = self.residuals(&search)?;
        let (mut settled, mut contradictions) = (self.settle(&mut search)?, Vec::new());
        for round in 1..=MAX_ROUNDS {
            let alone = self.fit_alone(&search, &recording)?;
            let nearer = self.take_nearer(&mut search, &alone)?;
            if nearer == 0 {
                let n = alone.frames.iter().filter(|frame| frame.status == FitStatus::Mirrored).count();
                if n > 0 {
                    contradictions.push(format!(
                        "the mirror image of the body fits {n} frames with half of the residuals: an axis is mirrored, or left and right are exchanged"
                    ));
                }
                break;
            }
            settled = self.settle(&mut search)?;
            if round == MAX_ROUNDS {
                contradictions
                    .push(format!("{nearer} frames that are fitted by themselves are nearer to the markers"));
            }
        }
        self.judge(&search, settled, recording.times(), before, contradictions)
    }

    fn frame_fit(&self, model: &Model, markers: MarkerSet, scale: Scale) -> Result<MarkerFit, ScalingError> {
        let options = FitOptions { scale, max_iterations: 100, ..FitOptions::default() };
        Ok(MarkerFit::try_new(model, markers, options)?)
    }

    /// The frames that are taken: of those that have at least half as many markers as any.
    fn frames(&self, targets: &[Targets]) -> Result<Vec<usize>, ScalingError> {
        let count = |frame: &Targets| frame.iter().flatten().count();
        let most = targets.iter().map(count).max().unwrap_or(0);
        let good = |i: &usize| most > 0 && 2 * count(&targets[*i]) >= most;
        let good: Vec<usize> = (0..targets.len()).filter(good).collect();
        let least = if self.options.noise.is_some() { 1 } else { 2 };
        if good.len() < least {
            return Err(ScalingError::TooFewFrames { least, found: good.len() });
        }
        let n = good.len().min(self.options.max_frames.max(least));
        let last = (good.len() - 1) as f64;
        let nth = |i: usize| (last * i as f64 / (n.max(2) - 1) as f64).round() as usize;
        Ok((0..n).map(|i| good[nth(i)]).collect())
    }

    /// Finds the minimum, with noise that is that of its residuals where it is not given.
    fn settle(&self, search: &mut Search<'_>) -> Result<Settled, ScalingError> {
        for estimate in 1.. {
            let end = search.minimize()?;
            let Some(posterior) = search.posterior()? else {
                return Ok(Settled { end, posterior: None, noise: search.noise, repeats: 1.0, over: 0.0 });
            };
            let residuals = self.residuals(search)?;
            let repeats = repeats(search, &residuals);
            let loss = search.loss();
            let (mut squares, mut n) = (0.0, 0);
            for (frame, residuals) in residuals.iter().enumerate() {
                for (k, residual) in residuals.iter().enumerate() {
                    let Some(residual) = residual else { continue };
                    let squared = residual.norm_squared();
                    squares += search.weight(frame, k) * loss.evaluate(squared).1 * squared;
                    n += search.axes.len();
                }
            }
            let over = n as f64 - posterior.n_determined;
            let told = (squares / over.max(1.0)).sqrt().max(LEAST_NOISE);
            let noise = self.options.noise.unwrap_or(told);
            let counted = noise * repeats.sqrt();
            let is_same = (counted / search.noise - 1.0).abs() < SAME;
            let is_last = estimate == MAX_ESTIMATES;
            if is_same || end != End::Converged || over < LEAST_OVER || is_last {
                // noise that does not settle is no minimum
                let is_open = is_last && !is_same && end == End::Converged && over >= LEAST_OVER;
                let end = if is_open { End::IterationLimit } else { end };
                let over = if over < LEAST_OVER { 0.0 } else { over };
                let chi_squared = (told / noise).powi(2);
                return Ok(Settled { end, posterior: Some((posterior, chi_squared)), noise, repeats, over });
            }
            search.noise = counted;
        }
        Ok(Settled {
            end: End::IterationLimit,
            posterior: None,
            noise: search.noise,
            repeats: 1.0,
            over: 0.0,
        })
    }

    /// Of all frames.
    fn residuals(&self, search: &Search<'_>) -> Result<Residuals, ScalingError> {
        let body = search.body(&search.state)?;
        let mut data = Data::new(&body.model);
        let frames = search.state.configurations.iter().enumerate();
        frames.map(|(i, q)| search.residuals(&body, &mut data, i, q)).collect()
    }

    /// Fits of single frames to the scaled model.
    fn fit_alone(&self, search: &Search<'_>, recording: &MarkerRecording) -> Result<MotionFit, ScalingError> {
        let body = search.body(&search.state)?;
        let markers = self.placed(&body)?;
        let fit = self.frame_fit(&body.model, markers, Scale::Fixed(1.0))?;
        Ok(fit.fit_cancellable(recording, search.token)?)
    }

    /// Markers where they are on a scaled body.
    fn placed(&self, body: &Body) -> Result<MarkerSet, ScalingError> {
        let place = |(marker, point): (&Marker, &Vector3<f64>)| Marker { point: *point, ..marker.clone() };
        let markers = self.markers.markers().iter().zip(&body.points).map(place).collect();
        Ok(MarkerSet::try_new(&body.model, markers)?)
    }

    /// Takes those of the fits of single frames that are nearer to the markers, and says how many.
    fn take_nearer(&self, search: &mut Search<'_>, alone: &MotionFit) -> Result<usize, ScalingError> {
        let body = search.body(&search.state)?;
        let mut data = Data::new(&body.model);
        let mut nearer = 0;
        for (i, frame) in alone.frames.iter().enumerate() {
            let found = search.frame_cost(&body, &mut data, i, &frame.estimate.q)?;
            let known = search.frame_cost(&body, &mut data, i, &search.state.configurations[i])?;
            if found < known - (NEARER * known).max(NEARER_BY) {
                search.state.configurations[i].clone_from(&frame.estimate.q);
                nearer += 1;
            }
        }
        Ok(nearer)
    }

    /// The scaled model, and what contradicts it.
    fn judge(
        &self,
        search: &Search<'_>,
        Settled { end, posterior, noise, repeats, over }: Settled,
        times: &[f64],
        before: Residuals,
        mut contradictions: Vec<String>,
    ) -> Result<ScaledModel, ScalingError> {
        let Search { state, options, .. } = search;
        let body = search.body(state)?;
        let residuals = self.residuals(search)?;
        let n_groups = self.groups.len();
        let (posterior, chi_squared) = posterior.map_or((None, 1.0), |(found, x)| (Some(found), x));
        let covariance = posterior.as_ref().map(|posterior| &posterior.covariance);
        let variance = |i: usize, j: usize| covariance.map_or(f64::INFINITY, |c| c[(i, j)]);
        let deviation = |i: usize| standard_deviation(variance(i, i));
        let groups: Vec<GroupScale> = self
            .groups
            .iter()
            .enumerate()
            .map(|(g, group)| {
                let scale = (state.size + state.proportions[g]).exp();
                let of_sum = variance(0, 0) + 2.0 * variance(0, 1 + g) + variance(1 + g, 1 + g);
                let is_seen = deviation(1 + g) < SEEN * options.group_deviation;
                let deviation = scale * standard_deviation(of_sum);
                GroupScale { name: group.name().to_owned(), scale, deviation, is_seen }
            })
            .collect();
        let size = state.size.exp();
        let offsets = self.offsets(search, &before, &residuals, &|k, axis| {
            if options.offset_deviation > 0.0 { deviation(1 + n_groups + 3 * k + axis) } else { 0.0 }
        });
        for (name, logarithm, prior) in
            std::iter::once(("the whole body", state.size, options.size_deviation)).chain(
                self.groups
                    .iter()
                    .zip(&state.proportions)
                    .map(|(group, x)| (group.name(), *x, options.group_deviation)),
            )
        {
            if logarithm.abs() > POSSIBLE * prior {
                contradictions.push(format!(
                    "the size of {name} is {:.2} of what was expected, {:.1} standard deviations off",
                    logarithm.exp(),
                    logarithm.abs() / prior
                ));
            }
        }
        let spread = spread(search);
        contradictions.extend(self.misplaced(search, &body, spread)?);
        let after = rms(residuals.iter().flatten()).unwrap_or(0.0);
        let limit = 2.0 * (FAR * spread).max(options.noise.map_or(0.0, |noise| MISFIT * noise));
        contradictions.extend(offsets.iter().filter_map(|marker| {
            let [_, rms] = marker.rms?;
            let (name, found, limit) = (&marker.name, 1e3 * rms, 1e3 * limit);
            let text = "mm from the body, root mean square, but may be";
            (found > limit).then(|| format!("marker `{name}` is {found:.0} {text} {limit:.0}"))
        }));
        if options.noise.is_none() && after > FAR * spread {
            contradictions.push(format!(
                "markers are {:.0} mm from the body, root mean square, but may be {:.0} where `noise` is not given: it moves as the model cannot, or the noise is large",
                1e3 * after,
                1e3 * FAR * spread
            ));
        }
        let loss = search.loss();
        let points = || residuals.iter().flatten().flatten();
        let n_outliers = points().filter(|r| loss.evaluate(r.norm_squared()).1 < 0.5).count();
        if n_outliers as f64 > OUTLIERS * points().count() as f64 {
            contradictions.push(format!("{n_outliers} points are far from where the body has them"));
        }
        let limit = 1.0 + TOLERANCE + MISFIT * (2.0 * repeats / over.max(1.0)).sqrt();
        if over > 0.0 && chi_squared > limit {
            contradictions.push(format!(
                "χ² per degree of freedom is {chi_squared:.2}, but must be at most {limit:.2}: the noise is larger, or the body is another"
            ));
        }
        let beyond_limits = BeyondLimit::of(&self.model, times.len(), |i, at, rate| {
            let deviation =
                posterior.as_ref().map_or(f64::INFINITY, |posterior| posterior.deviations[i][rate]);
            (times[i], state.configurations[i][at], deviation)
        });
        if beyond_limits.iter().any(BeyondLimit::is_far) {
            contradictions.push("joints are far beyond their limits".to_owned());
        }
        let status = match end {
            End::IterationLimit => ScalingStatus::IterationLimit,
            End::NoProgress => ScalingStatus::NoProgress,
            End::Converged if posterior.is_none() || over == 0.0 => ScalingStatus::Undetermined,
            End::Converged if !contradictions.is_empty() => ScalingStatus::Misfit,
            End::Converged => ScalingStatus::Converged,
        };
        Ok(ScaledModel {
            status,
            markers: self.placed(&body)?,
            scales: body.scales,
            model: body.model,
            size: [size, size * deviation(0)],
            groups,
            offsets,
            noise,
            repeats,
            rms: [rms(before.iter().flatten()).unwrap_or(0.0), after],
            times: times.to_vec(),
            q: state.configurations.clone(),
            n_outliers,
            beyond_limits,
            contradictions,
            iterations: search.iterations,
        })
    }

    fn offsets(
        &self,
        search: &Search<'_>,
        before: &Residuals,
        after: &Residuals,
        deviation: &dyn Fn(usize, usize) -> f64,
    ) -> Vec<MarkerOffset> {
        let of = |(k, marker): (usize, &Marker)| {
            let of_marker = |residuals: &Residuals| rms(residuals.iter().map(|frame| &frame[k]));
            MarkerOffset {
                name: marker.name.clone(),
                offset: search.state.offsets[k],
                deviation: Vector3::from_fn(|axis, _| deviation(k, axis)),
                rms: of_marker(before).zip(of_marker(after)).map(|(a, b)| [a, b]),
            }
        };
        self.markers.markers().iter().enumerate().map(of).collect()
    }

    /// What is said of markers whose mean place on their bodies is far from where they are said to be.
    fn misplaced(&self, search: &Search<'_>, body: &Body, spread: f64) -> Result<Vec<String>, ScalingError> {
        let n_markers = body.nominal.len();
        let (mut sums, mut counts) = (vec![Vector3::zeros(); n_markers], vec![0_usize; n_markers]);
        let mut data = Data::new(&body.model);
        for (targets, q) in search.targets.iter().zip(&search.state.configurations) {
            let positions = body.model.positions(&mut data, q)?;
            for (k, marker) in self.markers.markers().iter().enumerate() {
                let Some(target) = targets[k] else { continue };
                let pose = positions.pose(marker.body)?;
                let off = search.along_axes(&(target.point - pose.point(&body.nominal[k])));
                sums[k] += pose.rotation.tr_mul(&off);
                counts[k] += 1;
            }
        }
        let limit = POSSIBLE * self.options.offset_deviation + MISPLACED * spread;
        let far = |(k, marker): (usize, &Marker)| {
            let distance = (sums[k] / counts[k].max(1) as f64).norm();
            let name = &marker.name;
            (distance > limit).then(|| {
                format!(
                    "marker `{name}` is seen {:.0} mm from its place, but may be {:.0}: its name or its place is another's",
                    1e3 * distance,
                    1e3 * limit
                )
            })
        };
        Ok(self.markers.markers().iter().enumerate().filter_map(far).collect())
    }
}

/// A minimum, with the noise and what is known there.
struct Settled {
    end: End,
    /// And χ² per degree of freedom against the noise.
    posterior: Option<(Posterior, f64)>,
    noise: f64,
    repeats: f64,
    /// Coordinates beyond the unknowns; 0 where they are too few.
    over: f64,
}

/// For each frame those of its markers.
type Residuals = Vec<Vec<Option<Vector3<f64>>>>;

/// Root mean square of residuals; none where there are none.
fn rms<'a>(residuals: impl Iterator<Item = &'a Option<Vector3<f64>>>) -> Option<f64> {
    let squares: Vec<f64> = residuals.flatten().map(Vector3::norm_squared).collect();
    (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

/// Root mean square distance of the markers of a frame from their centre, of the frame where it is largest.
fn spread(search: &Search<'_>) -> f64 {
    let of_frame = |targets: &Targets| {
        let present = || targets.iter().flatten().map(|target| search.along_axes(&target.point));
        let n = present().count().max(1) as f64;
        let centre = present().sum::<Vector3<f64>>() / n;
        (present().map(|y| (y - centre).norm_squared()).sum::<f64>() / n).sqrt()
    };
    search.targets.iter().map(of_frame).fold(0.0, f64::max)
}

/// How many frames count as one: 1 + 2 Σ of the correlations of residuals some frames apart, up to the first that is noise.
fn repeats(search: &Search<'_>, residuals: &Residuals) -> f64 {
    let loss = search.loss();
    let counted = |frame: usize, k: usize| {
        let residual = residuals[frame][k]?;
        Some(residual * (search.weight(frame, k) * loss.evaluate(residual.norm_squared()).1).sqrt())
    };
    let (n_frames, n_markers) = (residuals.len(), search.markers.markers().len());
    let mean_product = |lag: usize| {
        let pairs = (0..n_frames - lag).flat_map(|i| (0..n_markers).map(move |k| (i, k)));
        let products = pairs.filter_map(|(i, k)| Some(counted(i, k)?.dot(&counted(i + lag, k)?)));
        let (sum, n) = products.fold((0.0, 0), |(sum, n), x| (sum + x, n + 1));
        if n > 0 { sum / n as f64 } else { 0.0 }
    };
    let variance = mean_product(0);
    if variance <= 0.0 {
        return 1.0;
    }
    let correlations = (1..=n_frames / 2).map(|lag| mean_product(lag) / variance);
    1.0 + 2.0 * correlations.take_while(|x| *x > CORRELATED).sum::<f64>()
}
