//! Derivatives, which are expressions of the same graph.

use crate::dependence::{Dependence, Reached, ancestors};
use crate::error::ExprError;
use crate::graph::{Expression, Graph, Node};
use crate::operation::{Operation, table};
use crate::sparsity::Sparsity;
use somersault_core::argument::expect_length;

macro_rules! partials {
    (
        unary { $($u:ident $u_name:literal |$ux:ident| $u_value:expr $(, lanes $u_lanes:ident)? ;
            |$ug:ident, $uy:ident| $u_dx:expr;)* }
        binary { $($b:ident $b_name:literal |$bx:ident, $by:ident| $b_value:expr ;
            |$bg:ident, $bv:ident| $b_dx:expr, $b_dy:expr;)* }
        ternary { $($t:ident $t_name:literal |$tx:ident, $ty:ident, $tz:ident| $t_value:expr ;
            |$tg:ident| $t_dx:expr, $t_dy:expr, $t_dz:expr;)* }
    ) => {
        /// The derivative of the result of an operation by the argument of this place.
        fn partial(
            operation: Operation, graph: &mut Graph, arguments: [Expression; 3], result: Expression, place: usize,
        ) -> Option<Expression> {
            match operation {
                $(Operation::$u => {
                    let ([$ux, ..], $ug, $uy) = (arguments, graph, result);
                    let _ = ($ux, $uy, &$ug);
                    $u_dx
                })*
                $(Operation::$b => {
                    let ([$bx, $by, _], $bg, $bv) = (arguments, graph, result);
                    let _ = ($bx, $by, $bv, &$bg);
                    if place == 0 { $b_dx } else { $b_dy }
                })*
                $(Operation::$t => {
                    let ([$tx, $ty, $tz], $tg) = (arguments, graph);
                    let _ = ($ty, $tz);
                    match place { 0 => $t_dx, 1 => $t_dy, _last => $t_dz }
                })*
            }
        }
    };
}

table!(partials);

/// An entry of a matrix: column, row, value.
type Entry = (usize, usize, Expression);

/// A way to a Jacobian matrix is tried unless it visits this many times as many nodes as the other.
const WORTH_A_TRIAL: usize = 4;

impl Graph {
    /// Σ seedₖ ∂ofₖ/∂x for each input x of `with`, by one sweep from results to inputs.
    pub fn adjoint(
        &mut self,
        of: &[Expression],
        seeds: &[Expression],
        with: &[Expression],
    ) -> Result<Vec<Expression>, ExprError> {
        expect_length("seeds", seeds.len(), of.len())?;
        self.check(of)?;
        self.check(seeds)?;
        self.check_inputs(with)?;
        let dependence = Dependence::new(self, of, with);
        let mut adjoints = vec![None; dependence.between.len()];
        for (x, &seed) in of.iter().zip(seeds) {
            if let Some(place) = dependence.place(*x) {
                self.gather(&mut adjoints[place], seed);
            }
        }
        let all: Vec<usize> = (0..dependence.between.len()).collect();
        self.sweep_back(&dependence, &all, &mut adjoints);
        let zero = self.constant(0.0);
        Ok(with
            .iter()
            .map(|&x| dependence.place(x).and_then(|place| adjoints[place]).unwrap_or(zero))
            .collect())
    }

    /// The gradient of one expression.
    pub fn gradient(&mut self, of: Expression, with: &[Expression]) -> Result<Vec<Expression>, ExprError> {
        let one = self.constant(1.0);
        self.adjoint(&[of], &[one], with)
    }

    /// Σ ∂of/∂xₖ seedₖ over the inputs of `with`, by one sweep from inputs to results. With a vector field as the seeds this is
    /// the Lie derivative along it.
    pub fn tangent(
        &mut self,
        of: &[Expression],
        with: &[Expression],
        seeds: &[Expression],
    ) -> Result<Vec<Expression>, ExprError> {
        expect_length("seeds", seeds.len(), with.len())?;
        self.check(of)?;
        self.check(seeds)?;
        self.check_inputs(with)?;
        let dependence = Dependence::new(self, of, with);
        let mut tangents = vec![None; dependence.between.len()];
        for (x, &seed) in with.iter().zip(seeds) {
            if let Some(place) = dependence.place(*x) {
                self.gather(&mut tangents[place], seed);
            }
        }
        let all: Vec<usize> = (0..dependence.between.len()).collect();
        self.sweep_forward(&dependence, &all, &mut tangents);
        let zero = self.constant(0.0);
        Ok(of
            .iter()
            .map(|&x| dependence.place(x).and_then(|place| tangents[place]).unwrap_or(zero))
            .collect())
    }

