//! **SYNTHETIC**: the optimal 107B, perturbed, judged by a formula, and the judge learnt from markers.
//!
//! ```text
//! cargo run --release -p somersault-motion --example synthetic_scoring
//! ```

use somersault_dives::{Dive, DiveSearch};
use somersault_motion::fit::MarkerSet;
use somersault_motion::scoring::{ScoringOptions, ValidationOptions, validate};
use somersault_motion::synthetic::{
    Perturbation, SyntheticFlight, SyntheticJudge, SyntheticOptions, SyntheticSet,
};
use somersault_nlp::Flow;
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let dive = Dive::forward_pike()?;
    let (model, program) = (dive.diver.model()?, dive.program()?);
    let start = program.start(&Dive::pike_template())?;
    let found = DiveSearch::direct().solve(&program, start, &mut |_| Flow::Continue)?;
    let motion = program.motion(&found.z)?;

    let flight = SyntheticFlight::try_new(&model, &motion.times, &motion.positions)?;
    let optimal = flight.perturb(&Perturbation::none())?.faults(&model)?;
    let judge = SyntheticJudge::with_reference(optimal);
    let markers = MarkerSet::joint_centres(&model)?;
    let set = SyntheticSet::generate(&flight, &markers, &judge, &SyntheticOptions::of(60))?;
    println!("60 SYNTHETIC dives; the judge's noise is {} points", judge.noise);

    let options = ScoringOptions { max_components: 12, ..ScoringOptions::thesis() };
    let found = validate(&set.performances()?, &set.scores, &options, &ValidationOptions::default(), &[])?;
    println!("each scored by a model of the others: error {:.2} points (SYNTHETIC)", found.rms_error);
    for (name, r) in [("Pearson", found.pearson), ("Spearman", found.spearman)] {
        let [lower, upper] = r.interval;
        println!("  {name} {:.2}, 95 % of resamples {lower:.2} to {upper:.2}, p = {:.3}", r.value, r.p_value);
    }
    for baseline in &found.baselines {
        println!("  {} alone: error {:.2} points", baseline.name, baseline.rms_error);
    }
    Ok(())
}
