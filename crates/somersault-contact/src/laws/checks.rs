//! What holds for every law: the tests of the laws ask it of each of them.

use super::encounter::Encounter;
use super::friction_law::{FrictionChange, FrictionInput, FrictionLaw, FrictionResponse};
use super::normal_law::{NormalChange, NormalLaw};
use nalgebra::Vector3;

/// A contact that is pushed in and slides.
pub(crate) const PUSHED: Encounter = Encounter {
    gap: -0.02,
    rate: 0.3,
    normal: Vector3::new(0.6, 0.0, 0.8),
    point: Vector3::new(0.4, -0.1, 0.2),
    sliding: Vector3::new(0.4, -0.5, -0.3),
    turning: Vector3::new(-0.7, 1.1, 0.4),
    tilting: Vector3::new(0.3, -0.6, 0.8),
    mass: 1.0,
};
/// A change of it.
pub(crate) const CHANGE: Encounter = Encounter {
    gap: 0.3,
    rate: -0.8,
    normal: Vector3::new(0.4, 0.5, -0.3),
    point: Vector3::new(0.2, 0.7, -0.6),
    sliding: Vector3::new(-0.3, 0.2, 0.9),
    turning: Vector3::new(0.5, -0.4, 0.3),
    tilting: Vector3::new(0.2, 0.9, -0.5),
    mass: 0.0,
};
/// A stretch, and a change of it.
pub(crate) const STRETCH: Vector3<f64> = Vector3::new(0.03, 0.05, 0.025);
pub(crate) const STRETCH_CHANGE: Vector3<f64> = Vector3::new(-0.03, 0.06, 0.02);

/// The encounter moved by ε of its change.
pub(crate) fn moved(epsilon: f64) -> Encounter {
    Encounter {
        gap: PUSHED.gap + epsilon * CHANGE.gap,
        rate: PUSHED.rate + epsilon * CHANGE.rate,
        normal: PUSHED.normal + epsilon * CHANGE.normal,
        point: PUSHED.point + epsilon * CHANGE.point,
        sliding: PUSHED.sliding + epsilon * CHANGE.sliding,
        turning: PUSHED.turning + epsilon * CHANGE.turning,
        tilting: PUSHED.tilting + epsilon * CHANGE.tilting,
        mass: 1.0,
    }
}

/// The numbers of a law's parameters, of which one is ε, or none.
fn constants<const N: usize>(place: Option<usize>, epsilon: f64) -> [f64; N] {
    std::array::from_fn(|i| if place == Some(i) { epsilon } else { 0.0 })
}

/// That a normal law is what [`NormalLaw`] says, given the law by what is added to its parameters, at gaps and rates in
/// contact.
pub(crate) fn check_normal_law<L: NormalLaw, const N: usize>(
    build: impl Fn([f64; N]) -> L,
    in_contact: &[(f64, f64)],
) {
    let law = build([0.0; N]);
    assert_eq!(law.parameters().len(), N, "{law:?}");
    for gap in [-0.1, -1e-3, -1e-9, 1e-9, 0.1] {
        for rate in [-30.0, -0.1, 0.0, 0.1, 30.0] {
            let acts = gap < 0.0 && law.force_in_contact(gap, rate) > 0.0;
            assert_eq!(law.guard(gap, rate).is_inside(), acts, "{law:?} at {gap}, {rate}");
            assert!(law.lag(gap, rate) >= 0.0, "{law:?} at {gap}, {rate}");
        }
        assert!(gap < 0.0 || law.energy(gap) == 0.0, "{law:?} at {gap}");
    }
    for &(gap, rate) in in_contact {
        assert!(law.guard(gap, rate).is_inside(), "{law:?} at {gap}, {rate}");
        let step = 1e-5 * gap.abs();
        let by_gap = |f: &dyn Fn(f64) -> f64| (f(gap + step) - f(gap - step)) / (2.0 * step);
        let spring = law.force_in_contact(gap, 0.0);
        let released = -by_gap(&|gap| law.energy(gap));
        assert!((released / spring - 1.0).abs() < 1e-8, "{law:?}: {released} {spring}");
        let stiffest = law.stiffest(gap, rate, 1.0);
        let steepness = -by_gap(&|gap| law.force_in_contact(gap, rate));
        assert!(stiffest.stiffness >= steepness * (1.0 - 1e-8), "{law:?}: {stiffest:?} {steepness}");
        let hardest = law.force_in_contact(gap, -rate.abs());
        assert!(stiffest.force >= hardest * (1.0 - 1e-12), "{law:?}: {stiffest:?} {hardest}");
        let h = 1e-6;
        let [before, after] = [0.0, h].map(|t| law.guard(gap + t * rate, rate));
        let push = law.force_in_contact(gap + 0.5 * h * rate, rate);
        assert!((law.impulse(h, &before, &after) / (h * push) - 1.0).abs() < 1e-8, "{law:?}");
        for parameter in (0..N).map(Some).chain([None]) {
            let along = NormalChange { gap: 0.3, rate: -0.8, parameter };
            let found = law.derivative(gap, rate, &along).unwrap();
            let step = 1e-6;
            let [a, b] = [step, -step].map(|e| {
                let (law, gap, rate) = (build(constants(parameter, e)), gap + e * 0.3, rate - e * 0.8);
                (law.force_in_contact(gap, rate), law.lag(gap, rate))
            });
            for (found, a, b) in [(found.force, a.0, b.0), (found.lag, a.1, b.1)] {
                let difference = (a - b) / (2.0 * step);
                assert!((found - difference).abs() < 1e-6 * (1.0 + found.abs()), "{law:?} by {parameter:?}");
            }
        }
    }
}

