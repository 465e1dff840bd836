//! Functions that are watched along runs: events in closed form, and states at given times.

use somersault_integrators::driver::{Adaptive, Status, Steps, TimeGrid};
use somersault_integrators::events::{
    Certificate, Direction, Occurrence, Watch, WatchError, WatchRule, Watched,
};
use somersault_integrators::methods::Method;
use somersault_integrators::nalgebra::Vector3;
use somersault_integrators::reversal::{Backwards, reversed};
use somersault_integrators::run::Run;
use somersault_integrators::solution::Recorder;
use somersault_integrators::state::{Pose, RigidBodyState};
use somersault_integrators::stepper::MethodInfo;
use somersault_integrators::system::RigidBodySystem;
use somersault_integrators::{
    body::RigidBody,
    force::{BoxedForce, Spring},
};
use somersault_testkit::problems::under;
use std::f64::consts::PI;

/// A ball on a spring of 1 N/m and length 0: x = cos t, v = −sin t.
fn oscillator() -> (RigidBodySystem<Vec<BoxedForce>>, RigidBodyState) {
    let zero = Vector3::zeros();
    let spring = Spring { anchor: zero, attachment: zero, stiffness: 1.0, damping: 0.0, rest_length: 0.0 };
    let mut start = RigidBodyState::default();
    start.configuration.position.x = 1.0;
    (under(RigidBody::try_box(1.0, Vector3::repeat(0.1)).unwrap(), spring), start)
}

fn grid(start: f64, end: f64, dt: f64) -> Steps {
    TimeGrid::try_new(start, end, dt).unwrap().into()
}

/// The events of one function of time and x in a run with steps.
fn watched(
    steps: Steps,
    rule: WatchRule,
    mut function: impl FnMut(f64, f64) -> f64,
) -> (Watched<Pose>, f64, Status) {
    let (system, mut start) = oscillator();
    let t = steps.interval().0;
    (start.configuration.position.x, start.rate.linear.x) = (t.cos(), -t.sin());
    let mut watch = Watch::new(vec![rule], |t, x: &RigidBodyState, out: &mut [f64]| {
        out[0] = function(t, x.position().x);
    });
    let end = Run::new(&system, Method::Rkmk8, steps).observed_by(&mut watch).from(&start).unwrap();
    (watch.finish().unwrap(), end.t, end.status)
}

fn times(found: &Watched<Pose>) -> Vec<f64> {
    found.occurrences.iter().map(|event| event.t).collect()
}

fn assert_times(found: &[f64], expected: &[f64], error: f64) {
    assert_eq!(found.len(), expected.len(), "{found:?}");
    found.iter().zip(expected).for_each(|(t, at)| assert!((t - at).abs() < error, "{found:?}"));
}

#[test]
fn events_have_the_accuracy_of_the_method_and_leave_its_steps_as_they_are() {
    let (system, start) = oscillator();
    let adapted = Steps::adapted((0.0, 20.0), Adaptive::with_tolerances(1e-13, 1e-13));
    for steps in [grid(0.0, 20.0, 0.1), adapted] {
        let free = Run::new(&system, Method::Rkmk8, steps).from(&start).unwrap();
        let mut watch =
            Watch::new(vec![WatchRule::default(); 2], |_, x: &RigidBodyState, out: &mut [f64]| {
                (out[0], out[1]) = (x.position().x, x.velocity().x);
            });
        let end = Run::new(&system, Method::Rkmk8, steps).observed_by(&mut watch).from(&start).unwrap();
        assert_eq!((end.state, end.steps, end.status), (free.state, free.steps, Status::Finished));
        let found = watch.finish().unwrap().occurrences;
        // x vanishes at odd multiples of π/2 and v at the even ones, but not at the start.
        assert_eq!(found.len(), 12);
        for (k, Occurrence { function, t, state }) in found.iter().enumerate() {
            assert!((t - 0.5 * PI * (k + 1) as f64).abs() < 1e-11, "{k} {t}");
            assert_eq!(*function, k % 2);
            assert!((state.position().x - t.cos()).abs() < 1e-11);
        }
    }
}

