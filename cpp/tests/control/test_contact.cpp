/// Inside d_min, in contact, and inside a link.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "proxcgal/control/controller.hpp"
#include "proxcgal/pipeline/distance.hpp"
#include "proxcgal/pipeline/limit.hpp"
#include "repeats.hpp"
#include "robots.hpp"

namespace proxcgal {
namespace {

using test::bent;
using test::found;
using test::goal_near;
using test::Random;

TEST(Controller, InsideTheLeastDistanceNothingComesNearer) {
  const auto robot = test::arm();
  const ControllerConfig config;
  Random random(24);
  int inside = 0;
  for (int trial = 0; trial < 40; ++trial) {
    Controller controller(robot, Skin{}, config);
    JointVector q = test::posture(random, 6);
    const Pose goal = goal_near(*robot, test::posture(random, 6));
    const Points points = test::cloud(random, 40, 1.0);
    Posture posture = robot->make_posture();
    JointVector before = JointVector::Zero(6);
    Limiter limiter({robot->q_min(), robot->q_max(), robot->qd_max(), robot->qdd_max()},
                    config.limit, config.period);
    for (int i = 0; i < 60; ++i) {
      const TickOutput& out = controller.tick_known(0.01 * i, q, points, goal);
      robot->update(q, posture);
      if (out.pair && out.pair->distance < 0.2 && out.pair->distance > 1e-6) {
        ControlPair pair;
        pair.link = out.pair->link;
        pair.control_W = out.pair->surface_W;
        pair.obstacle_W = out.pair->obstacle_W;
        pair.distance = out.trusted_distance;  // negative inside: out is the other way
        const JointVector row = opening_row(*robot, posture, pair);
        const JointVector& brake = limiter.begin(q, before, config.period).qd_brake;
        EXPECT_GE(row.dot(out.qd), std::min(0.0, row.dot(brake)) - 1e-9);
        ++inside;
      }
      before = out.qd;
      q += config.period * out.qd;
    }
  }
  EXPECT_GT(inside, 300);
}

TEST(Controller, AGoalThatIsNoPoseStopsTheNominalMotionAndNeverTheRetreat) {
  const auto robot = test::arm();
  Controller controller(robot, Skin{}, ControllerConfig{});
  JointVector q = bent();
  Posture posture = robot->make_posture();
  robot->update(q, posture);
  const Pose goal = posture.T_WT;
  Pose bad = goal;
  bad.translation().x() = std::nan("");
  Points near(1, 3);
  near.row(0) = (goal.translation() + Vector3(0.10, 0.0, 0.0)).transpose();
  double least = kInfinity, distance = 0.0;
  for (int i = 0; i < 300; ++i) {
    const TickOutput& out = controller.tick_known(0.01 * i, q, near, bad);
    ASSERT_EQ(out.mode, Mode::kHold);
    distance = out.pair_distance();
    least = std::min(least, distance);
    q += 0.01 * out.qd;
  }
  EXPECT_LT(least, 0.15);
  EXPECT_GT(distance, 0.19);
  for (int i = 300; i < 450; ++i) {
    const TickOutput& out = controller.tick_known(0.01 * i, q, near, goal);
    if (i >= 351) {
      ASSERT_EQ(out.mode, Mode::kRun);  // 0.5 s clean
    }
    q += 0.01 * out.qd;
  }
}

TEST(Controller, AnObstacleThatTouchesIsNotTakenForBody) {
  const auto robot = test::arm();
  Controller controller(robot, test::looking_back(), ControllerConfig{});
  const JointVector q = bent();
  const Pose goal = test::tool_at(*robot, q);
  int kept = 0;
  for (int i = 0; i < 60; ++i) {
    Scan scan;
    scan.counter = static_cast<std::uint32_t>(i);
    scan.stamp = 0.07 * i;
    scan.status.fill(255);
    const double range = std::min(0.08 + 0.005 * i, 0.25);
    scan.ranges[27] = range;
    scan.status[27] = 5;
    const TickOutput& out = controller.tick(0.07 * i, q, std::span(&scan, 1), goal);
    ASSERT_TRUE(out.pair.has_value()) << "lost at " << range << " m";
    if (!found(controller, Reason::kContact)) continue;
    ++kept;
    EXPECT_GE(out.mode, Mode::kDegraded);
    EXPECT_LT(out.trusted_distance, 0.05);
  }
  EXPECT_GT(kept, 10);
  // Gone, it is no contact any more; nor is what another zone then sees.
  Scan scan;
  scan.status.fill(255);
  for (int i = 60; i < 63; ++i) {
    scan.counter = static_cast<std::uint32_t>(i);
    scan.stamp = 0.07 * i;
    if (i > 60) {
      scan.ranges[28] = 0.1;
      scan.status[28] = 5;
    }
    const TickOutput& out = controller.tick(scan.stamp, q, std::span(&scan, 1), goal);
    EXPECT_EQ(out.pair.has_value(), i > 60);
    EXPECT_FALSE(found(controller, Reason::kContact)) << i;
  }
}

/// The signed distance from a point to a link: negative inside.
double signed_distance(const Robot& robot, const Posture& posture, int link, const Vector3& p_W) {
  const Vector3 p_L = posture.T_WL[static_cast<std::size_t>(link)].inverse() * p_W;
  const double distance = std::sqrt(robot.tree(link).nearest(p_L)->squared_distance);
  return robot.tree(link).inside(p_L) ? -distance : distance;
}

TEST(Controller, FromContactAndFromInsideEveryCommandLeadsOut) {
  const auto robot = test::arm();
  Random random(27);
  const ControllerConfig config;
  int led = 0, deep = 0, nearer = 0;
  const int trials = test::repeats(300, 30'000);
  for (int trial = 0; trial < trials; ++trial) {
    const JointVector q = test::posture(random, 6);
    Posture posture = robot->make_posture(), next = robot->make_posture();
    robot->update(q, posture);
    // A point up to 10 mm under the surface of a link, or on it.
    const int link = 2 + trial % 5;
    const Points& v = robot->tree(link).vertices_L();
    const Vector3 surface_L = v.row(
        static_cast<Eigen::Index>(random.uniform(0, 1) * 0.999 * static_cast<double>(v.rows())));
    const Vector3 centre_L(0, 0, surface_L.z());
    const double depth = trial % 3 == 0 ? 0.0 : random.uniform(0.0, 0.01);
    const Vector3 inward = (centre_L - surface_L).normalized();
    const Vector3 p_W = posture.T_WL[static_cast<std::size_t>(link)] * (surface_L + depth * inward);
    Points points(1, 3);
    points.row(0) = p_W.transpose();
    Controller controller(robot, Skin{}, config);
    const TickOutput& out = controller.tick_known(0.0, q, points, posture.T_WT);
    if (!out.pair || out.pair->link != link || !inward.allFinite()) continue;
    ControlPair pair;
    pair.link = link;
    pair.control_W = out.pair->surface_W;
    pair.obstacle_W = p_W;
    pair.distance = out.trusted_distance;
    if (std::abs(out.trusted_distance) < 1e-6) continue;  // on the surface no slope is left to test
    if (opening_row(*robot, posture, pair).norm() < 0.1) continue;
    const double before = signed_distance(*robot, posture, link, p_W);
    robot->update(q + 1e-5 * out.qd, next);  // so short that the slope decides
    EXPECT_GT(signed_distance(*robot, next, link, p_W), before);
    // In a millisecond another face of the bumpy mesh may have come as near.
    robot->update(q + 1e-3 * out.qd, next);
    const double opened = signed_distance(*robot, next, link, p_W) - before;
    EXPECT_GT(opened, -2e-4);
    nearer += opened > 0.0 ? 0 : 1;
    ++led;
    deep += before < -1e-4 ? 1 : 0;
  }
  EXPECT_GT(led, 80);
  EXPECT_GT(deep, 40);
  EXPECT_LE(nearer, 1 + led / 500);
}

}  // namespace
}  // namespace proxcgal