/// That a friction law is what [`FrictionLaw`] says, given the law by what is added to its parameters.
pub(crate) fn check_friction_law<L: FrictionLaw, const N: usize>(build: impl Fn([f64; N]) -> L) {
    let law = build([0.0; N]);
    assert_eq!(law.parameters().len(), N, "{law:?}");
    let stretch = if law.spring(0.0).is_some() { STRETCH } else { Vector3::zeros() };
    let stretch_change = if law.spring(0.0).is_some() { STRETCH_CHANGE } else { Vector3::zeros() };
    let modes: &[bool] = if law.has_modes() { &[false, true] } else { &[false] };
    for &slips in modes {
        for normal_force in [0.5, 5.0, 500.0] {
            let input = FrictionInput { slips, normal_force, at: &PUSHED, stretch: &stretch };
            if !law.has_modes() || (law.margin(&input) < 0.0) == slips {
                let stored = law.spring(normal_force).map_or(0.0, |spring| spring.stiffness);
                let FrictionResponse { force, stretch_rate } = law.response(&input);
                let power = force.dot(&PUSHED.sliding) + stored * stretch.dot(&stretch_rate);
                assert!(power <= 0.0, "{law:?} gives {power} W");
            }
            for parameter in (0..N).map(Some).chain([None]) {
                let (at, stretch_change) = (&CHANGE, &stretch_change);
                let along = FrictionChange { normal_force: 2.0, at, stretch: stretch_change, parameter };
                let found = law.derivative(&input, &along).unwrap();
                let step = 1e-6;
                let [a, b] = [step, -step].map(|e| {
                    let (at, stretch) = (moved(e), stretch + stretch_change * e);
                    let law = build(constants(parameter, e));
                    let normal_force = normal_force + e * 2.0;
                    let input = FrictionInput { slips, normal_force, at: &at, stretch: &stretch };
                    (law.response(&input), law.margin(&input))
                });
                let vectors = [
                    (found.force, a.0.force, b.0.force),
                    (found.stretch_rate, a.0.stretch_rate, b.0.stretch_rate),
                ];
                for (found, a, b) in vectors {
                    let error = (found - (a - b) / (2.0 * step)).norm();
                    assert!(error < 1e-6 * (1.0 + found.norm()), "{law:?} by {parameter:?}: {error:e}");
                }
                let difference = (a.1 - b.1) / (2.0 * step);
                let error = (found.margin - difference).abs();
                assert!(error < 1e-6 * (1.0 + found.margin.abs()), "{law:?} by {parameter:?}: {error:e}");
            }
        }
    }
}
