//! Bounds of the motion of links hold along motions that are integrated in short steps.

use nalgebra::Vector3;
use somersault_integrators::driver::{Flow, Observer, Step, TimeGrid};
use somersault_integrators::methods::Method;
use somersault_integrators::run::Run;
use somersault_multibody::motion::{Coordinates, LinkBounds, TreeState, TreeSystem, mobility_bound};
use somersault_multibody::{Data, Model};
use somersault_testkit::trees::{Random, random_configuration, random_tree};

struct Keep(Vec<TreeState>);

impl Observer<Coordinates> for Keep {
    fn observe(&mut self, step: &mut Step<'_, Coordinates>) -> Flow {
        self.0.push(step.after.clone());
        Flow::Continue
    }
}

/// Speeds of the origins of all links, their angular speeds, and the kinetic energy.
fn speeds(model: &Model, data: &mut Data, x: &TreeState) -> (Vec<[f64; 2]>, f64) {
    let mut v = vec![0.0; model.n_velocities()];
    model.joint_velocities(x, &mut v).unwrap();
    let bodies = model.velocities(data, x.configuration.as_slice(), &v).unwrap();
    let of = |i: usize| {
        let motion = bodies.velocity(i).unwrap();
        [motion.linear.norm(), motion.angular.norm()]
    };
    ((0..model.n_bodies()).map(of).collect(), bodies.kinetic_energy())
}

#[test]
fn links_move_no_faster_than_their_bounds() {
    let mut random = Random::new(7);
    for case in 0..150 {
        let n = 1 + random.below(5);
        let model = random_tree(&mut random, n, 0.2).unwrap();
        if model.n_velocities() == 0 {
            continue;
        }
        let q = random_configuration(&mut random, &model).unwrap();
        let v = random.numbers(model.n_velocities(), 2.0);
        let start = model.state(&q, &v).unwrap();
        let (h, parts) = (0.02, 20);
        let grid = TimeGrid::try_with_steps(0.0, h, parts).unwrap();
        let mut seen = Keep(vec![start.clone()]);
        let system = TreeSystem::new(&model, ());
        let end = Run::new(&system, Method::Rkmk, grid).observed_by(&mut seen).from(&start).unwrap().state;
        let (mut data, mut room, mut other) = (Data::new(&model), LinkBounds::new(&model), Data::new(&model));
        let ends = [&start, &end].map(|x| (&x.configuration, &x.rate));
        let (bodies, links) = room.between(&model, &mut data, ends, h).unwrap();
        let (_, energy) = speeds(&model, &mut other, &start);
        assert!((bodies.kinetic_energy() - energy).abs() <= 1e-12 * energy, "{case}");
        for x in &seen.0 {
            let (found, energy) = speeds(&model, &mut other, x);
            for (i, ([speed, spin], bound)) in found.iter().zip(links).enumerate() {
                assert!(*speed <= bound.speed * (1.0 + 1e-9) + 1e-12, "{case} {i}: {speed} {bound:?}");
                assert!(*spin <= bound.spin * (1.0 + 1e-9) + 1e-12, "{case} {i}: {spin} {bound:?}");
                let c = mobility_bound(&model, i, &Vector3::zeros(), 0.0).unwrap();
                assert!(speed * speed <= 2.0 * c * energy * (1.0 + 1e-9), "{case} {i}");
            }
        }
    }
}
