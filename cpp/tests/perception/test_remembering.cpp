/// A controller that remembers.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "perception/perception.hpp"
#include "proxcgal/control/controller.hpp"
#include "proxcgal/error.hpp"
#include "proxcgal/pipeline/distance.hpp"
#include "robots.hpp"

namespace proxcgal {
namespace {

using test::Random;

struct WithMemory : testing::Test {
  static ControllerConfig config() { return {.memory = MemoryConfig{}, .motion = MotionConfig{}}; }
  std::shared_ptr<Robot> robot = test::arm();
  Controller controller{robot, test::ring(), config()};
  JointVector q = JointVector::Constant(6, 0.3);
  Pose goal = Pose::Identity();
  std::uint32_t counter = 0;

  const TickOutput& tick(double time, double range, std::uint8_t status) {
    std::vector<Scan> scans;
    for (int s = 0; s < 10; ++s) {
      Scan scan{.sensor = s, .counter = ++counter, .stamp = time};
      scan.ranges.fill(range);
      scan.status.fill(status);
      scans.push_back(scan);
    }
    return controller.tick(time, q, scans, goal);
  }
};

TEST_F(WithMemory, AnInvalidScanLeavesTheLastCloudAndAnEmptyOneClearsIt) {
  tick(0.0, 0.3, 5);
  const Eigen::Index seen = controller.seen_points();
  ASSERT_GT(seen, 100);
  tick(0.07, 0.0, 0);  // tells nothing
  EXPECT_EQ(controller.seen_points(), seen);
  const TickOutput& out = tick(0.14, 0.0, 255);
  EXPECT_EQ(controller.seen_points(), 0);
  ASSERT_TRUE(out.pair);
  EXPECT_TRUE(out.pair_remembered);
  EXPECT_NEAR(out.pair_age, 0.14, 1e-12);
  EXPECT_GE(out.pair_origin.sensor, 0);
  EXPECT_GE(out.pair_origin.zone, 0);
  for (const double age : controller.cloud_ages(0.14)) EXPECT_NEAR(age, 0.14, 1e-12);
  tick(0.21, 0.0, 255);
  EXPECT_EQ(controller.cloud_W().rows(), 0);
}

TEST_F(WithMemory, WhereTheArmIsNothingIsRemembered) {
  tick(0.0, 0.3, 5);
  JointVector moved = q;
  for (int step = 0; step < 30; ++step) {
    q = moved + JointVector::Constant(6, 0.04 * step);  // through where the wall was
    const TickOutput& out = tick(0.05 + 0.01 * step, 0.0, step % 2 == 0 ? 255 : 0);
    EXPECT_GT(out.pair_distance(), 0.02);
  }
}

TEST_F(WithMemory, AMemoryThatRunsOutOfStepsIsToldAndKeepsWhatItDidNotLookAt) {
  detail::PerceptionConfig near{
      .filter = config().filter, .memory = config().memory, .motion = config().motion};
  near.filter.tolerance = 0.14;
  detail::Perception perception(robot, test::ring(), near);
  Monitor monitor{MonitorConfig{}};
  for (int i = 0; i < 2; ++i) {
    std::vector<Scan> scans;
    for (int s = 0; s < 10; ++s) {
      Scan scan{.sensor = s, .counter = static_cast<std::uint32_t>(i + 1), .stamp = 0.07 * i};
      scan.ranges.fill(0.12);
      scan.status.fill(0);
      std::fill_n(scan.status.begin(), i == 0 ? kZones : 1, std::uint8_t{5});
      scans.push_back(scan);
    }
    perception.update(0.07 * i, 0.0, q, scans, monitor);
  }
  Posture now = robot->make_posture();
  robot->update(q, now);
  // A tick asks once; asked again and again, the tick's steps come to their end.
  monitor.begin();
  perception.remember(0.07, now, monitor);
  ASSERT_TRUE(monitor.findings().empty());
  const Eigen::Index all = perception.cloud_W().rows();
  ASSERT_GT(all, perception.seen_points() + 50);
  for (int i = 0; i < 100000 && monitor.findings().empty(); ++i)
    perception.remember(0.07, now, monitor);
  ASSERT_EQ(monitor.findings().size(), 1U);
  EXPECT_EQ(monitor.findings()[0].reason, Reason::kWorkBounded);
  EXPECT_EQ(perception.cloud_W().rows(), all);
}

TEST_F(WithMemory, AStuckPayloadClearsNothingAndIsNotRememberedOnceItEnds) {
  Skin twice = test::ring(2);  // both look the same way
  twice.mounts[1].T_LS = twice.mounts[0].T_LS;
  Controller law(robot, twice, config());
  const auto told = [](int sensor, int index, double range, int zones) {
    Scan scan{.sensor = sensor, .counter = static_cast<std::uint32_t>(index)};
    scan.stamp = 0.07 * index;
    scan.ranges.fill(range);
    scan.status.fill(0);  // tells nothing
    std::fill_n(scan.status.begin(), zones, std::uint8_t{5});
    return scan;
  };
  const auto remembered = [&] { return law.cloud_W().rows() - law.seen_points(); };
  constexpr int lost = 10, over = 16;
  for (int i = 0; i < over; ++i) {
    // The first sees something that comes slowly, then only a corner of it; the other is stuck.
    const std::vector<Scan> scans{told(0, i, 0.3 - 1e-3 * i, i < lost ? kZones : 1),
                                  told(1, i, 0.9, kZones)};
    law.tick(0.07 * i, q, scans, goal);
    if (i >= lost) {
      EXPECT_GT(remembered(), 20) << i;
    }
  }
  const Eigen::Index before = remembered();
  const std::vector<Scan> ends{told(0, over, 0.2, 1), told(1, over, 0.9, 1)};
  law.tick(0.07 * over, q, ends, goal);
  EXPECT_EQ(remembered(), before);
}

TEST_F(WithMemory, WhatIsRememberedInsideTheLeastDistanceStaysThoughItsSensorIsStuckSince) {
  Controller law(robot, test::ring(1), config());
  constexpr int seen = 10, stuck = 20;
  int doubted = 0;
  for (int i = 0; i < stuck; ++i) {
    // Something before the middle; then the upper half tells the same far wall again and again,
    // and the rest nothing.
    Scan scan{.sensor = 0, .counter = static_cast<std::uint32_t>(i), .stamp = 0.07 * i};
    scan.ranges.fill(i < seen ? 0.12 + 1e-3 * (i % 3) : 0.9);
    scan.status.fill(0);
    const auto first = static_cast<std::size_t>(i < seen ? 26 : 0);
    for (std::size_t zone = first; zone < first + 4; ++zone) scan.status[zone] = 5;
    const TickOutput& out = law.tick(scan.stamp, q, std::span(&scan, 1), goal);
    ASSERT_TRUE(out.pair);
    EXPECT_EQ(out.pair_remembered, i >= seen) << i;
    EXPECT_LT(out.trusted_distance, 0.2);
    doubted += test::found(law, Reason::kSensorSuspect) ? 1 : 0;
  }
  EXPECT_GT(doubted, 3);
  // The arm comes to it, nearer than what it takes for its own surface.
  Posture posture = robot->make_posture();
  const Points points = law.cloud_W().bottomRows(law.cloud_W().rows() - law.seen_points());
  ClosestPair pair;
  for (int step = 0; step < 20; ++step) {
    robot->update(q, posture);
    pair = closest_pair(*robot, posture, points, Method::kFast);
    const ControlPair toward{.link = pair.link,
                             .control_W = pair.surface_W,
                             .obstacle_W = pair.obstacle_W,
                             .distance = pair.distance};
    const JointVector row = opening_row(*robot, posture, toward);
    q -= 0.5 * (pair.distance - 0.01) / row.squaredNorm() * row;
  }
  ASSERT_NEAR(pair.distance, 0.01, 0.005);
  const TickOutput& out = law.tick(0.07 * stuck, q, {}, goal);
  ASSERT_TRUE(out.pair);
  EXPECT_TRUE(out.pair_remembered);
  EXPECT_NEAR(out.pair->distance, 0.01, 0.005);
}

TEST_F(WithMemory, WithoutItEverythingIsAsItWas) {
  ControllerConfig off;
  off.memory = MemoryConfig{.memory_s = 0.0};
  Controller plain(robot, test::ring(), ControllerConfig{}), none(robot, test::ring(), off);
  Random random(9);
  for (int i = 0; i < 200; ++i) {
    std::vector<Scan> scans;
    for (int s = 0; i % 7 == 0 && s < 10; ++s) {
      Scan scan{.sensor = s, .counter = static_cast<std::uint32_t>(i + 1), .stamp = 0.01 * i};
      for (double& range : scan.ranges) range = random.uniform(0.15, 1.2);
      scan.status.fill(5);
      scans.push_back(scan);
    }
    const JointVector qd = plain.tick(0.01 * i, q, scans, goal).qd;
    EXPECT_EQ(none.tick(0.01 * i, q, scans, goal).qd, qd);
    EXPECT_EQ(none.cloud_W(), plain.cloud_W());
  }
}

}  // namespace
}  // namespace proxcgal
