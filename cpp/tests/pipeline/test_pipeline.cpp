#include <gtest/gtest.h>

#include <array>

#include "proxcgal/pipeline/distance.hpp"
#include "proxcgal/pipeline/filter.hpp"
#include "proxcgal/pipeline/sense.hpp"
#include "robots.hpp"

namespace proxcgal {
namespace {

using test::Random;

TEST(RemoveBody, FastAndPaperKeepTheSamePoints) {
  const auto robot = test::arm();
  Posture posture = robot->make_posture();
  Random random(5);
  int removed = 0;
  for (int trial = 0; trial < 20; ++trial) {
    robot->update(test::posture(random, 6), posture);
    const int n = 300;
    const Points origins = test::cloud(random, n, 1.0);
    Points points = test::cloud(random, n, 1.0);
    // Half of them on a link's surface, give or take the tolerance, so that many are body.
    for (int i = 0; i < n; i += 2) {
      const int link = i / 2 % robot->n_links();
      const Points& v = robot->tree(link).vertices_L();
      const Vector3 surface_W =
          posture.T_WL[static_cast<std::size_t>(link)] * Vector3(v.row(i % v.rows()));
      points.row(i) = (surface_W + random.vector(0.02)).transpose();
    }
    std::vector<double> tolerance(n);
    for (double& t : tolerance) t = random.uniform(0.0, 0.06);
    std::unique_ptr<bool[]> fast(new bool[n]), paper(new bool[n]);
    std::fill_n(fast.get(), n, true);
    std::fill_n(paper.get(), n, true);
    remove_body(*robot, posture, origins, points, tolerance, 0.005, Method::kFast, {fast.get(), n});
    remove_body(*robot, posture, origins, points, tolerance, 0.005, Method::kPaper,
                {paper.get(), n});
    for (int i = 0; i < n; ++i) {
      EXPECT_EQ(fast[i], paper[i]);
      removed += fast[i] ? 0 : 1;
    }
  }
  EXPECT_GT(removed, 500);
}

TEST(ClosestPair, FastAndPaperFindTheSameDistance) {
  const auto robot = test::arm();
  Posture posture = robot->make_posture();
  Random random(6);
  for (int trial = 0; trial < 100; ++trial) {
    robot->update(test::posture(random, 6), posture);
    const Points points = test::cloud(random, 1 + trial, 2.0);
    const ClosestPair fast = closest_pair(*robot, posture, points, Method::kFast);
    const ClosestPair paper = closest_pair(*robot, posture, points, Method::kPaper);
    EXPECT_NEAR(fast.distance, paper.distance, 1e-12);
    EXPECT_EQ(fast.link, paper.link);
    EXPECT_EQ(fast.point, paper.point);
    EXPECT_NEAR((fast.surface_W - fast.obstacle_W).norm(), fast.distance, 1e-12);
    std::vector<ClosestPair> each(static_cast<std::size_t>(robot->n_links()));
    closest_pairs(*robot, posture, points, {}, each);
    double nearest = kInfinity;
    for (const ClosestPair& pair : each) nearest = std::min(nearest, pair.distance);
    EXPECT_EQ(nearest, fast.distance);
  }
}

TEST(ClosestPair, OneNanRowDoesNotChangeTheMinimum) {
  const auto robot = test::arm();
  Posture posture = robot->make_posture();
  Random random(7);
  Points points = test::cloud(random, 50, 2.0);
  const double before = closest_pair(*robot, posture, points, Method::kFast).distance;
  Points with_nan(51, 3);
  with_nan << Eigen::RowVector3d::Constant(std::nan("")), points;
  EXPECT_EQ(closest_pair(*robot, posture, with_nan, Method::kFast).distance, before);
}

TEST(RemoveNearSurface, DropsAllThatAlgorithm1Drops) {
  const auto robot = test::arm();
  Posture posture = robot->make_posture();
  Random random(15);
  int removed = 0;
  for (int trial = 0; trial < 100; ++trial) {
    robot->update(test::posture(random, 6), posture);
    constexpr int n = 500;
    const Points origins = test::cloud(random, n, 0.6), points = test::cloud(random, n, 0.6);
    std::vector<double> tolerance(n);
    for (double& t : tolerance) t = random.uniform(0.0, 0.1);
    std::array<bool, n> algorithm1, margin;
    algorithm1.fill(true);
    margin.fill(true);
    remove_body(*robot, posture, origins, points, tolerance, 0.005, Method::kFast, algorithm1);
    remove_near_surface(*robot, posture, points, tolerance, margin);
    for (std::size_t i = 0; i < n; ++i) {
      EXPECT_TRUE(algorithm1[i] || !margin[i]);
      removed += algorithm1[i] ? 0 : 1;
    }
  }
  EXPECT_GT(removed, 100);
}

TEST(ClosestPair, WhereItBeganChangesNothing) {
  const auto robot = test::arm();
  Posture posture = robot->make_posture();
  Random random(16);
  ClosestPair before;
  for (int trial = 0; trial < 300; ++trial) {
    robot->update(test::posture(random, 6), posture);
    const Points points = test::cloud(random, 1 + trial, 2.0);
    const ClosestPair afresh = closest_pair(*robot, posture, points, Method::kFast);
    const ClosestPair found =
        closest_pair(*robot, posture, points, Method::kFast, {.before = before});
    EXPECT_EQ(found.distance, afresh.distance);
    EXPECT_EQ(found.link, afresh.link);
    EXPECT_EQ(found.point, afresh.point);
    const double within = random.uniform(0.0, 2.0 * afresh.distance);
    for (const Method method : {Method::kFast, Method::kPaper}) {
      const ClosestPair near = closest_pair(*robot, posture, points, method, {.within = within});
      EXPECT_EQ(near.found(), afresh.distance < within);
    }
    before = found;
  }
}

TEST(ClosestPair, WithFewStepsTheDistanceIsALowerBoundAndMarked) {
  const auto robot = test::arm();
  Posture posture = robot->make_posture();
  Random random(17);
  int marked = 0;
  for (int trial = 0; trial < 200; ++trial) {
    robot->update(test::posture(random, 6), posture);
    const Points points = test::cloud(random, 500, 1.0);
    const double exact = closest_pair(*robot, posture, points, Method::kFast).distance;
    for (std::int64_t steps : {0, 3, 20, 100, 100'000}) {
      const ClosestPair pair =
          closest_pair(*robot, posture, points, Method::kFast, {.steps = &steps});
      ASSERT_TRUE(pair.found());
      if (pair.lower_bound) {
        EXPECT_LE(pair.distance, exact);
        ++marked;
      } else {
        EXPECT_EQ(pair.distance, exact);
      }
    }
    EXPECT_FALSE(closest_pair(*robot, posture, points, Method::kFast).lower_bound);
  }
  EXPECT_GT(marked, 400);
}

/// Every triangle is as near as any other to a sphere's centre: no box can be left out.
TEST(ClosestPair, TheCentreOfASphereTakesNoMoreThanItsSteps) {
  RobotSpec spec;
  spec.name = "ball";
  spec.joints = {{.name = "joint", .qd_max = 1.0, .qdd_max = 1.0}};
  const auto ball = test::bumpy_sphere(70, 140, 0.2, 0.0);
  spec.links = {
      {.name = "ball", .joint = 0, .vertices_L = ball.vertices, .triangles = ball.triangles}};
  const Robot robot(std::move(spec));
  const Posture posture = robot.make_posture();
  Random random(18);
  const Points points = test::cloud(random, 192'000, 1e-3);
  std::int64_t steps = kSearchSteps;
  const ClosestPair pair = closest_pair(robot, posture, points, Method::kFast, {.steps = &steps});
  EXPECT_LE(steps, 0);
  EXPECT_TRUE(pair.lower_bound);
  EXPECT_LE(pair.distance, 0.2);
  EXPECT_GT(pair.distance, 0.15);  // a bound that says something
  EXPECT_TRUE(pair.surface_W.allFinite());
}

TEST(ClosestPair, AnEmptyCloudHasNone) {
  const auto robot = test::arm();
  const Posture posture = robot->make_posture();
  EXPECT_FALSE(closest_pair(*robot, posture, Points(0, 3), Method::kFast).found());
}

TEST(Sense, AWallReadsTheSameInAllZones) {
  const Sense sense{SensorModel{}};
  for (int zone = 0; zone < kZones; ++zone) EXPECT_EQ(sense.point(zone, 0.7).z(), 0.7);
  // The outermost zone's middle is 3.5 steps of 5.625 degrees from the axis.
  EXPECT_NEAR(sense.point(0, 1.0).x(), std::tan(-3.5 * 5.625 * M_PI / 180), 1e-15);
  EXPECT_NEAR(sense.point(63, 1.0).y(), std::tan(3.5 * 5.625 * M_PI / 180), 1e-15);
}

TEST(Sense, ThePrintedFormErrsBy21MillimetresAtTheEdge) {
  SensorModel printed;
  printed.range_model = RangeModel::kPrinted;
  const double off = Sense{SensorModel{}}.point(7, 1.0).x() - Sense{printed}.point(7, 1.0).x();
  EXPECT_NEAR(off, 0.021, 0.001);
}

TEST(Sense, OnlyTrustedZonesInRangeBecomePoints) {
  const Sense sense{SensorModel{}};
  Scan scan;
  scan.ranges.fill(0.5);
  scan.status.fill(5);
  scan.status[1] = 6;
  scan.status[2] = 9;
  scan.status[3] = 255;
  scan.status[4] = 4;
  scan.status[5] = 77;
  scan.ranges[6] = std::nan("");
  scan.ranges[7] = 0.0;
  scan.ranges[8] = -0.3;
  scan.ranges[9] = kInfinity;
  scan.ranges[10] = 3.0;  // beyond the workspace: cropped, but no fault
  SensedPoints out;
  sense(scan, out);
  EXPECT_EQ(out.invalid, 6);
  EXPECT_EQ(out.first_invalid_zone, 4);
  EXPECT_EQ(out.count, kZones - 8);
  EXPECT_GT(out.sigma[1], out.sigma[0]);
}

}  // namespace
}  // namespace proxcgal
