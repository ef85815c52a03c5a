/// Rows that keep distances: of obstacles, and of the robot's own links.
#include <gtest/gtest.h>

#include <cmath>

#include "task_rows.hpp"

namespace proxcgal {
namespace {

using test::at;
using test::bent_arm;
using test::derivative;
using test::pair_at;
using test::Random;
using test::random_q;

TEST(Avoidance, RowIsTheDerivativeOfTheDistanceScaledToUnitNorm) {
  const Robot robot = bent_arm(6, {2});
  Random random(1);
  for (int i = 0; i < 50; ++i) {
    const JointVector q = random_q(random, 6);
    const Posture posture = at(robot, q);
    const Vector3 point_L = random.vector(0.1);
    const Vector3 obstacle_W = posture.T_WL[1] * point_L + random.vector(0.3);
    ControlPair pair = pair_at(posture, point_L, obstacle_W);
    pair.obstacle_velocity_W = Vector3(0.1, -0.2, 0.3);
    BuiltTask built;
    const Avoidance spec;
    build_avoidance(spec, robot, posture, {&pair, 1}, built);
    const RowVector slope = derivative(
        robot, q, [&](const Posture& p) { return (p.T_WL[1] * point_L - obstacle_W).norm(); });
    const double norm = slope.norm();
    EXPECT_LT((built.task.jacobian.row(0).transpose() - slope / norm).norm(), 1e-7);
    EXPECT_NEAR(built.smallest_row_norm, norm, 1e-7);
    EXPECT_NEAR(row_norm(robot, posture, pair), norm, 1e-7);
    const Vector3 normal_W = (pair.control_W - obstacle_W) / pair.distance;
    const double rate = normal_W.dot(pair.obstacle_velocity_W) + 2.0 * (0.3 - pair.distance);
    EXPECT_NEAR(built.task.rate[0], rate / norm, 1e-6);
    EXPECT_NEAR(built.task.activation[0], decreasing(pair.distance, 0.2, 0.3), 1e-12);
  }
}

TEST(Avoidance, GivesOneRowForEachPair) {
  const Robot robot = bent_arm(6);
  Random random(2);
  const Posture posture = at(robot, random_q(random, 6));
  std::vector<ControlPair> pairs(kMaxRows + 3);
  for (ControlPair& pair : pairs) {
    pair = pair_at(posture, random.vector(0.1), random.vector(1.0));
  }
  BuiltTask built;
  build_avoidance({}, robot, posture, {pairs.data(), 3}, built);
  EXPECT_EQ(built.task.jacobian.rows(), 3);
  build_avoidance({}, robot, posture, pairs, built);
  EXPECT_EQ(built.task.jacobian.rows(), kMaxRows);
  build_avoidance({}, robot, posture, {}, built);
  EXPECT_EQ(built.task.rate.size(), 0);
}

TEST(Avoidance, IsFiniteWhereThePointsCoincide) {
  const Robot robot = bent_arm(6);
  Random random(3);
  const Posture posture = at(robot, random_q(random, 6));
  ControlPair pair = pair_at(posture, Vector3::Zero(), posture.T_WL[1].translation());
  BuiltTask built;
  build_avoidance({}, robot, posture, {&pair, 1}, built);
  EXPECT_TRUE(built.task.jacobian.isZero());
  EXPECT_EQ(built.smallest_row_norm, 0.0);
  EXPECT_EQ(built.task.activation[0], 1.0);
  EXPECT_TRUE(built.task.rate.allFinite());
  pair.fallback_normal_W = Vector3::UnitX();
  build_avoidance({}, robot, posture, {&pair, 1}, built);
  EXPECT_NEAR(built.task.jacobian.row(0).norm(), 1.0, 1e-12);
}

TEST(Avoidance, ANegativeDistanceTurnsTheNormal) {
  const Robot robot = bent_arm(6);
  Random random(4);
  const Posture posture = at(robot, random_q(random, 6));
  ControlPair pair = pair_at(posture, Vector3(0.05, 0, 0), posture.T_WL[1] * Vector3(0.03, 0, 0));
  BuiltTask outside, inside;
  build_avoidance({}, robot, posture, {&pair, 1}, outside);
  pair.distance = -pair.distance;
  build_avoidance({}, robot, posture, {&pair, 1}, inside);
  EXPECT_EQ(inside.task.jacobian, -outside.task.jacobian);
  EXPECT_GT(inside.task.rate[0], outside.task.rate[0]);
}

TEST(Avoidance, ARowTooSmallToScaleIsLeftAndTold) {
  const Robot robot = bent_arm(3);
  const Posture posture = at(robot, JointVector::Zero(3));
  ControlPair pair;
  pair.link = 0;  // the base: no joint moves it
  pair.control_W = Vector3::UnitX();
  pair.distance = 1.0;
  BuiltTask built;
  build_avoidance({}, robot, posture, {&pair, 1}, built);
  EXPECT_EQ(built.smallest_row_norm, 0.0);
  EXPECT_TRUE(built.task.jacobian.isZero());
}

TEST(SelfCollision, RowIsTheDerivativeOfTheDistanceBetweenTwoPointsOfLinks) {
  const Robot robot = bent_arm(6);
  Random random(11);
  for (int i = 0; i < 30; ++i) {
    const JointVector q = random_q(random, 6);
    const Posture posture = at(robot, q);
    const int a = robot.n_links() - 1;
    const int b = 0;
    const Vector3 on_a_L = random.vector(0.1);
    const Vector3 on_b_L = random.vector(0.1);
    const auto apart = [&](const Posture& p) {
      return (p.T_WL[static_cast<std::size_t>(a)] * on_a_L -
              p.T_WL[static_cast<std::size_t>(b)] * on_b_L)
          .norm();
    };
    LinkPair pair{.a = a, .b = b};
    pair.on_a_W = posture.T_WL[static_cast<std::size_t>(a)] * on_a_L;
    pair.on_b_W = posture.T_WL[static_cast<std::size_t>(b)] * on_b_L;
    pair.distance = apart(posture);
    const SelfCollision spec{.d_min = pair.distance - 0.05, .buffer = 0.1};
    BuiltTask built;
    build_self_collision(spec, robot, posture, {&pair, 1}, built);
    const RowVector slope = derivative(robot, q, apart);
    EXPECT_LT((parting_row(robot, posture, pair) - slope).norm(), 1e-6);
    EXPECT_LT((built.task.jacobian.row(0).transpose() - slope.normalized()).norm(), 1e-6);
    EXPECT_NEAR(built.task.rate[0], 2.0 * 0.05 / slope.norm(), 1e-5);
    EXPECT_NEAR(built.task.activation[0], 0.5, 1e-9);
  }
}

TEST(SelfCollision, LinksThatCrossArePartedAlongTheFallback) {
  const Robot robot = bent_arm(6);
  Random random(12);
  const Posture posture = at(robot, random_q(random, 6));
  LinkPair pair{.a = robot.n_links() - 1, .b = 0, .distance = 0.0};
  pair.on_a_W = pair.on_b_W = Vector3(0.1, 0.2, 0.3);
  pair.fallback_normal_W = Vector3::UnitX();
  BuiltTask built;
  build_self_collision({}, robot, posture, {&pair, 1}, built);
  EXPECT_TRUE(built.task.jacobian.allFinite());
  EXPECT_GT(built.task.jacobian.norm(), 0.9);
  EXPECT_EQ(built.task.activation[0], 1.0);
}

}  // namespace
}  // namespace proxcgal
