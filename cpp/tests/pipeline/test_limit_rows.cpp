/// Joint intervals, approach caps and retreat rates, and what they do over time.
#include <gtest/gtest.h>

#include <cmath>
#include <deque>

#include "limit_inputs.hpp"
#include "repeats.hpp"
#include "robots.hpp"

namespace proxcgal {
namespace {

using test::Random;
using test::random_joints;

constexpr double kDt = 0.01;

TEST(JointInterval, KeepsEveryJointInsideItsLimitsUnderLateTicks) {
  Random random(1);
  double worst = 0.0;
  for (int run = 0; run < test::repeats(60, 3000); ++run) {
    const Eigen::Index n = 6;
    Limits limits = test::arm_limits(n);
    for (Eigen::Index j = 0; j < n; ++j) {
      limits.qd_max[j] = random.uniform(0.5, 4.0);
      limits.qdd_max[j] = random.uniform(1.0, 30.0);
    }
    PeriodBound bound(kDt, 1.5);
    JointVector q = random_joints(random, n, 2.5), qd = JointVector::Zero(n);
    JointVector push = random_joints(random, n, 5.0);
    JointInterval interval;
    for (int tick = 0; tick < 600; ++tick) {
      double elapsed = kDt;
      if (run % 3 == 0) elapsed *= random.uniform(0.5, 1.5);
      if (run % 3 == 1) elapsed *= 1.5;
      if (run % 3 == 2) elapsed *= 2.0;
      q += elapsed * qd;  // the command was held that long
      bound.update(elapsed);
      joint_interval(limits, q, qd, elapsed, bound.value(), interval);
      ASSERT_TRUE((interval.low.array() <= interval.high.array()).all());
      if (tick % 100 == 0) push = random_joints(random, n, 5.0);
      qd = push.cwiseMax(interval.low).cwiseMin(interval.high);
      worst = std::max({worst, (q - limits.q_max).maxCoeff(), (limits.q_min - q).maxCoeff()});
    }
  }
  EXPECT_LT(worst, 0.5e-3);
}

TEST(JointInterval, AViableCommandStaysViableForAnyHold) {
  // S(v) - v h >= S(v - a h) for 0 <= h <= D, by the inverse of S.
  Random random(2);
  for (int trial = 0; trial < 20000; ++trial) {
    const double a = std::pow(10.0, random.uniform(-1.0, 2.0));
    const double D = std::pow(10.0, random.uniform(-3.0, -1.0));
    const double room = std::pow(10.0, random.uniform(-6.0, 1.0));
    const double v = viable_speed(room, a, D), h = random.uniform(0.0, D);
    ASSERT_GE(viable_speed(room - v * h, a, D), v - a * h - 1e-9 * (1.0 + v));
    double covered = 0.0;
    for (double u = v; u > 0.0; u -= a * D) covered += u * D;
    ASSERT_NEAR(covered, room, 1e-9 * (1.0 + room));
  }
}

TEST(JointInterval, LetsAJointOutsideItsLimitsMoveInwardsOnly) {
  Limits limits = test::arm_limits(2);
  JointVector q(2);
  q << 3.2, -3.2;
  JointInterval interval;
  joint_interval(limits, q, JointVector::Zero(2), kDt, 0.03, interval);
  EXPECT_EQ(interval.high[0], 0.0);
  EXPECT_LT(interval.low[0], 0.0);
  EXPECT_EQ(interval.low[1], 0.0);
  EXPECT_GT(interval.high[1], 0.0);
}

TEST(PeriodBound, FollowsTheRealIntervals) {
  PeriodBound bound(0.01, 1.5);
  EXPECT_DOUBLE_EQ(bound.value(), 0.03);
  bound.update(0.04);
  EXPECT_DOUBLE_EQ(bound.value(), 0.06);
  for (int i = 0; i < 200; ++i) bound.update(0.01);
  EXPECT_DOUBLE_EQ(bound.value(), 0.03);
}

TEST(ApproachSpeed, IsTheSpeedThatStopsAtDStop) {
  const LimitConfig config;
  Random random(3);
  for (int trial = 0; trial < 2000; ++trial) {
    const double T = random.uniform(0.02, 0.3), tau = random.uniform(0.0, 0.5);
    const double d = random.uniform(-0.05, 0.6);
    ApproachCap cap{.distance = d};
    const double c = approach_speed(config, cap, T, tau);
    if (d <= config.d_stop) {
      EXPECT_EQ(c, 0.0);
      continue;
    }
    EXPECT_LE(c * (T + 0.5 * tau), d - config.d_stop + 1e-12);
    if (d <= config.near_distance) {
      EXPECT_LE(c, config.near_speed);
    }
    if (tau > 0.0 && d > config.near_distance) {  // the form, with its own deceleration
      const double a = c / tau;
      EXPECT_LE(c, a * (std::sqrt(T * T + 2.0 * (d - config.d_stop) / a) - T) + 1e-9);
      const double v = config.near_speed;
      if (c > v) {
        EXPECT_LE(c * T + (c * c - v * v) / (2.0 * a), d - config.near_distance + 1e-9);
      }
    }
    if (c > 0.0) {
      EXPECT_LE(approach_distance(config, cap, c, T, tau), d + 1e-9);
    }
    cap.distance = d + 0.01;
    EXPECT_GE(approach_speed(config, cap, T, tau), c);
    cap.distance = d + 1e-7;
    EXPECT_LE(approach_speed(config, cap, T, tau) - c, 1e-4);
  }
}

TEST(RetreatRate, IsContinuousAndCappedNearerThanDStop) {
  const LimitConfig config;
  RetreatRow row;
  row.obstacle_rate = 1.0;
  row.distance = 0.049;
  EXPECT_DOUBLE_EQ(retreat_rate(config, row), config.retreat_speed);
  double before = retreat_rate(config, row);
  for (; row.distance < 0.3; row.distance += 1e-5) {
    EXPECT_LT(std::abs(retreat_rate(config, row) - before), 1e-3);
    before = retreat_rate(config, row);
  }
}

/// One joint drives straight at a wall as fast as it may; late ticks, dead time and lag.
TEST(ApproachCap, AnArmDrivenAtAWallStopsBeforeDStopAndIsSlowNearIt) {
  Random random(4);
  for (int run = 0; run < test::repeats(30, 500); ++run) {
    LimitConfig config;
    config.dead_time = run % 2 == 0 ? 0.03 : 0.0;
    config.lag = run % 3 == 0 ? 0.08 : 0.0;
    Limits limits = test::arm_limits(1);
    limits.q_max[0] = 100.0;
    limits.qd_max[0] = random.uniform(0.5, 3.0);
    limits.qdd_max[0] = random.uniform(2.0, 20.0);
    const double reach = random.uniform(0.3, 1.3);  // [m/rad]
    Limiter limiter(limits, config, kDt);
    JointVector q = JointVector::Zero(1), qd = q, nominal = JointVector::Constant(1, 10.0);
    std::deque<double> delayed(static_cast<std::size_t>(config.dead_time / kDt), 0.0);
    double real = 0.0;
    std::vector<ApproachCap> caps(1);
    caps[0].row = JointVector::Constant(1, -reach);
    for (int tick = 0; tick < 1000; ++tick) {
      caps[0].distance = 1.0 - reach * q[0];
      limiter.begin(q, qd, kDt);
      qd = limiter.limit({.nominal = nominal, .caps = caps}).qd;
      delayed.push_back(qd[0]);
      const double command = delayed.front();
      delayed.pop_front();
      real += (command - real) * (config.lag > 0.0 ? 1.0 - std::exp(-kDt / config.lag) : 1.0);
      q[0] += kDt * real;
      const double d = 1.0 - reach * q[0];
      ASSERT_GT(d, config.d_stop - (config.dead_time + config.lag > 0.0 ? 1e-3 : 1e-9)) << run;
      if (d < config.near_distance) {
        ASSERT_LT(reach * real, config.near_speed + (config.lag > 0.0 ? 0.015 : 1e-9)) << run;
      }
    }
    EXPECT_LT(1.0 - reach * q[0], config.d_stop + 0.01);
  }
}

struct Plates {
  double low, high;  // [m] along y
};

/// Rows of the arm's outer links between two plates: spheres of 0.06 m at mid-link and tool.
void rows(const Robot& robot, const Posture& posture, const Plates& plates, const Plates& speed,
          std::vector<RetreatRow>& retreats, std::vector<ApproachCap>& caps) {
  retreats.clear();
  caps.clear();
  Jacobian6 J;
  for (int link = 3; link < robot.n_links(); ++link) {
    const Vector3 p = posture.T_WL[static_cast<std::size_t>(link)] * Vector3(0, 0, 0.15);
    robot.jacobian(posture, link, p, J);
    const JointVector row = J.row(1).transpose();
    for (const bool low : {true, false}) {
      const double d = (low ? p.y() - plates.low : plates.high - p.y()) - 0.06;
      ApproachCap cap;
      cap.row = low ? row : JointVector(-row);
      cap.distance = d;
      cap.link = link;
      caps.push_back(cap);
      if (d > 0.30) continue;
      RetreatRow retreat;
      retreat.row = cap.row;
      retreat.distance = d;
      retreat.obstacle_rate = low ? speed.low : -speed.high;
      retreat.link = link;
      retreats.push_back(retreat);
    }
  }
}

/// @return root mean square of the tool's speed in the last 3 s [m/s]
double tool_rms(double v_low, double v_high, double dead_time, bool& pinched, double& least) {
  const auto robot = test::arm();
  Posture posture = robot->make_posture();
  JointVector q = test::bent(), qd = JointVector::Zero(6);
  q[0] = q[3] = 0.0;  // the arm in a plane midway between the plates
  LimitConfig config;
  config.dead_time = dead_time;
  config.require_stable(2.0, kDt);
  Limiter limiter({robot->q_min(), robot->q_max(), robot->qd_max(), robot->qdd_max()}, config, kDt);
  robot->update(q, posture);
  const double middle = posture.T_WT.translation().y();
  Plates plates{middle - 0.15 - (v_low > 0 ? 0.4 : 0.0), middle + 0.15 + (v_high < 0 ? 0.4 : 0.0)};
  std::deque<JointVector> delayed(static_cast<std::size_t>(dead_time / kDt), qd);
  std::vector<RetreatRow> retreats;
  std::vector<ApproachCap> caps;
  JointVector goal = q;
  goal[0] += 1.0;  // through the upper plate
  double sum = 0.0;
  least = kInfinity;
  const int ticks = 1200;
  for (int tick = 0; tick < ticks; ++tick) {
    robot->update(q, posture);
    const bool closing = plates.high - plates.low > 0.30;
    const Plates speed{closing ? v_low : 0.0, closing ? v_high : 0.0};
    rows(*robot, posture, plates, speed, retreats, caps);
    for (const auto& cap : caps) least = std::min(least, cap.distance);
    Task reach;
    Jacobian6 J;
    robot->tool_jacobian(posture, J);
    reach.jacobian = J;
    reach.rate = reach.activation = RowVector::Ones(6);
    const JointVector nominal = 1.0 * (goal - q);
    limiter.begin(q, qd, kDt);
    const LimitOutput& out = limiter.limit({nominal, {&reach, 1}, caps, retreats});
    qd = out.qd;
    pinched = out.pinched;
    delayed.push_back(qd);
    const JointVector real = delayed.front();
    delayed.pop_front();
    q += kDt * real;
    plates.low += kDt * speed.low;
    plates.high += kDt * speed.high;
    if (tick >= ticks - 300) sum += (J.topRows<3>() * real).squaredNorm();
  }
  return std::sqrt(sum / 300.0);
}

TEST(Limit, BetweenTwoPlatesTheArmStandsWithoutALimitCycle) {
  for (const double dead_time : {0.0, 0.03, 0.10}) {
    for (const auto& [low, high] : {std::pair{0.0, 0.0}, {0.2, 0.0}, {0.2, -0.2}}) {
      bool pinched = false;
      double least = 0.0;
      const double rms = tool_rms(low, high, dead_time, pinched, least);
      EXPECT_LT(rms, 0.010) << dead_time << " " << low << " " << high;
      EXPECT_TRUE(pinched) << dead_time << " " << low << " " << high;
      EXPECT_GT(least, 0.03) << dead_time << " " << low << " " << high;
      RecordProperty("rms_mm", static_cast<int>(1e3 * rms));
    }
  }
}

}  // namespace
}  // namespace proxcgal
