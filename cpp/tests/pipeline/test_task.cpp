#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "allocations.hpp"
#include "proxcgal/error.hpp"
#include "task_rows.hpp"

namespace proxcgal {
namespace {

using test::at;
using test::bent_arm;
using test::derivative;
using test::pair_at;
using test::Random;
using test::random_q;

double manipulability(const Robot& robot, const Posture& posture, int first, int size) {
  Jacobian6 J;
  robot.tool_jacobian(posture, J);
  const auto columns = J.middleCols(first, size);
  return std::sqrt(std::max((columns * columns.transpose()).determinant(), 0.0));
}

TEST(Bells, GoFromOneToZeroWithoutAStep) {
  EXPECT_EQ(decreasing(0.19, 0.2, 0.3), 1.0);
  EXPECT_EQ(decreasing(0.31, 0.2, 0.3), 0.0);
  EXPECT_NEAR(decreasing(0.25, 0.2, 0.3), 0.5, 1e-12);
  EXPECT_NEAR(decreasing(0.2 + 1e-9, 0.2, 0.3), 1.0, 1e-12);
  EXPECT_NEAR(increasing(0.225, 0.2, 0.3), 0.5 - std::sqrt(0.125), 1e-12);
}

TEST(Reach, PullsStraightToTheGoalWithinItsBounds) {
  const Robot robot = bent_arm(6);
  Random random(5);
  const Posture posture = at(robot, random_q(random, 6));
  Pose goal = posture.T_WT;
  goal.translation() += Vector3(0.3, 0.0, -0.4);
  goal.linear() = Eigen::AngleAxisd(1.0, Vector3::UnitY()) * goal.linear();
  BuiltTask built;
  build_reach({}, robot, posture, goal, built);
  RowVector expected(6);
  expected << 0.15, 0.0, -0.2, 0.0, 0.5, 0.0;
  EXPECT_LT((built.task.rate - expected).norm(), 1e-9);
  EXPECT_EQ(built.task.activation, RowVector::Ones(6));
  goal = posture.T_WT;
  goal.translation().x() += 0.1;
  build_reach({}, robot, posture, goal, built);
  EXPECT_NEAR(built.task.rate[0], 0.1, 1e-12);
  Jacobian6 J;
  robot.tool_jacobian(posture, J);
  EXPECT_EQ(Eigen::MatrixXd(built.task.jacobian), Eigen::MatrixXd(J));
}

TEST(Reach, ForHalfOfTheGoalIsHalfOfItsRows) {
  const Robot robot = bent_arm(6);
  Random random(41);
  const Posture posture = at(robot, random_q(random, 6));
  Pose goal = posture.T_WT;
  goal.translation() += Vector3(0.1, -0.2, 0.3);
  goal.linear() = goal.linear() * Eigen::AngleAxisd(0.4, Vector3::UnitX()).toRotationMatrix();
  BuiltTask whole, half;
  build_reach({}, robot, posture, goal, whole);
  for (const auto& [rows, first] :
       {std::pair{ReachRows::kPosition, 0}, {ReachRows::kOrientation, 3}}) {
    Reach spec;
    spec.rows = rows;
    build_reach(spec, robot, posture, goal, half);
    EXPECT_EQ(Eigen::MatrixXd(half.task.jacobian),
              Eigen::MatrixXd(whole.task.jacobian.middleRows(first, 3)));
    EXPECT_EQ(half.task.rate, whole.task.rate.segment(first, 3));
    EXPECT_EQ(half.task.activation.size(), 3);
  }
}

TEST(RotationError, TurnsOneFrameIntoTheOtherUpToAHalfTurn) {
  Random random(6);
  const double pi = std::numbers::pi;
  for (const double angle :
       {0.0, 1e-12, 1e-7, 1e-3, 1.0, 3.0, pi - 1e-3, pi - 1e-7, pi - 1e-12, pi}) {
    for (int i = 0; i < 50; ++i) {
      const Vector3 axis = random.vector(1.0).normalized();
      const Eigen::Matrix3d from = random.pose(1.0).linear();
      const Eigen::Matrix3d to = Eigen::AngleAxisd(angle, axis) * from;
      const Vector3 turn = rotation_error(from, to);
      EXPECT_NEAR(turn.norm(), angle, 1e-7);
      const Eigen::Matrix3d back =
          Eigen::AngleAxisd(turn.norm(), turn.stableNormalized()).toRotationMatrix() * from;
      EXPECT_LT((back - to).norm(), 1e-7);
      if (angle > 1e-3 && angle < 3.1) {
        EXPECT_LT((turn - angle * axis).norm(), 1e-7);
      }
    }
  }
  for (const Vector3 axis : {Vector3::UnitX(), Vector3::UnitY(), Vector3::UnitZ()}) {
    const Eigen::Matrix3d half = 2.0 * axis * axis.transpose() - Eigen::Matrix3d::Identity();
    EXPECT_LT((rotation_error(Eigen::Matrix3d::Identity(), half).cwiseAbs() - pi * axis).norm(),
              1e-9);
  }
}

TEST(JointLimits, PullToTheMiddleNearALimitOnly) {
  const Robot robot = bent_arm(4);  // -2 to 3
  JointVector q(4);
  q << 0.0, 2.85, -2.0, 3.5;
  BuiltTask built;
  build_joint_limits({}, robot, at(robot, q), built);
  const double activation[] = {0.0, 0.5, 1.0, 1.0};
  for (int j = 0; j < 4; ++j) {
    EXPECT_NEAR(built.task.rate[j], 0.2 * (0.5 - q[j]), 1e-12);
    EXPECT_NEAR(built.task.activation[j], activation[j], 1e-12);
  }
  EXPECT_EQ(built.task.jacobian, TaskJacobian::Identity(4, 4));
}

TEST(JointLimits, LeaveAJointWithoutLimitsAlone) {
  RobotSpec spec = bent_arm(3).spec();
  spec.joints[0].q_min = -kInfinity;
  spec.joints[0].q_max = kInfinity;
  spec.joints[1].q_min = -kInfinity;
  spec.joints[2].q_max = kInfinity;
  const Robot robot(spec);
  JointVector q(3);
  q << 50.0, 2.9, -1.9;
  BuiltTask built;
  build_joint_limits({}, robot, at(robot, q), built);
  EXPECT_EQ(built.task.rate[0], 0.0);
  EXPECT_EQ(built.task.activation[0], 0.0);
  EXPECT_NEAR(built.task.rate[1], 0.2 * (2.7 - 2.9), 1e-12);
  EXPECT_NEAR(built.task.activation[1], increasing(2.9, 2.7, 3.0), 1e-12);
  EXPECT_NEAR(built.task.rate[2], 0.2 * (-1.7 + 1.9), 1e-12);
  EXPECT_NEAR(built.task.activation[2], decreasing(-1.9, -2.0, -1.7), 1e-12);
}

TEST(MinimumAltitude, RowIsTheDerivativeOfTheToolsHeight) {
  const Robot robot = bent_arm(6);
  Random random(7);
  const JointVector q = random_q(random, 6);
  const Posture posture = at(robot, q);
  const double z = posture.T_WT.translation().z();
  MinimumAltitude spec;
  spec.height = z - 0.05;
  BuiltTask built;
  build_minimum_altitude(spec, robot, posture, built);
  const RowVector slope =
      derivative(robot, q, [](const Posture& p) { return p.T_WT.translation().z(); });
  EXPECT_LT((built.task.jacobian.row(0).transpose() - slope.normalized()).norm(), 1e-7);
  EXPECT_NEAR(built.task.rate[0], 0.5 * 0.05 / slope.norm(), 1e-7);
  EXPECT_NEAR(built.task.activation[0], 0.5, 1e-9);
}

TEST(Manipulability, RowIsItsDerivative) {
  Random random(8);
  for (const auto& sliding : {std::vector<int>{}, std::vector<int>{0, 3}, std::vector<int>{6}}) {
    const Robot robot = bent_arm(7, sliding);
    for (int i = 0; i < 20; ++i) {
      const JointVector q = random_q(random, 7);
      const Posture posture = at(robot, q);
      const double mu = manipulability(robot, posture, 0, 7);
      BuiltTask built;
      const Manipulability spec;
      build_manipulability(spec, robot, posture, built);
      const RowVector slope =
          derivative(robot, q, [&](const Posture& p) { return manipulability(robot, p, 0, 7); });
      EXPECT_NEAR(built.smallest_row_norm, slope.norm(), 1e-6);
      EXPECT_LT((built.task.jacobian.row(0).transpose() - slope.normalized()).norm(), 1e-4);
      EXPECT_NEAR(built.task.rate[0] * slope.norm(), 0.1 * (0.12 - mu), 1e-5);
      EXPECT_NEAR(built.task.activation[0], decreasing(mu, 0.02, 0.05), 1e-6);
    }
  }
}

TEST(Manipulability, OfTheSecondArmDependsOnItsOwnJointsOnly) {
  const Robot robot = bent_arm(12);
  Random random(9);
  const JointVector q = random_q(random, 12);
  const Posture posture = at(robot, q);
  Manipulability spec;
  spec.first_joint = 6;
  BuiltTask built;
  build_manipulability(spec, robot, posture, built);
  const RowVector slope =
      derivative(robot, q, [&](const Posture& p) { return manipulability(robot, p, 6, 6); });
  EXPECT_LT((built.task.jacobian.row(0).transpose() - slope.normalized()).norm(), 1e-4);
  EXPECT_LT(built.task.jacobian.leftCols(6).norm(), 1e-9);
  spec = {};
  spec.joints = 6;
  build_manipulability(spec, robot, posture, built);
  EXPECT_LT(built.task.jacobian.rightCols(6).norm(), 1e-9);
}

TEST(Manipulability, LeadsOutOfASingularPosture) {
  // Two aligned axes: a wrist with its middle joint straight.
  RobotSpec spec = bent_arm(6).spec();
  for (std::size_t j = 4; j < 6; ++j) spec.joints[j].origin = Pose::Identity();
  const Vector3 axes[] = {Vector3::UnitZ(), Vector3::UnitY(), Vector3::UnitY(),
                          Vector3::UnitZ(), Vector3::UnitY(), Vector3::UnitZ()};
  for (std::size_t j = 0; j < 6; ++j) spec.joints[j].axis = axes[j];
  const Robot robot(spec);
  JointVector q(6);
  q << 0.3, 0.5, 1.0, 0.2, 0.0, 0.4;
  BuiltTask built;
  build_manipulability({}, robot, at(robot, q), built);
  EXPECT_EQ(built.task.activation[0], 1.0);
  ASSERT_TRUE(built.task.jacobian.allFinite());
  EXPECT_NEAR(std::abs(built.task.jacobian(0, 4)), 1.0, 1e-9);
}

TEST(Manipulability, NeedsSixJoints) {
  const Robot robot = bent_arm(5);
  BuiltTask built;
  build_manipulability({}, robot, at(robot, JointVector::Zero(5)), built);
  EXPECT_TRUE(built.task.jacobian.isZero());
  EXPECT_EQ(built.smallest_row_norm, 0.0);
  EXPECT_THROW(validate(TaskSpec{Manipulability{}}, robot), ConfigError);
  EXPECT_THROW(validate(TaskSpec{Manipulability{.first_joint = 1}}, bent_arm(6)), ConfigError);
  EXPECT_NO_THROW(validate(TaskSpec{Manipulability{}}, bent_arm(6)));
}

TEST(TaskSpec, NamesTheFieldItsValueAndItsBound) {
  const TaskSpec bad[] = {Avoidance{.d_min = -0.1},
                          Avoidance{.buffer = 0.0},
                          Avoidance{.gain = kInfinity},
                          Avoidance{.nearest = 0},
                          Reach{.gain = 0.0},
                          Reach{.max_linear = -1.0},
                          Reach{.max_angular = std::nan("")},
                          JointLimits{.gain = 0.0},
                          JointLimits{.margin = 0.0},
                          MinimumAltitude{.height = kInfinity},
                          MinimumAltitude{.buffer = -1.0},
                          Manipulability{.low = 0.1},
                          Manipulability{.joints = 3}};
  for (const TaskSpec& spec : bad) EXPECT_THROW(validate(spec), ConfigError);
  try {
    validate(TaskSpec{Avoidance{.d_min = -0.25}});
    FAIL();
  } catch (const ConfigError& error) {
    EXPECT_STREQ(error.what(), "Avoidance.d_min is -0.25 m, must be finite and at least 0 m");
  }
}

TEST(Tasks, AllocateNothing) {
  const Robot robot = bent_arm(7);
  Random random(10);
  const Posture posture = at(robot, random_q(random, 7));
  const ControlPair pair = pair_at(posture, Vector3(0.05, 0, 0), Vector3(0.1, 0.1, 0.1));
  BuiltTask built;
  const test::CountAllocations counter;
  build_avoidance({}, robot, posture, {&pair, 1}, built);
  build_reach({}, robot, posture, Pose::Identity(), built);
  build_joint_limits({}, robot, posture, built);
  build_minimum_altitude({}, robot, posture, built);
  build_manipulability({}, robot, posture, built);
  const LinkPair links{.a = 1, .b = 0, .on_a_W = Vector3::UnitX(), .distance = 0.1};
  build_self_collision({}, robot, posture, {&links, 1}, built);
  EXPECT_EQ(counter.count(), 0U);
}

}  // namespace
}  // namespace proxcgal
