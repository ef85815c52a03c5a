#include <gtest/gtest.h>

#include "meshes.hpp"
#include "proxcgal/error.hpp"
#include "proxcgal/geometry/mesh_tree.hpp"
#include "repeats.hpp"

namespace proxcgal {
namespace {

using test::Random;

MeshTree bumpy() {
  const auto mesh = test::bumpy_sphere(40, 60);
  return {mesh.vertices, mesh.triangles};
}

TEST(MeshTree, NearestAgreesWithCgal) {
  const MeshTree tree = bumpy();
  Random random(1);
  const int queries = test::repeats(20'000, 500'000);
  for (int i = 0; i < queries; ++i) {
    const Vector3 p = random.vector(i % 2 == 0 ? 0.3 : 2.0);
    const auto found = tree.nearest(p);
    ASSERT_TRUE(found);
    const double expected = std::sqrt(tree.reference_squared_distance(p));
    EXPECT_NEAR(std::sqrt(found->squared_distance), expected, 1e-12);
    EXPECT_NEAR((found->point_L - p).norm(), expected, 1e-12);
  }
}

TEST(MeshTree, NearestWithinABoundIsTheNearestOrNothing) {
  const MeshTree tree = bumpy();
  Random random(2);
  for (int i = 0; i < 20000; ++i) {
    const Vector3 p = random.vector(0.5);
    const double radius = random.uniform(0.0, 0.4);
    const double expected = std::sqrt(tree.reference_squared_distance(p));
    const auto found = tree.nearest(p, radius * radius);
    EXPECT_EQ(found.has_value(), expected < radius);
    EXPECT_EQ(tree.within(p, radius), expected < radius);
    if (found) {
      EXPECT_NEAR(std::sqrt(found->squared_distance), expected, 1e-12);
    }
  }
}

TEST(MeshTree, FirstHitAgreesWithCgal) {
  const MeshTree tree = bumpy();
  Random random(3);
  int hits = 0;
  const int queries = test::repeats(20'000, 500'000);
  for (int i = 0; i < queries; ++i) {
    const Vector3 origin = random.vector(0.6);
    const Vector3 direction = (random.vector(0.2) - origin).normalized();
    const double expected = tree.reference_first_hit(origin, direction);
    const double found = tree.first_hit(origin, direction);
    if (std::isinf(expected)) {
      EXPECT_TRUE(std::isinf(found));
    } else {
      ++hits;
      EXPECT_NEAR(found, expected, 1e-10);
      EXPECT_TRUE(tree.any_hit(origin, direction, expected - 1e-9, expected + 1e-9));
      EXPECT_FALSE(tree.any_hit(origin, direction, 0.0, expected - 1e-9));
    }
  }
  EXPECT_GT(hits, 5000);
}

TEST(MeshTree, NoRaySlipsThroughAnEdge) {
  const auto mesh = test::box({1.0, 1.0, 1.0});
  const MeshTree tree(mesh.vertices, mesh.triangles);
  // Along every face diagonal, where two triangles meet, and through the vertices.
  for (int i = -50; i <= 50; ++i) {
    const double s = 0.01 * i;
    for (const double t : {s, -s}) {
      EXPECT_NEAR(tree.first_hit({s, t, 2.0}, {0, 0, -1}), 1.5, 1e-12);
      EXPECT_NEAR(tree.first_hit({2.0, s, t}, {-1, 0, 0}), 1.5, 1e-12);
      EXPECT_NEAR(tree.first_hit({s, -2.0, t}, {0, 1, 0}), 1.5, 1e-12);
    }
  }
}

TEST(MeshTree, DistanceOfBoxesIsTheirGap) {
  const auto a = test::box({1.0, 1.0, 1.0}), b = test::box({0.4, 0.4, 0.4});
  const MeshTree tree(a.vertices, a.triangles), other(b.vertices, b.triangles);
  Pose T = Pose::Identity();
  T.translation() = Vector3(1.0, 0.1, -0.05);
  Vector3 here, there;
  EXPECT_NEAR(tree.distance(other, T, kInfinity, &here, &there), 0.3, 1e-12);
  EXPECT_NEAR(here.x(), 0.5, 1e-12);
  EXPECT_NEAR(there.x(), -0.2, 1e-12);
  T.translation() = Vector3(0.6, 0.0, 0.0);
  EXPECT_EQ(tree.distance(other, T), 0.0);  // they cross
  T.translation() = Vector3(1.0, 0.0, 0.0);
  EXPECT_TRUE(std::isinf(tree.distance(other, T, 0.2)));
}

TEST(MeshTree, DistanceOfSurfacesIsNeverMoreThanBetweenTheirPoints) {
  const MeshTree tree = bumpy();
  const auto small = test::bumpy_sphere(8, 10, 0.1, 0.02);
  const MeshTree other(small.vertices, small.triangles);
  Random random(4);
  for (int i = 0; i < 300; ++i) {
    const Pose T = random.pose(0.6);
    Vector3 here, there;
    const double d = tree.distance(other, T, kInfinity, &here, &there);
    double vertices = kInfinity;
    for (Eigen::Index v = 0; v < small.vertices.rows(); ++v) {
      vertices =
          std::min(vertices, tree.nearest(T * Vector3(small.vertices.row(v)))->squared_distance);
    }
    EXPECT_LE(d, std::sqrt(vertices) + 1e-12);
    EXPECT_NEAR((here - T * there).norm(), d, 1e-12);
    EXPECT_NEAR(tree.nearest(here)->squared_distance, 0.0, 1e-18);
    EXPECT_NEAR(other.nearest(there)->squared_distance, 0.0, 1e-18);
    EXPECT_NEAR(other.distance(tree, T.inverse()), d, 1e-12);
  }
}

TEST(MeshTree, ABoundFromBelowIsNeverAboveAndRisesWithItsSteps) {
  const MeshTree tree = bumpy();
  Random random(14);
  for (int i = 0; i < 2000; ++i) {
    const Vector3 p = random.vector(0.5);
    const double squared = tree.reference_squared_distance(p);
    double before = 0.0;
    for (const int steps : {0, 1, 8, 64, 100'000}) {
      const double bound = tree.squared_lower_bound(p, steps);
      EXPECT_LE(bound, squared);
      EXPECT_GE(bound, before);
      before = bound;
    }
  }
}

TEST(MeshTree, InsideIsWhereTheSurfaceIsFartherOut) {
  const MeshTree tree = bumpy();  // star-shaped about its origin
  Random random(26);
  int inside = 0;
  for (int i = 0; i < 5000; ++i) {
    const Vector3 p = random.vector(0.25);
    const double out = tree.first_hit(Vector3::Zero(), p.normalized());
    if (std::abs(out - p.norm()) < 1e-6) continue;
    EXPECT_EQ(tree.inside(p), p.norm() < out);
    inside += tree.inside(p) ? 1 : 0;
  }
  EXPECT_GT(inside, 500);
}

TEST(MeshTree, ASearchWithoutStepsTellsSo) {
  const MeshTree tree = bumpy();
  std::int64_t none = 0, few = 2, enough = 100'000;
  EXPECT_FALSE(tree.nearest(Vector3::Zero(), kInfinity, &none).has_value());
  EXPECT_LT(none, 0);
  tree.nearest(Vector3::Zero(), kInfinity, &few);
  EXPECT_LT(few, 0);
  EXPECT_TRUE(tree.nearest(Vector3::Zero(), kInfinity, &enough).has_value());
  EXPECT_GT(enough, 0);
  std::int64_t spent = 0;
  EXPECT_FALSE(tree.within(Vector3::Zero(), 10.0, &spent));
  EXPECT_LT(spent, 0);
}

TEST(MeshTree, ASideOfAlmostNothingIsNoSide) {
  for (const double height : {1e-38, 1e-40, 1e-42}) {
    Points vertices(64, 3);
    for (int i = 0; i < 64; ++i) vertices.row(i) << i % 8, i / 8, i < 8 ? height : 0.0;
    Triangles triangles(98, 3);
    for (int i = 0, f = 0; i < 49; ++i) {
      const int a = i / 7 * 8 + i % 7;
      triangles.row(f++) << a, a + 1, a + 8;
      triangles.row(f++) << a + 1, a + 9, a + 8;
    }
    const MeshTree tree(vertices, triangles);
    EXPECT_NEAR(tree.nearest(Vector3(3.3, 4.4, 2.0))->squared_distance, 4.0, 1e-12);
  }
  auto far = test::box({1.0, 1.0, 1.0});
  far.vertices(0, 0) = 2e9;
  EXPECT_THROW(MeshTree(far.vertices, far.triangles), GeometryError);
}

/// Each is a little nearer to nothing than the last: the usual splits would peel off one at a time.
TEST(MeshTree, AChainOfEverSmallerStepsIsWalked) {
  constexpr int n = 2000;
  Points vertices(3 * n, 3);
  Triangles triangles(n, 3);
  double y = 1e-8;
  for (int i = 0; i < n; ++i, y *= 0.9375) {
    vertices.row(3 * i) << -1, -y, -1;
    vertices.row(3 * i + 1) << 1, -y, -1;
    vertices.row(3 * i + 2) << 0, -y, 1;
    triangles.row(i) << 3 * i, 3 * i + 1, 3 * i + 2;
  }
  const MeshTree tree(vertices, triangles);
  EXPECT_NEAR(tree.nearest(Vector3(0, 1, 0))->squared_distance, 1.0, 1e-7);
  EXPECT_TRUE(tree.within(Vector3(0, 0.5, 0), 0.6));
  EXPECT_NEAR(tree.first_hit(Vector3(0, 1, 0), Vector3(0, -1, 0)), 1.0, 1e-7);
}

TEST(MeshTree, FacesWithoutAreaAreLeftOutAndCounted) {
  auto mesh = test::box({1.0, 1.0, 1.0});
  mesh.triangles.row(3) << 1, 1, 2;
  const MeshTree tree(mesh.vertices, mesh.triangles);
  EXPECT_EQ(tree.degenerate_triangles(), 1);
  EXPECT_EQ(tree.triangles().rows(), 11);
}

TEST(MeshTree, RefusesWhatNoIndexCanBeBuiltFrom) {
  auto mesh = test::box({1.0, 1.0, 1.0});
  EXPECT_THROW(MeshTree(mesh.vertices, Triangles(0, 3)), GeometryError);
  auto bad = mesh;
  bad.vertices(3, 1) = std::nan("");
  EXPECT_THROW(MeshTree(bad.vertices, bad.triangles), GeometryError);
  bad = mesh;
  bad.triangles(0, 0) = 8;
  EXPECT_THROW(MeshTree(bad.vertices, bad.triangles), GeometryError);
  EXPECT_THROW(MeshTree(mesh.vertices, mesh.triangles.row(0) * 0), GeometryError);
}

TEST(MeshTree, ABoundedSearchBetweenSurfacesIsTheSameOrALowerBound) {
  const MeshTree tree = bumpy();
  const MeshTree other = bumpy();
  Random random(13);
  PairSearch search;
  int cut = 0;
  for (int i = 0; i < 200; ++i) {
    Pose T = random.pose(1.0);
    T.translation() = T.translation().normalized() * random.uniform(0.4, 0.9);
    const double d = tree.distance(other, T);
    search.steps = kSearchSteps;
    Vector3 here, there;
    EXPECT_EQ(tree.distance(other, T, kInfinity, &here, &there, &search), d);
    EXPECT_FALSE(search.lower_bound);
    EXPECT_LT(search.steps, kSearchSteps);
    search.steps = 40;
    const double bound = tree.distance(other, T, kInfinity, &here, &there, &search);
    EXPECT_LE(bound, d + 1e-12);
    const double points = (here - T * there).norm();
    EXPECT_TRUE(std::isnan(points) || points >= d - 1e-9);
    cut += search.lower_bound ? 1 : 0;
  }
  EXPECT_GT(cut, 100);
}

}  // namespace
}  // namespace proxcgal
