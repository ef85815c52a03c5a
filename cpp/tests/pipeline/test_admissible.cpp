/// What a joint may do in one tick, and what a distance may ask for within that.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "stacks.hpp"

namespace proxcgal {
namespace {

using test::inside;
using test::kDt;
using test::Random;
using test::random_limits;
using test::random_stack;
using test::random_vector;
using test::row;
using test::Stack;
using test::steady_box;
using test::vector;

TEST(Admissible, LeavesJustEnoughRoomToBrake) {
  Random random(1);
  for (int i = 0; i < 2000; ++i) {
    const double room = std::pow(10.0, random.uniform(-6.0, 1.0));
    const double a = std::pow(10.0, random.uniform(-1.0, 2.0));
    const Limits limits{vector({-1e3}), vector({room}), vector({1e9}), vector({a})};
    double v = admissible(limits, vector({0.0}), vector({1e9}), kDt).steady_high[0];
    double q = 0.0;
    for (; v > 0.0; v -= a * kDt) q += v * kDt;
    EXPECT_NEAR(q, room, 1e-9 * room);
  }
}

TEST(Admissible, KeepsAJointWithinItsPositionLimitsForEver) {
  Random random(2);
  for (int arm = 0; arm < 20; ++arm) {
    const Limits limits = random_limits(random, 6);
    JointVector q = 0.99 * (arm % 2 == 0 ? limits.q_min : limits.q_max);
    JointVector qd = JointVector::Zero(6), out;
    Stack stack;
    for (int tick = 0; tick < 4000; ++tick) {
      if (tick % 50 == 0) stack = random_stack(random, 6);
      const double scale = tick % 1000 < 800 ? 1.0 : 0.3;
      const Admissible box = admissible(limits, q, qd, kDt, scale);
      command(stack.levels, stack.tasks, qd, box, out);
      ASSERT_TRUE(((out - qd).cwiseAbs().array() <= limits.qdd_max.array() * kDt + 1e-12).all());
      ASSERT_TRUE((out.cwiseAbs().array() <= limits.qd_max.array() + 1e-12).all());
      qd = out;
      q += kDt * qd;
      ASSERT_TRUE((q.array() >= limits.q_min.array() - 1e-12).all());
      ASSERT_TRUE((q.array() <= limits.q_max.array() + 1e-12).all());
    }
  }
}

TEST(Admissible, LetsAJointOutsideItsLimitsMoveInwardsOnly) {
  const Limits limits{vector({-1, -1}), vector({1, 1}), vector({2, 2}), vector({10, 10})};
  const Admissible box = admissible(limits, vector({1.2, -1.2}), vector({0, 0}), kDt);
  EXPECT_EQ(box.high[0], 0.0);
  EXPECT_LT(box.low[0], 0.0);
  EXPECT_EQ(box.low[1], 0.0);
  EXPECT_GT(box.high[1], 0.0);
}

TEST(Admissible, BrakesAsHardAsItMayWhereItIsTooLate) {
  const Limits limits{vector({-1}), vector({1}), vector({2}), vector({10})};
  const Admissible box = admissible(limits, vector({0.999}), vector({2}), kDt);
  EXPECT_DOUBLE_EQ(box.low[0], 1.9);
  EXPECT_DOUBLE_EQ(box.high[0], 1.9);
}

TEST(Admissible, IsFiniteAndOrderedWithoutSomeLimits) {
  const Limits limits{vector({-kInfinity, -1, -kInfinity}), vector({kInfinity, 1, kInfinity}),
                      vector({2, 2, kInfinity}), vector({kInfinity, kInfinity, 10})};
  const Admissible box = admissible(limits, vector({0, 0.99, 0}), vector({0, 0, 0}), kDt);
  EXPECT_LT((box.high - vector({2, 1, 0.1})).norm(), 1e-12);
  EXPECT_LT((box.low - vector({-2, -2, -0.1})).norm(), 1e-12);
}

TEST(KeepRate, ChangesNothingThatDoesNotApproach) {
  JointVector qd = vector({0.3, -0.2});
  const JointVector before = qd;
  const Admissible box = steady_box(vector({-1, -1}), vector({1, 1}));
  EXPECT_NEAR(keep_rate(vector({1.0, 1.0}), 0.0, box, qd), 0.1, 1e-12);
  EXPECT_EQ(qd, before);
}

TEST(KeepRate, IsTheNearestVelocityThatKeepsIt) {
  Random random(6);
  for (int i = 0; i < 300; ++i) {
    const JointVector direction = random_vector(random, 4, -1.0, 1.0);
    const JointVector low = random_vector(random, 4, -1.0, 0.0);
    const JointVector high = random_vector(random, 4, 0.0, 1.0);
    JointVector before(4);
    for (Eigen::Index j = 0; j < 4; ++j) before[j] = random.uniform(low[j], high[j]);
    const double least = random.uniform(-0.5, 0.5);
    JointVector qd = before;
    const double kept = keep_rate(direction, least, steady_box(low, high), qd);
    double most = 0.0;
    for (Eigen::Index j = 0; j < 4; ++j) {
      most += std::max(direction[j] * low[j], direction[j] * high[j]);
    }
    EXPECT_GE(kept, std::min(least, most) - 1e-12);
    for (int other = 0; other < 200; ++other) {
      JointVector candidate(4);
      for (Eigen::Index j = 0; j < 4; ++j) candidate[j] = random.uniform(low[j], high[j]);
      if (direction.dot(candidate) < least) continue;
      EXPECT_GE((candidate - before).norm(), (qd - before).norm() - 1e-9);
    }
  }
}

TEST(CatchUp, GivesADistanceItsRateThoughAnotherJointIsSlow) {
  const std::vector<JointVector> levels{vector({0.1, 3.0}), vector({0.1, 3.0})};
  const Admissible box{vector({-0.1, -0.1}), vector({0.1, 0.1}), vector({-4, -4}), vector({4, 4})};
  const Task distance = row({1.0, 0.0}, 0.1);
  JointVector qd;
  command(levels, {&distance, 1}, vector({0.0, 0.0}), box, qd);
  EXPECT_NEAR(qd[0], 0.1 / 30.0, 1e-12);  // its share of the way that joint 2 still has to go
  JointVector half = qd;
  catch_up(levels, distance, box, qd);
  EXPECT_NEAR(qd[0], 0.1, 1e-12);
  EXPECT_NEAR(qd[1], 0.1, 1e-12);
  catch_up(levels, row({1.0, 0.0}, 0.1, 0.5), box, half);
  EXPECT_NEAR(half[0], 0.5 * (0.1 + 0.1 / 30.0), 1e-12);
}

TEST(CatchUp, NeverLeavesTheBoxNorLowersTheFirstRow) {
  Random random(12);
  for (int trial = 0; trial < 2000; ++trial) {
    const Eigen::Index n = 7;
    const std::vector<JointVector> levels{random_vector(random, n, -3, 3),
                                          random_vector(random, n, -3, 3)};
    const JointVector low = random_vector(random, n, -1, 0), high = random_vector(random, n, 0, 1);
    const Admissible box{low, high, 3.0 * low, 3.0 * high};
    Task task;
    task.jacobian = TaskJacobian(3, n);
    for (Eigen::Index i = 0; i < 3; ++i)
      task.jacobian.row(i) = random_vector(random, n, -1, 1).transpose();
    task.rate = RowVector::Zero(3);
    task.activation = random_vector(random, 3, 0, 1);
    const JointVector before = random_vector(random, n, 0, 1).cwiseProduct(high - low) + low;
    JointVector qd = before;
    catch_up(levels, task, box, qd);
    EXPECT_GE(task.jacobian.row(0).dot(qd), task.jacobian.row(0).dot(before) - 1e-12);
    ASSERT_TRUE(inside(qd, box));
    task.activation.setZero();
    qd = before;
    catch_up(levels, task, box, qd);
    EXPECT_EQ(qd, before);
  }
}

}  // namespace
}  // namespace proxcgal