    /// The entries of the Jacobian matrix that are not zero everywhere, and where they are.
    ///
    /// Columns are swept forward or rows back, whichever takes fewer instructions. Only nodes that an input moves are visited, so
    /// that no colouring is needed to make use of sparsity.
    pub fn jacobian(
        &mut self,
        of: &[Expression],
        with: &[Expression],
    ) -> Result<(Sparsity, Vec<Expression>), ExprError> {
        self.entries(of, with, |_| true)
    }

    /// The lower triangle of the Hessian matrix of one expression: entries that are not zero everywhere, and where they are.
    pub fn hessian(
        &mut self,
        of: Expression,
        with: &[Expression],
    ) -> Result<(Sparsity, Vec<Expression>), ExprError> {
        let gradient = self.gradient(of, with)?;
        self.entries(&gradient, with, |&(column, row, _)| row >= column)
    }

    /// The entries of a Jacobian matrix that are wanted.
    fn entries(
        &mut self,
        of: &[Expression],
        with: &[Expression],
        wanted: impl Fn(&Entry) -> bool,
    ) -> Result<(Sparsity, Vec<Expression>), ExprError> {
        self.check(of)?;
        self.check_inputs(with)?;
        let dependence = Dependence::new(self, of, with);
        let mut ways = Vec::new();
        let (by_columns, by_rows) = self.worth_a_trial(&dependence, of, with);
        if by_columns {
            ways.push(self.by_columns(&dependence, of, with));
        }
        if by_rows {
            ways.push(self.by_rows(&dependence, of, with));
        }
        let best = ways
            .into_iter()
            .map(|entries| entries.into_iter().filter(|entry| wanted(entry)).collect::<Vec<_>>())
            .min_by_key(|entries| {
                let values: Vec<_> = entries.iter().map(|&(.., value)| value).collect();
                ancestors(self, &values).len()
            });
        Ok(compressed(of.len(), with.len(), best.unwrap_or_default()))
    }

    /// Whether sweeps by columns and by rows may be those that take fewer instructions. Nodes that are visited tell instructions
    /// to a factor of about two; of the way that visits more, no more is counted than is needed to know.
    fn worth_a_trial(&self, dependence: &Dependence, of: &[Expression], with: &[Expression]) -> (bool, bool) {
        let mut reached = Reached::default();
        let mut columns = with.iter().filter_map(|&x| dependence.place(x));
        let mut rows = of.iter().filter_map(|&x| dependence.place(x));
        let (mut forward, mut back) = (0_usize, 0_usize);
        loop {
            if forward <= back {
                let Some(place) = columns.next() else { break };
                dependence.descendants(place, &mut reached);
                forward = forward.saturating_add(reached.places.len());
            } else {
                let Some(place) = rows.next() else { break };
                dependence.origins(self, place, &mut reached);
                back = back.saturating_add(reached.places.len());
            }
        }
        // one way is counted to its end
        while back <= forward.saturating_mul(WORTH_A_TRIAL) {
            let Some(place) = rows.next() else { break };
            dependence.origins(self, place, &mut reached);
            back = back.saturating_add(reached.places.len());
        }
        while forward <= back.saturating_mul(WORTH_A_TRIAL) {
            let Some(place) = columns.next() else { break };
            dependence.descendants(place, &mut reached);
            forward = forward.saturating_add(reached.places.len());
        }
        (forward <= back.saturating_mul(WORTH_A_TRIAL), back <= forward.saturating_mul(WORTH_A_TRIAL))
    }

    fn by_columns(&mut self, dependence: &Dependence, of: &[Expression], with: &[Expression]) -> Vec<Entry> {
        let one = self.constant(1.0);
        let rows = Rows::of(dependence, of);
        let mut tangents = vec![None; dependence.between.len()];
        let mut reached = Reached::default();
        let mut entries = Vec::new();
        for (column, &x) in with.iter().enumerate() {
            let Some(start) = dependence.place(x) else { continue };
            dependence.descendants(start, &mut reached);
            tangents[start] = Some(one);
            self.sweep_forward(dependence, &reached.places, &mut tangents);
            for &place in &reached.places {
                if let Some(value) = tangents[place].take()
                    && self.as_constant(value) != Some(0.0)
                {
                    entries.extend(rows.at(place).iter().map(|&(_, row)| (column, row, value)));
                }
            }
        }
        entries
    }

