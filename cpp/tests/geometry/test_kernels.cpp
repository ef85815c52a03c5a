#include <gtest/gtest.h>

#include <bit>

#include "geometry/kernels.hpp"
#include "meshes.hpp"

namespace proxcgal::detail {
namespace {

using test::Random;

/// The tree's own members hide the view that the kernels take: the same queries, by both sets.
class EverySetOfInstructions : public ::testing::Test {
 protected:
  const test::Mesh mesh = test::bumpy_sphere(40, 60);
  const Bvh bvh{mesh.vertices, mesh.triangles};
  const Kernels& best = kernels();
  Random random{19};
  void SetUp() override {
    if (best.name == kPortableKernels.name) GTEST_SKIP() << "only the portable kernels run here";
  }
};

std::uint64_t bits_of(double x) { return std::bit_cast<std::uint64_t>(x); }

TEST_F(EverySetOfInstructions, FindsTheSameNearestPointToTheBit) {
  for (int i = 0; i < 20000; ++i) {
    const Vector3 p = random.vector(0.5);
    Nearest a, b;
    a.squared = b.squared = i % 2 == 0 ? kInfinity : random.uniform(0.0, 0.1);
    std::int64_t steps_a = 1'000'000, steps_b = steps_a;
    best.nearest(bvh.view(), p.data(), a, steps_a);
    kPortableKernels.nearest(bvh.view(), p.data(), b, steps_b);
    EXPECT_EQ(bits_of(a.squared), bits_of(b.squared));
    EXPECT_EQ(a.triangle, b.triangle);
    EXPECT_EQ(steps_a, steps_b);
    for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(bits_of(a.point[k]), bits_of(b.point[k]));
  }
}

TEST_F(EverySetOfInstructions, FindsTheSameHitToTheBit) {
  for (int i = 0; i < 20000; ++i) {
    const Vector3 origin = random.vector(0.6);
    const Vector3 direction = (random.vector(0.2) - origin).normalized();
    EXPECT_EQ(bits_of(best.first_hit(bvh.view(), origin.data(), direction.data(), 0.0, kInfinity)),
              bits_of(kPortableKernels.first_hit(bvh.view(), origin.data(), direction.data(), 0.0,
                                                 kInfinity)));
  }
}

TEST_F(EverySetOfInstructions, GivesTheSameBoundsAndAnswers) {
  for (int i = 0; i < 20000; ++i) {
    const Vector3 p = random.vector(0.5);
    const int steps = i % 100;
    EXPECT_EQ(bits_of(best.squared_lower_bound(bvh.view(), p.data(), steps)),
              bits_of(kPortableKernels.squared_lower_bound(bvh.view(), p.data(), steps)));
    std::int64_t steps_a = 1'000'000, steps_b = steps_a;
    const double squared = random.uniform(0.0, 0.1);
    EXPECT_EQ(best.within(bvh.view(), p.data(), squared, steps_a),
              kPortableKernels.within(bvh.view(), p.data(), squared, steps_b));
    EXPECT_EQ(steps_a, steps_b);
    const Vector3 direction = (random.vector(0.2) - p).normalized();
    EXPECT_EQ(bits_of(best.any_hit(bvh.view(), p.data(), direction.data(), 0.0, 1.0)),
              bits_of(kPortableKernels.any_hit(bvh.view(), p.data(), direction.data(), 0.0, 1.0)));
  }
}

TEST_F(EverySetOfInstructions, SortsOutTheSameRows) {
  for (int i = 0; i < 2000; ++i) {
    ChunkView chunk;
    chunk.count = 1 + i % kChunk;
    for (auto& row : chunk.p_W) {
      for (float& x : row) x = static_cast<float>(random.uniform(-1.0, 1.0));
    }
    LinkBoxView box;
    const Pose T = random.pose(0.5);
    for (int k = 0; k < 3; ++k) {
      for (int j = 0; j < 3; ++j) box.R_LW[k][j] = static_cast<float>(T.linear()(k, j));
      box.offset[k] = static_cast<float>(T.translation()[k]);
      box.half[k] = 0.2F;
    }
    float limits[kChunk];
    for (float& limit : limits) limit = static_cast<float>(random.uniform(0.0, 0.5));
    std::uint8_t rows_a[kChunk], rows_b[kChunk];
    const int n = best.near_rows(chunk, box, 1e-6F, limits, rows_a);
    ASSERT_EQ(n, kPortableKernels.near_rows(chunk, box, 1e-6F, limits, rows_b));
    for (int row = 0; row < n; ++row) EXPECT_EQ(rows_a[row], rows_b[row]);
  }
}

}  // namespace
}  // namespace proxcgal::detail
