//! Expressions of one graph in another.

use crate::dependence::ancestors;
use crate::error::ExprError;
use crate::graph::{Expression, Graph, Node};

impl Graph {
    /// The same expressions with others in place of the inputs of `from`, whose expressions of this graph they become: inputs
    /// beyond `inputs` are NaN.
    pub fn insert(
        &mut self,
        from: &Self,
        of: &[Expression],
        inputs: &[Expression],
    ) -> Result<Vec<Expression>, ExprError> {
        from.check(of)?;
        self.check(inputs)?;
        let missing = self.constant(f64::NAN);
        let needed = ancestors(from, of);
        let mut images = vec![missing; from.len()];
        for x in needed {
            images[x.index()] = match from.nodes()[x.index()] {
                Node::Input(number) => inputs.get(number as usize).copied().unwrap_or(missing),
                Node::Constant(bits) => self.constant(f64::from_bits(bits)),
                Node::Operation(operation, arguments) => {
                    let arguments: [Expression; 3] =
                        arguments.map(|x| images.get(x.index()).copied().unwrap_or(Expression::NONE));
                    self.apply(operation, &arguments[..operation.arity()])?
                }
            };
        }
        Ok(of.iter().map(|x| images[x.index()]).collect())
    }
}