#[test]
fn the_order_of_event_times_is_that_of_the_method() {
    for (method, order) in [(Method::Rkmk, 4.0), (Method::Rkmk5, 5.0), (Method::Ab4, 4.0)] {
        let (system, start) = oscillator();
        let error = |dt: f64| {
            let mut watch =
                Watch::new(vec![WatchRule::default()], |_, x: &RigidBodyState, out: &mut [f64]| {
                    out[0] = x.position().x;
                });
            Run::new(&system, method, grid(0.0, 5.0, dt)).observed_by(&mut watch).from(&start).unwrap();
            (times(&watch.finish().unwrap())[1] - 1.5 * PI).abs()
        };
        let observed = (error(0.05) / error(0.025)).log2();
        assert!(observed > order - 0.5, "{method}: {observed}");
    }
}

#[test]
fn a_zero_at_the_start_is_no_event() {
    let any = WatchRule::default();
    // It rises, falls, stands still and turns away from zero at once.
    let functions: [fn(f64, f64) -> f64; 5] =
        [|t, _| t, |t, _| -t, |_, _| 0.0, |t, _| -t * t, |_, x| x - 1.0];
    for function in functions {
        assert_times(&times(&watched(grid(0.0, 1.0, 0.1), any, function).0), &[], 0.0);
    }
    let (found, ..) = watched(grid(0.0, 1.0, 0.1), any, |t, _| t * (t - 0.55));
    assert_times(&times(&found), &[0.55], 1e-14);
}

#[test]
fn two_events_in_a_step_are_found_and_a_touch_is_none() {
    let any = WatchRule::default();
    let dip = |depth: f64| move |t: f64, _: f64| (t - 0.537) * (t - 0.537) - depth;
    for depth in [1e-2, 1e-6, 1e-10] {
        let (found, ..) = watched(grid(0.0, 1.0, 0.5), any, dip(depth));
        assert_times(&times(&found), &[0.537 - depth.sqrt(), 0.537 + depth.sqrt()], 1e-9);
    }
    for depth in [0.0, 1e-17, -1e-10] {
        for dt in [0.5, 0.1, 0.0537] {
            assert_times(&times(&watched(grid(0.0, 1.0, dt), any, dip(depth)).0), &[], 0.0);
        }
    }
    // A touch at the end of a step.
    assert_times(&times(&watched(grid(0.0, 1.0, 0.25), any, |t, _| (t - 0.5) * (t - 0.5)).0), &[], 0.0);
    // The oscillator turns at x = −1 + 10⁻¹⁰ before and after π.
    let (found, ..) = watched(grid(0.0, 6.0, 0.2), any, |_, x| x + 1.0 - 1e-10);
    let half = (2e-10_f64).sqrt();
    assert_times(&times(&found), &[PI - half, PI + half], 1e-6);
}

#[test]
fn an_event_at_the_end_of_a_step_is_found_once() {
    let any = WatchRule::default();
    let (found, ..) = watched(grid(0.0, 1.0, 0.25), any, |t, _| t - 0.5);
    assert_eq!(times(&found), [0.5]);
    let (found, t, _) = watched(grid(0.0, 1.0, 0.25), any, |t, _| t - 1.0);
    assert_eq!((times(&found), t), (vec![1.0], 1.0));
}

