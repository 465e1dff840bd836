//! Motions that are left out together.

use super::ScoringError;
use somersault_core::argument::ArgumentError;
use std::collections::HashMap;
use std::hash::Hash;

/// Groups that intervals and p-values need at least.
const LEAST: usize = 3;

/// Which motions belong together, such as those of an athlete. They are left out together, so that errors are those of motions of athletes
/// that a model has not seen.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Groups {
    /// The group of each motion, from 0.
    of: Vec<usize>,
    /// The motions of each group.
    motions: Vec<Vec<usize>>,
}

impl Groups {
    /// By a label of each motion: those of the same label belong together. There must be three groups at least.
    ///
    /// ```
    /// use somersault_motion::scoring::Groups;
    ///
    /// let groups = Groups::try_new(&["Ann", "Bea", "Ann", "Cleo"])?;
    /// assert_eq!((groups.n_groups(), groups.n_motions()), (3, 4));
    /// # Ok::<(), somersault_motion::scoring::ScoringError>(())
    /// ```
    pub fn try_new<T: Eq + Hash>(labels: &[T]) -> Result<Self, ScoringError> {
        let mut numbers = HashMap::new();
        let (mut of, mut motions) = (Vec::with_capacity(labels.len()), Vec::<Vec<usize>>::new());
        for (i, label) in labels.iter().enumerate() {
            let group = *numbers.entry(label).or_insert(motions.len());
            if group == motions.len() {
                motions.push(Vec::new());
            }
            motions[group].push(i);
            of.push(group);
        }
        if motions.len() < LEAST {
            let (argument, allowed, found) = ("groups", "labels of at least 3 groups", motions.len() as f64);
            return Err(ArgumentError::OutOfRange { argument, allowed, found }.into());
        }
        Ok(Self { of, motions })
    }

    /// Each of `n` motions by itself.
    pub fn single(n: usize) -> Self {
        Self { of: (0..n).collect(), motions: (0..n).map(|i| vec![i]).collect() }
    }

    /// Number of groups.
    pub fn n_groups(&self) -> usize {
        self.motions.len()
    }

    /// Number of motions.
    pub fn n_motions(&self) -> usize {
        self.of.len()
    }

    /// The group of a motion, from 0.
    pub(super) fn of(&self, motion: usize) -> usize {
        self.of[motion]
    }

    /// The motions of each group.
    pub(super) fn motions(&self) -> &[Vec<usize>] {
        &self.motions
    }

    /// Fails unless enough motions are left without any of the groups.
    pub(super) fn expect_left(&self, least: usize) -> Result<(), ScoringError> {
        let n = self.n_motions();
        match self.motions.iter().find(|motions| n - motions.len() < least) {
            Some(motions) => Err(ScoringError::Group { motion: motions[0], least, found: n - motions.len() }),
            None => Ok(()),
        }
    }
}
