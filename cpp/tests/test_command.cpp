#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "allocations.hpp"
#include "meshes.hpp"
#include "proxcgal/pipeline/command.hpp"

namespace proxcgal {
namespace {

using test::Random;
constexpr double kDt = 0.01;

JointVector vector(std::initializer_list<double> values) {
  JointVector out(static_cast<Eigen::Index>(values.size()));
  std::copy(values.begin(), values.end(), out.data());
  return out;
}

JointVector random_vector(Random& random, Eigen::Index n, double low, double high) {
  JointVector out(n);
  for (double& value : out) value = random.uniform(low, high);
  return out;
}

Limits random_limits(Random& random, Eigen::Index n) {
  return {random_vector(random, n, -3.0, -0.5), random_vector(random, n, 0.5, 3.0),
          random_vector(random, n, 0.5, 3.0), random_vector(random, n, 1.0, 20.0)};
}

/// Bounds that are the same now and in the long run: as if nothing limited the acceleration.
Admissible steady_box(const JointVector& low, const JointVector& high) {
  return {low, high, low, high};
}

Task row(std::initializer_list<double> values, double rate, double activation = 1.0) {
  Task out;
  out.jacobian = vector(values).transpose();
  out.rate = RowVector::Constant(1, rate);
  out.activation = RowVector::Constant(1, activation);
  return out;
}

Task joints(const JointVector& rate) {
  Task out;
  out.jacobian = TaskJacobian::Identity(rate.size(), rate.size());
  out.rate = rate;
  out.activation = RowVector::Ones(rate.size());
  return out;
}

bool inside(const JointVector& qd, const Admissible& box) {
  return (qd.array() >= box.low.array()).all() && (qd.array() <= box.high.array()).all();
}

/// Levels as a solver may give them, of any size, and tasks that want something else.
struct Stack {
  std::vector<JointVector> levels;
  std::vector<Task> tasks;
};

Stack random_stack(Random& random, Eigen::Index n) {
  Stack out;
  JointVector sum = JointVector::Zero(n);
  for (int k = 0; k < 4; ++k) {
    sum += std::pow(10.0, random.uniform(-3.0, 1.0)) * random_vector(random, n, -1.0, 1.0);
    out.levels.push_back(sum);
    if (k < 3) {
      Task task = joints(random_vector(random, n, -2.0, 2.0));
      task.activation = random_vector(random, n, -0.5, 1.0).cwiseMax(0.0);
      out.tasks.push_back(task);
    }
  }
  return out;
}

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

TEST(Command, IsTheWholeSolutionWhereItFits) {
  Random random(3);
  for (int i = 0; i < 200; ++i) {
    const Stack stack = random_stack(random, 6);
    const JointVector& whole = stack.levels.back();
    const JointVector margin = random_vector(random, 6, 0.0, 1.0);
    JointVector out;
    command(stack.levels, stack.tasks, whole, steady_box(whole - margin, whole + margin), out);
    EXPECT_EQ(out, whole);
  }
}

TEST(Command, IsAlwaysAdmissible) {
  Random random(4);
  for (int i = 0; i < 20000; ++i) {
    const Limits limits = random_limits(random, 6);
    const Stack stack = random_stack(random, 6);
    const JointVector q = random_vector(random, 6, -4.0, 4.0);
    const JointVector last = random_vector(random, 6, -3.0, 3.0);
    const Admissible box = admissible(limits, q, last, kDt, random.uniform(0.0, 1.0));
    ASSERT_TRUE((box.low.array() <= box.high.array()).all());
    JointVector out;
    command(stack.levels, stack.tasks, last, box, out);
    ASSERT_TRUE(inside(out, box));
    decelerate(last, box, out);
    ASSERT_TRUE(inside(out, box));
    const JointVector direction = random_vector(random, 6, -1.0, 1.0);
    keep_rate(direction, 0.0, box, out);
    ASSERT_TRUE(inside(out, box));
  }
}

TEST(Command, NeverClipsOneJointAlone) {
  Random random(5);
  int scaled = 0;
  for (int i = 0; i < 2000; ++i) {
    const JointVector target = random_vector(random, 6, -3.0, 3.0);
    const JointVector last = random_vector(random, 6, -0.5, 0.5);
    const Limits limits = random_limits(random, 6);
    const Admissible box = admissible(limits, JointVector::Zero(6), last, kDt);
    const std::vector<JointVector> levels = {target, target};
    const std::vector<Task> tasks = {joints(target)};
    JointVector out;
    command(levels, tasks, last, box, out);
    // On the plane of what was and what is wished: last + s (sigma target - last).
    Eigen::Matrix<double, 6, 2> plane;
    plane << last, target;
    const Eigen::Vector2d parts = plane.colPivHouseholderQr().solve(Eigen::VectorXd(out));
    EXPECT_LT((plane * parts - out).norm(), 1e-9);
    EXPECT_GE(parts.minCoeff(), -1e-12);
    EXPECT_LE(parts.sum(), 1.0 + 1e-12);
    scaled += parts[1] < 0.999 ? 1 : 0;
  }
  EXPECT_GT(scaled, 1000);
}

TEST(Command, ShrinksTheLowestLevelFirst) {
  const std::vector<JointVector> levels = {vector({0.5, 0.0}), vector({2.5, 1.0}),
                                           vector({2.5, 1.0})};
  const std::vector<Task> tasks = {row({1.0, 0.0}, 0.5), joints(vector({2.5, 1.0}))};
  JointVector out;
  command(levels, tasks, vector({0, 0}), steady_box(vector({-1, -1}), vector({1, 1})), out);
  EXPECT_LT((out - vector({1.0, 0.25})).norm(), 1e-12);  // a quarter of level 2
}

TEST(Command, ScalesTheWholeWhereTheFirstLevelAloneIsTooMuch) {
  const std::vector<JointVector> levels = {vector({2.0, 1.0}), vector({3.0, -5.0}),
                                           vector({3.0, -5.0})};
  const std::vector<Task> tasks = {row({1.0, 0.0}, 2.0), joints(vector({3.0, -5.0}))};
  JointVector out;
  command(levels, tasks, vector({0, 0}), steady_box(vector({-1, -1}), vector({1, 1})), out);
  EXPECT_LT((out - vector({1.0, 0.5})).norm(), 1e-12);
}

TEST(Command, AnInactiveUpperTaskDoesNotHoldTheArmBack) {
  const JointVector wish = vector({1.0, 0.4});
  const std::vector<JointVector> levels = {vector({0, 0}), wish, wish};
  const std::vector<Task> tasks = {row({1.0, 0.0}, -3.0, 0.0), joints(wish)};
  const Limits limits{vector({-9, -9}), vector({9, 9}), vector({2, 2}), vector({10, 10})};
  JointVector qd = vector({0, 0}), out;
  for (int tick = 1; tick <= 10; ++tick) {
    command(levels, tasks, qd, admissible(limits, vector({0, 0}), qd, kDt), out);
    qd = out;
    EXPECT_LT((qd - 0.1 * tick * wish).norm(), 1e-12);  // joint 0 speeds up as fast as it may
  }
}

TEST(Command, LeavesLowerLevelsOutWhereTheySlowDownTheFirst) {
  // Joint 1, which level 2 wants the other way round, is slow to turn; level 1 needs joint 0 only.
  const std::vector<JointVector> levels = {vector({0.1, 0.0}), vector({0.1, -1.0}),
                                           vector({0.1, -1.0})};
  const std::vector<Task> tasks = {row({1.0, 0.0}, 0.1), joints(vector({0.0, -1.0}))};
  const Limits limits{vector({-9, -9}), vector({9, 9}), vector({2, 2}), vector({10, 1})};
  const Admissible box = admissible(limits, vector({0, 0}), vector({0, 0}), kDt);
  JointVector out;
  command(levels, tasks, vector({0, 0}), box, out);
  EXPECT_LT((out - vector({0.1, -0.01})).norm(), 1e-12);
}

TEST(Command, TheWholeArmSlowsDownWithAJointThatNearsItsLimit) {
  const JointVector wish = vector({1.0, -0.5});
  const std::vector<JointVector> levels = {wish, wish};
  const std::vector<Task> tasks = {joints(wish)};
  const Limits limits{vector({-9, -9}), vector({1, 9}), vector({2, 2}), vector({10, 10})};
  JointVector q = vector({0, 0}), qd = vector({0, 0}), out;
  for (int tick = 0; tick < 300; ++tick) {
    command(levels, tasks, qd, admissible(limits, q, qd, kDt), out);
    qd = out;
    q += kDt * qd;
    EXPECT_NEAR(qd[1], -0.5 * qd[0], 1e-9);
  }
  EXPECT_NEAR(q[0], 1.0, 1e-6);
  EXPECT_NEAR(qd.norm(), 0.0, 1e-6);
}

TEST(Decelerate, ComesToRestOnAStraightLineAndStays) {
  const Limits limits{vector({-9, -9}), vector({9, 9}), vector({2, 2}), vector({10, 4})};
  const JointVector start = vector({1.5, -0.4});
  JointVector qd = start, out;
  for (int tick = 0; tick < 15; ++tick) {
    EXPECT_NEAR(qd[0] * start[1], qd[1] * start[0], 1e-12);
    decelerate(qd, admissible(limits, vector({0, 0}), qd, kDt), out);
    qd = out;
  }
  EXPECT_EQ(qd, vector({0, 0}));
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

TEST(Command, AllocatesNothing) {
  Random random(7);
  const Limits limits = random_limits(random, 12);
  const Stack stack = random_stack(random, 12);
  JointVector qd = JointVector::Zero(12), out;
  const JointVector direction = random_vector(random, 12, -1.0, 1.0);
  const test::CountAllocations counter;
  for (int i = 0; i < 100; ++i) {
    const Admissible box = admissible(limits, JointVector::Zero(12), qd, kDt);
    command(stack.levels, stack.tasks, qd, box, out);
    keep_rate(direction, 0.1, box, out);
    for (const Task& task : stack.tasks) catch_up(stack.levels, task, box, out);
    qd = out;
    decelerate(qd, box, out);
  }
  EXPECT_EQ(counter.count(), 0U);
}

}  // namespace
}  // namespace proxcgal