#[test]
fn rules_say_which_way_and_how_often() {
    let rule = |direction, terminal| WatchRule { direction, terminal, lipschitz: None };
    let run = |rule| {
        let (found, t, status) = watched(grid(0.0, 20.0, 0.3), rule, |_, x| x);
        (times(&found), t, status, found.ended_by)
    };
    let (found, ..) = run(rule(Direction::Falling, None));
    assert_times(&found, &[0.5 * PI, 2.5 * PI, 4.5 * PI], 1e-7);
    let (found, t, status, by) = run(rule(Direction::Rising, Some(1)));
    assert_times(&found, &[1.5 * PI], 1e-7);
    assert_eq!((t, status, by), (found[0], Status::Stopped, Some(0)));
    let (found, t, _, by) = run(rule(Direction::Both, Some(3)));
    assert_times(&found, &[0.5 * PI, 1.5 * PI, 2.5 * PI], 1e-7);
    assert_eq!((t, by), (found[2], Some(0)));
    assert_eq!(run(rule(Direction::Both, Some(30))).2, Status::Finished);
}

fn bounded(lipschitz: f64) -> WatchRule {
    WatchRule { lipschitz: Some(lipschitz), ..WatchRule::default() }
}

#[test]
fn with_a_lipschitz_constant_no_dip_is_missed() {
    // Below zero for 10⁻⁶ of a step of 0.5 s, by the time and by the motion, x = cos t.
    let dip = |t: f64, _: f64| (t - 0.7301).abs() - 2.5e-7;
    let (unseen, ..) = watched(grid(0.0, 1.0, 0.5), WatchRule::default(), dip);
    assert_eq!((times(&unseen), &unseen.certificates[..]), (vec![], &[Certificate::Unbounded][..]));
    for rule in [bounded(1.0), bounded(20.0)] {
        let (found, ..) = watched(grid(0.0, 1.0, 0.5), rule, dip);
        assert_times(&times(&found), &[0.7301 - 2.5e-7, 0.7301 + 2.5e-7], 1e-13);
        assert_eq!(found.certificates, [Certificate::Certified]);
    }
    let (found, ..) = watched(grid(0.0, 2.0, 0.5), bounded(1.0), |_, x| (x - 0.3).abs() - 1e-7);
    assert_times(&times(&found), &[0.3_f64.acos(); 2], 2e-7);
    assert_eq!(found.certificates, [Certificate::Certified]);
    // Five dips in two steps, of which one is before a zero at the end of a step.
    let dips = [0.031, 0.171, 0.4999, 0.61, 0.98];
    let at_dips =
        |t: f64, _: f64| dips.iter().map(|at| (t - at).abs() - 1e-6).fold((0.75 - t).abs(), f64::min);
    let (found, ..) = watched(grid(0.0, 1.0, 0.25), bounded(1.0), at_dips);
    let expected: Vec<f64> = dips.iter().flat_map(|at| [at - 1e-6, at + 1e-6]).collect();
    assert_times(&times(&found), &expected, 1e-13);
    let falls = |t: f64, _: f64| ((t - 0.4).abs() - 1e-5).min(0.5 - t);
    let (found, ..) = watched(grid(0.0, 1.0, 0.25), bounded(1.0), falls);
    assert_times(&times(&found), &[0.4 - 1e-5, 0.4 + 1e-5, 0.5], 1e-13);
}

#[test]
fn what_a_lipschitz_constant_does_not_prove_is_not_certified() {
    // A touch is as near to an event as may be.
    let touch = |t: f64, _: f64| (t - 0.537) * (t - 0.537);
    let (found, _, status) = watched(grid(0.0, 1.0, 0.5), bounded(1.0), touch);
    assert_eq!((times(&found), status), (vec![], Status::Finished));
    assert_eq!(found.certificates, [Certificate::Unproved { from: 0.5, to: 1.0 }]);
    // Its bound is given up for the step, not the search.
    let crosses = |t: f64, _: f64| (t - 0.537) * (t - 0.537) - 1e-17;
    assert_times(&times(&watched(grid(0.0, 1.0, 0.5), bounded(1.0), crosses).0), &[], 0.0);
    let (found, ..) = watched(grid(0.0, 1.0, 0.5), bounded(0.0), |_, _| 1.0);
    assert_eq!(found.certificates, [Certificate::Certified]);
}

