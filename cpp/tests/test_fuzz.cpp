/// The fuzz targets over random inputs, the same ones every time: their short form.
#include <gtest/gtest.h>

#include <random>

#include "fuzz/mesh.hpp"
#include "fuzz/tick.hpp"
#include "repeats.hpp"

namespace proxcgal {
namespace {

using Input = std::vector<std::uint8_t>;

Input random_input(std::mt19937_64& engine, std::size_t least, std::size_t most) {
  Input input(least + engine() % (most - least));
  for (std::uint8_t& byte : input) byte = static_cast<std::uint8_t>(engine() >> 24U);
  return input;
}

TEST(Fuzz, TwentyThousandRandomTicksKeepEveryPromise) {
  std::mt19937_64 engine(1);
  int ticks = 0, usable = 0, inside = 0;
  const int enough = test::repeats(20'000, 1'000'000);
  while (ticks < enough) {
    const Input input = random_input(engine, 500, 2000);
    const fuzz::TickRun run = fuzz::run_ticks(input.data(), input.size());
    ASSERT_EQ(run.violation, "") << "after " << ticks << " ticks";
    ticks += run.ticks;
    usable += run.counts.usable;
    inside += run.counts.inside;
  }
  // Most of them would tell nothing if they were refused, or far from everything.
  EXPECT_GT(usable, ticks / 3);
  EXPECT_GT(inside, ticks / 20);
}

TEST(Fuzz, RandomMeshesAnswerAsBruteForceDoes) {
  std::mt19937_64 engine(2);
  int refused = 0, queries = 0;
  constexpr int meshes = 2000;
  for (int i = 0; i < meshes; ++i) {
    const Input input = random_input(engine, 50, 1000);
    const fuzz::MeshRun run = fuzz::run_mesh(input.data(), input.size());
    ASSERT_EQ(run.violation, "") << "mesh " << i;
    refused += run.refused ? 1 : 0;
    queries += run.queries;
  }
  EXPECT_GT(queries, 5 * meshes);
  EXPECT_GT(refused, meshes / 10);
}

}  // namespace
}  // namespace proxcgal
