#pragma once
#include "proxcgal/safety/guard.hpp"
#include "robots.hpp"

namespace proxcgal::test {

/// The guard of the six-joint test arm: lengths and speeds of its own.
inline GuardConfig guard_config(const Robot& robot) {
  GuardConfig config;
  for (int link = 1; link < robot.n_links(); ++link) {
    LinkCapsule capsule;
    capsule.name = robot.spec().links[static_cast<std::size_t>(link)].name;
    capsule.link = link;
    capsule.shape_L = {Vector3::Zero(), Vector3(0, 0, 0.3), 0.06};
    config.capsules.push_back(capsule);
  }
  config.separation.pairs = {"link1", "link2"};
  config.separation.min_distance = 0.455;
  config.q_reference = JointVector::Constant(robot.n_q(), 0.4);
  config.accept = {};
  return config;
}

}  // namespace proxcgal::test
