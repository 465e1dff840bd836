//! How events are located.

/// Settings of a run that locates events.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Location {
    /// Most events per unit of time and guard, averaged over the last 64 for each guard.
    ///
    /// The default, 1e9, lets any number of events pass that are more than nanoseconds apart.
    pub max_event_rate: f64,
    /// Whether events are kept. They are counted in any case.
    pub keep_events: bool,
    /// Depth below which a guard may go in and come out unseen, in units of its gap, where its
    /// [`Sweep`](super::Sweep) has a speed but no fall.
    ///
    /// The default is 1e-6. The others are resolved to rounding.
    pub graze: f64,
    /// What is done about fixed steps that are too long for the springs and dampers of a mode.
    pub stiff: StiffSteps,
}

/// What is done about fixed steps that are too long for the springs and dampers of a mode.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StiffSteps {
    /// They are divided as their rate ([`stiffest_rate`](super::Hybrid::stiffest_rate)) and the method ask for, and
    /// further where the [`energy`](super::Hybrid::energy) grows; a run that would need to divide a step by more than
    /// `most` ends with an error. Of an L-stable method ([`MethodInfo::l_stable`](crate::stepper::MethodInfo::l_stable)) only the
    /// first steps after an event are shorter.
    Divide {
        /// The largest number of parts; 1 refuses every step that is too long.
        most: u64,
    },
    /// They are made as given, for studies of methods: what comes out may be far from any motion.
    AsGiven,
}

impl Location {
    /// With fixed steps made as given, however long they are: for studies of methods.
    pub fn as_given() -> Self {
        Self { stiff: StiffSteps::AsGiven, ..Self::default() }
    }
}

impl Default for Location {
    fn default() -> Self {
        let stiff = StiffSteps::Divide { most: 100_000 };
        Self { max_event_rate: 1e9, keep_events: true, graze: 1e-6, stiff }
    }
}
