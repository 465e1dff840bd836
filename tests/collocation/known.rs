//! Problems whose least cost is known, for tests and for the example that solves them all.
//!
//! Closed forms where nothing else is named; costs of several arcs by indirect multiple shooting with halved steps, to the
//! digits given. A mesh of seven or nine intervals has no node where one of these solutions is not smooth, but for the
//! middle of the symmetric ones, which an odd number of intervals avoids.

use somersault_core::Scalar;
use somersault_ocp::collocation::{Dynamics, Ends, Guess, Interval, Mesh, Phase, Point, Problem, Terms};

/// Equations and costs of one of the problems.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Equations {
    /// ẍ = u, least time.
    FastBlock,
    /// ẍ = −x + u, least time.
    Oscillator,
    /// ẍ = u₁ − u₂, least ∫ u₁ + u₂.
    Fuel,
    /// ẍ = u, least ½ ∫ u², with x as a path constraint.
    Ceiling,
    /// ẋ = u, least ∫ x².
    Dwell,
    /// ẋ = −x + u, least ½ ∫ x² + u².
    Decay,
    /// ẋ = −x³ + u, least ½ ∫ x² + u².
    CubicDecay,
    /// ẋ = v cos u, ẏ = v sin u, v̇ = g sin u with y downwards and v̇ at gravity g, least time.
    Brachistochrone(f64),
    /// The same with y − x/2 as a path constraint.
    Slope,
    /// Unit speed in the plane, x² + y² as a path constraint, least time.
    Disk,
    /// A rocket that rises as high as it can.
    Goddard,
    /// ẍ = −x + ẋ (1 − x²) + u, least ½ ∫ x² + ẋ² + u².
    VanDerPol,
    /// A point of 1 kg on a rod of half a metre, torque u, least time.
    Pendulum,
    /// Cart (1 kg) and pole (0.3 kg, 0.5 m), least ∫ u².
    CartPole,
}

use Equations as E;

fn number<T: Scalar>(x: f64) -> T {
    nalgebra::convert(x)
}

impl Dynamics for Equations {
    fn n_states(&self) -> usize {
        match self {
            E::Dwell | E::Decay | E::CubicDecay => 1,
            E::FastBlock | E::Oscillator | E::Fuel | E::Ceiling | E::Disk | E::VanDerPol | E::Pendulum => 2,
            E::Brachistochrone(_) | E::Slope | E::Goddard => 3,
            E::CartPole => 4,
        }
    }

    fn n_controls(&self) -> usize {
        if *self == E::Fuel { 2 } else { 1 }
    }

    fn rates<T: Scalar>(&self, at: &Point<'_, T>, rates: &mut [T]) {
        let (x, u) = (at.state, at.control);
        match self {
            E::FastBlock | E::Ceiling => rates.copy_from_slice(&[x[1], u[0]]),
            E::Oscillator => rates.copy_from_slice(&[x[1], u[0] - x[0]]),
            E::Fuel => rates.copy_from_slice(&[x[1], u[0] - u[1]]),
            E::Dwell => rates[0] = u[0],
            E::Decay => rates[0] = u[0] - x[0],
            E::CubicDecay => rates[0] = u[0] - x[0] * x[0] * x[0],
            E::Brachistochrone(_) | E::Slope => {
                let g = number(if let E::Brachistochrone(g) = self { *g } else { 1.0 });
                rates.copy_from_slice(&[x[2] * u[0].cos(), x[2] * u[0].sin(), u[0].sin() * g]);
            }
            E::Disk => rates.copy_from_slice(&[u[0].cos(), u[0].sin()]),
            E::Goddard => {
                let (r, v, m) = (x[0], x[1], x[2]);
                let drag = number::<T>(310.0) * v * v * (number::<T>(-500.0) * (r - T::one())).exp();
                let thrust = number::<T>(3.5) * u[0];
                rates.copy_from_slice(&[v, (thrust - drag) / m - (r * r).recip(), number::<T>(-7.0) * u[0]]);
            }
            E::VanDerPol => {
                rates.copy_from_slice(&[x[1], x[1] * (T::one() - x[0] * x[0]) - x[0] + u[0]]);
            }
            E::Pendulum => {
                rates.copy_from_slice(&[x[1], u[0] * number(4.0) - x[0].sin() * number(9.81 / 0.5)]);
            }
            E::CartPole => {
                // Kelly 2017, equations 6.1 and 6.2
                let (m1, m2, l, g) =
                    (number::<T>(1.0), number::<T>(0.3), number::<T>(0.5), number::<T>(9.81));
                let (sin, cos) = x[1].sin_cos();
                let (speed, spin) = (x[2], x[3]);
                let below = m1 + m2 * sin * sin;
                let swing = l * m2 * sin * spin * spin;
                rates.copy_from_slice(&[
                    speed,
                    spin,
                    (swing + u[0] + m2 * g * cos * sin) / below,
                    -(swing * cos + u[0] * cos + (m1 + m2) * g * sin) / (l * below),
                ]);
            }
        }
    }
}

