//! Flights flown again with changes, and advice for faults that are known.

use nalgebra::Vector3;
use somersault_core::cancel::CancellationToken;
use somersault_integrators::driver::TimeGrid;
use somersault_integrators::methods::Method;
use somersault_integrators::run::Run;
use somersault_integrators::solution::Recorder;
use somersault_integrators::system::System;
use somersault_motion::advice::{
    AdviceError, AdviceStatus, Correction, FlightAdvice, Reach, WhatIfFlight, advise_flight,
};
use somersault_motion::fit::MarkerSet;
use somersault_motion::identification::{FlightReport, identify_flight};
use somersault_motion::reconstruction::{FlightReconstruction, ReconstructedFlight, ReconstructionOptions};
use somersault_motion::synthetic::synthetic_markers;
use somersault_multibody::Model;
use somersault_multibody::flight::{Flight, FlightChange, FlightSystem, TakeOff};
use somersault_multibody::models::{Diver, Posture};

const DURATION: f64 = 1.4;

/// A planar dive: folded between 0.1 and 0.4 s, opened within 0.25 s, and its reconstruction from markers with noise of 10 mm.
fn dived(posture: Posture, loose: f64, opens: f64, momentum: f64) -> (Model, ReconstructedFlight) {
    let diver = Diver::planar();
    let model = diver.model().unwrap();
    let open = Posture::A.planar().unwrap();
    let mut folded = posture.planar().unwrap();
    folded[1] -= loose;
    folded[2] -= if posture == Posture::F { loose } else { 0.0 };
    let smooth = |x: f64| {
        let x = x.clamp(0.0, 1.0);
        (x.powi(3) * (10.0 - 15.0 * x + 6.0 * x * x), 30.0 * (x * (1.0 - x)).powi(2))
    };
    let shape = move |t: f64, q: &mut [f64], v: &mut [f64]| {
        let ((a, rise), (b, fall)) = (smooth((t - 0.1) / 0.3), smooth((t - opens) / 0.25));
        let (w, rate) = (a * (1.0 - b), rise / 0.3 * (1.0 - b) - a * fall / 0.25);
        for k in 0..9 {
            q[k] = open[k] + w * (folded[k] - open[k]);
            v[k] = rate * (folded[k] - open[k]);
        }
    };
    let take_off = TakeOff {
        time: 0.0,
        center_of_mass: Vector3::new(0.0, 0.0, 4.0),
        velocity: Vector3::new(1.0, 0.0, 4.8),
        angular_momentum: Vector3::new(0.0, momentum, 0.0),
    };
    let system = FlightSystem::new(Flight::try_new(&model, take_off).unwrap(), &shape);
    let start = system.state(&[-0.1]).unwrap();
    let mut recorder = Recorder::new(0.0, &start, 1);
    let grid = TimeGrid::try_new(0.0, DURATION, 0.01).unwrap();
    Run::new(&system, Method::Rkmk, grid).observed_by(&mut recorder).from(&start).unwrap();
    let flown = recorder.into_solution();
    let mut workspace = system.workspace();
    let (mut times, mut positions) = (Vec::new(), Vec::new());
    for (t, x) in flown.times.iter().zip(&flown.states) {
        times.push(*t);
        positions.extend_from_slice(system.complete(&mut workspace, *t, x).unwrap().0);
    }
    let markers = MarkerSet::joint_centres(&model).unwrap();
    let seen = synthetic_markers(&model, &markers, &times, &positions, 0.01, 3).unwrap();
    let options =
        ReconstructionOptions { interval: Some((0.0, DURATION)), ..ReconstructionOptions::default() };
    let flight = FlightReconstruction::try_new(&model, markers, options).unwrap().reconstruct(&seen).unwrap();
    assert!(flight.success());
    (model, flight)
}

fn advised(model: &Model, flight: &ReconstructedFlight, n: Option<i32>) -> (FlightReport, FlightAdvice) {
    let report = identify_flight(model, flight, None).unwrap();
    let advice = advise_flight(model, flight, &report, n, &Reach::default(), &CancellationToken::new());
    (report, advice.unwrap())
}

#[test]
fn amounts_of_advice_bring_the_entry_to_the_vertical() {
    // three half somersaults in pike that are opened late and turn too far
    let (model, flight) = dived(Posture::H, 0.0, 1.04, 47.0);
    let (report, found) = advised(&model, &flight, Some(3));
    println!("{:.1}° {found:#?}", found.entry_angle.value.to_degrees());
    assert_eq!(found.status, AdviceStatus::Given);
    let again = WhatIfFlight::try_new(&model, &flight, &report, None).unwrap();
    // flown again without a change it is the flight
    let last = flight.frames.last().unwrap();
    assert!((again.unchanged().somersaults - last.somersaults).abs() < 1e-4);
    assert!((again.unchanged().entry_angle - report.entry_angle.value).abs() < 1e-3);
    for advice in &found.advice {
        assert!(advice.amount.lower > 0.0 && advice.amount.value < advice.amount.upper);
        let size = advice.amount.value.min(advice.reach);
        let change = match advice.correction {
            Correction::OpenLater => FlightChange { opening: size, ..FlightChange::default() },
            Correction::OpenEarlier => FlightChange { opening: -size, ..FlightChange::default() },
            Correction::Tighter => FlightChange { posture: size, ..FlightChange::default() },
            Correction::MoreMomentum => FlightChange { momentum: size, ..FlightChange::default() },
            Correction::LessMomentum => FlightChange { momentum: -size, ..FlightChange::default() },
        };
        let flown = again.fly(&change).unwrap();
        assert!((flown.flown.entry_angle - advice.flown).abs() < 1e-4);
        if size == advice.amount.value {
            assert!((found.entry_angle.value + flown.flown.entry_angle).abs() < 1e-3);
        }
    }
}

#[test]
fn a_flight_that_is_vertical_or_no_dive_has_no_advice() {
    let (model, flight) = dived(Posture::H, 0.0, 1.04, 47.0);
    let (report, found) = advised(&model, &flight, Some(3));
    let mut vertical = report.clone();
    let off = found.entry_angle.value;
    for x in
        [&mut vertical.entry_angle.value, &mut vertical.entry_angle.lower, &mut vertical.entry_angle.upper]
    {
        *x -= off;
    }
    let token = CancellationToken::new();
    let status = |report: &FlightReport, n, flight: &ReconstructedFlight| {
        advise_flight(&model, flight, report, n, &Reach::default(), &token).unwrap().status
    };
    assert_eq!(status(&vertical, Some(3), &flight), AdviceStatus::Vertical);
    assert_eq!(status(&report, Some(9), &flight), AdviceStatus::FarFromTarget);
    let mut other = flight.clone();
    other.status = somersault_motion::reconstruction::ReconstructionStatus::Misfit;
    assert_eq!(status(&report, Some(3), &other), AdviceStatus::NotReconstructed);
    // bad arguments
    let advise = |n, reach: Reach| advise_flight(&model, &flight, &report, n, &reach, &token).unwrap_err();
    let reach = Reach::default();
    for (error, named) in [
        (advise(Some(0), reach), "`half_somersaults`"),
        (advise(Some(12), reach), "`half_somersaults`"),
        (advise(None, Reach { line_up: -1.0, ..reach }), "`line_up`"),
        (advise(None, Reach { momentum: f64::NAN, ..reach }), "`momentum_reach`"),
    ] {
        assert!(error.to_string().contains(named), "{error}");
    }
    token.cancel();
    assert_eq!(advise(Some(3), reach), AdviceError::Interrupted);
}