#[test]
fn a_lipschitz_constant_that_does_not_hold_ends_the_run() {
    let refused = |lipschitz: f64| {
        let (system, start) = oscillator();
        let rules = vec![WatchRule::default(), bounded(lipschitz)];
        let mut watch = Watch::new(rules, |t, x: &RigidBodyState, out: &mut [f64]| {
            (out[0], out[1]) = (t - 0.05, 3.0 * x.velocity().x - 1.0);
        });
        let run = Run::new(&system, Method::Rkmk8, grid(0.0, 2.0, 0.1)).observed_by(&mut watch);
        run.from(&start).unwrap();
        watch.finish().map(|found| times(&found)).map_err(|broken| broken.reason)
    };
    // Its rate is −3 cos t.
    let Err(WatchError::Violated { function: 1, lipschitz, times, values }) = refused(2.9) else { panic!() };
    // The event of the other function has divided the step.
    assert_eq!((lipschitz, times), (2.9, (0.0, 0.05)));
    assert!((values.1 - values.0).abs() > 2.9 * 0.05);
    assert_eq!(refused(3.0), Ok(vec![0.05]));
    for wrong in [-1.0, f64::NAN, f64::INFINITY] {
        let Err(error) = refused(wrong) else { panic!("{wrong}") };
        assert!(matches!(error, WatchError::Lipschitz { function: 1, .. }), "{error}");
        assert!(error.to_string().contains("`lipschitz` must be finite and not negative"), "{error}");
    }
}

#[test]
fn a_watch_continues_where_another_ended() {
    let (system, start) = oscillator();
    let rule = WatchRule { terminal: Some(2), ..bounded(1.0) };
    let watch = || {
        Watch::new(vec![rule, WatchRule::default()], |t, x: &RigidBodyState, out: &mut [f64]| {
            (out[0], out[1]) = (x.position().x, t - 2.0);
        })
    };
    let (mut whole, mut first) = (watch(), watch());
    let at_once = Run::new(&system, Method::Rkmk8, grid(0.0, 8.0, 0.25)).observed_by(&mut whole);
    let at_once = at_once.from(&start).unwrap();
    // The first run ends at a zero of the second function, which is not found again.
    let half = Run::new(&system, Method::Rkmk8, grid(0.0, 2.0, 0.25)).observed_by(&mut first);
    let half = half.from(&start).unwrap();
    let mut second = watch().resuming(first.progress());
    let end = Run::new(&system, Method::Rkmk8, grid(2.0, 8.0, 0.25)).observed_by(&mut second);
    let end = end.from(&half.state).unwrap();
    assert_eq!((end.t, end.state), (at_once.t, at_once.state));
    let (found, whole) = (second.finish().unwrap(), whole.finish().unwrap());
    let parts: Vec<f64> = [first.finish().unwrap(), found.clone()].iter().flat_map(times).collect();
    assert_eq!(parts, times(&whole));
    assert_eq!((found.ended_by, found.certificates), (whole.ended_by, whole.certificates));
}

#[test]
fn directions_count_along_a_run_backwards() {
    let (system, start) = oscillator();
    let rule = WatchRule { direction: Direction::Falling, terminal: Some(1), lipschitz: None };
    let mut end = start;
    let t = 10.0_f64;
    (end.configuration.position.x, end.rate.linear.x) = (t.cos(), -t.sin());
    let mut watch = Watch::new(vec![rule], |t: f64, x: &RigidBodyState, out: &mut [f64]| {
        assert!((x.position().x - t.cos()).abs() < 1e-4 && (x.velocity().x + t.sin()).abs() < 1e-4);
        out[0] = x.position().x;
    });
    let mut recorder = Recorder::new(t, &end, 1).with_dense_output();
    let mut observer = Backwards((&mut watch, &mut recorder));
    let run = Run::new(&system, Method::Rkmk8, grid(-10.0, 0.0, 0.3)).observed_by(&mut observer);
    let reached = run.from(&reversed(&end)).unwrap();
    // The rate along the run is sin t.
    let found = watch.finish().unwrap();
    assert_times(&times(&found), &[1.5 * PI], 1e-7);
    assert!((reached.t + 1.5 * PI).abs() < 1e-7);
    let motion = recorder.into_solution();
    let state = motion.at(7.0).unwrap();
    assert!(
        (state.position().x - 7.0_f64.cos()).abs() < 1e-7
            && (state.velocity().x + 7.0_f64.sin()).abs() < 1e-7
    );
    assert!(motion.at(4.0).is_none() && motion.at(10.1).is_none());
}

