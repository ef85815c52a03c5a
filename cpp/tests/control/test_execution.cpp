/// What avoidance asked for and did not get.
#include <gtest/gtest.h>

#include <algorithm>

#include "proxcgal/control/controller.hpp"
#include "proxcgal/pipeline/distance.hpp"
#include "robots.hpp"

namespace proxcgal {
namespace {

using test::found;
using test::Random;

/// Links of the avoidance's rows: the nearest that joints can move away, nearest first.
std::vector<int> links_of_rows(const Robot& robot, const Posture& posture, const Points& points,
                               std::size_t rows) {
  std::vector<int> moved;
  for (int link = 1; link < robot.n_links(); ++link) moved.push_back(link);
  std::vector<ClosestPair> pairs(moved.size());
  closest_pairs(robot, posture, points, moved, pairs);
  const auto signed_distance = [&](const ClosestPair& pair) {
    const Pose& T_WL = posture.T_WL[static_cast<std::size_t>(pair.link)];
    const bool inside = robot.tree(pair.link).inside(T_WL.inverse() * pair.obstacle_W);
    return inside ? -pair.distance : pair.distance;
  };
  std::sort(pairs.begin(), pairs.end(),
            [&](const auto& x, const auto& y) { return signed_distance(x) < signed_distance(y); });
  std::vector<int> links;
  for (const ClosestPair& pair : pairs) {
    ControlPair control{.link = pair.link, .control_W = pair.surface_W};
    control.obstacle_W = pair.obstacle_W;
    if (links.size() < rows && row_norm(robot, posture, control) >= 0.05)
      links.push_back(pair.link);
  }
  return links;
}

TEST(Execution, EveryRowThatGetsLessThanHalfIsToldWithItsLink) {
  const auto robot = test::arm();
  ControllerConfig config;
  config.tasks = {Avoidance{.nearest = 3}, Reach{}};
  config.monitor.following_tolerance = kInfinity;  // the arm is held where it is
  Random random(41);
  int several = 0, other = 0;
  for (int trial = 0; trial < 200; ++trial) {
    Controller controller(robot, Skin{}, config);
    const JointVector q = test::posture(random, 6);
    Posture posture = robot->make_posture();
    robot->update(q, posture);
    const Points points = test::cloud(random, 60, 0.9);
    for (int i = 0; i < 30; ++i) {  // held where it is: until what can be reached is
      const TickOutput& out = controller.tick_known(0.01 * i, q, points, posture.T_WT);
      if (out.mode != Mode::kRun) break;
      const TaskReport& told = out.tasks[0];
      const auto links =
          links_of_rows(*robot, posture, points, static_cast<std::size_t>(told.rate.size()));
      ASSERT_EQ(links.size(), static_cast<std::size_t>(told.rate.size()));
      std::vector<int> expected, got;
      for (Eigen::Index row = 0; row < told.rate.size(); ++row) {
        if (told.activation[row] > 0.5 && told.rate[row] > 0.0 &&
            told.residual[row] > 0.5 * told.rate[row])
          expected.push_back(links[static_cast<std::size_t>(row)]);
      }
      for (const Finding& finding : controller.findings()) {
        if (finding.reason == Reason::kNotExecuted) got.push_back(finding.link);
      }
      ASSERT_EQ(got, expected) << "trial " << trial << ", tick " << i;
      several += expected.size() > 1 ? 1 : 0;
      other += !expected.empty() && expected.front() != links.front() ? 1 : 0;
    }
  }
  EXPECT_GT(several, 20);  // else nothing was tried
  EXPECT_GT(other, 20);
}

TEST(SelfCollision, PairsThatAWiderReachTakesInAreFoundWhereTheArmStands) {
  const auto robot = test::arm();
  const auto tasks = [](double d_min) {
    return std::vector<TaskSpec>{SelfCollision{.d_min = d_min, .buffer = 0.01}};
  };
  ControllerConfig config;
  config.tasks = tasks(0.01);
  JointVector q(6);
  q << 0.0, 1.2, 2.0, 0.0, 0.4, 0.0;  // folded, but not near
  const Pose goal = test::tool_at(*robot, q);
  const Points none(0, 3);
  Controller controller(robot, Skin{}, config);
  for (int i = 0; i < 20; ++i) controller.tick_known(0.01 * i, q, none, goal);
  controller.retune(tasks(0.4));
  config.tasks = tasks(0.4);
  Controller fresh(robot, Skin{}, config);
  for (int i = 20; i < 40; ++i) {
    controller.tick_known(0.01 * i, q, none, goal);
    fresh.tick_known(0.01 * i, q, none, goal);
  }
  const LinkPair wanted = fresh.tick_known(0.4, q, none, goal).own;
  const LinkPair got = controller.tick_known(0.4, q, none, goal).own;
  ASSERT_GE(wanted.a, 0);
  EXPECT_EQ(got.a, wanted.a);
  EXPECT_EQ(got.b, wanted.b);
  EXPECT_NEAR(got.distance, wanted.distance, 1e-9);
}

}  // namespace
}  // namespace proxcgal
