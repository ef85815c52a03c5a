#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <vector>

#include "proxcgal/controller.hpp"
#include "proxcgal/error.hpp"
#include "robots.hpp"
#include "voxel_index.hpp"

namespace proxcgal {
namespace {

using test::Random;

const ViewModel kModel{0.7853981633974483, 0.005, 0.015, 4.0};

/// A scan along world z from the origin: every zone ends at `range`, with or without an obstacle.
ScanView view(double stamp, float range, float obstacle = 0.0F) {
  ScanView scan;
  scan.stamp = stamp;
  scan.empty_to.fill(range);
  scan.obstacle.fill(obstacle);
  return scan;
}

RememberedPoint point(double x, double y, double z, double stamp = 0.0) {
  return {Vector3(x, y, z), stamp, 0.02, {3, 27}};
}

struct Remembering : testing::Test {
  std::shared_ptr<Robot> robot = test::arm();
  Posture posture = robot->make_posture();
  Memory memory{MemoryConfig{}, kModel, 1};

  void leave(const RememberedPoint& left, const ScanView& now) {
    memory.leave({&left, 1}, now, *robot, posture);
  }
  Eigen::Index count() const { return memory.points_W().rows(); }
};

TEST_F(Remembering, WhatLeavesTheViewStaysUntilItIsOld) {
  leave(point(2.0, 0.0, 0.5), view(0.07, 1.0F));  // beside the field of view
  memory.update(2.0);
  ASSERT_EQ(count(), 1);
  EXPECT_EQ(Vector3(memory.points_W().row(0).transpose()), Vector3(2.0, 0.0, 0.5));
  EXPECT_EQ(memory.origins()[0].sensor, 3);
  EXPECT_EQ(memory.origins()[0].zone, 27);
  EXPECT_EQ(memory.stamps()[0], 0.0);
  memory.update(2.001);
  EXPECT_EQ(count(), 0);
}

TEST_F(Remembering, OneScanThatSeesThroughAPointIsNotEnoughAndTwoAre) {
  leave(point(0.01, 0.01, 0.5), view(0.07, 1.0F));
  memory.update(0.07);
  EXPECT_EQ(count(), 1);
  memory.see(0, view(0.07, 1.0F));  // the same scan again proves nothing more
  memory.update(0.07);
  EXPECT_EQ(count(), 1);
  memory.see(0, view(0.14, 1.0F));
  memory.update(0.14);
  EXPECT_EQ(count(), 0);
}

TEST_F(Remembering, AScanThatSeesTheSurfaceAgainStandsForIt) {
  leave(point(0.01, 0.01, 0.5), view(0.07, 0.51F, 0.51F));
  memory.update(0.07);
  EXPECT_EQ(count(), 0);
}

TEST_F(Remembering, ASensorThatPassesASurfaceSlowlyLeavesAllItSawBehind) {
  // 5 mm a scan, where a zone is 49 mm wide: each scan's points are beside the last one's.
  Memory long_one({.memory_s = 60.0}, kModel, 1);
  const auto scan_at = [](int k) {
    ScanView scan = view(0.07 * k, 0.5F, 0.5F);
    scan.T_WS.translation().x() = 0.005 * k;
    return scan;
  };
  const double pitch = kModel.field_of_view / 8.0;
  const auto points = [&](int k) {
    std::vector<RememberedPoint> out;
    for (int zone = 0; zone < kZones; ++zone) {
      const double x = 0.5 * std::tan((zone % 8 - 3.5) * pitch);
      const double y = 0.5 * std::tan((zone / 8 - 3.5) * pitch);
      out.push_back(point(0.005 * k + x, y, 0.5, 0.07 * k));
    }
    return out;
  };
  constexpr int scans = 200;  // 1 m
  for (int k = 0; k < scans; ++k) {
    long_one.leave(points(k), scan_at(k + 1), *robot, posture);
    long_one.see(0, scan_at(k + 1));
    long_one.update(0.07 * (k + 1));
  }
  const auto held_W = long_one.points_W();
  const double voxel = MemoryConfig{}.voxel;
  for (int k = 0; k < scans - 100; ++k) {  // what has left the view by now
    for (const RememberedPoint& seen : points(k)) {
      const auto apart = held_W.rowwise() - seen.point_W.transpose();
      EXPECT_LT(apart.rowwise().norm().minCoeff(), std::sqrt(3.0) * voxel) << k;
    }
  }
  EXPECT_LT(held_W.rows(), 8 * 30);  // one a voxel: no scan heaps up what the last one left
}

TEST_F(Remembering, WhatIsNotClearlySeenThroughStays) {
  ScanView beside = view(0.07, 1.0F);
  beside.empty_to[27] = 0.5F;  // one of the four rays round the point ends there
  ScanView invalid = view(0.07, 1.0F);
  invalid.empty_to[36] = 0.0F;               // or tells nothing
  const ScanView body = view(0.07, 0.3F);    // all end before it, on the robot itself
  const ScanView noisy = view(0.07, 0.54F);  // or beyond it by no more than noise
  int kept = 0;
  for (ScanView scan : {beside, invalid, body, noisy}) {
    leave(point(0.01, 0.01, 0.5), scan);
    for (const double stamp : {0.14, 0.21, 0.28}) {
      scan.stamp = stamp;
      memory.see(0, scan);
      memory.update(stamp);
    }
    EXPECT_EQ(count(), 1) << kept;
    ++kept;
  }
}

TEST_F(Remembering, FarRaysOnBothSidesOfAPointProveNothing) {
  // Between two middle rays at 2 m: 98 mm to either side, more than its voxel reaches.
  leave(point(0.0, 0.0, 2.0), view(0.07, 3.0F));
  for (const double stamp : {0.14, 0.21, 0.28}) {
    memory.see(0, view(stamp, 3.0F));
    memory.update(stamp);
  }
  EXPECT_EQ(count(), 1);
}

TEST_F(Remembering, AFullMemoryNeverDropsTheNearest) {
  Memory small({.max_points = 64}, kModel, 1);
  Random random(3);
  const ScanView elsewhere = [] {
    ScanView scan = view(0.07, 0.0F);
    scan.T_WS.translation() = Vector3(0, 0, 100.0);
    return scan;
  }();
  Points all(5000, 3);
  for (Eigen::Index i = 0; i < all.rows(); ++i) {
    all.row(i) = random.vector(3.0).transpose();
    const RememberedPoint left = point(all(i, 0), all(i, 1), all(i, 2));
    small.leave({&left, 1}, elsewhere, *robot, posture);
  }
  ASSERT_GT(small.points_W().rows(), 16);
  ASSERT_LE(small.points_W().rows(), 64);
  const double kept = closest_pair(*robot, posture, small.points_W(), Method::kFast).distance;
  EXPECT_EQ(kept, closest_pair(*robot, posture, all, Method::kFast).distance);
}

TEST_F(Remembering, TheHeldPointOutlivesAnyCrowd) {
  Memory small({.max_points = 16}, kModel, 1);
  const ScanView elsewhere = view(0.07, 0.0F);
  const RememberedPoint far = point(5.0, 5.0, 5.0);
  small.leave({&far, 1}, elsewhere, *robot, posture);
  small.hold(0);
  Random random(4);
  for (int i = 0; i < 2000; ++i) {
    const Vector3 at = random.vector(1.0);
    const RememberedPoint left = point(at.x(), at.y(), at.z());
    small.leave({&left, 1}, elsewhere, *robot, posture);
    ASSERT_GE(small.held(), 0);
    ASSERT_EQ(Vector3(small.points_W().row(small.held()).transpose()), far.point_W);
  }
}

TEST(MemoryConfig, RefusesWhatCannotBe) {
  EXPECT_THROW(MemoryConfig{.memory_s = -1.0}.validate(), ConfigError);
  EXPECT_THROW(MemoryConfig{.memory_s = kInfinity}.validate(), ConfigError);
  EXPECT_THROW(MemoryConfig{.voxel = 0.0}.validate(), ConfigError);
  EXPECT_THROW(MemoryConfig{.max_points = 0}.validate(), ConfigError);
  EXPECT_THROW(MemoryConfig{.clear_scans = 0}.validate(), ConfigError);
  EXPECT_THROW(MotionConfig{.window = 0.0}.validate(), ConfigError);
  EXPECT_THROW(MotionConfig{.radius = kInfinity}.validate(), ConfigError);
}

TEST(VoxelIndex, FindsWhatAMapFinds) {
  detail::VoxelIndex index(0.05, 300);
  std::map<detail::VoxelIndex::Key, int> oracle;
  Random random(5);
  for (int i = 0; i < 20000; ++i) {
    const auto key = index.key(random.vector(0.25));
    const auto there = oracle.find(key);
    ASSERT_EQ(index.find(key), there == oracle.end() ? detail::VoxelIndex::kNone : there->second);
    if (there != oracle.end()) {
      index.erase(key);
      oracle.erase(there);
    } else if (oracle.size() < 300) {
      index.put(key, i);
      oracle[key] = i;
    }
  }
}

/// Nearly normal, never beyond three standard deviations.
double noise(Random& random, double sigma) {
  return sigma * (random.uniform(-1, 1) + random.uniform(-1, 1) + random.uniform(-1, 1));
}

/// Points of a surface as a moving sensor might pick them: other ones at every scan.
template <class Surface>
Vector3 tracked(Random& random, const Vector3& velocity, Surface&& surface, int scans = 4) {
  Motion motion(MotionConfig{}, 10);
  const double last = (scans - 1) / 15.0;
  for (int scan = 0; scan < scans; ++scan) {
    const double stamp = scan / 15.0;
    std::vector<Vector3> points;
    for (int i = 0; i < 40; ++i) {
      // The patch that is sampled slides by 0.5 m/s.
      const Vector3 sampled =
          surface(random.uniform(-0.12, 0.12) + 0.5 * (stamp - last), random.uniform(-0.12, 0.12));
      points.push_back(sampled + velocity * (stamp - last) + Vector3(0, 0, noise(random, 0.006)));
    }
    motion.see(stamp, points);
  }
  return motion.velocity_W(last, surface(0.0, 0.0));
}

TEST(Motion, AStillSurfaceThatIsSampledAnewShowsNoVelocity) {
  Random random(6);
  int fast = 0;
  constexpr int trials = 300;
  for (int trial = 0; trial < trials; ++trial) {
    const double tilt = random.uniform(-0.5, 0.5);
    const auto plane = [&](double u, double w) { return Vector3(u, w, 0.8 + tilt * u); };
    const auto ball = [&](double u, double w) {
      return Vector3(u, w, 0.8 - std::sqrt(std::max(0.04 - u * u - w * w, 0.0)));
    };
    if (tracked(random, Vector3::Zero(), plane).norm() > 0.05) ++fast;
    if (tracked(random, Vector3::Zero(), ball).norm() > 0.05) ++fast;
  }
  EXPECT_LE(fast, 2 * trials / 100);  // the 99th percentile
}

TEST(Motion, ThreeScansTellTheVelocityOfWhatComesNearer) {
  Random random(7);
  const Vector3 velocity(0, 0, -0.5);
  for (int trial = 0; trial < 100; ++trial) {
    const auto plane = [](double u, double w) { return Vector3(u, w, 0.8); };
    EXPECT_LT((tracked(random, velocity, plane, 3) - velocity).norm(), 0.1);
  }
  // Two do not.
  const auto plane = [](double u, double w) { return Vector3(u, w, 0.8); };
  EXPECT_EQ(tracked(random, velocity, plane, 2), Vector3(Vector3::Zero()));
}

TEST(Motion, WhatWasNotSeenForAWhileHasNoVelocity) {
  Motion motion(MotionConfig{}, 1);
  Random random(8);
  for (int scan = 0; scan < 4; ++scan) {
    std::vector<Vector3> points;
    for (int i = 0; i < 40; ++i)
      points.emplace_back(random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1), -0.5 * scan / 15.0);
    motion.see(scan / 15.0, points);
  }
  EXPECT_GT(motion.velocity_W(0.21, Vector3(0, 0, -0.1)).norm(), 0.4);
  EXPECT_EQ(motion.velocity_W(0.31, Vector3(0, 0, -0.1)), Vector3(Vector3::Zero()));
}

TEST(Motion, ASensorWithOldStampsHidesNothingFromIt) {
  Motion motion(MotionConfig{}, 2);
  Random random(10);
  for (int scan = 0; scan < 4; ++scan) {
    std::vector<Vector3> points;
    for (int i = 0; i < 40; ++i)
      points.emplace_back(random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1), -0.5 * scan / 15.0);
    motion.see(scan / 15.0, points);
    motion.see(scan / 15.0 - 0.4, points);
  }
  EXPECT_GT(motion.velocity_W(0.21, Vector3(0, 0, -0.1)).norm(), 0.4);
}

