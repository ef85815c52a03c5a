#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <vector>

#include "geometry/voxel_index.hpp"
#include "perception/perception.hpp"
#include "proxcgal/control/controller.hpp"
#include "proxcgal/error.hpp"
#include "proxcgal/pipeline/distance.hpp"
#include "robots.hpp"

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

TEST_F(Remembering, AFullMemoryNeverDropsTheNearestAmongThoseInsideALinksBox) {
  // Most of these lie in the boxes of links, to which all are then equally near.
  const ScanView elsewhere = [] {
    ScanView scan = view(0.07, 0.0F);
    scan.T_WS.translation() = Vector3(0, 0, 100.0);
    return scan;
  }();
  Random random(13);
  for (int max_points : {3, 5, 16, 64}) {
    const MemoryConfig config{.voxel = 0.005, .max_points = max_points};
    Memory small(config, kModel, 1);
    robot->update(test::posture(random, 6), posture);
    std::set<detail::VoxelIndex::Key> voxels;
    const detail::VoxelIndex index(config.voxel, 1);
    Points all(2000, 3);
    Eigen::Index n = 0;
    while (n < all.rows()) {
      const auto link = static_cast<std::size_t>(random.uniform(0.0, 6.99));
      Vector3 at_L = random.vector(0.07);
      at_L.z() = random.uniform(0.0, 0.28);
      const RememberedPoint left{posture.T_WL[link] * at_L, 0.0, 0.0, {}};
      // One point a voxel: the next would take its place.
      if (!voxels.insert(index.key(left.point_W)).second) continue;
      all.row(n++) = left.point_W.transpose();
      small.leave({&left, 1}, elsewhere, *robot, posture);
      ASSERT_LE(small.points_W().rows(), max_points);
    }
    const double kept = closest_pair(*robot, posture, small.points_W(), Method::kFast).distance;
    EXPECT_EQ(kept, closest_pair(*robot, posture, all, Method::kFast).distance) << max_points;
  }
}

/// What Memory says of a point and a scan whose zones all tell nothing but where they end, counted
/// anew in double precision; nothing where it is too close to call.
std::optional<bool> seen_through(const ScanView& scan, const Vector3& point_W, double voxel) {
  constexpr double close = 1e-4;
  const Vector3 p = scan.T_WS.inverse() * point_W;
  const double pitch = kModel.field_of_view / 8.0, noise = kModel.sigmas * 0.015;
  if (p.z() < 0.03) return p.z() < 0.01 ? std::optional(false) : std::nullopt;
  const double far = std::max(noise * p.z(), kModel.sigmas * kModel.sigma_floor) + 0.5 * voxel;
  const double column = std::atan2(p.x(), p.z()) / pitch + 3.5;
  const double row = std::atan2(p.y(), p.z()) / pitch + 3.5;
  for (const double at : {column, row}) {
    if (at < -0.5 - close || at > 7.5 + close) return false;
    if (std::abs(at - std::round(at)) < close || std::abs(at - std::floor(at) - 0.5) < close)
      return std::nullopt;
  }
  std::vector<int> zones;
  if (std::min(column, row) < 0.0 || std::max(column, row) > 7.0) {
    zones = {8 * static_cast<int>(std::round(row)) + static_cast<int>(std::round(column))};
  } else {
    for (const int corner : {0, 1, 8, 9})
      zones.push_back(8 * static_cast<int>(row) + static_cast<int>(column) + corner);
  }
  bool beyond = true;
  double nearest = kInfinity;
  for (const int zone : zones) {
    const double end = scan.empty_to[static_cast<std::size_t>(zone)];
    if (std::abs(end - p.z() - far) < close) return std::nullopt;
    beyond = beyond && end > p.z() + far;
    const double x = p.z() * std::tan((zone % 8 - 3.5) * pitch) - p.x();
    const double y = p.z() * std::tan((zone / 8 - 3.5) * pitch) - p.y();
    nearest = std::min(nearest, std::hypot(x, y));
  }
  const double round = 0.5 * std::sqrt(3.0) * voxel;
  if (std::abs(nearest - round) < close) return std::nullopt;
  return beyond && nearest < round;
}

