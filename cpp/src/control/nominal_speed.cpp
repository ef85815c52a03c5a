#include "nominal_speed.hpp"

#include <algorithm>

namespace proxcgal::detail {
namespace {

constexpr double kLongest = 0.5;  // [s] from 1 to 0, also while the arm retreats at speed

}  // namespace

void NominalSpeed::update(Mode mode, double elapsed, double braking) {
  const double target = mode >= Mode::kHold ? 0.0 : mode == Mode::kDegraded ? degraded_ : 1.0;
  if (share_ > target) {
    // In proportion to the joints' own braking: with nothing else to do the arm stops on its path.
    const double slower = braking > elapsed ? share_ * (1.0 - elapsed / braking) : 0.0;
    share_ = std::max(target, std::min(slower, share_ - elapsed / kLongest));
  } else {
    share_ = std::min(target, share_ + elapsed / ramp_);
  }
}

}  // namespace proxcgal::detail
