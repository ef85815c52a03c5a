#pragma once
#include <algorithm>
#include <memory>

#include "meshes.hpp"
#include "proxcgal/control/controller.hpp"

namespace proxcgal::test {

/// Six joints like an arm's, links as bumpy boxes and spheres: no data package needed.
inline std::shared_ptr<Robot> arm(int joints = 6, int rings = 12, int segments = 16) {
  RobotSpec spec;
  spec.name = "arm";
  const auto add_link = [&](int joint, double length) {
    LinkSpec link;
    link.name = "link" + std::to_string(joint + 1);
    link.joint = joint;
    auto mesh = bumpy_sphere(rings, segments, 0.06, 0.008);
    mesh.vertices.col(2) *= 0.5 * length / 0.06;
    mesh.vertices.col(2).array() += 0.5 * length;
    link.vertices_L = mesh.vertices;
    link.triangles = mesh.triangles;
    spec.links.push_back(link);
  };
  add_link(-1, 0.2);
  for (int j = 0; j < joints; ++j) {
    JointSpec joint;
    joint.name = "joint" + std::to_string(j + 1);
    joint.parent = j - 1;
    joint.origin.translation() = Vector3(0, 0, j == 0 ? 0.2 : 0.3);
    joint.axis = j == 0 || j == 3 || j == 5 ? Vector3::UnitZ() : Vector3::UnitY();
    joint.q_min = -3.0;
    joint.q_max = 3.0;
    joint.qd_max = 2.0;
    joint.qdd_max = 10.0;
    spec.joints.push_back(joint);
    add_link(j, 0.28);
  }
  spec.tool_joint = joints - 1;
  spec.T_JT.translation() = Vector3(0, 0, 0.3);
  return std::make_shared<Robot>(std::move(spec));
}

/// Sensors round one link of that arm, looking out.
inline Skin ring(int sensors = 10, const std::string& link = "link3") {
  Skin skin;
  for (int s = 0; s < sensors; ++s) {
    const double angle = 2 * M_PI * s / sensors;
    const Vector3 out(std::cos(angle), std::sin(angle), 0.0);
    Mount mount{"s" + std::to_string(s), link, Pose::Identity()};
    mount.T_LS.linear().col(2) = out;
    mount.T_LS.linear().col(0) = Vector3::UnitZ();
    mount.T_LS.linear().col(1) = out.cross(Vector3::UnitZ());
    mount.T_LS.translation() = 0.09 * out + Vector3(0, 0, 0.15);
    skin.mounts.push_back(mount);
  }
  return skin;
}

/// One sensor that stands off the link that carries it, and looks back at it: the surface is at
/// 0.25 m.
inline Skin looking_back() {
  Skin skin = ring(1);
  Pose& T_LS = skin.mounts[0].T_LS;
  T_LS.translation() = Vector3(0.31, 0.0, 0.15);
  T_LS.linear().col(2) = -Vector3::UnitX();
  T_LS.linear().col(1) = T_LS.linear().col(2).cross(Vector3(T_LS.linear().col(0)));
  return skin;
}

/// A posture of that arm far from its limits and from singular ones.
inline JointVector bent() {
  JointVector q(6);
  q << 0.2, 0.6, 0.9, 0.1, 0.5, 0.0;
  return q;
}

inline JointVector posture(Random& random, int n) {
  JointVector q(n);
  for (int i = 0; i < n; ++i) q[i] = random.uniform(-2.0, 2.0);
  return q;
}

inline Pose tool_at(const Robot& robot, const JointVector& q) {
  Posture posture = robot.make_posture();
  robot.update(q, posture);
  return posture.T_WT;
}

inline bool found(const Controller& controller, Reason reason) {
  const auto findings = controller.findings();
  return std::any_of(findings.begin(), findings.end(),
                     [&](const Finding& finding) { return finding.reason == reason; });
}

inline Points cloud(Random& random, int n, double half) {
  Points points(n, 3);
  for (int i = 0; i < n; ++i) points.row(i) = random.vector(half).transpose();
  return points;
}

/// Where its tool would be 0.2 m farther on.
inline Pose goal_near(const Robot& robot, const JointVector& q) {
  Pose goal = tool_at(robot, q);
  goal.translation().x() += 0.2;
  return goal;
}

/// A scan whose zones all see something, at no range yet.
inline Scan scan_of(int sensor, std::uint32_t counter, double stamp) {
  Scan scan;
  scan.sensor = sensor;
  scan.counter = counter;
  scan.stamp = stamp;
  scan.status.fill(5);
  return scan;
}

/// Scans of a room of changing depth; the noise makes the closest pair jump.
inline std::vector<Scan> scans(Random& random, int sensors, std::uint32_t counter, double stamp,
                               double nearest = 0.15) {
  std::vector<Scan> out;
  for (int s = 0; s < sensors; ++s) {
    out.push_back(scan_of(s, counter, stamp));
    for (double& range : out.back().ranges) range = random.uniform(nearest, 1.2);
  }
  return out;
}

/// Every kind of task, and confirmation.
inline ControllerConfig five_tasks() {
  ControllerConfig config;
  config.tasks = {JointLimits{}, Avoidance{.nearest = 3}, MinimumAltitude{}, Manipulability{},
                  Reach{}};
  config.filter.confirmation = Confirmation::kScans;
  return config;
}

}  // namespace proxcgal::test
