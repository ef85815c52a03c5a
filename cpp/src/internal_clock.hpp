#pragma once
#include <algorithm>
#include <cmath>

namespace proxcgal::detail {

/// Advances with the caller's clock, and goes on by the nominal period through its jumps.
class InternalClock {
 public:
  explicit InternalClock(double period) : period_(period) {}

  /// @param caller  [s] the caller's time of this tick
  /// @return        could it be: finite, later than the last, by no more than half a second?
  bool advance(double caller) {
    const double step = caller - caller_;
    const bool good = std::isfinite(caller) && (!started_ || (step > 0.0 && step <= kLongestStep));
    if (started_) now_ += good ? step : period_;
    const bool early = started_ && good && step < (1.0 - kRounding) * period_;
    step_ = early ? std::max(step, kShortest * period_) : period_;
    if (!std::isfinite(caller)) return false;
    started_ = true;
    caller_ = caller;
    return good;
  }

  double now() const { return now_; }              ///< [s] 0 at the first tick
  double caller() const { return caller_; }        ///< [s] the last that was finite
  double delay() const { return now_ - caller_; }  ///< [s] added to the caller's stamps
  /// [s] since the last tick, the nominal period at most: what has passed for the joints'
  /// accelerations.
  double step() const { return step_; }

 private:
  static constexpr double kLongestStep = 0.5;  // [s] a longer one is a clock that jumped
  static constexpr double kRounding = 1e-6;    // of the period; what is left of sums of it
  static constexpr double kShortest = 0.02;    // of the period: a clock that crawls still brakes
  double period_;
  double step_ = period_;
  bool started_ = false;
  double caller_ = 0.0, now_ = 0.0;
};

}  // namespace proxcgal::detail
