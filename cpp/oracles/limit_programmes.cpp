/// Writes random programmes of the limit stage and its answers, for an oracle to solve again.
///
///   limit_programmes COUNT SEED > programmes.txt
///
/// One line a programme: n, caps, retreats, then low, high, nominal, qd_brake (n each), W (n n),
/// for each cap its row (n) and speed, for each retreat row (n), distance, d_min, gain,
/// obstacle_rate; then stand, status and qd (n).
#include <cstdio>
#include <cstdlib>

#include "pipeline/limit_inputs.hpp"

namespace {

void write(const Eigen::Ref<const Eigen::VectorXd>& values) {
  for (const double value : values) std::printf(" %.17g", value);
}

}  // namespace

int main(int argc, char** argv) {
  using namespace proxcgal;
  const int count = argc > 1 ? std::atoi(argv[1]) : 1000;
  test::Random random(argc > 2 ? static_cast<unsigned>(std::atoi(argv[2])) : 1U);
  const LimitConfig config;
  for (int trial = 0; trial < count; ++trial) {
    const test::LimitCase one = test::any_case(random, trial);
    const auto n = one.q.size();
    Limiter limiter(one.limits, config, 0.01);
    const LimitOutput& out = one.through(limiter);
    Eigen::MatrixXd W = config.least_weight * Eigen::MatrixXd::Identity(n, n);
    double weight = 1.0;
    for (const Task& task : one.tasks) {
      W += weight * task.jacobian.transpose() * task.activation.asDiagonal() * task.jacobian;
      weight *= config.level_ratio;
    }
    std::printf("%d %zu %zu", static_cast<int>(n), one.caps.size(), one.retreats.size());
    write(limiter.state().interval.low);
    write(limiter.state().interval.high);
    write(one.nominal);
    write(limiter.state().qd_brake);
    write(W.reshaped());
    for (const ApproachCap& cap : one.caps) {
      write(cap.row);
      std::printf(" %.17g", cap.speed);
    }
    for (const RetreatRow& row : one.retreats) {
      write(row.row);
      std::printf(" %.17g %.17g %.17g %.17g", row.distance, row.d_min, row.gain, row.obstacle_rate);
    }
    std::printf(" %.17g %d", out.stand, static_cast<int>(out.status));
    write(out.qd);
    std::printf("\n");
  }
  return 0;
}
