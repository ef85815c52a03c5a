#include "joint_history.hpp"

#include <algorithm>

namespace proxcgal::detail {

void JointHistory::push(double time, const JointVector& q) {
  time_[count_ % kKept] = time;
  q_[count_ % kKept] = q;
  ++count_;
}

JointVector JointHistory::at(double time) const {
  const std::size_t kept = std::min(count_, kKept);
  if (time >= t(0)) return q(0);
  for (std::size_t back = 1; back < kept; ++back) {
    if (time < t(back)) continue;
    const double span = t(back - 1) - t(back);
    const double part = span > 0.0 ? (time - t(back)) / span : 0.0;
    return q(back) + part * (q(back - 1) - q(back));
  }
  return q(kept - 1);
}

}  // namespace proxcgal::detail