TEST_F(Remembering, WhatIsSeenThroughIsClearedWithinThreeTenthsAndNothingElse) {
  constexpr int sensors = 30, points = 1024;
  Random random(14);
  int cleared = 0, stayed = 0;
  for (int trial = 0; trial < 5; ++trial) {
    const MemoryConfig config{.max_points = points};
    Memory crowded(config, kModel, sensors);
    std::vector<ScanView> scans;
    for (int s = 0; s < sensors; ++s) {
      ScanView scan = view(0.0, 0.0F);
      scan.T_WS.translation() = random.vector(0.3);
      scan.T_WS.linear() = Eigen::Quaterniond::FromTwoVectors(Vector3::UnitZ(), random.vector(1.0))
                               .toRotationMatrix();
      for (float& end : scan.empty_to) end = random.uniform(0.0, 1.0) < 0.1 ? 0.4F : 2.0F;
      scans.push_back(scan);
    }
    std::vector<RememberedPoint> put;
    std::set<detail::VoxelIndex::Key> voxels;
    const detail::VoxelIndex index(config.voxel, 1);
    while (put.size() < static_cast<std::size_t>(points)) {
      const Vector3 at = random.vector(0.9);
      if (!voxels.insert(index.key(at)).second) continue;
      put.push_back({at, 0.0, 0.02, {0, static_cast<int>(put.size() % 64)}});
      ScanView elsewhere = view(0.0, 0.0F);
      elsewhere.T_WS.translation() = Vector3(0, 0, 100.0);
      crowded.leave({&put.back(), 1}, elsewhere, *robot, posture);
    }
    // The sensors' scans come one after the other, 15 a second of each, 100 ticks a second.
    for (int tick = 0; tick < 30; ++tick) {
      const double time = 0.01 * (tick + 1);
      for (int s = 0; s < sensors; ++s) {
        ScanView& scan = scans[static_cast<std::size_t>(s)];
        const double due = std::floor(15.0 * time + s / 30.0) / 15.0 - s / 450.0;
        if (!(due > scan.stamp)) continue;
        scan.stamp = due;
        crowded.see(static_cast<std::size_t>(s), scan);
      }
      crowded.update(time);
    }
    std::set<std::array<double, 3>> left;
    for (Eigen::Index i = 0; i < crowded.points_W().rows(); ++i) {
      const auto row = crowded.points_W().row(i);
      left.insert({row.x(), row.y(), row.z()});
    }
    for (const RememberedPoint& one : put) {
      bool through = false, known = true;
      for (const ScanView& scan : scans) {
        const auto told = seen_through(scan, one.point_W, config.voxel);
        through = through || told.value_or(false);
        known = known && told.has_value();
      }
      if (!through && !known) continue;
      const bool there = left.contains({one.point_W.x(), one.point_W.y(), one.point_W.z()});
      EXPECT_EQ(there, !through) << one.point_W.transpose();
      (through ? cleared : stayed) += 1;
    }
  }
  EXPECT_GT(cleared, 500);
  EXPECT_GT(stayed, 500);
}

TEST_F(Remembering, EveryPointIsLookedAtThoughScansComeFasterThanARoundTakes) {
  Memory crowded({.voxel = 0.005, .max_points = 20000}, kModel, 1);
  ScanView elsewhere = view(0.0, 0.0F);
  elsewhere.T_WS.translation() = Vector3(0, 0, 100.0);
  for (int i = 0; i < 49 * 200; ++i) {
    // Along the middle rays of the zones, a little to the inside; then as many out of view.
    const auto ray = [](int zone) { return std::tan((zone - 3.49) * kModel.field_of_view / 8.0); };
    const double z = 0.3 + 0.005 * (i / 49);
    const RememberedPoint left = point(z * ray(i % 7), z * ray(i / 7 % 7), z);
    crowded.leave({&left, 1}, elsewhere, *robot, posture);
  }
  constexpr int aside = 49 * 200;
  for (int i = 0; i < aside; ++i) {
    const RememberedPoint left = point(5.0 + 0.006 * (i % 100), 0.006 * (i / 100), 0.5);
    crowded.leave({&left, 1}, elsewhere, *robot, posture);
  }
  ASSERT_GT(crowded.points_W().rows(), aside + 8000);
  for (int tick = 1; tick <= 20; ++tick) {
    crowded.see(0, view(0.01 * tick, 3.0F));  // one at every tick
    crowded.update(0.01 * tick);
  }
  EXPECT_EQ(crowded.points_W().rows(), aside);
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
  EXPECT_THROW(validate(MemoryConfig{.memory_s = -1.0}), ConfigError);
  EXPECT_THROW(validate(MemoryConfig{.memory_s = kInfinity}), ConfigError);
  EXPECT_THROW(validate(MemoryConfig{.voxel = 0.0}), ConfigError);
  EXPECT_THROW(validate(MemoryConfig{.max_points = 2}), ConfigError);
  EXPECT_THROW(validate(MemoryConfig{.clear_scans = 0}), ConfigError);
  EXPECT_THROW(validate(MotionConfig{.window = 0.0}), ConfigError);
  EXPECT_THROW(validate(MotionConfig{.radius = kInfinity}), ConfigError);
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

}  // namespace
}  // namespace proxcgal
