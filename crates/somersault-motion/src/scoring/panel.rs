//! What a panel of judges makes of a dive.

use super::ScoringError;
use somersault_core::argument::{ArgumentError, expect_positive};

/// The points of a dive, and which awards count.
#[derive(Debug, Clone, PartialEq)]
pub struct PanelScore {
    /// Σ awards that count × difficulty.
    pub points: f64,
    /// Whether the award of each judge counts.
    pub counts: Vec<bool>,
}

/// The points of a dive for the awards of its judges and its degree of difficulty.
///
/// Of seven judges the two highest and the two lowest awards are cancelled, of five the highest and the lowest, of three none; the sum of the
/// others is multiplied by the difficulty. Awards are half points from 0 to 10. Of equal awards the first ones are cancelled.
///
/// Source: World Aquatics, Competition Regulations, diving.
pub fn panel_score(awards: &[f64], difficulty: f64) -> Result<PanelScore, ScoringError> {
    let cancelled = match awards.len() {
        3 => 0,
        5 => 1,
        7 => 2,
        found => {
            let allowed = "of 3, 5 or 7 judges";
            return Err(ArgumentError::OutOfRange { argument: "awards", allowed, found: found as f64 }.into());
        }
    };
    if let Some(&found) =
        awards.iter().find(|award| !((0.0..=10.0).contains(*award) && (2.0 * **award).fract() == 0.0))
    {
        let allowed = "half points from 0 to 10";
        return Err(ArgumentError::OutOfRange { argument: "awards", allowed, found }.into());
    }
    let difficulty = expect_positive("difficulty", difficulty)?;
    let mut order: Vec<usize> = (0..awards.len()).collect();
    order.sort_by(|&i, &j| awards[i].total_cmp(&awards[j]));
    let mut counts = vec![true; awards.len()];
    for &i in order.iter().take(cancelled).chain(order.iter().rev().take(cancelled)) {
        counts[i] = false;
    }
    let sum: f64 = awards.iter().zip(&counts).filter(|(_, counts)| **counts).map(|(award, _)| award).sum();
    Ok(PanelScore { points: sum * difficulty, counts })
}
