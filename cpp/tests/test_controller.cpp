#include <gtest/gtest.h>
#if defined(__linux__)
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>
#endif

#include "allocations.hpp"
#include "proxcgal/controller.hpp"
#include "proxcgal/error.hpp"
#include "repeats.hpp"
#include "robots.hpp"

namespace proxcgal {
namespace {

using test::bent;
using test::found;
using test::Random;

Pose goal_near(const Robot& robot, const JointVector& q) {
  Pose goal = test::tool_at(robot, q);
  goal.translation().x() += 0.2;
  return goal;
}

/// Scans of a room of changing depth; the noise makes the closest pair jump.
std::vector<Scan> scans(Random& random, int sensors, std::uint32_t counter, double stamp,
                        double nearest = 0.15) {
  std::vector<Scan> out;
  for (int s = 0; s < sensors; ++s) {
    Scan scan;
    scan.sensor = s;
    scan.counter = counter;
    scan.stamp = stamp;
    scan.status.fill(5);
    for (double& range : scan.ranges) range = random.uniform(nearest, 1.2);
    out.push_back(scan);
  }
  return out;
}

ControllerConfig five_tasks() {
  ControllerConfig config;
  config.tasks = {JointLimits{}, Avoidance{.nearest = 3}, MinimumAltitude{}, Manipulability{},
                  Reach{}};
  config.filter.confirmation = Confirmation::kScans;
  return config;
}

TEST(Controller, TickAllocatesNothing) {
  ControllerConfig own = five_tasks();
  own.tasks[3] = SelfCollision{.d_min = 0.3, .buffer = 0.3};  // so that there always is a pair
  for (const auto& config :
       {ControllerConfig{}, five_tasks(), own,
        ControllerConfig{.control_point = ControlPoint::kSensor},
        ControllerConfig{.memory = MemoryConfig{.max_points = 200}, .motion = MotionConfig{}}}) {
    const auto robot = test::arm();
    Controller controller(robot, test::ring(), config);
    Random random(8);
    JointVector q = bent();
    const Pose goal = goal_near(*robot, q);
    std::vector<std::vector<Scan>> batches;
    for (std::uint32_t i = 0; i < 300; ++i) batches.push_back(scans(random, 10, i, 0.07 * i));
    std::size_t found = 0, allocations = 0;
    const int ticks = test::repeats(25'000, 250'000);  // 10^5 or 10^6 over the four
    for (int i = 0; i < ticks; ++i) {
      const std::vector<Scan> none;
      auto& batch = batches[static_cast<std::size_t>(i / 7) % batches.size()];
      for (Scan& scan : batch) scan.counter = static_cast<std::uint32_t>(i), scan.stamp = 0.01 * i;
      const test::CountAllocations counter;
      const TickOutput& out = controller.tick(0.01 * i, q, i % 7 == 0 ? batch : none, goal);
      allocations += counter.count();
      found += out.pair ? 1 : 0;
      q += 0.01 * out.qd;
    }
    EXPECT_EQ(allocations, 0U);
    EXPECT_GT(found, static_cast<std::size_t>(ticks) / 2U);
  }
}

TEST(Controller, SelfCollisionPartsTheNearestLinksThatJointsCanPart) {
  const auto robot = test::arm();
  ControllerConfig config;
  config.tasks = {SelfCollision{.d_min = 0.1, .buffer = 0.3, .nearest = 2}};
  Controller controller(robot, Skin{}, config);
  JointVector q(6);
  q << 0.0, 1.2, 2.6, 0.0, 0.4, 0.0;  // folded
  Posture posture = robot->make_posture();
  robot->update(q, posture);
  double nearest = kInfinity;
  for (int a = 0; a < robot->n_links(); ++a) {
    for (int b = a + 3; b < robot->n_links(); ++b) {
      const Pose T_AB = posture.T_WL[static_cast<std::size_t>(a)].inverse() *
                        posture.T_WL[static_cast<std::size_t>(b)];
      nearest = std::min(nearest, robot->tree(a).distance(robot->tree(b), T_AB));
    }
  }
  double before = -1.0;
  for (int i = 0; i < 30; ++i) {
    const TickOutput& out = controller.tick_known(0.01 * i, q, Points(0, 3), posture.T_WT);
    ASSERT_GE(out.own.a, 0);
    EXPECT_LE(out.own.distance, nearest + 1e-12);
    ASSERT_GE(out.tasks[0].rate.size(), 1);
    ASSERT_LE(out.tasks[0].rate.size(), 2);
    before = parting_row(*robot, posture, out.own).dot(out.qd);
  }
  EXPECT_GT(before, 0.0);
}

#if defined(__linux__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
/// A child that may only read, write and exit: whoever else calls the system is killed.
TEST(Controller, TickMakesNoSystemCall) {
  const auto robot = test::arm();
  Controller controller(robot, test::ring(), five_tasks());
  Random random(20);
  JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  std::vector<std::vector<Scan>> batches;
  for (std::uint32_t i = 0; i < 300; ++i) batches.push_back(scans(random, 10, i, 0.01 * i));
  controller.tick(0.0, q, batches[0], goal);
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    if (prctl(PR_SET_SECCOMP, SECCOMP_MODE_STRICT) != 0) syscall(SYS_exit, 77);
    for (int i = 1; i < 300; ++i)
      q += 0.01 * controller.tick(0.01 * i, q, batches[static_cast<std::size_t>(i)], goal).qd;
    syscall(SYS_exit, 0);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  if (WIFEXITED(status) && WEXITSTATUS(status) == 77) GTEST_SKIP() << "seccomp is not allowed here";
  EXPECT_TRUE(WIFEXITED(status)) << "killed by signal " << WTERMSIG(status);
}
#endif

TEST(Controller, KnownPointsAllocateNothing) {
  const auto robot = test::arm();
  Controller controller(robot, Skin{}, ControllerConfig{});
  Random random(9);
  const Points points = test::cloud(random, 3000, 1.5);
  const JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  const test::CountAllocations counter;
  for (int i = 0; i < 200; ++i) controller.tick_known(0.01 * i, q, points, goal);
  EXPECT_EQ(counter.count(), 0U);
}

TEST(Controller, EveryKnownPointHasItsOwnVelocity) {
  const auto robot = test::arm();
  Posture posture = robot->make_posture();
  robot->update(bent(), posture);
  Points points(2, 3), velocities_W(2, 3);
  points.row(0) = (posture.T_WT.translation() + Vector3(0.25, 0, 0)).transpose();
  points.row(1) << 3.0, 3.0, 3.0;
  velocities_W << -0.1, 0.02, 0.03, 0.7, 0.8, 0.9;
  for (const int nearest : {1, 2}) {
    for (const ControlPoint point : {ControlPoint::kWholeBody, ControlPoint::kSensor}) {
      const ControllerConfig config{.control_point = point,
                                    .tasks = {Avoidance{.nearest = nearest}, Reach{}}};
      Controller controller(robot, test::ring(), config);
      const TickOutput& out =
          controller.tick_known(0.0, bent(), points, posture.T_WT, velocities_W);
      ASSERT_TRUE(out.pair);
      EXPECT_EQ(out.control.obstacle_velocity_W, Vector3(velocities_W.row(out.pair->point)));
      EXPECT_EQ(out.pair->point, 0);
      const TickOutput& alike =
          controller.tick_known(0.01, bent(), points, posture.T_WT, velocities_W.row(1));
      EXPECT_EQ(alike.control.obstacle_velocity_W, Vector3(velocities_W.row(1)));
      controller.tick_known(0.02, bent(), points, posture.T_WT, Points::Zero(3, 3));
      ASSERT_FALSE(controller.findings().empty());
      EXPECT_EQ(controller.findings().front().reason, Reason::kPointsInvalid);
    }
  }
}

TEST(Controller, CommandsStayWithinLimits) {
  const auto robot = test::arm();
  Controller controller(robot, test::ring(), five_tasks());
  Random random(10);
  JointVector q = bent(), last = JointVector::Zero(6);
  const Pose goal = goal_near(*robot, q);
  for (int i = 0; i < 3000; ++i) {
    const auto batch = i % 7 == 0 ? scans(random, 10, static_cast<std::uint32_t>(i), 0.01 * i)
                                  : std::vector<Scan>{};
    const TickOutput& out = controller.tick(0.01 * i, q, batch, goal);
    ASSERT_TRUE(out.qd.allFinite());
    EXPECT_TRUE((out.qd.cwiseAbs().array() <= robot->qd_max().array() + 1e-12).all());
    EXPECT_TRUE(
        ((out.qd - last).cwiseAbs().array() <= 0.01 * robot->qdd_max().array() + 1e-12).all());
    last = out.qd;
    q += 0.01 * out.qd;
    EXPECT_TRUE((q.array() <= robot->q_max().array() + 1e-9).all() &&
                (q.array() >= robot->q_min().array() - 1e-9).all());
  }
}

TEST(Controller, ANanJointStateStopsWithinOneCycleAndStaysStopped) {
  const auto robot = test::arm();
  Controller controller(robot, Skin{}, ControllerConfig{});
  JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  for (int i = 0; i < 50; ++i) controller.tick(0.01 * i, q, {}, goal);
  JointVector bad = q;
  bad[2] = std::nan("");
  EXPECT_EQ(controller.tick(0.5, bad, {}, goal).mode, Mode::kStop);
  EXPECT_FALSE(controller.reset());  // the cause is still there
  EXPECT_EQ(controller.tick(0.51, q, {}, goal).mode, Mode::kStop);
  EXPECT_TRUE(controller.reset());
  EXPECT_NE(controller.tick(0.52, q, {}, goal).mode, Mode::kStop);
}

TEST(Controller, SilenceOfAllSensorsHoldsTheArmWithin200Milliseconds) {
  const auto robot = test::arm();
  Controller controller(robot, test::ring(), ControllerConfig{});
  Random random(11);
  const JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  for (int i = 0; i < 100; ++i) {
    const auto batch = i % 7 == 0 ? scans(random, 10, static_cast<std::uint32_t>(i), 0.01 * i, 1.0)
                                  : std::vector<Scan>{};
    controller.tick(0.01 * i, q, batch, goal);
  }
  Mode mode = Mode::kRun;  // the last scan came at 0.98 s
  for (int i = 100; i <= 118; ++i) {
    mode = controller.tick(0.01 * i, q, {}, goal).mode;
    if (i <= 111) {
      EXPECT_EQ(mode, Mode::kRun);
    }
  }
  EXPECT_EQ(mode, Mode::kHold);
}

TEST(Controller, SilenceOfOneArrayHoldsTheArmWithin200Milliseconds) {
  const auto robot = test::arm();
  Skin skin = test::ring(10);
  for (std::size_t s = 0; s < 10; ++s)
    skin.mounts[s].name = (s < 5 ? "front/" : "back/") + std::to_string(s);
  Controller controller(robot, skin, ControllerConfig{});
  Random random(21);
  const JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  Mode mode = Mode::kRun;
  for (int i = 0; i < 100; ++i) {
    auto batch = scans(random, 10, static_cast<std::uint32_t>(i), 0.01 * i, 1.0);
    if (i >= 60) batch.resize(5);  // the second array goes silent, its last scan came at 0.59 s
    mode = controller.tick(0.01 * i, q, batch, goal).mode;
    if (i == 70) {
      EXPECT_EQ(mode, Mode::kRun);
    }
    if (i == 79) {
      EXPECT_EQ(mode, Mode::kHold);
      EXPECT_TRUE(found(controller, Reason::kArraySilent));
    }
  }
}

TEST(Controller, TheSamePayloadAgainAndAgainIsSuspect) {
  const auto robot = test::arm();
  Random random(22);
  const JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  const auto stuck = scans(random, 10, 0, 0.0, 1.0);
  // A wall beyond the workspace is no point of the cloud, but it is told all the same.
  for (const double farther : {0.0, 2.0}) {
    Controller controller(robot, test::ring(), ControllerConfig{});
    for (int i = 0; i < 20; ++i) {
      auto batch = scans(random, 10, static_cast<std::uint32_t>(i), 0.01 * i, 1.0);
      batch[3].ranges = stuck[3].ranges;
      for (double& range : batch[3].ranges) range += farther;
      const Mode mode = controller.tick(0.01 * i, q, batch, goal).mode;
      EXPECT_EQ(found(controller, Reason::kSensorSuspect), i >= 5);
      if (i < 5) {
        EXPECT_EQ(mode, Mode::kRun);
      } else {
        EXPECT_GE(mode, Mode::kDegraded);
      }
    }
  }
}

TEST(Controller, AnOldJointStateHoldsAndAtLastStops) {
  const auto robot = test::arm();
  Controller controller(robot, test::ring(), ControllerConfig{});
  Random random(23);
  const JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  const auto at = [&](int i, double age) {
    const auto batch = scans(random, 10, static_cast<std::uint32_t>(i), 0.01 * i, 1.0);
    return controller.tick(0.01 * i, q, batch, goal, false, 0.01 * i - age).mode;
  };
  EXPECT_EQ(at(0, 0.0), Mode::kRun);
  EXPECT_EQ(at(1, 0.019), Mode::kRun);
  EXPECT_EQ(at(2, 0.021), Mode::kHold);
  EXPECT_EQ(at(3, 0.101), Mode::kStop);
  const auto kept = controller.last_ticks();
  ASSERT_EQ(kept.size(), 4U);
  EXPECT_EQ(kept.back().mode, Mode::kStop);
  EXPECT_EQ(kept.back().findings[0].reason, Reason::kJointStateLost);
  EXPECT_EQ(at(4, 0.0), Mode::kStop);  // latched, and what led to it stays
  EXPECT_EQ(controller.last_ticks().size(), 4U);
  EXPECT_TRUE(controller.reset());
  EXPECT_EQ(at(5, 0.0), Mode::kHold);
  EXPECT_EQ(controller.last_ticks().size(), 5U);
}

TEST(Controller, AJointStateOfAnotherClockHolds) {
  const auto robot = test::arm();
  Random random(28);
  const JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  for (const double stamp : {std::nan(""), kInfinity, 3600.0}) {
    Controller controller(robot, test::ring(), ControllerConfig{});
    controller.tick(0.0, q, scans(random, 10, 0, 0.0, 1.0), goal, false, stamp);
    EXPECT_TRUE(found(controller, Reason::kJointStateStale));
  }
}

TEST(Controller, InsideTheLeastDistanceNothingComesNearer) {
  const auto robot = test::arm();
  ControllerConfig config;
  config.monitor.stuck_after = 1e9;
  Random random(24);
  int inside = 0;
  for (int trial = 0; trial < 40; ++trial) {
    Controller controller(robot, Skin{}, config);
    JointVector q = test::posture(random, 6);
    const Pose goal = goal_near(*robot, test::posture(random, 6));
    const Points points = test::cloud(random, 40, 1.0);
    Posture posture = robot->make_posture();
    JointVector before = JointVector::Zero(6);
    for (int i = 0; i < 60; ++i) {
      const TickOutput& out = controller.tick_known(0.01 * i, q, points, goal);
      robot->update(q, posture);
      if (out.pair && out.pair->distance < 0.2 && out.pair->distance > 1e-6) {
        ControlPair pair;
        pair.link = out.pair->link;
        pair.control_W = out.pair->surface_W;
        pair.obstacle_W = out.pair->obstacle_W;
        pair.distance = out.trusted_distance;  // negative inside: out is the other way
        const JointVector row = opening_row(*robot, posture, pair);
        const Limits limits{robot->q_min(), robot->q_max(), robot->qd_max(), robot->qdd_max()};
        const Admissible box = admissible(limits, q, before, config.period);
        JointVector best = before;  // as fast outward as the box allows at all
        for (Eigen::Index j = 0; j < 6; ++j) best[j] = row[j] > 0.0 ? box.high[j] : box.low[j];
        EXPECT_GE(row.dot(out.qd), std::min(0.0, row.dot(best)) - 1e-9);
        ++inside;
      }
      before = out.qd;
      q += config.period * out.qd;
    }
  }
  EXPECT_GT(inside, 300);
}

TEST(Controller, AHoldInsideTheLeastDistanceClearsAndTheArmMovesOff) {
  const auto robot = test::arm();
  Controller controller(robot, Skin{}, ControllerConfig{});
  JointVector q = bent();
  Posture posture = robot->make_posture();
  robot->update(q, posture);
  const Pose goal = posture.T_WT;
  Pose bad = goal;
  bad.translation().x() = std::nan("");
  Points near(1, 3);
  near.row(0) = (goal.translation() + Vector3(0.15, 0.0, 0.0)).transpose();
  double before = 0.0, after = 0.0;
  for (int i = 0; i < 200; ++i) {
    const TickOutput& out = controller.tick_known(0.01 * i, q, near, i < 30 ? bad : goal);
    if (i < 30) {
      ASSERT_EQ(out.mode, Mode::kHold);
    } else if (i == 30) {
      before = out.pair_distance();
      ASSERT_LT(before, 0.2);
    }
    after = out.pair_distance();
    if (i > 45) {
      ASSERT_EQ(out.mode, Mode::kRun);
    }
    q += 0.01 * out.qd;
  }
  EXPECT_GT(after, before + 0.02);
}

TEST(Controller, AnObstacleThatTouchesIsNotTakenForBody) {
  const auto robot = test::arm();
  Controller controller(robot, test::looking_back(), ControllerConfig{});
  const JointVector q = bent();
  const Pose goal = test::tool_at(*robot, q);
  int kept = 0;
  for (int i = 0; i < 60; ++i) {
    Scan scan;
    scan.counter = static_cast<std::uint32_t>(i);
    scan.stamp = 0.07 * i;
    scan.status.fill(255);
    const double range = std::min(0.08 + 0.005 * i, 0.25);
    scan.ranges[27] = range;
    scan.status[27] = 5;
    const TickOutput& out = controller.tick(0.07 * i, q, std::span(&scan, 1), goal);
    ASSERT_TRUE(out.pair.has_value()) << "lost at " << range << " m";
    if (!found(controller, Reason::kContact)) continue;
    ++kept;
    EXPECT_GE(out.mode, Mode::kDegraded);
    EXPECT_LT(out.trusted_distance, 0.05);
  }
  EXPECT_GT(kept, 10);
  // Gone, it is no contact any more; nor is what another zone then sees.
  Scan scan;
  scan.status.fill(255);
  for (int i = 60; i < 63; ++i) {
    scan.counter = static_cast<std::uint32_t>(i);
    scan.stamp = 0.07 * i;
    if (i > 60) {
      scan.ranges[28] = 0.1;
      scan.status[28] = 5;
    }
    const TickOutput& out = controller.tick(scan.stamp, q, std::span(&scan, 1), goal);
    EXPECT_EQ(out.pair.has_value(), i > 60);
    EXPECT_FALSE(found(controller, Reason::kContact)) << i;
  }
}

/// The signed distance from a point to a link: negative inside.
double signed_distance(const Robot& robot, const Posture& posture, int link, const Vector3& p_W) {
  const Vector3 p_L = posture.T_WL[static_cast<std::size_t>(link)].inverse() * p_W;
  const double distance = std::sqrt(robot.tree(link).nearest(p_L)->squared_distance);
  return robot.tree(link).inside(p_L) ? -distance : distance;
}

TEST(Controller, FromContactAndFromInsideEveryCommandLeadsOut) {
  const auto robot = test::arm();
  Random random(27);
  ControllerConfig config;
  config.monitor.stuck_after = 1e9;
  int led = 0, deep = 0;
  const int trials = test::repeats(300, 30'000);
  for (int trial = 0; trial < trials; ++trial) {
    const JointVector q = test::posture(random, 6);
    Posture posture = robot->make_posture(), next = robot->make_posture();
    robot->update(q, posture);
    // A point up to 10 mm under the surface of a link, or on it.
    const int link = 2 + trial % 5;
    const Points& v = robot->tree(link).vertices_L();
    const Vector3 surface_L = v.row(
        static_cast<Eigen::Index>(random.uniform(0, 1) * 0.999 * static_cast<double>(v.rows())));
    const Vector3 centre_L(0, 0, surface_L.z());
    const double depth = trial % 3 == 0 ? 0.0 : random.uniform(0.0, 0.01);
    const Vector3 inward = (centre_L - surface_L).normalized();
    const Vector3 p_W = posture.T_WL[static_cast<std::size_t>(link)] * (surface_L + depth * inward);
    Points points(1, 3);
    points.row(0) = p_W.transpose();
    Controller controller(robot, Skin{}, config);
    const TickOutput& out = controller.tick_known(0.0, q, points, posture.T_WT);
    if (!out.pair || out.pair->link != link || !inward.allFinite()) continue;
    ControlPair pair;
    pair.link = link;
    pair.control_W = out.pair->surface_W;
    pair.obstacle_W = p_W;
    pair.distance = out.trusted_distance;
    if (std::abs(out.trusted_distance) < 1e-6) continue;  // on the surface no slope is left to test
    if (opening_row(*robot, posture, pair).norm() < 0.1) continue;
    const double before = signed_distance(*robot, posture, link, p_W);
    const double dt = 1e-3;  // short, so that the slope decides
    robot->update(q + dt * out.qd, next);
    EXPECT_GT(signed_distance(*robot, next, link, p_W), before);
    ++led;
    deep += before < -1e-4 ? 1 : 0;
  }
  EXPECT_GT(led, 80);
  EXPECT_GT(deep, 40);
}

TEST(Controller, OnKnownPointsSilentSensorsSlowNothing) {
  const auto robot = test::arm();
  JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  const Points far = Points::Constant(1, 3, 3.0);
  Controller bare(robot, Skin{}, ControllerConfig{}),
      covered(robot, test::ring(10), ControllerConfig{});
  for (int i = 0; i < 50; ++i) {
    const JointVector qd = bare.tick_known(0.01 * i, q, far, goal).qd;
    EXPECT_EQ(covered.tick_known(0.01 * i, q, far, goal).qd, qd);
    q += 0.01 * qd;
  }
}

TEST(Controller, MotionIntoWhatASilentSensorSawIsHeld) {
  const auto robot = test::arm();
  Skin skin = test::ring(10);
  Controller controller(robot, skin, ControllerConfig{});
  Random random(25);
  JointVector q = bent();
  Posture posture = robot->make_posture();
  robot->update(q, posture);
  const int link = robot->link_row("link3");
  // The goal lies where sensor 0 looks.
  Pose goal = posture.T_WT;
  const Vector3 view_W =
      (posture.T_WL[static_cast<std::size_t>(link)] * skin.mounts[0].T_LS).linear().col(2);
  goal.translation() += 0.5 * view_W;
  bool held = false;
  for (int i = 0; i < 100; ++i) {
    auto batch = scans(random, 10, static_cast<std::uint32_t>(i), 0.01 * i, 1.0);
    if (i >= 40) batch.erase(batch.begin());
    const TickOutput& out = controller.tick(0.01 * i, q, batch, goal);
    if (i < 40) {
      EXPECT_EQ(out.mode, Mode::kRun);
    }
    held = held || (out.mode == Mode::kHold && found(controller, Reason::kBlindMotion));
    if (held) {
      EXPECT_LE(i, 60);
      break;
    }
    q += 0.01 * out.qd;
  }
  EXPECT_TRUE(held);
}

TEST(Controller, ARepeatedOrOlderScanIsRefused) {
  const auto robot = test::arm();
  Controller controller(robot, test::ring(), ControllerConfig{});
  Random random(12);
  const JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  const auto first = scans(random, 10, 5, 0.0);
  controller.tick(0.0, q, first, goal);
  const Points before = controller.cloud_W();
  controller.tick(0.01, q, scans(random, 10, 5, 0.01), goal);
  EXPECT_EQ(Points(controller.cloud_W()), before);
  EXPECT_EQ(controller.findings().front().reason, Reason::kScanRefused);
  controller.tick(0.02, q, scans(random, 10, 4, 0.02), goal);
  EXPECT_EQ(Points(controller.cloud_W()), before);
}

TEST(Controller, TheCloudStaysInWorldBetweenScans) {
  const auto robot = test::arm();
  Controller controller(robot, test::ring(), ControllerConfig{});
  Random random(13);
  JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  controller.tick(0.0, q, scans(random, 10, 1, 0.0), goal);
  const Points before = controller.cloud_W();
  ASSERT_GT(before.rows(), 0);
  q[0] += 0.3;
  controller.tick(0.01, q, {}, goal);
  EXPECT_EQ(Points(controller.cloud_W()), before);
}

TEST(Controller, AScanIsPlacedWhereTheArmWasAtItsStamp) {
  const auto robot = test::arm();
  ControllerConfig config;
  config.filter.surface_margin = false;
  config.filter.tolerance = 0.0;
  config.filter.sigmas = 0.0;
  Random random(14);
  const auto batch = scans(random, 10, 1, 0.015);  // halfway between two ticks
  const auto run = [&](bool moving) {
    Controller controller(robot, test::ring(), config);
    JointVector q = bent();
    const Pose goal = goal_near(*robot, q);
    for (int i = 0; i < 4; ++i) {
      if (moving) q[0] = 0.1 * i;
      if (!moving) q[0] = 0.15;
      controller.tick(0.01 * i, q, i == 3 ? batch : std::vector<Scan>{}, goal);
    }
    return Points(controller.raw_cloud_W());
  };
  EXPECT_LT((run(true) - run(false)).cwiseAbs().maxCoeff(), 1e-9);
}

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

TEST(Controller, TicksThatComeEarlyAccelerateByTheTimeThatHasPassed) {
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
    const JointVector most = std::min(step, 0.01) * robot->qdd_max();
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

TEST(Controller, WhatNoZoneTellsIsUnknownNotFree) {
  for (const bool nan : {true, false}) {
    const auto robot = test::arm();
    Controller controller(robot, test::ring(), ControllerConfig{});
    Random random(16);
    const JointVector q = bent();
    const Pose goal = goal_near(*robot, q);
    controller.tick(0.0, q, scans(random, 10, 0, 0.0), goal);
    const Points before = controller.cloud_W();
    Mode mode = Mode::kRun;
    for (int i = 1; i <= 20; ++i) {
      auto batch = scans(random, 10, static_cast<std::uint32_t>(i), 0.01 * i);
      for (Scan& scan : batch) {
        if (nan) scan.ranges.fill(std::nan(""));
        if (!nan) scan.status.fill(4);
      }
      mode = controller.tick(0.01 * i, q, batch, goal).mode;
    }
    EXPECT_EQ(Points(controller.cloud_W()), before);
    EXPECT_EQ(mode, Mode::kHold);
  }
}

TEST(Controller, AScanOfLongAgoIsRefused) {
  const auto robot = test::arm();
  Controller controller(robot, test::ring(), ControllerConfig{});
  Random random(17);
  const JointVector q = bent();
  const Pose goal = goal_near(*robot, q);
  double time = 5.0;
  for (const double stamp : {-kInfinity, 4.0, std::nan(""), 6.0}) {
    time += 0.01;
    controller.tick(time, q, scans(random, 10, 1, stamp), goal);
    EXPECT_EQ(controller.cloud_W().rows(), 0);
    EXPECT_EQ(controller.findings().front().reason, Reason::kScanRefused);
  }
}

TEST(Controller, ASkinWithoutSensorsHoldsTheArm) {
  const auto robot = test::arm();
  Controller controller(robot, Skin{}, ControllerConfig{});
  const JointVector q = bent();
  const TickOutput& out = controller.tick(0.0, q, {}, goal_near(*robot, q));
  EXPECT_EQ(out.mode, Mode::kHold);
  EXPECT_EQ(out.qd, JointVector::Zero(6));
  // What is missing of each task is judged by what is issued: here, all of it.
  EXPECT_EQ(out.tasks[1].residual, out.tasks[1].rate);
}

TEST(Controller, RefusesContradictions) {
  const auto robot = test::arm();
  EXPECT_THROW(Controller(robot, test::ring(3, "no_such_link"), ControllerConfig{}), ModelError);
  ControllerConfig config;
  config.tasks.clear();
  EXPECT_THROW(Controller(robot, Skin{}, config), ConfigError);
  config = ControllerConfig{};
  config.avoid_links = {"link2", "link2"};
  EXPECT_THROW(Controller(robot, Skin{}, config), ConfigError);
  config = ControllerConfig{.control_point = ControlPoint::kSensor};
  EXPECT_THROW(Controller(robot, test::ring(3, "link0"), config), ConfigError);
  config = ControllerConfig{};
  config.period = 0.0;
  EXPECT_THROW(Controller(robot, Skin{}, config), ConfigError);
  config = ControllerConfig{};
  config.filter.tolerance = std::nan("");
  EXPECT_THROW(Controller(robot, Skin{}, config), ConfigError);
}

}  // namespace
}  // namespace proxcgal
