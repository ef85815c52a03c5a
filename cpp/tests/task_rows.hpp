#pragma once
#include <algorithm>
#include <functional>
#include <vector>

#include "meshes.hpp"
#include "proxcgal/pipeline/task.hpp"

namespace proxcgal::test {

/// An arm with bent axes; some joints may slide, the last may be free of limits.
inline Robot bent_arm(int n, const std::vector<int>& sliding = {}) {
  RobotSpec spec;
  spec.name = "arm";
  for (int j = 0; j < n; ++j) {
    JointSpec joint;
    joint.name = "joint" + std::to_string(j);
    joint.parent = j - 1;
    joint.origin.translation() = Vector3(0.1 * (j % 2), 0.05, 0.3);
    joint.axis = j % 3 == 0 ? Vector3::UnitZ() : (j % 3 == 1 ? Vector3::UnitY() : Vector3::UnitX());
    if (std::find(sliding.begin(), sliding.end(), j) != sliding.end()) {
      joint.type = JointType::kPrismatic;
    }
    joint.q_min = -2.0;
    joint.q_max = 3.0;
    spec.joints.push_back(joint);
  }
  const auto mesh = test::box(Vector3(0.1, 0.1, 0.1));
  spec.links = {{"base", -1, Pose::Identity(), mesh.vertices, mesh.triangles, 0.0},
                {"hand", n - 1, Pose::Identity(), mesh.vertices, mesh.triangles, 0.0}};
  spec.tool_joint = n - 1;
  spec.T_JT.translation() = Vector3(0.05, 0.1, 0.2);
  return Robot(std::move(spec));
}

inline JointVector random_q(Random& random, int n) {
  JointVector q(n);
  for (double& value : q) value = random.uniform(-1.5, 1.5);
  return q;
}

inline Posture at(const Robot& robot, const JointVector& q) {
  Posture posture = robot.make_posture();
  robot.update(q, posture);
  return posture;
}

/// Central differences of a function of the posture.
inline RowVector derivative(const Robot& robot, const JointVector& q,
                            const std::function<double(const Posture&)>& f) {
  constexpr double h = 1e-6;
  RowVector out(q.size());
  for (Eigen::Index j = 0; j < q.size(); ++j) {
    JointVector ahead = q, behind = q;
    ahead[j] += h;
    behind[j] -= h;
    out[j] = (f(at(robot, ahead)) - f(at(robot, behind))) / (2.0 * h);
  }
  return out;
}

inline ControlPair pair_at(const Posture& posture, const Vector3& point_L,
                           const Vector3& obstacle_W) {
  ControlPair pair;
  pair.link = 1;
  pair.control_W = posture.T_WL[1] * point_L;
  pair.obstacle_W = obstacle_W;
  pair.distance = (pair.control_W - obstacle_W).norm();
  return pair;
}

}  // namespace proxcgal::test
