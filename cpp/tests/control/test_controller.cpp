#include <gtest/gtest.h>
#if defined(__linux__)
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>
#endif

#include "allocations.hpp"
#include "proxcgal/control/controller.hpp"
#include "proxcgal/error.hpp"
#include "repeats.hpp"
#include "robots.hpp"

namespace proxcgal {
namespace {

using test::bent;
using test::five_tasks;
using test::found;
using test::goal_near;
using test::Random;
using test::scans;

TEST(Controller, TickAllocatesNothing) {
  ControllerConfig own = five_tasks();
  own.tasks[3] = SelfCollision{.d_min = 0.3, .buffer = 0.3};  // so that there always is a pair
  for (const auto& config :
       {ControllerConfig{}, five_tasks(), own,
        ControllerConfig{.control_point = ControlPoint::kSensor},
        ControllerConfig{.memory = MemoryConfig{.max_points = 200}, .motion = MotionConfig{}}}) {
    const auto robot = test::arm();
    Controller controller(robot, test::ring(), config);
    Random random(8);
    JointVector q = bent();
    const Pose goal = goal_near(*robot, q);
    std::vector<std::vector<Scan>> batches;
    for (std::uint32_t i = 0; i < 300; ++i) batches.push_back(scans(random, 10, i, 0.07 * i));
    std::size_t found = 0, allocations = 0;
#ifdef __SANITIZE_ADDRESS__  // allocations are counted in the other builds
    const int ticks = 1'000;
#else
    const int ticks = test::repeats(25'000, 250'000);  // 10^5 or 10^6 over the four
#endif
    for (int i = 0; i < ticks; ++i) {
      const std::vector<Scan> none;
      auto& batch = batches[static_cast<std::size_t>(i / 7) % batches.size()];
      for (Scan& scan : batch) scan.counter = static_cast<std::uint32_t>(i), scan.stamp = 0.01 * i;
      const test::CountAllocations counter;
      const TickOutput& out = controller.tick(0.01 * i, q, i % 7 == 0 ? batch : none, goal);
      allocations += counter.count();
      found += out.pair ? 1 : 0;
      q += 0.01 * out.qd;
    }
    EXPECT_EQ(allocations, 0U);
    EXPECT_GT(found, static_cast<std::size_t>(ticks) / 2U);
  }
}

TEST(Controller, SelfCollisionPartsTheNearestLinksThatJointsCanPart) {
  const auto robot = test::arm();
  ControllerConfig config;
  config.tasks = {SelfCollision{.d_min = 0.1, .buffer = 0.3, .nearest = 2}};
  Controller controller(robot, Skin{}, config);
  JointVector q(6);
  q << 0.0, 1.2, 2.6, 0.0, 0.4, 0.0;  // folded
  Posture posture = robot->make_posture();
  robot->update(q, posture);
  double nearest = kInfinity;
  for (int a = 0; a < robot->n_links(); ++a) {
    for (int b = a + 3; b < robot->n_links(); ++b) {
      const Pose T_AB = posture.T_WL[static_cast<std::size_t>(a)].inverse() *
                        posture.T_WL[static_cast<std::size_t>(b)];
      nearest = std::min(nearest, robot->tree(a).distance(robot->tree(b), T_AB));
    }
  }
  double before = -1.0;
  for (int i = 0; i < 30; ++i) {
    const TickOutput& out = controller.tick_known(0.01 * i, q, Points(0, 3), posture.T_WT);
    ASSERT_GE(out.own.a, 0);
    EXPECT_LE(out.own.distance, nearest + 1e-12);
    ASSERT_GE(out.tasks[0].rate.size(), 1);
    ASSERT_LE(out.tasks[0].rate.size(), 2);
    before = parting_row(*robot, posture, out.own).dot(out.qd);
  }
  EXPECT_GT(before, 0.0);
}

#if defined(__linux__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
/// A child that may only read, write and exit: whoever else calls the system is killed.
TEST(Controller, TickMakesNoSystemCall) {
  const auto robot = test::arm();
  Controller controller(robot, test::ring(), five_tasks());
  Random random(20);
  JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  std::vector<std::vector<Scan>> batches;
  for (std::uint32_t i = 0; i < 300; ++i) batches.push_back(scans(random, 10, i, 0.01 * i));
  controller.tick(0.0, q, batches[0], goal);
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    if (prctl(PR_SET_SECCOMP, SECCOMP_MODE_STRICT) != 0) syscall(SYS_exit, 77);
    for (int i = 1; i < 300; ++i)
      q += 0.01 * controller.tick(0.01 * i, q, batches[static_cast<std::size_t>(i)], goal).qd;
    syscall(SYS_exit, 0);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  if (WIFEXITED(status) && WEXITSTATUS(status) == 77) GTEST_SKIP() << "seccomp is not allowed here";
  EXPECT_TRUE(WIFEXITED(status)) << "killed by signal " << WTERMSIG(status);
}
#endif

TEST(Controller, KnownPointsAllocateNothing) {
  const auto robot = test::arm();
  Controller controller(robot, Skin{}, ControllerConfig{});
  Random random(9);
  const Points points = test::cloud(random, 3000, 1.5);
  const JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  const test::CountAllocations counter;
  for (int i = 0; i < 200; ++i) controller.tick_known(0.01 * i, q, points, goal);
  EXPECT_EQ(counter.count(), 0U);
}

TEST(Controller, EveryKnownPointHasItsOwnVelocity) {
  const auto robot = test::arm();
  Posture posture = robot->make_posture();
  robot->update(bent(), posture);
  Points points(2, 3), velocities_W(2, 3);
  points.row(0) = (posture.T_WT.translation() + Vector3(0.25, 0, 0)).transpose();
  points.row(1) << 3.0, 3.0, 3.0;
  velocities_W << -0.1, 0.02, 0.03, 0.7, 0.8, 0.9;
  for (const int nearest : {1, 2}) {
    for (const ControlPoint point : {ControlPoint::kWholeBody, ControlPoint::kSensor}) {
      const ControllerConfig config{.control_point = point,
                                    .tasks = {Avoidance{.nearest = nearest}, Reach{}}};
      Controller controller(robot, test::ring(), config);
      const TickOutput& out =
          controller.tick_known(0.0, bent(), points, posture.T_WT, velocities_W);
      ASSERT_TRUE(out.pair);
      EXPECT_EQ(out.control.obstacle_velocity_W, Vector3(velocities_W.row(out.pair->point)));
      EXPECT_EQ(out.pair->point, 0);
      const TickOutput& alike =
          controller.tick_known(0.01, bent(), points, posture.T_WT, velocities_W.row(1));
      EXPECT_EQ(alike.control.obstacle_velocity_W, Vector3(velocities_W.row(1)));
      controller.tick_known(0.02, bent(), points, posture.T_WT, Points::Zero(3, 3));
      ASSERT_FALSE(controller.findings().empty());
      EXPECT_EQ(controller.findings().front().reason, Reason::kPointsInvalid);
    }
  }
}

TEST(Controller, CommandsStayWithinLimits) {
  const auto robot = test::arm();
  Controller controller(robot, test::ring(), five_tasks());
  Random random(10);
  JointVector q = bent(), last = JointVector::Zero(6);
  const Pose goal = goal_near(*robot, q);
  for (int i = 0; i < 3000; ++i) {
    const auto batch = i % 7 == 0 ? scans(random, 10, static_cast<std::uint32_t>(i), 0.01 * i)
                                  : std::vector<Scan>{};
    const TickOutput& out = controller.tick(0.01 * i, q, batch, goal);
    ASSERT_TRUE(out.qd.allFinite());
    EXPECT_TRUE((out.qd.cwiseAbs().array() <= robot->qd_max().array() + 1e-12).all());
    EXPECT_TRUE(
        ((out.qd - last).cwiseAbs().array() <= 0.01 * robot->qdd_max().array() + 1e-12).all());
    last = out.qd;
    q += 0.01 * out.qd;
    EXPECT_TRUE((q.array() <= robot->q_max().array() + 1e-9).all() &&
                (q.array() >= robot->q_min().array() - 1e-9).all());
  }
}

TEST(Controller, OneThatTakesOverAMovingArmGoesOnFromItsVelocity) {
  const auto robot = test::arm();
  const Points none(0, 3);
  Controller first(robot, Skin{}, ControllerConfig{}), second(robot, Skin{}, ControllerConfig{});
  JointVector q = bent(), last;
  const Pose goal = goal_near(*robot, q);
  for (int i = 0; i < 30; ++i) {
    last = first.tick_known(0.01 * i, q, none, goal).qd;
    q += 0.01 * last;
  }
  ASSERT_GT(last.cwiseAbs().maxCoeff(), 0.2);  // more than one tick could brake
  second.go_on_from(last);
  EXPECT_EQ(second.tick_known(0.0, q, none, goal).qd, first.tick_known(0.3, q, none, goal).qd);
  JointVector fast = last;
  fast[0] = 2.1;
  EXPECT_THROW(second.go_on_from(fast), ConfigError);
  EXPECT_THROW(second.go_on_from(JointVector::Zero(5)), ConfigError);
  fast[0] = std::nan("");
  EXPECT_THROW(second.go_on_from(fast), ConfigError);
}

TEST(Controller, TheCloudStaysInWorldBetweenScans) {
  const auto robot = test::arm();
  Controller controller(robot, test::ring(), ControllerConfig{});
  Random random(13);
  JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  controller.tick(0.0, q, scans(random, 10, 1, 0.0), goal);
  const Points before = controller.cloud_W();
  ASSERT_GT(before.rows(), 0);
  q[0] += 0.3;
  controller.tick(0.01, q, {}, goal);
  EXPECT_EQ(Points(controller.cloud_W()), before);
}

TEST(Controller, AScanIsPlacedWhereTheArmWasAtItsStamp) {
  const auto robot = test::arm();
  ControllerConfig config;
  config.filter.surface_margin = false;
  config.filter.tolerance = 0.0;
  config.filter.sigmas = 0.0;
  Random random(14);
  const auto batch = scans(random, 10, 1, 0.015);  // halfway between two ticks
  const auto run = [&](bool moving) {
    Controller controller(robot, test::ring(), config);
    JointVector q = bent();
    const Pose goal = goal_near(*robot, q);
    for (int i = 0; i < 4; ++i) {
      if (moving) q[0] = 0.1 * i;
      if (!moving) q[0] = 0.15;
      controller.tick(0.01 * i, q, i == 3 ? batch : std::vector<Scan>{}, goal);
    }
    return Points(controller.raw_cloud_W());
  };
  EXPECT_LT((run(true) - run(false)).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(Controller, WhatNoZoneTellsIsUnknownNotFree) {
  for (const bool nan : {true, false}) {
    const auto robot = test::arm();
    Controller controller(robot, test::ring(), ControllerConfig{});
    Random random(16);
    const JointVector q = bent();
    const Pose goal = goal_near(*robot, q);
    controller.tick(0.0, q, scans(random, 10, 0, 0.0), goal);
    const Points before = controller.cloud_W();
    Mode mode = Mode::kRun;
    for (int i = 1; i <= 20; ++i) {
      auto batch = scans(random, 10, static_cast<std::uint32_t>(i), 0.01 * i);
      for (Scan& scan : batch) {
        if (nan) scan.ranges.fill(std::nan(""));
        if (!nan) scan.status.fill(4);
      }
      mode = controller.tick(0.01 * i, q, batch, goal).mode;
    }
    EXPECT_EQ(Points(controller.cloud_W()), before);
    EXPECT_EQ(mode, Mode::kHold);
  }
}

TEST(Controller, ASkinWithoutSensorsHoldsTheArm) {
  const auto robot = test::arm();
  Controller controller(robot, Skin{}, ControllerConfig{});
  const JointVector q = bent();
  const TickOutput& out = controller.tick(0.0, q, {}, goal_near(*robot, q));
  EXPECT_EQ(out.mode, Mode::kHold);
  EXPECT_EQ(out.qd, JointVector::Zero(6));
  // What is missing of each task is judged by what is issued: here, all of it.
  EXPECT_EQ(out.tasks[1].residual, out.tasks[1].rate);
}

TEST(Controller, RefusesContradictions) {
  const auto robot = test::arm();
  EXPECT_THROW(Controller(robot, test::ring(3, "no_such_link"), ControllerConfig{}), ModelError);
  ControllerConfig config;
  config.tasks.clear();
  EXPECT_THROW(Controller(robot, Skin{}, config), ConfigError);
  config = ControllerConfig{};
  config.avoid_links = {"link2", "link2"};
  EXPECT_THROW(Controller(robot, Skin{}, config), ConfigError);
  config = ControllerConfig{.control_point = ControlPoint::kSensor};
  EXPECT_THROW(Controller(robot, test::ring(3, "link0"), config), ConfigError);
  config = ControllerConfig{};
  config.period = 0.0;
  EXPECT_THROW(Controller(robot, Skin{}, config), ConfigError);
  config = ControllerConfig{};
  config.filter.tolerance = std::nan("");
  EXPECT_THROW(Controller(robot, Skin{}, config), ConfigError);
}

}  // namespace
}  // namespace proxcgal