impl Terms for Equations {
    fn n_path_constraints(&self) -> usize {
        usize::from(matches!(self, E::Ceiling | E::Slope | E::Disk))
    }

    fn path_constraints<T: Scalar>(&self, at: &Point<'_, T>, values: &mut [T]) {
        let x = at.state;
        match self {
            E::Ceiling => values[0] = x[0],
            E::Slope => values[0] = x[1] - x[0] * number(0.5),
            E::Disk => values[0] = x[0] * x[0] + x[1] * x[1],
            _ => {}
        }
    }

    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        let (x, u) = (at.state, at.control);
        let half = number::<T>(0.5);
        match self {
            E::Fuel => u[0] + u[1],
            E::Ceiling => u[0] * u[0] * half,
            E::Dwell => x[0] * x[0],
            E::Decay | E::CubicDecay => (x[0] * x[0] + u[0] * u[0]) * half,
            E::VanDerPol => (x[0] * x[0] + x[1] * x[1] + u[0] * u[0]) * half,
            E::CartPole => u[0] * u[0],
            E::FastBlock
            | E::Oscillator
            | E::Brachistochrone(_)
            | E::Slope
            | E::Disk
            | E::Goddard
            | E::Pendulum => T::zero(),
        }
    }

    fn end_cost<T: Scalar>(&self, ends: &Ends<'_, T>) -> T {
        match self {
            E::FastBlock | E::Oscillator | E::Brachistochrone(_) | E::Slope | E::Disk | E::Pendulum => {
                ends.final_time - ends.initial_time
            }
            E::Goddard => -ends.final_state[0],
            E::Fuel | E::Ceiling | E::Dwell | E::Decay | E::CubicDecay | E::VanDerPol | E::CartPole => {
                T::zero()
            }
        }
    }
}

/// A problem, a mesh to begin with, and its least cost.
pub(crate) struct Known {
    pub(crate) name: &'static str,
    pub(crate) cost: f64,
    intervals: usize,
    phase: fn() -> Phase,
}

impl Known {
    pub(crate) fn problem(&self) -> Problem {
        self.problem_from(None)
    }

    /// The same from another guess.
    pub(crate) fn problem_from(&self, guess: Option<Guess>) -> Problem {
        let phase = (self.phase)();
        let phase = match guess {
            Some(guess) => phase.guess(guess),
            None => phase,
        };
        Problem::try_new(phase).expect("the problem is well posed")
    }

    /// Nowhere a node where the solution is not smooth.
    pub(crate) fn mesh(&self) -> Mesh {
        Mesh::try_uniform(self.intervals, 3).expect("a mesh")
    }
}

fn phase(equations: Equations) -> Phase {
    Phase::new(equations, equations)
}

/// A straight line over `duration` seconds, with constant controls.
fn line(duration: f64, from: &[f64], to: &[f64], control: &[f64]) -> Guess {
    Guess {
        times: vec![0.0, duration],
        states: vec![from.to_vec(), to.to_vec()],
        controls: vec![control.to_vec(); 2],
        parameters: Vec::new(),
    }
}

fn unit() -> [Interval; 1] {
    [Interval::new(-1.0, 1.0)]
}

