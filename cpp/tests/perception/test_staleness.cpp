/// Scans and joint states that are late, missing, repeated or no numbers.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "proxcgal/control/controller.hpp"
#include "robots.hpp"

namespace proxcgal {
namespace {

using test::bent;
using test::found;
using test::goal_near;
using test::Random;
using test::scans;

TEST(Controller, ANanJointStateStopsWithinOneCycleAndStaysStopped) {
  const auto robot = test::arm();
  Controller controller(robot, Skin{}, ControllerConfig{});
  JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  for (int i = 0; i < 50; ++i) controller.tick(0.01 * i, q, {}, goal);
  JointVector bad = q;
  bad[2] = std::nan("");
  EXPECT_EQ(controller.tick(0.5, bad, {}, goal).mode, Mode::kStop);
  EXPECT_FALSE(controller.reset());  // the cause is still there
  EXPECT_EQ(controller.tick(0.51, q, {}, goal).mode, Mode::kStop);
  EXPECT_TRUE(controller.reset());
  EXPECT_NE(controller.tick(0.52, q, {}, goal).mode, Mode::kStop);
}

TEST(Controller, SilenceOfAllSensorsHoldsTheArmWithin200Milliseconds) {
  const auto robot = test::arm();
  Controller controller(robot, test::ring(), ControllerConfig{});
  Random random(11);
  JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  for (int i = 0; i < 100; ++i) {
    const auto batch = i % 7 == 0 ? scans(random, 10, static_cast<std::uint32_t>(i), 0.01 * i, 1.0)
                                  : std::vector<Scan>{};
    q += 0.01 * controller.tick(0.01 * i, q, batch, goal).qd;
  }
  Mode mode = Mode::kRun;  // the last scan came at 0.98 s
  for (int i = 100; i <= 118; ++i) {
    const TickOutput& out = controller.tick(0.01 * i, q, {}, goal);
    q += 0.01 * out.qd;
    mode = out.mode;
    if (i <= 111) {
      EXPECT_EQ(mode, Mode::kRun);
    }
  }
  EXPECT_EQ(mode, Mode::kHold);
}

TEST(Controller, SilenceOfOneArrayHoldsTheArmWithin200Milliseconds) {
  const auto robot = test::arm();
  Skin skin = test::ring(10);
  for (std::size_t s = 0; s < 10; ++s)
    skin.mounts[s].name = (s < 5 ? "front/" : "back/") + std::to_string(s);
  Controller controller(robot, skin, ControllerConfig{});
  Random random(21);
  JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  Mode mode = Mode::kRun;
  for (int i = 0; i < 100; ++i) {
    auto batch = scans(random, 10, static_cast<std::uint32_t>(i), 0.01 * i, 1.0);
    if (i >= 60) batch.resize(5);  // the second array goes silent, its last scan came at 0.59 s
    const TickOutput& out = controller.tick(0.01 * i, q, batch, goal);
    q += 0.01 * out.qd;
    mode = out.mode;
    if (i == 70) {
      EXPECT_EQ(mode, Mode::kRun);
    }
    if (i == 79) {
      EXPECT_EQ(mode, Mode::kHold);
      EXPECT_TRUE(found(controller, Reason::kArraySilent));
    }
  }
}

TEST(Controller, TheSamePayloadAgainAndAgainIsSuspect) {
  const auto robot = test::arm();
  Random random(22);
  const JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  const auto stuck = scans(random, 10, 0, 0.0, 1.0);
  // A wall beyond the workspace is no point of the cloud, but it is told all the same.
  for (const double farther : {0.0, 2.0}) {
    Controller controller(robot, test::ring(), ControllerConfig{});
    for (int i = 0; i < 20; ++i) {
      auto batch = scans(random, 10, static_cast<std::uint32_t>(i), 0.01 * i, 1.0);
      batch[3].ranges = stuck[3].ranges;
      for (double& range : batch[3].ranges) range += farther;
      const Mode mode = controller.tick(0.01 * i, q, batch, goal).mode;
      EXPECT_EQ(found(controller, Reason::kSensorSuspect), i >= 5);
      if (i < 5) {
        EXPECT_EQ(mode, Mode::kRun);
      } else {
        EXPECT_GE(mode, Mode::kDegraded);
      }
    }
  }
}

TEST(Controller, AnOldJointStateHoldsAndAtLastStops) {
  const auto robot = test::arm();
  Controller controller(robot, test::ring(), ControllerConfig{});
  Random random(23);
  const JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  const auto at = [&](int i, double age) {
    const auto batch = scans(random, 10, static_cast<std::uint32_t>(i), 0.01 * i, 1.0);
    return controller.tick(0.01 * i, q, batch, goal, false, 0.01 * i - age).mode;
  };
  EXPECT_EQ(at(0, 0.0), Mode::kRun);
  EXPECT_EQ(at(1, 0.019), Mode::kRun);
  EXPECT_EQ(at(2, 0.021), Mode::kHold);
  EXPECT_EQ(at(3, 0.101), Mode::kStop);
  const auto kept = controller.last_ticks();
  ASSERT_EQ(kept.size(), 4U);
  EXPECT_EQ(kept.back().mode, Mode::kStop);
  EXPECT_EQ(kept.back().findings[0].reason, Reason::kJointStateLost);
  EXPECT_EQ(at(4, 0.0), Mode::kStop);  // latched, and what led to it stays
  EXPECT_EQ(controller.last_ticks().size(), 4U);
  EXPECT_TRUE(controller.reset());
  EXPECT_EQ(at(5, 0.0), Mode::kHold);
  EXPECT_EQ(controller.last_ticks().size(), 5U);
}

TEST(Controller, AJointStateOfAnotherClockHolds) {
  const auto robot = test::arm();
  Random random(28);
  const JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  for (const double stamp : {std::nan(""), kInfinity, 3600.0}) {
    Controller controller(robot, test::ring(), ControllerConfig{});
    controller.tick(0.0, q, scans(random, 10, 0, 0.0, 1.0), goal, false, stamp);
    EXPECT_TRUE(found(controller, Reason::kJointStateStale));
  }
}

TEST(Controller, OnKnownPointsSilentSensorsSlowNothing) {
  const auto robot = test::arm();
  JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  const Points far = Points::Constant(1, 3, 3.0);
  Controller bare(robot, Skin{}, ControllerConfig{}),
      covered(robot, test::ring(10), ControllerConfig{});
  for (int i = 0; i < 50; ++i) {
    const JointVector qd = bare.tick_known(0.01 * i, q, far, goal).qd;
    EXPECT_EQ(covered.tick_known(0.01 * i, q, far, goal).qd, qd);
    q += 0.01 * qd;
  }
}

Pose sensor_0(const Robot& robot, const Skin& skin, const Posture& posture) {
  const Mount& mount = skin.mounts[0];
  return posture.T_WL[static_cast<std::size_t>(robot.link_row(mount.link))] * mount.T_LS;
}

/// A goal half a metre that way from the tool.
Pose where_sensor_0_looks(const Robot& robot, const Skin& skin, const JointVector& q,
                          Posture& posture) {
  robot.update(q, posture);
  Pose goal = posture.T_WT;
  goal.translation() += 0.5 * sensor_0(robot, skin, posture).linear().col(2);
  return goal;
}

TEST(Controller, MotionIntoWhatASilentSensorSawIsHeld) {
  const auto robot = test::arm();
  Skin skin = test::ring(10);
  Controller controller(robot, skin, ControllerConfig{});
  Random random(25);
  JointVector q = bent();
  Posture posture = robot->make_posture();
  const Pose goal = where_sensor_0_looks(*robot, skin, q, posture);
  bool held = false;
  for (int i = 0; i < 100; ++i) {
    auto batch = scans(random, 10, static_cast<std::uint32_t>(i), 0.01 * i, 1.0);
    if (i >= 40) batch.erase(batch.begin());
    const TickOutput& out = controller.tick(0.01 * i, q, batch, goal);
    if (i < 40) {
      EXPECT_EQ(out.mode, Mode::kRun);
    }
    held = held || (out.mode == Mode::kHold && found(controller, Reason::kBlindMotion));
    if (held) {
      EXPECT_LE(i, 60);
      break;
    }
    q += 0.01 * out.qd;
  }
  EXPECT_TRUE(held);
}

TEST(Controller, WhereNoAgeHoldsMotionIntoWhatASilentSensorSawIsSlowedStill) {
  const auto robot = test::arm();
  const Skin skin = test::ring(10);
  ControllerConfig config;
  config.monitor.hold_after = kInfinity;
  config.monitor.blind_speed = 0.02;
  Controller controller(robot, skin, config);
  Random random(25);
  JointVector q = bent();
  Posture posture = robot->make_posture();
  const Pose goal = where_sensor_0_looks(*robot, skin, q, posture);
  double fastest_seen = 0.0, fastest_blind = 0.0;
  for (int i = 0; i < 100; ++i) {
    auto batch = scans(random, 10, static_cast<std::uint32_t>(i), 0.01 * i, 1.0);
    if (i >= 40) batch.erase(batch.begin());
    const TickOutput& out = controller.tick(0.01 * i, q, batch, goal);
    robot->update(q, posture);
    const Pose T_WS = sensor_0(*robot, skin, posture);
    Jacobian6 J;
    robot->jacobian(posture, robot->link_row(skin.mounts[0].link), T_WS.translation(), J);
    const double into = T_WS.linear().col(2).dot(J.topRows<3>() * out.qd);
    if (i < 40) fastest_seen = std::max(fastest_seen, into);
    if (i >= 80) fastest_blind = std::max(fastest_blind, into);
    EXPECT_NE(out.mode, Mode::kHold);
    q += 0.01 * out.qd;
  }
  EXPECT_GT(fastest_seen, 0.03);
  EXPECT_LE(fastest_blind, 0.02 + 1e-9);
}

TEST(Controller, ARepeatedOrOlderScanIsRefused) {
  const auto robot = test::arm();
  Controller controller(robot, test::ring(), ControllerConfig{});
  Random random(12);
  const JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  const auto first = scans(random, 10, 5, 0.0);
  controller.tick(0.0, q, first, goal);
  const Points before = controller.cloud_W();
  controller.tick(0.01, q, scans(random, 10, 5, 0.01), goal);
  EXPECT_EQ(Points(controller.cloud_W()), before);
  EXPECT_EQ(controller.findings().front().reason, Reason::kScanRefused);
  controller.tick(0.02, q, scans(random, 10, 4, 0.02), goal);
  EXPECT_EQ(Points(controller.cloud_W()), before);
}

TEST(Controller, AScanOfLongAgoIsRefused) {
  const auto robot = test::arm();
  Controller controller(robot, test::ring(), ControllerConfig{});
  Random random(17);
  const JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  double time = 5.0;
  for (const double stamp : {-kInfinity, 4.0, std::nan(""), 6.0}) {
    time += 0.01;
    controller.tick(time, q, scans(random, 10, 1, stamp), goal);
    EXPECT_EQ(controller.cloud_W().rows(), 0);
    EXPECT_EQ(controller.findings().front().reason, Reason::kScanRefused);
  }
}

}  // namespace
}  // namespace proxcgal
