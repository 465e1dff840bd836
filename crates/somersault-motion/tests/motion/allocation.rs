//! No allocation in an iteration: that of a fit does not depend on how many there are.

use somersault_motion::fit::{FitOptions, Loss, MarkerFit, MarkerSet, Shape};
use somersault_motion::recording::MarkerRecording;
use somersault_motion::synthetic::synthetic_markers;
use somersault_multibody::joint_motion::EigenpostureBase;
use somersault_multibody::models::{Diver, Posture};
use somersault_multibody::{Model, ModelBuilder};
use somersault_testkit::allocations::allocations;

/// The diver with joints that have no upper limit. A joint with both is turned through its range, and how many searches begin there
/// depends on where the one before ended.
fn half_bounded(diver: &Diver) -> Model {
    let mut builder = ModelBuilder::new();
    for link in diver.model().unwrap().links() {
        let limits = link.limits();
        let link = limits.map_or(link.clone(), |[lower, _]| link.clone().with_limits(lower, f64::INFINITY));
        builder.add(link).unwrap();
    }
    builder.build().unwrap()
}

/// A frame of a diver who folds, with noise and one marker in five missing. Of more, neighbours would begin from each other as long
/// as one gets lower.
fn recording(diver: &Diver, model: &Model, markers: &MarkerSet) -> MarkerRecording {
    let [a, h] = [Posture::A, Posture::H].map(|p| diver.configuration(p).unwrap());
    let times = vec![0.0];
    let positions: Vec<f64> = a.iter().zip(&h).map(|(a, h)| a + 0.4 * (h - a)).collect();
    let whole = synthetic_markers(model, markers, &times, &positions, 0.01, 1).unwrap();
    let points = whole.frames().flatten().enumerate().map(|(k, p)| p.filter(|_| k % 5 != 3));
    MarkerRecording::try_new(whole.names().to_vec(), times, points.collect()).unwrap()
}

/// Allocations and cost of a fit in searches of so many iterations at most.
fn fit(diver: &Diver, shape: &Shape, loss: Loss, max_iterations: usize) -> (u64, f64) {
    let model = half_bounded(diver);
    let bodies = model.links().iter().map(|l| l.name().to_owned()).filter(|n| !n.contains("shoulder_"));
    let markers = MarkerSet::on_bodies(&model, bodies.map(|b| (b.clone(), b, [0.03, 0.05, -0.02]))).unwrap();
    let recording = recording(diver, &model, &markers);
    let options =
        FitOptions { shape: shape.clone(), loss, max_iterations, step_tol: 1e-300, ..FitOptions::default() };
    let fit = MarkerFit::try_new(&model, markers, options).unwrap();
    let mut cost = f64::NAN;
    let count = allocations(|| cost = fit.fit(&recording).unwrap().frames[0].cost);
    (count, cost)
}

#[test]
fn iterations_of_a_fit_do_not_allocate() {
    // this thread, whose allocations are counted, does all the work
    let _pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build().unwrap();
    fit(&Diver::planar(), &Shape::Joints, Loss::Squares, 1);
    for diver in [Diver::planar(), Diver::spatial()] {
        let root = if diver == Diver::planar() { 3 } else { 7 };
        let postures = [Posture::A, Posture::H].map(|p| diver.configuration(p).unwrap()[root..].to_vec());
        let base = Shape::Eigenpostures(EigenpostureBase::try_new(&postures).unwrap());
        for shape in [Shape::Joints, base] {
            for loss in [Loss::Squares, Loss::Huber(0.01), Loss::Cauchy(0.01)] {
                let (few, many) = (fit(&diver, &shape, loss, 1), fit(&diver, &shape, loss, 12));
                assert!(many.1 < few.1, "more iterations were made: {few:?}, {many:?}");
                assert_eq!(few.0, many.0, "{:?}, {loss:?}: {few:?}, {many:?}", diver.dimension);
            }
        }
    }
}
