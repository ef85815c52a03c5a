/// The caller's clock, and ticks that come at any time.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "proxcgal/control/controller.hpp"
#include "robots.hpp"

namespace proxcgal {
namespace {

using test::bent;
using test::five_tasks;
using test::goal_near;
using test::Random;
using test::scans;

TEST(Controller, AClockThatJumpsAnHourChangesNoCommand) {
  const auto run = [](double jump) {
    const auto robot = test::arm();
    Controller controller(robot, test::ring(), ControllerConfig{});
    Random random(15);
    JointVector q = bent();
    const Pose goal = goal_near(*robot, q);
    JointVector sum = JointVector::Zero(6);
    for (int i = 0; i < 200; ++i) {
      const double time = 0.01 * i + (i >= 100 ? jump : 0.0);
      const auto batch =
          i % 7 == 0 ? scans(random, 10, static_cast<std::uint32_t>(i), time) : std::vector<Scan>{};
      const TickOutput& out = controller.tick(time, q, batch, goal);
      q += 0.01 * out.qd;
      sum += out.qd;
    }
    return sum;
  };
  EXPECT_EQ(run(3600.0), run(0.0));
  EXPECT_EQ(run(-3600.0), run(0.0));
  EXPECT_EQ(run(1.7e9), run(0.0));  // seconds since 1970
}

TEST(Controller, TicksAtAnyTimeAccelerateByTheTimeThatHasPassed) {
  const auto robot = test::arm();
  Controller controller(robot, test::ring(), five_tasks());
  Random random(18);
  JointVector q = bent(), last = JointVector::Zero(6);
  const Pose goal = goal_near(*robot, q);
  double time = 0.0;
  bool limited = false;  // somewhere the limit was what held a joint
  for (int i = 0; i < 3000; ++i) {
    const double step = i % 3 == 0 ? 0.01 : std::round(random.uniform(500.0, 12500.0)) / 1e6;
    time += step;
    q += step * last;
    const auto batch =
        i % 7 == 0 ? scans(random, 10, static_cast<std::uint32_t>(i), time) : std::vector<Scan>{};
    const TickOutput& out = controller.tick(time, q, batch, goal);
    const JointVector most = step * robot->qdd_max();
    const JointVector change = (out.qd - last).cwiseAbs();
    ASSERT_TRUE((change.array() <= most.array() + 1e-12).all());
    limited = limited || (step < 0.009 && (change - most).cwiseAbs().minCoeff() < 1e-9);
    last = out.qd;
  }
  EXPECT_TRUE(limited);
}

TEST(Controller, AJointThatTicksAtAnyTimeStillStopsAtItsLimit) {
  const auto robot = test::arm();
  Random random(19);
  for (int arm = 0; arm < 10; ++arm) {
    Controller controller(robot, Skin{}, ControllerConfig{});
    JointVector q = bent(), last = JointVector::Zero(6);
    Pose goal = goal_near(*robot, q);
    double time = 0.0;
    for (int i = 0; i < 1500; ++i) {
      if (i % 100 == 0) goal = goal_near(*robot, test::posture(random, 6));
      const double step = random.uniform(0.0005, 0.01);
      time += step;
      q += step * last;
      last = controller.tick_known(time, q, Points(0, 3), goal).qd;
      ASSERT_TRUE((q.array() <= robot->q_max().array() + 1e-9).all());
      ASSERT_TRUE((q.array() >= robot->q_min().array() - 1e-9).all());
    }
  }
}

TEST(Controller, AClockThatCrawlsStillBrakes) {
  const auto robot = test::arm();
  Controller controller(robot, Skin{}, ControllerConfig{});
  JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  for (int i = 0; i < 20; ++i)
    q += 0.01 * controller.tick_known(0.01 * i, q, Points(0, 3), goal).qd;
  ASSERT_GT(controller.tick_known(0.2, q, Points(0, 3), goal).qd.norm(), 1e-3);
  JointVector bad = q;
  bad[0] = std::nan("");
  JointVector qd;
  for (int i = 1; i < 5000; ++i)
    qd = controller.tick_known(0.2 + 1e-9 * i, bad, Points(0, 3), goal).qd;
  EXPECT_EQ(qd.norm(), 0.0);
}

}  // namespace
}  // namespace proxcgal
