#include <gtest/gtest.h>

#include <cmath>

#include "meshes.hpp"
#include "proxcgal/geometry/capsule.hpp"

namespace proxcgal {
namespace {

using test::Random;

/// Least over a grid of points of both axes: never less than the truth.
double by_search(const Capsule& a, const Capsule& b, int steps = 60) {
  double least = kInfinity;
  for (int i = 0; i <= steps; ++i) {
    const Vector3 point = a.at(double(i) / steps);
    least = std::min(least, (point - b.at(nearest_share(point, b.start, b.end))).norm());
  }
  return least - a.radius - b.radius;
}

Capsule random_capsule(Random& random) {
  return {random.vector(1.0), random.vector(1.0), random.uniform(0.0, 0.3)};
}

TEST(Capsule, DistanceIsTheLeastOfAllPoints) {
  Random random(1);
  for (int i = 0; i < 500; ++i) {
    const Capsule a = random_capsule(random), b = random_capsule(random);
    const double distance = closest(a, b).distance, searched = by_search(a, b);
    EXPECT_LE(distance, searched + 1e-12);
    EXPECT_GE(distance, searched - 2.0 / 60.0);
  }
}

TEST(Capsule, WitnessesLieOnTheSurfacesAndAreTheDistanceApart) {
  Random random(2);
  for (int i = 0; i < 500; ++i) {
    const Capsule a = random_capsule(random), b = random_capsule(random);
    const CapsulePair pair = closest(a, b);
    EXPECT_NEAR(pair.normal.norm(), 1.0, 1e-12);
    EXPECT_NEAR((pair.surface_a - pair.surface_b).dot(pair.normal), pair.distance, 1e-12);
    EXPECT_NEAR((pair.surface_a - pair.axis_a).norm(), a.radius, 1e-12);
    EXPECT_NEAR((pair.surface_b - pair.axis_b).norm(), b.radius, 1e-12);
  }
}

TEST(Capsule, DegenerateCasesAreExact) {
  const Vector3 o = Vector3::Zero(), x = Vector3::UnitX(), y = Vector3::UnitY();
  const auto distance = [](const Capsule& a, const Capsule& b) { return closest(a, b).distance; };
  EXPECT_EQ(distance({o, o, 0.1}, {2 * x, 2 * x, 0.2}), 2.0 - (0.1 + 0.2));  // two spheres
  EXPECT_EQ(distance({o, o, 0.0}, {-x + y, x + y, 0.0}), 1.0);               // a point, a segment
  EXPECT_EQ(distance({o, x, 0.0}, {0.25 * x + y, 3 * x + y, 0.0}), 1.0);     // parallel, beside
  EXPECT_EQ(distance({o, x, 0.0}, {3 * x, 2 * x, 0.0}), 1.0);                // on one line, apart
  EXPECT_EQ(distance({o, 2 * x, 0.1}, {x, 3 * x, 0.1}), -0.2);               // on one line, over
  EXPECT_EQ(distance({-x, x, 0.1}, {-y, y, 0.1}), -0.2);                     // crossing
  EXPECT_EQ(distance({o, x, 0.3}, {o, x, 0.3}), -0.6);                       // identical
  EXPECT_EQ(distance({o, o, 0.0}, {o, o, 0.0}), 0.0);                        // one point
}

TEST(Capsule, NormalIsFiniteAndUnitWhereAxesMeet) {
  const Vector3 o = Vector3::Zero(), x = Vector3::UnitX(), y = Vector3::UnitY();
  for (const auto& [a, b] : {std::pair<Capsule, Capsule>{{-x, x, 0.1}, {-y, y, 0.1}},
                             {{o, x, 0.3}, {o, x, 0.3}},
                             {{o, o, 0.1}, {o, o, 0.1}},
                             {{o, o, 0.1}, {-x, x, 0.1}}}) {
    const Vector3 normal = closest(a, b).normal;
    EXPECT_NEAR(normal.norm(), 1.0, 1e-15);
    EXPECT_NEAR(normal.dot(a.end - a.start), 0.0, 1e-15);
    EXPECT_NEAR(normal.dot(b.end - b.start), 0.0, 1e-15);
  }
}

TEST(Capsule, NearlyParallelAxesThatCrossTouch) {
  for (int power = 1; power <= 15; ++power) {
    const double angle = std::pow(10.0, -power);
    // Crossing at 0.3 of the one and 0.7 of the other, off any round number.
    const Vector3 along(1.0, 0.0, 0.0), other(std::cos(angle), std::sin(angle), 0.0);
    const Vector3 cross(0.123, 0.456, 0.789);
    const Capsule a{cross - 0.3 * along, cross + 0.7 * along, 0.0};
    const Capsule b{cross - 0.7 * other, cross + 0.3 * other, 0.0};
    EXPECT_LT(closest(a, b).distance, 1e-15) << "angle " << angle;
  }
}

TEST(Capsule, ClosingSpeedIsMinusTheDerivativeOfDistance) {
  Random random(3);
  constexpr double kStep = 1e-6;
  for (int i = 0; i < 500; ++i) {
    const Capsule a = random_capsule(random), b = random_capsule(random);
    const CapsuleMotion va{random.vector(1.0), random.vector(1.0)};
    const CapsuleMotion vb{random.vector(1.0), random.vector(1.0)};
    const auto moved = [](const Capsule& c, const CapsuleMotion& v, double t) {
      return Capsule{c.start + t * v.start, c.end + t * v.end, c.radius};
    };
    const CapsulePair pair = closest(a, b);
    if ((pair.axis_a - pair.axis_b).norm() < 0.05) continue;  // the derivative has an edge there
    const double after = closest(moved(a, va, kStep), moved(b, vb, kStep)).distance;
    const double before = closest(moved(a, va, -kStep), moved(b, vb, -kStep)).distance;
    EXPECT_NEAR(closing_speed(pair, va, vb), (before - after) / (2.0 * kStep), 1e-4);
  }
}

TEST(Capsule, ApproachSpeedIsPositiveTowardsTheAxis) {
  const Capsule upright{Vector3(1, 0, -1), Vector3(1, 0, 1), 0.2};
  const Vector3 o = Vector3::Zero();
  EXPECT_DOUBLE_EQ(approach_speed(o, Vector3(0.5, 0, 0), upright), 0.5);
  EXPECT_DOUBLE_EQ(approach_speed(o, Vector3(-0.5, 2, 3), upright), -0.5);
  EXPECT_EQ(approach_speed(Vector3(1, 0, 0.3), Vector3(2, 3, 6), upright), 7.0);  // on the axis
}

}  // namespace
}  // namespace proxcgal
