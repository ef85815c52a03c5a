#pragma once
#include <string>

#include "cell.hpp"
#include "samples.hpp"

/// The benchmarks of one cell, by what they ask; each function registers its own.
namespace proxcgal::bench {

inline constexpr double kWorstBudget = 66'700.0;  // [us]

inline std::string named(const char* what, const Cell& cell, Eigen::Index points) {
  return std::string(what) + '/' + cell.name + "/points=" + std::to_string(points);
}

template <class Run>
void add(const std::string& name, int iterations, Run run) {
  benchmark::RegisterBenchmark(name.c_str(), run)
      ->UseManualTime()
      ->Iterations(iterations)
      ->Unit(benchmark::kMicrosecond);
}

/// Every stage by itself, and the trees it works on: of a cell with one scan of each sensor.
void add_stages(const Cell& cell);
/// The whole tick: of a cell with many scans of each sensor.
void add_ticks(const Cell& cell);
/// Many points, and points placed where hardly any box can be left out.
void add_worst(const Cell& cell);
/// The worst of all for a distance, on a body of its own.
void add_sphere();

}  // namespace proxcgal::bench
