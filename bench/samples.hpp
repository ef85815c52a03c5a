#pragma once
#include <benchmark/benchmark.h>
#include <time.h>

#include <algorithm>
#include <vector>

namespace proxcgal::bench {

/// Thread CPU time of each iteration: what other programs do on the machine counts least there.
class Samples {
 public:
  static double cpu_us() {
    timespec now{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return 1e6 * static_cast<double>(now.tv_sec) + 1e-3 * static_cast<double>(now.tv_nsec);
  }

  /// One timed call.
  template <class Work>
  void take(benchmark::State& state, Work&& work) {
    const double begin = cpu_us();
    work();
    const double took = cpu_us() - begin;
    us_.push_back(took);
    state.SetIterationTime(1e-6 * took);
  }

  /// Median, p99, p99.9 and worst as counters [us], beside the budget where there is one.
  void report(benchmark::State& state, double budget_us = 0.0) {
    std::sort(us_.begin(), us_.end());
    const auto at = [&](double share) {
      return us_[std::min(us_.size() - 1, static_cast<std::size_t>(share * double(us_.size())))];
    };
    state.counters["median_us"] = at(0.5);
    state.counters["p99_us"] = at(0.99);
    state.counters["p99.9_us"] = at(0.999);
    state.counters["max_us"] = us_.back();
    if (budget_us > 0.0) state.counters["budget_us"] = budget_us;
  }

 private:
  std::vector<double> us_;
};

}  // namespace proxcgal::bench
