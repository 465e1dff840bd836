//! Which expressions others are made of.

use crate::graph::{Expression, Graph, Node};

/// The expressions that these are made of, themselves included, ascending: arguments before results.
pub(crate) fn ancestors(graph: &Graph, of: &[Expression]) -> Vec<Expression> {
    let end = of.iter().map(|x| x.index() + 1).max().unwrap_or(0);
    let mut needed = vec![false; end];
    of.iter().for_each(|x| needed[x.index()] = true);
    let mut found = Vec::new();
    for index in (0..end).rev().filter(|&index| index < graph.nodes().len()) {
        if !needed[index] {
            continue;
        }
        found.push(Expression(index as u32));
        arguments(graph, index).iter().for_each(|x| needed[x.index()] = true);
    }
    found.reverse();
    found
}

/// The arguments of a node.
pub(crate) fn arguments(graph: &Graph, index: usize) -> &[Expression] {
    match &graph.nodes()[index] {
        Node::Operation(operation, arguments) => &arguments[..operation.arity()],
        Node::Input(_) | Node::Constant(_) => &[],
    }
}

/// The part of a graph through which some expressions depend on some inputs.
pub(crate) struct Dependence {
    /// Nodes from an input to an expression, ascending.
    pub(crate) between: Vec<Expression>,
    /// For each node of the graph, its place in `between`.
    places: Vec<u32>,
    /// For each of `between`, where its users start in `users`.
    starts: Vec<usize>,
    users: Vec<u32>,
}

const NOWHERE: u32 = u32::MAX;

impl Dependence {
    pub(crate) fn new(graph: &Graph, of: &[Expression], with: &[Expression]) -> Self {
        let needed = ancestors(graph, of);
        let end = needed.last().map_or(0, |x| x.index() + 1);
        let mut places = vec![NOWHERE; end];
        let mut moves = vec![false; end];
        with.iter().filter(|x| x.index() < end).for_each(|x| moves[x.index()] = true);
        let mut between: Vec<Expression> = Vec::new();
        for &x in &needed {
            let index = x.index();
            if moves[index] || arguments(graph, index).iter().any(|a| moves[a.index()]) {
                moves[index] = true;
                places[index] = between.len() as u32;
                between.push(x);
            }
        }
        let mut starts = vec![0; between.len() + 1];
        let mut pairs = Vec::new();
        for (user, &x) in between.iter().enumerate() {
            let inner = arguments(graph, x.index());
            for (k, a) in inner.iter().enumerate() {
                let place = places[a.index()];
                if place != NOWHERE && !inner[..k].contains(a) {
                    starts[place as usize + 1] += 1;
                    pairs.push((place, user as u32));
                }
            }
        }
        (0..between.len()).for_each(|k| starts[k + 1] += starts[k]);
        let (mut users, mut next) = (vec![0; pairs.len()], starts.clone());
        for (place, user) in pairs {
            users[next[place as usize]] = user;
            next[place as usize] += 1;
        }
        Self { between, places, starts, users }
    }

    /// Where an expression is in `between`.
    pub(crate) fn place(&self, x: Expression) -> Option<usize> {
        self.places.get(x.index()).filter(|&&place| place != NOWHERE).map(|&place| place as usize)
    }

    /// The places that depend on one, ascending, itself included.
    pub(crate) fn descendants(&self, place: usize, reached: &mut Reached) {
        reached.start(self.between.len(), place);
        let mut next = 0;
        while next < reached.places.len() {
            let user_of = reached.places[next];
            for &user in &self.users[self.starts[user_of]..self.starts[user_of + 1]] {
                reached.add(user as usize);
            }
            next += 1;
        }
        reached.places.sort_unstable();
    }

    /// The places that one depends on, ascending, itself included.
    pub(crate) fn origins(&self, graph: &Graph, place: usize, reached: &mut Reached) {
        reached.start(self.between.len(), place);
        let mut next = 0;
        while next < reached.places.len() {
            let user = self.between[reached.places[next]];
            for argument in arguments(graph, user.index()) {
                if let Some(origin) = self.place(*argument) {
                    reached.add(origin);
                }
            }
            next += 1;
        }
        reached.places.sort_unstable();
    }
}

/// Places that a walk has reached; memory that is used again.
#[derive(Default)]
pub(crate) struct Reached {
    marks: Vec<u32>,
    round: u32,
    pub(crate) places: Vec<usize>,
}

impl Reached {
    fn start(&mut self, size: usize, place: usize) {
        if self.marks.len() != size || self.round == u32::MAX {
            self.marks.clear();
            self.marks.resize(size, 0);
            self.round = 0;
        }
        self.round += 1;
        self.places.clear();
        self.add(place);
    }

    fn add(&mut self, place: usize) {
        if self.marks[place] != self.round {
            self.marks[place] = self.round;
            self.places.push(place);
        }
    }
}
