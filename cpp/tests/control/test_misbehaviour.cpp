/// Rows of docs/reliability.md that need a controller and no simulator.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "proxcgal/control/controller.hpp"
#include "proxcgal/pipeline/distance.hpp"
#include "robots.hpp"

namespace proxcgal {
namespace {

using test::bent;
using test::found;
using test::Random;
using test::tool_at;

std::vector<Scan> wall(int sensors, std::uint32_t counter, double stamp, double range) {
  std::vector<Scan> out;
  for (int s = 0; s < sensors; ++s) {
    out.push_back(test::scan_of(s, counter, stamp));
    for (int zone = 0; zone < kZones; ++zone)
      out.back().ranges[static_cast<std::size_t>(zone)] = range + 1e-3 * ((zone + counter) % 7);
  }
  return out;
}

TEST(Misbehaviour, WhereMountsAreAwaitedTheArmHoldsUntilTheyAreAccepted) {
  const auto robot = test::arm();
  ControllerConfig config;
  config.monitor.await_mounts = true;
  Controller controller(robot, test::ring(), config);
  const JointVector q = bent();
  Pose goal = tool_at(*robot, q);
  goal.translation().x() += 0.2;
  std::uint32_t i = 0;
  const auto tick = [&]() -> const TickOutput& {
    const double time = 0.01 * ++i;
    return controller.tick(time, q, wall(10, i, time, 1.0), goal);
  };
  for (int n = 0; n < 50; ++n) {
    const TickOutput& out = tick();
    EXPECT_EQ(out.mode, Mode::kHold);
    EXPECT_TRUE(found(controller, Reason::kMountsUnchecked));
    EXPECT_EQ(out.qd.norm(), 0.0);
  }
  controller.accept_mounts();
  for (int n = 0; n < 49; ++n) EXPECT_EQ(tick().mode, Mode::kHold);
  tick();
  EXPECT_EQ(tick().mode, Mode::kRun);
  EXPECT_GT(tick().qd.norm(), 0.0);
}

TEST(Misbehaviour, OutsideItsLimitsAJointOnlyMovesInward) {
  const auto robot = test::arm();
  Random random(31);
  for (int trial = 0; trial < 40; ++trial) {
    Controller controller(robot, Skin{}, ControllerConfig{});
    JointVector q = test::posture(random, 6);
    const Eigen::Index joint = trial % 6;
    const double side = trial % 2 == 0 ? 1.0 : -1.0;
    q[joint] = side * (3.0 + random.uniform(0.01, 0.3));
    const Pose goal = tool_at(*robot, test::posture(random, 6));
    const Points points = test::cloud(random, 20, 0.8);
    for (int i = 0; i < 40; ++i) {
      const TickOutput& out = controller.tick_known(0.01 * i, q, points, goal);
      if (std::abs(q[joint]) <= 3.0) break;
      EXPECT_TRUE(found(controller, Reason::kOutsideLimits));
      EXPECT_LE(side * out.qd[joint], 0.0);
      q += 0.01 * out.qd;
    }
  }
}

/// Two points, each near to a link of its own; which of them is the nearer changes.
TEST(Misbehaviour, CommandsStayContinuousWhereTheClosestPointJumps) {
  const auto robot = test::arm();
  Random random(32);
  int jumps = 0;
  for (int trial = 0; trial < 30; ++trial) {
    Controller controller(robot, Skin{}, ControllerConfig{});
    JointVector q = test::posture(random, 6), before = JointVector::Zero(6);
    const Pose goal = tool_at(*robot, test::posture(random, 6));
    Posture posture = robot->make_posture();
    int link = -1;
    double switched = -1.0, distance = kInfinity;
    for (int i = 0; i < 200; ++i) {
      robot->update(q, posture);
      Points points(2, 3);
      for (int k = 0; k < 2; ++k) {
        const Pose& T_WL = posture.T_WL[static_cast<std::size_t>(3 + 3 * k)];
        // Within 10 mm of each other, now the one, now the other ahead.
        const double range = 0.06 + 0.28 + 0.003 * std::sin(0.9 * i + M_PI * k);
        points.row(k) = (T_WL * Vector3(range, 0.0, 0.14)).transpose();
      }
      const double time = 0.01 * i;
      const TickOutput& out = controller.tick_known(time, q, points, goal);
      ASSERT_TRUE(out.qd.allFinite());
      EXPECT_TRUE(((out.qd - before).cwiseAbs().array() <= 0.01 * 10.0 + 1e-12).all());
      ASSERT_TRUE(out.pair.has_value());
      if (link >= 0 && out.pair->link != link) {
        ++jumps;
        const bool inside = out.pair->distance < 0.2;
        const double other =
            closest_pair(*robot, posture, points, Method::kFast, {.links = std::span(&link, 1)})
                .distance;
        // At once only inside d_min, where the new link is nearer by 10 mm, or where the old one
        // cannot be moved away any more.
        EXPECT_TRUE(inside || found(controller, Reason::kLinkSkipped) ||
                    other >= out.pair->distance + 0.01 - 1e-9 || time - switched >= 0.1 - 1e-9)
            << "after " << time - switched << " s";
        switched = time;
      }
      link = out.pair->link;
      distance = out.pair->distance;
      before = out.qd;
      q += 0.01 * out.qd;
    }
    EXPECT_LT(distance, 1.0);
  }
  EXPECT_GT(jumps, 30);
}

TEST(Misbehaviour, ASingularPostureKeepsJointSpeedsBoundedAndContinuous) {
  const auto robot = test::arm();
  for (const double bend : {0.0, 1e-9, 1e-4, 0.05}) {
    Controller controller(robot, Skin{}, ControllerConfig{});
    JointVector q = JointVector::Zero(6), before = JointVector::Zero(6);
    q[2] = bend;  // stretched out: the goal beyond can't be reached
    Pose goal = tool_at(*robot, q);
    goal.translation().z() += 0.5;
    goal.translation().x() += 0.1;
    const Points none(0, 3);
    for (int i = 0; i < 400; ++i) {
      const TickOutput& out = controller.tick_known(0.01 * i, q, none, goal);
      ASSERT_TRUE(out.qd.allFinite());
      EXPECT_LE(out.qd.cwiseAbs().maxCoeff(), 2.0 + 1e-12);
      EXPECT_LE((out.qd - before).cwiseAbs().maxCoeff(), 0.1 + 1e-12);
      before = out.qd;
      q += 0.01 * out.qd;
    }
  }
}

TEST(Misbehaviour, AnArmThatIsStretchedOutExactlyReportsThatItCannotMoveAlongItself) {
  const auto robot = test::arm();
  Controller controller(robot, Skin{}, ControllerConfig{});
  const JointVector q = JointVector::Zero(6);
  Pose goal = tool_at(*robot, q);
  goal.translation().z() -= 0.3;  // straight towards its base
  controller.tick_known(0.0, q, Points(0, 3), goal);
  EXPECT_TRUE(found(controller, Reason::kSingular));
  goal.translation().x() += 0.3;
  controller.tick_known(0.01, q, Points(0, 3), goal);
  EXPECT_FALSE(found(controller, Reason::kSingular));
}

TEST(Misbehaviour, AGoalWhoseRotationIsRoundedToFourDecimalsIsTaken) {
  const auto robot = test::arm();
  Controller controller(robot, Skin{}, ControllerConfig{});
  const JointVector q = bent();
  Pose goal = tool_at(*robot, q);
  for (double& value : goal.linear().reshaped()) value = std::round(1e4 * value) / 1e4;
  controller.tick_known(0.0, q, Points(0, 3), goal);
  EXPECT_FALSE(found(controller, Reason::kGoalInvalid));
  goal.linear() *= 1.01;
  controller.tick_known(0.01, q, Points(0, 3), goal);
  EXPECT_TRUE(found(controller, Reason::kGoalInvalid));
}

TEST(Misbehaviour, AgainstAConflictingGoalTheSafetyLevelKeepsItsBestAndBothTellWhatIsMissing) {
  const auto robot = test::arm();
  Random random(33);
  int against = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const JointVector q = test::posture(random, 6);
    Posture posture = robot->make_posture();
    robot->update(q, posture);
    // A point right in the way of the tool, the goal behind it.
    const Vector3 tool_W = posture.T_WT.translation();
    const Vector3 way_W = posture.T_WT.linear().col(2);
    Points points(1, 3);
    points.row(0) = (tool_W + 0.1 * way_W).transpose();
    Pose goal = posture.T_WT;
    goal.translation() += 0.6 * way_W;
    ControllerConfig config, alone;
    config.monitor.following_tolerance = kInfinity;  // the arm is held where it is
    alone.monitor = config.monitor;
    alone.tasks = {Avoidance{}};
    Controller both(robot, Skin{}, config), safety(robot, Skin{}, alone);
    double with = 0.0, without = 0.0, reach = 0.0, rate = 0.0;
    for (int i = 0; i < 30; ++i) {  // until both are up to speed; the arm is held where it is
      const TickOutput& a = both.tick_known(0.01 * i, q, points, goal);
      const TickOutput& b = safety.tick_known(0.01 * i, q, points, goal);
      ASSERT_EQ(a.n_tasks, 2);
      with = std::max(a.tasks[0].residual[0], 0.0);
      without = std::max(b.tasks[0].residual[0], 0.0);
      rate = a.tasks[0].rate[0];
      reach = a.tasks[1].residual.norm();
    }
    if (!(rate > 0.05)) continue;
    ++against;
    EXPECT_LE(with, without + 0.02 * rate) << "trial " << trial;
    EXPECT_GT(reach, 0.0);
  }
  EXPECT_GT(against, 30);
}

TEST(Misbehaviour, AnArmBetweenTwoPointsOfOneLinkIsReportedAsPinchedAndStuckAndNeverHeld) {
  const auto robot = test::arm();
  Controller controller(robot, Skin{}, ControllerConfig{});
  // At its upper limit, and pushed on.
  JointVector q = JointVector::Zero(6);
  q[1] = 3.0;
  Posture posture = robot->make_posture();
  robot->update(q, posture);
  Points points(2, 3);  // on both sides of one link: away from the one is towards the other
  points.row(0) = (posture.T_WL[2] * Vector3(0.10, 0.0, 0.2)).transpose();
  points.row(1) = (posture.T_WL[2] * Vector3(-0.10, 0.0, 0.2)).transpose();
  int stuck = -1, reported = -1;
  bool pinched = false;
  for (int i = 0; i < 60; ++i) {
    const TickOutput& out = controller.tick_known(0.01 * i, q, points, posture.T_WT);
    q += 0.01 * out.qd;
    if (reported < 0 && found(controller, Reason::kNotExecuted)) reported = i;
    if (stuck < 0 && found(controller, Reason::kAvoidanceStuck)) stuck = i;
    pinched |= found(controller, Reason::kPinched);
    EXPECT_EQ(out.mode, Mode::kRun);
  }
  EXPECT_TRUE(pinched);
  ASSERT_GE(reported, 0);
  ASSERT_GE(stuck, 0);
  EXPECT_NEAR(0.01 * (stuck - reported), 0.1, 0.021);
}

TEST(Misbehaviour, AStuckPayloadDoesNotOutliveItsFaultAsAContact) {
  const auto robot = test::arm();
  Controller controller(robot, test::looking_back(), ControllerConfig{});
  const JointVector q = bent();
  const Pose goal = tool_at(*robot, q);
  Scan scan;
  scan.status.fill(255);
  for (int i = 0; i < 40; ++i) {
    scan.counter = static_cast<std::uint32_t>(i);
    scan.stamp = 0.07 * i;
    for (const std::size_t zone : {26U, 27U, 28U, 34U, 35U}) {
      scan.status[zone] = 5;
      scan.ranges[zone] = i < 20 ? 0.18 : 0.25 + 1e-3 * ((static_cast<int>(zone) + i) % 3);
    }
    const TickOutput& out = controller.tick(scan.stamp, q, std::span(&scan, 1), goal);
    if (i == 19) {
      EXPECT_TRUE(found(controller, Reason::kSensorSuspect));
    }
    if (i > 20) {  // what it sees is the arm itself
      EXPECT_FALSE(found(controller, Reason::kContact)) << i;
      EXPECT_FALSE(out.pair.has_value()) << i;
    }
  }
}

TEST(SignedDistance, IsThatOfTheUnionOfTheLinksAndItsNormalLeadsOut) {
  const auto robot = test::arm();
  Random random(34);
  Posture posture = robot->make_posture();
  int inside = 0;
  for (int i = 0; i < 2000; ++i) {
    robot->update(test::posture(random, 6), posture);
    const auto link = static_cast<std::size_t>(random.uniform(0.0, 6.999));
    const Vector3 p_W =
        posture.T_WL[link] * Vector3(random.uniform(-0.08, 0.08), random.uniform(-0.08, 0.08),
                                     random.uniform(0.02, 0.26));
    const SignedDistance found = signed_distance(*robot, posture, p_W);
    // By the parity of rays, and the unsigned search, link by link.
    double expected = kInfinity;
    for (int k = 0; k < robot->n_links(); ++k) {
      const Vector3 p_L = posture.T_WL[static_cast<std::size_t>(k)].inverse() * p_W;
      const double unsigned_distance = std::sqrt(robot->tree(k).nearest(p_L)->squared_distance);
      expected =
          std::min(expected, robot->tree(k).inside(p_L) ? -unsigned_distance : unsigned_distance);
    }
    EXPECT_NEAR(found.distance, expected, 1e-12);
    EXPECT_NEAR(found.normal_W.norm(), 1.0, 1e-9);
    EXPECT_NEAR((found.surface_W + found.distance * found.normal_W - p_W).norm(), 0.0, 1e-9);
    if (found.distance < 0.0) ++inside;
  }
  EXPECT_GT(inside, 300);
}

TEST(SignedDistance, OnTheSurfaceTheNormalStillLeadsOut) {
  const auto robot = test::arm();
  Posture posture = robot->make_posture();
  robot->update(bent(), posture);
  for (int f = 0; f < 200; ++f) {
    const MeshTree& tree = robot->tree(4);
    Vector3 middle = Vector3::Zero();
    for (int k = 0; k < 3; ++k)
      middle += Vector3(tree.vertices_L().row(tree.triangles()(f, k)).transpose()) / 3.0;
    const SignedDistance found = signed_distance(*robot, posture, posture.T_WL[4] * middle);
    if (std::abs(found.distance) > 1e-9 || found.link != 4) continue;  // inside another link
    const Vector3 normal_L = posture.T_WL[4].linear().transpose() * found.normal_W;
    EXPECT_FALSE(tree.inside(middle + 1e-5 * normal_L)) << f;
    EXPECT_TRUE(tree.inside(middle - 1e-5 * normal_L)) << f;
  }
}

}  // namespace
}  // namespace proxcgal