/// Bryson and Denham's problem: 2 + 6 (1 − 4ℓ)² with ℓ between 1/6 and 1/4, 4/(9ℓ) below (Bryson & Ho 1975, section 3.11).
fn ceiling(height: f64) -> Phase {
    phase(E::Ceiling)
        .initial_state([0.0, 1.0])
        .final_state([0.0, -1.0])
        .path_bounds([Interval::at_most(height)])
}

pub(crate) const ALL: &[Known] = &[
    Known {
        name: "least time, double integrator",
        // accelerate for a second, brake for a second
        cost: 2.0,
        intervals: 7,
        phase: || {
            phase(E::FastBlock)
                .initial_state([0.0, 0.0])
                .final_state([1.0, 0.0])
                .control_bounds(unit())
                .horizon(0.0, Interval::new(0.1, 10.0))
                .guess(line(3.0, &[0.0, 0.0], &[1.0, 0.0], &[0.0]))
        },
    },
    Known {
        name: "least time, oscillator",
        // arcs of 0.16686017322, π, π, 1.48736624018
        cost: 7.937_411_720_585_108,
        intervals: 9,
        phase: || {
            phase(E::Oscillator)
                .initial_state([5.0, 0.0])
                .final_state([0.0, 0.0])
                .control_bounds(unit())
                .horizon(0.0, Interval::new(1.0, 30.0))
                .guess(Guess {
                    times: (0..=8).map(f64::from).collect(),
                    states: (0..=8)
                        .map(f64::from)
                        .map(|t| {
                            let r = 5.0 * (1.0 - t / 8.0);
                            vec![r * t.cos(), -r * t.sin()]
                        })
                        .collect(),
                    controls: vec![vec![0.0]; 9],
                    parameters: Vec::new(),
                })
        },
    },
    Known {
        name: "least fuel, double integrator",
        cost: 3.0 - 2.236_067_977_499_79,
        intervals: 7,
        phase: || {
            phase(E::Fuel)
                .initial_state([0.0, 0.0])
                .final_state([1.0, 0.0])
                .control_bounds([Interval::new(0.0, 1.0); 2])
                .horizon(0.0, 3.0)
        },
    },
    Known { name: "Bryson and Denham, 0.3", cost: 2.0, intervals: 7, phase: || ceiling(0.3) },
    Known { name: "Bryson and Denham, 0.2", cost: 2.24, intervals: 7, phase: || ceiling(0.2) },
    Known { name: "Bryson and Denham, 1/9", cost: 4.0, intervals: 7, phase: || ceiling(1.0 / 9.0) },
    Known { name: "Bryson and Denham, 0.02", cost: 200.0 / 9.0, intervals: 7, phase: || ceiling(0.02) },
    Known {
        name: "least square, singular arc",
        // control-toolbox/OptimalControl.jl#937: ⅓ down to zero in a second, 1/24 up to ½ in half a second
        cost: 0.375,
        intervals: 7,
        phase: || {
            phase(E::Dwell).initial_state([1.0]).final_state([0.5]).control_bounds(unit()).horizon(0.0, 2.0)
        },
    },
    Known {
        name: "linear decay",
        // ½ ((√2 − 1) + 1.5² (√2 + 1)), to terms with e^{−40 √2}
        cost: 2.923_097_038_856_279_5,
        intervals: 7,
        phase: || phase(E::Decay).initial_state([1.0]).final_state([1.5]).horizon(0.0, 40.0),
    },
    Known {
        name: "hyper-sensitive",
        // ∫₀¹ −x³ + √(x⁶ + x²) dx + ∫₀^1.5 x³ + √(x⁶ + x²) dx
        cost: 3.362_056_904_943,
        intervals: 21,
        phase: || phase(E::CubicDecay).initial_state([1.0]).final_state([1.5]).horizon(0.0, 40.0),
    },
    Known {
        name: "brachistochrone",
        // a cycloid
        cost: 1.801_295_483_013_72,
        intervals: 7,
        phase: || {
            phase(E::Brachistochrone(9.81))
                .initial_state([0.0, 0.0, 0.0])
                .final_state([Interval::fixed(10.0), Interval::fixed(5.0), Interval::FREE])
                .horizon(0.0, Interval::new(0.1, 20.0))
                .guess(line(2.0, &[0.0, 0.0, 0.0], &[10.0, 5.0, 9.9], &[0.5]))
        },
    },
    Known {
        name: "brachistochrone over a slope",
        // Bryson & Ho 1975, section 3.11; multiple shooting, contact from 0.741048092583 to 1.376383902965
        cost: 1.834_003_222_847_19,
        intervals: 7,
        phase: || {
            phase(E::Slope)
                .initial_state([0.0, 0.0, 0.0])
                .final_state([Interval::fixed(1.0), Interval::FREE, Interval::FREE])
                .path_bounds([Interval::at_most(0.1)])
                .horizon(0.0, Interval::new(0.1, 20.0))
                .guess(line(2.0, &[0.0, 0.0, 0.0], &[1.0, 0.5, 1.0], &[0.5]))
        },
    },
    Known {
        name: "around a disk",
        // two tangents and a sixth of the circle
        cost: 2.0 * 1.732_050_807_568_877_3 + std::f64::consts::FRAC_PI_3,
        intervals: 9,
        phase: || {
            phase(E::Disk)
                .initial_state([-2.0, 0.0])
                .final_state([2.0, 0.0])
                .path_bounds([Interval::at_least(1.0)])
                .horizon(0.0, Interval::new(1.0, 20.0))
                .guess(Guess {
                    times: vec![0.0, 2.5, 5.0],
                    states: vec![vec![-2.0, 0.0], vec![0.0, 1.5], vec![2.0, 0.0]],
                    controls: vec![vec![0.6], vec![0.0], vec![-0.6]],
                    parameters: Vec::new(),
                })
        },
    },
    Known {
        name: "Goddard",
        // multiple shooting: full thrust to 0.023509684041, singular to 0.072670743441, then none until 0.198856262105
        cost: -1.012_836_918_317_48,
        intervals: 21,
        phase: || goddard(f64::INFINITY),
    },
    Known {
        name: "Goddard below 0.1",
        // multiple shooting: full, singular, at the bound, off at 0.023509684041, 0.059737380901, 0.101571348425
        cost: -1.012_576_324_656_93,
        intervals: 21,
        phase: || goddard(0.1),
    },
    Known {
        name: "van der Pol above −0.4",
        // multiple shooting
        cost: 1.476_850_671_192_52,
        intervals: 9,
        phase: || {
            phase(E::VanDerPol)
                .initial_state([1.0, 0.0])
                .state_bounds([Interval::FREE, Interval::at_least(-0.4)])
                .horizon(0.0, 5.0)
        },
    },
    Known {
        name: "least time, pendulum",
        // multiple shooting: +, −, +, −
        cost: 2.196_809_250_472,
        intervals: 9,
        phase: || {
            phase(E::Pendulum)
                .initial_state([0.0, 0.0])
                .final_state([std::f64::consts::PI, 0.0])
                .control_bounds([Interval::new(-2.0, 2.0)])
                .horizon(0.0, Interval::new(0.5, 5.0))
        },
    },
    Known {
        name: "Kelly's cart-pole",
        // Kelly 2017, section 6; multiple shooting
        cost: 58.807_667_458_167,
        intervals: 9,
        phase: || {
            phase(E::CartPole)
                .initial_state([0.0; 4])
                .final_state([1.0, std::f64::consts::PI, 0.0, 0.0])
                .state_bounds([Interval::new(-2.0, 2.0), Interval::FREE, Interval::FREE, Interval::FREE])
                .control_bounds([Interval::new(-20.0, 20.0)])
                .horizon(0.0, 2.0)
        },
    },
];

fn goddard(speed: f64) -> Phase {
    phase(E::Goddard)
        .initial_state([1.0, 0.0, 1.0])
        .final_state([Interval::FREE, Interval::FREE, Interval::fixed(0.6)])
        .state_bounds([Interval::at_least(1.0), Interval::new(0.0, speed), Interval::new(0.6, 1.0)])
        .control_bounds([Interval::new(0.0, 1.0)])
        .horizon(0.0, Interval::new(0.05, 1.0))
        .guess(line(0.2, &[1.0, 0.05, 1.0], &[1.01, 0.05, 0.6], &[0.3]))
}
