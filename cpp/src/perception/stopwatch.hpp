#pragma once
#include <chrono>

namespace proxcgal::detail {

/// Steady clock for `out.timings`; where it is off it reads nothing. No decision depends on it.
class Stopwatch {
 public:
  explicit Stopwatch(bool on) : on_(on), start_(on ? Clock::now() : Clock::time_point{}) {}
  double lap_us() {
    if (!on_) return 0.0;
    const auto now = Clock::now();
    const std::chrono::duration<double, std::micro> lap = now - start_;
    start_ = now;
    return lap.count();
  }

 private:
  using Clock = std::chrono::steady_clock;
  bool on_;
  Clock::time_point start_;
};

}  // namespace proxcgal::detail