/// A controller with memory on the test arm, and a wall before all its sensors that goes away.
struct WithMemory : testing::Test {
  static ControllerConfig config() { return {.memory = MemoryConfig{}, .motion = MotionConfig{}}; }
  std::shared_ptr<Robot> robot = test::arm();
  Controller controller{robot, test::ring(), config()};
  JointVector q = JointVector::Constant(6, 0.3);
  Pose goal = Pose::Identity();
  std::uint32_t counter = 0;

  const TickOutput& tick(double time, double range, std::uint8_t status) {
    std::vector<Scan> scans;
    for (int s = 0; s < 10; ++s) {
      Scan scan{.sensor = s, .counter = ++counter, .stamp = time};
      scan.ranges.fill(range);
      scan.status.fill(status);
      scans.push_back(scan);
    }
    return controller.tick(time, q, scans, goal);
  }
};

TEST_F(WithMemory, AnInvalidScanLeavesTheLastCloudAndAnEmptyOneClearsIt) {
  tick(0.0, 0.3, 5);
  const Eigen::Index seen = controller.seen_points();
  ASSERT_GT(seen, 100);
  tick(0.07, 0.0, 0);  // tells nothing
  EXPECT_EQ(controller.seen_points(), seen);
  const TickOutput& out = tick(0.14, 0.0, 255);
  EXPECT_EQ(controller.seen_points(), 0);
  ASSERT_TRUE(out.pair);
  EXPECT_TRUE(out.pair_remembered);
  EXPECT_NEAR(out.pair_age, 0.14, 1e-12);
  EXPECT_GE(out.pair_origin.sensor, 0);
  EXPECT_GE(out.pair_origin.zone, 0);
  for (const double age : controller.cloud_ages(0.14)) EXPECT_NEAR(age, 0.14, 1e-12);
  const Eigen::Index before = controller.cloud_W().rows();
  tick(0.21, 0.0, 255);
  EXPECT_LT(controller.cloud_W().rows(), before / 3);  // what only the outermost rays pass is left
  for (int i = 0; i < 40; ++i) tick(0.28 + 0.05 * i, 0.0, 255);
  EXPECT_EQ(controller.cloud_W().rows(), 0);
}

