// Times Pinocchio's dynamics of one tree, called from C++: `pinocchio MODEL`, a model in its text format.
//
// Prints a name and the least microseconds per call on each line, of a state where there are many, as `time_diver` does for
// this library.

#include <pinocchio/algorithm/aba-derivatives.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/algorithm/rnea-derivatives.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>
#include <pinocchio/serialization.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <limits>

// The least time of a state over 200 samples of some calls, for so many states each.
template <typename Call>
static void report(const char* name, Call call, int calls = 200, int states = 1) {
  using Clock = std::chrono::steady_clock;
  double best = std::numeric_limits<double>::infinity();
  for (int sample = 0; sample < 200; ++sample) {
    const auto start = Clock::now();
    for (int i = 0; i < calls; ++i) call();
    best = std::min(best, std::chrono::duration<double>(Clock::now() - start).count() / (calls * states));
  }
  std::printf("%s %.4f\n", name, best * 1e6);
}

int main(int count, char** arguments) {
  if (count != 2) return 2;
  using pinocchio::Convention;
  pinocchio::Model model;
  pinocchio::serialization::loadFromText(model, arguments[1]);
  pinocchio::Data data(model);
  const Eigen::VectorXd rest = pinocchio::neutral(model);
  const Eigen::VectorXd v = Eigen::VectorXd::Random(model.nv), a = Eigen::VectorXd::Random(model.nv);
  const Eigen::VectorXd q = pinocchio::integrate(model, rest, v);
  report("rnea", [&] { pinocchio::rnea(model, data, q, v, a); });
  report("crba", [&] { pinocchio::crba(model, data, q, Convention::WORLD); });
  report("crba", [&] { pinocchio::crba(model, data, q, Convention::LOCAL); });
  report("aba", [&] { pinocchio::aba(model, data, q, v, a, Convention::WORLD); });
  report("aba", [&] { pinocchio::aba(model, data, q, v, a, Convention::LOCAL); });
  report("rnea_partials", [&] { pinocchio::computeRNEADerivatives(model, data, q, v, a); });
  report("aba_partials", [&] { pinocchio::computeABADerivatives(model, data, q, v, a); });
  // Many states, in a loop.
  const int states = 256;
  const Eigen::MatrixXd many_q = q.replicate(1, states), many_v = v.replicate(1, states);
  const Eigen::MatrixXd many_a = a.replicate(1, states);
  Eigen::MatrixXd out(model.nv, states);
  report(
      "rnea_many",
      [&] {
        for (int i = 0; i < states; ++i)
          out.col(i) = pinocchio::rnea(model, data, many_q.col(i), many_v.col(i), many_a.col(i));
      },
      1, states);
  // Matrices are kept for each state, as the call for many states does here.
  const Eigen::Index square = Eigen::Index(model.nv) * model.nv;
  Eigen::MatrixXd matrices(3 * square, states);
  const auto keep = [&](int state, int place, const auto& matrix) {
    Eigen::Map<Eigen::MatrixXd>(matrices.col(state).data() + place * square, model.nv, model.nv) = matrix;
  };
  for (const Convention convention : {Convention::WORLD, Convention::LOCAL})
    report(
        "crba_many",
        [&] {
          for (int i = 0; i < states; ++i) keep(i, 0, pinocchio::crba(model, data, many_q.col(i), convention));
        },
        1, states);
  for (const Convention convention : {Convention::WORLD, Convention::LOCAL})
    report(
        "aba_many",
        [&] {
          for (int i = 0; i < states; ++i)
            out.col(i) = pinocchio::aba(model, data, many_q.col(i), many_v.col(i), many_a.col(i), convention);
        },
        1, states);
  report(
      "rnea_partials_many",
      [&] {
        for (int i = 0; i < states; ++i) {
          pinocchio::computeRNEADerivatives(model, data, many_q.col(i), many_v.col(i), many_a.col(i));
          keep(i, 0, data.dtau_dq), keep(i, 1, data.dtau_dv), keep(i, 2, data.M);
        }
      },
      1, states);
  report(
      "aba_partials_many",
      [&] {
        for (int i = 0; i < states; ++i) {
          pinocchio::computeABADerivatives(model, data, many_q.col(i), many_v.col(i), many_a.col(i));
          keep(i, 0, data.ddq_dq), keep(i, 1, data.ddq_dv), keep(i, 2, data.Minv);
        }
      },
      1, states);
}
