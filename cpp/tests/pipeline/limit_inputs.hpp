#pragma once
#include <cmath>
#include <vector>

#include "meshes.hpp"
#include "proxcgal/pipeline/limit.hpp"

/// Random inputs of the limit stage: ordinary, badly scaled, pinched and contradictory ones.
namespace proxcgal::test {

inline JointVector random_joints(Random& random, Eigen::Index n, double half) {
  JointVector out(n);
  for (double& value : out) value = random.uniform(-half, half);
  return out;
}

inline Limits arm_limits(Eigen::Index n) {
  return {JointVector::Constant(n, -3.0), JointVector::Constant(n, 3.0),
          JointVector::Constant(n, 2.0), JointVector::Constant(n, 10.0)};
}

/// Owns what a LimitInput refers to, and the state before it.
struct LimitCase {
  Limits limits;
  JointVector q, nominal, qd_last;
  double elapsed = 0.01;
  std::vector<Task> tasks;
  std::vector<ApproachCap> caps;
  std::vector<RetreatRow> retreats;

  const LimitOutput& through(Limiter& limiter) const {
    limiter.begin(q, qd_last, elapsed);
    return limiter.limit({nominal, tasks, caps, retreats});
  }
};

enum class Shape { kOrdinary, kBadlyScaled, kPinched, kContradictory };

inline LimitCase random_case(Random& random, Eigen::Index n, Shape shape, int caps, int retreats) {
  LimitCase out;
  out.limits = arm_limits(n);
  for (Eigen::Index j = 0; j < n; ++j) {
    out.limits.qd_max[j] = random.uniform(0.5, 3.0);
    out.limits.qdd_max[j] = random.uniform(2.0, 20.0);
  }
  out.q = random_joints(random, n, 2.99);
  out.qd_last = random_joints(random, n, 0.4);
  out.nominal = random_joints(random, n, random.uniform(0.0, 1.0) < 0.5 ? 0.5 : 3.0);
  out.elapsed = random.uniform(0.005, 0.05);
  const bool scaled = shape == Shape::kBadlyScaled;
  const auto row = [&] {
    JointVector r = random_joints(random, n, 1.0);
    for (Eigen::Index j = 0; j < n; ++j)  // joints beyond the link do not move it
      if (random.uniform(0.0, 1.0) < 0.3) r[j] = 0.0;
    if (scaled) r *= std::pow(10.0, random.uniform(-4.0, 2.0));
    return r;
  };
  for (int k = 0; k < 2; ++k) {
    Task task;
    task.jacobian.resize(k == 0 ? 1 : 6, n);
    for (Eigen::Index i = 0; i < task.jacobian.rows(); ++i)
      task.jacobian.row(i) = random_joints(random, n, 1.0).transpose();
    task.rate = RowVector::Zero(task.jacobian.rows());
    task.activation = RowVector::Constant(task.jacobian.rows(), random.uniform(0.0, 1.0));
    out.tasks.push_back(task);
  }
  for (int i = 0; i < caps; ++i) {
    ApproachCap cap;
    cap.row = row();
    cap.speed = std::max(0.0, random.uniform(-0.1, 0.5));
    cap.link = i;
    out.caps.push_back(cap);
  }
  for (int i = 0; i < retreats; ++i) {
    RetreatRow retreat;
    retreat.row = row();
    retreat.distance = random.uniform(-0.02, 0.25);
    if (shape == Shape::kContradictory) retreat.distance = random.uniform(-0.02, 0.05);
    retreat.obstacle_rate = random.uniform(-0.3, 0.3);
    retreat.link = i;
    if (shape == Shape::kPinched && i % 2 == 1) {
      retreat.row = -out.retreats.back().row;
      if (random.uniform(0.0, 1.0) < 0.5) retreat.row *= random.uniform(0.5, 1.0);
    }
    out.retreats.push_back(retreat);
  }
  return out;
}

inline LimitCase any_case(Random& random, int trial) {
  const Eigen::Index n = trial % 3 == 0 ? 6 : trial % 3 == 1 ? 7 : 12;
  const auto shape = static_cast<Shape>(trial / 3 % 4);
  const int caps = static_cast<int>(random.uniform(0.0, 24.99));
  return random_case(random, n, shape, caps, static_cast<int>(random.uniform(0.0, 16.99)));
}

}  // namespace proxcgal::test
