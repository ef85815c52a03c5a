#include <gtest/gtest.h>

#include <vector>

#include "allocations.hpp"
#include "stacks.hpp"

namespace proxcgal {
namespace {

using test::inside;
using test::joints;
using test::kDt;
using test::Random;
using test::random_limits;
using test::random_stack;
using test::random_vector;
using test::row;
using test::Stack;
using test::steady_box;
using test::vector;

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
