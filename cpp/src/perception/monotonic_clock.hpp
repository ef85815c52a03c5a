#pragma once
#include <algorithm>
#include <cmath>

namespace proxcgal::detail {

/// The nearest microsecond: durations that are whole ticks stay so, whatever rounding clocks of
/// large numbers add, and compare with bounds in the same way. Of ticks that are no whole
/// microseconds apart a jump may cost one.
/// @param time  [s]
inline double whole_us(double time) { return std::round(time * 1e6) / 1e6; }

/// Advances with the caller's clock, and goes on by the nominal period through its jumps. In whole
/// microseconds.
class MonotonicClock {
 public:
  explicit MonotonicClock(double period) : period_(period) {}

  /// @param caller  [s] the caller's time of this tick
  /// @return        could it be: finite, later than the last, by no more than half a second?
  bool advance(double caller) {
    const double gap = caller - caller_;
    const bool good = std::isfinite(caller) && (!started_ || (gap > 0.0 && gap <= kLongestStep));
    const double before = now_;
    // Never back: through times that were no numbers it went on by itself.
    if (started_) now_ = std::max(before, whole_us(good ? caller - offset_ : now_ + period_));
    const double step = now_ - before;
    const bool early = started_ && step < period_ - kRounding;
    step_ = early ? std::max(step, kShortest * period_) : period_;
    elapsed_ = started_ ? std::max(step, kShortest * period_) : period_;
    if (!std::isfinite(caller)) return false;
    if (!good || !started_) offset_ = caller - now_;
    started_ = true;
    caller_ = caller;
    return good;
  }

  double now() const { return now_; }              ///< [s] 0 at the first tick
  double caller() const { return caller_; }        ///< [s] the last that was finite
  double delay() const { return now_ - caller_; }  ///< [s] added to the caller's stamps
  /// [s] since the last tick, the nominal period at most: what has passed for the joints'
  /// accelerations. By rounding at most 2.5 us more than truly has.
  double step() const { return step_; }
  /// [s] since the last tick, however late this one is.
  double elapsed() const { return elapsed_; }

 private:
  static constexpr double kLongestStep = 0.5;  // [s] a longer one is a clock that jumped
  static constexpr double kRounding = 1.5e-6;  // [s] that whole microseconds may take from a step
  static constexpr double kShortest = 0.02;    // of the period: a clock that crawls still brakes
  double period_;
  double step_ = period_, elapsed_ = period_;
  bool started_ = false;
  double caller_ = 0.0, now_ = 0.0;
  double offset_ = 0.0;  // [s] of the caller's clock at the start, or since its last jump
};

}  // namespace proxcgal::detail
