//! Points that no later one may be dominated by (Fletcher & Leyffer 2002, with the margins of Wächter & Biegler 2006).

/// Fraction by which a violation must shrink, or of which a cost must, to count as progress.
const MARGIN: f64 = 1e-5;
/// Powers of the slope and of the violation in the switching condition.
const SLOPE_POWER: f64 = 2.3;
const VIOLATION_POWER: f64 = 1.1;

/// What a point is accepted by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Measures {
    /// Sum of violations.
    pub(crate) violation: f64,
    pub(crate) cost: f64,
}

/// Measures that are given up: a point is acceptable where it has less of one than each of them.
pub(crate) struct Filter {
    /// Margins taken off.
    entries: Vec<Measures>,
    /// Violation above which nothing is accepted.
    largest: f64,
    /// Violation above which a promise of a lower cost is not relied on.
    pub(crate) small: f64,
    /// Size of a unit of cost.
    cost_scale: f64,
}

impl Filter {
    /// For a start with this violation, and `limit` times as much or as one at most.
    pub(crate) fn new(violation: f64, limit: f64, cost_scale: f64) -> Self {
        let size = violation.max(1.0);
        let largest = (limit * size).max(violation);
        Self { entries: Vec::new(), largest, small: 1e-4 * size, cost_scale }
    }

    /// Whether no entry dominates a point.
    pub(crate) fn accepts(&self, point: Measures) -> bool {
        point.violation <= self.largest
            && self.entries.iter().all(|e| point.violation < e.violation || point.cost < e.cost)
    }

    /// Whether a point has less violation or cost than another; `slack` is rounding of the cost.
    pub(crate) fn improves(&self, from: Measures, to: Measures, slack: f64) -> bool {
        let least = self.margins(from);
        to.violation <= least.violation || to.cost <= least.cost + slack
    }

    /// Whether a step of this length is to reduce the cost: it promises much beside the violation where it begins.
    pub(crate) fn switches(&self, violation: f64, slope: f64, length: f64) -> bool {
        slope < 0.0
            && violation <= self.small
            && length * (-slope / self.cost_scale).powf(SLOPE_POWER) > violation.powf(VIOLATION_POWER)
    }

    /// Gives up a point and all that it dominates.
    pub(crate) fn add(&mut self, point: Measures) {
        let added = self.margins(point);
        self.entries.retain(|e| e.violation < added.violation || e.cost < added.cost);
        self.entries.push(added);
    }

    fn margins(&self, point: Measures) -> Measures {
        Measures {
            violation: (1.0 - MARGIN) * point.violation,
            cost: point.cost - MARGIN * self.cost_scale * point.violation,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_accepted_beyond_the_limit_but_what_is_no_worse_than_the_start() {
        for (start, limit, largest) in [(1e-3, 0.03, 0.03), (2.0, 0.03, 2.0), (2.0, 1e4, 2e4)] {
            let filter = Filter::new(start, limit, 1.0);
            let accepts = |violation| filter.accepts(Measures { violation, cost: 0.0 });
            assert!(accepts(largest) && !accepts(1.01 * largest), "{start} {limit}");
        }
    }
}