#[test]
fn a_function_without_a_value_ends_the_run() {
    let (system, start) = oscillator();
    let mut watch = Watch::new(vec![WatchRule::default(); 2], |t, _: &RigidBodyState, out: &mut [f64]| {
        (out[0], out[1]) = (t - 0.25, (0.72 - t).sqrt());
    });
    let run = Run::new(&system, Method::Rkmk, grid(0.0, 1.0, 0.1)).observed_by(&mut watch);
    assert_eq!(run.from(&start).unwrap().status, Status::Stopped);
    let broken = watch.finish().unwrap_err();
    assert_times(&times(&broken.so_far), &[0.25], 1e-14);
    assert!(matches!(broken.reason, WatchError::NonFinite { function: 1, t, .. } if (t - 0.8).abs() < 1e-12));
}

#[test]
fn states_at_times_have_the_order_of_the_method() {
    let (body, spin) =
        (RigidBody::try_box(1.0, Vector3::new(0.2, 0.4, 0.6)).unwrap(), Vector3::new(0.1, 2.0, 0.3));
    let (system, start) = (RigidBodySystem::free(body), RigidBodyState::spinning(spin));
    let exact = somersault_integrators::exact::FreeBody::try_new(&body, &start).unwrap();
    let t_eval: Vec<f64> = [0.013, 0.333, 0.7777, 1.0].into();
    for method in [Method::Rkmk, Method::Rkmk5, Method::Rkmk8, Method::Radau5, Method::Pmv8, Method::Ab4] {
        let MethodInfo { orders, dense_order, .. } = method.info();
        let error = |dt: f64| {
            let mut recorder = Recorder::at_times((0.0, 1.0), &start, t_eval.clone()).unwrap();
            Run::new(&system, method, grid(0.0, 1.0, dt)).observed_by(&mut recorder).from(&start).unwrap();
            let found = recorder.into_solution();
            assert_eq!(found.times, t_eval);
            let errors = found
                .times
                .iter()
                .zip(&found.states)
                .map(|(t, x)| x.orientation().angle_to(exact.at(*t).unwrap().orientation()));
            errors.fold(0.0, f64::max)
        };
        let (coarse, fine) = (error(0.2), error(0.1));
        let order = f64::from(orders.rotation);
        assert!(
            fine < 1e-11 || (coarse / fine).log2() > order - 0.8,
            "{method} {dense_order}: {coarse:e} {fine:e}"
        );
    }
}

#[test]
fn times_that_a_run_does_not_pass_are_refused() {
    let start = RigidBodyState::default();
    let refused = |interval, t_eval: &[f64]| {
        Recorder::at_times(interval, &start, t_eval.to_vec()).err().unwrap().to_string()
    };
    assert_eq!(refused((0.0, 1.0), &[]), "`t_eval` must have at least 1 entries, found 0");
    assert_eq!(refused((0.0, 1.0), &[0.5, 1.5]), "`t_eval` must be within `interval`, found 1.5");
    assert_eq!(refused((0.0, 1.0), &[f64::NAN]), "`t_eval` must be finite, found NaN");
    let order = "`t_eval` must be times that follow each other in the direction of the run, found 0.5";
    assert_eq!(refused((0.0, 1.0), &[0.5, 0.5]), order);
    assert_eq!(refused((1.0, 0.0), &[0.2, 0.5]), order);
    assert!(Recorder::at_times((1.0, 0.0), &start, vec![1.0, 0.5, 0.0]).is_ok());
}
