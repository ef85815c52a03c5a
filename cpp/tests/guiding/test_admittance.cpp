#include <gtest/gtest.h>

#include <cmath>

#include "allocations.hpp"
#include "proxcgal/error.hpp"
#include "proxcgal/guiding/hand_guide.hpp"
#include "robots.hpp"

namespace proxcgal {
namespace {

using test::Random;
constexpr double kDt = 0.001;

Vector6 random_force(Random& random, double linear, double angular) {
  Vector6 force;
  force << random.vector(linear), random.vector(angular);
  return force;
}

TEST(Admittance, SettlesAtForceOverDamping) {
  AdmittanceConfig config;
  config.engage_time = 0.0;
  Admittance admittance(config);
  Vector6 force = Vector6::Zero();
  force[1] = 37.0;
  for (int i = 0; i < 5000; ++i) admittance.step(force, true, kDt);
  EXPECT_NEAR(admittance.velocity()[1], (37.0 - 2.0) / 35.0, 1e-9);
}

TEST(Admittance, StepIsTheExactSolution) {
  AdmittanceConfig config;
  config.engage_time = 0.0;
  config.dead_band.setZero();
  Admittance coarse(config), fine(config);
  Vector6 force;
  force << 20, -30, 10, 1, -2, 0.5;
  Vector6 way = Vector6::Zero();
  const Vector6 whole = coarse.step(force, true, 0.1) * 0.1;
  for (int i = 0; i < 100; ++i) way += fine.step(force, true, 0.001) * 0.001;
  EXPECT_LT((coarse.velocity() - fine.velocity()).norm(), 1e-12);
  EXPECT_LT((whole - way).norm(), 1e-12);
}

TEST(Admittance, ForceInsideTheDeadBandMovesNothing) {
  Admittance admittance({});
  const Vector6 force = AdmittanceConfig{}.dead_band;
  for (int i = 0; i < 100; ++i) EXPECT_EQ(admittance.step(force, true, kDt).norm(), 0.0);
}

TEST(Admittance, NeverGivesBackMoreThanTheHandPutIn) {
  Random random(11);
  for (int run = 0; run < 300; ++run) {
    AdmittanceConfig config;
    for (int axis = 0; axis < 6; ++axis) {
      config.mass[axis] = std::exp(random.uniform(-3.0, 3.0));
      config.damping[axis] = std::exp(random.uniform(-3.0, 4.0));
      config.dead_band[axis] = random.uniform(0.0, 20.0);
      config.max_force[axis] = random.uniform(5.0, 60.0);
    }
    Admittance admittance(config);
    double work = 0.0, most = 0.0;
    Vector6 force = Vector6::Zero();
    bool engaged = true;
    for (int i = 0; i < 2000; ++i) {
      // Forces that hold for a while, and such that chase the velocity to milk it.
      if (i % 50 == 0) force = random_force(random, 150.0, 50.0);
      if (run % 3 == 0) force = -30.0 * admittance.velocity().cwiseSign();
      if (random.uniform(0.0, 1.0) < 0.01) engaged = !engaged;
      work += force.dot(admittance.step(force, engaged, kDt)) * kDt;
      most = std::max(most, admittance.energy());
      ASSERT_LE(admittance.energy(), work + 1e-9 * (1.0 + most));
    }
  }
}

TEST(Admittance, VelocityIsContinuousWhenEngagedAndReleased) {
  const AdmittanceConfig config;
  Admittance admittance(config);
  Vector6 force = Vector6::Constant(60.0);
  // No step is larger than the most that force and damping can do.
  Vector6 last = Vector6::Zero();
  for (int i = 0; i < 3000; ++i) {
    const bool engaged = (i / 400) % 2 == 0;
    const Vector6 now = admittance.step(force, engaged, kDt);
    const Vector6 most =
        (config.max_force.cwiseMin(force) + config.damping.cwiseProduct(last.cwiseAbs()))
            .cwiseQuotient(config.mass) *
        kDt;
    EXPECT_TRUE(((now - last).cwiseAbs().array() <= most.array() + 1e-12).all());
    last = now;
  }
}

TEST(Admittance, WhatIsNotFiniteCountsAsNoForce) {
  Admittance admittance({});
  const Vector6 force = Vector6::Constant(std::nan(""));
  EXPECT_EQ(admittance.step(force, true, kDt).norm(), 0.0);
}

TEST(Admittance, RefusesBadSettings) {
  AdmittanceConfig config;
  config.mass[2] = 0.0;
  EXPECT_THROW(Admittance{config}, ConfigError);
}

TEST(HandGuide, ToolFollowsTheAdmittanceWhereLimitsAllow) {
  const auto robot = test::arm();
  HandGuide guide(robot, {});
  JointVector q(6);
  q << 0.2, 0.6, 0.9, 0.1, 0.5, 0.0;
  Vector6 force = Vector6::Zero();
  force.head<3>() << 8, -6, 5;
  for (int i = 0; i < 500; ++i) {
    const HandGuideOutput& out = guide.step(q, force, true);
    EXPECT_LT((out.achieved - out.wanted).norm(), 0.02 * out.wanted.norm() + 1e-6);
    q += kDt * out.qd;
  }
  EXPECT_GT(guide.output().achieved.norm(), 0.1);
}

TEST(HandGuide, CommandsStayWithinLimitsWhateverTheHandDoes) {
  const auto robot = test::arm();
  HandGuide guide(robot, {});
  Random random(13);
  JointVector q = JointVector::Constant(6, 0.5), last = JointVector::Zero(6);
  Vector6 force = Vector6::Zero();
  for (int i = 0; i < 20000; ++i) {
    if (i % 200 == 0) force = random_force(random, 200.0, 40.0);
    const JointVector qd = guide.step(q, force, i % 1000 < 800).qd;
    ASSERT_TRUE((qd.cwiseAbs().array() <= robot->qd_max().array() + 1e-12).all());
    ASSERT_TRUE(((qd - last).cwiseAbs().array() <= robot->qdd_max().array() * kDt + 1e-12).all());
    q += kDt * qd;
    ASSERT_TRUE((q.array() <= robot->q_max().array() + 1e-9).all());
    ASSERT_TRUE((q.array() >= robot->q_min().array() - 1e-9).all());
    last = qd;
  }
}

TEST(HandGuide, StepAllocatesNothing) {
  const auto robot = test::arm();
  HandGuide guide(robot, {});
  JointVector q = JointVector::Constant(6, 0.5);
  const Vector6 force = Vector6::Constant(30.0);
  guide.step(q, force, true);
  const test::CountAllocations allocations;
  for (int i = 0; i < 1000; ++i) q += kDt * guide.step(q, force, i % 300 < 200).qd;
  EXPECT_EQ(allocations.count(), 0U);
}

}  // namespace
}  // namespace proxcgal
