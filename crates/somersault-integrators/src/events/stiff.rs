//! Fixed steps while springs act: how many parts they take, and that the system gains no energy.
//!
//! A spring and damper with the masses they move have roots λ of λ² + λ c/m + k/m = 0. A step is divided so that
//! h |λ| is at most 1, or ¼ for methods with a history: where the methods of the table of order 3 and above are
//! stable, oscillation or decay. The rate |λ| is read from the system where the mode begins.
//!
//! The steps of an L-stable method are not divided. What a touch-down starts at the rate |λ| dies away in a time of 1/|λ|, and
//! reaches the slow motion where it is not resolved; so the first step after an event has h |λ| = ¼, and each next one is
//! twice as long up to the step given. A step whose equation an implicit method does not solve is made again in halves.
//!
//! Without drive the sum of kinetic energy, springs and potential never grows. While springs act it is compared after
//! each step with the least that it was before: where it has grown by more than 10⁻⁶ of the largest sum of kinetic
//! energy and springs so far, the step is made again in halves, down to a sixty-fourth. What is added or taken while none
//! acts is the method's error and not counted.

use super::hybrid::{Energy, Frozen, Hybrid};
use super::location::StiffSteps;
use super::outcome::Interruption;
use crate::stepper::MethodInfo;
use crate::system::StateOf;

/// Growth of the energy allowed, relative.
const GAIN: f64 = 1e-6;
/// The first step of an L-stable method after an event, in units of 1/|λ|, and the factor by which each next one is longer.
const FIRST: f64 = 0.25;
const GROWTH: f64 = 2.0;
/// How much farther than the rate of the springs asks for a step is divided where the energy grows.
const FARTHER: u64 = 64;
/// Roundings of the energy, relative to its parts.
const ROUNDING: f64 = 1e-13;

/// The largest h |λ| at which a spring is integrated by a method; an L-stable one has none.
fn longest(method: &MethodInfo) -> f64 {
    match (method.l_stable, method.history) {
        (true, _) => f64::INFINITY,
        (false, 0) => 1.0,
        (false, _) => 0.25,
    }
}

/// Into how many parts a step is divided, and the energy while springs act.
pub(super) struct Stiff {
    setting: StiffSteps,
    longest: f64,
    /// The step given.
    pub(super) dt: f64,
    /// Its parts in the present mode.
    parts: u64,
    /// The length of the next steps of an L-stable method after an event, until it is that of a part.
    ramp: f64,
    /// The most parts that the energy may ask for.
    most: u64,
    watch: Option<Watch>,
    /// The largest kinetic energy and springs so far.
    scale: f64,
    /// By how much the energy exceeded its least value when the last mode with springs ended.
    excess: f64,
}

/// The energy while springs act.
struct Watch {
    least: f64,
    last: f64,
}

impl Stiff {
    pub(super) fn new(setting: StiffSteps, method: &MethodInfo, dt: f64) -> Self {
        let longest = longest(method);
        Self {
            setting,
            longest,
            dt,
            parts: 1,
            ramp: f64::INFINITY,
            most: 1,
            watch: None,
            scale: 0.0,
            excess: 0.0,
        }
    }

    /// The length of a part.
    fn part(&self) -> f64 {
        self.dt / self.parts as f64
    }

    /// The length of the next step.
    pub(super) fn step(&self) -> f64 {
        self.part().min(self.ramp)
    }

    /// Lets steps grow after an event; whether the next one is longer than the last.
    pub(super) fn grows(&mut self) -> bool {
        let grows = self.ramp < self.part();
        self.ramp *= GROWTH;
        grows
    }

    /// Begins a mode in a state at `t`.
    pub(super) fn enter<H: Hybrid>(
        &mut self,
        frozen: &Frozen<'_, H>,
        t: f64,
        x: &StateOf<H>,
    ) -> Result<(), Interruption<H::Fault>> {
        let StiffSteps::Divide { most } = self.setting else { return Ok(()) };
        let rate = frozen.stiffest_rate(x);
        let parts = (self.dt * rate / self.longest).ceil().max(1.0);
        if parts.is_nan() || parts > most as f64 {
            return Err(Interruption::StepTooLong { t, dt: self.dt, parts, most });
        }
        self.parts = parts as u64;
        self.ramp = if self.longest.is_infinite() && rate > 0.0 { FIRST / rate } else { f64::INFINITY };
        self.most = most.min(FARTHER * self.parts);
        if let Some(watch) = self.watch.take() {
            self.excess = (watch.last - watch.least).max(0.0);
        }
        if rate > 0.0
            && let Some(energy) = frozen.energy(x)
        {
            let last = energy.total();
            self.scale = self.scale.max(energy.kinetic + energy.springs);
            self.watch = Some(Watch { least: last - self.excess, last });
        }
        Ok(())
    }

    /// Whether a step from `t` may stand that was made to its end, past events maybe: where it is thrown off,
    /// the parts are halved and it is to be made again.
    pub(super) fn holds<H: Hybrid>(
        &mut self,
        frozen: &Frozen<'_, H>,
        t: f64,
        x: &StateOf<H>,
    ) -> Result<bool, Interruption<H::Fault>> {
        let Some(watch) = &self.watch else { return Ok(true) };
        let Some(energy) = frozen.energy(x) else { return Ok(true) };
        // Springs that a step went into past an event are no part of its motion.
        let gain = energy.kinetic + energy.potential - watch.least;
        if gain <= self.scale { Ok(true) } else { self.halve(t, gain) }
    }

    /// Whether a step from `t` to a state may stand; where energy was gained, the parts are halved and it is to be
    /// made again.
    pub(super) fn accepts<H: Hybrid>(
        &mut self,
        frozen: &Frozen<'_, H>,
        t: f64,
        x: &StateOf<H>,
    ) -> Result<bool, Interruption<H::Fault>> {
        let Some(watch) = &mut self.watch else { return Ok(true) };
        let Some(energy) = frozen.energy(x) else { return Ok(true) };
        let Energy { kinetic, springs, potential } = energy;
        let total = energy.total();
        let scale = self.scale.max(kinetic + springs);
        let gain = total - watch.least;
        if gain <= GAIN * scale + ROUNDING * (kinetic + springs + potential.abs()) {
            self.scale = scale;
            (watch.last, watch.least) = (total, watch.least.min(total));
            return Ok(true);
        }
        self.halve(t, gain)
    }

    /// Halves the parts where energy was gained.
    fn halve<F>(&mut self, t: f64, gain: f64) -> Result<bool, Interruption<F>> {
        if self.shortens() {
            return Ok(false);
        }
        Err(Interruption::EnergyGain { t, gain: gain / self.scale, dt: self.part() })
    }

    /// Halves the parts, unless they are the shortest allowed.
    pub(super) fn shortens(&mut self) -> bool {
        let shortens = 2 * self.parts <= self.most;
        if shortens {
            (self.parts, self.ramp) = (2 * self.parts, 0.5 * self.ramp);
        }
        shortens
    }
}
