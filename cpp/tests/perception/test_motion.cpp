#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "meshes.hpp"
#include "proxcgal/perception/motion.hpp"

namespace proxcgal {
namespace {

using test::Random;

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

/// Of a plate at 0.8 m that comes at 0.5 m/s, after three scans of so many points: z [m/s].
double told_of_plate(Random& random, double half, int points) {
  Motion motion(MotionConfig{}, 10);
  for (int scan = 0; scan < 3; ++scan) {
    std::vector<Vector3> points_W;
    for (int i = 0; i < points; ++i) {
      const double z = 0.8 - 0.5 * (scan - 2) / 15.0 + noise(random, 0.006);
      points_W.emplace_back(random.uniform(-half, half), random.uniform(-half, half), z);
    }
    motion.see(scan / 15.0, points_W);
  }
  return motion.velocity_W(2 / 15.0, Vector3(0, 0, 0.8)).z();
}

TEST(Motion, FromSixCentimetresOnTheSizeOfAPlateThatComesNearerMattersLittle) {
  Random random(16);
  for (int trial = 0; trial < 1000; ++trial) {
    const double half = random.uniform(0.03, 0.15);
    EXPECT_NEAR(told_of_plate(random, half, 40), -0.5, 0.1) << half;
  }
}

TEST(Motion, TenPointsAScanTellTheVelocityOfASmallPlate) {
  Random random(17);
  int off = 0;
  constexpr int trials = 1000;
  for (int trial = 0; trial < trials; ++trial) {
    const double half = random.uniform(0.03, 0.05), told = told_of_plate(random, half, 10);
    if (std::abs(told + 0.5) > 0.1) ++off;
    EXPECT_GT(told, -0.6) << half;
    EXPECT_LE(told, 0.0) << half;
  }
  EXPECT_LE(off, trials / 50);
}

/// A plate before one sensor that moves, as far as its zones meet it: often at the view's edge.
struct PlateInView {
  double half, at_z;
  Vector3 velocity = Vector3::Zero(), sensor = Vector3::Zero();  // [m/s] of plate and sensor
  Vector3 middle;                                                // at the last scan
  int fewest = kZones;                                           // zones on it, of all scans

  explicit PlateInView(Random& random)
      : half(random.uniform(0.03, 0.15)), at_z(random.uniform(0.25, 0.8)) {
    const double edge = at_z * std::tan(0.3927) + 0.5 * half;
    middle = Vector3(random.uniform(-edge, edge), random.uniform(-edge, edge), at_z);
  }

  Vector3 told(Random& random) {
    Motion motion(MotionConfig{}, 1);
    Vector3 anchor = Vector3::Constant(kInfinity);
    for (int scan = 0; scan < 3; ++scan) {
      const double ago = (scan - 2) / 15.0;
      const Vector3 from = sensor * ago, plate = middle + velocity * ago;
      std::vector<Vector3> points_W;
      for (int zone = 0; zone < kZones; ++zone) {
        const int column = zone % 8, row = zone / 8;
        const Vector3 ray(std::tan((column - 3.5) * 0.09817), std::tan((row - 3.5) * 0.09817), 1.0);
        const double range = plate.z() - from.z();
        const Vector3 hit = from + range * ray - plate;
        if (std::abs(hit.x()) > half || std::abs(hit.y()) > half) continue;
        const double sigma = std::max(0.005, 0.015 * range);
        points_W.emplace_back(from + (range + noise(random, sigma)) * ray);
      }
      fewest = std::min(fewest, static_cast<int>(points_W.size()));
      motion.see(scan / 15.0, points_W);
      anchor = Vector3::Constant(kInfinity);
      for (const Vector3& point : points_W)
        if (point.norm() < anchor.norm()) anchor = point;
    }
    return fewest > 0 ? motion.velocity_W(2 / 15.0, anchor) : Vector3(Vector3::Zero());
  }
};

TEST(Motion, APlateThatAMovingSensorSeesAtTheEdgeOfItsViewStandsStill) {
  Random random(18);
  int seen = 0, fast = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    PlateInView plate(random);
    plate.sensor = random.vector(0.3);
    const double speed = plate.told(random).norm();
    if (plate.fewest > 0) ++seen;
    if (speed > 0.05) ++fast;
  }
  EXPECT_GT(seen, 1000);
  EXPECT_LE(fast, seen / 100);  // the 99th percentile
}

TEST(Motion, OfAPlateAtTheEdgeOfTheViewMoreThanItsVelocityIsNeverTold) {
  Random random(19);
  int seen = 0, off = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    PlateInView plate(random);
    plate.sensor = random.vector(0.3);
    plate.velocity.z() = -0.5;
    const double told = plate.told(random).z();
    EXPECT_GT(told, -0.65) << plate.half;
    EXPECT_LT(told, 0.05) << plate.half;
    if (plate.fewest < 6) continue;  // it may be too few to tell
    ++seen;
    if (std::abs(told + 0.5) > 0.1) ++off;
  }
  EXPECT_GT(seen, 500);
  EXPECT_LE(off, seen / 10);
}

TEST(Motion, WhatWasNotSeenForAWhileHasNoVelocity) {
  Motion motion(MotionConfig{}, 1);
  Random random(8);
  for (int scan = 0; scan < 4; ++scan) {
    std::vector<Vector3> points;
    points.reserve(40);
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
    points.reserve(40);
    for (int i = 0; i < 40; ++i)
      points.emplace_back(random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1), -0.5 * scan / 15.0);
    motion.see(scan / 15.0, points);
    motion.see(scan / 15.0 - 0.4, points);
  }
  EXPECT_GT(motion.velocity_W(0.21, Vector3(0, 0, -0.1)).norm(), 0.4);
}

}  // namespace
}  // namespace proxcgal
