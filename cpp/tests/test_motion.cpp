#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "meshes.hpp"
#include "proxcgal/pipeline/motion.hpp"

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

TEST(Motion, FromATenthOfAMetreOnTheSizeOfAPlateThatComesNearerMattersLittle) {
  Random random(16);
  const Vector3 velocity(0, 0, -0.5);
  for (int trial = 0; trial < 200; ++trial) {
    const double half = random.uniform(0.05, 0.15);
    Motion motion(MotionConfig{}, 10);
    for (int scan = 0; scan < 3; ++scan) {
      std::vector<Vector3> points;
      for (int i = 0; i < 40; ++i) {
        const Vector3 on(random.uniform(-half, half), random.uniform(-half, half), 0.8);
        points.push_back(on + velocity * ((scan - 2) / 15.0) + Vector3(0, 0, noise(random, 0.006)));
      }
      motion.see(scan / 15.0, points);
    }
    const Vector3 told = motion.velocity_W(2 / 15.0, Vector3(0, 0, 0.8));
    EXPECT_LT(std::abs(told.z() - velocity.z()), 0.1) << half;
  }
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

}  // namespace
}  // namespace proxcgal
