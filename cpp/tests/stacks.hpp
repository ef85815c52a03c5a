#pragma once
#include <algorithm>
#include <cmath>
#include <vector>

#include "meshes.hpp"
#include "proxcgal/pipeline/command.hpp"

/// Levels, tasks and limits as the command stage takes them.
namespace proxcgal::test {

inline constexpr double kDt = 0.01;

inline JointVector vector(std::initializer_list<double> values) {
  JointVector out(static_cast<Eigen::Index>(values.size()));
  std::copy(values.begin(), values.end(), out.data());
  return out;
}

inline JointVector random_vector(Random& random, Eigen::Index n, double low, double high) {
  JointVector out(n);
  for (double& value : out) value = random.uniform(low, high);
  return out;
}

inline Limits random_limits(Random& random, Eigen::Index n) {
  return {random_vector(random, n, -3.0, -0.5), random_vector(random, n, 0.5, 3.0),
          random_vector(random, n, 0.5, 3.0), random_vector(random, n, 1.0, 20.0)};
}

/// Bounds that are the same now and in the long run: as if nothing limited the acceleration.
inline Admissible steady_box(const JointVector& low, const JointVector& high) {
  return {low, high, low, high};
}

inline Task row(std::initializer_list<double> values, double rate, double activation = 1.0) {
  Task out;
  out.jacobian = vector(values).transpose();
  out.rate = RowVector::Constant(1, rate);
  out.activation = RowVector::Constant(1, activation);
  return out;
}

inline Task joints(const JointVector& rate) {
  Task out;
  out.jacobian = TaskJacobian::Identity(rate.size(), rate.size());
  out.rate = rate;
  out.activation = RowVector::Ones(rate.size());
  return out;
}

inline bool inside(const JointVector& qd, const Admissible& box) {
  return (qd.array() >= box.low.array()).all() && (qd.array() <= box.high.array()).all();
}

/// Levels as a solver may give them, of any size, and tasks that want something else.
struct Stack {
  std::vector<JointVector> levels;
  std::vector<Task> tasks;
};

inline Stack random_stack(Random& random, Eigen::Index n) {
  Stack out;
  JointVector sum = JointVector::Zero(n);
  for (int k = 0; k < 4; ++k) {
    sum += std::pow(10.0, random.uniform(-3.0, 1.0)) * random_vector(random, n, -1.0, 1.0);
    out.levels.push_back(sum);
    if (k < 3) {
      Task task = joints(random_vector(random, n, -2.0, 2.0));
      task.activation = random_vector(random, n, -0.5, 1.0).cwiseMax(0.0);
      out.tasks.push_back(task);
    }
  }
  return out;
}

}  // namespace proxcgal::test
