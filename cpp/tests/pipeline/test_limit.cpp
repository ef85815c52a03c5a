/// The limit stage on random programmes: feasible, inside the limits, continuous.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "allocations.hpp"
#include "limit_inputs.hpp"
#include "proxcgal/error.hpp"
#include "repeats.hpp"

namespace proxcgal {
namespace {

using test::any_case;
using test::LimitCase;
using test::Random;
using test::random_case;
using test::random_joints;
using test::Shape;

constexpr double kDt = 0.01;

bool same_bits(const JointVector& a, const JointVector& b) {
  return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), [](double x, double y) {
           return std::bit_cast<std::uint64_t>(x) == std::bit_cast<std::uint64_t>(y);
         });
}

double cap_bound(const ApproachCap& cap, const LimitState& state) {
  return std::min(-cap.speed, cap.row.dot(state.qd_brake));  // of caps whose distance is infinite
}

TEST(Limit, StaysInsideTheIntervalsAndTheCapsWhateverTheProgramme) {
  Random random(1);
  int changed = 0, partly = 0, braking = 0;
  const int trials = test::repeats(2000, 100000);
  for (int trial = 0; trial < trials; ++trial) {
    const LimitCase one = any_case(random, trial);
    Limiter limiter(one.limits, {}, kDt);
    const LimitOutput& out = one.through(limiter);
    ASSERT_TRUE(out.qd.allFinite());
    ASSERT_TRUE(
        (limiter.state().interval.low.array() <= limiter.state().interval.high.array()).all());
    ASSERT_TRUE((out.qd.array() >= limiter.state().interval.low.array()).all()) << trial;
    ASSERT_TRUE((out.qd.array() <= limiter.state().interval.high.array()).all()) << trial;
    for (const ApproachCap& cap : one.caps)
      ASSERT_GE(cap.row.dot(out.qd), cap_bound(cap, limiter.state()) - 1e-9) << trial;
    ASSERT_LE(out.programmes, 6);
    ASSERT_LE(out.iterations, 1200);
    changed += out.status == LimitStatus::kLimited ? 1 : 0;
    partly += out.status == LimitStatus::kPartly ? 1 : 0;
    braking += out.status == LimitStatus::kBraking ? 1 : 0;
  }
  EXPECT_GT(changed, 0);
  EXPECT_LE(partly, trials / 1000);  // where rows of all scales contradict one another
  EXPECT_EQ(braking, 0);
}

TEST(Limit, ReturnsAnAdmissibleNominalBitForBit) {
  Random random(2);
  int unchanged = 0;
  for (int trial = 0; trial < test::repeats(2000, 20000); ++trial) {
    LimitCase one = any_case(random, trial);
    Limiter limiter(one.limits, {}, kDt);
    one.nominal = one.through(limiter).qd;  // fulfils (0) and (1), often (2) as well
    const LimitOutput& again = one.through(limiter);
    bool admissible = true;
    for (const RetreatRow& row : one.retreats)
      admissible &= row.row.dot(one.nominal) >= retreat_rate({}, row);
    if (!admissible) continue;
    ++unchanged;
    ASSERT_TRUE(same_bits(again.qd, one.nominal)) << trial;
    ASSERT_EQ(again.status, LimitStatus::kUnchanged);
    ASSERT_EQ(again.n_active, 0);
  }
  EXPECT_GT(unchanged, 100);
}

TEST(Limit, AllocatesNothing) {
  Random random(3);
  std::vector<LimitCase> cases;
  std::vector<Limiter> limiters;
  for (int trial = 0; trial < 600; ++trial) {
    cases.push_back(any_case(random, trial));
    limiters.emplace_back(cases.back().limits, LimitConfig{}, kDt);
  }
  std::size_t count = 0;
  {
    const test::CountAllocations counter;
    for (std::size_t i = 0; i < cases.size(); ++i) cases[i].through(limiters[i]);
    count = counter.count();
  }
  EXPECT_EQ(count, 0u);
}

TEST(Limit, BrakesOnWhatIsNotFinite) {
  Random random(4);
  const LimitCase good = random_case(random, 6, Shape::kOrdinary, 4, 4);
  Limiter limiter(good.limits, {}, kDt);
  for (int field = 0; field < 6; ++field) {
    LimitCase bad = good;
    if (field == 0) bad.nominal[2] = NAN;
    if (field == 1) bad.caps[1].row[0] = kInfinity;
    if (field == 2) bad.retreats[1].row[0] = NAN;
    if (field == 3) bad.retreats[1].distance = NAN;
    if (field == 4) bad.caps[0].distance = NAN;
    if (field == 5) bad.tasks[0].jacobian(0, 0) = NAN;
    const LimitOutput& out = bad.through(limiter);
    EXPECT_TRUE(out.qd.allFinite());
    if (field < 5) {
      EXPECT_EQ(out.status, LimitStatus::kBraking);
      EXPECT_TRUE(same_bits(out.qd, limiter.state().qd_brake));
    }
  }
}

