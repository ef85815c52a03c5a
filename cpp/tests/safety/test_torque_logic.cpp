#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "meshes.hpp"
#include "proxcgal/safety/torque_logic.hpp"

namespace proxcgal {
namespace {

using test::Random;

SafetyLimits limits(double speed = 1.0, double acceleration = 3.0) {
  return {1.3, JointVector::Constant(2, speed), JointVector::Constant(2, acceleration)};
}

/// Fine in every way, at rest.
SafetyInput fine(double time, bool reset = false) {
  SafetyInput input;
  input.time = time;
  input.qd = JointVector::Zero(2);
  input.distance_ok = input.velocity_ok = input.finite = true;
  input.distance = input.min_distance = 0.5;
  input.reset = reset;
  return input;
}

/// One whose torque is on, at `time`.
SafetyLogic running(double time = 0.003) {
  SafetyLogic logic(limits(), {});
  logic.cycle(fine(time - 0.002));
  logic.cycle(fine(time - 0.001, true));
  EXPECT_TRUE(logic.cycle(fine(time)).torque);
  return logic;
}

TEST(SafetyLogic, TorqueIsOffAtTheStartUntilTheResetGoesDown) {
  SafetyLogic logic(limits(), {});
  EXPECT_FALSE(logic.cycle(fine(0.000, true)).torque) << "a button that is down at the start";
  EXPECT_FALSE(logic.cycle(fine(0.001, true)).torque);
  EXPECT_FALSE(logic.cycle(fine(0.002, false)).torque);
  EXPECT_TRUE(logic.cycle(fine(0.003, true)).torque);
  EXPECT_TRUE(logic.cycle(fine(0.004, false)).torque);
}

TEST(SafetyLogic, EveryViolationCutsTheTorqueInItsOwnCycle) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto trips = [](SafetyFunction function, const auto& change) {
    SafetyLogic logic = running();
    SafetyInput input = fine(0.004);
    change(input);
    const SafetyOutput& out = logic.cycle(input);
    EXPECT_FALSE(out.torque) << function_name(function);
    EXPECT_EQ(out.state, TorqueState::kStopping);
    EXPECT_EQ(function_name(out.trip.function), std::string(function_name(function)));
    EXPECT_EQ(out.trips, 1);
  };
  trips(SafetyFunction::kInput, [](SafetyInput& in) { in.finite = false; });
  trips(SafetyFunction::kCycle, [](SafetyInput& in) { in.time = 0.010; });
  trips(SafetyFunction::kCycle, [](SafetyInput& in) { in.time = 0.003; });
  trips(SafetyFunction::kTcpSpeed, [](SafetyInput& in) { in.tcp_speed = 1.301; });
  trips(SafetyFunction::kTcpSpeed, [=](SafetyInput& in) { in.tcp_speed = nan; });
  trips(SafetyFunction::kJointSpeed, [](SafetyInput& in) { in.qd[1] = -1.001; });
  trips(SafetyFunction::kJointAcceleration, [](SafetyInput& in) { in.qd[0] = 0.004; });
  trips(SafetyFunction::kDistance, [](SafetyInput& in) { in.distance_ok = false; });
  trips(SafetyFunction::kRelativeVelocity, [](SafetyInput& in) { in.velocity_ok = false; });
}

TEST(SafetyLogic, AValueAtItsBoundIsFine) {
  SafetyLogic logic = running();
  SafetyInput input = fine(0.004);
  input.tcp_speed = 1.3;
  EXPECT_TRUE(logic.cycle(input).torque);
}

TEST(SafetyLogic, ResetIsRefusedWhileTheCauseIsThereOrTheArmMoves) {
  SafetyLogic logic = running();
  SafetyInput bad = fine(0.004);
  bad.distance_ok = false;
  logic.cycle(bad);
  bad.time = 0.005;
  bad.reset = true;
  EXPECT_TRUE(logic.cycle(bad).reset_refused);
  for (int i = 6; i < 20; ++i) EXPECT_FALSE(logic.cycle(fine(0.001 * i, true)).torque) << "held";
  EXPECT_FALSE(logic.cycle(fine(0.020)).torque);
  EXPECT_TRUE(logic.cycle(fine(0.021, true)).torque);
}

TEST(SafetyLogic, AStopLongerThanDeclaredLocksTheArm) {
  SafetyLogic logic(limits(), {.stop_time = 0.05});
  logic.cycle(fine(0.001));
  logic.cycle(fine(0.002, true));
  SafetyInput moving = fine(0.003);
  moving.distance_ok = false;
  moving.qd[0] = 0.002;
  logic.cycle(moving);
  for (int i = 4; i < 60; ++i) {
    moving.time = 0.001 * i;
    moving.qd[0] = 0.02;
    logic.cycle(moving);
  }
  EXPECT_TRUE(logic.output().overrun);
  logic.cycle(fine(0.060));
  logic.cycle(fine(0.061));
  EXPECT_FALSE(logic.cycle(fine(0.062, true)).torque);
}

TEST(SafetyLogic, AClockThatStandsStillDoesNotHideALongStop) {
  SafetyLogic logic(limits(), {.stop_time = 0.05});
  logic.cycle(fine(0.001));
  logic.cycle(fine(0.002, true));
  SafetyInput moving = fine(0.003);
  moving.distance_ok = false;
  for (int i = 0; i < 60; ++i) {
    moving.qd[0] = 0.02;
    logic.cycle(moving);
  }
  EXPECT_TRUE(logic.output().overrun);
}

TEST(SafetyLogic, AnArmThatItsWeightMovesUntilTheBrakesHaveClosedStopsInTime) {
  SafetyLogic logic = running();
  SafetyInput input = fine(0.004);
  input.distance_ok = false;
  logic.cycle(input);
  EXPECT_EQ(logic.cycle(fine(0.005)).state, TorqueState::kOff) << "it stood";
  for (int i = 6; i < 60; ++i) {
    SafetyInput moving = fine(0.001 * i);
    moving.qd[0] = 0.1;
    EXPECT_EQ(logic.cycle(moving).state, TorqueState::kStopping);
  }
  const SafetyOutput& out = logic.cycle(fine(0.060));
  EXPECT_EQ(out.state, TorqueState::kOff);
  EXPECT_NEAR(out.stop_time, 0.056, 1e-9);
  EXPECT_FALSE(out.overrun);
  logic.cycle(fine(0.061));
  EXPECT_TRUE(logic.cycle(fine(0.062, true)).torque);
}

TEST(SafetyLogic, AnArmThatMovesAgainUnderItsBrakesIsLocked) {
  SafetyLogic logic = running();
  SafetyInput input = fine(0.004);
  input.distance_ok = false;
  logic.cycle(input);
  for (int i = 5; i < 400; ++i) logic.cycle(fine(0.001 * i));
  EXPECT_FALSE(logic.output().overrun);
  input = fine(0.400);
  input.qd[0] = 0.02;
  EXPECT_TRUE(logic.cycle(input).overrun);
}

TEST(SafetyLogic, AnUnknownJointStateIsNeitherMotionNorLongerThanItLasts) {
  SafetyLogic logic = running();
  SafetyInput lost = fine(0.004);
  lost.finite = false;
  lost.qd.setConstant(std::numeric_limits<double>::quiet_NaN());
  for (int i = 4; i < 64; ++i) {
    lost.time = 0.001 * i;
    logic.cycle(lost);
  }
  EXPECT_NEAR(logic.output().stop_time, 0.059, 1e-9);
  EXPECT_FALSE(logic.output().overrun);
  logic.cycle(fine(0.064));
  lost.time = 0.065;  // once more, now at rest
  EXPECT_FALSE(logic.cycle(lost).overrun);
  logic.cycle(fine(0.066));
  EXPECT_TRUE(logic.cycle(fine(0.067, true)).torque);
}

/// 10^5 random sequences of inputs and resets, against a judge that knows only the rule.
TEST(SafetyLogic, TorqueNeverReturnsByItself) {
  Random random(7);
  long resets = 0, cuts = 0;
  for (int sequence = 0; sequence < 100000; ++sequence) {
    SafetyLogic logic(limits(), {.stop_time = 0.02});
    bool torque = false, button = true;
    double time = 0.0;
    const double bad = random.uniform(0.0, 0.15), press = random.uniform(0.0, 0.9);
    const auto chance = [&](double share) { return random.uniform(0.0, 1.0) < share; };
    for (int i = 0; i < 40; ++i) {
      time += chance(bad * 0.2) ? random.uniform(-0.01, 0.01) : 0.001;
      SafetyInput input = fine(time, chance(press));
      if (chance(0.3)) input.qd = JointVector::Constant(2, random.uniform(-0.02, 0.02));
      if (chance(bad * 0.2)) input.qd = JointVector::Constant(2, random.uniform(-2.0, 2.0));
      input.tcp_speed = chance(bad * 0.3) ? random.uniform(1.2, 1.5) : 0.5;
      input.distance_ok = !chance(bad);
      input.velocity_ok = !chance(bad * 0.5);
      input.finite = !chance(bad * 0.2);
      if (!input.finite) input.qd.setConstant(std::numeric_limits<double>::quiet_NaN());
      const SafetyOutput& out = logic.cycle(input);
      const bool down = input.reset && !button;
      button = input.reset;
      if (out.torque && !torque) {
        ++resets;
        ASSERT_TRUE(down) << "no reset went down";
        ASSERT_EQ(out.violated, 0U) << "the cause is still there";
        ASSERT_LE(input.qd.cwiseAbs().maxCoeff(), 0.01) << "the arm moves";
      }
      if (out.violated != 0U) {
        ASSERT_FALSE(out.torque);
      }
      cuts += static_cast<long>(torque && !out.torque);
      torque = out.torque;
    }
  }
  EXPECT_GT(resets, 50000);  // else nothing was tried
  EXPECT_GT(cuts, 20000);
}

}  // namespace
}  // namespace proxcgal