TEST_F(WithMemory, WhereTheArmIsNothingIsRemembered) {
  tick(0.0, 0.3, 5);
  JointVector moved = q;
  for (int step = 0; step < 30; ++step) {
    q = moved + JointVector::Constant(6, 0.04 * step);  // through where the wall was
    const TickOutput& out = tick(0.05 + 0.01 * step, 0.0, step % 2 == 0 ? 255 : 0);
    EXPECT_GT(out.pair_distance(), 0.02);
  }
}

TEST_F(WithMemory, AStuckPayloadClearsNothingAndIsNotRememberedOnceItEnds) {
  Skin twice = test::ring(2);  // both look the same way
  twice.mounts[1].T_LS = twice.mounts[0].T_LS;
  Controller law(robot, twice, config());
  const auto told = [](int sensor, int index, double range, int zones) {
    Scan scan{.sensor = sensor, .counter = static_cast<std::uint32_t>(index)};
    scan.stamp = 0.07 * index;
    scan.ranges.fill(range);
    scan.status.fill(0);  // tells nothing
    std::fill_n(scan.status.begin(), zones, std::uint8_t{5});
    return scan;
  };
  const auto remembered = [&] { return law.cloud_W().rows() - law.seen_points(); };
  constexpr int lost = 10, over = 16;
  for (int i = 0; i < over; ++i) {
    // The first sees something that comes slowly, then only a corner of it; the other is stuck.
    const std::vector<Scan> scans{told(0, i, 0.3 - 1e-3 * i, i < lost ? kZones : 1),
                                  told(1, i, 0.9, kZones)};
    law.tick(0.07 * i, q, scans, goal);
    if (i >= lost) {
      EXPECT_GT(remembered(), 20) << i;
    }
  }
  const Eigen::Index before = remembered();
  const std::vector<Scan> ends{told(0, over, 0.2, 1), told(1, over, 0.9, 1)};
  law.tick(0.07 * over, q, ends, goal);
  EXPECT_EQ(remembered(), before);
}

TEST_F(WithMemory, WithoutItEverythingIsAsItWas) {
  ControllerConfig off;
  off.memory = MemoryConfig{.memory_s = 0.0};
  Controller plain(robot, test::ring(), ControllerConfig{}), none(robot, test::ring(), off);
  Random random(9);
  for (int i = 0; i < 200; ++i) {
    std::vector<Scan> scans;
    for (int s = 0; i % 7 == 0 && s < 10; ++s) {
      Scan scan{.sensor = s, .counter = static_cast<std::uint32_t>(i + 1), .stamp = 0.01 * i};
      for (double& range : scan.ranges) range = random.uniform(0.15, 1.2);
      scan.status.fill(5);
      scans.push_back(scan);
    }
    const JointVector qd = plain.tick(0.01 * i, q, scans, goal).qd;
    EXPECT_EQ(none.tick(0.01 * i, q, scans, goal).qd, qd);
    EXPECT_EQ(none.cloud_W(), plain.cloud_W());
  }
}

}  // namespace
}  // namespace proxcgal