TEST(Limit, TellsWhichRowsChangedTheCommand) {
  LimitCase one;
  one.limits = test::arm_limits(2);
  one.q = one.nominal = one.qd_last = JointVector::Zero(2);
  one.nominal << 0.05, 5.0;
  ApproachCap cap;
  cap.row = JointVector::Zero(2);
  cap.row[0] = -1.0;
  cap.distance = 0.02;
  cap.kind = LimitKind::kFloor;
  cap.link = 4;
  one.caps = {cap};
  Limiter limiter(one.limits, {}, kDt);
  const LimitOutput& out = one.through(limiter);
  ASSERT_EQ(out.n_active, 2);
  EXPECT_EQ(out.active[0].kind, LimitKind::kJoint);
  EXPECT_EQ(out.active[0].link, 1);
  EXPECT_EQ(out.active[1].kind, LimitKind::kFloor);
  EXPECT_EQ(out.active[1].link, 4);
  EXPECT_NEAR(out.qd[0], 0.0, 1e-12);
  EXPECT_NEAR(out.qd[1], 0.1, 1e-12);
}

TEST(Limit, LowerLevelsYieldFirst) {
  // Both tasks want more of the one joint than it may give together; the first keeps more.
  LimitCase one;
  one.limits = test::arm_limits(2);
  one.q = one.qd_last = JointVector::Zero(2);
  one.nominal = JointVector::Constant(2, 0.09);
  Task first, second;
  first.jacobian = TaskJacobian::Identity(1, 2);
  first.activation = first.rate = RowVector::Ones(1);
  second = first;
  second.jacobian << 0.0, 1.0;
  one.tasks = {first, second};
  ApproachCap cap;
  cap.row = JointVector::Constant(2, -1.0);
  cap.speed = 0.09;
  one.caps = {cap};
  Limiter limiter(one.limits, {}, kDt);
  const LimitOutput& out = one.through(limiter);
  EXPECT_NEAR(out.qd.sum(), 0.09, 1e-9);
  const LimitConfig& config = limiter.config();
  const double weights = (1.0 + config.least_weight) / (config.level_ratio + config.least_weight);
  EXPECT_NEAR((0.09 - out.qd[1]) / (0.09 - out.qd[0]), weights, 1e-6);
}

TEST(Limit, IsContinuousWhereARowCrossesDStop) {
  Random random(6);
  double steepest = 0.0;
  for (int trial = 0; trial < test::repeats(60, 1000); ++trial) {
    LimitCase one = random_case(random, 6, Shape::kPinched, 2, 6);
    one.elapsed = 0.05;
    JointVector before;
    for (int i = -20; i <= 20; ++i) {
      Limiter limiter(one.limits, {}, kDt);  // one that was not pinched before
      one.retreats[0].distance = 0.05 + 1e-5 * i;
      const JointVector qd = one.through(limiter).qd;
      if (i > -20) steepest = std::max(steepest, (qd - before).norm() / 1e-5);
      before = qd;
    }
  }
  // [rad/s per m]: a jump of 0.05 rad/s over one step would be 5000.
  EXPECT_LT(steepest, 1000.0);
}

TEST(Limit, ContradictoryRowsArePinchedAndFadeTheNominal) {
  LimitCase one;
  one.limits = test::arm_limits(6);
  one.q = one.qd_last = JointVector::Zero(6);
  one.nominal = JointVector::Constant(6, 0.05);
  RetreatRow row;
  row.row = JointVector::Zero(6);
  row.row[0] = 1.0;
  row.distance = 0.09;
  one.retreats = {row, row};
  one.retreats[1].row *= -1.0;
  Limiter limiter(one.limits, {}, kDt);
  const LimitOutput& out = one.through(limiter);
  EXPECT_TRUE(out.pinched);
  EXPECT_NEAR(out.qd.norm(), 0.0, 1e-9);
  one.retreats.pop_back();  // one row that joints limit is no contradiction
  Limiter fresh(one.limits, {}, kDt);
  EXPECT_FALSE(one.through(fresh).pinched);
}

TEST(LimitConfig, RefusesALoopThatRings) {
  LimitConfig config;
  config.joint_state_age = 0.01;
  config.dead_time = 0.03;
  config.lag = 0.08;
  EXPECT_NO_THROW(config.require_stable(2.0, 0.01));
  EXPECT_THROW(config.require_stable(4.0, 0.01), ConfigError);
  config.near_distance = 0.01;
  EXPECT_THROW(validate(config), ConfigError);
}

}  // namespace
}  // namespace proxcgal
