// Every stage and the whole tick on the cells that inputs.py wrote:
//
//     bench_pipeline CELL.bin ... [--benchmark_filter=tick] [--benchmark_out=FILE]
//
// Cells with one scan of each sensor are for the stages, cells with many for the ticks.
// Names tell stage, question, robot, resolution and size: tick/scans/ur10e_10000_raw/points=1580.
#include "pipeline.hpp"

#include <cstdio>
#include <cstring>

int main(int argc, char** argv) {
  using namespace proxcgal;         // NOLINT(google-build-using-namespace)
  using namespace proxcgal::bench;  // NOLINT(google-build-using-namespace)
  std::vector<Cell> cells;
  std::vector<char*> rest;
  for (int i = 0; i < argc; ++i) {
    const bool is_cell = i > 0 && std::strstr(argv[i], ".bin") != nullptr && argv[i][0] != '-';
    if (!is_cell) {
      rest.push_back(argv[i]);
      continue;
    }
    try {
      cells.push_back(read_cell(argv[i]));
    } catch (const std::exception& error) {
      std::fprintf(stderr, "bench_pipeline: %s\n", error.what());
      return 2;
    }
  }
  if (cells.empty()) {
    std::fputs("bench_pipeline CELL.bin ...: no cell; bench/inputs.py writes them\n", stderr);
    return 2;
  }
  for (const Cell& cell : cells) {
    if (cell.scans.size() > cell.skin.mounts.size()) {
      add_ticks(cell);
    } else {
      add_stages(cell);
      add_worst(cell);
    }
  }
  add_sphere();
  int left = static_cast<int>(rest.size());
  benchmark::Initialize(&left, rest.data());
  if (benchmark::ReportUnrecognizedArguments(left, rest.data())) return 2;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