    fn by_rows(&mut self, dependence: &Dependence, of: &[Expression], with: &[Expression]) -> Vec<Entry> {
        let one = self.constant(1.0);
        let columns = Rows::of(dependence, with);
        let mut adjoints = vec![None; dependence.between.len()];
        let mut reached = Reached::default();
        let mut entries = Vec::new();
        for (row, &y) in of.iter().enumerate() {
            let Some(end) = dependence.place(y) else { continue };
            dependence.origins(self, end, &mut reached);
            adjoints[end] = Some(one);
            self.sweep_back(dependence, &reached.places, &mut adjoints);
            for &place in &reached.places {
                if let Some(value) = adjoints[place].take()
                    && self.as_constant(value) != Some(0.0)
                {
                    entries.extend(columns.at(place).iter().map(|&(_, column)| (column, row, value)));
                }
            }
        }
        entries
    }

    /// Tangents of these places from those of their arguments; those that are there stay.
    fn sweep_forward(
        &mut self,
        dependence: &Dependence,
        places: &[usize],
        tangents: &mut [Option<Expression>],
    ) {
        for &place in places {
            let result = dependence.between[place];
            let Node::Operation(operation, arguments) = self.nodes()[result.index()] else { continue };
            let mut sum = None;
            for k in 0..operation.arity() {
                let Some(seed) = dependence.place(arguments[k]).and_then(|place| tangents[place]) else {
                    continue;
                };
                if let Some(partial) = partial(operation, self, arguments, result, k) {
                    let term = self.scale(seed, partial);
                    self.gather(&mut sum, term);
                }
            }
            tangents[place] = sum;
        }
    }

    /// Adds what these places contribute to the adjoints of their arguments, the last ones first.
    fn sweep_back(&mut self, dependence: &Dependence, places: &[usize], adjoints: &mut [Option<Expression>]) {
        for &place in places.iter().rev() {
            let result = dependence.between[place];
            let Some(seed) = adjoints[place] else { continue };
            let Node::Operation(operation, arguments) = self.nodes()[result.index()] else { continue };
            for k in 0..operation.arity() {
                let Some(argument) = dependence.place(arguments[k]) else { continue };
                if let Some(partial) = partial(operation, self, arguments, result, k) {
                    let term = self.scale(seed, partial);
                    self.gather(&mut adjoints[argument], term);
                }
            }
        }
    }

    /// Adds a term to a sum that may be none, and is none where it is the constant 0.
    fn gather(&mut self, sum: &mut Option<Expression>, term: Expression) {
        if self.as_constant(term) == Some(0.0) {
            return;
        }
        *sum = Some(match *sum {
            Some(before) => self.add(before, term),
            None => term,
        });
    }

    fn check_inputs(&self, with: &[Expression]) -> Result<(), ExprError> {
        self.check(with)?;
        match with.iter().find(|x| !matches!(self.nodes()[x.index()], Node::Input(_))) {
            Some(x) => Err(ExprError::NotAnInput { found: x.index() }),
            None => Ok(()),
        }
    }
}

/// The rows that a place is, of which there are several where an expression is given twice.
struct Rows(Vec<(usize, usize)>);

impl Rows {
    fn of(dependence: &Dependence, of: &[Expression]) -> Self {
        let mut pairs: Vec<_> = of
            .iter()
            .enumerate()
            .filter_map(|(row, &x)| dependence.place(x).map(|place| (place, row)))
            .collect();
        pairs.sort_unstable();
        Self(pairs)
    }

    fn at(&self, place: usize) -> &[(usize, usize)] {
        let start = self.0.partition_point(|pair| pair.0 < place);
        let end = self.0.partition_point(|pair| pair.0 <= place);
        &self.0[start..end]
    }
}

/// The pattern and the values of entries.
fn compressed(n_rows: usize, n_columns: usize, mut entries: Vec<Entry>) -> (Sparsity, Vec<Expression>) {
    entries.sort_unstable_by_key(|&(column, row, _)| (column, row));
    let mut columns = vec![0; n_columns + 1];
    entries.iter().for_each(|&(column, ..)| columns[column + 1] += 1);
    (0..n_columns).for_each(|column| columns[column + 1] += columns[column]);
    let rows = entries.iter().map(|&(_, row, _)| row).collect();
    (Sparsity { n_rows, columns, rows }, entries.into_iter().map(|(.., value)| value).collect())
}
