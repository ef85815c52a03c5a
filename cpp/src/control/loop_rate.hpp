#pragma once
#include <algorithm>

namespace proxcgal::detail {

/// Do ticks come later than they should, on average?
class LoopRate {
 public:
  explicit LoopRate(double period) : period_(period), mean_(period) {}

  /// @param elapsed  [s] since the last tick
  bool slow(double elapsed) {
    mean_ += kShare * (std::min(elapsed, kLongest * period_) - mean_);
    return mean_ > kSlow * period_;
  }

 private:
  static constexpr double kShare = 0.05;   // of a tick in the mean: about 20 ticks
  static constexpr double kLongest = 4.0;  // periods that one tick counts for at most
  static constexpr double kSlow = 1.25;    // periods on average
  double period_, mean_;
};

}  // namespace proxcgal::detail
