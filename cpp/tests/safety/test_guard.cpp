#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "allocations.hpp"
#include "guards.hpp"
#include "proxcgal/error.hpp"

namespace proxcgal {
namespace {

using test::Random;

TEST(Guard, BoundsAreEquationsOneAndTwo) {
  const auto robot = test::arm();
  const GuardConfig config = test::guard_config(*robot);
  Posture posture = robot->make_posture();
  robot->update(config.q_reference, posture);
  Jacobian6 J;
  robot->tool_jacobian(posture, J);
  const JointVector qd_max = JointVector::Constant(6, 3.0), qdd_max = JointVector::Constant(6, 8.0);
  const SafetyLimits found = basic_limits(*robot, config.q_reference, 1.3, qd_max, qdd_max, 0.35);
  for (int k = 0; k < 6; ++k) {
    const double lever = std::sqrt(J(0, k) * J(0, k) + J(1, k) * J(1, k) + J(2, k) * J(2, k));
    const double qd = lever > 0.0 ? std::min(3.0, 1.3 / lever) : 3.0;
    EXPECT_DOUBLE_EQ(found.qd[k], qd);
    EXPECT_DOUBLE_EQ(found.qdd[k], std::min(8.0, qd / 0.35));
  }
}

TEST(Guard, AJointThatDoesNotMoveTheToolKeepsItsMaximum) {
  const auto robot = test::arm();
  const JointVector straight = JointVector::Zero(6);  // the last joint's axis goes through the tool
  const JointVector most = JointVector::Constant(6, 3.0);
  EXPECT_DOUBLE_EQ(basic_limits(*robot, straight, 1.3, most, most, 0.35).qd[5], 3.0);
}

TEST(Guard, RefusesWhatContradictsItselfItemByItem) {
  const auto robot = test::arm();
  GuardConfig config = test::guard_config(*robot);
  config.separation.min_distance = 0.40;
  config.separation.pairs = {"link1", "link6"};
  config.qdd_max = JointVector::Constant(6, 10.0);
  config.qdd_max[5] = 1.0;
  const auto told = [&]() -> std::string {
    try {
      const Guard guard(robot, config);
      return "";
    } catch (const ConfigError& error) {
      return error.what();
    }
  };
  const std::string all = told();
  for (const char* item :
       {"stopping_distance", "closing_distance", "joint_stop.joint6", "pair.link6"})
    EXPECT_NE(all.find(item), std::string::npos) << all;
  config.accept = {"stopping_distance", "closing_distance", "pair.link6"};
  EXPECT_NE(told().find("joint_stop.joint6"), std::string::npos);
  EXPECT_EQ(told().find("pair.link6"), std::string::npos);
  config.accept.emplace_back("joint_stop.joint6");
  EXPECT_EQ(told(), "");
  EXPECT_EQ(Guard(robot, config).accepted().size(), 4U);
  config.accept.emplace_back("pair.link1");
  EXPECT_NE(told().find("accept names pair.link1"), std::string::npos);
}

TEST(Guard, PaperThresholdIsExactlyWhatItsSpeedNeeds) {
  const auto robot = test::arm();
  for (const Contradiction& each : contradictions(*robot, test::guard_config(*robot)))
    EXPECT_EQ(each.item.find("distance"), std::string::npos) << each.text;
}

TEST(Separation, WhatIsNoNumberIsNeverFine) {
  const auto robot = test::arm();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  GuardConfig config = test::guard_config(*robot);
  config.separation.min_distance = 0.0;
  for (int place = 0; place < 6; ++place) {
    const auto link = static_cast<std::size_t>(1 + place / 3);  // of two pairs that are watched
    Separation separation(*robot, config.capsules, config.separation, 0.35);
    Posture posture = robot->make_posture();
    const JointVector rest = JointVector::Zero(6);
    robot->update(JointVector::Constant(6, 0.3), posture);
    const SeparationOutput& out = separation.update(*robot, posture, rest, Vector3::Zero());
    ASSERT_TRUE(out.distance_ok);
    ASSERT_TRUE(out.velocity_ok);
    posture.T_WL[link].translation()[place % 3] = nan;
    separation.update(*robot, posture, rest, Vector3::Zero());
    EXPECT_FALSE(out.distance_ok) << "link " << link << ", axis " << place % 3;
    EXPECT_FALSE(out.velocity_ok) << "link " << link << ", axis " << place % 3;
  }
}

TEST(Guard, PosturesAreDrawnWithinTheJointsLimitsWhereverThoseLie) {
  // Upright all over its range, so that the operator stands above its base; between half a turn and
  // that range it would reach out far.
  RobotSpec spec = test::arm()->spec();
  spec.joints[1].q_min = 6.2;
  spec.joints[1].q_max = 6.3;
  for (std::size_t j = 2; j < 6; ++j) {
    spec.joints[j].q_min = -0.01;
    spec.joints[j].q_max = 0.01;
  }
  const auto robot = std::make_shared<Robot>(std::move(spec));
  GuardConfig config = test::guard_config(*robot);
  config.q_reference = JointVector::Zero(6);
  config.q_reference[1] = 6.25;
  config.separation.pairs = {"link1"};
  Separation separation(*robot, config.capsules, config.separation, 0.35);
  double most = 0.0;
  Posture posture = robot->make_posture();
  for (int i = 0; i <= 100; ++i) {
    JointVector q = JointVector::Zero(6);
    q[1] = 6.2 + 0.001 * i;
    robot->update(q, posture);
    most = std::max(most, separation.distance(separation.pairs().front(), posture));
  }
  ASSERT_GT(most, 0.0);
  config.separation.min_distance = most + 0.05;
  const auto told = [&] {
    std::string items;
    for (const Contradiction& each : contradictions(*robot, config)) items += each.item + " ";
    return items;
  };
  EXPECT_NE(told().find("pair.link1"), std::string::npos);
  config.separation.min_distance = most - 0.05;
  EXPECT_EQ(told().find("pair.link1"), std::string::npos);
}

TEST(Guard, ProtectiveDistanceAgreesWithTheWorkedCheck) {
  EXPECT_NEAR(protective_distance({1.6, 0.1, 0.2, 0.15, 0.0}, 1.0, 0.3), 1.24, 1e-12);
}

TEST(Guard, AnyNumberThatIsNotFiniteCutsTheTorque) {
  const auto robot = test::arm();
  GuardConfig config = test::guard_config(*robot);
  config.separation.min_distance = 0.0;
  config.timing.stop_time = 1.0;
  config.accept = {"stopping_distance", "closing_distance"};
  for (int place = 0; place < 13; ++place) {
    Guard guard(robot, config);
    JointVector q = JointVector::Constant(6, 0.3), qd = JointVector::Zero(6);
    guard.cycle(0.000, q, qd, false);
    ASSERT_TRUE(guard.cycle(0.001, q, qd, true).safety.torque);
    double time = 0.002;
    (place < 6    ? q[place]
     : place < 12 ? qd[place - 6]
                  : time) = std::numeric_limits<double>::quiet_NaN();
    const GuardOutput& out = guard.cycle(time, q, qd, false);
    EXPECT_FALSE(out.safety.torque);
    EXPECT_EQ(out.safety.trip.function, SafetyFunction::kInput);
  }
}

TEST(Guard, CycleAllocatesNothing) {
  const auto robot = test::arm();
  GuardConfig config = test::guard_config(*robot);
  Guard guard(robot, config);
  Random random(5);
  JointVector q = test::posture(random, 6), qd = JointVector::Zero(6);
  guard.cycle(0.0, q, qd, false);
  const test::CountAllocations allocations;
  for (int i = 1; i < 2000; ++i) {
    q[i % 6] += 1e-4;
    guard.cycle(0.001 * i, q, qd, i % 7 == 0);
  }
  EXPECT_EQ(allocations.count(), 0U);
}

}  // namespace
}  // namespace proxcgal
